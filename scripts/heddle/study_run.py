# SPDX-License-Identifier: Apache-2.0
"""Running a study: variants in processes of their own that take turns, errors apart from times, everything kept.

What is measured is kept in FOLDER/measured under names that say what went into it (contents of libraries, graphs, shaders,
scenes, settings, machine), each file whole or not there; what is there is not measured again, so that a study that was
interrupted goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import json
import math
import os
import pathlib
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from . import Error, Host, metrics, version
from . import statistics as s
from . import study as definition
from . import study_images as images
from .__main__ import scene_path
from ._library import CANCELLED
from .study import Point, SceneChoice, Study, slug
from .study_items import (AGAIN, CLOCKS, PROFILED_FRAMES, REFERENCE, SEEDS, Contents, Lost, Refused, Residents, digest, fingerprint, own,
                          portable, timing_alone, used_seconds)
from .study_rows import (command_line, finite, made_by, mark_dominated, mark_front, print_summary, rows_of, write, write_image,
                         write_table)
from .study_spent import Spent, own_seconds
from .study_worker import open_graph, open_scene

# ---- What is kept ----

class Store:
    """FOLDER/measured: JSON by key, whole or not there."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder / "measured"
        self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, key: str, ending: str = ".json") -> pathlib.Path:
        return self.folder / f"{key}{ending}"

    def get(self, key: str) -> Any:
        try:
            return json.loads(self.path(key).read_text())
        except (OSError, ValueError):
            return None

    def put(self, key: str, value: Any) -> Any:
        write(self.path(key), json.dumps(value))
        return value

    def image(self, key: str) -> np.ndarray | None:
        try:
            return np.load(self.path(key, ".npy"), allow_pickle=False)
        except (OSError, ValueError, EOFError):  # not there, or damaged: it is made again
            return None

    def put_image(self, key: str, pixels: np.ndarray) -> None:
        write_image(self.path(key, ".npy"), pixels)

    def lines(self, key: str) -> list[Any]:
        """What append() wrote. Lines that are not whole are left out: a last one, or what a crash of the machine left."""
        try:
            content = self.path(key, ".jsonl").read_bytes()
        except OSError:
            return []
        found = []
        for line in content.split(b"\n")[:-1]:
            with contextlib.suppress(ValueError):
                found.append(json.loads(line))
        return found

    def append(self, key: str, value: Any) -> None:
        path = self.path(key, ".jsonl")
        if path.exists():
            content = path.read_bytes()
            if not content.endswith(b"\n"):
                os.truncate(path, content.rfind(b"\n") + 1)  # what an interrupted run, or a full disk, left half written
        with open(path, "a") as file:
            file.write(json.dumps(value) + "\n")
            file.flush()
            os.fsync(file.fileno())


# ---- Who does the work ----

@dataclasses.dataclass(frozen=True)
class Answer:
    """Of an item: its value, or how its point was lost, and the machine that did it."""

    machine: str  # fingerprint()["id"]
    value: Any = None
    lost: Lost | None = None


class Moved(Exception):
    """The machine that times is another one now: what was measured there before is not compared with what it does."""


class Here:
    """Does items in this process, one after the other; the processes of a scene's variants stay for all of them."""

    width = 1  # items at once

    def __init__(self, device: str | None, timeout: float, folder: pathlib.Path, say: Callable[[str], None],
                 stop: Callable[[], None]):
        self._device, self._timeout, self._folder, self._say, self._stop = device, timeout, folder, say, stop
        self._contents = Contents()
        self._residents: Residents | None = None

    def machines(self) -> list[dict]:
        """Fingerprints of those that do items, or did."""
        return [self.place()]

    def place(self) -> dict:
        """The fingerprint of the machine that times."""
        try:
            return fingerprint(self._device)
        except Lost as lost:
            raise Error(4, f"error: the devices of this machine cannot be listed\n    {lost}") from lost

    def run(self, items: Sequence[dict], truth: dict | None = None) -> Iterator[tuple[int, Answer]]:
        """The items by number with their answers, as they come. raises: Error, OSError"""
        for i, item in enumerate(items):
            yield i, self._do(item, truth)

    def at_place(self, item: dict) -> Answer:
        """Of an item that is timed. raises: Moved, Error, OSError"""
        return self._do(item, None)

    def timing(self) -> contextlib.AbstractContextManager:
        """While items are timed: nobody else times on this machine."""
        return timing_alone(self._say, self._stop)

    def used(self) -> float | None:
        """Processor seconds of this process and of all that it started; None where they are elsewhere."""
        workers = self._residents.workers.values() if self._residents is not None else []
        return own_seconds() + sum(used_seconds(each.process.pid) for each in workers)

    def end(self, owner: str) -> None:
        """That process is not needed any more."""
        if self._residents is not None:
            self._residents.end(owner)

    def close(self) -> None:
        if self._residents is not None:
            self._residents.close()
            self._residents = None

    def _do(self, item: dict, truth: dict | None) -> Answer:
        if self._residents is None or self._residents.scene != item["scene"]:
            self.close()
            self._residents = Residents(item["scene"], self._device, self._timeout, self._folder, self._stop, self._contents)
        try:
            return Answer(self.place()["id"], self._residents.do(item, truth))
        except Lost as lost:
            return Answer(self.place()["id"], lost=lost)
        except Refused as refused:
            raise Error(2, f"error: {refused}\n  help:     it has changed meanwhile; the same command measures again what "
                           "depends on it") from refused

# ---- A scene of a study ----

class SceneRun:
    """All that is measured on one scene. Points that are lost have a state other than "ok", and the others go on."""

    def __init__(self, study: Study, scene: SceneChoice, store: Store, options: argparse.Namespace, folder: pathlib.Path,
                 host: Host, executor: Here, contents: Contents, say: Callable[[str], None], stop: Callable[[], None],
                 deadline: float):
        self.study, self.scene, self.store, self.options, self.folder = study, scene, store, options, folder
        self.host, self.executor, self.contents, self.say, self.stop = host, executor, contents, say, stop
        self.deadline = deadline  # of time.monotonic(): the study's budget ends
        path = scene_path(scene.file)
        self.described = {"file": portable(path or scene.file), "camera": scene.camera, "time": scene.time,
                          "overlays": [portable(each) for each in scene.overlays],
                          "arguments": [list(each) for each in scene.arguments]}
        self.state: dict[str, tuple[str, str]] = {point.name: ("ok", "") for point in study.points}
        self.graphs: dict[str, dict] = {}  # what items are told of points
        self.keys: dict[str, str] = {}  # what a point's images depend on, beside the machine
        self.scene_files: list[str] = []
        self.pixels: dict[str, int] = {}  # of a point's frame
        self.passes: dict[str, int] = {}  # how many a point's graph has
        self.standing: dict[str, dict] = {}  # all parameters of the study's pass, as a point has them
        self.warm: dict[str, dict] = {}
        self.measured: dict[str, dict] = {}  # profile() of points
        self.errors: dict[str, dict] = {}
        self.rounds: list[dict] = []
        self.foreign: float | None = None  # share of the processors that other programs used while rounds were timed
        self.changing: dict[str, int] = {}  # frames of the warm-up of points that were still changing after them
        self.kept: dict[str, str] = {}  # keys of images.load(): the first seed of points, and REFERENCE
        self.explained: dict[str, str] = {}  # keys of the store: how points' frames were planned
        self.machine = ""  # id of the one that timed
        self.reference_size = 0.0  # root mean square of the reference's values

    @property
    def baseline(self) -> Point:
        return self.study.points[0]

    def alive(self) -> list[Point]:
        return [point for point in self.study.points if self.state[point.name][0] == "ok"]

    def lose(self, name: str, lost: Lost) -> None:
        point = self.baseline.name if name == AGAIN else name
        text = f"a second process of it: {lost}" if name == AGAIN else str(lost)
        self.state[point] = (lost.state, text)
        self.say(f"{self.scene.name}: {point} {lost.state}: {text}")

    # What there is to do

    def identify(self) -> None:
        """What goes into every point, from its files; renders nothing."""
        try:
            made, _, self.scene_files = open_scene(self.host, {**self.described, "file": own(self.described["file"]),
                                                          "overlays": list(self.scene.overlays)})
            made.close()
        except Error as error:
            raise Error(error.status, f"{self.scene.where}: error: nothing of scene '{self.scene.name}' can be rendered\n    "
                        + str(error).replace("\n", "\n    ")) from error
        for point in self.study.points:
            try:
                self.identify_one(point.name, point.graph, point.settings)
                if self.study.function_image is not None:
                    self.identify_one(self.image_of(point.name), point.graph, point.settings, self.study.pass_name)
            except Error as error:
                self.lose(point.name, Lost("failed", str(error)))
        if (reference := self.study.reference) is not None and not reference.files:
            self.identify_one(REFERENCE, reference.graph, reference.settings, self.study.pass_name, reference.port, reference.adds)
        self.check_alive()

    def identify_one(self, name: str, graph: str, settings: Sequence[str], asked: str | None = None,
                     keep: str | None = None, adds: str | None = None) -> None:
        """asked: of a graph that is not timed the pass whose answers become an image, where the study has such a role.
        keep: another port than the study's. adds: passes that the graph does not have, as TOML. raises: Error"""
        if self.study.function_image is not None and asked is not None and adds is None:
            adds = definition.with_function_image(self.host, graph, settings, self.study.function_image, asked)
        # What is timed makes the port only if it is the graph's own.
        if keep is None and (adds is not None or self.study.function_image is None):
            keep = self.study.port
        with open_graph(self.host, definition.absolute(graph) if adds else graph, settings, adds) as made:
            if keep is not None:
                made.keep(keep)
            files = [file for file in made.files() if pathlib.Path(file).is_absolute() or pathlib.Path(file).exists()]
            described = made.describe()
        self.pixels[name] = described["extent"][0] * described["extent"][1]
        self.passes[name] = len(described["passes"])
        self.standing[name] = next((each.get("parameters", {}) for each in described["passes"]
                                    if each["name"] == self.study.pass_name), {})
        expected = self.contents.of([*files, *self.scene_files])
        self.graphs[name] = {"graph": portable(graph) if pathlib.Path(graph).is_file() else graph, "settings": list(settings),
                             "expected": expected, "keep": keep, "adds": adds}
        self.keys[name] = digest("image", [content for _, content in sorted(expected.items())], settings, adds,
                                 self.scene.camera, self.scene.time, self.scene.arguments, keep if adds else self.study.port,
                                 self.study.settle)

    def image_of(self, name: str) -> str:
        """The name under which a point's image is made: another graph's, where the point's own has none."""
        return name if self.study.function_image is None else f"{name} (image)"

    def check_alive(self) -> None:
        if not self.alive():  # nothing can be measured: the scene, the device, or all settings are wrong
            state, text = self.state[self.baseline.name]
            raise Error(2 if state == "failed" else 4, f"{self.scene.where}: error: nothing of scene '{self.scene.name}' can be "
                        f"rendered\n    " + text.replace("\n", "\n    "))

    def told(self, name: str, owner: str, shown: str | None = None) -> dict:
        """A point as items have it. owner: the process it lives in; shown: by another name, as the first point's double."""
        return {"name": shown or name, "owner": owner} | self.graphs[name]

    def item(self, do: str, **more: Any) -> dict:
        return {"do": do, "scene": self.described, "device": self.options.device, "timeout": self.options.timeout,
                "port": self.study.port, "settle": self.study.settle} | more

    def ask(self, point: Point, request: str, **arguments: Any) -> dict | None:
        """What study_worker.py says of a point where it is timed; None if it is lost by now."""
        while self.state[point.name][0] == "ok":
            with contextlib.suppress(Moved):
                answer = self.executor.at_place(self.item("ask", point=self.told(point.name, point.variant), request=request,
                                                          arguments=arguments))
                if answer.lost is None:
                    return answer.value
                self.lose(point.name, answer.lost)
        return None

    # Warm-up and what it will take

    def warm_up(self) -> None:
        """Of the points of which something is not measured yet."""
        due = [point for point in self.alive() if self.is_due(point)]
        for point in due:
            while point.name not in self.warm and self.state[point.name][0] == "ok":
                with contextlib.suppress(Moved):
                    answer = self.executor.at_place(self.item("warm_point", point=self.told(point.name, point.variant)))
                    if answer.lost is not None:
                        self.lose(point.name, answer.lost)
                    else:
                        self.warm[point.name] = answer.value
                        # Of those that are known by now: hours are said before the others have warmed up for hours.
                        self.check_budget(self.estimate_seconds(), "at least")
        self.check_alive()
        self.say(f"{self.scene.name}: {len(due)} of {len(self.study.points)} points are to be measured")

    def is_due(self, point: Point) -> bool:
        return bool(self.missing_rounds(point) or self.store.get(self.profile_key(point)) is None
                    or (self.study.reference is not None and not self.has_images(point)))

    def has_images(self, point: Point) -> bool:
        return any(self.store.get(self.images_key(point, each["id"])) is not None for each in self.executor.machines())

    def missing_rounds(self, point: Point) -> int:
        done = sum(point.name in each["order"] for each in self.finished_rounds())
        return max(0, self.study.rounds - done)

    def estimate_seconds(self) -> float:
        """Of what is not measured yet: rounds, profiles and images. The reference is known once its first part is there."""
        points = self.alive()
        frame = {point.name: self.warm[point.name]["ms"] / 1e3 for point in points if point.name in self.warm}
        missing = {point.name: self.missing_rounds(point) for point in points}
        # The first point and its double take turns in all of them.
        if self.baseline.name in missing:
            missing[self.baseline.name] = max(missing.values())
        seconds = 2 * (self.study.frames + 1) * sum(
            rounds * frame.get(name, 0.0) * (2 if name == self.baseline.name else 1) for name, rounds in missing.items())
        for point in points:
            if self.store.get(self.profile_key(point)) is None:
                seconds += (PROFILED_FRAMES + 2) * frame.get(point.name, 0.0)  # one for memory, one that explains itself
            if self.study.reference is not None and not self.has_images(point):
                seconds += SEEDS * self.study.settle * frame.get(point.name, 0.0) / self.executor.width
        return seconds + more_seconds(self)

    def check_budget(self, rest: float, how: str = "about") -> None:
        """Before anything is timed: a study that would take longer than it may says so now."""
        if time.monotonic() + rest > self.deadline:
            raise Error(2, f"error: this study would take {how} {duration(rest)} more; its budget is "
                           f"{self.study.budget_minutes:g} min\n  help:     --budget MINUTES; or fewer rounds, frames, scenes or "
                           "values of knobs, smaller images, a cheaper reference. What was measured is kept")

    # Errors

    def reference_images(self) -> list[np.ndarray]:
        """The independent parts of the reference; one if it has no randomness, or is an image. raises: Lost"""
        reference = self.study.reference
        assert reference is not None
        if reference.files:
            return [self.host.read_image(reference.files[self.study.scenes.index(self.scene)])]
        told = self.told(REFERENCE, REFERENCE)
        # Seeds of techniques begin at 0: noise is never compared with itself.
        items = [self.item("part", point=told, seed=1_000_000 + part, port=reference.port or self.study.port)
                 for part in range(reference.parts)]
        parts: dict[int, np.ndarray] = {}
        for i, item in enumerate(items):
            for machine in self.executor.machines():
                found = self.store.image(self.part_key(item["seed"], machine["id"]))
                if found is not None:
                    parts[i] = found
                    break

        def make(wanted: Sequence[int]) -> float:
            todo = [i for i in wanted if i not in parts]
            seconds = 0.0
            for number, answer in self.executor.run([items[i] for i in todo]):
                if answer.lost is not None:
                    raise answer.lost
                i = todo[number]
                parts[i], seconds = answer.value["image"], answer.value["seconds"]
                self.store.put_image(self.part_key(items[i]["seed"], answer.machine), parts[i])
            return seconds

        seconds = make([0])
        if seconds and reference.parts > 1:
            rest = seconds * math.ceil((reference.parts - 1) / self.executor.width)
            self.say(f"{self.scene.name}: the reference takes {duration(rest)} more at most")
            self.check_budget(rest + self.estimate_seconds())
        make(range(min(2, reference.parts)))
        if len(parts) > 1 and np.array_equal(parts[0], parts[1]):
            return [parts[0]]
        make(range(reference.parts))
        return [parts[i] for i in sorted(parts)]

    def part_key(self, seed: int, machine: str) -> str:
        return digest("part", self.keys[REFERENCE], machine, seed)

    def measure_errors(self) -> None:
        """Errors of every point against the reference, per seed and with each part of the reference left out."""
        if self.study.reference is None or not self.alive():
            return
        try:
            parts = self.reference_images()
        except Lost as lost:
            self.say(f"{self.scene.name}: the reference {lost.state}: {lost}")
            for point in self.study.points:
                self.state[point.name] = (lost.state, f"the reference: {lost}")
            return
        finally:
            self.executor.end(REFERENCE)
        stack = np.stack(parts).astype(np.float64)
        total = stack.sum(axis=0)
        whole = (total / len(parts)).astype(np.float32)
        self.reference_size = float(np.sqrt(np.mean(np.square(whole, dtype=np.float64))))
        truth = {"whole": whole, "without": [((total - part) / (len(parts) - 1)).astype(np.float32) for part in stack]
                 if len(parts) > 1 else []}
        write_image(self.folder / f"reference_{slug(self.scene.name)}.npy", whole)
        self.kept[REFERENCE] = digest("kept", images.fingerprint(whole))
        if images.head_of(self.folder, self.kept[REFERENCE]) is None:
            images.keep(self.folder, self.kept[REFERENCE], whole)
        known = digest(hashlib.sha256(whole.tobytes()).hexdigest(), len(parts), self.study.metrics, self.study.exposures,
                       self.study.tone_mapper, SEEDS)
        todo = []
        for point in self.alive():
            found = [self.store.get(self.errors_key(point, known, machine["id"])) for machine in self.executor.machines()]
            found = [each for each in found if each is not None]
            if found:
                self.errors[point.name] = found[0]
                self.keep_image(point, found[0]["machine"])
            else:
                todo.append(point)
        items = [self.item("errors", point=self.told(self.image_of(point.name), point.variant), metrics=list(self.study.metrics), exposures=self.study.exposures,
                           tone_mapper=self.study.tone_mapper) for point in todo]
        for number, answer in self.executor.run(items, truth):
            point = todo[number]
            if answer.lost is not None:
                self.lose(point.name, answer.lost)
                continue
            self.keep_image(point, answer.machine, answer.value.pop("image"))
            self.errors[point.name] = answer.value | {"machine": answer.machine}
            self.store.put(self.errors_key(point, known, answer.machine), self.errors[point.name])
            self.store.put(self.images_key(point, answer.machine), {"point": point.name})

    def keep_image(self, point: Point, machine: str, image: np.ndarray | None = None) -> None:
        """Of the first seed, for the report. A study of before reports has errors without it: then it is rendered again."""
        key = self.kept[point.name] = digest("kept", self.keys[self.image_of(point.name)], machine)
        if images.head_of(self.folder, key) is not None:
            return
        if image is None:
            image = self.render_image(point, 0)
        if image is not None:
            images.keep(self.folder, key, image)

    def render_image(self, point: Point, seed: int) -> np.ndarray | None:
        """None if the point is lost by that."""
        item = self.item("part", point=self.told(self.image_of(point.name), point.variant), seed=seed)
        for _, answer in self.executor.run([item]):
            if answer.lost is None:
                return answer.value["image"]
            self.lose(point.name, answer.lost)
        return None

    def errors_key(self, point: Point, reference: str, machine: str) -> str:
        return digest("errors", self.keys[self.image_of(point.name)], machine, reference)

    def images_key(self, point: Point, machine: str) -> str:
        return digest("images", self.keys[self.image_of(point.name)], machine)

    # Times

    def times_key(self) -> str:
        return digest("times", CLOCKS, self.keys.get(self.baseline.name), self.executor.place()["id"], self.study.frames)

    def finished_rounds(self) -> list[dict]:
        """On the machine that times now; of each round the turns of points that are still what they were then. A variant
        that has changed since is measured again, and nobody else but the first, with which it is compared."""
        now = {point.name: self.keys.get(point.name) for point in self.study.points} | {AGAIN: self.keys.get(self.baseline.name)}
        rounds = []
        for each in self.store.lines(self.times_key()):
            kept = [i for i, name in enumerate(each["order"]) if name in now and each["keys"].get(name) == now[name] is not None]
            rounds.append(each | {key: [each[key][i] for i in kept] for key in ("order", *CLOCKS)})
        return rounds

    def profile_key(self, point: Point) -> str:
        return digest("profile", self.keys[point.name], self.executor.place()["id"], PROFILED_FRAMES)

    def measure_passes(self) -> None:
        """Pass by pass, apart from all other times: submitting stage by stage makes a frame slower."""
        for point in self.alive():
            while point.name not in self.measured and self.state[point.name][0] == "ok":
                key = self.profile_key(point)
                found = self.store.get(key)
                if found is None:
                    try:
                        answer = self.executor.at_place(self.item("profile", point=self.told(point.name, point.variant)))
                    except Moved:
                        continue
                    if answer.lost is not None:
                        self.lose(point.name, answer.lost)
                        continue
                    found = answer.value | {"machine": answer.machine}
                    self.store.put(key, found)
                self.measured[point.name] = found
            key = self.explained[point.name] = digest("explain", self.keys[point.name])
            if self.store.get(key) is None and (explained := self.ask(point, "explain")) is not None:
                self.store.put(key, explained["explain"])

    def measure_times(self) -> None:
        """Rounds of turns. A point that is lost on the way leaves; what it and the others finished stays."""
        while due := [point for point in self.alive() if self.missing_rounds(point)]:
            with contextlib.suppress(Moved):
                self.time_round(due)
        self.machine = self.executor.place()["id"]
        self.rounds = self.finished_rounds()
        # Of all rounds, whichever run took them.
        others, passed = (sum(each["others"][i] for each in self.rounds) for i in (0, 1))
        if passed > 1:
            self.foreign = max(0.0, others / passed)
        for each in self.rounds:
            self.changing |= {name: frames for name, frames in each["changing"].items() if name in each["order"]}

    def time_round(self, due: Sequence[Point]) -> None:
        """One round, kept if nobody is lost in it: of those that are due, and of the first point, twice."""
        told = {point.name: self.told(point.name, point.variant) for point in due}
        if self.state[self.baseline.name][0] == "ok":
            told |= {self.baseline.name: self.told(self.baseline.name, self.baseline.variant),
                     AGAIN: self.told(self.baseline.name, AGAIN, AGAIN)}
        key = self.times_key()
        number = len(self.store.lines(key))
        names = [name for name in [*(point.name for point in self.study.points), AGAIN] if name in told]
        order = s.turns(names, 1, self.study.seed + number)[0]
        answer = self.executor.at_place(self.item("round", points=list(told.values()), order=order, frames=self.study.frames))
        if answer.lost is not None:
            self.lose(answer.lost.point, answer.lost)
            return
        if key != self.times_key():
            return  # another machine did it
        keys = {name: self.keys[self.baseline.name if name == AGAIN else name] for name in told}
        self.store.append(key, {"round": number, "order": order, "keys": keys, "machine": answer.machine, **answer.value})
        done = self.study.rounds - max(self.missing_rounds(point) for point in due)
        if done in (1, self.study.rounds) or done % 5 == 0:
            self.say(f"{self.scene.name}: round {done} of {self.study.rounds}")


def duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


# ---- Rows ----

UNGATED = 4  # the status of a gate that came to no verdicts


def run_study(options: argparse.Namespace, stop: Callable[[], None]) -> int:
    """Answers the exit status. raises: Error; of a gate never with a status that is a verdict's"""
    try:
        return measure(options, stop)
    except Error as error:
        if options.gate and error.status != CANCELLED:
            raise Error(UNGATED, str(error)) from error
        raise
    except OSError as error:  # a disk that is full, a folder that may not be written
        raise Error(UNGATED, f"error: the study's files cannot be written or read: {error}\n  help:     what was measured "
                             "before is kept; the same command goes on from there") from error
    except Exception:
        if not options.gate:
            raise
        traceback.print_exc()  # Python's own status would be "worse"
        return UNGATED


def measure(options: argparse.Namespace, stop: Callable[[], None]) -> int:
    def say(text: str) -> None:
        if not options.quiet:
            print(text, file=sys.stderr, flush=True)

    with Host(options.device, log=lambda *_: None) as host:
        if options.role is not None:
            if not options.files and not options.scene:
                raise Error(2, "error: --role needs a scene\n  help:     heddle study --role ambient_occlusion atrium.py")
            study = definition.of_role(host, options.role, [*options.files, *options.scene], options.set, options.climb,
                                       options.graph, options.reference)
        elif len(options.files) != 1 or options.set or options.graph or options.reference:
            raise Error(2, "error: heddle study takes one study file, or --role ROLE with scenes\n  found:    "
                           f"{len(options.files)} files" + (" and --set" if options.set else "")
                        + (" and --graph" if options.graph else "")
                        + (" and --reference" if options.reference else ""))
        else:
            study = definition.read(host, options.files[0], options.scene)
        return measure_study(options, host, study, say, stop)


def measure_study(options: argparse.Namespace, host: Host, study: Study, say: Callable[[str], None],
                  stop: Callable[[], None]) -> int:
    if options.rounds is not None and options.rounds < s.FEWEST_ROUNDS:
        raise Error(2, f"error: --rounds {options.rounds}\n  expected: at least {s.FEWEST_ROUNDS}: fewer decide nothing")
    study = dataclasses.replace(study, **{key: value for key, value in (
        ("rounds", options.rounds), ("budget_minutes", options.budget)) if value is not None})
    folder = pathlib.Path(options.folder or pathlib.Path("out") / study.name)
    for warning in study.warnings:
        say(warning)
    say(f"{study.title}: {len(study.scenes)} scenes, {len(study.points)} points, {study.rounds} rounds of "
        f"{study.frames} frames twice, {', '.join(study.metrics)} of {study.port}")
    if options.dry_run:
        for point in study.points:
            print(f"{point.name}: {' '.join(point.settings)}")
        return 0
    try:
        folder.mkdir(parents=True, exist_ok=True)
        store, contents = Store(folder), Contents()
    except OSError as error:
        raise Error(UNGATED, f"error: the folder '{folder}' for the results cannot be made: {error.strerror}\n"
                             "  help:     --folder says where they go") from error
    executor = executor_of(options, folder, say, stop)
    try:
        rows, restless, more = measure_scenes(study, options, folder, store, contents, host, executor, say, stop)
    finally:
        executor.close()
    # They build on this module, and import it.
    from . import cost_model, domination, leave_one_out, study_chart
    from . import report as page

    chart = study_chart.draw(study, rows, folder)
    print_summary(study, rows, restless)
    domination.print_list(more["dominated"], study.metrics[0])
    leave_one_out.print_table(more["leave_one_out"])
    cost_model.print_models(more["cost_models"])
    for name in ("results.csv", "results.json"):
        say(f"wrote {folder / name}")
    over = study_chart.draw_over_scenes(study, rows, folder)
    if over:
        say(f"wrote {over}")
    if chart or not over:
        say(f"wrote {chart}" if chart else study_chart.why_none(study, rows))
    say(f"wrote {page.write(folder)}")
    return gate(rows) if options.gate else (0 if all(row["state"] == "ok" for row in rows) else 4)


def executor_of(options: argparse.Namespace, folder: pathlib.Path, say: Callable[[str], None],
                stop: Callable[[], None]) -> Here:
    """Who does the work: this process, or a cluster."""
    if options.cluster is None:
        return Here(options.device, options.timeout, folder, say, stop)
    from .study_cluster import Cluster

    return Cluster(options.cluster, options.device, options.timeout, say, stop)


def measure_scenes(study: Study, options: argparse.Namespace, folder: pathlib.Path, store: Store, contents: Contents, host: Host,
                   executor: Here, say: Callable[[str], None], stop: Callable[[], None]
                   ) -> tuple[list[dict], dict[str, list[str]], dict[str, list[dict]]]:
    """All rows, what speaks against the machine by scene, and measure_more(). The tables are written after each scene."""
    from . import leave_one_out

    more: dict[str, list[dict]] = {}
    made: list[dict] = []
    rows: list[dict] = []
    restless: dict[str, list[str]] = {}
    begun = time.monotonic()
    for number, scene in enumerate(study.scenes):
        run = SceneRun(study, scene, store, options, folder, host, executor, contents, say, stop,
                       begun + 60 * study.budget_minutes)
        spent = Spent(executor.used)
        with spent.on("files"):
            run.identify()
        with spent.on("warm-up"):
            run.warm_up()
        rest = run.estimate_seconds() * (len(study.scenes) - number)  # other scenes take as long, for all that is known
        say(f"{scene.name}: about {duration(rest)} to go from here, and the reference; {study.budget_minutes:g} min at most")
        run.check_budget(rest)
        with spent.on("errors"):
            run.measure_errors()
        with contextlib.ExitStack() as alone:
            with spent.on("waiting"):
                alone.enter_context(executor.timing())
            with spent.on("rounds"):
                run.measure_times()
            with spent.on("passes"):
                run.measure_passes()
            with spent.on("beside the table"):
                found = measure_more(run)
        own_rows, restless[scene.name] = rows_of(run)
        rows += own_rows + leave_one_out.table_rows(study.name, found["leave_one_out"])
        mark_front(rows, study.metrics[0])
        mark_dominated(rows, found["dominated"], study.metrics[0])
        say(f"{scene.name}: done in {spent.said()}")
        for key, each in (found | {"spent": spent.rows(scene.name)}).items():
            more.setdefault(key, []).extend(each)
        made.append(made_by(run))
        machines = executor.machines()
        used = {row["machine"] for row in rows if row.get("machine")}
        report = {"study": dataclasses.asdict(study), "heddle": version(), "machine": executor.place()["machine"],
                  "machines": {each["id"]: each for each in machines if each["id"] in used},
                  "restless": restless, "false_verdicts": s.FALSE_VERDICTS, "power": s.POWER,
                  "command": command_line(), "made_by": made, "files": contents.known()} | more
        write_table(folder, finite(rows), report)
    return rows, restless, more


def measure_more(run: SceneRun) -> dict[str, list[dict]]:
    """What results.json has beside its rows, each key with a list that the study's scenes add to."""
    from . import cost_model, domination, leave_one_out

    return {"leave_one_out": leave_one_out.measure(run), "cost_models": cost_model.measure(run),
            "dominated": domination.measure(run)}


def more_seconds(run: SceneRun) -> float:
    """What measure_more() will take."""
    from . import cost_model, leave_one_out

    return leave_one_out.estimate_seconds(run) + cost_model.estimate_seconds(run)


def gate(rows: list[dict]) -> int:
    """0, 1 "worse" or lost, 2 "undecided". Processors' time is not asked: nobody waits for it."""
    verdicts = {row.get("verdict") for row in rows if row.get("quantity") != "processor"}
    if s.WORSE in verdicts or any(row["state"] != "ok" for row in rows):
        return 1
    return 2 if s.UNDECIDED in verdicts else 0
