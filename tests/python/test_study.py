# SPDX-License-Identifier: Apache-2.0
"""Studies: what is wrong in a file is said before anything renders; what is lost is told while the others finish; what is
measured is kept; the table says what was measured."""

import argparse
import csv
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import threading

import numpy as np
import pytest

import heddle
from heddle import statistics as s
from heddle import study as definition
from heddle import study_items, study_run

SMALL = """\
leave_one_out = []
role = "ambient_occlusion"
graph = "studio"
set = ["extent=[32,18]"]
metrics = ["rmse", "ssim"]
rounds = 7
frames = 1
[[scene]]
file = "cornell_box.py"
camera = "front"
[[variant]]
name = "few"
technique = "gtao"
set = ["ao.params.steps=2"]
[[variant]]
name = "rays"
technique = "ray_traced"
knobs = { samples = [1, 4] }
[reference]
technique = "ray_traced"
set = ["ao.params.samples=64"]
parts = 4
"""


def options(**given):
    known = {"files": [], "role": None, "set": [], "folder": None, "device": None, "rounds": None, "budget": None,
             "timeout": 120.0, "cluster": None, "scene": [], "graph": None, "reference": None, "climb": "together", "dry_run": False, "gate": False, "quiet": True}
    return argparse.Namespace(**(known | given))


def written(tmp_path, text, name="small.toml"):
    file = tmp_path / name
    file.write_text(text)
    return str(file)


def run(tmp_path, text=SMALL, stop=lambda: None, **given):
    return study_run.run_study(options(files=[written(tmp_path, text)], folder=str(tmp_path / "out"), **given), stop)


def table(tmp_path):
    with open(tmp_path / "out" / "results.csv", newline="") as file:
        return list(csv.DictReader(file))


def refusal(host, tmp_path, text):
    with pytest.raises(heddle.Error) as raised:
        definition.read(host, written(tmp_path, text))
    assert raised.value.status == 2
    return str(raised.value).replace(str(tmp_path), "")


@pytest.fixture(scope="module", autouse=True)
def lock_of_our_own(tmp_path_factory):
    # Tests measure nothing that another study on this machine could disturb, and must not wait for it.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_items, "LOCK", tmp_path_factory.mktemp("lock") / "lock")
        study_items.fingerprint(None)  # of this machine as it is, before tests change what is seen of it
        yield


# ---- Files ----

@pytest.mark.parametrize(("before", "after", "place", "message"), [
    ('technique = "gtao"', 'technique = "gtoa"', "13:1", "there is no technique of role 'ambient_occlusion' 'gtoa'\n"
     "  expected: one of none, baked, gtao, ray_traced, ssao\n  help:     did you mean 'gtao'?"),
    ('metrics = ["rmse", "ssim"]', 'metrics = ["rsme"]', "5:1", "there is no metric 'rsme'"),
    ('"cornell_box.py"', '"cornel_box.py"', "9:1", "there is no scene 'cornel_box.py'"),
    ("rounds = 7", "round = 7", "6:1", "there is no key 'round'"),
    ("rounds = 7", "exposures = [-4, 4, inf]", "6:1", "'exposures' is a list of finite numbers\n  found:    exposures = [-4, 4, inf]"),
    ("rounds = 7", "exposures = [nan, 4, 2]", "6:1", "'exposures' is a list of finite numbers"),
    ("rounds = 7", "resolution = nan", "6:1", "'resolution' is a finite number"),
    ("rounds = 7", "rounds = 1" + 400 * "0", "6:1", "'rounds' is a whole number"),
    ("rounds = 7", "exposures = [-400, 4, 5]", "6:1", "'exposures' are start, stop and count\n  found:    [-400, 4, 5]"),
    ("rounds = 7", "exposures = [-4, 4, 1]", "6:1", "'exposures' are start, stop and count"),
    ("rounds = 7", "exposures = [-4, 4, 1001]", "6:1", "'exposures' are start, stop and count"),
    ('metrics = ["rmse", "ssim"]', 'metrics = ["percentile_200"]', "5:1", "'percentile_200' is no percentile"),
    ('metrics = ["rmse", "ssim"]', 'metrics = ["percentile_0"]', "5:1", "'percentile_0' is no percentile"),
    ('metrics = ["rmse", "ssim"]', 'metrics = ["percentile_P"]', "5:1", "there is no metric 'percentile_P'"),
    ('camera = "front"', 'camera = "nix"', "10:1", "there is no camera of scene 'cornell_box.py' 'nix'\n  expected: one of front"),
    ('camera = "front"', 'cameras = ["front", "front"]', "8:3", "scene 'cornell_box front' is there twice"),
    ('camera = "front"', 'camera = "front"\n[[scene]]\nfile = "cornell_box.py"\ncamera = "front"', "11:3",
     "scene 'cornell_box front' is there twice"),
    ('name = "rays"', 'name = ""', "16:1", "a variant's name is empty"),
    ('name = "rays"', 'name = "(reference)"', "16:1", "a variant's name is empty or begins with a parenthesis"),
    ('name = "few"', 'name = "rays samples=1"', "16:1", "a point of another variant is called 'rays samples=1' as well"),
    ("{ samples = [1, 4] }", "{ samples = [2, 2] }", "18:1", "two points have the same values of all knobs\n  found:    samples=2"),
    ('technique = "gtao"\nset = ["ao.params.steps=2"]', 'technique = "none"', "13:1",
     "without pass 'ao' there is no 'ao.visibility', the image that is compared\n  found:    technique = \"none\""),
    ("rounds = 7", "rounds = 3", "6:1", "'rounds' is out of range\n  found:    3\n  expected: 7 to 1000"),
    ("rounds = 7", 'rounds = "7"', "6:1", "'rounds' is a whole number\n  found:    rounds = '7'"),
    ('name = "rays"', 'name = "few"', "16:1", "two variants are called 'few'"),
    ("{ samples = [1, 4] }", '["sample"]', "18:1", "there is no knob of ambient_occlusion/ray_traced 'sample'\n"
     "  expected: one of samples\n  help:     did you mean 'samples'?"),
    ("{ samples = [1, 4] }", "3", "18:1", "'knobs' says which ladders are climbed"),
    ('"ao.params.steps=2"', '"ao.params.stpes=2"', "14:1", "the graph does not take these settings"),
    ('role = "ambient_occlusion"', 'role = "ambient"', "2:1", "there is no role 'ambient'"),
    ('graph = "studio"', 'graph = "stduio"', "3:1", "the graph does not take these settings"),
    ("{ samples = [1, 4] }", "{ samples = [1, 0] }", "18:1", "the graph does not take these settings"),
    ('metrics = ["rmse", "ssim"]', "metrics = []", "5:1", "'metrics' is empty"),
    ('camera = "front"', "cameras = []", "10:1", "'cameras' is empty"),
    ('technique = "gtao"\nset = ["ao.params.steps=2"]', 'graph = "furnace"', "13:1", "the variant's graph has no port 'ao.visibility'"),
    ('set = ["ao.params.samples=64"]', 'set = ["extent=[32,20]"]', "21:1", "the reference is of another size than variant 'few'\n"
     "  found:    32 x 20\n  expected: 32 x 18"),
    ("parts = 4", "parts = 0", "22:1", "'parts' is out of range"),
    ("parts = 4", "parts = ", "22:9", "this is no TOML"),
])
def test_mistakes_are_said_at_their_lines(host, tmp_path, before, after, place, message):
    assert before in SMALL
    assert f"/small.toml:{place}: error: {message}" in refusal(host, tmp_path, SMALL.replace(before, after))


def test_all_mistakes_are_said_at_once(host, tmp_path):
    text = SMALL.replace("rounds = 7", "round = 7").replace('"gtao"', '"gtoa"').replace('"ssim"', '"sim"')
    assert len(re.findall(r"^/small.toml:\d+:\d+: error:", refusal(host, tmp_path, text), re.M)) == 3


def test_a_variant_without_the_pass_is_one_where_its_port_stays(host, tmp_path):
    text = SMALL.replace('technique = "gtao"\nset = ["ao.params.steps=2"]', 'technique = "none"')
    study = definition.read(host, written(tmp_path, 'port = "display.color"\n' + text))
    assert study.points[0].settings == ("extent=[32,18]", "ao.technique=none")


def test_a_mistake_is_not_followed_by_others_that_it_makes(host, tmp_path):
    with pytest.raises(heddle.Error) as raised:
        definition.of_role(host, "light_assignment", ["cornell_box.py"], [], graph="deferred")
    errors = re.findall(r"error: (.*)", str(raised.value))
    assert len(errors) == 1 and "0 passes of role 'light_assignment'" in errors[0]
    text = refusal(host, tmp_path, SMALL.replace('role = "ambient_occlusion"', 'role = "ambient"'))
    assert len(re.findall("error:", text)) == 1
    assert len(re.findall(r"^/small.toml", refusal(host, tmp_path, SMALL.replace('"studio"', '"stduio"')), re.M)) == 1


def test_two_scenes_of_one_name_are_told_apart_or_refused(host, tmp_path, root):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "box.py").write_text((root / "scripts" / "scenes" / "cornell_box.py").read_text())
    text = SMALL.replace('"cornell_box.py"', '"a/box.py"').replace(
        "[[variant]]", '[[scene]]\nfile = "b/box.py"\ncamera = "front"\n[[variant]]', 1)
    assert (":11:3: error: two scenes are called 'box front', and would share their rows and their reference's file\n"
            "  found:    /a/box.py and /b/box.py") in refusal(host, tmp_path, text)
    text = text.replace('"b/box.py"', '"b/box.py"\ntime = 1')
    assert len(definition.read(host, written(tmp_path, text)).scenes) == 2


def test_a_scene_that_cannot_be_loaded_is_said_at_its_line(host, tmp_path):
    (tmp_path / "broken.py").write_text("def build(scene):\n    1 // 0\n")
    text = refusal(host, tmp_path, SMALL.replace("cornell_box.py", "broken.py"))
    assert ":9:1: error: the scene cannot be loaded:" in text and "division" in text


def test_a_study_without_scenes_or_variants_is_none(host, tmp_path):
    text = refusal(host, tmp_path, 'role = "ambient_occlusion"\n')
    assert "a study needs a scene" in text and "a study needs a variant" in text


def test_a_role_without_an_image_asks_for_a_port(host, tmp_path):
    text = SMALL.replace("ambient_occlusion", "gbuffer").replace('technique = "gtao"', 'technique = "raster"')
    assert "'port' says which image is compared" in refusal(host, tmp_path, text)


SHADOWS = """\
leave_one_out = []
role = "shadow"
set = ["extent=[48,27]"]
rounds = 7
frames = 1
[[scene]]
file = "cornell_box.py"
[[variant]]
name = "maps"
technique = "shadow_map"
[[variant]]
name = "no shadow"
technique = "none"
[reference]
technique = "shadow_map"
"""


def test_what_a_function_answers_is_compared_as_an_image(host, tmp_path):
    study = definition.read(host, written(tmp_path, SHADOWS))
    # Of two passes the one that has the role's own name; the other, which answers as well, is not asked.
    assert (study.port, study.pass_name, study.function_image) == (definition.FUNCTION_PORT, "shadow", "shadow")
    asked, ask = [], study_items.Worker.ask
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_items.Worker, "ask", lambda self, do, **a: asked.append((do, a)) or ask(self, do, **a))
        assert run(tmp_path, SHADOWS) == 0
    timed = [a for do, a in asked if do == "load" and a["adds"] is None]
    shown = [a for do, a in asked if do == "load" and a["adds"] is not None]
    assert {a["point"] for a in timed} == {"maps", "no shadow", study_items.AGAIN} and all(a["keep"] is None for a in timed)
    assert {a["point"] for a in shown} == {"maps (image)", "no shadow (image)", study_items.REFERENCE}
    assert [a["adds"].splitlines()[-1] for a in shown if a["point"] == "no shadow (image)"] == ["functions.shadow = []"]
    assert not any(do in ("render", "profile") and a["point"].endswith("(image)") and "seed" not in a for do, a in asked)
    rows = {row["variant"]: row for row in table(tmp_path) if row["quantity"] == "rmse"}
    assert float(rows["maps"]["value"]) == 0.0
    reference = np.load(tmp_path / "out" / "reference_cornell_box.npy")
    assert 0.0 < reference.mean() < 1.0  # some pixels are in shadow, others are not
    assert float(rows["no shadow"]["value"]) == pytest.approx(np.sqrt(np.mean((1 - reference) ** 2)), rel=1e-6)


def test_what_a_file_leaves_open_the_role_says(host, tmp_path):
    study = definition.read(host, written(tmp_path, SMALL))
    assert (study.port, study.pass_name) == ("ao.visibility", "ao")
    assert [point.name for point in study.points] == ["few", "rays samples=1", "rays samples=4"]
    assert study.points[2].settings == ("extent=[32,18]", "ao.technique=ray_traced", "ao.params.samples=4")
    no_reference = definition.read(host, written(tmp_path, SMALL[:SMALL.index("[reference]")]))
    assert "ao.technique=ray_traced" in no_reference.reference.settings
    assert "ao.params.samples=1024" in no_reference.reference.settings


def test_a_role_alone_is_a_study_of_all_its_techniques_and_knobs(host):
    study = definition.of_role(host, "ambient_occlusion", ["cornell_box.py"], ["extent=[32,18]"])
    assert {point.variant for point in study.points} == {"gtao", "ray_traced", "ssao"}
    assert study.title == "All techniques of ambient_occlusion without baked, which a graph must give a job's artifact"
    by_variant = [point for point in study.points if point.variant == "ssao"]
    assert len(by_variant) == 5 and {knob for knob, _ in by_variant[0].knobs} >= {"points", "blur_passes"}
    with pytest.raises(heddle.Error, match="did you mean 'ambient_occlusion'"):
        definition.of_role(host, "ambient_oclusion", ["cornell_box.py"], [])


@pytest.mark.parametrize("role, graph, port", [("ray_tracing", "path_traced", "path_tracer.radiance"),
                                               ("antialiasing", "supersampled", "aa.radiance")])
def test_a_role_outside_the_default_graph_is_studied_in_one_that_has_it(host, role, graph, port):
    study = definition.of_role(host, role, ["cornell_box.py"], ["extent=[32,18]"])
    assert {point.graph for point in study.points} == {graph} and study.port == port
    assert definition.of_role(host, "ambient_occlusion", ["cornell_box.py"], []).points[0].graph == "deferred"
    assert definition.of_role(host, "ambient_occlusion", ["cornell_box.py"], [], graph="studio").points[0].graph == "studio"


def test_a_role_that_makes_no_image_is_seen_in_the_graphs(host):
    study = definition.of_role(host, "gbuffer", ["cornell_box.py"], ["extent=[32,18]"])
    assert study.port == "display.color" and study.title.endswith(", seen in display.color")
    assert {point.variant for point in study.points} == {"raster"}


@pytest.mark.parametrize("role, variants", [("light_assignment", {"brute_force", "tiled"}), ("surface_material", {"ggx"}),
                                            ("sky", {"environment_map", "procedural", "uniform"})])
def test_a_role_of_functions_is_seen_in_an_image_of_what_they_answer(host, role, variants):
    study = definition.of_role(host, role, ["cornell_box.py"], ["extent=[32,18]"])
    assert study.port == definition.FUNCTION_PORT and study.function_image == role and " seen in " not in study.title
    assert {point.variant for point in study.points} == variants


def test_a_role_that_no_shipped_graph_has_asks_for_one(host):
    with pytest.raises(heddle.Error) as raised:
        definition.of_role(host, "bake_visibility", ["cornell_box.py"], [])
    assert str(raised.value).startswith("--role: error: no shipped graph of frames has a pass of role 'bake_visibility'")
    assert "--graph" in str(raised.value) and raised.value.status == 2


def test_a_study_that_is_not_there_is_told_with_the_nearest(host, tmp_path):
    with pytest.raises(heddle.Error) as raised:
        definition.read(host, "ambient_oclusion")
    lines = str(raised.value).splitlines()
    assert lines[0] == "error: there is neither a file nor a shipped study 'ambient_oclusion'"
    assert lines[-1] == "  help:     did you mean 'ambient_occlusion'?" and len(lines) == 3
    with pytest.raises(heddle.Error) as raised:
        definition.read(host, str(tmp_path))
    assert str(raised.value) == f"error: the study '{tmp_path}' cannot be read: Is a directory"


def test_shipped_studies_are_right(host, root):
    files = sorted((root / "scripts" / "studies").glob("*.toml"))
    assert files
    for file in files:
        assert definition.read(host, file.stem).points


def test_ladders_are_climbed_together():
    assert definition.rungs({"a": [1, 2, 3], "b": [5, 6]}) == [
        (("a", 1), ("b", 5)), (("a", 2), ("b", 6)), (("a", 3), ("b", 6))]


# ---- Running ----

def measured_run(study, errors):
    """What rows_of() reads of a run whose errors, by the study's one metric, are known."""
    metric, = study.metrics
    found = {name: {"seeds": {metric: seeds}, "parts": {metric: []}, "is_random": False, "machine": "m"} for name, seeds in errors.items()}
    return argparse.Namespace(study=study, scene=study.scenes[0], state={p.name: ("ok", "") for p in study.points}, rounds=[],
                              changing={}, measured={}, errors=found, foreign=None, machine="m",
                              reference_size=1.0)


@pytest.mark.parametrize(("few", "one", "four", "verdicts", "note"), [
    (np.inf, 30.0, np.inf, ["undecided", "no difference seen"], "psnr of few is infinite: equal images"),
    (30.0, np.inf, 31.0, ["undecided", "better"], "psnr of rays samples=1 is infinite: equal images"),
    (np.nan, 30.0, 31.0, ["undecided", "undecided"], "psnr of few is not a number"),
])
def test_an_error_without_a_number_is_told_and_ends_nothing(host, tmp_path, capsys, few, one, four, verdicts, note):
    study = definition.read(host, written(tmp_path, SMALL.replace('["rmse", "ssim"]', '["psnr"]')))
    rows, restless = study_run.rows_of(
        measured_run(study, {"few": [few], "rays samples=1": [one], "rays samples=4": [four]}))
    own = {row["variant"] + row["knobs"]: row for row in rows if row["quantity"] == "psnr"}
    assert [own[name]["verdict"] for name in ("rayssamples=1", "rayssamples=4")] == verdicts
    assert own["rayssamples=1"]["note"] == note
    assert study_run.gate(rows) == 2
    frames = [rows[i] | {"quantity": "frame", "verdict": ""} for i in range(len(rows))]
    study_run.print_summary(study, frames + rows, {})
    assert f"psnr: undecided against few ({note})" in capsys.readouterr().out
    study_run.write_table(tmp_path, study_run.finite(rows), {})


def test_a_first_variant_that_equals_the_reference_leaves_all_results(tmp_path):
    text = SMALL.replace('["rmse", "ssim"]', '["psnr"]').replace("samples = [1, 4]", "samples = [1]")
    text = text[:text.index("[reference]")] + '[reference]\ntechnique = "gtao"\nset = ["ao.params.steps=2"]\n'
    assert run(tmp_path, text, gate=True) in (1, 2)  # times may say "worse"; the error cannot
    rows = {row["variant"]: row for row in table(tmp_path) if row["quantity"] == "psnr"}
    assert rows["few"]["note"] == "infinite: equal images" and not rows["few"]["value"]
    assert rows["rays"]["verdict"] == s.UNDECIDED and float(rows["rays"]["value"]) > 0

@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    assert run(folder) == 0
    return folder


def test_the_table_has_every_point_and_quantity_with_its_interval(finished):
    rows = table(finished)
    points = {(row["variant"], row["knobs"]) for row in rows}
    assert points == {("few", ""), ("rays", "samples=1"), ("rays", "samples=4")}
    for quantity, unit in (("frame", "ms"), ("processor", "ms"), ("pass ao", "ms"), ("rmse", "1"), ("ssim", "1")):
        own = [row for row in rows if row["quantity"] == quantity]
        assert {(row["variant"], row["knobs"]) for row in own} == points
        for row in own:
            assert float(row["low"]) <= float(row["value"]) <= float(row["high"]) and row["unit"] == unit
    for name in ("transient_bytes", "process_bytes", "process_peak_bytes"):  # of the device, and of the host
        own = [row for row in rows if row["quantity"] == f"memory {name}"]
        assert len(own) == 3 and all(float(row["value"]) > 0 and row["unit"] == "bytes" and row["formula"] for row in own)
    assert {row["machine"] for row in rows} == {study_items.fingerprint(None)["id"]}
    assert any(row["quantity"].startswith("count ") for row in rows)
    told = {row["verdict"] for row in rows if row["against"]}
    assert told <= {s.BETTER, s.WORSE, s.SAME, s.UNDECIDED} and told
    assert all(row["state"] == "ok" for row in rows)


def test_errors_are_those_of_the_images(finished, host):
    # The point without randomness, rendered again here, against the reference that the study kept.
    reference = np.load(finished / "out" / "reference_cornell_box_front.npy")
    with host.scene() as scene, host.graph("studio", ["extent=[32,18]", "ao.params.steps=2", "ao.technique=gtao"]) as graph:
        from heddle.__main__ import load_scene

        load_scene(scene, "cornell_box.py")
        scene.use_camera(0)
        graph.keep("ao.visibility")
        graph.render(scene)
        expected = heddle.compare(graph.read("ao.visibility"), reference, "rmse")
    row = next(row for row in table(finished) if row["quantity"] == "rmse" and row["variant"] == "few")
    assert float(row["value"]) == pytest.approx(expected, rel=1e-9)
    assert float(row["high"]) > expected  # the reference's own variance


def test_more_rays_err_less_and_that_is_seen(finished):
    rows = {row["knobs"]: row for row in table(finished) if row["quantity"] == "rmse"}
    assert float(rows["samples=4"]["high"]) < float(rows["samples=1"]["low"])


def test_ssim_is_better_where_it_is_higher(finished):
    rows = {row["variant"] + row["knobs"]: row for row in table(finished) if row["quantity"] == "ssim"}
    gap = float(rows["rayssamples=4"]["value"]) - float(rows["few"]["value"])
    assert float(rows["rayssamples=4"]["difference"]) == pytest.approx(gap, abs=0.02)
    expected = s.BETTER if gap > 0 else s.WORSE
    assert rows["rayssamples=4"]["verdict"] == expected or abs(gap) < float(rows["rayssamples=4"]["smallest_seen"])


def test_the_front_is_what_nobody_beats(finished):
    rows = table(finished)
    times = {row["variant"] + row["knobs"]: float(row["value"]) for row in rows if row["quantity"] == "frame"}
    errors = {row["variant"] + row["knobs"]: row for row in rows if row["quantity"] == "rmse"}
    for name, row in errors.items():
        beaten = any(times[o] <= times[name] and float(e["value"]) <= float(row["value"]) and o != name
                     for o, e in errors.items())
        assert row["is_on_front"] == str(not beaten)


def test_there_is_a_chart(finished, host):
    chart = host.read_image(finished / "out" / "error_over_time.png")
    assert min(chart.shape[:2]) > 300 and chart.std() > 0.05


def test_json_says_what_the_table_does(finished):
    report = json.loads((finished / "out" / "results.json").read_text())
    assert len(report["rows"]) == len(table(finished))
    assert report["machine"]["processors"] == os.cpu_count()
    assert set(report["restless"]) == {"cornell_box front"}
    spent = {each["part"]: each for each in report["spent"]}
    assert {"warm-up", "errors", "rounds", "passes"} <= spent.keys() and all(each["processor_s"] > 0 for each in (
        spent["errors"], spent["rounds"]))  # of the variants' processes, or hardly anything were used
    assert {row["machine"] for row in report["rows"]} == set(report["machines"])
    assert all(each["devices"] and each["build"]["version"] == heddle.version() for each in report["machines"].values())


def test_what_is_measured_is_not_measured_again(finished, monkeypatch):
    asked = []
    ask = study_items.Worker.ask
    monkeypatch.setattr(study_items.Worker, "ask", lambda self, do, **a: asked.append((do, a.get("point"))) or ask(self, do, **a))
    measured = {file.name: file.stat().st_mtime_ns for file in (finished / "out" / "measured").iterdir()}
    before = table(finished)
    assert run(finished) == 0
    assert {file.name: file.stat().st_mtime_ns for file in (finished / "out" / "measured").iterdir()} == measured
    assert not asked  # not even a process of a variant is started
    assert table(finished) == before


def test_a_changed_variant_is_measured_again_alone(finished, tmp_path, monkeypatch):
    shutil.copytree(finished / "out", tmp_path / "out")
    before = {row["variant"] + row["knobs"]: row for row in table(tmp_path) if row["quantity"] == "frame"}
    kept = sum(len(file.read_text().splitlines()) for file in (tmp_path / "out" / "measured").glob("*.jsonl"))
    asked, ask = [], study_items.Worker.ask
    monkeypatch.setattr(study_items.Worker, "ask", lambda self, do, **a: asked.append((do, a.get("point"))) or ask(self, do, **a))
    assert run(tmp_path, SMALL.replace("samples = [1, 4]", "samples = [1, 2]")) == 0
    assert {name for do, name in asked if do == "read"} == {"rays samples=2"}  # the reference's images are there too
    assert {name for do, name in asked if do == "profile"} == {"rays samples=2"}
    assert {name for do, name in asked if do == "render"} == {"few", study_items.AGAIN, "rays samples=2"}
    rows = {row["variant"] + row["knobs"]: row for row in table(tmp_path) if row["quantity"] == "frame"}
    assert rows["rayssamples=1"]["value"] == before["rayssamples=1"]["value"]
    assert rows["rayssamples=2"]["samples"] == before["rayssamples=4"]["samples"] == "14"
    times = [json.loads(line) for file in (tmp_path / "out" / "measured").glob("*.jsonl") for line in file.read_text().splitlines()]
    assert len(times) == kept + 7 and set(times[-1]["order"]) == {"few", study_items.AGAIN, "rays samples=2"}


def test_an_interrupted_study_goes_on(tmp_path, monkeypatch):
    rounds = []
    append = study_run.Store.append

    def interrupted(self, key, value):
        append(self, key, value)
        rounds.append(value)
        if len(rounds) == 3:
            raise heddle.Error(6, "stopped")

    monkeypatch.setattr(study_run.Store, "append", interrupted)
    with pytest.raises(heddle.Error, match="stopped"):
        run(tmp_path)
    times = next((tmp_path / "out" / "measured").glob("*.jsonl"))
    times.write_text(times.read_text() + '{"round": 3, "ord')  # and in the middle of a line
    assert run(tmp_path) == 0
    kept = [json.loads(line) for line in times.read_text().splitlines()]
    assert kept[:3] == rounds[:3] and len(kept) == 7 and [each["round"] for each in kept] == list(range(7))


def test_a_study_that_goes_on_keeps_its_warnings(tmp_path, monkeypatch):
    # Many processors that others keep busy: each look finds an hour more of each, of which none are the study's.
    looks = iter(range(10**6))
    monkeypatch.setattr(os, "cpu_count", lambda: 1000)
    monkeypatch.setattr(study_items, "busy_seconds", lambda: 1000 * 3600.0 * next(looks))
    monkeypatch.setattr(s, "warm_up", lambda *_: None)
    assert run(tmp_path) == 0
    before = json.loads((tmp_path / "out" / "results.json").read_text())["restless"]["cornell_box front"]
    monkeypatch.undo()
    monkeypatch.setattr(study_items, "LOCK", tmp_path / "lock")
    monkeypatch.setattr(os, "cpu_count", lambda: 1000)
    monkeypatch.setattr(study_items, "busy_seconds", lambda: 0.0)
    assert run(tmp_path) == 0
    assert json.loads((tmp_path / "out" / "results.json").read_text())["restless"]["cornell_box front"] == before
    assert any("other programs used" in text for text in before)
    assert sum("still changing" in text for text in before) == 3


@pytest.mark.parametrize(("number", "state"), [(signal.SIGKILL, "crashed"), (signal.SIGSTOP, "hung")])
def test_a_lost_variant_is_told_while_the_others_finish(tmp_path, monkeypatch, number, state):
    ask, seen = study_items.Worker.ask, []

    def losing(self, do, **arguments):
        # In the third turn that is timed, and again when it is tried once more.
        if do == "render" and arguments["point"] == "rays samples=1" and arguments["frames"] == 2 and "seed" not in arguments:
            seen.append(self.process.pid)
            if len(seen) > 4:
                os.kill(self.process.pid, number)
                if number == signal.SIGSTOP:
                    self.timeout = 1.0  # it is not slow: nothing will come
        return ask(self, do, **arguments)

    monkeypatch.setattr(study_items.Worker, "ask", losing)
    assert run(tmp_path) == 4
    rows = table(tmp_path)
    lost = [row for row in rows if row["knobs"] == "samples=1" and row["quantity"] == "frame"]
    assert [row["state"] for row in lost] == [state] and lost[0]["note"]
    for variant, knobs in (("few", ""), ("rays", "samples=4")):
        frame = next(row for row in rows if (row["variant"], row["knobs"], row["quantity"]) == (variant, knobs, "frame"))
        assert frame["state"] == "ok" and int(frame["samples"]) >= 14
    assert not any(study_items.used_seconds(pid) for pid in set(seen))  # nobody stays behind


def test_a_second_process_of_the_first_that_is_lost_ends_nobody_else(tmp_path, monkeypatch):
    ask = study_items.Worker.ask

    def losing(self, do, **arguments):
        if do == "render" and arguments["point"] == study_items.AGAIN and arguments["frames"] == 2:
            os.kill(self.process.pid, signal.SIGKILL)
        return ask(self, do, **arguments)

    monkeypatch.setattr(study_items.Worker, "ask", losing)
    assert run(tmp_path) == 4
    rows = {row["variant"] + row["knobs"]: row for row in table(tmp_path) if row["quantity"] == "frame"}
    assert rows["few"]["state"] == "crashed" and "a second process of it" in rows["few"]["note"]
    assert {rows[name]["samples"] for name in ("rayssamples=1", "rayssamples=4")} == {"14"}


def test_a_scene_of_which_nothing_can_be_rendered_is_said_at_its_line(tmp_path, monkeypatch):
    def refusing(self, do, **arguments):
        raise study_items.Lost("failed", "it is gone\n  help: none")

    monkeypatch.setattr(study_items.Worker, "ask", refusing)
    with pytest.raises(heddle.Error, match=r"small.toml:10:1: error: nothing of scene 'cornell_box front' can be rendered\n"
                                           r"    it is gone\n      help: none"):
        run(tmp_path)


def test_a_study_beyond_its_budget_says_so_before_it_times_anything(tmp_path, monkeypatch):
    asked, ask = [], study_items.Worker.ask
    monkeypatch.setattr(study_items.Worker, "ask", lambda self, do, **a: asked.append((do, a.get("point"))) or ask(self, do, **a))
    with pytest.raises(heddle.Error, match="this study would take at least .* more; its budget is 0.001 min") as raised:
        run(tmp_path, budget=0.001)
    assert raised.value.status == 2 and not list((tmp_path / "out" / "measured").glob("*.jsonl"))
    assert {name for do, name in asked if do == "render"} == {"few"}  # the first point's frames were enough to know


def test_the_estimate_is_of_what_is_not_measured_yet(host, tmp_path):
    study = definition.read(host, written(tmp_path, SMALL))  # 7 rounds of 1 + 1 frames, twice; 1 frame settles
    machine = argparse.Namespace(place=lambda: {"id": "m"}, machines=lambda: [{"id": "m"}], width=1)
    scene = study_run.SceneRun(study, study.scenes[0], study_run.Store(tmp_path), options(), tmp_path, host, machine,
                               study_items.Contents(), print, lambda: None, 0.0)
    scene.keys = {point.name: point.name for point in study.points}
    scene.warm = {point.name: {"ms": 1000.0 * (i + 1)} for i, point in enumerate(study.points)}
    profiles, images = study_items.PROFILED_FRAMES + 2, study_items.SEEDS
    assert scene.estimate_seconds() == 7 * 2 * 2 * (2 * 1 + 2 + 3) + (profiles + images) * (1 + 2 + 3)
    few, again, one = "few", study_items.AGAIN, "rays samples=1"
    for number in range(7):  # two of three are timed
        scene.store.append(scene.times_key(), {"round": number, "order": [few, again, one], "ms": [[1.0]] * 3,
                                               "processor_ms": [[2.0]] * 3, "keys": {few: few, again: few, one: one}})
    scene.store.put(scene.profile_key(study.points[2]), {})
    scene.store.put(scene.images_key(study.points[2], "m"), {})
    assert scene.estimate_seconds() == 7 * 2 * 2 * (2 * 1 + 3) + (profiles + images) * (1 + 2)
    machine.width = 4
    assert scene.estimate_seconds() == 7 * 2 * 2 * (2 * 1 + 3) + (profiles + images / 4) * (1 + 2)


@pytest.mark.parametrize(("first_ms", "frames"), [(30.0, 32), (100.0, 22), (300.0, 12)])
def test_a_warm_up_waits_for_no_machine(tmp_path, first_ms, frames):
    """Of frames that never stop changing: as long as it may be the process itself, and no longer."""
    residents = study_items.Residents({}, None, 1.0, tmp_path, lambda: None, study_items.Contents())
    shown = [0]

    def ask(of, do, **arguments):
        shown[0] += arguments["frames"]
        return {"ms": [first_ms * 1.1**(n // 5) for n in range(shown[0] - arguments["frames"], shown[0])]}

    residents.load, residents._ask = lambda item, point: None, ask
    found = residents.warm_point({"point": {"name": "p", "owner": "v"}})
    assert (found["frames"], found["warm_after"], shown[0]) == (frames, None, frames)


def test_one_study_times_at_once(tmp_path):
    said, order = [], []
    entered, leave = threading.Event(), threading.Event()

    def first():
        with study_items.timing_alone(said.append, lambda: None):
            entered.set()
            leave.wait(20)
            order.append("first")

    thread = threading.Thread(target=first)
    thread.start()
    entered.wait(20)
    with pytest.raises(heddle.Error):  # waiting can be stopped
        with study_items.timing_alone(said.append, stopped):
            pass
    assert "another study is timing" in said[0]
    leave.set()
    with study_items.timing_alone(said.append, lambda: None):
        order.append("second")
    thread.join()
    assert order == ["first", "second"]


def test_a_lock_of_another_user_is_only_read(tmp_path, monkeypatch):
    opened, system_open = [], os.open
    lock = tmp_path / "lock"
    monkeypatch.setattr(study_items, "LOCK", lock)

    def protected(path, flags, mode=0o777, **rest):
        opened.append(flags)
        if os.path.exists(path) and flags & os.O_CREAT and not flags & os.O_EXCL:  # fs.protected_regular
            raise PermissionError(13, "Permission denied")
        if os.path.exists(path) and flags & (os.O_RDWR | os.O_WRONLY) and not flags & os.O_EXCL:
            raise PermissionError(13, "Permission denied")
        return system_open(path, flags, mode, **rest)

    monkeypatch.setattr(os, "open", protected)
    before = os.umask(0o077)
    try:
        for _ in range(2):
            said = []
            with study_items.timing_alone(said.append, lambda: None):
                with pytest.raises(heddle.Error), study_items.timing_alone(said.append, stopped):
                    pass
            assert said == [f"another study is timing on this machine ({lock}); waiting for it"]
    finally:
        os.umask(before)
    assert lock.stat().st_mode & 0o777 == 0o644


def test_a_lock_that_cannot_be_opened_is_said(tmp_path, monkeypatch):
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    monkeypatch.setattr(study_items, "LOCK", tmp_path / "link")
    monkeypatch.setattr(study_items, "OWN_LOCK", tmp_path / "own")
    said = []
    with study_items.timing_alone(said.append, lambda: None):
        with pytest.raises(heddle.Error), study_items.timing_alone(said.append, stopped):
            pass
    assert "other users' studies may time meanwhile" in said[0] and f"({tmp_path / 'own'}); waiting for it" in said[-1]
    assert not (tmp_path / "elsewhere").exists()
    monkeypatch.setattr(study_items, "OWN_LOCK", tmp_path / "missing" / "own")
    said.clear()
    with study_items.timing_alone(said.append, lambda: None):
        pass
    assert "no study waits for another" in said[-1]


def stopped():
    raise heddle.Error(6, "stopped")


@pytest.mark.parametrize(("verdicts", "states", "status"), [
    ([s.SAME, s.BETTER], ["ok"], 0), ([s.WORSE, s.UNDECIDED], ["ok"], 1), ([s.SAME, s.UNDECIDED], ["ok"], 2),
    ([s.SAME], ["crashed"], 1), ([], ["ok"], 0)])
def test_a_gate_is_for_what_is_worse(verdicts, states, status):
    rows = [{"verdict": verdict, "state": "ok"} for verdict in verdicts] + [{"state": state} for state in states]
    assert study_run.gate(rows) == status


def test_a_gate_does_not_ask_for_processors():
    assert study_run.gate([{"quantity": "processor", "verdict": s.WORSE, "state": "ok"}]) == 0


@pytest.mark.parametrize(("metric", "first", "second", "verdict"), [
    ("ssim", 0.98, 0.995, s.BETTER), ("ssim", 0.98, 0.9801, s.SAME),  # three quarters of what it lacks, and a 200th
    ("psnr", 40.0, 40.7, s.BETTER), ("psnr", 40.0, 40.1, s.SAME),  # 8 and 1 % of the root mean square
    ("mean_difference", -0.5, 0.01, s.BETTER), ("mean_difference", 0.5, -0.5, s.SAME)])
def test_what_matters_is_a_part_of_the_error(host, tmp_path, metric, first, second, verdict):
    study = definition.read(host, written(tmp_path, SMALL.replace('["rmse", "ssim"]', f'["{metric}"]')))
    rows, _ = study_run.rows_of(
        measured_run(study, {"few": [first], "rays samples=1": [second], "rays samples=4": [second]}))
    assert [row["verdict"] for row in rows if row["quantity"] == metric and row.get("verdict")] == [verdict, verdict]


@pytest.mark.parametrize(("words", "status", "said"), [
    (["--gtae"], 2, "error: heddle study has no option '--gtae'\n  expected: one of --budget, "),
    (["--gtae"], 2, "\n  help:     did you mean '--gate'? heddle study --help says what they do\n"),
    (["--output", "here"], 2, "\n  help:     did you mean '--folder'? "), (["--repeats=9"], 2, "did you mean '--rounds'? "),
    (["--climb", "eahc"], 2, "error: --climb has no 'eahc'\n  expected: one of together, each\n  help:     did you mean 'each'? "),
    (["--gate", "--rounds", "x"], 4, "'x' is no whole number"),
    (["--gate", "--rounds", "3"], 4, "error: --rounds 3"), (["--rounds", "3"], 2, "error: --rounds 3"),
    (["--folder", "/proc/nope"], 4, "error: the folder '/proc/nope' for the results cannot be made"),
    (["--gate", "--folder", "/proc/nope"], 4, "error: the folder '/proc/nope'")])
def test_no_error_is_taken_for_a_verdict(command, tmp_path, words, status, said):
    done = subprocess.run([command, "study", "-q", written(tmp_path, SMALL), *words], capture_output=True, text=True)
    assert done.returncode == status and said in done.stderr and "Traceback" not in done.stderr


def test_what_nobody_foresaw_is_no_verdict(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(definition, "read", lambda *_: 1 // 0)
    assert run(tmp_path, gate=True) == 4
    assert "ZeroDivisionError" in capsys.readouterr().err
    with pytest.raises(ZeroDivisionError):
        run(tmp_path)


def test_a_full_disk_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(study_run.Store, "put", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(heddle.Error, match="files cannot be written or read: .*No space left") as raised:
        run(tmp_path)
    assert raised.value.status == 4


def test_a_disk_that_is_full_for_a_variant_is_no_crash_of_it(tmp_path, monkeypatch):
    ask = study_items.Worker.ask

    def into_a_full_disk(self, do, **arguments):
        if do == "read":
            pathlib.Path(f"{arguments['file']}.{self.process.pid}.partial").symlink_to("/dev/full")
        return ask(self, do, **arguments)

    monkeypatch.setattr(study_items.Worker, "ask", into_a_full_disk)
    with pytest.raises(heddle.Error, match="files cannot be written or read: .*No space left on device: .*image.*\n  help:     what "
                                           "was measured before is kept") as raised:
        run(tmp_path)
    assert raised.value.status == 4
    assert not [file.name for file in (tmp_path / "out").rglob("*") if "partial" in file.name or file.name.startswith(".image")]


def test_nothing_that_was_kept_is_lost_when_the_disk_is_full(tmp_path, monkeypatch):
    store = study_run.Store(tmp_path)
    store.append("key", {"round": 0})
    path = store.path("key", ".jsonl")
    path.write_bytes(path.read_bytes() + b'{"round": 1, "or')  # half of a line that had no room

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError):
            store.append("key", {"round": 1})
    assert store.lines("key")[0] == {"round": 0}
    with monkeypatch.context() as patch:
        patch.setattr(type(tmp_path), "write_bytes", full)
        with pytest.raises(OSError):
            study_run.write(tmp_path / "results.csv", "new")
    study_run.write(tmp_path / "results.csv", "old")
    with monkeypatch.context() as patch:
        patch.setattr(type(tmp_path), "replace", full)
        with pytest.raises(OSError):
            study_run.write(tmp_path / "results.csv", "new")
    assert (tmp_path / "results.csv").read_text() == "old" and not list(tmp_path.glob(".*partial"))


def test_what_is_damaged_is_measured_again(tmp_path):
    store = study_run.Store(tmp_path)
    for number in range(3):
        store.append("key", {"round": number})
    path = store.path("key", ".jsonl")
    path.write_bytes(path.read_bytes().replace(b'"round": 1', 10 * b"\0"))  # what a crash of the machine leaves
    assert store.lines("key") == [{"round": 0}, {"round": 2}]
    store.put_image("image", np.ones((4, 3, 1), np.float32))
    assert np.array_equal(store.image("image"), np.ones((4, 3, 1)))
    whole = store.path("image", ".npy").read_bytes()
    for length in (0, 5, 100, len(whole) - 1):
        store.path("image", ".npy").write_bytes(whole[:length])
        assert store.image("image") is None
    assert store.image("none") is None


def test_a_reference_may_be_an_image(host, tmp_path):
    text = SMALL[:SMALL.index("[reference]")].replace("samples = [1, 4]", "samples = [1]") + '[reference]\nfile = "{scene}.exr"\n'
    assert ":20:1: error: there is no image '{scene}.exr'".replace("{scene}", "cornell_box_front") in refusal(host, tmp_path, text)
    (tmp_path / "cornell_box_front.exr").write_text("no picture")
    assert ":20:1: error: the reference cannot be read:\n    " in refusal(host, tmp_path, text)
    host.write_image(tmp_path / "cornell_box_front.exr", np.zeros((18, 30, 1)))
    assert (":20:1: error: the reference '/cornell_box_front.exr' is of another size than variant 'few'\n  found:    30 x 18\n"
            "  expected: 32 x 18") in refusal(host, tmp_path, text)
    assert ":21:1: error: 'parts' says how the reference is rendered" in refusal(host, tmp_path, text + "parts = 3\n")
    two = text.replace("{scene}.exr", "one.exr").replace(
        "[[variant]]", '[[scene]]\nfile = "cornell_box.py"\ncamera = "front"\ntime = 1\n[[variant]]', 1)
    assert "error: one image is the reference of several scenes" in refusal(host, tmp_path, two)
    host.write_image(tmp_path / "cornell_box_front.exr", np.full((18, 32, 1), 0.5))
    assert run(tmp_path, text) == 0
    row = next(row for row in table(tmp_path) if row["quantity"] == "rmse" and row["variant"] == "few")
    assert 0 < float(row["value"]) < 0.5


def test_the_command_studies(command, tmp_path):
    done = subprocess.run([command, "study", "--dry-run", written(tmp_path, SMALL)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[2].startswith("rays samples=4: extent=[32,18] ao.technique=ray_traced")
    wrong = subprocess.run([command, "study", written(tmp_path, SMALL.replace("gtao", "gtoa"))], capture_output=True, text=True)
    assert wrong.returncode == 2 and ":13:1: error:" in wrong.stderr


def test_without_matplotlib_there_are_tables(host, tmp_path, monkeypatch):
    from heddle import study_chart

    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    study, rows = chart_of(host, tmp_path, 0.1)
    assert study_chart.draw(study, rows, tmp_path) is None
    assert "python3-matplotlib" in study_chart.why_none(study, rows)


def chart_of(host, tmp_path, error):
    """A study and its rows for one point with an error."""
    common = {"scene": "cornell_box front", "variant": "few", "knobs": ""}
    rows = [common | {"quantity": "frame", "value": 2.0, "low": 1.9, "high": 2.1}, common | {"quantity": "rmse"}]
    if error is not None:
        rows[1] |= {"value": error, "low": error, "high": error}
    return definition.read(host, written(tmp_path, SMALL)), rows


@pytest.mark.parametrize("error", [None, 0.0])
def test_there_is_no_chart_of_nothing(host, tmp_path, error):
    from heddle import study_chart

    assert study_chart.draw(*chart_of(host, tmp_path, 0.1), tmp_path).exists()
    study, rows = chart_of(host, tmp_path, error)
    assert study_chart.draw(study, rows, tmp_path) is None
    assert not list(tmp_path.glob("*.png"))
    assert "an error above 0 of 'rmse'" in study_chart.why_none(study, rows)
