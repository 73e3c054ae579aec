# SPDX-License-Identifier: Apache-2.0
"""What changes while a graph renders: techniques, parameters, files. What the change does not touch goes on."""

import os
import pathlib
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest

import heddle
from conftest import default_signals
from heddle.__main__ import load_scene

SMALL = ["extent=[64,48]"]


@pytest.fixture
def scene(host, root):
    with host.scene() as made:
        load_scene(made, str(root / "scripts" / "scenes" / "cornell_box.py"))
        yield made


def picture_of(host, scene, settings, graph="deferred"):
    with host.graph(graph, [*SMALL, *settings]) as made:
        made.render(scene)
        return made.read()


def test_a_swap_makes_the_swapped_pass_and_nothing_else(host, scene):
    with host.graph("deferred", SMALL) as graph:
        graph.render(scene)
        first = graph.stats()["plan"]
        assert first["passes_made"] > 5 and first["pipelines_made"] > 5
        assert first["passes_kept"] == first["pipelines_kept"] == 0
        gtao = graph.read()
        # "none" takes the pass away: everything else goes on, but the shader that was joined with it is another.
        graph.set("ao.technique=none")
        graph.render(scene)
        plan = graph.stats()["plan"]
        assert plan["passes_made"] <= 1
        assert plan["passes_kept"] + plan["passes_made"] == first["passes_made"] - 1
        assert plan["pipelines_kept"] >= first["pipelines_made"] - 4
        assert np.array_equal(graph.read(), picture_of(host, scene, ["ao.technique=none"]))
        graph.set("ao.technique=gtao")
        graph.render(scene)
        assert np.array_equal(graph.read(), gtao)


@pytest.mark.parametrize("setting", ["shadow.params.resolution=512", "shadow.params.filter_taps=4", "ao.params.directions=4",
                                     "sky.params.sun_elevation=0.2",
                                     "lighting.technique=forward", "extent=[48,64]", "shadow.technique=none"])
def test_a_changed_graph_renders_as_one_that_was_always_so(host, scene, setting):
    """Whatever is taken over: the bytes are those of a graph that never was another, back and forth."""
    with host.graph("deferred", SMALL) as graph:
        graph.render(scene)
        before = graph.read()
        graph.set(setting)
        graph.render(scene)
        assert np.array_equal(graph.read(), picture_of(host, scene, [setting]))
        key = setting.split("=")[0]
        back = {"extent": "extent=[64,48]", "lighting.technique": "lighting.technique=deferred",
                "shadow.technique": "shadow.technique=shadow_map", "shadow.params.resolution": f"{key}=1024",
                "shadow.params.filter_taps": f"{key}=9", "ao.params.directions": f"{key}=2",
                "sky.params.sun_elevation": f"{key}=0.9"}[key]
        graph.set(back)
        graph.render(scene)
        assert np.array_equal(graph.read(), before)


def test_an_impossible_change_leaves_the_graph_and_its_last_frame(host, scene):
    with host.graph("deferred", SMALL) as graph:
        graph.render(scene)
        before = graph.read()
        with pytest.raises(heddle.Error):
            graph.set("ao.technique=gtoa")
        with pytest.raises(heddle.Error):
            graph.set("ao.params.radius=-1")
        assert np.array_equal(graph.read(), before)
        graph.render(scene)
        assert np.array_equal(graph.read(), before)


@pytest.fixture
def plugins(root, tmp_path):
    """A copy of the plugins whose shaders may be edited."""
    copy = tmp_path / "plugins"
    shutil.copytree(pathlib.Path(os.environ["HEDDLE_LIBRARY"]).parent / "heddle" / "plugins", copy)
    return copy


def edit(file, old, new):
    """As an editor does: another file under the same name, later than the one before."""
    text = file.read_text()
    assert old in text
    stamp = file.stat().st_mtime_ns
    file.unlink()
    file.write_text(text.replace(old, new))
    os.utime(file, ns=(stamp + 10**9, stamp + 10**9))


def test_what_a_host_has_had_is_not_made_again(host, scene):
    with host.graph("deferred", SMALL) as graph:
        graph.render(scene)
        image, made = graph.read(), graph.stats()["plan"]["pipelines_made"]
        graph.set("ao.technique=none")
        graph.render(scene)
        graph.set("ao.technique=gtao")
        graph.render(scene)
        plan = graph.stats()["plan"]
        assert plan["pipelines_made"] == 0 and plan["pipelines_shared"] >= 1
        assert np.array_equal(graph.read(), image)
        with host.graph("deferred", SMALL) as other:  # beside it
            other.render(scene)
            plan = other.stats()["plan"]
            assert (plan["pipelines_made"], plan["pipelines_shared"]) == (0, made)
            assert np.array_equal(other.read(), image)
    with host.graph("deferred", SMALL) as other:  # after both
        other.render(scene)
        assert other.stats()["plan"]["pipelines_made"] == 0
        assert np.array_equal(other.read(), image)


ENCODE = "color = vec4(srgb_from_linear(clipped), 1.0);"


def test_an_edited_shader_is_the_only_one_that_is_made_anew(plugins, root):
    shader = plugins / "display" / "linear" / "encode.frag.glsl"
    with heddle.Host(plugin_path=str(plugins)) as host, host.scene() as scene:
        load_scene(scene, str(root / "scripts" / "scenes" / "cornell_box.py"))
        with host.graph("deferred", SMALL) as graph:
            assert str(shader) in graph.files()
            graph.render(scene)
            before = graph.read()
            made = graph.stats()["plan"]["pipelines_made"]
            edit(shader, ENCODE, "color = vec4(1.0 - srgb_from_linear(clipped), 1.0);")
            graph.reload()
            graph.render(scene)
            plan = graph.stats()["plan"]
            assert (plan["passes_made"], plan["pipelines_made"]) == (0, 1)
            assert plan["pipelines_kept"] == made - 1
            after = graph.read()
            assert np.abs(after[..., :3] - (1 - before[..., :3])).max() <= 1 / 255

            edit(shader, "1.0 - srgb_from_linear", "1.0 - srgb_form_linear")
            line = 1 + shader.read_text().split("srgb_form_linear")[0].count("\n")
            with pytest.raises(heddle.Error, match=rf"encode\.frag\.glsl:{line}.*srgb_form_linear"):
                graph.reload()
            assert np.array_equal(graph.read(), after), "the last good frame is still there"
            graph.render(scene)
            assert np.array_equal(graph.read(), after), "and what made it"

            edit(shader, "1.0 - srgb_form_linear", "srgb_from_linear")
            graph.reload()
            graph.render(scene)
            assert np.array_equal(graph.read(), before)


def test_an_edited_graph_is_read_again_and_settings_hold(host, scene, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('extends = "deferred"\nextent = [32, 24]\n')
    with host.graph(file, ["ao.technique=none"]) as graph:
        assert str(file) in graph.files()
        graph.render(scene)
        assert graph.read().shape == (24, 32, 4)
        edit(file, "[32, 24]", "[40, 30]")
        graph.reload()
        graph.render(scene)
        assert np.array_equal(graph.read(), picture_of(host, scene, ["extent=[40,30]", "ao.technique=none"]))
        edit(file, "[40, 30]", "[40, 30")
        with pytest.raises(heddle.Error, match=r"mine\.toml:\d+:\d+"):
            graph.reload()
        assert graph.read().shape == (30, 40, 4)


def test_a_plugin_that_was_built_again_is_opened_again(plugins, root):
    library = plugins / "display" / "linear" / "linear.so"
    with heddle.Host(plugin_path=str(plugins)) as host, host.scene() as scene:
        load_scene(scene, str(root / "scripts" / "scenes" / "cornell_box.py"))
        with host.graph("deferred", SMALL) as graph:
            graph.render(scene)
            before = graph.read()
            library.write_bytes(library.read_bytes() + b"\0")  # another file with the same code
            graph.reload()
            graph.render(scene)
            plan = graph.stats()["plan"]
            assert plan["passes_made"] == 1
            assert np.array_equal(graph.read(), before)


def test_a_thousand_unchanged_frames_leave_every_count_as_it_was(host, scene):
    with host.graph("deferred", ["extent=[16,12]", "shadow.params.resolution=64"]) as graph:
        counts = []
        for frame in range(1002):
            graph.render(scene, time=frame / 60)
            counters = graph.stats()["counters"]
            counts.append({name: value for name, value in counters.items()
                           if name.startswith("live_") or name == "device_memory_bytes"} |
                          {"pipelines_created": counters["pipelines_created"]} if frame > 0 else {})
        assert counts[1]["live_pipelines"] > 0 and counts[1]["device_memory_bytes"] > 0
        assert all(count == counts[1] for count in counts[2:])


class Watched:
    """`heddle run --watch`, and what it says."""

    def __init__(self, command, root, folder, *arguments):
        self.log = folder / "stderr"
        self.output = folder / "picture.png"
        with self.log.open("w") as errors:
            graph = [] if any(word.endswith(".toml") for word in arguments) else ["deferred"]
            self.process = subprocess.Popen([command, "run", *graph, *arguments, "--set", "extent=[64,48]", "--watch",
                                             "--output", str(self.output)], cwd=root, stderr=errors, preexec_fn=default_signals)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        self.process.send_signal(signal.SIGINT)
        status = self.process.wait()
        assert kind is not None or status == 130, self.log.read_text()

    def wait_for(self, text, count=1):
        """Ends by itself only with the process: what is waited for comes, however slow the machine."""
        while self.log.read_text().count(text) < count:
            assert self.process.poll() is None, self.log.read_text()
            time.sleep(0.05)
        return self.log.read_text()


def test_watch_renders_again_and_keeps_the_last_good_picture(command, root, plugins, tmp_path, host):
    shader = plugins / "display" / "linear" / "encode.frag.glsl"
    with Watched(command, root, tmp_path, "--plugins", str(plugins)) as watched:
        watched.wait_for("watching")
        first = host.read_image(watched.output)
        edit(shader, ENCODE, "color = vec4(1.0 - srgb_from_linear(clipped), 1.0);")
        assert "0 passes and 1 pipelines made" in watched.wait_for("planned in", 2)
        second = host.read_image(watched.output)
        assert np.abs(second[..., :3] - (1 - first[..., :3])).max() <= 1 / 255
        edit(shader, "1.0 - srgb_from_linear", "1.0 - srgb_form_linear")
        assert "encode.frag.glsl:15" in watched.wait_for("waiting for the next change")
        assert np.array_equal(host.read_image(watched.output), second)
        edit(shader, "1.0 - srgb_form_linear", "srgb_from_linear")
        watched.wait_for("planned in", 3)
        assert np.array_equal(host.read_image(watched.output), first)


SCENE = """
import paint

def build(scene):
    positions, indices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [0, 1, 2]
    scene.instance(scene.mesh(positions, scene.material(base_color=paint.COLOR), indices))
    scene.camera((0, 0, 3), (0, 0, 0))
"""


def test_watch_reads_a_python_scene_and_what_it_imports_again(command, root, tmp_path, host):
    scene, paint = tmp_path / "scene.py", tmp_path / "paint.py"
    scene.write_text(SCENE)
    paint.write_text("COLOR = (0.8, 0.1, 0.1, 1)\n")
    with Watched(command, root, tmp_path, str(scene)) as watched:
        watched.wait_for("planned in")
        red = host.read_image(watched.output)[24, 32]
        edit(paint, "(0.8, 0.1, 0.1, 1)", "(0.1, 0.1, 0.8, 1")
        watched.wait_for("waiting for the next change")
        edit(paint, "(0.1, 0.1, 0.8, 1", "(0.1, 0.1, 0.8, 1)")
        watched.wait_for("planned in", 2)
        blue = host.read_image(watched.output)[24, 32]
        assert red[0] > 1.5 * red[2] and blue[2] > 1.5 * blue[0]
        edit(scene, "def build(scene):", "def build(scene):\n    raise SystemExit(0)")
        assert f"{scene}:5: error: in build(scene): SystemExit" in watched.wait_for("waiting for the next change", 2)


def test_watch_renders_once_for_a_change_of_the_files_that_are_watched(command, root, tmp_path):
    graph = tmp_path / "mine.toml"
    graph.write_text('extends = "deferred"\nextent = [32, 24]\n[[pass]]\nname = "ao"\ntechnique = "gtao"\n')
    with Watched(command, root, tmp_path, str(graph)) as watched:
        watched.wait_for("planned in")
        edit(graph, "gtao", "ssao")
        watched.wait_for("planned in", 2)
        edit(graph, "ssao", "none")  # said after whatever was due before it
        watched.wait_for("planned in", 3)
        assert watched.log.read_text().count("wrote ") == 3
