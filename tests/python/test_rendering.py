# SPDX-License-Identifier: Apache-2.0
"""From a scene in Python to pixels: same bytes every time, plugins opened and closed for real, errors that say why."""

import hashlib
import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import heddle

SMALL = ["extent=[160,90]"]


def build_atrium(scene, root):
    sys.path.insert(0, str(root / "scripts"))
    from heddle.__main__ import load_scene

    load_scene(scene, str(root / "scripts" / "scenes" / "atrium.py"))


def mapped_plugins():
    """Plugin libraries in this process's memory, by technique."""
    found = set()
    for line in pathlib.Path("/proc/self/maps").read_text().splitlines():
        path = line.split(maxsplit=5)[-1]
        for technique in ("gtao", "ray_traced", "shadow_map", "deferred", "linear", "raster", "procedural", "uniform", "ggx",
                          "ray_marched_screen"):
            if f"{technique}.so" in path and "heddle" in path:
                found.add(technique)
    return found


def test_the_atrium_has_hundreds_of_parts_and_is_the_same_each_time(host, root):
    descriptions = []
    for _ in range(2):
        with host.scene() as scene:
            build_atrium(scene, root)
            descriptions.append(scene.describe())
    assert descriptions[0] == descriptions[1]
    assert descriptions[0]["counts"]["instances"] > 500
    assert {"masked", "lights", "surfaces"} <= set(descriptions[0]["features"])


def test_two_frames_of_one_process_have_the_same_bytes_and_are_finite(host, root):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build_atrium(scene, root)
        graph.keep("lighting.radiance")
        graph.keep("ao.visibility")
        frames = []
        for _ in range(2):
            graph.render(scene, cut=True)
            frames.append([graph.read(port) for port in (None, "lighting.radiance", "ao.visibility")])
        for first, second in zip(*frames):
            assert np.isfinite(first).all()
            assert first.tobytes() == second.tobytes()
        color, radiance, visibility = frames[0]
        assert color.shape == (90, 160, 4)
        assert radiance[..., :3].min() >= 0
        assert 0 <= visibility.min() < 0.6 and visibility.max() <= 1
        assert 0.1 < color[..., :3].mean() < 0.9


def digest_of_a_process(root):
    script = ("import sys, hashlib, heddle; sys.path.insert(0, sys.argv[1])\n"
              "from heddle.__main__ import load_scene\n"
              "with heddle.Host() as host, host.graph('deferred', ['extent=[96,54]']) as graph, host.scene() as scene:\n"
              "    load_scene(scene, sys.argv[1] + '/scenes/atrium.py')\n"
              "    graph.render(scene)\n"
              "    print(hashlib.sha256(graph.read().tobytes()).hexdigest())\n")
    run = subprocess.run([sys.executable, "-c", script, str(root / "scripts")], capture_output=True, text=True, check=True)
    return run.stdout.strip()


def test_two_processes_render_the_same_bytes(root):
    digests = {digest_of_a_process(root) for _ in range(2)}
    assert len(digests) == 1
    assert len(next(iter(digests))) == hashlib.sha256().digest_size * 2


def test_graphs_open_only_their_own_plugins_and_close_them():
    """In a process of its own, so that nothing else is open."""
    script = (
        "import heddle, sys; sys.path.insert(0, sys.argv[1]); import test_rendering as t\n"
        "with heddle.Host() as host:\n"
        "    host.list()\n"
        "    assert t.mapped_plugins() == set(), t.mapped_plugins()\n"
        "    graph = host.graph('deferred', ['extent=[32,32]'])\n"
        "    assert t.mapped_plugins() == set(), t.mapped_plugins()\n"
        "    with host.scene() as scene:\n"
        "        graph.render(scene)\n"
        "        opened = t.mapped_plugins()\n"
        "        assert 'gtao' in opened and 'ray_traced' not in opened and 'uniform' not in opened, opened\n"
        "        graph.set('ao.technique=ray_traced')\n"
        "        graph.render(scene)\n"
        "        opened = t.mapped_plugins()\n"
        "        assert 'ray_traced' in opened and 'gtao' not in opened, opened\n"
        "        graph.set('ao.technique=none')\n"
        "        graph.render(scene)\n"
        "        assert not {'gtao', 'ray_traced'} & t.mapped_plugins(), t.mapped_plugins()\n"
        "    graph.close()\n"
        "    assert t.mapped_plugins() == set(), t.mapped_plugins()\n"
        "print('right')\n")
    run = subprocess.run([sys.executable, "-c", script, str(pathlib.Path(__file__).parent)], capture_output=True, text=True)
    assert run.stdout.strip() == "right", run.stderr


def test_a_technique_is_swapped_by_a_word_and_back(host, root):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        build_atrium(scene, root)
        graph.render(scene, cut=True)
        first = graph.read()
        graph.set("contact.technique=none")
        graph.render(scene, cut=True)
        without = graph.read()
        graph.set("contact.technique=ray_marched_screen")
        graph.render(scene, cut=True)
        assert graph.read().tobytes() == first.tobytes()
        assert np.abs(without - first).max() > 0


def test_a_scene_without_lights_or_surfaces_renders(host):
    with host.graph("deferred", SMALL) as graph, host.scene() as scene:
        graph.render(scene)
        assert np.isfinite(graph.read()).all()


def test_errors_carry_place_and_status(host):
    with pytest.raises(heddle.Error) as raised:
        host.graph("deferred", ["ao.technique=gtoa"])
    assert raised.value.status == 2
    assert "gtao" in str(raised.value) and "--set:1:" in str(raised.value)
    with pytest.raises(heddle.Error) as raised, host.scene() as scene:
        scene.load("no such file.glb")
    assert "no such file.glb" in str(raised.value)


LIFETIMES = {
    "the host is closed before its graph and scene": (
        "with heddle.Host() as host:\n"
        "    graph, scene = host.graph('deferred', ['extent=[16,16]']), host.scene()\n"
        "    graph.render(scene)\n"),
    "a cycle holds them all": (
        "class Holder: pass\n"
        "holder = Holder(); holder.me = holder\n"
        "holder.host = heddle.Host(); holder.scene = holder.host.scene(); holder.graph = holder.host.graph('deferred')\n"
        "del holder\nimport gc; gc.collect()\n"),
    "the interpreter ends": (
        "host = heddle.Host()\n"
        "def make(): return host.graph('deferred', ['extent=[16,16]']), host.scene()\n"
        "graph, scene = make(); graph.render(scene)\n"),
    "something closed is used": (
        "host = heddle.Host(); graph, scene = host.graph('deferred'), host.scene(); host.close()\n"
        "try:\n    graph.render(scene)\n    raise SystemExit(1)\n"
        "except heddle.Error as error:\n    assert 'closed' in str(error)\n"),
}


@pytest.mark.parametrize("name", LIFETIMES)
def test_objects_end_in_any_order_when(name):
    ended = subprocess.run([sys.executable, "-c", "import heddle\n" + LIFETIMES[name]], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def run(command, *arguments):
    return subprocess.run([command, *arguments], capture_output=True, text=True)


def test_list_needs_no_library_but_its_own(command):
    listed = run(command, "list", "--json")
    assert listed.returncode == 0
    assert {role["name"] for role in json.loads(listed.stdout)["roles"]} >= {"shadow", "sky", "ambient_occlusion"}


def test_devices_names_the_device_in_words_and_as_json(command):
    devices = json.loads(run(command, "devices", "--json").stdout)["devices"]
    assert devices and all(device["name"] in run(command, "devices").stdout for device in devices)


def test_comparing_with_a_bound_exits_with_1(command, host, tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    host.write_image(a, np.full((4, 4, 3), 0.5))
    host.write_image(b, np.full((4, 4, 3), 0.6))
    assert run(command, "compare", a, a, "--bound", "rmse=0").returncode == 0
    assert run(command, "compare", a, b, "--bound", "rmse=0.01").returncode == 1
    assert run(command, "compare", a, b, "--bound", "nonsense=1").returncode == 2


def test_the_command_renders_a_python_scene_to_a_file(command, root, tmp_path):
    picture, visibility = tmp_path / "picture.png", tmp_path / "visibility.exr"
    done = run(command, "run", "deferred", str(root / "scripts" / "scenes" / "atrium.py"), "--set", "extent=[64,36]",
               "--output", str(picture), "--output", f"ao.visibility={visibility}")
    assert done.returncode == 0, done.stderr
    assert picture.exists() and visibility.exists()
    assert not list(tmp_path.glob("*.tmp*"))


def test_a_tracer_that_compensates_where_the_material_does_not_says_so_once():
    said = []
    with heddle.Host(log=lambda _level, text: said.append(text)) as host, host.scene() as scene:
        metal = scene.material(base_color=(0.9, 0.8, 0.6), metalness=1.0, roughness=0.9)
        scene.instance(scene.mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], metal))
        scene.camera((0, 0, 2), (0, 0, 0))
        with host.graph("path_traced", ["extent=[8,8]", "path_tracer.params.samples=1"]) as graph:
            graph.render(scene)
            assert not [text for text in said if "multiple_scattering" in text]
            graph.set("material.params.multiple_scattering", False)
            for seed in range(3):
                graph.render(scene, seed=seed)
            told = [text for text in said if "multiple_scattering" in text]
            assert len(told) == 1 and told[0].endswith(
                "warning: pass 'path_tracer' (ray_tracing/path_tracer): multiple_scattering is true here and false in the pass "
                "of role surface_material: paths are reflected by another material than the one that shaders have; give both "
                "the same value")
            graph.set("path_tracer.params.multiple_scattering", False)
            graph.render(scene)
            graph.set("path_tracer.params.multiple_scattering", True)
            graph.render(scene)
            assert len([text for text in said if "multiple_scattering" in text]) == 2
