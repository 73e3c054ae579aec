# SPDX-License-Identifier: Apache-2.0
"""What a study keeps beside its numbers, for its report and for who makes a row of it again: an image of each point and of the
reference, how each frame was planned, and what all of it was made of."""

from __future__ import annotations

import dataclasses
import pathlib
import shlex
import sys
from typing import TYPE_CHECKING

import numpy as np

from . import statistics as s
from . import study_images as images
from .study import Point
from .study_items import REFERENCE, Lost, digest

if TYPE_CHECKING:
    from .study_run import SceneRun


class Record:
    """Of one scene of a study."""

    def __init__(self) -> None:
        self.kept: dict[str, str] = {}  # keys of images.load(): the first seed of points, and REFERENCE
        self.explained: dict[str, str] = {}  # keys of the study's store

    def keep_reference(self, run: SceneRun, whole: np.ndarray) -> None:
        self.kept[REFERENCE] = digest("kept", images.fingerprint(whole))
        if images.head_of(run.folder, self.kept[REFERENCE]) is None:
            images.keep(run.folder, self.kept[REFERENCE], whole)

    def keep_image(self, run: SceneRun, point: Point, machine: str, image: np.ndarray) -> None:
        """Of the first seed, as that machine renders it."""
        key = self.kept[point.name] = self._key(run, point, machine)
        if images.head_of(run.folder, key) is None:
            images.keep(run.folder, key, image)

    def find_images(self, run: SceneRun) -> None:
        """Of points whose errors were there already. What is not there, because a study of before kept none, is rendered."""
        missing = []
        for point in run.alive():
            if point.name not in self.kept and point.name in run.errors:
                key = self._key(run, point, run.errors[point.name]["machine"])
                if images.head_of(run.folder, key) is not None:
                    self.kept[point.name] = key
                else:
                    missing.append(point)
        items = [run.item("part", point=run.told(run.image_of(point.name), point.variant), seed=0) for point in missing]
        for number, answer in run.executor.run(items):
            if answer.lost is not None:
                run.lose(missing[number].name, answer.lost)
            else:
                self.keep_image(run, missing[number], answer.machine, answer.value["image"])

    def explain(self, run: SceneRun) -> None:
        """How each point's own frame was planned, on the machine that times."""
        from .study_run import Moved

        for point in run.alive():
            while point.name not in self.explained and run.state[point.name][0] == "ok":
                key = digest("explain", run.keys[point.name], run.executor.place()["id"])
                if run.store.get(key) is None:
                    try:
                        answer = run.executor.at_place(run.item("ask", point=run.told(point.name, point.variant),
                                                                request="explain", arguments={}))
                    except Moved:
                        continue
                    if answer.lost is not None:
                        run.lose(point.name, answer.lost)
                        continue
                    run.store.put(key, answer.value["explain"])
                self.explained[point.name] = key

    def _key(self, run: SceneRun, point: Point, machine: str) -> str:
        return digest("kept", run.keys[run.image_of(point.name)], machine)

    def made_by(self, run: SceneRun) -> dict:
        """What made a scene's numbers: enough to make any of them again, and to show its image and its frame. Plain data."""
        reference = run.study.reference
        values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
        files: dict[str, str] = {}
        for each in run.graphs.values():
            files |= each["expected"]
        try:
            devices = run.executor.place()["devices"]
        except Lost:
            devices = []
        return {
            "scene": run.scene.name, "choice": dataclasses.asdict(run.scene) | {
                "file": absolute(run.scene.file), "overlays": [absolute(each) for each in run.scene.overlays]}, "devices": devices, "device": run.options.device,
            "reference": None if reference is None else {
                "graph": absolute(reference.graph) if reference.graph else "", "settings": list(reference.settings),
                "parts": reference.parts, "files": list(reference.files), "image": self.kept.get(REFERENCE)},
            "points": [{
                "name": point.name, "variant": point.variant, "knobs": [list(each) for each in point.knobs],
                "graph": absolute(point.graph), "settings": list(point.settings), "image": self.kept.get(point.name),
                "explained": self.explained.get(point.name),
                "device": run.measured.get(point.name, {}).get("device"),
            } for point in run.study.points],
            # Of each round the mean logarithm of milliseconds; the first point takes part twice.
            "rounds": [{name: round(value, 7) for name, value in each.items()} for each in values],
            "contents": files,
        }


def absolute(file: str) -> str:
    """A file's whole path; what comes with Heddle goes by its name."""
    path = pathlib.Path(file)
    return str(path.resolve()) if path.exists() else file


def command_line() -> str:
    """What was typed, as near as Python knows."""
    return shlex.join(["heddle", *sys.argv[1:]] if sys.argv[1:2] == ["study"] else ["heddle", "study"])
