# SPDX-License-Identifier: Apache-2.0
"""A scene a thousand times as large or as small, with its camera: the same picture, though nobody states near planes or how
far shadows reach. Lengths that are looks (radius of occlusion, contact shadows) are the graph's and scaled by hand."""

import numpy as np
import pytest

import heddle
from heddle.shapes import box

SCALES = (1e-3, 1.0, 1e3)
# Positions are float32 and scales no powers of two: a few edges of 64 x 48 pixels fall on the other side of a centre or of
# a shadow's texel. Elsewhere there are only rounding errors, of a code of 8 bits.
DIFFERENT_PIXELS = 0.01
ONE_CODE = 1.5 / 255


def fill(scene, scale, near=0.0):
    """A pillar and a board on a floor, before a wall; the sun is the sky's."""
    plaster = scene.material(base_color=(0.8, 0.7, 0.6), roughness=0.7)
    paint = scene.material(base_color=(0.2, 0.4, 0.7), roughness=0.5, double_sided=True)
    scaled = np.diag([scale, scale, scale, 1.0])
    for shape, material in ((box((6, 0.2, 6), (0, -0.1, 0)), plaster),
                            (box((6, 3, 0.2), (0, 1.5, -3.1)), plaster),
                            (box((0.6, 2, 0.6), (-0.3, 1, 0)), paint),
                            (box((1.2, 0.1, 2), (1.2, 0.05, 0)), paint)):
        scene.instance(scene.mesh(**shape, material=material), scaled)
    eye, target = np.array((2.5, 2.2, 4.5)), np.array((0, 0.8, 0))
    return scene.camera(scale * eye, scale * target, vertical_angle=0.8, near=near)


def picture(graph_name, scale, settings=(), near=0.0, log=None):
    looks = [f"params.ao_radius={0.5 * scale}", f"contact.params.distance={0.3 * scale}"]
    given = {} if log is None else {"log": lambda level, text: log.append(text)}
    with heddle.Host(**given) as host, host.scene() as scene:
        fill(scene, scale, near)
        with host.graph(graph_name, ["extent=[64,48]", *looks, *settings]) as graph:
            graph.render(scene)
            return graph.read()[..., :3]


@pytest.mark.parametrize("technique", ["shadow_map", "cascaded"])
def test_a_thousand_times_as_large_or_small_is_the_same_picture(technique):
    settings = [f"shadow.technique={technique}"]
    small, usual, large = (picture("deferred", scale, settings) for scale in SCALES)
    unshadowed = picture("deferred", 1.0, ["shadow.technique=none"])
    in_shadow = np.abs(usual - unshadowed).max(-1) > 0.1
    assert in_shadow.mean() > 0.03  # the sun throws shadows that are to be found again
    for scaled in (small, large):
        difference = np.abs(scaled - usual).max(-1)
        assert (difference > ONE_CODE).mean() <= DIFFERENT_PIXELS
        assert difference[in_shadow].mean() < 0.01


def test_baked_occlusion_keeps_the_suns_shadow_at_any_size():
    def baked(scale):
        return picture("baked_ao", scale, [f"bake_occlusion.toml#bake.params.spacing={0.5 * scale}",
                                           "bake_occlusion.toml#bake.params.directions=32",
                                           f"contact.params.distance={0.3 * scale}"])
    small, usual, large = (baked(scale) for scale in SCALES)
    for scaled in (small, large):
        assert (np.abs(scaled - usual).max(-1) > ONE_CODE).mean() <= DIFFERENT_PIXELS


def test_a_near_plane_behind_the_whole_scene_is_told():
    log = []
    cut = picture("deferred", 1e-3, near=0.05, log=log)
    told = [text for text in log if "near plane" in text]
    assert told == ["warning: nothing of the scene can be seen: the camera's near plane, at 0.05 m, is farther than all of it"
                    " (0.00976 m)\n  help:     leave near_distance 0: it then follows from the scene's size"]
    assert np.abs(cut - picture("deferred", 1e-3)).max() > 0.1
