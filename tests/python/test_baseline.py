# SPDX-License-Identifier: Apache-2.0
"""heddle baseline: what changed is said, what did not is not, and what nobody can know is not compared."""

import argparse
import json
import os

import pytest

import heddle
from heddle import baseline
from heddle.study_items import Lost

DEVICE = {"index": 0, "name": "llvmpipe", "driver": "llvmpipe", "driver_version": "Mesa 1"}
NOW = {"technique": "ambient_occlusion/gtao", "graph": "deferred", "scene": "cornell_box.py", "settings": ["extent=[64,36]"],
       "port": "ao.visibility", "against": "ambient_occlusion/ray_traced", "errors": {"rmse": 0.1, "maximum": 0.5}, "image": "abc",
       "numbers": {"counters.dispatches": 8, "memory.kept_bytes": 100}, "unsteady": []}


def options(tmp_path, action, *files, **given):
    return argparse.Namespace(**({"action": action, "files": list(files), "folder": str(tmp_path), "tolerance": 0.0, "timeout": 120.0,
                                  "device": None, "quiet": True} | given))


@pytest.mark.parametrize(("change", "tolerance", "said"), [
    ({}, 0.0, []),
    ({"errors": {"rmse": 0.11, "maximum": 0.5}, "image": "abd"}, 0.0, ["error rmse: 0.1 -> 0.11 (+10 %)", "bytes of ao.visibility: differ"]),
    ({"errors": {"rmse": 0.11, "maximum": 0.5}, "image": "abd"}, 0.05, ["error rmse: 0.1 -> 0.11 (+10 %)"]),
    ({"errors": {"rmse": 0.1001, "maximum": 0.5}, "image": "abd"}, 0.05, []),
    ({"image": "abd"}, 0.0, ["bytes of ao.visibility: differ"]),
    ({"image": ""}, 0.0, ["bytes of ao.visibility: steady before, not now"]),
    ({"errors": {"rmse": None, "maximum": 0.5}}, 0.0, ["error rmse: 0.1 -> none"]),
    ({"numbers": {"counters.dispatches": 9, "memory.kept_bytes": 100}}, 1.0, ["counters.dispatches: 8 -> 9 (+12.5 %)"]),
    ({"numbers": {"counters.dispatches": 8}}, 0.0, ["memory.kept_bytes: 100 -> none"]),
    ({"numbers": {"counters.dispatches": 9, "memory.kept_bytes": 100}, "unsteady": ["counters.dispatches"]}, 0.0, []),
    ({"scene": "street.py"}, 0.0, ["scene: cornell_box.py -> street.py"]),
])
def test_changes_are_said(change, tolerance, said):
    assert baseline.changes(NOW, NOW | change, tolerance) == said


def test_what_cannot_be_measured_any_more_is_a_change():
    assert "not_measured: none -> no shipped graph has it" in baseline.changes(NOW, {"not_measured": "no shipped graph has it"}, 0.0)


def test_counters_are_flat_and_have_no_times():
    assert baseline.flat({"counters": {"draws": 3, "pipeline_total_ms": 5.0}, "counts": [
        {"pass": "shadow", "name": "maps_drawn", "count": 4}, {"pass": "shadow", "name": "maps_kept", "count": 0}]}) == {
            "counters.draws": 3, "counts.shadow maps_drawn": 4, "counts.shadow maps_kept": 0}


def test_memory_of_the_process_is_no_number_of_a_technique():
    found = baseline.numbers_of({"counters": {}, "counts": [], "instances": {}, "memory": {"kept_bytes": 3, "process_peak_bytes": 9}})
    assert found["memory"] == {"kept_bytes": 3}


def test_what_two_frames_do_not_share_is_unsteady():
    assert baseline.steady({"a": 1, "b": 2, "c": 3}, {"a": 1, "b": 4, "d": 5}) == ({"a": 1}, ["b", "c", "d"])


def test_names_choose_techniques():
    known = ["ambient_occlusion/gtao", "ambient_occlusion/ssao", "sky/uniform"]
    assert baseline.wanted([], known) == known
    assert baseline.wanted(["ambient_occlusion"], known) == known[:2]
    assert baseline.wanted(["sky/uniform", "sky"], known) == ["sky/uniform"]
    with pytest.raises(heddle.Error, match="there is no role or technique 'ambient_oclusion'\n.*\n  help:     did you mean 'ambient_occlusion'"):
        baseline.wanted(["ambient_oclusion"], known)


def test_another_driver_is_another_folder():
    names = {baseline.folder_name(baseline.fingerprint(DEVICE | change)) for change in ({}, {"driver_version": "Mesa 2"}, {"name": "llvmpipe (128 bits)"})}
    assert len(names) == 3 and all(name.startswith("llvmpipe_Mesa_") and "/" not in name for name in names)
    assert baseline.folder_name(baseline.fingerprint(DEVICE)) in names  # and the same one is the same


@pytest.fixture
def gauge(monkeypatch):
    """What techniques make, as a test says; measuring them says on which device."""
    made = {"ambient_occlusion/gtao": NOW, "ambient_occlusion/ssao": NOW | {"technique": "ambient_occlusion/ssao"}}

    def measure(self, name):
        self.device = DEVICE
        if isinstance(made[name], Exception):
            raise made[name]
        return made[name]

    def init(self, host, options, log, stop):
        self.techniques, self.device = dict.fromkeys(made), {}

    monkeypatch.setattr(baseline.Gauge, "__init__", init)
    monkeypatch.setattr(baseline.Gauge, "measure", measure)
    return made


def test_a_silent_change_shows(gauge, tmp_path, capsys):
    assert baseline.baseline(options(tmp_path, "record"), lambda: None) == 0
    assert "recorded 2 techniques" in capsys.readouterr().out
    assert baseline.baseline(options(tmp_path, "check"), lambda: None) == 0
    assert ", 0 differ" in capsys.readouterr().out
    gauge["ambient_occlusion/gtao"] = NOW | {"numbers": {"counters.dispatches": 9, "memory.kept_bytes": 100}}
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.json")}
    assert baseline.baseline(options(tmp_path, "check"), lambda: None) == 1
    assert capsys.readouterr().out.startswith("ambient_occlusion/gtao: counters.dispatches: 8 -> 9 (+12.5 %)\nchecked 2 techniques")
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.json")} == before
    assert baseline.baseline(options(tmp_path, "record"), lambda: None) == 0
    assert "ambient_occlusion/gtao: counters.dispatches: 8 -> 9" in capsys.readouterr().out
    assert baseline.baseline(options(tmp_path, "check"), lambda: None) == 0


def test_what_comes_and_goes_is_a_difference(gauge, tmp_path, capsys):
    gauge["sky/uniform"] = NOW
    assert baseline.baseline(options(tmp_path, "record", "sky", "ambient_occlusion/gtao"), lambda: None) == 0
    del gauge["sky/uniform"]
    assert baseline.baseline(options(tmp_path, "check"), lambda: None) == 1
    said = capsys.readouterr().out
    assert "ambient_occlusion/ssao: not in the baseline (heddle baseline record)" in said
    assert "sky/uniform: it was there, and is no more" in said
    assert baseline.baseline(options(tmp_path, "check", "ambient_occlusion/gtao"), lambda: None) == 0


def test_no_baseline_of_this_machine_is_an_error(gauge, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "machine.json").write_text("{}")
    with pytest.raises(heddle.Error, match="there is no baseline of this machine and driver .*\n  found:    other\n") as raised:
        baseline.baseline(options(tmp_path, "check"), lambda: None)
    assert raised.value.status == 2


def test_a_crash_is_told_while_the_others_are_checked(gauge, tmp_path, capsys):
    gauge["ambient_occlusion/gtao"] = Lost("crashed", "the process ended by SIGSEGV")
    assert baseline.baseline(options(tmp_path, "record"), lambda: None) == 4
    said = capsys.readouterr().out
    assert "ambient_occlusion/gtao: crashed: the process ended by SIGSEGV" in said and "recorded 1 techniques" in said


def test_a_damaged_file_is_said_with_its_place(gauge, tmp_path):
    baseline.baseline(options(tmp_path, "record"), lambda: None)
    file = next(tmp_path.rglob("gtao.json"))
    file.write_text("{")
    with pytest.raises(heddle.Error) as raised:
        baseline.baseline(options(tmp_path, "check"), lambda: None)
    assert str(raised.value).startswith(f"{file}: error: this is no baseline:")


def test_a_technique_is_measured_where_it_runs_and_twice_alike(tmp_path):
    with heddle.Host(log=lambda *_: None) as host:
        gauge = baseline.Gauge(host, options(tmp_path, "check"), tmp_path / "log", lambda: None)
        assert gauge.measure("ambient_occlusion/gtao") == (found := gauge.measure("ambient_occlusion/gtao"))
    assert (found["graph"], found["scene"], found["port"]) == ("deferred", "cornell_box.py", "ao.visibility")
    assert found["against"] == "ambient_occlusion/ray_traced" and 0.01 < found["errors"]["rmse"] < 0.5
    assert found["numbers"]["counters.dispatches"] > 0 and len(found["image"]) == 64 and found["unsteady"] == []
    json.dumps(found, allow_nan=False)
    assert gauge.device["driver"]


def test_a_pass_that_needs_a_feature_is_measured_in_a_scene_that_has_it(tmp_path, monkeypatch):
    tried = []
    monkeypatch.setattr(baseline.Gauge, "measure_in", lambda self, technique, graph, pass_name, scene: tried.append(
        (graph, scene)) or {"scene": scene})
    with heddle.Host(log=lambda *_: None) as host:
        gauge = baseline.Gauge(host, options(tmp_path, "check"), tmp_path / "log", lambda: None)
        assert gauge.measure("subdivision/catmull_clark") == {"scene": "subdivision.py"}
        assert tried == [("deferred", "subdivision.py")]
        gauge.scenes = ["cornell_box.py"]
        assert gauge.measure("subdivision/catmull_clark") == {"not_measured": "cornell_box.py has no subdivision.surface"}


# ---- What is kept in tests/baselines, on the driver and processor that made it ----

# One of each kind: a picture of its own with a reference, one at random, a function seen in the frame, one that a function shows,
# counts of its own.
FAST = ["ambient_occlusion/gtao", "ambient_occlusion/ray_traced", "sky/uniform", "function_image/shadow", "light_assignment/tiled"]


def check_kept(capsys, *names):
    """heddle baseline check against tests/baselines; skips where nothing was recorded on such a machine."""
    try:
        status = baseline.baseline(options(None, "check", *names, folder=None), lambda: None)
    except heddle.Error as error:
        if "there is no baseline of this machine and driver" in str(error):
            pytest.skip(" ".join(line.strip() for line in str(error).splitlines()[:3]))
        raise
    said = capsys.readouterr().out
    assert status == 0, (f"{said}A technique makes something else than it did. If that is meant, keep it with the change:\n"
                         "  build/bin/heddle baseline record ROLE/TECHNIQUE")


def test_what_a_handful_of_techniques_make_is_what_was_recorded(capsys):
    check_kept(capsys, *FAST)


@pytest.mark.skipif(not os.environ.get("HEDDLE_TEST_ALL"), reason="minutes: scripts/test --all runs it")
def test_what_all_techniques_make_is_what_was_recorded(capsys):
    check_kept(capsys)


def test_a_change_that_nobody_meant_shows(tmp_path, monkeypatch, capsys):
    assert baseline.baseline(options(tmp_path, "record", "ambient_occlusion/gtao"), lambda: None) == 0
    kept = next(tmp_path.rglob("gtao.json"))
    before, ask = json.loads(kept.read_text()), baseline.Open.ask

    def planted(self, do, **arguments):
        if do == "load":  # as if somebody had changed a default of the graph
            arguments["settings"] += ["ao.params.steps=3"] if "ao.technique=gtao" in arguments["settings"] else []
        return ask(self, do, **arguments)

    monkeypatch.setattr(baseline.Open, "ask", planted)
    capsys.readouterr()
    assert baseline.baseline(options(tmp_path, "check", "ambient_occlusion/gtao"), lambda: None) == 1
    said = capsys.readouterr().out
    assert f"ambient_occlusion/gtao: error rmse: {before['errors']['rmse']!r} -> " in said
    assert "ambient_occlusion/gtao: bytes of ao.visibility: differ\n" in said and "settings" not in said
    assert said.splitlines()[-1].startswith("checked 1 techniques against ") and said.splitlines()[-1].endswith(", 1 differ")
