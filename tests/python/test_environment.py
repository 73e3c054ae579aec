# SPDX-License-Identifier: Apache-2.0
"""Images as environments from Python and from the command: which way they face, their brightness, what is refused."""

import math
import subprocess

import numpy as np
import pytest

import heddle

SMALL = ["extent=[64,48]"]


def patch_towards(column, width=64, height=32):
    """Grey of 0.05 with a patch of orange on the horizon, around a column."""
    pixels = np.full((height, width, 3), 0.05, np.float32)
    columns = np.arange(column - 4, column + 4) % width
    pixels[height // 2 - 4:height // 2 + 4, columns] = (1.0, 0.2, 0.1)
    return pixels


def looking(scene, forward):
    """A camera at the origin, along a horizontal axis."""
    scene.camera((0, 0, 0), forward, vertical_angle=1.0)


def radiance(graph, scene):
    graph.render(scene, cut=True)
    return graph.read("lighting.radiance")[..., :3]


@pytest.fixture
def empty(host):
    with host.scene() as scene:
        triangle = scene.mesh([[0, -900, 0], [1, -900, 0], [0, -900, 1]], scene.material())  # out of sight
        scene.instance(triangle)
        yield scene


# -Z is in the image's middle, +X to the right of it, +Z at both ends.
@pytest.mark.parametrize("column, forward", [(32, (0, 0, -1)), (48, (1, 0, 0)), (0, (0, 0, 1)), (16, (-1, 0, 0))])
def test_each_axis_shows_its_part_of_the_image(host, empty, column, forward):
    looking(empty, forward)
    empty.set_environment(patch_towards(column), scale=3.0)
    with host.graph("environment", SMALL) as graph:
        graph.keep("lighting.radiance")
        image = radiance(graph, empty)
    np.testing.assert_allclose(image[24, 32], [3.0, 0.6, 0.3], rtol=2e-3)
    np.testing.assert_allclose(image[2, 2], [0.15, 0.15, 0.15], rtol=2e-3)


def test_what_is_to_the_right_in_the_image_is_to_the_right_in_the_picture(host, empty):
    looking(empty, (0, 0, -1))
    empty.set_environment(patch_towards(36))  # 22.5 degrees from -Z towards +X
    with host.graph("environment", SMALL) as graph:
        graph.keep("lighting.radiance")
        image = radiance(graph, empty)
        assert image[24, 32:].max() > 0.9 and image[24, :28].max() < 0.1
        # Turned about +Y by a positive angle, -Z goes to -X: to the left.
        empty.set_environment(patch_towards(36), angle=math.pi / 4)
        image = radiance(graph, empty)
        assert image[24, :32].max() > 0.9 and image[24, 36:].max() < 0.1
        empty.set_environment(patch_towards(36), rotation=(0, math.sin(math.pi / 8), 0, math.cos(math.pi / 8)))
        np.testing.assert_allclose(radiance(graph, empty), image, rtol=1e-5)
        empty.set_environment(None)
        assert radiance(graph, empty).max() == 0.0


def test_environments_of_wrong_shape_or_value_are_refused(host, empty):
    with pytest.raises(heddle.Error) as caught:
        empty.set_environment(np.ones((2, 2, 2, 2), np.float32))
    assert str(caught.value) == "error: the environment has shape (2, 2, 2, 2): expected (height, width, 1, 3 or 4)"
    with pytest.raises(heddle.Error) as caught:
        empty.set_environment(np.full((2, 4), -1.0, np.float32))
    assert str(caught.value) == "error: the environment's texel 0, 0 is -1: expected radiance, finite and not negative"


def test_the_command_and_python_light_by_the_same_file(host, root, command, tmp_path):
    file = tmp_path / "sky.hdr"
    host.write_image(str(file), patch_towards(40, 128, 64))
    scene = root / "scripts" / "scenes" / "material_grid.py"
    arguments = ["run", str(scene), "--environment", str(file), "--environment-scale", "2", "--environment-rotation", "0.5",
                 "--set", "extent=[64,48]", "--quiet"]
    subprocess.run([command, *arguments, "--output", str(tmp_path / "command.exr")], check=True, capture_output=True)
    command_image = host.read_image(str(tmp_path / "command.exr"))
    with host.graph("environment", SMALL) as graph, host.scene() as made:
        from heddle.__main__ import load_scene

        load_scene(made, str(scene))
        made.set_environment(host.read_image(str(file)), 2.0, 0.5)
        graph.render(made)
        np.testing.assert_allclose(graph.read()[..., :3], command_image[..., :3], atol=1e-2)


def test_fading_to_nothing_ends_in_the_dark(host, empty):
    looking(empty, (0, 0, -1))
    with host.graph("environment", SMALL) as graph:
        graph.keep("lighting.radiance")
        for scale in (1.0, 0.001, 0.0):
            empty.set_environment(np.ones((8, 16), np.float32), scale=scale)
            np.testing.assert_allclose(radiance(graph, empty), scale, rtol=2e-3)


@pytest.mark.parametrize("technique", ["supersampled", "multiframe"])
def test_a_complete_loop_begins_anew_under_another_environment(host, empty, technique):
    looking(empty, (0, 0, -1))
    settings = [*SMALL, "sky.technique=environment_map", f"aa.technique={technique}", "aa.params.samples=2",
                "params.exposure=0"]
    if technique == "supersampled":
        settings.append("aa.params.mode=progressive")
    with host.graph("supersampled", settings) as graph:
        seen = []
        for image, scale in ((1.0, 1.0), (0.25, 1.0), (0.25, 3.0)):
            empty.set_environment(np.full((8, 16), image, np.float32), scale=scale)
            for _ in range(4):
                graph.render(empty)
            assert graph.stats()["counters"]["submits"] == 0  # complete
            seen.append(graph.read()[..., :3])
            for _ in range(2):
                graph.render(empty, anew=True)
            np.testing.assert_array_equal(seen[-1], graph.read()[..., :3])
        assert seen[1].max() < seen[2].max() < seen[0].max()


@pytest.mark.parametrize("wrong", [{"scale": -1.0}, {"scale": math.nan}, {"scale": math.inf}, {"rotation": (0, 0, 0, 0)}])
def test_scales_and_rotations_that_mean_nothing_are_refused(empty, wrong):
    with pytest.raises(heddle.Error, match=next(iter(wrong))):
        empty.set_environment(np.ones((8, 16), np.float32), **wrong)
