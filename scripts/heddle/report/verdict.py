# SPDX-License-Identifier: Apache-2.0
"""A study's rows -> two sentences: what is better than the first point, and what could not be told."""

from __future__ import annotations

import math
from typing import Any

from .. import statistics as s

Json = dict[str, Any]
TELLS_NOTHING = math.log(2)  # if no difference of times below 100 % could have been seen


def verdict(study: Json, rows: list[Json], restless: dict[str, list[str]]) -> list[str]:
    """Two sentences. rows: of results.json; restless: what speaks against the machine, by scene"""
    return [best(study, rows), trust(rows, restless)]


def best(study: Json, rows: list[Json]) -> str:
    metric = study["metrics"][0]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    words: dict[str, dict[str, tuple[Json, Json]]] = {}  # by point and scene: its rows of the frame and of the error
    for row in rows:
        if row["quantity"] == "frame" and row.get("verdict"):
            other = next((each for each in rows if each["quantity"] == metric and each["scene"] == row["scene"]
                          and (each["variant"], each["knobs"]) == (row["variant"], row["knobs"]) and each.get("verdict")), None)
            if other is not None:
                words.setdefault(name(row), {})[row["scene"]] = (row, other)
    against = next((row["against"] for row in rows if row.get("against")), None)
    if against is None or not words:
        lost = sum(row["state"] != "ok" for row in rows)
        return (f"Nothing was compared: {lost} of {len({(name(row), row['scene']) for row in rows})} points were lost." if lost
                else "Nothing was compared: the study has one point, or no verdict of both time and error.")

    def those(time: set[str], error: set[str]) -> list[str]:
        return [point for point, found in words.items() if len(found) == len(scenes) and all(
            a["verdict"] in time and b["verdict"] in error for a, b in found.values())]

    where = {1: "", 2: " on both scenes"}.get(len(scenes), f" on all {len(scenes)} scenes")
    both = those({s.BETTER}, {s.BETTER})
    if both:
        chosen = max(both, key=lambda point: -sum(a["difference"] for a, _ in words[point].values()))
        others = "" if len(both) == 1 else f", as {'is 1 other' if len(both) == 2 else f'are {len(both) - 1} others'}"
        return (f"{chosen} is both faster ({range_of([a for a, _ in words[chosen].values()])}) and nearer to the reference "
                f"({errors_of(metric, [b for _, b in words[chosen].values()])}) than {against}{where}{others}.")
    for time, error, text in (
            ({s.BETTER}, {s.SAME}, "{} is faster ({time}) than {against}{where}, with no difference seen in {metric}"),
            ({s.SAME}, {s.BETTER}, "{} is nearer to the reference ({error}) than {against}{where}, with no difference of time seen")):
        if found := those(time, error):
            chosen = min(found, key=lambda point: sum(a["difference"] for a, _ in words[point].values()))
            return text.format(chosen, time=range_of([a for a, _ in words[chosen].values()]), against=against, where=where,
                               metric=metric, error=errors_of(metric, [b for _, b in words[chosen].values()])) + "."
    faster, nearer = those({s.BETTER}, {s.WORSE}), those({s.WORSE}, {s.BETTER})
    unclear = [point for point, found in words.items() if any(s.UNDECIDED in (a["verdict"], b["verdict"]) for a, b in found.values())]
    text = f"Nothing was seen to be both faster and nearer to the reference than {against}{where}: "
    rest = len(words) - len(faster) - len(nearer) - len(unclear)
    groups = [(count, what) for count, what in (
        (len(faster), "faster with a larger error"), (len(nearer), "slower with a smaller error"),
        (len(unclear), "undecided in time or error" + (" on a scene" if where else "")),
        (rest, "better in neither" + (" on every scene" if where else ""))) if count]
    if len(groups) == 1:
        return text + {1: "the other one is ", 2: "both others are "}.get(len(words), f"all {len(words)} others are ") + groups[0][1] + "."
    return text + f"of {len(words)} others " + ", ".join(f"{count} {'is' if count == 1 else 'are'} {what}" for count, what in groups) + "."


def trust(rows: list[Json], restless: dict[str, list[str]]) -> str:
    told = [row for row in rows if row.get("verdict") and row["quantity"] != "processor"]
    times = [row["smallest_seen"] for row in told if row["quantity"] == "frame" and row.get("smallest_seen") is not None]
    undecided = sum(row["verdict"] == s.UNDECIDED for row in told)
    lost = sorted({f"{name(row)} on {row['scene']} ({row['state']})" for row in rows if row["state"] != "ok"})
    parts = []
    if times and min(times) > TELLS_NOTHING:
        parts.append("this run could tell nothing about times: a frame that took twice as long could have been missed")
    elif times:
        worst = max(times)
        parts.append(f"a difference of frame times below {percent(min(times))}" + (
            f" to {percent(worst)}" if percent(worst) != percent(min(times)) else "") + " could not have been seen")
    parts.append(f"{undecided} of {len(told)} comparisons {'is' if undecided == 1 else 'are'} undecided")
    text = ", and ".join(parts)
    if lost:
        text += f"; lost: {', '.join(lost[:3])}" + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
    warnings = [each for texts in restless.values() for each in texts]
    if warnings:
        text += f"; the machine was restless: {warnings[0]}" + (
            "" if len(warnings) == 1 else ' (1 more sign of it stands under "Machine and versions")' if len(warnings) == 2
            else f' ({len(warnings) - 1} more signs of it stand under "Machine and versions")')
    return text[0].upper() + text[1:] + "."


def name(row: Json) -> str:
    return f"{row['variant']} {row['knobs']}".strip()


def percent(log_ratio: float) -> str:
    value = 100 * math.expm1(log_ratio)
    return "more than 100 %" if value >= 100.5 else f"{value:.2g} %" if value < 99.5 else "100 %"


def range_of(rows: list[Json]) -> str:
    """The differences of times of one point over scenes."""
    ratios = sorted(100 * math.expm1(row["difference"]) for row in rows)
    return f"{ratios[0]:+.1f} %" if len(rows) == 1 else f"{ratios[0]:+.1f} to {ratios[-1]:+.1f} %"


def errors_of(metric: str, rows: list[Json]) -> str:
    values = sorted(row["difference"] for row in rows)
    return f"{metric} {values[0]:+.2g}" if len(rows) == 1 else f"{metric} {values[0]:+.2g} to {values[-1]:+.2g}"
