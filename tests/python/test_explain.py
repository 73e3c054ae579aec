# SPDX-License-Identifier: Apache-2.0
"""Why a pass runs or does not, from the command and from Python; graphs found by name."""

import json
import subprocess

import pytest

import heddle


def explain(command, *words):
    return subprocess.run([command, "explain", *words, "-q"], capture_output=True, text=True)


def test_the_command_explains_one_pass(command):
    done = explain(command, "deferred", "--why", "contact", "--set", "contact.params.distance=0.2")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "pass 'contact' (shadow/ray_marched_screen) runs: answers 'shadow' for 'transparency'"
    assert any(line.split() == ["params.distance", "0.2", "--set"] for line in lines)


def test_text_and_json_of_python_and_command_are_the_same(command, host):
    with host.graph("deferred") as graph:
        text = graph.explain(why="ao")
        answer = json.loads(graph.explain("json", why="ao"))
    assert explain(command, "--why", "ao").stdout == text + "\n"
    assert json.loads(explain(command, "--why", "ao", "--format", "json").stdout) == answer
    assert answer["runs"] is True and answer["chain"][-1] == "'display' makes the output 'display.color'"
    (radius,) = [setting for setting in answer["settings"] if setting["name"] == "params.radius"]
    assert radius["value"] == 0.5
    assert radius["from"].startswith("params.ao_radius at ") and '"$ao_radius"' in radius["from"]


def test_values_set_between_frames_are_seen_with_their_place(host):
    with host.graph("deferred", ["extent=[64,48]"]) as graph, host.scene() as scene:
        graph.render(scene)
        graph.set("ao.params.radius=0.125")
        settings = json.loads(graph.explain("json", why="ao"))["settings"]
    assert {"name": "params.radius", "value": 0.125, "from": "--set"} in settings


def test_a_removed_pass_is_told_with_its_line(host, root):
    with host.graph("furnace") as graph:
        answer = json.loads(graph.explain("json", why="contact"))
    assert answer["rule"] == "removed" and answer["rule_at"].endswith("graphs/furnace.toml:6:27")


def test_an_unknown_pass_is_an_error(host, root):
    with host.graph("deferred") as graph:
        with pytest.raises(heddle.Error) as error:
            graph.explain(why="oa")
    assert str(error.value).splitlines()[0].endswith("deferred.toml: error: the graph has no pass 'oa'")
    assert str(error.value).splitlines()[-1] == "  help:     did you mean 'ao'?"


def test_scenes_in_python_are_explained_too(command, root):
    done = subprocess.run([command, "explain", "scripts/scenes/material_grid.py", "--why", "ao", "--set",
                           "extent=[64,48]"], cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("pass 'ao' (ambient_occlusion/gtao) runs: makes 'ao.visibility' for 'lighting'\n")


def test_a_graph_describes_itself_without_a_plan(host):
    with host.graph("deferred", ["ao.technique=none", "extent=[64,48]"]) as graph:
        said = graph.describe()
    assert said["extent"] == [64, 48] and said["output"] == "display.color"
    assert said["presets"] == {"exposure": 15.0, "ao_radius": 0.5}
    passes = {each["name"]: each for each in said["passes"]}
    assert passes["ao"] == {"name": "ao", "role": "ambient_occlusion", "technique": "none", "is_left_out": True}
    assert passes["lighting"]["inputs"]["depth"] == "gbuffer.depth"
    assert passes["lighting"]["inputs"]["visibility"] == "none"
    assert {"name": "gbuffer.depth", "type": "image"} in said["ports"]


def test_an_overlay_extends_a_shipped_graph_by_name(host, tmp_path):
    file = tmp_path / "night.toml"
    file.write_text('extends = "deferred"\n[[pass]]\nname = "ao"\ntechnique = "none"\n')
    with host.graph(file) as graph:
        assert [each["technique"] for each in graph.describe()["passes"] if each["name"] == "ao"] == ["none"]
    file.write_text('extends = "defered"\n')
    with pytest.raises(heddle.Error) as error:
        host.graph(file)
    folder = heddle._library.find().resolve().parent / "heddle" / "graphs"
    shipped = folder / "defered.toml"
    names = ", ".join(sorted(path.stem for path in folder.glob("*.toml")))
    assert str(error.value) == (f"{file}:1:11: error: there is neither a file nor a shipped graph 'defered'\n"
                                f"  expected: one of the files {tmp_path}/defered and {shipped}; shipped are {names}\n"
                                "  help:     did you mean 'deferred'?")


def test_numbers_of_another_unit_are_warned_of(tmp_path):
    said = []
    with heddle.Host(log=lambda severity, text: said.append(text)) as host:
        with host.graph("deferred", ["ao.inputs.depth=gbuffer.normal", "extent=[64,48]"]):
            pass
    assert said == ["--set:1:17: warning: pass 'ao': input 'depth' is in m, but 'gbuffer.normal' is without unit\n"
                    "  found:    inputs.depth = \"gbuffer.normal\"\n"
                    "  expected: a port in m\n"
                    "  help:     'gbuffer.depth' is one"]


def test_without_a_scene_an_artifact_is_not_there_yet(command):
    done = subprocess.run([command, "explain", "baked_ao"], capture_output=True, text=True)
    assert done.returncode == 0
    assert "input 'occlusion' is not there yet: the job that makes it has not run" in done.stderr
    assert "is no baked visibility" not in done.stderr
