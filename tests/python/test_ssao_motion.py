# SPDX-License-Identifier: Apache-2.0
"""ambient_occlusion/ssao where occluders leave the image, and where they are too thin to be seen: nothing pops, flickers
or is no number."""

import numpy as np
import pytest

import heddle

GRAPH = """extent = [96, 64]
output = "ao.visibility"
[[pass]]
name = "gbuffer"
role = "gbuffer"
technique = "raster"
params.precision = "float32"
[[pass]]
name = "ao"
role = "ambient_occlusion"
technique = "ssao"
"""
ANGLE, DISTANCE = 0.8, 4.0
METRES_PER_PIXEL = 2 * DISTANCE * np.tan(ANGLE / 2) / 64  # at that distance


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """frames(n, move) -> visibility of n frames of a floor with what `move(scene)` adds, moved by what it returns."""
    file = tmp_path_factory.mktemp("ssao") / "graph.toml"
    file.write_text(GRAPH)
    with heddle.Host() as host, host.graph(file) as graph:
        def body(count, build):
            with host.scene() as scene:
                floor = scene.mesh([[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]], scene.material(),
                                   indices=[0, 1, 2, 0, 2, 3], normals=[[0, 1, 0]] * 4)
                scene.instance(floor)
                move = build(scene)
                seen = []
                for frame in range(count):
                    move(frame)
                    graph.render(scene, cut=frame == 0)
                    seen.append(graph.read()[..., 0].astype(np.float64))
                return np.array(seen)
        yield body


def box(scene, low, high):
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    positions = np.concatenate([corners[list(face)] for face in faces])
    indices = [[4 * i + a, 4 * i + b, 4 * i + c] for i in range(6) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    return scene.mesh(positions, scene.material(), indices=indices)


def test_an_occluder_that_leaves_the_image_leaves_no_step(frames):
    # A box goes over the right border, a pixel a frame, and the floor beside it opens.
    def build(scene):
        moved = scene.instance(box(scene, (-0.25, 0, -0.25), (0.25, 0.5, 0.25)))
        scene.camera((0, DISTANCE, 0), (0, 0, 0), vertical_angle=ANGLE, up=(0, 0, -1))
        border = 48 * METRES_PER_PIXEL

        def move(frame):
            matrix = np.eye(4)
            matrix[0, 3] = border - 0.4 + frame * METRES_PER_PIXEL
            scene.move(moved, matrix)
        return move

    seen = frames(24, build)
    floor = seen[:, :, 56:78]  # beside the box, which begins farther to the right
    assert np.isfinite(seen).all() and seen[-1].min() > 0.97, "when it is gone, nothing is dark"
    steps = np.abs(np.diff(floor, axis=0))
    print(f"darkest {floor.min():.3f}; greatest step of a pixel {steps.max():.4f}, of the floor's mean "
          f"{np.abs(np.diff(floor.mean((1, 2)))).max():.5f}")
    # 16 points, of which the blur of 7 x 7 pixels averages at least four: a point that loses its occluder is 1/64.
    assert steps.max() < 4 / 64
    assert np.abs(np.diff(floor.mean((1, 2)))).max() < 1 / 64


def test_a_wall_seen_edge_on_neither_flickers_nor_is_no_number(frames):
    # A sheet without thickness that stands in the line of sight, while the camera goes from side to side: at times a sliver shows.
    def build(scene):
        sheet = scene.mesh([[0, 0, -0.5], [0, 1, -0.5], [0, 1, 0.5], [0, 0, 0.5]], scene.material(double_sided=True),
                           indices=[0, 1, 2, 0, 2, 3])
        scene.instance(sheet)

        def move(frame):
            x = 1.5 * METRES_PER_PIXEL * np.sin(2.4 * frame)
            scene.camera((x, DISTANCE, 0), (x, 0, 0), vertical_angle=ANGLE, up=(0, 0, -1))
        return move

    seen = frames(16, build)
    assert np.isfinite(seen).all() and seen.min() >= 0 and seen.max() <= 1
    # Where the sliver itself comes and goes another surface is seen: three pixels, its shadow's blur three more.
    wander = np.delete(seen.std(0), slice(42, 54), axis=1)
    print(f"mean {seen.mean():.4f}, darkest {seen.min():.3f}; standard deviation of a pixel: worst {wander.max():.4f}, "
          f"mean {wander.mean():.5f}")
    # What the image does not show does not occlude: the floor on both sides stays open (a limit that its README names).
    assert seen.mean() > 0.98
    assert wander.max() < 0.05 and wander.mean() < 0.002


def test_work_in_close_ups_is_bounded_by_the_limiter(frames):
    """From 4 m to 5 cm over the floor with a box beside: numbers stay in range and the radius on the screen is cut."""
    def build(scene):
        scene.instance(box(scene, (0.1, 0, -0.2), (0.5, 0.5, 0.2)))
        heights = np.geomspace(4, 0.05, 10)

        def move(frame):
            scene.camera((0, heights[frame], 0), (0, 0, 0), vertical_angle=ANGLE, up=(0, 0, -1), near=0.01)
        return move

    seen = frames(10, build)
    assert np.isfinite(seen).all() and seen.min() >= 0 and seen.max() <= 1
    assert seen[-1].mean() > 0.9
