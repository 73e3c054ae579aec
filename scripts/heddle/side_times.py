# SPDX-License-Identifier: Apache-2.0
"""Times of graphs that are no points of a study: a point without one of its passes, a point at another extent.

They take turns with points in rounds of their own, by the rule of all times (statistics.turns), in the process of the
variant that they belong to, and are kept as those are.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence

import numpy as np

from . import Error
from . import statistics as s
from .study import Point
from .study_items import digest
from .study_run import Moved, SceneRun, duration


def measure(run: SceneRun, kind: str, points: Sequence[Point], sides: Sequence[Point], keeps: Sequence[str | None],
            rounds: int) -> tuple[list[dict[str, float]], dict[str, str]]:
    """Rounds of turns of points and sides, which live in their variants' processes meanwhile.

    keeps:   of each side the port that it makes beside its output, where that is not the study's; None: the study's
    returns: ([{name: milliseconds, the mean of both turns' medians} a round], {name of a side: why it has no times})
    """
    lost: dict[str, str] = {}
    for side, keep in zip(sides, keeps):
        try:
            run.identify_one(side.name, side.graph, side.settings, keep=keep)
        except Error as error:
            lost[side.name] = in_short(str(error))
    there = [side for side in sides if side.name not in lost]
    everybody = {each.name: each for each in [*points, *there]}

    def key() -> str:
        return digest("side", kind, [(name, run.keys[name]) for name in everybody], run.executor.place()["id"], run.study.frames)

    def finished() -> list[dict]:
        return [each for each in run.store.lines(key()) if set(everybody) - set(lost) <= set(each["order"])]

    missing = rounds - len(finished())
    if there and missing > 0 and is_affordable(run, kind, points, there, missing):
        while set(everybody) - set(lost) and any(side.name not in lost for side in there) and len(finished()) < rounds:
            with contextlib.suppress(Moved):
                time_round(run, key(), [each for name, each in everybody.items() if name not in lost], lost)
        for side in there:
            with contextlib.suppress(Moved):
                run.executor.at_place(run.item("forget", point=run.told(side.name, side.variant)))
    if len(finished()) >= rounds or not there:
        run.store.put(done_key(run, kind, points, rounds), {"kind": kind})
    return [mean_of_turns(each["order"], each["ms"]) for each in finished()], lost


def done_key(run: SceneRun, kind: str, points: Sequence[Point], rounds: int) -> str:
    """Of a note that all was timed, for estimates: what sides are is known only once they are loaded."""
    return digest("side done", kind, [run.keys[point.name] for point in points or run.study.points if point.name in run.keys],
                  run.study.extents, rounds, run.executor.place()["id"], run.study.frames)


def seconds_of(run: SceneRun, kind: str, points: Sequence[Point], rounds: int, frame: float) -> float:
    """What all rounds take, `frame` seconds for each of everybody; 0 if that was measured."""
    if run.store.get(done_key(run, kind, points, rounds)) is not None:
        return 0.0
    return frame * (rounds * 2 * (run.study.frames + 1) + 12)


def in_short(text: str) -> str:
    return text.splitlines()[0].rpartition("error: ")[2]


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


def time_round(run: SceneRun, key: str, turns: Sequence[Point], lost: dict[str, str]) -> None:
    """One round, kept if nobody is lost in it."""
    number = len(run.store.lines(key))
    order = s.turns([each.name for each in turns], 1, run.study.seed + number)[0]
    answer = run.executor.at_place(run.item("round", points=[run.told(each.name, each.variant) for each in turns], order=order,
                                            frames=run.study.frames))
    if answer.lost is not None:
        lost[answer.lost.point] = in_short(str(answer.lost)) if answer.lost.state == "failed" else f"{answer.lost.point}: {answer.lost}"
        return
    run.store.append(key, {"round": number, "order": order, "machine": answer.machine, **answer.value})


def mean_of_turns(order: Sequence[str], times: Sequence[Sequence[float]]) -> dict[str, float]:
    """{name: milliseconds}. Two turns each, so that a drift that is straight over the round adds the same to all."""
    values: dict[str, float] = {}
    for name, turn in zip(order, times):
        values[name] = values.get(name, 0.0) + 0.5 * float(np.median(turn))
    return values
