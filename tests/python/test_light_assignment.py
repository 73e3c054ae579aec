# SPDX-License-Identifier: Apache-2.0
"""The street's 512 lights: the same picture by every technique of light_assignment, and how much work each saves."""

import pathlib

import numpy as np
import pytest

import heddle
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


MOST_LIGHTS = 65535 // 3  # lavapipe grants an invocation so many loop iterations, and a light out of reach takes three


def lights_before_a_wall(scene, count):
    """One of them shines on the wall: the last one."""
    white = scene.material(base_color=(0.8, 0.8, 0.8))
    scene.instance(scene.mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], white, indices=[0, 1, 2, 0, 2, 3]))
    scene.camera((0, 0, 1), (0, 0, 0))
    for _ in range(count - 1):
        scene.light("point", (1, 1, 1), position=(0, 0, 500), range=0.1, casts_shadow=False)
    scene.light("point", (1000, 1000, 1000), position=(0, 0, 1), range=5, casts_shadow=False)


@pytest.mark.parametrize("technique", ["deferred", "forward"])
def test_more_lights_than_a_shader_may_meet_are_an_error_and_not_darkness(host, technique):
    if not host.devices()[0]["name"].startswith("llvmpipe"):
        pytest.skip("only lavapipe ends loops")
    settings = [setting for setting in PLAIN if not setting.startswith("material")] + [f"lighting.technique={technique}"]
    none = ["extent=[8,8]", *settings, "light_assignment.technique=none"]
    with host.scene() as scene, host.graph("tiled", none) as graph:
        lights_before_a_wall(scene, MOST_LIGHTS)
        graph.render(scene)
        lit = graph.read()
        assert (lit[..., :3] > 1).all()  # the very last is still there
        scene.light("point", (1, 1, 1), position=(0, 0, 500), range=0.1, casts_shadow=False)
        with pytest.raises(heddle.Error) as raised:
            graph.render(scene)
        assert raised.value.status == 3
        assert (f"pass 'lighting' (lighting/{technique}): there are 21846 lights, each pixel goes through all of them in 3 "
                "loop iterations each, and this driver ends a shader's loops after 65535: lights behind the first 21845 would "
                "be left out; add a pass of role light_assignment above, of technique tiled") in str(raised.value)
        graph.set("light_assignment.technique=tiled")
        graph.render(scene)
        assert graph.read().tobytes() == lit.tobytes()
