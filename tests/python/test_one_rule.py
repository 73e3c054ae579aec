# SPDX-License-Identifier: Apache-2.0
"""What the command does for scenes in Python as for others, and messages that say what to do in the words of whoever
reads them."""

import json
import subprocess

import numpy as np
import pytest

import heddle

SMALL = ["--set", "extent=[32,24]"]
PYTHON_SCENE = """def build(scene):
    scene.instance(scene.mesh([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], scene.material(name="paint")))
    scene.light("directional", (1, 1, 1), name="sun")
    scene.camera((0, 3, 1), (0, 0, 0))
"""


@pytest.fixture
def scenes(tmp_path):
    """A scene in Python, and the same as glTF without a light."""
    (tmp_path / "scene.py").write_text(PYTHON_SCENE)
    positions = np.array([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], "<f4")
    (tmp_path / "mesh.bin").write_bytes(positions.tobytes())
    (tmp_path / "scene.gltf").write_text(json.dumps({
        "asset": {"version": "2.0"}, "buffers": [{"uri": "mesh.bin", "byteLength": positions.nbytes}],
        "bufferViews": [{"buffer": 0, "byteLength": positions.nbytes}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, 0, -1],
                       "max": [1, 0, 1]}],
        "materials": [{"name": "paint"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}], "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}], "scene": 0}))
    return tmp_path


def run(command, *arguments, status=0):
    done = subprocess.run([command, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
def test_a_check_is_text_unless_json_is_asked_for(command, scenes, file):
    graph = scenes / "depth.toml"
    graph.write_text('extent = [16, 8]\noutput = "gbuffer.depth"\n[[pass]]\nrole = "gbuffer"\ntechnique = "raster"\n')
    text = run(command, "check", graph, scenes / file).stdout
    assert " runs of 3 frames, nothing found\n  hazards  every read-after-write" in text
    assert text.endswith(" agree in all runs\n")
    report = json.loads(run(command, "check", graph, scenes / file, "--json").stdout)
    assert report["frames"] == 3


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
def test_every_file_that_is_written_gets_its_folder(command, scenes, file):
    run(command, "run", "studio", scenes / file, *SMALL, "--output", scenes / "a" / "b" / "x.png", "--stats",
        scenes / "c" / "d" / "stats.json")
    assert (scenes / "a" / "b" / "x.png").exists() and (scenes / "c" / "d" / "stats.json").exists()


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
def test_frames_are_numbered_alike_everywhere(command, scenes, file):
    arguments = ["studio", scenes / file, *SMALL, "--frames", "3"]
    assert "frame 2 on " in run(command, "run", *arguments, "--output", scenes / "%d.png").stderr
    assert sorted(path.name for path in scenes.glob("*.png")) == ["0.png", "1.png", "2.png"]
    assert "pixel 4,4 of 32 x 24, frame 2\n" in run(command, "inspect", *arguments, "4,4").stdout


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
@pytest.mark.parametrize("option", ["--environment-scale", "--environment-rotation"])
def test_an_option_of_an_image_needs_the_image(command, scenes, file, option):
    said = run(command, "run", "studio", scenes / file, *SMALL, option, "2", status=2).stderr
    assert f"{option} requires --environment" in said


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
def test_half_an_option_is_none(command, scenes, file):
    said = run(command, "run", "studio", scenes / file, *SMALL, "--liv", status=2).stderr
    assert "--liv" in said


@pytest.mark.parametrize("bound", ["rmse=nan", "rmse=abc", "rmse", "rmse=inf"])
def test_a_bound_is_a_number_and_read_first(command, bound):
    done = run(command, "compare", "nowhere.exr", "neither.exr", "--bound", bound, status=2)
    assert done.stderr == f"error: --bound '{bound}' is not METRIC=NUMBER\n" and done.stdout == ""


@pytest.mark.parametrize("file", ["scene.py", "scene.gltf"])
def test_a_live_run_says_what_was_stale(command, scenes, file):
    said = run(command, "run", "studio", scenes / file, *SMALL, "--live", "--frames", "4", "--output", scenes / "x.png").stderr
    assert "live: 0 of 0 late reads were stale; the host waited for the GPU " in said
    assert "cannot be live" in run(command, "run", "studio", scenes / file, *SMALL, "--live", "--check", status=2).stderr


def test_a_live_picture_is_the_repeatable_one_where_nothing_is_late(scenes):
    pictures = []
    for live in (False, True):
        with heddle.Host(live=live) as host, host.graph("deferred", ["extent=[48,32]"]) as graph, host.scene() as scene:
            ball = scene.mesh([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], scene.material())
            scene.instance(ball)
            moved = scene.instance(ball)
            scene.light("directional", (1, 1, 1), direction=(0.3, -1, 0.2))
            for frame in range(7):  # nobody reads in between: in live mode they run while the next are recorded
                scene.camera((0, 3 + 0.1 * frame, 1), (0, 0, 0))
                matrix = np.eye(4)
                matrix[0, 3] = 0.2 * frame
                scene.move(moved, matrix)
                graph.set("display.params.exposure", 0.1 * frame)
                graph.render(scene, time=0.1 * frame)
            pictures.append(graph.read())
            assert graph.stats()["late"]["mode"] == ("live" if live else "repeatable")
    np.testing.assert_array_equal(pictures[1], pictures[0])


def test_a_graph_that_is_not_there_is_told_with_those_that_are(command):
    said = run(command, "explain", "nosuch", status=2).stderr
    assert "there is neither a file nor a shipped graph 'nosuch'" in said
    assert "; shipped are bake_occlusion, baked_ao, deferred, environment, furnace, " in said


def test_a_kind_of_image_that_nobody_writes_is_told_by_its_own_name(command, scenes):
    said = run(command, "run", "studio", scenes / "scene.gltf", *SMALL, "--output", scenes / "x.nosuch", status=2).stderr
    assert f"{scenes}/x.nosuch" in said and "partial" not in said


def test_an_overlay_may_lie_over_an_overlay(host, scenes):
    (scenes / "base.scene.toml").write_text('file = "scene.gltf"\n[[light]]\nname = "lamp"\ntype = "point"\n'
                                            'intensity = [1, 1, 1]\n')
    (scenes / "top.scene.toml").write_text('file = "base.scene.toml"\n[[light]]\nname = "lamp"\nradius = 0.5\n')
    with host.scene() as scene:
        scene.load(scenes / "top.scene.toml")
        assert scene.describe()["lights"] == ["lamp"]
        assert {path.rsplit("/", 1)[1] for path in scene.files()} >= {"scene.gltf", "base.scene.toml", "top.scene.toml"}


@pytest.mark.parametrize("base, said", [
    ("scene.py", "a Python file cannot be under an overlay\n  found:    scene.py\n  expected: a glTF file or another overlay\n"
                 "  help:     load the Python file, and this one with --overlay"),
    ("top.scene.toml", "the overlays are over each other in a circle"), ("other.scene.toml", "over each other in a circle")])
def test_an_overlay_over_what_it_cannot_change_is_refused(host, scenes, base, said):
    (scenes / "top.scene.toml").write_text(f'file = "{base}"\n')
    (scenes / "other.scene.toml").write_text('file = "top.scene.toml"\n')
    with host.scene() as scene, pytest.raises(heddle.Error) as error:
        scene.load(scenes / "top.scene.toml")
    assert said in str(error.value)


def test_python_is_told_in_its_own_words(host):
    with host.scene() as scene, host.graph("studio", ["extent=[16,16]"]) as graph:
        scene.instance(scene.mesh([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], scene.material()))
        graph.render(scene)
        for arguments, said in (({"layer": -1}, "there is no layer -1"), ({"mip": 1.5}, "there is no mip 1.5"),
                                ({"port": "gbuffer.depth"}, "keep it (heddle_graph_keep, Graph.keep in Python)")):
            with pytest.raises(heddle.Error) as error:
                graph.read(**arguments)
            assert said in str(error.value)
        with pytest.raises(heddle.Error) as error:
            graph.set("display.params", {"exposure": 1.0})
        assert "the setting 'display.params' was given a dict" in str(error.value)
        assert 'set("display.params.exposure", ...)' in str(error.value)


def test_an_environment_whose_light_is_beyond_all_numbers_is_refused(host):
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[3, 5, 2] = 1e37
    with host.scene() as scene, pytest.raises(heddle.Error) as error:
        scene.set_environment(pixels)
    assert "texel 5, 3 is 1e+37" in str(error.value) and "1e+28" in str(error.value)


def test_what_stands_still_has_moved_by_exactly_nothing(host):
    with host.scene() as scene, host.graph("studio", ["extent=[97,61]"]) as graph:
        scene.instance(scene.mesh([[-3, 0, -3], [0, 0.7, 3], [3, 0, -3]], scene.material()))
        scene.camera((0.3, 2.9, 1.7), (0, 0, 0))
        graph.keep("gbuffer.motion")
        for _ in range(3):
            graph.render(scene)
            assert not graph.read("gbuffer.motion")[..., :2].any()
