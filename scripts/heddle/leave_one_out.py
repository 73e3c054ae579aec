# SPDX-License-Identifier: Apache-2.0
"""What a frame would save without a pass, beside the pass's own time.

The two differ: without a pass nobody has to wait for it, what only it reads is not made, and who asked its function gets
a constant; but where passes run beside each other, or share what caches hold, leaving one out saves less than its time.
A pass that only answers functions takes no time of its own at all: its cost is in those that ask it.
"""

from __future__ import annotations

from typing import Any

from . import statistics as s
from . import side_times
from .study import Point
from .study_items import digest
from .study_run import SceneRun


def measure(run: SceneRun) -> list[dict[str, Any]]:
    """Of the first point of each of the study's `leave_one_out` variants, every pass of its graph that runs, in the order
    of the file:

    {scene, variant, knobs, pass, technique, cost_ms [low, middle, high] or None, confidence, own_ms or None, frame_ms,
     rounds, note}
    cost_ms: frame's time with the pass minus without, paired round by round (statistics.difference)
    own_ms:  median of the pass alone, submitted and waited for; None if it only answers functions
    """
    return [row for base in bases(run) for row in of_point(run, base)]


def bases(run: SceneRun) -> list[Point]:
    first = (next((point for point in run.alive() if point.variant == variant), None) for variant in run.study.leave_one_out)
    return [point for point in first if point is not None]


def estimate_seconds(run: SceneRun) -> float:
    """Of what is not measured yet; a frame without a pass is taken to be as slow as with it."""
    return sum(side_times.seconds_of(run, kind_of(base), [base], run.study.rounds, (run.passes[base.name] + 1) *
                                     run.warm[base.name]["ms"] / 1e3) for base in bases(run) if base.name in run.warm)


def kind_of(base: Point) -> str:
    return f"leaving out each pass of {base.name}"


def of_point(run: SceneRun, base: Point) -> list[dict[str, Any]]:
    key = digest("passes", run.keys[base.name])
    made = run.store.get(key)
    if made is None:
        made = run.ask(base, "passes")
        if made is None:
            return []
        run.store.put(key, made)
    running = [each for each in made["passes"] if not each["is_pruned"] and each["technique"] != "none"]
    sides = [without(base, each["name"]) for each in running]
    keeps = [made["output"] if run.study.port.startswith(f"{each['name']}.") else None for each in running]
    rounds, lost = side_times.measure(run, kind_of(base), [base], sides, keeps, run.study.rounds)
    own = run.measured.get(base.name, {}).get("passes", {})
    return [row_of(run, base, each, side, rounds, lost.get(side.name), own.get(each["name"]))
            for each, side in zip(running, sides)]


def without(base: Point, name: str) -> Point:
    """The point with a pass's role done by nobody. Settings of the pass would be those of a technique that is not there."""
    kept = tuple(each for each in base.settings if not each.startswith(f"{name}."))
    return Point(base.variant, base.graph, (*kept, f"{name}.technique=none"), (*base.knobs, ("without", name)))


def row_of(run: SceneRun, base: Point, each: dict, side: Point, rounds: list[dict[str, float]], why: str | None,
           own: list[float] | None) -> dict[str, Any]:
    row: dict[str, Any] = {
        "scene": run.scene.name, "variant": base.variant, "knobs": " ".join(f"{k}={v}" for k, v in base.knobs),
        "pass": each["name"], "technique": each["technique"], "cost_ms": None, "confidence": None,
        "own_ms": s.median(own).value if own else None, "frame_ms": None, "rounds": 0,
        "note": "" if own else "it answers functions: its time is in those that ask it"}
    both = [found for found in rounds if base.name in found and side.name in found]
    if not both:
        return row | {"note": f"it cannot be left out: {why}" if why else "not measured"}
    if len(both) < s.FEWEST_ROUNDS:  # their interval has no ends
        return row | {"note": f"lost after {len(both)} rounds: {why}", "rounds": len(both)}
    cost = s.difference([found[base.name] - found[side.name] for found in both])
    return row | {"cost_ms": [cost.low, cost.value, cost.high], "confidence": cost.confidence, "rounds": len(both),
                  "frame_ms": s.median([found[base.name] for found in both]).value}


def table_rows(study_name: str, costs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For results.csv: beside the rows "pass NAME"."""
    return [{"study": study_name, "scene": each["scene"], "variant": each["variant"], "knobs": each["knobs"], "state": "ok",
             "quantity": f"leave-one-out {each['pass']}", "unit": "ms", "value": each["cost_ms"][1], "low": each["cost_ms"][0],
             "high": each["cost_ms"][2], "confidence": each["confidence"], "samples": each["rounds"],
             "formula": "frame with the pass minus frame without it, round by round", "note": each["note"]}
            for each in costs if each["cost_ms"] is not None]


def print_table(costs: list[dict[str, Any]]) -> None:
    for scene, variant, knobs in dict.fromkeys((each["scene"], each["variant"], each["knobs"]) for each in costs):
        own = [each for each in costs if (each["scene"], each["variant"], each["knobs"]) == (scene, variant, knobs)]
        print(f"\n{scene}: what the frame of {' '.join(filter(None, (variant, knobs)))} would save without a pass")
        print(f"  {'pass':<24} {'saved, ms':>30}   {'its own time, ms':>16}")
        for each in own:
            low_high = "-" if each["cost_ms"] is None else "{1:.4g} ({0:.3g} to {2:.3g})".format(*each["cost_ms"])
            alone = "-" if each["own_ms"] is None else f"{each['own_ms']:.4g}"
            print(f"  {each['pass']:<24} {low_high:>30}   {alone:>16}" + (f"   {each['note']}" if each["note"] else ""))
