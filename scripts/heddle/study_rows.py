# SPDX-License-Identifier: Apache-2.0
"""What a study found as rows of one table: intervals, verdicts, what stands on the front; its files, and its words."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import os
import pathlib
import shlex
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import metrics
from . import statistics as s
from . import study_images as images
from .study import Point, Study
from .study_items import AGAIN, REFERENCE, SEEDS, own

if TYPE_CHECKING:
    from .study_run import SceneRun


def write(path: pathlib.Path, content: str | bytes) -> None:
    """The file is whole or not there, and what stood there before stays until then."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def write_image(path: pathlib.Path, pixels: np.ndarray) -> None:
    content = io.BytesIO()
    np.save(content, pixels)
    write(path, content.getvalue())


COLUMNS = ["study", "scene", "variant", "knobs", "state", "quantity", "unit", "value", "low", "high", "confidence", "samples",
           "against", "verdict", "difference", "difference_low", "difference_high", "floor", "smallest_seen", "is_on_front",
           "formula", "note", "machine", "dominated_by", "matters", "rounds_needed"]
# Two clocks of a frame, by their quantities: what a row of each is made of.
TIMES = {
    "frame": ("ms", "median over turns, submission to last fence; difference: of logarithms"),
    "processor": ("processor_ms", "median over turns, of all threads of the variant's process, from recording to last fence; "
                                  "difference: of logarithms"),
}
# What differs by less than this of the reference's own size is arithmetic, not a technique: a fortieth of an 8-bit step.
NEGLIGIBLE = 1e-4


MEMORY = {
    "process_bytes": "resident memory of the variant's process, all its points and the scene in it",
    "process_peak_bytes": "the most of that, up to this point's profile",
    "transient_bytes": "of the device, images and buffers that share memory within a frame",
    "transient_bytes_without_aliasing": "of the device, if they shared none",
    "kept_bytes": "of the device, what outlasts a frame",
}


class Compared:
    """Times of a scene's points against the first one's, by one clock: the same rounds, the same machine, one noise."""

    def __init__(self, run: SceneRun, clock: str):
        baseline = run.study.points[0].name
        values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each[clock]]) for each in run.rounds]
        # The first point itself may have been lost: then there is nothing to compare with.
        values = [each for each in values if baseline in each]
        self.differences: dict[str, list[float]] = {}  # of logarithms, one a round
        for each in values:
            for name in each:
                if name != baseline:
                    self.differences.setdefault(name, []).append(each[name] - each[baseline])
        self.floor = s.floor_of(self.differences[AGAIN]) if AGAIN in self.differences else 0.0
        self._noise: dict[int, s.Noise] = {}  # by rounds

    def noise(self, rounds: int) -> s.Noise:
        if rounds not in self._noise:
            self._noise[rounds] = s.noise(list(self.differences.values()), rounds)
        return self._noise[rounds]

    def verdict(self, name: str, matters: float) -> tuple[s.Verdict, s.Noise]:
        own = self.differences[name]
        return s.decide(own, self.floor, matters), self.noise(len(own))


def rows_of(run: SceneRun) -> tuple[list[dict], list[str]]:
    """One row for each point and quantity, and what speaks against the machine."""
    study, rows = run.study, []
    baseline = study.points[0]
    better = {each["name"]: (each["better"], each["formula"]) for each in metrics()}

    def row(point: Point, quantity: str, unit: str, interval: s.Interval | None = None, samples: int = 0, **more: Any) -> None:
        state, text = run.state[point.name]
        rows.append({"study": study.name, "scene": run.scene.name, "variant": point.variant,
                     "knobs": " ".join(f"{knob}={value}" for knob, value in point.knobs), "state": state, "quantity": quantity,
                     "unit": unit, "samples": samples, "note": text.split("\n")[0] if state != "ok" else ""} | more)
        if interval is not None:
            rows[-1] |= {"value": interval.value, "low": interval.low, "high": interval.high,
                         "confidence": interval.confidence}

    def told(verdict: s.Verdict, noise: s.Noise) -> dict[str, Any]:
        return {"against": baseline.name, "verdict": verdict.word, "difference": verdict.difference.value,
                "difference_low": verdict.difference.low, "difference_high": verdict.difference.high, "floor": verdict.floor,
                "smallest_seen": verdict.smallest_seen(noise), "matters": verdict.matters}

    def told_time(verdict: s.Verdict, noise: s.Noise) -> dict[str, Any]:
        needed = verdict.rounds_needed(noise) if verdict.word == s.UNDECIDED else None
        return told(verdict, noise) | ({"rounds_needed": needed} if needed is not None else {})

    compared = {quantity: Compared(run, clock) for quantity, (clock, _) in TIMES.items()}
    restless: list[str] = []
    for point in study.points:
        if run.state[point.name][0] != "ok":
            row(point, "frame", "ms")
            continue
        frames = [ms for each in run.rounds for name, turn in zip(each["order"], each["ms"]) if name == point.name for ms in turn]
        if frames:
            for quantity, (clock, formula) in TIMES.items():
                turns = [float(np.median(turn)) for each in run.rounds for name, turn in zip(each["order"], each[clock])
                         if name == point.name]
                own = compared[quantity]
                row(point, quantity, "ms", s.median(turns), len(frames), formula=formula, machine=run.machine,
                    **(told_time(*own.verdict(point.name, math.log1p(study.resolution))) if point.name in own.differences else {}))
                if point is baseline:
                    row(point, f"{quantity} noise floor", "log ratio", s.difference(own.differences[AGAIN]),
                        len(own.differences[AGAIN]), formula="the same variant against itself, in another process",
                        machine=run.machine)
            if point is baseline:
                certain = s.certain_difference(compared["frame"].differences[AGAIN])
                restless = s.unrest(frames, certain, math.log1p(study.resolution), run.foreign)
        if point.name in run.changing:
            restless.append(f"frames of {point.name} were still changing after {run.changing[point.name]} of them")
        if found := run.measured.get(point.name):
            for name, times in found["passes"].items():
                row(point, f"pass {name}", "ms", s.median(times), len(times), formula="submitted and waited for stage by stage",
                    machine=found["machine"])
            for name, value in found["memory"].items():
                row(point, f"memory {name}", "bytes", value=value, formula=MEMORY.get(name, ""), machine=found["machine"])
            for name, value in found["counters"].items():
                if isinstance(value, (int, float)):
                    unit = next((unit for unit in ("ms", "bytes") if name.endswith(f"_{unit}")), "1")
                    row(point, f"count {name}", unit, value=value, machine=found["machine"])
        by = run.errors.get(point.name, {}).get("machine", "")
        for metric, errors in run.errors.get(point.name, {}).get("seeds", {}).items():
            parts = run.errors[point.name]["parts"][metric]
            direction, formula = better.get(metric, ("lower", "P-th percentile of |a-b|, nearest rank"))
            is_compared = point is not baseline and baseline.name in run.errors
            if not is_finite(run.errors[point.name], metric):
                more = unmeasured(run, point, baseline, metric) if is_compared else {}
                row(point, metric, "1", samples=len(errors), formula=formula, machine=by, **{"note": why_not_finite(errors)} | more)
                continue
            own = s.reference_floor(parts) if len(parts) > 1 else 0.0
            interval = error_interval(errors, own)
            more = {}
            if is_compared and is_finite(run.errors[baseline.name], metric):
                more = told(*error_verdict(run, point, baseline, metric, direction))
            elif is_compared:
                more = unmeasured(run, point, baseline, metric)
            row(point, metric, "1", interval, len(errors), formula=formula, machine=by, **more)
    return rows, restless


def made_by(run: SceneRun) -> dict:
    """What made a scene's numbers: enough to make any of them again, and to show its image and its frame."""
    reference = run.study.reference
    values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
    return {
        "scene": run.scene.name, "file": absolute(run.scene.file), "camera": run.scene.camera, "time": run.scene.time,
        "overlays": [absolute(each) for each in run.scene.overlays], "devices": run.executor.place()["devices"],
        "arguments": [list(each) for each in run.scene.arguments], "device": run.options.device,
        "reference": None if reference is None else {
            "graph": absolute(reference.graph), "settings": list(reference.settings), "parts": reference.parts,
            "image": run.kept.get(REFERENCE)},
        "points": [{
            "name": point.name, "variant": point.variant, "knobs": [list(each) for each in point.knobs],
            "graph": absolute(point.graph), "settings": list(point.settings), "image": run.kept.get(point.name),
            "explained": run.explained.get(point.name),
            "device": run.measured.get(point.name, {}).get("device"),
        } for point in run.study.points],
        # Of each round the mean logarithm of milliseconds; the first point takes part twice.
        "rounds": [{name: round(value, 7) for name, value in each.items()} for each in values],
    }


def absolute(file: str) -> str:
    """A file's whole path; what comes with Heddle goes by its name."""
    path = pathlib.Path(file)
    return str(path.resolve()) if path.exists() else file


def command_line() -> str:
    """What was typed, as near as Python knows."""
    return shlex.join(["heddle", *sys.argv[1:]] if sys.argv[1:2] == ["study"] else ["heddle", "study"])


def is_finite(found: dict, metric: str) -> bool:
    return all(math.isfinite(each) for each in [*found["seeds"][metric], *found["parts"][metric]])


def why_not_finite(errors: Sequence[float]) -> str:
    if any(math.isnan(each) for each in errors):
        return "not a number"
    return "infinite: equal images" if any(math.isinf(each) for each in errors) else "infinite against a part of the reference"


def unmeasured(run: SceneRun, point: Point, baseline: Point, metric: str) -> dict[str, Any]:
    """The verdict where an error is not finite, as psnr is of equal images: such have no difference that could be measured."""
    a, b = (run.errors[each.name] for each in (baseline, point))
    if set(a["seeds"][metric]) == set(b["seeds"][metric]) == {math.inf}:
        return {"against": baseline.name, "verdict": s.SAME, "note": "infinite: both images equal the reference"}
    odd = point if not is_finite(b, metric) else baseline
    return {"against": baseline.name, "verdict": s.UNDECIDED,
            "note": f"{metric} of {odd.name} is {why_not_finite(run.errors[odd.name]['seeds'][metric])}"}


def error_interval(errors: Sequence[float], floor: float) -> s.Interval:
    """Of seeds, and of the reference's own variance on top of it."""
    middle = s.difference(errors) if len(errors) >= s.FEWEST_ROUNDS else s.median(errors)
    return s.Interval(middle.value, middle.low - floor, middle.high + floor, 1.0 - s.FALSE_VERDICTS)


def negligible(metric: str, size: float) -> float:
    """The difference of errors that pixels make which are all off by NEGLIGIBLE of the reference's own size (its root mean
    square), as the metric counts it; of psnr 0: it is a ratio already."""
    if metric == "psnr":
        return 0.0
    if metric in ("relmse", "ssim", "flip", "hdr_flip"):
        return NEGLIGIBLE**2 if metric == "relmse" else NEGLIGIBLE
    return (NEGLIGIBLE * size) ** (2 if metric == "mse" else 1)


def error_that_matters(run: SceneRun, metric: str) -> float:
    """The smallest difference of errors that matters: of the first point's error the part that the study says, and nothing
    negligible. ssim's error is what it lacks of 1; psnr is a ratio, whose part of the root mean square is a number of decibels."""
    part = run.study.error_resolution
    if metric == "psnr":
        return -20.0 * math.log10(1.0 - part) if part < 1.0 else math.inf
    first = float(np.median(run.errors[run.study.points[0].name]["seeds"][metric]))
    return max(part * abs(1.0 - first if metric == "ssim" else first), negligible(metric, run.reference_size))


def error_verdict(run: SceneRun, point: Point, baseline: Point, metric: str, direction: str) -> tuple[s.Verdict, s.Noise]:
    """The rule of times: differences seed by seed, with the reference's own variance as the floor."""
    sign = -1.0 if direction == "higher" else 1.0
    # Of a signed one, nearer to 0 is better.
    value = abs if metric == "mean_difference" else float
    a, b = ([value(x) for x in run.errors[each.name]["seeds"][metric]] for each in (baseline, point))
    count = max(len(a), len(b), SEEDS)
    differences = [sign * (b[i % len(b)] - a[i % len(a)]) for i in range(count)]
    parts_a, parts_b = ([value(x) for x in run.errors[each.name]["parts"][metric]] for each in (baseline, point))
    floor = s.reference_floor([y - x for x, y in zip(parts_a, parts_b)]) if len(parts_a) > 1 else 0.0
    verdict, noise = s.decide(differences, floor, error_that_matters(run, metric)), s.noise([differences], count)
    if sign > 0:
        return verdict, noise
    # Told as it is: what is better has more of it.
    found = verdict.difference
    return dataclasses.replace(
        verdict, difference=s.Interval(-found.value, -found.high, -found.low, found.confidence)), noise


def mark_front(rows: list[dict], metric: str) -> None:
    """Which points of a scene no other one beats in both frame time and the error, by their middle values."""
    better = {each["name"]: each["better"] for each in metrics()}
    sign = -1.0 if better.get(metric) == "higher" else 1.0
    for scene in {row["scene"] for row in rows}:
        def values(quantity: str) -> dict[tuple, dict]:
            return {(row["variant"], row["knobs"]): row for row in rows
                    if row["scene"] == scene and row["quantity"] == quantity and row.get("value") is not None}
        times, errors = values("frame"), values(metric)
        points = {key: (times[key]["value"], sign * errors[key]["value"]) for key in times if key in errors}
        for key, (time_, error) in points.items():
            beaten = any(t <= time_ and e <= error and (t, e) != (time_, error) for t, e in points.values())
            errors[key]["is_on_front"] = not beaten


def mark_dominated(rows: list[dict], found: list[dict], metric: str) -> None:
    by = {(each["scene"], each["variant"], each["knobs"]): each["by"] for each in found}
    for row in rows:
        if row["quantity"] == metric and (row["scene"], row["variant"], row["knobs"]) in by:
            row["dominated_by"] = by[row["scene"], row["variant"], row["knobs"]]


def write_table(folder: pathlib.Path, rows: list[dict], report: dict) -> None:
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write(folder / "results.csv", text.getvalue())
    write(folder / "results.json", json.dumps(report | {"rows": rows}, indent=1, default=str, allow_nan=False))


def finite(rows: list[dict]) -> list[dict]:
    """JSON has no infinity: what is not finite is left out."""
    return [{key: value for key, value in row.items() if not (isinstance(value, float) and not math.isfinite(value))}
            for row in rows]


# ---- The command ----


def print_summary(study: Study, rows: list[dict], restless: dict[str, list[str]]) -> None:
    for scene in dict.fromkeys(row["scene"] for row in rows):
        print(f"\n{scene}")
        print(f"  {'':<36} {'frame, ms':>28}   {'processors, ms':>28}   {study.metrics[0]:>36}")
        for point in study.points:
            key = (point.variant, " ".join(f"{knob}={value}" for knob, value in point.knobs))
            own = {row["quantity"]: row for row in rows if row["scene"] == scene and (row["variant"], row["knobs"]) == key}
            first = own.get("frame", {"state": "failed", "note": ""})
            if first["state"] != "ok":
                print(f"  {point.name:<36} {first['state']}: {first['note']}")
                continue
            print(f"  {point.name:<36} {cell(first):>28}   {cell(own.get('processor', {})):>28}   "
                  f"{cell(own.get(study.metrics[0], {})):>36}"
                  + (" *" if own.get(study.metrics[0], {}).get("is_on_front") else ""))
            for quantity in (*TIMES, *study.metrics):
                row = own.get(quantity, {})
                if row.get("verdict"):
                    if "difference" not in row:
                        print(f"      {quantity}: {row['verdict']} against {row['against']} ({row['note']})")
                        continue
                    scale = "" if quantity in TIMES else f" {row['unit']}" if row["unit"] != "1" else ""
                    needed = f"; about {row['rounds_needed']} rounds would tell" if row.get("rounds_needed") else ""
                    print(f"      {quantity}: {row['verdict']} than {row['against']}" if row["verdict"] in (s.BETTER, s.WORSE)
                          else f"      {quantity}: {row['verdict']} against {row['against']}", end="")
                    print(f" ({spell(quantity, row['difference'])}, {spell(quantity, row['difference_low'])} to "
                          f"{spell(quantity, row['difference_high'])}; matters from "
                          f"{spell(quantity, row['matters'])}, smallest seen {spell(quantity, row['smallest_seen'])}{needed})" + scale)
        for text in restless.get(scene, []):
            print(f"  warning: {text}")
    print(f"\n* no other point beats it in both frame time and error. Intervals hold the true value with 95 % and more.\n"
          f"Better and worse: certain, and at least what matters, {100 * study.resolution:g} % of times, "
          f"{100 * study.error_resolution:g} % of the first point's error (resolution, error_resolution). No difference seen: "
          "certainly less than that.")


def spell(quantity: str, value: float) -> str:
    if not math.isfinite(value):
        return "any"
    return f"{100 * math.expm1(value):+.1f} %" if quantity in TIMES else f"{value:+.3g}"


def cell(row: dict) -> str:
    if row.get("value") is None:
        return row.get("note") or "-"
    return f"{row['value']:.5g} ({row['low']:.4g} to {row['high']:.4g})"
