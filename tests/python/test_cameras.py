# SPDX-License-Identifier: Apache-2.0
"""Cameras that Python makes."""

import numpy as np
import pytest

import heddle

SIDE = 64  # pixels


def square_scene(scene, half, distance):
    """A square of `half` metres to each side, straight before a camera at the origin."""
    z = -distance
    corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]
    scene.instance(scene.mesh(corners, scene.material(), indices=[0, 1, 2, 0, 2, 3]))


def covered_rows(graph, scene):
    """Pixels of the middle column that show the square."""
    graph.render(scene)
    return int(np.isfinite(graph.read("gbuffer.depth")[:, SIDE // 2, 0]).sum())


@pytest.mark.parametrize("distance", [2.0, 20.0])
def test_an_orthographic_camera_shows_a_thing_as_large_at_every_distance(distance):
    """half / orthographic_half_height of the picture's height; no edge falls on a pixel's middle."""
    with heddle.Host() as host, host.scene() as scene, host.graph("deferred", [f"extent=[{SIDE},{SIDE}]"]) as graph:
        graph.keep("gbuffer.depth")
        square_scene(scene, 1.0, distance)
        camera = scene.camera((0, 0, 0), (0, 0, -1), orthographic_half_height=2.0)
        assert covered_rows(graph, scene) == SIDE // 2
        scene.move_camera(camera, (0, 0, 0), (0, 0, -1), orthographic_half_height=8.0)
        assert covered_rows(graph, scene) == SIDE // 8
        scene.move_camera(camera, (0, 0, 0), (0, 0, -1), vertical_angle=2 * np.arctan(2 / distance))
        assert covered_rows(graph, scene) == SIDE // 2  # in perspective it depends on the distance


@pytest.mark.parametrize("half_height", [0.0, -1.0, float("nan"), float("inf")])
def test_an_orthographic_camera_has_a_height(half_height):
    with heddle.Host() as host, host.scene() as scene:
        with pytest.raises(heddle.Error, match="orthographic_half_height is .*\\n  expected: metres, above 0, or None"):
            scene.camera((0, 0, 0), (0, 0, -1), orthographic_half_height=half_height)
