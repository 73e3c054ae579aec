# SPDX-License-Identifier: Apache-2.0
"""`heddle reproduce report.html ROW`: what the page says of a point, made again: is the image the same to the bit, and is its
time the same as far as can be told?

Times are not compared as they are: the machine may be busier today. In the study and now the point took turns with another
one, and their ratio then and now is compared, round by round, by the rule of all verdicts.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import pathlib
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from . import Error, Host
from . import report
from . import statistics as s
from . import study_images as images
from .study import Point, SceneChoice, Study
from .study_items import AGAIN, Contents
from .study_run import Here, SceneRun, Store

Json = dict[str, Any]


def reproduce(options: argparse.Namespace, stop: Callable[[], None]) -> int:
    """0: the same; 1: other bytes, or a time that is better or worse. raises: Error"""
    def say(text: str) -> None:
        if not options.quiet:
            print(text, flush=True)

    path = pathlib.Path(options.file)
    try:
        data = report.points_of(path)
    except (OSError, ValueError) as error:
        raise Error(2, f"error: '{path}' is no report of a study: {error}\n  help:     heddle study writes report.html into the "
                       "folder of its results") from error
    point = find_row(data, options.row, path)
    scene = data["scenes"][point["scene"]]
    known = data["images"].get(point["image"] or "")
    if known is None:
        why = f": it was {point['state']} ({point['note']})" if point["state"] != "ok" else ""
        raise Error(2, f"error: the study keeps no image of row {point['row']}, '{point['name']}'{why}")
    say(f"row {point['row']}: {point['name']} of scene '{scene['scene']}'")
    yardstick = next((each for each in data["points"] if each["scene"] == point["scene"] and each["state"] == "ok"
                      and each["name"] != point["name"]), None)
    with tempfile.TemporaryDirectory(prefix="heddle-reproduce-") as folder:
        with make_run(data, scene, point, yardstick, options, pathlib.Path(folder), say, stop) as run:
            image = rendered(run, point, scene)
            say_what_changed(data, scene, run, say)
            is_same = compare_bytes(path, point, known, image, say)
            if options.output:
                write_output(options, image)
            verdict = None if options.no_times else compare_times(data, point, yardstick, run, say)
    return 0 if is_same and verdict not in (s.BETTER, s.WORSE) else 1


def find_row(data: Json, words: list[str], path: pathlib.Path) -> Json:
    """By its number, or by its name, after which the scene's may follow."""
    points = data["points"]
    for number, point in enumerate(points, 1):
        point["row"] = number
    wanted = " ".join(words)
    if wanted.isdigit():
        if not 1 <= int(wanted) <= len(points):
            raise Error(2, f"error: '{path}' has no row {wanted}\n  expected: 1 to {len(points)}, or a point's name")
        return points[int(wanted) - 1]
    found = [each for each in points if wanted in (each["name"], f"{each['name']} {data['scenes'][each['scene']]['scene']}")]
    if len(found) == 1:
        return found[0]
    choices = [f"{each['row']}: {each['name']} of {data['scenes'][each['scene']]['scene']}" for each in found or points]
    more = f"\n            and {len(choices) - 40} more" if len(choices) > 40 else ""
    raise Error(2, f"error: '{path}' has {'several rows' if found else 'no row'} '{wanted}'\n  expected: a row's number\n            " +
                "\n            ".join(choices[:40]) + more)


@contextlib.contextmanager
def make_run(data: Json, scene: Json, point: Json, yardstick: Json | None, options: argparse.Namespace, folder: pathlib.Path,
             say: Callable[[str], None], stop: Callable[[], None]) -> Iterator[SceneRun]:
    """The study of two points that the page has of them, without a reference, while the block lasts."""
    choice = SceneChoice(scene["file"], scene["camera"], scene["time"], tuple(scene["overlays"]), str(options.file),
                         tuple((key, value) for key, value in scene.get("arguments", [])))
    both = [each for each in (yardstick, point) if each is not None]
    points = tuple(Point(each["variant"], each["graph"], tuple(each["settings"]), tuple((k, v) for k, v in each["knobs"]))
                   for each in both)
    fields = dict(data["study"]) | {"scenes": (choice,), "points": points, "reference": None}
    fields["rounds"] = options.rounds or fields["rounds"]
    if fields["rounds"] < s.FEWEST_ROUNDS:
        raise Error(2, f"error: --rounds {options.rounds}\n  expected: at least {s.FEWEST_ROUNDS}: fewer decide nothing")
    known = {each.name for each in dataclasses.fields(Study)}
    study = Study(**{key: value for key, value in fields.items() if key in known})
    if options.device is None:
        options.device = scene["device"]
    here = Here(options.device, options.timeout, folder, say, stop)
    with Host(options.device, log=lambda *_: None) as host, contextlib.closing(here) as executor:
        yield SceneRun(study, choice, Store(folder), options, folder, host, executor, Contents(), say, stop, math.inf)


def rendered(run: SceneRun, point: Json, scene: Json) -> np.ndarray:
    target = next(each for each in run.study.points if each.name == point["name"])
    image, state, text = None, "failed", ""
    try:
        run.identify()
        image = run.render_image(target, 0)
        state, text = run.state[target.name]
    except Error as error:
        text = str(error)
    if image is None:
        missing = [file for file in (scene["file"], *scene["overlays"], point["graph"])
                   if pathlib.Path(file).is_absolute() and not pathlib.Path(file).exists()]
        raise Error(2 if state == "failed" else 4, f"error: row {point['row']} cannot be rendered: {text}" + (
            f"\n  help:     the study was made of {', '.join(missing)}, which is not here" if missing else ""))
    return image


def say_what_changed(data: Json, scene: Json, run: SceneRun, say: Callable[[str], None]) -> None:
    now = run.contents.known()
    changed = [file for file, value in now.items() if file in data["files"] and data["files"][file] != value[:16]]
    other = [file for file in now if file not in data["files"]]
    for what, files in (("are not what they were", changed), ("are none of the study's", other)):
        if files:
            say(f"note: {len(files)} of {len(now)} files {what}: {', '.join(sorted(files)[:5])}" + (", ..." if len(files) > 5 else ""))
    if run.executor.place()["devices"] != scene["devices"]:
        say("note: the devices or drivers are not those of the study; bytes may differ for that")


def compare_bytes(path: pathlib.Path, point: Json, known: Json, image: np.ndarray, say: Callable[[str], None]) -> bool:
    found = images.fingerprint(image)
    if found == known["sha256"]:
        say(f"image: bytes equal ({image.shape[1]} x {image.shape[0]} x {image.shape[2]}, SHA-256 {found[:16]}...)")
        return True
    shape = (known["height"], known["width"], known["channels"])
    if image.shape != shape:
        say(f"image: DIFFERENT: {image.shape[1]} x {image.shape[0]} x {image.shape[2]}\n  expected: {shape[1]} x {shape[0]} x {shape[2]}")
        return False
    try:
        before = images.load(path.parent, point["image"])
    except (OSError, ValueError):
        say(f"image: DIFFERENT: SHA-256 {found}\n  expected: {known['sha256']}\n  help:     the image of the study is not beside the page "
            f"({known['file']}), so by how much is not known")
        return False
    differs = (image != before).any(axis=2) & ~(np.isnan(image) & np.isnan(before)).any(axis=2)
    places = np.argwhere(differs)
    if not len(places):
        say("image: DIFFERENT, in the bits of NaN or of zeros' signs alone")
        return False
    y, x = places[0]
    largest = float(np.nanmax(np.abs(image.astype(np.float64) - before)))
    say(f"image: DIFFERENT: {len(places)} of {differs.size} pixels, by {largest:.4g} at most; the first is {x}, {y}\n"
        f"  found:    {spell(image[y, x])}\n  expected: {spell(before[y, x])}")
    return False


def spell(values: np.ndarray) -> str:
    return "  ".join(f"{value:.9g}" for value in values.tolist())


def write_output(options: argparse.Namespace, image: np.ndarray) -> None:
    with Host(options.device, log=lambda *_: None) as host:
        host.write_image(options.output, image)


def compare_times(data: Json, point: Json, yardstick: Json | None, run: SceneRun, say: Callable[[str], None]) -> str | None:
    """The verdict; None: nothing was compared."""
    scene = data["scenes"][point["scene"]]
    recorded = data["rounds"][point["scene"]]
    place = run.executor.place()
    machine = place["machine"]
    if machine != data["machine"] or place["devices"] != scene["devices"]:
        say("time: not compared: this is not the study's machine and driver\n  found:    "
            f"{machine}\n  expected: {data['machine']}")
        return None
    if not recorded:
        say("time: not compared: the study timed nothing of this scene")
        return None
    say(f"time: {run.study.rounds} rounds" + (f", in turns with {yardstick['name']}" if yardstick else ""))
    run.warm_up()
    with run.executor.timing():
        run.measure_times()
    values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
    lost = [f"{each.name}: {run.state[each.name][1]}" for each in run.study.points if run.state[each.name][0] != "ok"]
    if lost:
        raise Error(4, f"error: {lost[0]}")
    verdict, text = judge(data, point["name"], yardstick["name"] if yardstick else None, recorded, values)
    say(text)
    if run.foreign is not None and run.foreign > 0.1:
        say(f"note: other programs used {100 * run.foreign:.0f} % of the processors meanwhile")
    return verdict


def judge(data: Json, name: str, yardstick: str | None, then: list[dict], now: list[dict]) -> tuple[str, str]:
    """A verdict on a point's time then and now, as a ratio to the yardstick's in the same round, and the words for it.

    then, now: of each round the mean logarithm of milliseconds of each point, and of AGAIN, the first of its run again
    """
    def ratios(rounds: list[dict]) -> list[float]:
        return [each[name] - (each[yardstick] if yardstick else 0.0) for each in rounds
                if name in each and (yardstick is None or yardstick in each)]

    def again(rounds: list[dict], first: str) -> list[float]:
        return [each[AGAIN] - each[first] for each in rounds if AGAIN in each and first in each]

    before, after = ratios(then), ratios(now)
    count = min(len(before), len(after))
    if count < s.FEWEST_ROUNDS:
        return s.UNDECIDED, f"time: undecided: {count} rounds are too few\n  expected: at least {s.FEWEST_ROUNDS}"
    # Both runs have a floor of their own, and a difference between them has both.
    equal = [each for each in (again(then, data["points"][0]["name"]), again(now, yardstick or name)) if each]
    differences = [b - a for a, b in zip(before[:count], after[:count])]
    found = s.decide(differences, sum(map(s.floor_of, equal)), math.log1p(data["study"]["resolution"]))
    noise = s.noise([differences, *equal], count)
    against = f" against {yardstick}" if yardstick else ""
    milliseconds = [math.exp(float(np.median([each[name] for each in rounds if name in each]))) for rounds in (then, now)]

    def spelled(value: float) -> str:
        return f"{100 * math.expm1(value):+.1f} %" if math.isfinite(value) else "any"

    return found.word, (
        f"time{against}: {found.word}{' than then' if found.word in (s.BETTER, s.WORSE) else ''} ({spelled(found.difference.value)}, "
        f"{spelled(found.difference.low)} to {spelled(found.difference.high)}; smallest seen {spelled(found.smallest_seen(noise))}); the "
        f"frame took {milliseconds[0]:.4g} ms then, {milliseconds[1]:.4g} ms now")
