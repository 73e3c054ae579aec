# SPDX-License-Identifier: Apache-2.0
"""Time from knobs and resolution: three forms fitted by least squares, the one that predicts left-out points best is kept,
and it says how well it does, or that it does not.

With N pixels and knobs x (numbers as they are; choices and truths as 1 where they hold, 0 elsewhere):
  additive  t = c + c_N N + sum_k c_k N x_k                  work at every pixel that each knob adds to
  product   t = additive + sum_(j<k) c_jk N x_j x_k          loops within loops
  power     t = c N^p prod_k x_k^p_k (e^(c_k x_k) where a value is 0 or no number)
Where only one extent was measured there is no N. Residuals are relative: additive and product weigh a point by 1 / t, power
is linear in logarithms. How well a form predicts what it has not seen is computed exactly for each point left out in turn,
from the hat matrix H: the residual without the point is r_i / (1 - H_ii) (Allen 1974, "The Relationship between Variable
Selection and Data Augmentation and a Method for Prediction", PRESS). A point with H_ii = 1 is one that alone decides a
coefficient: the others say nothing about it, and the form is not considered.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import side_times
from . import statistics as s
from .study import Point, extent_setting
from .study_run import SceneRun

FITS_WITHIN = 0.10  # root mean square of the relative errors of left-out points, up to which a model is said to fit
KIND = "frames at other extents"
ROUNDS = 7  # at other extents: medians, no verdicts


@dataclasses.dataclass(frozen=True)
class Sample:
    knobs: Mapping[str, Any]
    pixels: int
    ms: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Model:
    """A fitted form, or none: then `why` says what stood against it."""

    form: str
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    predicted: tuple[float, ...]  # ms, of the samples, from all of them
    left_out: tuple[float, ...]  # ms, of each sample, from the others
    predict: Callable[[Mapping[str, Any], int], float] | None
    error: float  # root mean square of log(left_out / ms)
    worst: float
    why: str = ""

    @property
    def fits(self) -> bool:
        return self.predict is not None and self.error <= FITS_WITHIN


Columns = list[tuple[str, Callable[[Mapping[str, Any], int], float]]]


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def features(samples: Sequence[Sample]) -> list[tuple[str, bool, Callable[[Mapping[str, Any]], float]]]:
    """(name, whether all its values are above 0, value) of what differs between samples."""
    found = []
    for knob in samples[0].knobs:
        values = [each.knobs[knob] for each in samples]
        if all(map(is_number, values)):
            if len(set(values)) > 1:
                found.append((knob, min(values) > 0, lambda knobs, k=knob: float(knobs[k])))
            continue
        # The first word is what the others are told from.
        for word in list(dict.fromkeys(map(str, values)))[1:]:
            found.append((f"[{knob}={word}]", False, lambda knobs, k=knob, w=word: float(str(knobs[k]) == w)))
    return found


def columns_of(form: str, samples: Sequence[Sample]) -> Columns:
    has_extents = len({each.pixels for each in samples}) > 1
    found: Columns = [("1", lambda knobs, n: 1.0)]
    own = features(samples)
    if form == "power":
        if has_extents:
            found.append(("log N", lambda knobs, n: math.log(n)))
        for name, is_positive, value in own:
            found.append((f"log {name}", lambda knobs, n, v=value: math.log(v(knobs))) if is_positive else
                         (name, lambda knobs, n, v=value: v(knobs)))
        return found
    if has_extents:
        found.append(("N", lambda knobs, n: float(n)))
    scale = "N " if has_extents else ""

    def times(n: int) -> float:
        return float(n) if has_extents else 1.0

    for name, _, value in own:
        found.append((f"{scale}{name}", lambda knobs, n, v=value: times(n) * v(knobs)))
    if form == "product":
        for (a, _, x), (b, _, y) in itertools.combinations(own, 2):
            found.append((f"{scale}{a} {b}", lambda knobs, n, x=x, y=y: times(n) * x(knobs) * y(knobs)))
    return found


def fit_form(form: str, samples: Sequence[Sample]) -> Model:
    """samples: with times above 0 and the same knobs"""
    columns = columns_of(form, samples)
    names = tuple(name for name, _ in columns)

    def none(why: str) -> Model:
        return Model(form, names, (), (), (), None, math.inf, math.inf, why)

    times = np.array([each.ms for each in samples])
    if len(samples) < len(columns) + 2:
        return none(f"{len(samples)} points for {len(columns)} coefficients: too few to tell how well it predicts")
    rows = np.array([[value(each.knobs, each.pixels) for _, value in columns] for each in samples])
    is_power = form == "power"
    weights = np.ones(len(samples)) if is_power else 1.0 / times
    # Columns are scaled to lengths of 1: pixels are millions, truths are ones.
    weighted = rows * weights[:, None]
    lengths = np.linalg.norm(weighted, axis=0)
    if np.any(lengths == 0) or np.linalg.matrix_rank(weighted / lengths) < len(columns):
        return none("these points do not tell its terms apart")
    q, r = np.linalg.qr(weighted / lengths)
    wanted = (np.log(times) if is_power else times) * weights
    solved = np.linalg.solve(r, q.T @ wanted) / lengths
    leverage = np.sum(q * q, axis=1)
    if np.any(leverage > 1 - 1e-9):
        alone = samples[int(np.argmax(leverage))]
        return none(f"one point alone decides a term: {spell(alone)}")
    fitted = rows @ solved
    residual = (np.log(times) if is_power else times) - fitted
    without = (np.log(times) if is_power else times) - residual / (1.0 - leverage)
    predicted, left_out = (np.exp(fitted), np.exp(without)) if is_power else (fitted, without)
    # A time below 0 is as wrong as can be.
    errors = np.array([math.log(p / t) if p > 0 else -math.inf for p, t in zip(left_out, times)])

    def predict(knobs: Mapping[str, Any], pixels: int) -> float:
        total = float(sum(c * value(knobs, pixels) for c, (_, value) in zip(solved, columns)))
        return math.exp(total) if is_power else total

    return Model(form, names, tuple(map(float, solved)), tuple(map(float, predicted)), tuple(map(float, left_out)), predict,
                 float(np.sqrt(np.mean(errors**2))), float(np.max(np.abs(errors))))


def fit(samples: Sequence[Sample]) -> tuple[Model, list[Model]]:
    """(the form that predicts left-out points best, all of them); the best may have no `predict`."""
    models = [fit_form(form, samples) for form in ("additive", "product", "power")]
    return min(models, key=lambda each: each.error), models


def spell(sample: Sample) -> str:
    return " ".join([*[f"{knob}={value}" for knob, value in sample.knobs.items()], f"{sample.pixels} px"])


# ---- Of a study ----

def measure(run: SceneRun) -> list[dict[str, Any]]:
    """A model of each variant with knobs, of the frame's time: see describe(). At the study's further extents every point
    is timed for it as well."""
    points = [point for point in run.alive() if point.knobs]
    sides = [at_extent(point, extent) for point in points for extent in run.study.extents]
    # Beside a point of the study, so that a later run finds the same rounds whichever variants it has.
    rounds, lost = side_times.measure(run, KIND, [], sides, [None] * len(sides), ROUNDS) \
        if sides else ([], {})
    for name, why in lost.items():
        run.say(f"{run.scene.name}: {name}: {why}")
    found = []
    for variant in dict.fromkeys(point.variant for point in points):
        samples = samples_of(run, [point for point in points if point.variant == variant], rounds)
        if samples:
            found.append(describe(run.scene.name, variant, samples))
    return found


def estimate_seconds(run: SceneRun) -> float:
    """Of frames at other extents that are not measured yet, taken to be as slow as their pixels are many."""
    points = [point for point in run.alive() if point.knobs and point.name in run.warm]
    frame = sum(run.warm[point.name]["ms"] / 1e3 * extent[0] * extent[1] / run.pixels[point.name]
                for point in points for extent in run.study.extents)
    return side_times.seconds_of(run, KIND, [], ROUNDS, frame) if frame else 0.0


def at_extent(point: Point, extent: tuple[int, int]) -> Point:
    return Point(point.variant, point.graph, (*point.settings, extent_setting(extent)), (*point.knobs, ("extent", extent)))


def samples_of(run: SceneRun, points: Sequence[Point], rounds: Sequence[Mapping[str, float]]) -> list[Sample]:
    """Of a variant's points. A knob that a ladder leaves as it stands has the value that the technique has then."""
    own = [{name: float(np.median([np.median(turn) for other, turn in zip(each["order"], each["ms"]) if other == name]))
            for name in set(each["order"])} for each in run.rounds]
    standing = {knob: str(value).lower() if isinstance(value, bool) else value
                for point in points for knob, value in run.standing.get(point.name, {}).items()}
    knobs = list(dict.fromkeys(knob for point in points for knob, _ in point.knobs))
    samples = []
    for point in points:
        for extent, source, name in [(None, own, point.name), *[(extent, rounds, at_extent(point, extent).name)
                                                                for extent in run.study.extents]]:
            times = [each[name] for each in source if name in each]
            pixels = extent[0] * extent[1] if extent else run.pixels.get(point.name, 0)
            if times and pixels:
                middle = s.median(times)
                samples.append(Sample({knob: dict(point.knobs).get(knob, standing.get(knob)) for knob in knobs}, pixels,
                                      middle.value, middle.low, middle.high))
    return samples


def describe(scene: str, variant: str, samples: Sequence[Sample]) -> dict[str, Any]:
    """As JSON: the model, how well it predicts, its rivals, and a row for each sample.

    error_percent: of points left out in turn: root mean square and largest; noise_percent: half the median interval of the
    times themselves, below which no model can be
    """
    model, rivals = fit(samples)
    noise = float(np.median([0.5 * (each.high - each.low) / each.ms for each in samples]))
    rows = [{"knobs": dict(each.knobs), "pixels": each.pixels, "ms": each.ms, "low": each.low, "high": each.high}
            for each in samples]
    for row, whole, left in zip(rows, model.predicted, model.left_out):
        row |= {"predicted_ms": whole, "left_out_ms": left if math.isfinite(left) else None}
    return {"scene": scene, "variant": variant, "form": model.form if model.predict else None, "fits": model.fits,
            "formula": formula(model) if model.predict else "", "why": model.why, "noise_percent": 100 * noise,
            "terms": [{"term": term, "coefficient": value} for term, value in zip(model.terms, model.coefficients)],
            "error_percent": None if not model.predict else {"rms": percent(model.error), "worst": percent(model.worst)},
            "rivals": [{"form": each.form, "rms_percent": percent(each.error), "why": each.why} for each in rivals],
            "samples": rows}


def percent(log_ratio: float) -> float | None:
    return 100 * math.expm1(log_ratio) if math.isfinite(log_ratio) else None


def formula(model: Model) -> str:
    """In words of the terms; N in pixels, t in ms."""
    if model.form == "power":
        factors = [f"{math.exp(model.coefficients[0]):.4g}"]
        for term, value in zip(model.terms[1:], model.coefficients[1:]):
            factors.append(f"{term.removeprefix('log ')}^{value:.3g}" if term.startswith("log ") else f"e^({value:.3g} {term})")
        return "t = " + " ".join(factors)
    parts = [f"{value:+.4g}" + ("" if term == "1" else f" {term}") for term, value in zip(model.terms, model.coefficients)]
    return "t = " + " ".join(parts).removeprefix("+")


def print_models(models: Sequence[Mapping[str, Any]]) -> None:
    for each in models:
        print(f"\n{each['scene']}: frame time of {each['variant']} from its knobs, {len(each['samples'])} points"
              + (" (N: pixels)" if "N" in each["formula"] else ""))
        if each["form"] is None:
            print(f"  no model: {each['why']}")
            continue
        error = each["error_percent"]
        words = {key: "without bound" if value is None else f"{value:.1f} %" for key, value in error.items()}
        print(f"  {each['formula']} ms")
        print(f"  a point that it has not seen: {words['rms']} off (root mean square), {words['worst']} at worst; the times "
              f"themselves are known to {each['noise_percent']:.1f} %" + ("" if each["fits"] else
              f". It does not fit: more than {100 * FITS_WITHIN:.0f} %"))
