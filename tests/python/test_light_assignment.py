# SPDX-License-Identifier: Apache-2.0
"""The street's 512 lights: the same picture by every technique of light_assignment, and how much work each saves."""

import pathlib

import numpy as np

from heddle.__main__ import load_scene

STREET = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "scenes" / "street.py"
# What costs time and meets no light is left out.
PLAIN = ["ao.technique=none", "contact.technique=none", "shadow.technique=none", "sky.technique=none",
         "material.technique=none", "lighting.params.precision=float32", "output=lighting.radiance"]
VARIANTS = {
    "none": ["light_assignment.technique=none"],
    "brute_force": ["light_assignment.technique=brute_force"],
    **{f"tiled, {tile} px, {steps} steps": [f"light_assignment.params.tile={tile}", f"light_assignment.params.steps={steps}"]
       for tile, steps in ((32, 2), (16, 0), (16, 2), (16, 16), (8, 2))},
}


def test_the_street_is_the_same_picture_with_a_fraction_of_the_work(host):
    """Prints the table of light_assignment/tiled's README: pytest -s."""
    pictures, met, reaching = {}, {}, {}
    with host.scene() as scene:
        load_scene(scene, str(STREET))
        for name, settings in VARIANTS.items():
            with host.graph("tiled", ["extent=[160,90]", *PLAIN, *settings]) as graph:
                graph.keep("light_count.count")
                graph.render(scene)
                pictures[name] = graph.read().tobytes()
                count = graph.read("light_count.count")
                surface = np.isfinite(count[..., 0]) & (count[..., 0] > 0)
                met[name], reaching[name] = count[..., 0][surface], count[..., 1]
    print("\n| technique | lights met, mean | 99 % of pixels | most |\n|---|---|---|---|")
    for name, lights in met.items():
        print(f"| {name} | {lights.mean():.1f} | {np.percentile(lights, 99):.0f} | {lights.max():.0f} |")
    print(f"| (reach the pixel) | {reaching['none'][reaching['none'] > 0].mean():.1f} | | {reaching['none'].max():.0f} |")
    for name in VARIANTS:
        assert pictures[name] == pictures["none"], name
        assert (reaching[name] == reaching["none"]).all(), f"{name} loses a light"
    assert (met["none"] == 512).all()
    assert met["tiled, 16 px, 2 steps"].mean() < 512 / 10
    assert met["tiled, 8 px, 2 steps"].mean() < met["tiled, 16 px, 2 steps"].mean() < met["tiled, 32 px, 2 steps"].mean()
    assert met["tiled, 16 px, 16 steps"].mean() <= met["tiled, 16 px, 2 steps"].mean() < met["tiled, 16 px, 0 steps"].mean()
