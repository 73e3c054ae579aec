# SPDX-License-Identifier: Apache-2.0
"""heddle tune: what is chosen was measured and keeps to its bound, what is written is a graph, and what the choice misses in
views that took no part is said. Times are made up here."""

import argparse
import itertools
import json
import math
import tomllib

import pytest

import heddle
from heddle import study_items, study_rows, study_run, tune
from heddle.tune import Bound, Guess, Option, Seen, around, choose, combine, front


def seen(ms, error, spread=0.01):
    return Seen(ms, ms * (1 - spread), ms * (1 + spread), error, error * (1 - spread), error * (1 + spread))


# ---- What is asked ----

@pytest.mark.parametrize(("text", "ms"), [("4ms", 4.0), ("0.1 s", 100.0), ("900us", 0.9), (".5ms", 0.5)])
def test_budgets_have_units(text, ms):
    assert tune.read_budget(text) == Bound("frame", pytest.approx(ms))


@pytest.mark.parametrize("text", ["4", "ms", "-4ms", "0ms", "4 min", "nan ms", "1e3ms"])
def test_a_budget_that_is_none_is_said(text):
    with pytest.raises(heddle.Error, match="is no time of a frame\n  expected: a number above 0 with its unit: 4ms"):
        tune.read_budget(text)


def test_errors_are_bounds_of_a_metric():
    assert tune.read_error("flip=0.02") == Bound("flip", 0.02)
    assert tune.read_error("psnr=40") == Bound("psnr", 40.0, True)
    for text in ("flip", "flip=", "flip=x", "flip=nan", "0.02"):
        with pytest.raises(heddle.Error, match="is no bound\n  expected: METRIC=NUMBER"):
            tune.read_error(text)
    with pytest.raises(heddle.Error, match="there is no metric 'flop'\n  expected: one of .*\n  help:     did you mean 'flip'"):
        tune.read_error("flop=1")


# ---- Choosing ----

def passes_of(seed, counts=(5, 4, 6)):
    import random

    generator = random.Random(seed)
    return [[(Option((f"p{i}.params.k={j}",)), generator.uniform(-1, 3), generator.uniform(0, 1)) for j in range(n)]
            for i, n in enumerate(counts)]


@pytest.mark.parametrize("seed", range(5))
def test_the_front_of_all_combinations_is_exact(seed):
    passes = passes_of(seed)
    every = [Guess(tuple(o for o, _, _ in chosen), 10 + sum(t for _, t, _ in chosen),
                   math.sqrt(sum(e * e for _, _, e in chosen))) for chosen in itertools.product(*passes)]
    expected = [(g.ms, g.error) for g in every if not any(
        o.ms <= g.ms and o.error <= g.error and (o.ms, o.error) != (g.ms, g.error) for o in every)]
    found = [(g.ms, g.error) for g in combine(10.0, passes)]
    assert len(found) == len(expected) and found == [pytest.approx(each, rel=1e-12) for each in sorted(expected)]


def test_what_lies_around_a_bound_is_tried_nearest_first():
    guesses = [Guess((), float(ms), 10.0 - ms) for ms in range(10)]
    assert [g.ms for g in around(guesses, lambda g: g.ms <= 5, True, 4)] == [5, 4, 3, 6]
    assert [g.ms for g in around(guesses, lambda g: g.error <= 5, False, 4)] == [5, 6, 7, 4]
    assert [g.ms for g in around(guesses, lambda g: True, True, 2)] == [9, 8]
    assert [g.ms for g in around(guesses, lambda g: True, False, 2)] == [0, 1]
    assert [g.ms for g in around(guesses, lambda g: False, True, 2)] == [0, 1]


def test_only_what_keeps_to_the_bound_with_its_whole_interval_is_chosen():
    measured = {"fast": seen(3.0, 0.3), "good": seen(3.9, 0.1), "close": seen(3.99, 0.05), "slow": seen(8.0, 0.01)}
    assert choose(measured, Bound("frame", 4.0), False) == "good"
    assert choose(measured, Bound("rmse", 0.2), False) == "good"
    assert choose(measured, Bound("rmse", 0.1005), False) == "close"
    assert choose(measured, Bound("frame", 1.0), False) is None
    higher = {"a": seen(3.0, 30.0), "b": seen(4.0, 41.0), "c": seen(5.0, 50.0)}
    assert choose(higher, Bound("psnr", 40.0, True), True) == "b"
    assert choose(higher, Bound("frame", 4.5), True) == "b"


def test_the_worst_of_all_views_counts():
    views = {"a": {"x": seen(3.0, 0.2)}, "b": {"x": seen(4.0, 0.1)}}
    found = tune.worst(views, "x", False)
    assert (found.ms, found.error) == (4.0, 0.2) and found.ms_high == pytest.approx(4.04)
    assert tune.worst(views, "x", True).error == 0.1
    assert tune.worst({**views, "c": {}}, "x", False) is None


def test_a_miss_says_whether_it_could_be_noise():
    elsewhere = {"kept": {"tuned": seen(3.0, 0.1)}, "near": {"tuned": seen(3.99, 0.1)}, "over": {"tuned": seen(4.01, 0.1)},
                 "far": {"tuned": seen(6.0, 0.1), "as it is": seen(9.0, 0.2)}, "lost": {}}
    lines, misses = tune.check_lines(elsewhere, Bound("frame", 4.0), "flip")
    assert misses == ["over", "far", "lost"]
    assert [line.split(": ")[1] for line in lines] == [
        "kept", "kept, but its interval reaches beyond", "MISSED, within what was seen of noise", "MISSED", "MISSED"]
    assert lines[3].endswith("as it was: 9 ms (8.91 to 9.09), flip 0.2 (0.198 to 0.202)")
    assert tune.check_lines({"a": {"tuned": seen(1.0, 39.0)}}, Bound("psnr", 40.0, True), "psnr")[1] == ["a"]


def test_options_are_ladders_together_and_each_alone():
    technique = {"name": "t", "parameters": [{"name": "a", "type": "int", "ladder": [1, 2]},
                                             {"name": "b", "type": "bool", "ladder": [0, 1]},
                                             {"name": "c", "type": "float", "ladder": []}]}
    found = [each.settings for each in tune.options_of("p", technique, {"a": 2, "b": False, "c": 1.0}, False)]
    assert found == [(), ("p.params.a=1", "p.params.b=false"), ("p.params.a=2", "p.params.b=true")]
    swapped = tune.options_of("p", technique, {"a": 2, "b": False, "c": 1.0}, True)
    assert swapped[0].settings == ("p.technique=t", "p.params.a=1", "p.params.b=false")
    assert tune.most_accurate("p", technique, False) == ("p.params.a=2", "p.params.b=true")


# ---- What is written ----

def test_the_overlay_says_all_settings_once(tmp_path):
    text = tune.overlay("deferred", ["extent=[64,36]", "ao.params.steps=4", "params.exposure=12", "ao.technique=ssao",
                                     "ao.params.steps=8"], ["ao", "gbuffer"], ["why", ""])
    assert text == ('# why\n#\nextends = "deferred"\nextent = [64,36]\nparams.exposure = 12\n\n[[pass]]\nname = "ao"\n'
                    'technique = "ssao"\nparams.steps = 8\n')
    assert tomllib.loads(text)["pass"][0]["params"] == {"steps": 8}


def test_a_graph_is_extended_from_where_the_overlay_lies(tmp_path, monkeypatch):
    (tmp_path / "graphs").mkdir()
    (tmp_path / "graphs" / "mine.toml").write_text('extends = "deferred"\n')
    monkeypatch.chdir(tmp_path)
    assert tune.extends_of("graphs/mine.toml", tmp_path / "out" / "tuned.toml") == "../graphs/mine.toml"
    assert tune.extends_of("deferred", tmp_path / "tuned.toml") == "deferred"


def test_what_the_host_does_not_take_is_not_written(tmp_path):
    output = tmp_path / "tuned.toml"
    output.write_text("before")
    with pytest.raises(heddle.Error, match="no technique 'gtoa'"):
        tune.write_checked(None, output, 'extends = "deferred"\n[[pass]]\nname = "ao"\ntechnique = "gtoa"\n')
    assert output.read_text() == "before" and [file.name for file in tmp_path.iterdir()] == ["tuned.toml"]


# ---- The command, with times made up ----

def arguments(tmp_path, **given):
    known = {"files": ["atrium.py"], "budget": None, "error": None, "metric": None, "port": None, "passes": ["ao"], "techniques": False,
             "set": ["extent=[64,36]"], "reference_set": [], "parts": 1, "overlay": [], "camera": [], "time": [], "check_camera": [],
             "check_time": [], "output": str(tmp_path / "tuned.toml"), "folder": str(tmp_path / "out"), "rounds": 9, "frames": 2,
             "settle": 1, "minutes": 30.0, "timeout": 60.0, "device": None, "dry_run": False, "quiet": True}
    return argparse.Namespace(**(known | given))


@pytest.fixture
def made_up(monkeypatch):
    """Frames of atrium: 10 ms + 1 ms for each step and direction; errors fall with both. In other cameras it is `slower`."""
    measured = []

    def measure(self, title, views, points, truth, parts):
        measured.append((title, [view.name for view in views], [point.name for point in points], tuple(truth)))
        found = {}
        for view in views:
            found[view.name] = {}
            for point in points:
                knobs = {"steps": 8, "directions": 2} | {key.rpartition(".")[2]: int(value) for key, value in (
                    setting.split("=") for setting in point.settings) if ".params." in key and value.isdigit()}
                ms = 10.0 + knobs["steps"] + knobs["directions"] + (made_up_slower if view.camera != "court" else 0.0)
                found[view.name][point.name] = seen(ms, 0.3 / knobs["steps"] + 0.1 / knobs["directions"], 0.001)
        return found

    made_up_slower = 0.0

    def slower(ms):
        nonlocal made_up_slower
        made_up_slower = ms

    monkeypatch.setattr(tune.Bench, "measure", measure)
    monkeypatch.setattr(tune, "passes_that_run", lambda bench, view: {"gbuffer", "ao", "shadow", "display"})
    measure.slower, measure.measured = slower, measured
    return measure


def test_the_most_accurate_within_a_budget_is_written_and_checked_elsewhere(made_up, tmp_path, capsys):
    assert tune.tune(arguments(tmp_path, budget="25ms"), lambda: None) == 0
    text = (tmp_path / "tuned.toml").read_text()
    made = tomllib.loads(text)
    assert made["extends"] == "deferred" and made["extent"] == [64, 36]
    knobs = {"steps": 8, "directions": 2} | made["pass"][0]["params"]
    assert 10 + knobs["steps"] + knobs["directions"] <= 25
    # Of all that was tried nothing better keeps to it.
    report = json.loads((tmp_path / "out" / "tune.json").read_text())
    within = [each["seen"]["error"] for each in report["tried"] if each["seen"]["ms_high"] <= 25]
    assert report["seen"]["error"] == min(within)
    titles = [title for title, _, _, _ in made_up.measured]
    assert titles == ["tune ao", "tune together", "tune check"]
    assert made_up.measured[0][1] == ["atrium court"] and made_up.measured[2][1] == ["atrium gallery", "atrium fountain"]
    assert "# Checked in atrium gallery: kept: " in text and "MISSED" not in text
    with heddle.Host() as host, host.graph(str(tmp_path / "tuned.toml")) as graph:
        assert graph.get("ao.params.steps") == knobs["steps"]


def test_misses_are_said_written_and_the_exit_status(made_up, tmp_path, capsys):
    made_up.slower(5.0)
    assert tune.tune(arguments(tmp_path, budget="25ms"), lambda: None) == 1
    assert "# Checked in atrium gallery: MISSED: " in (tmp_path / "tuned.toml").read_text()
    assert "in atrium fountain: MISSED: " in capsys.readouterr().out


def test_the_fastest_within_an_error_is_chosen(made_up, tmp_path):
    assert tune.tune(arguments(tmp_path, error="rmse=0.1"), lambda: None) == 0
    report = json.loads((tmp_path / "out" / "tune.json").read_text())
    within = [each["seen"]["ms"] for each in report["tried"] if each["seen"]["error_high"] <= 0.1]
    assert report["seen"]["ms"] == min(within) and report["seen"]["error_high"] <= 0.1


def test_without_a_choice_nothing_is_written(made_up, tmp_path, capsys):
    assert tune.tune(arguments(tmp_path, budget="5ms"), lambda: None) == 1
    said = capsys.readouterr().out
    assert "Nothing that was measured keeps to frames of 5 ms at most with its whole interval. No overlay was written." in said
    assert "The nearest: ao.directions=1 ao.steps=2 with 13 ms" in said
    assert not (tmp_path / "tuned.toml").exists()


def test_a_scene_without_other_cameras_is_checked_from_made_ones(made_up, tmp_path, capsys):
    assert tune.tune(arguments(tmp_path, files=["cornell_box.py"], budget="40ms"), lambda: None) == 0
    names = made_up.measured[-1][1]
    assert names == ["cornell_box check.scene left", "cornell_box check.scene right", "cornell_box check.scene above"]
    with heddle.Host() as host, host.scene() as scene:
        scene.load(str(tmp_path / "out" / "check.scene.toml"))
        assert scene.describe()["cameras"] == ["left", "right", "above"]


@pytest.fixture
def without_a_clock(monkeypatch):
    """Real frames and errors, with times by the number of rays: 1 ms and 1 us for each."""
    def measure_times(run):
        def ms(point):
            return 1.0 + 1e-3 * next((int(each.partition("samples=")[2]) for each in reversed(point.settings) if "samples=" in each), 64)

        turns = [(point.name, [ms(point)]) for point in run.alive()] + [(study_items.AGAIN, [ms(run.baseline)])]
        turns += turns[::-1]
        times = [each for _, each in turns]
        run.rounds = [{"order": [name for name, _ in turns], "ms": times, "processor_ms": times}] * run.study.rounds
        run.machine = run.executor.place()["id"]

    monkeypatch.setattr(study_run.SceneRun, "measure_times", measure_times)
    monkeypatch.setattr(study_run.SceneRun, "warm_up", lambda run: None)
    monkeypatch.setattr(study_items, "SEEDS", 3)  # of eight: the middle of three is enough to tell 1 ray from 1024
    monkeypatch.setattr(study_run, "SEEDS", 3)
    monkeypatch.setattr(study_rows, "SEEDS", 3)


def test_errors_of_real_frames_choose_a_rung_and_check_it_elsewhere(without_a_clock, tmp_path, capsys):
    # Corner and boxes fill more of the picture from the left than from the front, where walls are far: the same rays err more.
    file = tmp_path / "views.scene.toml"
    file.write_text('[[camera]]\nname = "far"\nposition = [0, 1, 9]\ntarget = [0, 1, 0]\n'
                    '[[camera]]\nname = "corner"\nposition = [0.2, 0.5, 0.2]\ntarget = [-1, 0, -1]\n')
    given = {"files": ["cornell_box.py"], "overlay": [str(file)], "camera": ["far"], "check_camera": ["corner"],
             "set": ["extent=[32,18]", "ao.technique=ray_traced"], "port": "ao.visibility", "rounds": 7, "frames": 1}
    assert tune.tune(arguments(tmp_path, error="rmse=0.05", **given), lambda: None) == 1
    report = json.loads((tmp_path / "out" / "tune.json").read_text())
    tried = {each["settings"][-1] if each["settings"] else "as it is": each["seen"] for each in report["tried"]}
    within = {name: each["ms"] for name, each in tried.items() if each["error_high"] <= 0.05}
    chosen = report["chosen"][-1]
    assert within[chosen] == min(within.values()) and len(within) < len(tried)
    # Noise falls with the root of the rays: no two rungs of the ladder, four times apart, are within noise of each other.
    by_rays = [each["error"] for _, each in sorted(tried.items(), key=lambda item: item[1]["ms"])]
    assert by_rays == sorted(by_rays, reverse=True)
    elsewhere = report["elsewhere"]["cornell_box views.scene corner"]["tuned"]
    assert elsewhere["error"] > 0.05 >= report["seen"]["error_high"] and report["misses"] == ["cornell_box views.scene corner"]
    said = f"corner: MISSED: {tune.spell(tune.Seen(**elsewhere), 'rmse')}; as it was: "
    assert said in capsys.readouterr().out and said in (tmp_path / "tuned.toml").read_text()


@pytest.mark.parametrize(("given", "message"), [
    ({}, "heddle tune needs one bound"),
    ({"budget": "4ms", "error": "flip=1"}, "heddle tune needs one bound"),
    ({"error": "flip=1", "metric": "rmse"}, "expected: one metric"),
    ({"budget": "4ms", "files": ["deferred"]}, "heddle tune needs a scene"),
    ({"budget": "4ms", "camera": ["cort"]}, "the scene has no camera 'cort'\n  expected: one of court, gallery, fountain"),
    ({"budget": "4ms", "camera": ["court"], "check_camera": ["court"]}, "view 'atrium court' is to choose and to check"),
    ({"budget": "4ms", "passes": ["aoo"]}, "--pass aoo: no pass of the frame has that name\n  expected: one of gbuffer, ao"),
    ({"budget": "4ms", "passes": ["display"]}, "--pass display: display/linear has no knobs"),
    ({"budget": "4ms", "port": "ao.x"}, "the graph has no image port 'ao.x'"),
    ({"budget": "4ms", "rounds": 3}, "--rounds 3\n  expected: at least 7"),
    ({"budget": "4ms", "set": ["ao.technique=gtoa"]}, "no technique 'gtoa'"),
])
def test_mistakes_are_said(made_up, tmp_path, given, message):
    with pytest.raises(heddle.Error) as raised:
        tune.tune(arguments(tmp_path, **given), lambda: None)
    assert message in str(raised.value) and raised.value.status == 2
    assert not made_up.measured
