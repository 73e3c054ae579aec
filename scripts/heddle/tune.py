# SPDX-License-Identifier: Apache-2.0
"""Choosing a graph's knobs: the least error within a budget of time, or the least time within an error.

1. Each pass alone: its knobs over their ladders, all others as the graph has them; what each setting adds to the frame's
   time, and its error against the same graph with this pass at its most accurate.
2. All passes together: times are taken to add up, errors as independent ones do (the root of the sum of squares). The
   settings that nothing beats are found exactly: a sum that is beaten stays so whatever is added.
3. That is a guess, so what lies around the bound is measured as a whole, and only what was measured is chosen: its whole
   interval keeps to the bound in every view. If none does, the guess is corrected by what was seen, and tried again.
4. The choice is checked in views that took no part, and what it misses there is said, and written into the overlay.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import difflib
import json
import math
import os
import pathlib
import re
import sys
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from . import Error, Host, metrics, version
from . import study as definition
from .__main__ import load_scene, sort_files, write_file
from .statistics import FEWEST_ROUNDS
from .study import Point, Reference, SceneChoice, Study
from .study_items import Contents, machine
from .study_run import Here, SceneRun, Store, rows_of

TRIED = 8  # whole settings that are measured at a time
TRIALS = 3
ROUNDS = 9
UNITS = {"us": 1e-3, "ms": 1.0, "s": 1e3}  # milliseconds


@dataclasses.dataclass(frozen=True)
class Bound:
    """What a choice keeps to: of frame times in ms, or of a metric."""

    quantity: str  # "frame" or the metric
    value: float
    is_least: bool = False  # of metrics that are better higher

    def cost(self, value: float) -> float:
        """Lower is better, at most self.cost(self.value)."""
        return -value if self.is_least else value

    def __str__(self) -> str:
        return (f"frames of {self.value:g} ms" if self.quantity == "frame" else
                f"{self.quantity} of {self.value:g}") + (" at least" if self.is_least else " at most")


@dataclasses.dataclass(frozen=True)
class Option:
    """One way to set a pass: settings that it takes beside the graph's own, and what they are as in a file."""

    settings: tuple[str, ...]

    @property
    def words(self) -> str:
        return " ".join(each.replace(".params.", ".") for each in self.settings)


@dataclasses.dataclass(frozen=True)
class Guess:
    """Options of all passes together, with what they are taken to amount to."""

    options: tuple[Option, ...]
    ms: float
    error: float  # lower is better

    @property
    def settings(self) -> tuple[str, ...]:
        return tuple(setting for option in self.options for setting in option.settings)

    @property
    def words(self) -> str:
        return " ".join(each.replace(".params.", ".") for each in self.settings) or "(as it is)"


@dataclasses.dataclass(frozen=True)
class Seen:
    """What was measured of a point in a view."""

    ms: float
    ms_low: float
    ms_high: float
    error: float
    error_low: float
    error_high: float


# ---- What was asked ----

def read_budget(text: str) -> Bound:
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(us|ms|s)\s*", text)
    if not found or float(found[1]) <= 0:
        raise Error(2, f"error: --budget '{text}' is no time of a frame\n  expected: a number above 0 with its unit: 4ms, 900us, "
                       "0.1s")
    return Bound("frame", float(found[1]) * UNITS[found[2]])


def better_of(metric: str) -> str:
    known = {each["name"]: each["better"] for each in metrics()}
    if re.fullmatch(r"percentile_\d+(\.\d+)?", metric):
        return "lower"
    if metric not in known or metric == "percentile_P":
        near = difflib.get_close_matches(metric, known, 1)
        raise Error(2, f"error: there is no metric '{metric}'\n  expected: one of {', '.join(known)}"
                       + (f"\n  help:     did you mean '{near[0]}'?" if near else ""))
    return known[metric]


def read_error(text: str) -> Bound:
    name, equals, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not equals or not math.isfinite(value):
        raise Error(2, f"error: --error '{text}' is no bound\n  expected: METRIC=NUMBER, as in flip=0.02 or psnr=40")
    return Bound(name.strip(), value, better_of(name.strip()) == "higher")


# ---- Each pass alone ----

def options_of(pass_name: str, technique: Mapping[str, Any], standing: Mapping[str, Any], is_swapped: bool) -> list[Option]:
    """Ladders together and each on its own, as the graph has it first (of a technique that it has not, only ladders)."""
    ladders = {each["name"]: definition.rung_values(each) for each in technique["parameters"] if each["ladder"]}
    found: dict[tuple, Option] = {}
    swap = (f"{pass_name}.technique={technique['name']}",) if is_swapped else ()
    rungs = [] if is_swapped and ladders else [()]
    for rung in [*rungs, *definition.rungs(ladders), *definition.rungs_of_each(ladders)]:
        values = {knob: definition.toml(value) for knob, value in standing.items() if knob in ladders}
        values |= {knob: definition.toml(value) for knob, value in rung}
        settings = tuple(f"{pass_name}.params.{knob}={definition.toml(value)}" for knob, value in rung)
        found.setdefault(tuple(sorted(values.items())), Option((*swap, *settings)))
    return list(found.values())


def most_accurate(pass_name: str, technique: Mapping[str, Any], is_swapped: bool) -> tuple[str, ...]:
    """Settings of the last rung of every ladder."""
    last = {each["name"]: definition.rung_values(each)[-1] for each in technique["parameters"] if each["ladder"]}
    return (*((f"{pass_name}.technique={technique['name']}",) if is_swapped else ()),
            *(f"{pass_name}.params.{knob}={definition.toml(value)}" for knob, value in last.items()))


# ---- All of them together ----

def front(guesses: Iterable[Guess]) -> list[Guess]:
    """Those that no other one beats, the fastest first."""
    kept: list[Guess] = []
    for each in sorted(guesses, key=lambda guess: (guess.ms, guess.error)):
        if not kept or each.error < kept[-1].error:
            kept.append(each)
    return kept


def combine(base_ms: float, passes: Sequence[Sequence[tuple[Option, float, float]]]) -> list[Guess]:
    """The front of all combinations of one (option, milliseconds beside the base, error) of each pass."""
    found = [Guess((), base_ms, 0.0)]
    for options in passes:
        found = front(Guess((*guess.options, option), guess.ms + ms, math.hypot(guess.error, error))
                      for guess in found for option, ms, error in options)
    return found


def around(guesses: Sequence[Guess], is_within: Callable[[Guess], bool], is_of_time: bool, count: int) -> list[Guess]:
    """Of a front, those on both sides of a bound, the nearest to it first: three quarters within it, where there are so many.

    guesses: the fastest first, so that of a bound of time the first ones are within, of one of error the last ones
    """
    within = [each for each in guesses if is_within(each)]
    beyond = [each for each in guesses if not is_within(each)]
    (within if is_of_time else beyond).reverse()
    inside = min(len(within), max(count - len(beyond), (3 * count + 3) // 4))
    return within[:inside] + beyond[:count - inside]


# ---- Measuring ----

@dataclasses.dataclass
class Bench:
    """What all measurements share."""

    graph: str
    settings: tuple[str, ...]
    port: str
    metric: str
    is_higher_better: bool
    store: Store
    contents: Contents
    folder: pathlib.Path
    options: argparse.Namespace
    say: Callable[[str], None]
    stop: Callable[[], None]
    deadline: float
    device: dict[str, Any] = dataclasses.field(default_factory=dict)

    def measure(self, title: str, views: Sequence[SceneChoice], points: Sequence[Point], truth: Sequence[str],
                parts: int) -> dict[str, dict[str, Seen]]:
        """{view: {point: what was seen}} of points that have a time and an error."""
        study = Study(title, title, self.port, None, tuple(views), tuple(points),
                      Reference(self.graph, (*self.settings, *truth), parts), (self.metric,), rounds=self.options.rounds,
                      frames=self.options.frames, settle=self.options.settle, resolution=0.02, error_resolution=0.02,
                      budget_minutes=self.options.minutes, exposures=None, tone_mapper="aces", seed=0)
        found: dict[str, dict[str, Seen]] = {}
        with self.runs(study) as run_of:
            for view in views:
                run = run_of(view)
                run.identify()
                run.warm_up()
                run.check_budget(run.estimate_seconds())
                run.measure_errors()
                with run.executor.timing():
                    run.measure_times()
                rows, restless = rows_of(run)
                for text in restless:
                    self.say(f"{view.name}: warning: {text}")
                found[view.name] = seen_of(rows, self.metric, points)
        return found

    @contextlib.contextmanager
    def runs(self, study: Study) -> Iterator[Callable[[SceneChoice], SceneRun]]:
        """What runs a view of a study, while the block lasts."""
        here = Here(self.options.device, self.options.timeout, self.folder, self.say, self.stop)
        with Host(self.options.device, log=lambda *_: None) as host, contextlib.closing(here) as executor:
            yield lambda view: SceneRun(study, view, self.store, self.options, self.folder, host, executor, self.contents, self.say,
                                        self.stop, self.deadline)


def seen_of(rows: Sequence[Mapping[str, Any]], metric: str, points: Sequence[Point]) -> dict[str, Seen]:
    by = {(row["variant"], row["knobs"], row["quantity"]): row for row in rows if row.get("value") is not None}
    found = {}
    for point in points:
        knobs = " ".join(f"{knob}={value}" for knob, value in point.knobs)
        ms, error = by.get((point.variant, knobs, "frame")), by.get((point.variant, knobs, metric))
        if ms is not None and error is not None and math.isfinite(ms["value"]):
            found[point.name] = Seen(ms["value"], ms["low"], ms["high"], error["value"], error["low"], error["high"])
    return found


def worst(seen: Mapping[str, Mapping[str, Seen]], name: str, is_higher_better: bool) -> Seen | None:
    """Of all views the slowest time and the largest error; None if a view has none."""
    own = [each[name] for each in seen.values() if name in each]
    if len(own) < len(seen) or not own:
        return None
    slowest = max(own, key=lambda each: each.ms)
    pick = min if is_higher_better else max
    least = pick(own, key=lambda each: each.error)
    return Seen(slowest.ms, slowest.ms_low, max(each.ms_high for each in own), least.error,
                min(each.error_low for each in own), max(each.error_high for each in own))


def keeps(seen: Seen, bound: Bound) -> bool:
    """Whether the whole interval does."""
    if bound.quantity == "frame":
        return seen.ms_high <= bound.value
    return seen.error_low >= bound.value if bound.is_least else seen.error_high <= bound.value


def choose(measured: Mapping[str, Seen], bound: Bound, is_higher_better: bool) -> str | None:
    """Of what keeps to the bound the most accurate, for a bound of times, else the fastest."""
    good = [name for name, seen in measured.items() if keeps(seen, bound)]
    if not good:
        return None
    if bound.quantity == "frame":
        return min(good, key=lambda name: (-1 if is_higher_better else 1) * measured[name].error)
    return min(good, key=lambda name: measured[name].ms)


# ---- The overlay ----

def extends_of(graph: str, output: pathlib.Path) -> str:
    """A path from the overlay's folder, or a shipped graph's name."""
    if pathlib.Path(graph).exists():
        return os.path.relpath(pathlib.Path(graph).resolve(), output.resolve().parent)
    return graph


def value_text(text: str) -> str:
    """A setting's value as TOML has it: words need quotes there."""
    try:
        tomllib.loads(f"value = {text}")
        return text
    except tomllib.TOMLDecodeError:
        return json.dumps(text)


def overlay(graph: str, settings: Sequence[str], passes: Iterable[str], comments: Sequence[str]) -> str:
    """A graph file that extends another one. Later settings of one key replace earlier ones."""
    values: dict[str, str] = {}
    for each in settings:
        key, _, value = each.partition("=")
        values.pop(key.strip(), None)
        values[key.strip()] = value_text(value.strip())
    known = set(passes)
    top = [f"{key} = {value}" for key, value in values.items() if key.split(".")[0] not in known]
    lines = [*(f"# {line}".rstrip() for line in comments), f"extends = {json.dumps(graph)}", *top]
    for name in dict.fromkeys(key.split(".")[0] for key in values):
        if name in known:
            lines += ["", "[[pass]]", f"name = {json.dumps(name)}"]
            lines += [f"{key.partition('.')[2]} = {value}" for key, value in values.items() if key.split(".")[0] == name]
    return "\n".join(lines) + "\n"


# ---- Views ----

def views_of(host: Host, scene_file: str, arguments: argparse.Namespace, folder: pathlib.Path) -> tuple[
        list[SceneChoice], list[SceneChoice], str]:
    """(views that choose, views that check, what is said of them). Without --check-camera or --check-time: the scene's
    other cameras; if it has none, three that look at its middle from elsewhere."""
    overlays = tuple(arguments.overlay)
    with host.scene() as scene:
        load_scene(scene, scene_file)
        for each in overlays:
            scene.load(each)
        described = scene.describe()
    cameras = described.get("cameras", [])
    for name in [*arguments.camera, *arguments.check_camera]:
        if name not in cameras:
            raise Error(2, f"error: the scene has no camera '{name}'\n  expected: one of {', '.join(cameras) or 'none'}")
    used = described.get("camera")
    chosen = list(arguments.camera) or [cameras[used] if cameras and isinstance(used, int) and 0 <= used < len(cameras) else None]
    times = arguments.time or [0.0]

    def views(names: Iterable[str | None], at: Iterable[float], more: tuple[str, ...] = ()) -> list[SceneChoice]:
        return [SceneChoice(scene_file, name, when, (*overlays, *more), "--scene") for name in names for when in at]

    choosing = views(chosen, times)
    checking = views(arguments.check_camera or (chosen if arguments.check_time else []), arguments.check_time or times)
    said = ""
    if not checking:
        others = [name for name in cameras if name not in chosen]
        if others:
            checking = views(others, times)
        else:
            file = folder / "check.scene.toml"
            write_file(str(file), looking_at_the_middle(described["bounds"]))
            checking = views(["left", "right", "above"], times, (str(file),))
            said = "the scene has no other camera: it is checked from three that look at its middle (--check-camera, --check-time)"
    if both := [view.name for view in checking if view in choosing]:
        raise Error(2, f"error: view '{both[0]}' is to choose and to check\n  expected: --check-camera or --check-time that take "
                       "no part in choosing")
    return choosing, checking, said


def looking_at_the_middle(bounds: Sequence[Sequence[float]]) -> str:
    """Three cameras that see all of a scene's bounds: the sphere around them fills their 0.9 radians."""
    low, high = np.asarray(bounds[0], float), np.asarray(bounds[1], float)
    middle, radius = 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-6)
    text = "# Views that check what was tuned.\n"
    for name, turn, lift in (("left", -0.9, 0.25), ("right", 1.1, 0.15), ("above", 0.3, 0.9)):
        toward = np.array([math.sin(turn) * math.cos(lift), math.sin(lift), math.cos(turn) * math.cos(lift)])
        at = middle + toward * radius / math.sin(0.45)
        text += (f"[[camera]]\nname = \"{name}\"\nposition = [{', '.join(f'{x:.9g}' for x in at)}]\n"
                 f"target = [{', '.join(f'{x:.9g}' for x in middle)}]\n")
    return text


# ---- The command ----

def tune(arguments: argparse.Namespace, stop: Callable[[], None]) -> int:
    """Answers 0, or 1 if nothing keeps to the bound, or the choice misses it in a view that checks. raises: Error"""
    def say(text: str) -> None:
        if not arguments.quiet:
            print(text, file=sys.stderr, flush=True)

    bound, metric = read_bound(arguments)
    graph, scene_file = sort_files(arguments.files, None)
    graph = graph or "deferred"
    if scene_file is None:
        raise Error(2, "error: heddle tune needs a scene\n  help:     heddle tune deferred atrium.py --budget 40ms")
    folder = pathlib.Path(arguments.folder or pathlib.Path("out") / "tune")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        store = Store(folder)
    except OSError as error:
        raise Error(4, f"error: the folder '{folder}' cannot be made: {error.strerror}") from error
    with Host(arguments.device, log=lambda *_: None) as host:
        choosing, checking, said = views_of(host, scene_file, arguments, folder)
        with host.graph(graph, arguments.set) as made:
            described = made.describe()
        listed = host.list()
    port = arguments.port or described["output"]
    if port not in [each["name"] for each in described["ports"] if each["type"] == "image"]:
        raise Error(2, f"error: the graph has no image port '{port}'")
    if said:
        say(said)
    bench = Bench(graph, tuple(arguments.set), port, metric, better_of(metric) == "higher", store, Contents(), folder, arguments, say,
                  stop, time.monotonic() + 60 * arguments.minutes)
    every, truths = what_is_tuned(arguments, described["passes"], passes_that_run(bench, choosing[0]), listed)
    say(f"{sum(map(len, every.values()))} settings of {', '.join(every)}, chosen in {names_of(choosing)}, checked in "
        f"{names_of(checking)}; {metric} of {port}; {bound}")
    if arguments.dry_run:
        for options in every.values():
            for option in options:
                print(option.words or "(as it is)")
        return 0
    base_ms, alone = measure_alone(bench, choosing, every, truths)
    truth = (*(setting for each in truths.values() for setting in each), *arguments.reference_set)
    tried, chosen, as_it_is = measure_together(bench, choosing, bound, base_ms, alone, truth)
    print_together(tried, chosen, as_it_is, metric)
    if chosen is None:
        print_nearest(tried, bound, metric)
        return 1
    guess, found = tried[chosen]

    points = [Point("as it is", graph, bench.settings, ()), Point("tuned", graph, (*bench.settings, *guess.settings), ())]
    elsewhere = bench.measure("tune check", checking, points, truth, arguments.parts)
    lines, misses = check_lines(elsewhere, bound, metric)
    output = pathlib.Path(arguments.output or folder / "tuned.toml")
    comments = [
        f"Written by heddle tune: of what was measured with {bound}, the least "
        f"{metric if bound.quantity == 'frame' else 'time'}.",
        f"heddle {version()}; {bench.device.get('name', 'device')} ({bench.device.get('driver_version', 'driver unknown')}); "
        f"{machine()['processor'] or 'processor'} x {machine()['processors']}",
        f"Frames from submission to fence: medians of {arguments.rounds} rounds, with 95 % intervals. {metric} of {port} against "
        f"{' '.join(truth) or 'the graph itself'}", f"Chosen in {names_of(choosing)}: {spell(found, metric)}"
        + (f"; as it was: {spell(as_it_is, metric)}" if as_it_is is not None else ""), *(f"Checked in {line}" for line in lines)]
    write_checked(arguments.device, output, overlay(
        extends_of(graph, output), [*bench.settings, *guess.settings], [each["name"] for each in described["passes"]], comments))
    print(f"\nChosen: {guess.words}\n  in {names_of(choosing)}: {spell(found, metric)}")
    for line in lines:
        print(f"  in {line}")
    report = {"bound": str(bound), "chosen": list(guess.settings), "seen": dataclasses.asdict(found), "misses": misses,
              "elsewhere": {view: {name: dataclasses.asdict(each) for name, each in own.items()} for view, own in elsewhere.items()},
              "tried": [{"settings": list(each.settings), "guessed_ms": each.ms, "guessed_error": each.error,
                         "seen": dataclasses.asdict(one)} for each, one in tried.values()]}
    write_file(str(folder / "tune.json"), json.dumps(report, indent=1) + "\n")
    say(f"wrote {output}")
    return 1 if misses else 0


def read_bound(arguments: argparse.Namespace) -> tuple[Bound, str]:
    """(what the choice keeps to, the metric of errors)."""
    if (arguments.budget is None) == (arguments.error is None):
        raise Error(2, "error: heddle tune needs one bound\n  expected: --budget 4ms, for the least error in that time, or --error "
                       "flip=0.02, for the least time within that error")
    bound = read_budget(arguments.budget) if arguments.budget is not None else read_error(arguments.error)
    metric = arguments.metric or (bound.quantity if bound.quantity != "frame" else "flip")
    if bound.quantity not in ("frame", metric):
        raise Error(2, f"error: --metric {metric} and --error {arguments.error}\n  expected: one metric; --metric goes with --budget")
    better_of(metric)
    if arguments.rounds < FEWEST_ROUNDS:
        raise Error(2, f"error: --rounds {arguments.rounds}\n  expected: at least {FEWEST_ROUNDS}")
    return bound, metric


def what_is_tuned(arguments: argparse.Namespace, passes: Sequence[Mapping[str, Any]], running: set[str],
                  listed: Mapping[str, Any]) -> tuple[dict[str, list[Option]], dict[str, tuple[str, ...]]]:
    """({pass: its options}, {pass: what is true of it})."""
    techniques = {(each["role"], each["name"]): each for each in listed["techniques"]}
    roles = {each["name"]: each for each in listed["roles"]}
    every: dict[str, list[Option]] = {}
    truths: dict[str, tuple[str, ...]] = {}
    for each in tuned_passes(arguments, passes, running, techniques):
        name, here = each["name"], techniques[each["role"], each["technique"]]
        every[name] = options_of(name, here, each["parameters"], False)
        truths[name] = most_accurate(name, here, False)
        if arguments.techniques:
            for (role, _), other in sorted(techniques.items()):
                if role == each["role"] and other is not here and not definition.needs_artifact(other):
                    every[name] += options_of(name, other, each["parameters"], True)
            stated = (roles[each["role"]].get("references") or {}).get("same_model") or {}
            if reference := techniques.get((each["role"], stated.get("technique", "").split("/")[-1])):
                truths[name] = most_accurate(name, reference, reference is not here)
    return every, truths


def measure_alone(bench: Bench, views: Sequence[SceneChoice], every: Mapping[str, Sequence[Option]],
                  truths: Mapping[str, tuple[str, ...]]) -> tuple[float, list[list[tuple[Option, float, float]]]]:
    """(milliseconds of the graph as it is, of each pass (option, milliseconds beside that, error))."""
    base_ms, alone = 0.0, []
    for name, options in every.items():
        points = [Point(name, bench.graph, (*bench.settings, *option.settings), (("", i),) if i else ())
                  for i, option in enumerate(options)]
        seen = bench.measure(f"tune {name}", views, points, (*truths[name], *bench.options.reference_set), bench.options.parts)
        first = worst(seen, points[0].name, bench.is_higher_better)
        if first is None:
            raise Error(4, f"error: the graph as it is could not be measured; what was said is in {bench.folder / 'workers.log'}")
        base_ms = base_ms or first.ms
        own = []
        print(f"\n{name} alone: frame, and {bench.metric} against its most accurate; of {len(views)} views the worst")
        for option, point in zip(options, points):
            found = worst(seen, point.name, bench.is_higher_better)
            print(f"  {option.words or '(as it is)':<64} " + (spell(found, bench.metric) if found else "lost"))
            if found is not None:
                own.append((option, found.ms - first.ms, as_error(found.error, bench.metric)))
        alone.append(own)
    return base_ms, alone


def measure_together(bench: Bench, views: Sequence[SceneChoice], bound: Bound, base_ms: float,
                     alone: Sequence[Sequence[tuple[Option, float, float]]], truth: Sequence[str]) -> tuple[
                         dict[str, tuple[Guess, Seen]], str | None, Seen | None]:
    """(what was measured by its settings, which is chosen, the graph as it is)."""
    tried: dict[str, tuple[Guess, Seen]] = {}
    slow, wrong, as_it_is = 1.0, 1.0, None
    limit = as_error(bound.value, bench.metric)
    for trial in range(TRIALS):
        def is_within(guess: Guess, slow: float = slow, wrong: float = wrong) -> bool:
            return guess.ms * slow <= bound.value if bound.quantity == "frame" else guess.error * wrong <= limit

        fresh = [each for each in combine(base_ms, alone) if each.words not in tried]
        fresh = around(fresh, is_within, bound.quantity == "frame", TRIED)
        # Where even the guess keeps to no bound, what is nearest to it is measured once, to be told.
        if not fresh or (trial > 0 and not any(map(is_within, fresh))):
            break
        points = [Point("as it is", bench.graph, bench.settings, ())]
        points += [Point("together", bench.graph, (*bench.settings, *each.settings), (("", 100 * trial + i),))
                   for i, each in enumerate(fresh)]
        seen = bench.measure("tune together", views, points, truth, bench.options.parts)
        as_it_is = worst(seen, points[0].name, bench.is_higher_better)
        new = {each.words: (each, found) for each, point in zip(fresh, points[1:])
               if (found := worst(seen, point.name, bench.is_higher_better)) is not None}
        tried |= new
        chosen = choose({name: found for name, (_, found) in tried.items()}, bound, bench.is_higher_better)
        if chosen is not None or not new:
            return tried, chosen, as_it_is
        # The guess was too good: by how much.
        slow = float(np.median([found.ms / guess.ms for guess, found in tried.values()]))
        ratios = [as_error(found.error, bench.metric) / guess.error for guess, found in tried.values() if guess.error > 0]
        wrong = float(np.median(ratios)) if ratios else 1.0
    return tried, None, as_it_is


def passes_that_run(bench: Bench, view: SceneChoice) -> set[str]:
    """Names of passes that a frame of this view is made of."""
    base = Point("as it is", bench.graph, bench.settings, ())
    study = Study("tune", "tune", bench.port, None, (view,), (base,), None, (bench.metric,), bench.options.rounds,
                  bench.options.frames, bench.options.settle, 0.02, 0.02, bench.options.minutes, None, "aces", 0)
    with bench.runs(study) as run_of:
        run = run_of(view)
        run.identify()
        bench.device = next(iter(run.executor.place()["devices"]), {})
        found = run.ask(base, "passes")
        if found is None:
            raise Error(4, f"error: the graph cannot be rendered: {run.state[base.name][1]}")
    return {each["name"] for each in found["passes"] if not each["is_pruned"]}


def tuned_passes(arguments: argparse.Namespace, passes: Sequence[Mapping[str, Any]], running: set[str],
                 techniques: Mapping[tuple[str, str], Any]) -> list[Mapping[str, Any]]:
    """Those of --pass, else all that run and have knobs (with --techniques: or rivals)."""
    by_name = {each["name"]: each for each in passes}
    for name in arguments.passes:
        if name not in by_name or name not in running:
            raise Error(2, f"error: --pass {name}: no pass of the frame has that name\n  expected: one of "
                           f"{', '.join(each for each in by_name if each in running)}")
    found = []
    for each in passes:
        if each["name"] not in running or (arguments.passes and each["name"] not in arguments.passes):
            continue
        rivals = [name for role, name in techniques if role == each["role"]]
        own = techniques.get((each["role"], each["technique"]))
        has_knobs = own is not None and any(parameter["ladder"] for parameter in own["parameters"])
        if own is not None and (has_knobs or (arguments.techniques and len(rivals) > 1)):
            found.append(each)
        elif arguments.passes:
            raise Error(2, f"error: --pass {each['name']}: {each['role']}/{each['technique']} has no knobs\n  help:     "
                           "--techniques tries other techniques of its role")
    if not found:
        raise Error(2, "error: no pass of the frame has knobs")
    return found


def as_error(value: float, metric: str) -> float:
    """A metric as a distance from what is true, which adds up as independent errors do: of psnr the root mean square,
    of others that are better higher what is missing to 1."""
    if metric == "psnr":
        return 10.0 ** (-value / 20.0)
    return 1.0 - value if better_of(metric) == "higher" else value


def names_of(views: Sequence[SceneChoice]) -> str:
    return ", ".join(view.name for view in views)


def spell(seen: Seen, metric: str) -> str:
    return (f"{seen.ms:.4g} ms ({seen.ms_low:.4g} to {seen.ms_high:.4g}), {metric} {seen.error:.4g} ({seen.error_low:.4g} to "
            f"{seen.error_high:.4g})")


def print_together(tried: Mapping[str, tuple[Guess, Seen]], chosen: str | None, as_it_is: Seen | None, metric: str) -> None:
    print("\nAll passes together (guessed -> measured):")
    if as_it_is is not None:
        print(f"    {'(as it is)':<20} {spell(as_it_is, metric)}")
    for name, (guess, found) in sorted(tried.items(), key=lambda each: each[1][1].ms):
        print(f"  {'*' if name == chosen else ' '} {guess.words}\n    {guess.ms:.4g} ms, {guess.error:.3g} -> "
              f"{spell(found, metric)}")
    if tried:
        off = [abs(math.log(found.ms / guess.ms)) for guess, found in tried.values() if guess.ms > 0]
        if off:
            print(f"  guessed times were off by {100 * math.expm1(float(np.median(off))):.0f} % in the median, "
                  f"{100 * math.expm1(max(off)):.0f} % at most")


def print_nearest(tried: Mapping[str, tuple[Guess, Seen]], bound: Bound, metric: str) -> None:
    print(f"\nNothing that was measured keeps to {bound} with its whole interval. No overlay was written.")
    if tried:
        guess, found = min(tried.values(), key=lambda each: each[1].ms if bound.quantity == "frame" else as_error(each[1].error, metric))
        print(f"The nearest: {guess.words} with {spell(found, metric)}")


def check_lines(elsewhere: Mapping[str, Mapping[str, Seen]], bound: Bound, metric: str) -> tuple[list[str], list[str]]:
    """(a line a view, the views that miss the bound). A view misses if the middle value does; whether that could be noise is
    said."""
    lines, misses = [], []
    for view, own in elsewhere.items():
        if "tuned" not in own:
            lines.append(f"{view}: MISSED: it could not be measured")
            misses.append(view)
            continue
        seen = own["tuned"]
        value, low, high = (seen.ms, seen.ms_low, seen.ms_high) if bound.quantity == "frame" else (
            seen.error, seen.error_low, seen.error_high)
        ends = sorted((bound.cost(low), bound.cost(high)))
        verdict = "kept"
        if bound.cost(value) > bound.cost(bound.value):
            misses.append(view)
            verdict = "MISSED" if ends[0] > bound.cost(bound.value) else "MISSED, within what was seen of noise"
        elif ends[1] > bound.cost(bound.value):
            verdict = "kept, but its interval reaches beyond"
        before = f"; as it was: {spell(own['as it is'], metric)}" if "as it is" in own else ""
        lines.append(f"{view}: {verdict}: {spell(seen, metric)}{before}")
    return lines, misses


def write_checked(device: str | None, output: pathlib.Path, text: str) -> None:
    """The overlay, whole or not there, and only if the host takes it."""
    partial = output.with_name(f".{output.name}.{os.getpid()}.toml")  # beside it: its path to what it extends is relative
    write_file(str(partial), text)
    try:
        with Host(device, log=lambda *_: None) as host, host.graph(str(partial)):
            pass
        partial.replace(output)
    finally:
        partial.unlink(missing_ok=True)
