# SPDX-License-Identifier: Apache-2.0
"""What a study says beside its table: rungs that a cheaper one dominates, what frames save without a pass, ladders alone."""

import argparse
import dataclasses
import json

import numpy as np
import pytest

import heddle
from heddle import cost_model, domination, leave_one_out, side_times
from heddle import statistics as s
from heddle import study as definition
from heddle import study_chart, study_items, study_rows, study_run
from heddle.study import Point

SCENE = argparse.Namespace(name="box")


def ladder(*values, variant="v"):
    return tuple(Point(variant, "deferred", (f"ao.params.steps={value}",), (("steps", value),)) for value in values)


def measured(points, times, errors, rounds=15, noise=0.01, metric="rmse", seed=4):
    """A run of points whose true times and errors are known."""
    generator = np.random.default_rng(seed)
    names = [point.name for point in points]
    found = []
    for number in range(rounds):
        order = s.turns([*names, study_items.AGAIN], 1, number)[0]
        ms = [[times[name if name in times else names[0]] * float(np.exp(noise * generator.normal()))] for name in order]
        found.append({"order": order, "ms": ms})
    made = {name: {"seeds": {metric: list(values)}, "parts": {metric: []}} for name, values in errors.items()}
    study = argparse.Namespace(metrics=(metric,), points=points, resolution=0.02, error_resolution=0.02)
    return argparse.Namespace(study=study, scene=SCENE, rounds=found, errors=made, reference_size=1.0, alive=lambda: list(points))


def test_a_rung_that_is_slower_and_worse_is_dominated():
    points = ladder(2, 4, 8)
    run = measured(points, dict(zip((p.name for p in points), (10, 12, 14))),
                   {"v steps=2": [0.3], "v steps=4": [0.1], "v steps=8": [0.2]})
    found = domination.measure(run)
    assert [(row["knobs"], row["by"]) for row in found] == [("steps=8", "v steps=4")]
    assert found[0]["slower"][0] <= 14 / 12 - 1 <= found[0]["slower"][2]
    assert found[0]["worse"] == pytest.approx([0.1, 0.1, 0.1])


def test_of_a_metric_that_is_better_higher_the_lower_is_dominated():
    points = ladder(2, 4)
    run = measured(points, {"v steps=2": 10, "v steps=4": 12}, {"v steps=2": [40.0], "v steps=4": [30.0]}, metric="psnr")
    assert [row["knobs"] for row in domination.measure(run)] == ["steps=4"]


@pytest.mark.parametrize(("times", "errors"), [
    ((10, 12), ([0.2], [0.1])),                                  # it buys accuracy
    ((10, 10), ([0.1], [0.2])),                                  # it costs nothing
    ((10, 12), ([0.1] * 8, [0.1] * 8)),                          # nor worse
    ((10, 12), ([0.1], [0.1001])),                               # certainly worse, by nothing that matters
    ((10, 10.1), ([0.1], [0.2])),                                # nor slower by what matters
    ((10, 12), (list(0.1 + 0.05 * np.cos(np.arange(8))), list(0.1005 + 0.05 * np.sin(np.arange(8))))),  # lost in noise
])
def test_other_rungs_are_not(times, errors):
    points = ladder(2, 4)
    names = [point.name for point in points]
    assert domination.measure(measured(points, dict(zip(names, times)), dict(zip(names, errors)))) == []


def test_rungs_of_two_ladders_are_not_compared():
    points = (*ladder(2), *ladder(4, variant="w"))
    run = measured(points, {"v steps=2": 10, "w steps=4": 12}, {"v steps=2": [0.1], "w steps=4": [0.2]})
    assert domination.measure(run) == []


def test_equal_rungs_are_hardly_ever_called_dominated():
    # All pairs of a ladder share the rate of one verdict: 0.025 of 200 are 5; 13 or more have a probability below 0.002.
    points = ladder(1, 2, 3, 4)
    names = [point.name for point in points]
    generator = np.random.default_rng(11)
    false = 0
    for trial in range(200):
        errors = {name: list(0.1 + 0.01 * generator.normal(size=8)) for name in names}
        false += bool(domination.measure(measured(points, dict.fromkeys(names, 10.0), errors, noise=0.05, seed=trial)))
    assert false < 13


def test_what_dominates_is_in_the_table_and_told(capsys):
    rows = [{"scene": "box", "variant": "v", "knobs": "steps=8", "quantity": quantity} for quantity in ("rmse", "frame")]
    found = [{"scene": "box", "variant": "v", "knobs": "steps=8", "by": "v steps=4", "slower": [0.1, 0.2, 0.3],
              "worse": [0.01, 0.02, 0.03], "pairs": 3}]
    study_run.mark_dominated(rows, found, "rmse")
    assert rows[0]["dominated_by"] == "v steps=4" and "dominated_by" not in rows[1]
    domination.print_list(found, "rmse")
    assert capsys.readouterr().out == (
        "\nbox: v steps=8 is dominated by v steps=4 beyond the noise: its frame takes +20.0 % (+10.0 to +30.0), and its rmse is "
        "worse by 0.02 (0.01 to 0.03)\n")


# ---- Leaving passes out ----

class Workers:
    """Who does a study's work: frames take what the test says: {part of a point's name: ms}."""

    def __init__(self, times, refused=()):
        self.times, self.refused, self.asked = times, refused, []

    def place(self):
        return {"id": "here"}

    def at_place(self, item):
        self.asked.append(item["do"])
        try:
            return study_run.Answer("here", getattr(self, item["do"])(item))
        except study_items.Lost as lost:
            return study_run.Answer("here", lost=lost)

    def ask(self, item):
        assert item["request"] == "passes"
        return {"output": "display.color", "passes": [
            {"name": name, "role": name, "technique": f"{name}/x", "is_pruned": name == "fog"}
            for name in ("gbuffer", "ao", "material", "fog")]}

    def round(self, item):
        return {"ms": [[self.ms(name)] for name in item["order"]], "others": [0, 0], "changing": {}}

    def ms(self, name):
        return next(ms for word, ms in self.times.items() if word in name)

    def forget(self, item):
        pass


def side_run(tmp_path, workers, **study):
    points = ladder(2, 4)
    run = argparse.Namespace(
        study=argparse.Namespace(points=points, port="ao.visibility", frames=1, rounds=9, seed=0, leave_one_out=("v",), extents=(),
                                 **study),
        scene=SCENE, store=study_run.Store(tmp_path), keys={point.name: point.name for point in points}, executor=workers, warm={},
        measured={"v steps=2": {"passes": {"gbuffer": [3.0, 3.1, 2.9], "ao": [5.0] * 3}}}, deadline=float("inf"),
        say=lambda text: None, alive=lambda: list(points), pixels={}, standing={},
        item=lambda do, **more: {"do": do} | more, told=lambda name, owner: {"name": name, "owner": owner},
        ask=lambda point, request: workers.at_place({"do": "ask", "request": request}).value)

    def identify_one(name, graph, settings, keep=None):
        if any(word in name for word in workers.refused):
            raise heddle.Error(2, "deferred.toml:3:1: error: pass 'ao': nothing makes its input 'depth'\n  help: x")
        run.keys[name] = [graph, *settings]

    run.identify_one = identify_one
    return run


def test_the_cost_of_a_pass_is_the_frame_with_it_minus_without_it(tmp_path):
    workers = Workers({"without=ao": 6.0, "without=material": 9.0, "steps=2": 10.0}, refused=("without=gbuffer",))
    run = side_run(tmp_path, workers)
    found = {row["pass"]: row for row in leave_one_out.measure(run)}
    assert list(found) == ["gbuffer", "ao", "material"]  # in the order of the file, and none that does not run
    assert found["ao"]["cost_ms"] == pytest.approx([4.0, 4.0, 4.0]) and found["ao"]["own_ms"] == 5.0
    assert found["material"]["cost_ms"] == pytest.approx([1.0] * 3) and found["material"]["own_ms"] is None
    assert found["material"]["note"] == "it answers functions: its time is in those that ask it"
    assert found["gbuffer"]["cost_ms"] is None
    assert found["gbuffer"]["note"] == "it cannot be left out: pass 'ao': nothing makes its input 'depth'"
    rows = leave_one_out.table_rows("study", list(found.values()))
    assert [(row["quantity"], row["value"]) for row in rows] == [("leave-one-out ao", 4.0), ("leave-one-out material", 1.0)]
    assert set().union(*rows) <= set(study_rows.COLUMNS)
    json.dumps(list(found.values()), allow_nan=False)


def test_what_was_timed_without_a_pass_is_not_timed_again(tmp_path):
    times = {"without=ao": 6.0, "without=": 9.0, "steps=2": 10.0}
    before = leave_one_out.measure(side_run(tmp_path, Workers(times)))
    workers = Workers(times)
    assert leave_one_out.measure(side_run(tmp_path, workers)) == before
    assert "round" not in workers.asked


def test_a_side_that_is_lost_takes_only_its_own_times(tmp_path):
    class Ending(Workers):
        def ms(self, name):
            if name.endswith("without=ao"):
                raise study_items.Lost("crashed", "the process ended by SIGKILL", name)
            return super().ms(name)

    run = side_run(tmp_path, Ending({"without=": 7.0, "": 9.0}))
    found = {row["pass"]: row for row in leave_one_out.measure(run)}
    assert found["ao"]["cost_ms"] is None and "SIGKILL" in found["ao"]["note"]
    assert found["gbuffer"]["cost_ms"] == found["material"]["cost_ms"] == pytest.approx([2.0] * 3)


def test_what_is_lost_after_a_few_rounds_has_no_interval(tmp_path):
    class Ending(Workers):
        def ms(self, name):
            if name.endswith("without=ao") and self.asked.count("round") > 4:
                raise study_items.Lost("crashed", "the process ended by SIGKILL", name)
            return super().ms(name)

    run = side_run(tmp_path, Ending({"": 9.0}))
    found = {row["pass"]: row for row in leave_one_out.measure(run)}
    assert found["ao"]["rounds"] == 4 < s.FEWEST_ROUNDS and found["ao"]["cost_ms"] is None
    assert "lost after" in found["ao"]["note"] and "SIGKILL" in found["ao"]["note"]
    json.dumps(list(found.values()), allow_nan=False)


def test_without_time_left_nothing_is_timed(tmp_path):
    said = []
    run = side_run(tmp_path, Workers({"": 9.0}))
    run.deadline, run.say = 0.0, said.append
    assert all(row["cost_ms"] is None for row in leave_one_out.measure(run))
    assert "no time is left for leaving out each pass of v steps=2" in said[0]


def test_what_is_beside_the_table_is_estimated_until_it_is_there(tmp_path):
    def ready(workers):
        run = side_run(tmp_path, workers)
        run.warm, run.passes, run.pixels = {point.name: {"ms": 100.0} for point in run.alive()}, dict.fromkeys(run.keys, 4), dict.fromkeys(
            run.keys, 400)
        run.study.extents, run.rounds = ((10, 10),), []
        return run

    times = {"without=ao": 6.0, "": 9.0}
    run = ready(Workers(times))
    # 9 rounds of 2 turns of 2 frames and 12 to warm up, of the point and 4 passes: 48 x 5 x 0.1 s; two points at a quarter of
    # the pixels, 7 rounds: 40 x 2 x 0.025 s.
    assert study_run.more_seconds(run) == pytest.approx(24.0 + 2.0)
    leave_one_out.measure(run)
    assert study_run.more_seconds(ready(Workers(times))) == pytest.approx(2.0)
    cost_model.measure(run)
    assert study_run.more_seconds(ready(Workers(times))) == 0.0


def test_settings_of_a_pass_go_with_it():
    base = Point("v", "deferred", ("extent=[8,8]", "ao.params.steps=2", "aohm.params.x=1"), ())
    assert leave_one_out.without(base, "ao").settings == ("extent=[8,8]", "aohm.params.x=1", "ao.technique=none")


def test_the_extents_of_a_study_give_its_model_resolution(tmp_path):
    run = side_run(tmp_path, Workers({"extent=(10, 10)": 3.0, "": 9.0}))
    run.study.extents = ((10, 10), (40, 40))
    run.rounds = [{"order": ["v steps=2", "v steps=4"], "ms": [[5.0], [6.0]]}]
    run.pixels = dict.fromkeys(run.keys, 400)
    run.standing = dict.fromkeys(run.keys, {"steps": 2})
    found = cost_model.measure(run)
    assert {(row["pixels"], row["ms"]) for row in found[0]["samples"]} == {(400, 5.0), (400, 6.0), (100, 3.0), (1600, 9.0)}


def test_turns_of_a_round_are_averaged():
    assert side_times.mean_of_turns(["a", "b", "b", "a"], [[1, 2, 9], [4], [6], [4, 4]]) == {"a": 3.0, "b": 5.0}


# ---- What a file may say of it ----

FILE = """\
role = "ambient_occlusion"
graph = "studio"
set = ["extent=[32,18]"]
[[scene]]
file = "SCENE"
[[variant]]
name = "v"
technique = "gtao"
knobs = { steps = [2, 4], directions = [1, 2] }
"""


def read(host, tmp_path, text, scenes=()):
    (tmp_path / "box.py").write_text("def build(scene, size=1.0):\n    scene.camera((0, 0, size), (0, 0, 0), name='eye')\n")
    (tmp_path / "some.toml").write_text(text.replace("SCENE", "box.py"))
    return definition.read(host, str(tmp_path / "some.toml"), scenes)


def test_ladders_are_climbed_each_on_its_own(host, tmp_path):
    study = read(host, tmp_path, FILE + 'climb = "each"\n')
    assert [point.name for point in study.points] == ["v steps=2", "v steps=4", "v directions=1", "v directions=2"]
    assert [point.name for point in read(host, tmp_path, FILE).points] == ["v steps=2 directions=1", "v steps=4 directions=2"]
    of_role = definition.of_role(host, "ambient_occlusion", ["cornell_box.py"], ["extent=[8,8]"], "each")
    assert all(len(point.knobs) == 1 for point in of_role.points)


def test_the_first_variant_has_its_passes_left_out(host, tmp_path):
    assert read(host, tmp_path, FILE).leave_one_out == ("v",)
    assert read(host, tmp_path, "leave_one_out = []\n" + FILE).leave_one_out == ()


def test_scenes_may_have_arguments_and_be_others(host, tmp_path):
    text = FILE.replace('"SCENE"', '"SCENE"\narguments = { size = 2.5 }')
    assert [scene.name for scene in read(host, tmp_path, text).scenes] == ["box size=2.5"]
    assert [scene.name for scene in read(host, tmp_path, text, ["cornell_box.py"]).scenes] == ["cornell_box"]


@pytest.mark.parametrize(("before", "after", "message"), [
    ("[[scene]]", 'leave_one_out = ["w"]\n[[scene]]', ":4:1: error: there is no variant 'w'\n  expected: one of v"),
    ("[[scene]]", "extents = [[0, 9]]\n[[scene]]", ":4:1: error: 'extents' are pairs of pixels\n  found:    extents = [[0, 9]]"),
    ("[[scene]]", "extents = 3\n[[scene]]", ":4:1: error: 'extents' are pairs of pixels"),
    ("[[variant]]", "arguments = { sise = 1 }\n[[variant]]", ":6:1: error: the scene cannot be loaded:\n    {0}/box.py: error: in "
     "build(scene, sise=1): TypeError: build() got an unexpected keyword argument 'sise'"),
    ("[[variant]]", "arguments = { size = [1] }\n[[variant]]", ":6:1: error: 'arguments' are texts, numbers and truths by name"),
    ("knobs =", 'climb = "eech"\nknobs =', ":9:1: error: there is no way to climb 'eech'\n  expected: one of together, each\n"
     "  help:     did you mean 'each'?"),
    ("knobs = { steps = [2, 4], directions = [1, 2] }", 'climb = "each"', ":9:1: error: there are no ladders to climb"),
])
def test_mistakes_are_said_at_their_lines(host, tmp_path, before, after, message):
    with pytest.raises(heddle.Error) as raised:
        read(host, tmp_path, FILE.replace(before, after))
    assert "some.toml" + message.format(tmp_path) in str(raised.value)


def test_a_scene_of_the_command_line_that_is_not_there_is_said_there(host, tmp_path):
    with pytest.raises(heddle.Error, match="^--scene: error: there is no scene 'nix.glb'"):
        read(host, tmp_path, FILE, ["nix.glb"])


def test_a_ladder_has_a_line_of_its_own(host, tmp_path, monkeypatch):
    study = dataclasses.replace(read(host, tmp_path, FILE + 'climb = "each"\n'), metrics=("rmse",))
    rows = [{"scene": "box", "variant": "v", "knobs": point.name[2:], "quantity": quantity, "value": value + i, "low": value + i,
             "high": value + i} for i, point in enumerate(study.points) for quantity, value in (("frame", 2.0), ("rmse", 1.0))]
    rows[1]["dominated_by"] = "v steps=4"
    drawn = {}
    original = study_chart.draw_scene

    def seen(axes, *rest):
        labels = original(axes, *rest)
        drawn.update(dict.fromkeys(axes.get_legend_handles_labels()[1]))
        return labels

    monkeypatch.setattr(study_chart, "draw_scene", seen)
    study_chart.draw(study, rows, tmp_path)
    assert {"v (steps)", "v (directions)", "dominated by a cheaper rung, beyond the noise"} <= drawn.keys()


@pytest.mark.parametrize(("low", "high"), [(5400.08, 5400.12), (1.0, 1.0 + 1e-7), (0.02, 50.0), (99.0, 101.0)])
def test_no_two_numbers_of_an_axis_are_alike(low, high):
    """However narrow the view: each number lies nearer to its own tick than to half of the way to the next."""

    plt = study_chart.pyplot()
    figure, axes = plt.subplots(figsize=(6, 4))
    axes.set(xscale="log", xlim=(low, high))
    study_chart.plain_numbers(axes.xaxis)
    figure.canvas.draw()
    ticks = [tick for tick in axes.xaxis.get_majorticklocs() if low <= tick <= high]
    texts = [axes.xaxis.get_major_formatter()(tick) for tick in ticks]
    assert len(ticks) >= 2 and len(set(texts)) == len(texts)
    gap = min(b - a for a, b in zip(ticks, ticks[1:]))
    assert all(abs(float(text) - tick) < 0.5 * gap for text, tick in zip(texts, ticks))
    assert study_chart.number_text(0.02, [0.02, 50.0]) == "0.02" and study_chart.number_text(50.0, [0.02, 50.0]) == "50"
    plt.close(figure)


def test_values_beside_points_lie_over_nothing(tmp_path):

    plt = study_chart.pyplot()
    figure, axes = plt.subplots(figsize=(4, 3))
    axes.set(xscale="log", yscale="log", xlim=(1, 100), ylim=(0.1, 10))
    labels = [(10 * 1.04**i, 1.0, str(2**i)) for i in range(10)] + [(2.0, 5.0, "alone")]  # ten points on 1.5 cm
    figure.canvas.draw()
    study_chart.write_values(axes, labels)
    figure.canvas.draw()
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    places = [axes.transData.transform((x, y)) for x, y, _ in labels]
    assert "alone" in boxes and len(boxes) >= 4
    for name, box in boxes.items():
        assert not any(box.overlaps(other) for rest, other in boxes.items() if rest != name)
        assert not any(box.contains(x, y) for x, y in places)
    plt.close(figure)


def test_a_point_without_error_has_a_lane_of_its_own(host, tmp_path, monkeypatch):

    study = dataclasses.replace(read(host, tmp_path, FILE), metrics=("rmse",), unit="cd/m^2")
    rows = [{"scene": "box", "variant": "v", "knobs": point.name[2:], "quantity": quantity, "value": value, "low": value, "high": value}
            for i, point in enumerate(study.points) for quantity, value in (("frame", 2.0 + i), ("rmse", float(i)))]
    drawn = []
    monkeypatch.setattr(study_chart, "save", lambda plt, figure, file: drawn.append(figure) or file)
    assert study_chart.draw(study, rows, tmp_path) is not None
    axes = drawn[0].axes[0]
    assert axes.get_ylabel().endswith("[cd/m²]") and "v: without error" in axes.get_legend_handles_labels()[1]
    # The lane is below all points that have an error, and 0 is written beside it.
    errors = [each for each in (row["value"] for row in rows if row["quantity"] == "rmse") if each > 0]
    assert axes.transAxes.inverted().transform(axes.transData.transform((2.0, min(errors))))[1] > 0.09
    assert [text.get_text() for text in axes.texts][0] == "0"
    study_chart.pyplot().close(drawn[0])


def lit_study(host, tmp_path, arguments):
    scenes = "".join(f'[[scene]]\nfile = "SCENE"\narguments = {each}\n' for each in arguments)
    return read(host, tmp_path, FILE.replace('[[scene]]\nfile = "SCENE"\n', scenes))


def test_scenes_that_differ_in_one_number_are_an_axis(host, tmp_path):

    study = lit_study(host, tmp_path, ["{ size = 1 }", "{ size = 4 }", "{ size = 2.5 }"])
    assert study_chart.arguments_of(study) == ("size", {"box size=1": 1.0, "box size=4": 4.0, "box size=2.5": 2.5})
    rows = [{"scene": scene.name, "variant": "v", "knobs": point.name[2:], "quantity": "frame", "value": 2.0 + i, "low": 1.9, "high": 6.0}
            for i, scene in enumerate(study.scenes) for point in study.points]
    chart = study_chart.draw_over_scenes(study, rows, tmp_path)
    image = host.read_image(chart)
    assert min(image.shape[:2]) > 300 and image.std() > 0.05
    assert study_chart.draw_over_scenes(study, [], tmp_path) is None and not chart.exists()  # of another run


def test_other_scenes_are_none(host, tmp_path):

    assert study_chart.arguments_of(read(host, tmp_path, FILE)) is None
    assert study_chart.arguments_of(lit_study(host, tmp_path, ["{ size = -1 }", "{ size = 2 }"])) is None  # no logarithm
    mixed = FILE.replace("[[variant]]", '[[scene]]\nfile = "cornell_box.py"\n[[variant]]')
    assert study_chart.arguments_of(read(host, tmp_path, mixed)) is None


def test_fewer_lights_shine_in_the_same_street(host):
    from heddle.__main__ import load_scene

    counts = {}
    for lights in (32, 512):
        with host.scene() as scene:
            load_scene(scene, "street.py", arguments={"lights": lights})(scene, 1.0)
            counts[lights] = scene.describe()["counts"]
    assert counts[32]["lights"] == 32 and counts[512]["lights"] == 512
    assert counts[32]["triangles"] == counts[512]["triangles"] and counts[32]["instances"] == counts[512]["instances"]


def test_the_front_of_a_chart_is_what_no_other_point_beats_in_its_own_time():
    assert study_chart.front_of([(3, 1), (1, 5), (2, 5), (2, 3), (4, 1), (5, 0.5)]) == [(1, 5), (2, 3), (3, 1), (5, 0.5)]
    assert study_chart.front_of([(1, 1), (1, 1)]) == [(1, 1)] and study_chart.front_of([]) == []
