# SPDX-License-Identifier: Apache-2.0
"""Times of graphs that are no points of a study: a point without one of its passes, a point at another extent.

They take turns with points in rounds of their own, by the rule of all times (statistics.turns), in the process of the
variant that they belong to, and are kept as those are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from . import statistics as s
from .study import Point
from .study_run import Lost, SceneRun, digest, duration, machine


def measure(run: SceneRun, kind: str, points: Sequence[Point], sides: Sequence[Point], keeps: Sequence[str | None],
            rounds: int) -> tuple[list[dict[str, float]], dict[str, str]]:
    """Rounds of turns of points, which are loaded, and sides, which are loaded into their variants' processes for it.

    keeps:   of each side the port that it makes beside its output, as points make the study's port; None: none
    returns: ([{name: milliseconds, the mean of both turns' medians} a round], {name of a side: why it has no times})
    """
    lost: dict[str, str] = {}
    keys = [run.keys[point.name] for point in points]
    for side, keep in zip(sides, keeps):
        if (key := load(run, side, keep, lost)) is not None:
            keys.append(key)
    there = [side for side in sides if side.name not in lost]
    store_key = digest("side", kind, keys, [each.name for each in [*points, *there]], machine(), run.study.frames)
    names = {each.name for each in [*points, *there]}

    def finished() -> list[dict]:
        return [each for each in run.store.lines(store_key) if names - set(lost) <= set(each["order"])]

    missing = rounds - len(finished())
    if there and missing > 0 and is_affordable(run, kind, points, there, missing):
        for side in there:
            ask(run, side, lost, lambda side=side: run.warm_point(side, side.variant))
        number = len(run.store.lines(store_key))
        while len(finished()) < rounds and names - set(lost):
            time_round(run, store_key, number, [*points, *there], lost)
            number += 1
    if len(finished()) >= rounds or not there:
        run.store.put(done_key(run, kind, points, rounds), {"kind": kind})
    for side in there:
        if side.name not in lost:
            ask(run, side, lost, lambda side=side: run.workers[side.variant].ask("forget", point=side.name))
        run.warm.pop(side.name, None)
    return [mean_of_turns(each["order"], each["ms"]) for each in finished()], lost


def done_key(run: SceneRun, kind: str, points: Sequence[Point], rounds: int) -> str:
    """Of a note that all was timed, for estimates: what sides are is known only once they are loaded."""
    return digest("side done", kind, [run.keys[point.name] for point in points or run.study.points if point.name in run.keys],
                  run.study.extents, rounds, machine(), run.study.frames)


def seconds_of(run: SceneRun, kind: str, points: Sequence[Point], rounds: int, frame: float) -> float:
    """What all rounds take, `frame` seconds for each of everybody; 0 if that was measured."""
    if run.store.get(done_key(run, kind, points, rounds)) is not None:
        return 0.0
    return frame * (rounds * 2 * (run.study.frames + 1) + 12)


def load(run: SceneRun, side: Point, keep: str | None, lost: dict[str, str]) -> str | None:
    files = ask(run, side, lost, lambda: run.workers[side.variant].ask(
        "load", point=side.name, graph=side.graph, settings=list(side.settings), keep=keep))
    return run.key_of(side.graph, side.settings, files["files"]) if files is not None else None


def ask(run: SceneRun, side: Point, lost: dict[str, str], work: Callable[[], Any]) -> Any:
    """What the side's process answers; None if it was lost, now or before, and then `lost` says why."""
    run.stop()
    # A process that ended took its sides with it: only its points are loaded again.
    why = lost.get(side.name) or lost.get(process_of(side))
    if why is not None:
        lost[side.name] = why
        return None
    try:
        if side.variant not in run.workers:
            run.start(side.variant)
        return work()
    except Lost as error:
        if error.state == "failed":
            lost[side.name] = str(error).splitlines()[0].rpartition("error: ")[2]
        else:
            lost[side.name] = lost[process_of(side)] = f"{side.name}: {error}"
            if side.variant in run.workers:
                run.revive(side.variant)
        return None


def process_of(side: Point) -> str:
    """The name under which `lost` has the whole process of a side. Points' names do not begin with a parenthesis."""
    return f"({side.variant})"


def is_affordable(run: SceneRun, kind: str, points: Sequence[Point], sides: Sequence[Point], rounds: int) -> bool:
    """Whether the study's budget has room. A side is taken to cost what its variant's first point does."""
    frame = {name: warm["ms"] / 1e3 for name, warm in run.warm.items()}
    first: dict[str, float] = {}
    for point in run.study.points:
        first.setdefault(point.variant, frame.get(point.name, 0.0))
    each = sum(frame.get(point.name, 0.0) for point in points) + sum(first.get(side.variant, 0.0) for side in sides)
    seconds = seconds_of(run, kind, points, rounds, each)
    if time.monotonic() + seconds > run.deadline:
        run.say(f"{run.scene.name}: no time is left for {kind}, about {duration(seconds)}; --budget MINUTES makes room")
        return False
    run.say(f"{run.scene.name}: {kind}, about {duration(seconds)}")
    return True


def time_round(run: SceneRun, key: str, number: int, turns: Sequence[Point], lost: dict[str, str]) -> None:
    """One round, kept if nobody is lost in it."""
    by_name = {each.name: each for each in turns if each.name not in lost}
    order = s.turns(list(by_name), 1, run.study.seed + number)[0]
    times = []
    for name in order:
        answer = ask(run, by_name[name], lost, lambda: run.workers[by_name[name].variant].ask(
            "render", point=name, frames=run.study.frames + 1))
        if answer is None:
            return
        times.append(answer["ms"][1:])
    run.store.append(key, {"round": number, "order": order, "ms": times})


def mean_of_turns(order: Sequence[str], times: Sequence[Sequence[float]]) -> dict[str, float]:
    """{name: milliseconds}. Two turns each, so that a drift that is straight over the round adds the same to all."""
    values: dict[str, float] = {}
    for name, turn in zip(order, times):
        values[name] = values.get(name, 0.0) + 0.5 * float(np.median(turn))
    return values
