# SPDX-License-Identifier: Apache-2.0
"""The package's comforts over the C API: settings read and changed, reloading, read-back into one's own memory, progress,
and errors in scenes that are written in Python."""

import base64
import json
import os
import subprocess
import sys

import numpy as np
import pytest

import heddle
from heddle import shapes

SMALL = ["extent=[64,36]", "sky.technique=uniform", "contact.technique=none", "params.exposure=0"]


def build(scene):
    paint = scene.material("paint", (0.6, 0.5, 0.4, 1))
    scene.instance(scene.mesh(**shapes.box((1, 1, 1)), material=paint))
    scene.instance(scene.mesh(**shapes.quad((-3, -0.5, 3), (6, 0, 0), (0, 0, -6)), material=paint))
    scene.camera((1.5, 1.5, 3), (0, 0, 0))


def test_get_says_what_set_and_the_file_said(host):
    with host.graph("deferred", SMALL) as graph:
        assert graph.get("extent") == [64, 36]
        assert graph.get("output") == "display.color"
        assert graph.get("params.ao_radius") == 0.5
        assert graph.get("ao.technique") == "gtao"
        assert graph.get("ao.params.radius") == 0.5
        assert graph.get("ao.inputs.depth") == "gbuffer.depth"
        assert graph.get("contact")["params"] == {}
        assert graph.get("lighting.functions.shadow") == ["shadow"]
        graph.set("ao.params.radius", np.float64(0.75))
        graph.set("ao.params.directions=4")
        assert graph.get("ao.params.radius") == 0.75
        assert graph.get("ao")["params"]["directions"] == 4
        assert set(graph.get()) >= {"extent", "output", "params", "joins", "sky", "gbuffer", "ao", "display"}
        for key, text in (
            ("ao.params.radus", "error: 'ao.params' has no setting 'radus'\n  expected: one of "),
            ("a0", "error: the graph has no setting 'a0'\n  expected: one of kind, extent, output, params, joins, sky, "),
            ("extent.x", "error: 'extent' has no setting 'x'\n  expected: nothing behind it"),
        ):
            with pytest.raises(heddle.Error) as raised:
                graph.get(key)
            assert str(raised.value).startswith(text) and raised.value.status == 2
        with pytest.raises(heddle.Error) as raised:
            graph.get("ao.params.radus")
        assert str(raised.value).endswith("\n  help:     did you mean 'radius'?")


def test_swap_answers_the_technique_that_was_there(host):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.keep("ao.visibility")
        graph.render(scene)
        before = graph.read("ao.visibility")
        assert graph.swap("ao", "ray_traced") == "gtao"
        graph.render(scene)
        assert graph.read("ao.visibility").tobytes() != before.tobytes()
        assert graph.swap("ao", "gtao") == "ray_traced"
        graph.render(scene)
        assert graph.read("ao.visibility").tobytes() == before.tobytes()
        with pytest.raises(heddle.Error, match="did you mean 'gtao'"):
            graph.swap("ao", "gtoa")
        assert graph.get("ao.technique") == "gtao"


def test_reload_reads_the_file_again_and_keeps_what_was_set(host, tmp_path, root):
    file = tmp_path / "mine.toml"
    base = f'extends = "{root}/scripts/graphs/deferred.toml"\n[params]\nao_radius = '
    file.write_text(base + "0.25\n")
    with host.graph(file, SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.set("ao.params.directions", 3)
        graph.render(scene)
        first = graph.read()
        file.write_text(base + "1.5\n")
        assert graph.get("ao.params.radius") == 0.25
        graph.reload()
        assert (graph.get("ao.params.radius"), graph.get("ao.params.directions")) == (1.5, 3)
        assert graph.get("extent") == [64, 36]
        graph.render(scene)
        assert graph.read().tobytes() != first.tobytes()
        file.write_text("extends = 3\n")
        with pytest.raises(heddle.Error, match="mine.toml:1:11: error: 'extends' is an integer"):
            graph.reload()
        assert graph.get("ao.params.radius") == 1.5
        graph.render(scene)


def test_read_writes_into_memory_of_the_callers(host):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.render(scene)
        first = graph.read()
        own = np.full((36, 64, 4), np.nan, np.float32)
        assert graph.read(out=own) is own
        assert own.tobytes() == first.tobytes()
        # What was read before stays as it was, whatever the graph does next, and after its end.
        kept = first.copy()
        graph.set("ao.technique", "none")
        graph.render(scene)
        assert graph.read().tobytes() != first.tobytes()
        assert first.tobytes() == kept.tobytes()
        for wrong, found in ((np.empty((36, 64, 3), np.float32), "float32 (36, 64, 3), contiguous, writeable"),
                             (np.empty((36, 64, 4)), "float64 (36, 64, 4), contiguous, writeable"),
                             (np.empty((36, 128, 4), np.float32)[:, ::2], "float32 (36, 64, 4), not contiguous, writeable")):
            with pytest.raises(heddle.Error) as raised:
                graph.read(out=wrong)
            assert str(raised.value) == (f"error: 'out' is {found}\n"
                                         "  expected: a float32 array (36, 64, 4), contiguous and writeable")
    assert first.tobytes() == kept.tobytes()


def test_texels_are_what_the_device_has(host):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.keep("gbuffer.depth")
        graph.render(scene)
        texels, vk_format = graph.read_texels()
        assert (texels.shape, texels.dtype, vk_format) == ((36, 64, 4), np.uint8, 37)
        assert np.array_equal(texels, np.rint(graph.read() * 255))
        # Of float32 nothing changes, and of any port.
        texels, vk_format = graph.read_texels("gbuffer.depth")
        assert (texels.shape, vk_format) == ((36, 64, 4), 100)  # VK_FORMAT_R32_SFLOAT
        assert texels.tobytes() == graph.read("gbuffer.depth").tobytes()
        for arguments, expected in ((("ao.visibility",), "port 'ao.visibility' was not kept"), ((None, 1), "has 1 layers and 1 mips")):
            with pytest.raises(heddle.Error, match=expected):
                graph.read_texels(*arguments)


def test_fewer_samples_than_are_taken_are_told_once():
    told = []
    with heddle.Host(log=lambda severity, text: told.append((severity, text))) as host, host.scene() as scene:
        build(scene)
        with host.graph("path_traced", ["extent=[64,36]", "path_tracer.params.samples=8"]) as graph:
            graph.render(scene)
            first = graph.read().tobytes()
            assert told == []
            graph.set("path_tracer.params.samples", 2)
            for _ in range(2):
                graph.render(scene)
                assert graph.read().tobytes() == first
            assert len(told) == 1 and told[0][0] == 1
            assert "`samples` asks for 2 paths a pixel and 8 are taken: all of them stay in the picture" in told[0][1]
            graph.set("path_tracer.params.samples", 8)
            graph.render(scene)
            assert graph.read().tobytes() == first and len(told) == 1
            # Another number of samples in a picture that begins anew is no such question.
            graph.set("path_tracer.params.samples", 2)
            graph.set("path_tracer.params.bounces", 1)
            graph.render(scene)
            assert len(told) == 1


def test_progress_tells_activities_and_rising_fractions():
    told = []
    with heddle.Host(progress=lambda activity, fraction: told.append((activity, fraction))) as host:
        with host.graph("deferred", SMALL) as graph, host.scene() as scene:
            build(scene)
            graph.render(scene)
    assert any(activity.startswith("compiling shader '") and activity.endswith("of pass 'lighting'") for activity, _ in told)
    stages = [fraction for activity, fraction in told if activity.startswith("stage ")]
    assert stages == sorted(stages) and stages[0] == 0 and stages[-1] < 1
    assert told[-1][0].startswith("stage '") and told[-1][0].endswith("of pass 'display'")


def test_what_progress_raises_ends_the_call_and_leaves_everything_usable():
    class Enough(Exception):
        pass

    limit = [None]

    def tell(activity, fraction):
        if limit[0] is not None and activity.startswith(limit[0]):
            raise Enough(activity)

    with heddle.Host(progress=tell) as host, host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.render(scene)
        whole = graph.read()
        limit[0] = "stage"
        with pytest.raises(Enough, match="stage"):
            graph.render(scene)
        limit[0] = None
        graph.render(scene, cut=True)
        assert graph.read().tobytes() == whole.tobytes()
        limit[0] = "compiling"
        with pytest.raises(Enough, match="compiling"):
            graph.set("ao.technique", "none")  # a new plan
        assert graph.read().tobytes() == whole.tobytes(), "the last frame is still there"
        limit[0] = None
        graph.render(scene, cut=True)
        assert graph.read().tobytes() == whole.tobytes()
        assert graph.get("ao.technique") == "gtao"


def test_loading_a_file_can_be_ended_by_its_progress(tmp_path):
    points = base64.b64encode(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).tobytes()).decode()
    file = tmp_path / "a.gltf"
    file.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64," + points}]}))
    told = []

    def tell(activity, fraction):
        told.append(activity)
        raise KeyboardInterrupt

    with heddle.Host(progress=tell) as host, host.scene() as scene:
        with pytest.raises(KeyboardInterrupt):
            scene.load(file)
        assert scene.describe()["counts"]["instances"] == 0
    assert told == [f"{file}: reading the nodes"]


@pytest.mark.parametrize("text, message", [
    ("def build(scene):\n    place = 1\n    return place / 0\n",
     "{file}:3: error: in build(scene): ZeroDivisionError: division by zero\n  calls:\n"
     "  File \"{file}\", line 3, in build\n    return place / 0\n"),
    ("def lamp(scene):\n    scene.light('pont', (1, 1, 1))\n\n\ndef build(scene):\n    lamp(scene)\n",
     "{file}:2: error: in build(scene): unknown light type 'pont'\n  expected: one of directional, point, spot, sphere, "
     "capsule, cone, wedge, box, rectangle, environment\n  calls:\n  File \"{file}\", line 6, in build\n    lamp(scene)\n"),
    ("def build(scene):\n    pass\n\n\ndef update(scene, time):\n    raise ValueError(f'no time {time}')\n",
     "{file}:6: error: in update(scene, 0.5): ValueError: no time 0.5\n  calls:\n"
     "  File \"{file}\", line 6, in update\n    raise ValueError(f'no time {{time}}')\n"),
    ("import nothing_of_this_name\n",
     "{file}:1: error: in the file itself: ModuleNotFoundError: No module named 'nothing_of_this_name'\n"),
    ("def build(scene:\n    pass\n", "{file}:1: error: in the file itself: SyntaxError: "),
    ("def biuld(scene):\n    pass\n", "{file}: error: the scene has no function build(scene)\n"),
])
def test_errors_of_a_scene_name_its_file_and_line_and_exit_with_2(command, tmp_path, text, message):
    file = tmp_path / "scene.py"
    file.write_text(text)
    run = subprocess.run([command, "run", str(file), "--time", "0.5", "--set", "extent=[8,8]", "--output",
                          str(tmp_path / "out.png")], capture_output=True, text=True)
    assert run.stderr.startswith(message.format(file=file)), run.stderr
    assert run.returncode == 2
    assert "heddle/__main__.py" not in run.stderr and not (tmp_path / "out.png").exists()


def test_the_notebook_compares_techniques_at_a_tiny_size(root, tmp_path):
    script = root / "scripts" / "examples" / "compare_occlusion.py"
    run = subprocess.run([sys.executable, str(script), "--extent", "48,27", "--repeats", "1", "--steps", "2", "--scene",
                          "cornell_box.py", "--reference-samples", "64", "--folder", str(tmp_path)],
                         capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(root / "scripts")})
    assert run.returncode == 0, run.stderr
    rows = (tmp_path / "occlusion.csv").read_text().splitlines()
    assert rows[0] == "technique,setting,rmse,ms" and len(rows) == 5
    errors = {}
    for row in rows[1:]:
        technique, _, rmse, ms = row.split(",")
        errors.setdefault(technique, []).append(float(rmse))
        assert float(ms) > 0
    # Four rays a pixel are noisier than sixteen: the ladder buys accuracy.
    assert errors["ray_traced"][1] < errors["ray_traced"][0]
    for name in ("gtao", "ray_traced"):
        assert (tmp_path / f"occlusion_{name}.png").exists()
    assert (tmp_path / "occlusion.png").exists() or "matplotlib is not installed" in run.stdout


@pytest.mark.parametrize("wrong, message", [
    (lambda scene, graph: scene.texture(np.full((2, 2, 4), 0.5)), "expected uint8"),
    (lambda scene, graph: scene.texture(np.full((2, 2, 4), 300)), "expected uint8"),
    (lambda scene, graph: scene.use_camera(-1), "no camera -1"),
    (lambda scene, graph: graph.render(scene, seed=-1), "seed is -1"),
    (lambda scene, graph: graph.render(scene, seed=2**70), "seed is"),
    (lambda scene, graph: graph.read(out=[1, 2]), "of type list"),
    (lambda scene, graph: graph.read(out=np.broadcast_to(np.float32(0), graph.read().shape)), "not contiguous, not writeable"),
])
def test_arguments_that_would_become_others_are_refused(wrong, message):
    with heddle.Host() as host, host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build(scene)
        graph.render(scene)
        with pytest.raises(heddle.Error, match=message):
            wrong(scene, graph)
