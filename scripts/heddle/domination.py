# SPDX-License-Identifier: Apache-2.0
"""Rungs that a cheaper one dominates: slower than another rung of their ladder, and no more accurate, beyond the noise.

Both must be seen, slower and worse, so a false report needs a false one of each that is false (an intersection-union test:
Berger 1982, "Multiparameter Hypothesis Testing and Acceptance Sampling"). As every pair of a ladder is looked at, the
statistics' FALSE_VERDICTS is shared among the pairs of the scene (Bonferroni).
Times: Hodges and Lehmann's interval of the rounds' differences, beyond the noise floor. Errors are means over many pixels:
Student's interval of the seeds' differences (none for images without randomness), beyond the reference's own variance. The
middle of both must be as large as the study says that matters: of images without randomness every difference is certain.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import metrics
from . import statistics as s
from .study import Point
from .study_run import AGAIN, SEEDS, SceneRun
from .study_rows import error_that_matters, is_finite


def measure(run: SceneRun) -> list[dict[str, Any]]:
    """Of the study's first metric: {scene, variant, knobs, by, slower [low, middle, high] as ratios of frame times minus 1,
    worse [low, middle, high] in the metric, lower being better}, the strongest cheaper rung for each that is dominated."""
    metric = run.study.metrics[0]
    sign = -1.0 if {each["name"]: each["better"] for each in metrics()}.get(metric) == "higher" else 1.0
    values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
    baseline = run.study.points[0].name
    again = [each[AGAIN] - each[baseline] for each in values if baseline in each and AGAIN in each]
    floor = s.floor_of(again) if again else 0.0
    pairs = pairs_of([point for point in run.alive() if point.name in run.errors and is_finite(run.errors[point.name], metric)])
    has_first = baseline in run.errors and is_finite(run.errors[baseline], metric)
    least = error_that_matters(run, metric) if has_first else 0.0
    found: dict[str, dict[str, Any]] = {}
    for point, other in pairs:
        both = [each for each in values if point.name in each and other.name in each]
        if not both:
            continue
        confidence = 1.0 - s.FALSE_VERDICTS / (len(pairs) // 2)  # an interval speaks for both directions
        time = s.difference([each[point.name] - each[other.name] for each in both], confidence)
        error = error_difference(run.errors[other.name], run.errors[point.name], metric, sign, confidence)
        is_slower = time.low > floor and time.value >= math.log1p(run.study.resolution)
        if not (is_slower and error.low > 0.0 and error.value >= least):
            continue
        row = {"scene": run.scene.name, "variant": point.variant, "knobs": words(point), "by": other.name,
               "slower": [math.expm1(each) for each in (time.low, time.value, time.high)],
               "worse": [error.low, error.value, error.high], "pairs": len(pairs) // 2}
        if point.name not in found or found[point.name]["worse"][0] < error.low:
            found[point.name] = row
    return list(found.values())


def words(point: Point) -> str:
    return " ".join(f"{knob}={value}" for knob, value in point.knobs)


def pairs_of(points: Sequence[Point]) -> list[tuple[Point, Point]]:
    """Ordered pairs of rungs of one ladder: a variant's points that climb the same knobs."""
    ladders: dict[tuple, list[Point]] = {}
    for point in points:
        ladders.setdefault((point.variant, tuple(knob for knob, _ in point.knobs)), []).append(point)
    return [pair for ladder in ladders.values() for pair in itertools.permutations(ladder, 2)]


def error_difference(a: dict, b: dict, metric: str, sign: float, confidence: float) -> s.Interval:
    """sign (b - a) of two points' errors, with the reference's own variance on both sides."""
    first, second = a["seeds"][metric], b["seeds"][metric]
    count = SEEDS if len(first) > 1 or len(second) > 1 else 1
    d = np.array([sign * (second[i % len(second)] - first[i % len(first)]) for i in range(count)])
    middle = float(d.mean())
    tail = 1.0 - 0.5 * (1.0 - confidence)
    reach = s.student(tail, count - 1) * float(d.std(ddof=1)) / math.sqrt(count) if count > 1 else 0.0
    parts = [y - x for x, y in zip(a["parts"][metric], b["parts"][metric])]
    if len(parts) > 1:
        reach += s.student(tail, len(parts) - 1) * s.jackknife_deviation(parts)
    return s.Interval(middle, middle - reach, middle + reach, confidence)


def print_list(found: list[dict[str, Any]], metric: str) -> None:
    for row in found:
        print(f"\n{row['scene']}: {' '.join(filter(None, (row['variant'], row['knobs'])))} is dominated by {row['by']} beyond "
              f"the noise: its frame takes {100 * row['slower'][1]:+.1f} % ({100 * row['slower'][0]:+.1f} to "
              f"{100 * row['slower'][2]:+.1f}), and its {metric} is worse by {row['worse'][1]:.3g} ({row['worse'][0]:.3g} to "
              f"{row['worse'][2]:.3g})")
