# SPDX-License-Identifier: Apache-2.0
"""Drawings that are sorted for blending leave out what their view cannot see, and touch no other byte."""

import numpy as np
import pytest

import heddle

ORDERS = ["unsorted", "instances", "triangles"]


def fill(scene):
    """Panes around the camera, of which it sees a few and some in part; 900 km from the scene's origin."""
    glass = scene.material(base_color=(0.9, 0.3, 0.2, 0.4), alpha_mode="blend", double_sided=True)
    pane = scene.mesh([[-0.7, -0.7, 0], [0.7, -0.7, 0.2], [0.7, 0.7, 0], [-0.7, 0.7, -0.2]], glass, indices=[0, 1, 2, 0, 2, 3])
    far = np.array([9e5, -3e5, 2e5])
    for angle in np.arange(0, 2 * np.pi, 0.21):
        for distance in (2.0, 4.5):
            matrix = np.eye(4)
            matrix[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
            matrix[:3, 3] = far + distance * np.array([np.sin(angle), 0.3 * np.sin(5 * angle), np.cos(angle)])
            scene.instance(pane, matrix)
    scene.light("directional", (3, 3, 3), direction=(0.4, -1, 0.3))
    scene.camera(far, far + (0, 0, -1), vertical_angle=0.8)


@pytest.mark.parametrize("order", ORDERS)
def test_sorted_drawings_leave_out_what_cannot_be_seen(order):
    with heddle.Host(check=True) as host, host.scene() as scene:
        fill(scene)
        with host.graph("deferred", ["extent=[64,40]", "ao.technique=none", f"transparency.params.order={order}"]) as graph:
            graph.render(scene)
            instances = graph.stats()["instances"]
            # 60 panes, a third of the horizon; each is drawn once, by the one pass that draws what is blended.
            assert instances["culled"] > 30 and instances["drawn"] > 8
            assert graph.read()[..., :3].std() > 0.01
            graph.check(scene, 1)  # one of its runs draws everything, and bytes must agree


def test_what_is_sorted_is_less_work():
    """Triangles are sorted on the CPU and brought to the device: only those of instances that are seen."""
    uploaded = {}
    for is_behind in (False, True):
        with heddle.Host() as host, host.scene() as scene:
            glass = scene.material(base_color=(1, 1, 1, 0.5), alpha_mode="blend")
            side = 40
            x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
            corners = np.arange(side * side).reshape(side, side)
            quads = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], -1).reshape(-1, 4)
            sheet = scene.mesh(np.stack([x, y, 0 * x], -1).reshape(-1, 3), glass, indices=quads[:, [0, 1, 2, 0, 2, 3]])
            scene.instance(sheet)
            matrix = np.eye(4)
            matrix[2, 3] = 9.0 if is_behind else -1.0
            scene.instance(sheet, matrix)
            scene.camera((0, 0, 3), (0, 0, 0))
            with host.graph("studio", ["extent=[32,24]"]) as graph:
                graph.render(scene)
                graph.render(scene, cut=True)  # the first frame uploads the scene too
                stats = graph.stats()
                uploaded[is_behind] = stats["counters"]["uploaded_bytes"]
                assert stats["instances"]["culled"] > 0 if is_behind else stats["instances"]["culled"] == 0
    indices = 6 * 39 * 39 * 4  # bytes of one sheet's
    assert uploaded[False] - uploaded[True] == indices


def test_a_moving_camera_costs_no_submission_of_its_own(host):
    """Records of instances are relative to the camera, so all of them change with it; they go with the frame's commands."""
    with host.scene() as scene, host.graph("studio", ["extent=[32,24]"]) as graph:
        scene.instance(scene.mesh([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], scene.material()))
        submits = []
        for frame in range(4):
            scene.camera((0, 3 + 0.1 * frame, 1), (0, 0, 0))
            graph.render(scene)
            submits.append(graph.stats()["counters"]["submits"])
        graph.render(scene)  # nothing moves
        assert submits[1:] == [graph.stats()["counters"]["submits"]] * 3
