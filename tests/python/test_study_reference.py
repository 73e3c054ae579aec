# SPDX-License-Identifier: Apache-2.0
"""What a study calls true: the role's same model, its physical reference by another role, and how sure these are."""

import argparse
import math

import numpy as np
import pytest

import heddle
from heddle import statistics as s
from heddle import study as definition
from heddle import study_items, study_run
from heddle.study_rows import error_interval, error_verdict
from heddle.study_spent import Spent

OCCLUSION = """\
role = "ambient_occlusion"
graph = "studio"
set = ["extent=[32,18]", "ao.params.radius=0.3"]
metrics = ["percentile_95"]
[[scene]]
file = "cornell_box.py"
[[variant]]
name = "screen"
technique = "gtao"
[[variant]]
name = "rays"
technique = "ray_traced"
set = ["ao.params.samples=1024"]
[[variant]]
name = "wide"
technique = "ray_traced"
set = ["ao.params.samples=256", "ao.params.radius=1"]
[reference]
truth = "physical"
set = ["physical.params.samples=64"]
parts = 4
"""


def written(tmp_path, text):
    file = tmp_path / "small.toml"
    file.write_text(text)
    return str(file)


def refusal(host, tmp_path, text):
    with pytest.raises(heddle.Error) as raised:
        definition.read(host, written(tmp_path, text))
    assert raised.value.status == 2
    return str(raised.value).replace(str(tmp_path), "")


@pytest.mark.parametrize(("before", "after", "place", "message"), [
    ('truth = "physical"', 'truth = "physcal"', "19:1", "there is no truth 'physcal'\n  expected: one of same_model, physical\n"
     "  help:     did you mean 'physical'?"),
    ('truth = "physical"', 'truth = "physical"\ntechnique = "ray_traced"', "20:1", "'truth' is the technique that the role's contract "
     "names, and 'technique' another one\n  expected: one of them"),
    ('truth = "physical"', 'truth = "physical"\nfile = "a.exr"', "19:1", "'truth' says how the reference is rendered, and 'file' that "
     "it is an image\n  expected: one of them"),
    ('role = "ambient_occlusion"', 'role = "ambient_occlusion"\nport = "display.color"', "20:1", "the physical reference of role "
     "'ambient_occlusion' shows what 'ao.visibility' does\n  found:    port = \"display.color\"\n"
     "  expected: no 'port' at the top, or that one"),
    ("physical.params.samples=64", "physical.params.sample=64", "20:1", "the graph does not take ray_tracing/path_tracer:\n"),
    ("physical.params.samples=64", "physical.params.samples=0", "20:1", "the graph does not take ray_tracing/path_tracer:\n"),
    ("parts = 4", "parts = 0", "21:1", "'parts' is out of range"),
])
def test_mistakes_are_said_at_their_lines(host, tmp_path, before, after, place, message):
    assert before in OCCLUSION
    assert f"/small.toml:{place}: error: {message}" in refusal(host, tmp_path, OCCLUSION.replace(before, after))


@pytest.mark.parametrize(("role", "message"), [
    ("sky", "role 'sky' names no physical reference\n"
     "  expected: a role that does: ambient_occlusion, lighting, ray_tracing, shadow, transparency\n"
     "  help:     [reference] with technique, graph or set"),
])
def test_a_role_without_a_physical_reference_is_said_before_anything_renders(host, tmp_path, role, message):
    text = f'reference = "physical"\nrole = "{role}"\n[[scene]]\nfile = "cornell_box.py"\n[[variant]]\nname = "it"\n'
    assert refusal(host, tmp_path, text) == f"/small.toml:1:1: error: {message}"


def test_a_point_of_another_radius_than_its_truth_is_told_at_its_line(host, tmp_path):
    """Of `wide` alone, which sets another one; of a ladder of radii once, for the first rung that is not the truth's."""
    study = definition.read(host, written(tmp_path, OCCLUSION))
    assert [text.replace(str(tmp_path), "") for text in study.warnings] == [
        "/small.toml:17:1: warning: 'wide' is compared with the truth of another radius\n  found:    ao.params.radius=1.0, and 0.3 in "
        "ray_tracing/path_tracer\n  help:     to compare it with its own, set ao.params.radius in 'set' at the top, for all"]
    ladder = OCCLUSION.replace('technique = "gtao"', 'technique = "gtao"\nknobs = { radius = [0.3, 0.5, 0.7] }')
    first, second = definition.read(host, written(tmp_path, ladder)).warnings
    assert ":10:1: warning: 'screen radius=0.5' is compared" in first and "'wide' is compared" in second
    alike = OCCLUSION.replace('"ao.params.radius=1"', '"ao.params.radius=0.3"')
    assert definition.read(host, written(tmp_path, alike)).warnings == ()
    same = OCCLUSION.replace('truth = "physical"\nset = ["physical.params.samples=64"]', 'truth = "same_model"')
    assert definition.read(host, written(tmp_path, same)).warnings == ()


def test_a_reference_of_one_part_is_warned_of(host, tmp_path):
    alike = OCCLUSION.replace('"ao.params.radius=1"', '"ao.params.radius=0.3"').replace("parts = 4", "parts = 1")
    assert [text.replace(str(tmp_path), "") for text in definition.read(host, written(tmp_path, alike)).warnings] == [
        "/small.toml:21:1: warning: of one rendering nobody knows how sure it is, and no verdict asks\n  found:    parts = 1\n"
        "  help:     2 or more; of those without randomness no more than two are made"]


def test_what_is_true_is_a_word_or_a_table(host, tmp_path):
    assert "/small.toml:1:1: error: 'reference' says what is true\n  found:    reference = 3" in refusal(
        host, tmp_path, 'reference = 3\nrole = "sky"\n[[scene]]\nfile = "cornell_box.py"\n[[variant]]\nname = "it"\n')


def test_the_same_model_is_what_a_study_takes_that_says_nothing(host, tmp_path):
    without = OCCLUSION[:OCCLUSION.index("[reference]")]
    named = definition.read(host, written(tmp_path, without + '[reference]\ntruth = "same_model"\n')).reference
    assert named == definition.read(host, written(tmp_path, without)).reference
    assert named.settings[-2:] == ("ao.technique=ray_traced", "ao.params.samples=1024")


def test_a_role_alone_may_have_its_physical_reference(host):
    study = definition.of_role(host, "lighting", ["cornell_box.py"], ["extent=[32,18]"], reference="physical")
    assert study.port == "lighting.radiance" and study.reference.port == "physical.radiance"
    assert 'technique = "path_tracer"' in study.reference.adds and "physical.params.filter=point" in study.reference.settings


def test_shadows_have_a_physical_reference_of_all_lights(host, tmp_path):
    """Rays through the same triangles by two techniques of two roles: the mean over the lights of a scene with several."""
    text = """\
role = "shadow"
set = ["extent=[48,27]"]
metrics = ["mean_difference", "rmse"]
rounds = 7
[[scene]]
file = "street.py"
arguments = { lights = 6 }
[[variant]]
name = "rays"
technique = "ray_traced"
set = ["shadow.params.samples=64"]
[[variant]]
name = "nobody"
technique = "none"
[reference]
truth = "physical"
set = ["physical.params.samples=256"]
parts = 2
"""
    study = definition.read(host, written(tmp_path, text))
    assert study.port == definition.FUNCTION_PORT and study.reference.port == "physical.shadow"
    assert "physical.params.shadow_light=-2" in study.reference.settings
    found = run_of(study, host, tmp_path).errors
    error = {name: float(np.median(each["seeds"]["rmse"])) for name, each in found.items()}
    assert error["rays"] < 0.1 * error["nobody"]


def run_of(study, host, tmp_path):
    executor = study_run.Here(None, 120, tmp_path, print, lambda: None)
    try:
        run = study_run.SceneRun(study, study.scenes[0], study_run.Store(tmp_path), argparse.Namespace(device=None, timeout=120),
                                 tmp_path, host, executor, study_items.Contents(), print, lambda: None, math.inf)
        run.identify()
        run.measure_errors()
    finally:
        executor.close()
    return run


def test_the_path_tracer_says_what_occlusion_is_and_how_sure_it_is_of_that(host, tmp_path):
    study = definition.read(host, written(tmp_path, OCCLUSION))
    # The radius is the pass's own, by another name.
    assert "physical.params.occlusion_radius=0.3" in study.reference.settings
    run = run_of(study, host, tmp_path)
    screen, rays, wide = study.points
    found = {point.name: run.errors[point.name] for point in study.points}
    # Both follow rays to what lies within the radius: nineteen pixels of twenty differ by noise alone, the rest
    # are edges that a ray through the pixel's middle takes for the other side. A pixel's variance is at most 1/4 of one ray's,
    # 1.96 sqrt(1/4/1024 + 1/4/256) = 0.069; stratified rays stay below half of that. Another radius is not within noise.
    error = {name: float(np.median(each["seeds"]["percentile_95"])) for name, each in found.items()}
    assert 0.0 < error[rays.name] < 0.035 and error[wide.name] > 0.1
    # Four independent parts: the jackknife knows their spread, and verdicts are no finer than that.
    parts = found[rays.name]["parts"]["percentile_95"]
    assert len(parts) == 4 and s.reference_floor(parts) > 0.0
    interval = error_interval(found[rays.name]["seeds"]["percentile_95"], s.reference_floor(parts))
    assert interval.high - interval.low >= 2 * s.reference_floor(parts)
    verdict, _ = error_verdict(run, wide, rays, "percentile_95", "lower")
    assert verdict.word == s.WORSE and verdict.floor > 0.0
    assert error[screen.name] > error[rays.name]  # horizons of a depth image are another model


def test_a_study_says_where_its_time_went():
    now, used = iter([0.0, 10.0, 10.0, 10.5, 20.0, 25.0]), iter([1.0, 16.0, 16.0, 16.25, 17.0, 26.0])
    spent = Spent(lambda: next(used), lambda: next(now))
    for part in ("rounds", "files", "rounds"):
        with spent.on(part):
            pass
    assert spent.rows("box") == [{"scene": "box", "part": "rounds", "s": 15.0, "processor_s": 24.0},
                                 {"scene": "box", "part": "files", "s": 0.5, "processor_s": 0.25}]
    assert spent.said() == "16 s (24 s of processors): rounds 15 s"  # 15.5 and 24.25, rounded to even and down


def test_of_processors_elsewhere_nothing_is_said():
    now = iter([0.0, 90.0])
    spent = Spent(lambda: None, lambda: next(now))
    with spent.on("rounds"):
        pass
    assert spent.rows("box")[0]["processor_s"] is None and spent.said() == "90 s: rounds 90 s"
