# SPDX-License-Identifier: Apache-2.0
"""What every technique makes, kept per machine and driver, so that a change that nobody meant shows as a difference.

Of each technique: its error against the role's reference, the bytes of its image, counters of work and memory of a frame,
in a small picture of a shipped scene through a shipped graph. Bytes repeat on one driver, so errors are compared exactly
unless --tolerance says otherwise, and counters always exactly. What differs between two frames of one run is named as
unsteady and not compared.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import hashlib
import json
import math
import pathlib
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from . import Error, Host, compare, version
from . import study as definition
from .__main__ import load_scene, write_file
from .study_items import Lost, Worker, machine
from .tune import most_accurate

EXTENT = (64, 36)  # enough for every pass's edges, tiles and maps; a picture costs milliseconds
SETTLE = 3  # frames, the first after a cut, for techniques with a past
FUNCTION_IMAGE = "function_image"  # the role whose techniques are called as the roles that they show
METRICS = ("rmse", "mean_difference", "maximum")
# The first in which a pass runs counts; others follow in the order of their names.
FIRST_SCENE = "cornell_box.py"
SCENE_ORDER = ("subdivision.py", "material_grid.py", "wires_and_grass.py", "street.py", "atrium.py")


# ---- What is measured ----

def graphs_with(host: Host) -> dict[str, list[tuple[str, str]]]:
    """{role: (shipped graph, pass of it)}, of graphs of frames."""
    found: dict[str, list[tuple[str, str]]] = {}
    for graph, each in definition.shipped_passes(host, [extent()]):
        found.setdefault(each["role"], []).append((graph, each["name"]))
    return found


def scenes() -> list[str]:
    folder = pathlib.Path(__file__).resolve().parents[1] / "scenes"
    there = sorted(each.name for each in folder.glob("*.py"))
    return [each for each in dict.fromkeys((FIRST_SCENE, *SCENE_ORDER, *there)) if each in there]


def extent() -> str:
    return definition.extent_setting(EXTENT)


class Gauge:
    """Measures techniques, each in a process of its own, so that counters are those of one graph and a crash is one's own."""

    def __init__(self, host: Host, options: argparse.Namespace, log: pathlib.Path, stop: Callable[[], None]):
        listed = host.list()
        self.roles = {each["name"]: each for each in listed["roles"]}
        self.techniques = {f"{each['role']}/{each['name']}": each for each in listed["techniques"]}
        self.graphs = graphs_with(host)
        self.scenes = scenes()
        self.host, self.options, self.log, self.stop = host, options, log, stop
        self._features: dict[str, set[str]] = {}
        self.device: dict[str, Any] = {}
        self._references: dict[tuple, np.ndarray | None] = {}

    def measure(self, name: str) -> dict[str, Any]:
        """What a technique makes, or {"not_measured": why}. raises: Lost if its process ends"""
        technique = self.techniques[name]
        # No shipped graph shows what a function answers: a pass is added to one that has the function, as studies do it.
        role = technique["name"] if technique["role"] == FUNCTION_IMAGE else technique["role"]
        passes = self.graphs.get(role, [])
        if not passes:
            return {"not_measured": f"no shipped graph of frames has a pass of role '{role}'"}
        refusals = []
        for scene in self.scenes:
            if missing := sorted(set(technique["features"]) - self.features(scene)):
                refusals.append(f"{scene} has no {', '.join(missing)}")
                continue
            for graph, pass_name in passes:
                found = self.measure_in(technique, graph, pass_name, scene)
                if isinstance(found, dict):
                    return found
                refusals.append(f"{graph}, {scene}: {found}")
                if found.startswith("refused: "):  # by whatever scene
                    passes = [each for each in passes if each != (graph, pass_name)]
        return {"not_measured": refusals[0]}

    def features(self, scene: str) -> set[str]:
        if scene not in self._features:
            with self.host.scene() as loaded:
                load_scene(loaded, scene)
                self._features[scene] = set(loaded.describe()["features"])
        return self._features[scene]

    def measure_in(self, technique: Mapping[str, Any], graph: str, pass_name: str, scene: str) -> dict[str, Any] | str:
        """A measurement, or why the pass does not run there."""
        settings = [extent()]
        if technique["role"] != FUNCTION_IMAGE:
            settings.append(f"{pass_name}.technique={technique['name']}")
        if definition.needs_artifact(technique):
            self.run_jobs(graph, scene, settings)
        with self.worker(scene) as worker:
            try:
                port, why = self.port_of(worker, technique, graph, pass_name, settings)
            except Lost as lost:
                if lost.state == "failed":
                    return "refused: " + str(lost).splitlines()[0].rpartition("error: ")[2]
                raise
            if port is None:
                return why
            image = self.image(worker, port)
            first = worker.ask("profile", point="it", frames=0)
            again = worker.ask("profile", point="it", frames=0)
            self.device = first["device"]
            is_steady = np.array_equal(image, self.image(worker, port), equal_nan=True)
        numbers, unsteady = steady(flat(numbers_of(first)), flat(numbers_of(again)))
        errors, against = self.errors(technique, graph, pass_name, scene, port, image)
        return {"technique": f"{technique['role']}/{technique['name']}", "graph": graph, "scene": scene, "settings": settings,
                "port": port, "against": against, "errors": errors if is_steady else {},
                "image": hashlib.sha256(image.tobytes()).hexdigest() if is_steady else "", "numbers": numbers,
                "unsteady": unsteady + ([] if is_steady else ["image"])}

    def run_jobs(self, graph: str, scene: str, settings: Sequence[str]) -> None:
        """So that the process which is measured finds what jobs leave: else its counters were those of the jobs too, or not,
        by what another run left behind."""
        with self.worker(scene) as worker, contextlib.suppress(Lost):  # what is wrong with it is told by who measures it
            worker.ask("load", point="it", graph=graph, settings=list(settings), keep=None)
            worker.ask("render", point="it", frames=1)

    def port_of(self, worker: Open, technique: Mapping[str, Any], graph: str, pass_name: str,
                settings: Sequence[str]) -> tuple[str | None, str]:
        """(image that shows what the pass does, with the graph loaded that makes it; why there is none)."""
        if technique["role"] == FUNCTION_IMAGE:
            adds = definition.with_function_image(self.host, graph, settings, technique["name"], pass_name)
            worker.ask("load", point="it", graph=graph, settings=list(settings), keep=definition.FUNCTION_PORT, adds=adds)
            return definition.FUNCTION_PORT, ""
        measure = self.roles[technique["role"]].get("measure") or {}
        named = f"{pass_name}.{measure['port']}" if measure.get("kind") == "image" and measure.get("port") else None
        worker.ask("load", point="it", graph=graph, settings=list(settings), keep=named)
        passes = worker.ask("passes", point="it")
        own = next((each for each in passes["passes"] if each["name"] == pass_name), None)
        if own is not None and not own["is_pruned"]:
            return named or passes["output"], ""
        if named is None and (images := worker.ask("ports", point="it", of=pass_name)["images"]):
            # Nobody asks for it in this graph: what it makes itself, then.
            worker.ask("load", point="it", graph=graph, settings=list(settings), keep=images[0])
            passes = worker.ask("passes", point="it")
            own = next(each for each in passes["passes"] if each["name"] == pass_name)
            if not own["is_pruned"]:
                return images[0], ""
        return None, own["reason"] if own is not None else "left out"

    def image(self, worker: Open, port: str) -> np.ndarray:
        worker.ask("render", point="it", frames=SETTLE, cut=True)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "image.npy"
            worker.ask("read", point="it", port=port, file=str(file))
            return np.load(file)

    def errors(self, technique: Mapping[str, Any], graph: str, pass_name: str, scene: str, port: str,
               image: np.ndarray) -> tuple[dict[str, Any], str]:
        """({metric: error}, against what), against the reference of the role that is there."""
        references = self.roles[technique["role"]].get("references") or {}
        stated = [each["technique"] if "/" in each["technique"] else f"{technique['role']}/{each['technique']}"
                  for each in (references.get("same_model"), references.get("physical")) if each]
        name = next((each for each in stated if each in self.techniques), None)
        if name is None:
            return {}, "the role's reference is no technique that is there" if stated else "the role names no reference"
        key = (name, graph, pass_name, scene, port)
        if key not in self._references:
            self._references[key] = self.reference(*key)
        reference = self._references[key]
        if reference is None:
            return {}, f"{name} cannot be rendered there"
        try:
            found = compare(image, reference, METRICS)
        except Error as error:
            return {}, f"{name}: {str(error).splitlines()[0].removeprefix('error: ')}"
        return {metric: each["value"] for metric, each in found.items()}, name

    def reference(self, name: str, graph: str, pass_name: str, scene: str, port: str) -> np.ndarray | None:
        settings = [extent(), *most_accurate(pass_name, self.techniques[name], True)]
        with self.worker(scene) as worker:
            try:
                worker.ask("load", point="it", graph=graph, settings=settings, keep=port)
                return self.image(worker, port)
            except Lost as lost:
                if lost.state != "failed":
                    raise
                return None

    def worker(self, scene: str) -> Open:
        return Open(Worker(self.log, self.options.timeout, self.stop), scene, self.options.device)


class Open:
    """A worker with a scene, for as long as a block."""

    def __init__(self, worker: Worker, scene: str, device: str | None):
        self.worker, self.scene, self.device = worker, scene, device

    def __enter__(self) -> Open:
        try:
            self.ask("open", scene={"file": self.scene, "camera": None, "time": 0.0, "overlays": [], "arguments": []}, device=self.device)
        except BaseException:
            self.worker.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.worker.close()

    def ask(self, do: str, **arguments: Any) -> dict:
        return self.worker.ask(do, **arguments)


def numbers_of(profile: Mapping[str, Any]) -> dict[str, Any]:
    # What the system gives a process differs from one to the next.
    memory = {key: value for key, value in profile["memory"].items() if not key.startswith("process_")}
    return {"counters": profile["counters"], "memory": memory, "counts": profile["counts"],
            "instances": profile["instances"]}


def flat(values: Any, name: str = "") -> dict[str, Any]:
    """{dotted name: number or text}, without times."""
    if isinstance(values, Mapping):
        return {key: value for own, each in values.items() for key, value in flat(each, f"{name}.{own}" if name else own).items()}
    if isinstance(values, list):
        # Rows of a pass are told apart by its name and theirs, as order may change.
        named = {f"{each.get('pass', '')} {each.get('name', '')}".strip() or str(i): each.get("count", each)
                 for i, each in enumerate(values) if isinstance(each, Mapping)}
        return flat(named, name)
    return {} if name.endswith("_ms") else {name: values}


def steady(first: Mapping[str, Any], again: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """({what is the same in both}, names of what is not)."""
    return ({key: value for key, value in first.items() if key in again and again[key] == value},
            sorted(key for key in {*first, *again} if first.get(key) != again.get(key)))


# ---- What has changed ----

def changes(before: Mapping[str, Any], now: Mapping[str, Any], tolerance: float) -> list[str]:
    """In words, a line each; empty: nothing. tolerance: of errors, relative to the earlier one; above 0 bytes may differ too"""
    said = []
    for key in ("not_measured", "graph", "scene", "settings", "port", "against"):
        if before.get(key) != now.get(key):
            said.append(f"{key}: {before.get(key, 'none')} -> {now.get(key, 'none')}")
    for key in dict.fromkeys([*before.get("errors", {}), *now.get("errors", {})]):
        a, b = before.get("errors", {}).get(key), now.get("errors", {}).get(key)
        if not (a == b or (a is not None and b is not None and abs(b - a) <= tolerance * abs(a))):
            said.append(f"error {key}: {number(a)} -> {number(b)}{percent(a, b)}")
    if before.get("image") != now.get("image") and tolerance == 0.0:
        said.append(f"bytes of {now.get('port')}: " + ("differ" if before.get("image") and now.get("image") else
                    "steady before, not now" if before.get("image") else "not steady before, now they are"))
    # Of what is unsteady on either side nothing is known.
    unsteady = {*before.get("unsteady", []), *now.get("unsteady", [])}
    a, b = before.get("numbers", {}), now.get("numbers", {})
    for key in dict.fromkeys([*a, *b]):
        if key not in unsteady and a.get(key) != b.get(key):
            said.append(f"{key}: {number(a.get(key))} -> {number(b.get(key))}{percent(a.get(key), b.get(key))}")
    return said


def number(value: Any) -> str:
    return "none" if value is None else repr(value)


def percent(a: Any, b: Any) -> str:
    if not all(isinstance(each, (int, float)) and math.isfinite(each) for each in (a, b)) or not a:
        return ""
    return f" ({100 * (b - a) / abs(a):+.3g} %)"


def fingerprint(device: Mapping[str, Any]) -> dict[str, Any]:
    """What bytes and counters may depend on beside Heddle."""
    return {"device": device["name"], "driver": device["driver"], "driver_version": device["driver_version"],
            "processor": machine()["processor"]}


def folder_name(found: Mapping[str, Any]) -> str:
    words = definition.slug(f"{found['driver']} {found['driver_version']} {found['processor']}")
    while "__" in words:
        words = words.replace("__", "_")
    return f"{words.strip('_')[:80]}_{hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:8]}"


# ---- The command ----

def wanted(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """Techniques, ROLE/TECHNIQUE, of ROLE or ROLE/TECHNIQUE. raises: Error"""
    if not names:
        return sorted(known)
    found: list[str] = []
    for name in names:
        own = [each for each in known if each == name or each.startswith(f"{name}/")]
        if not own:
            near = difflib.get_close_matches(name, [*known, *{each.split("/")[0] for each in known}], 1)
            raise Error(2, f"error: there is no role or technique '{name}'\n  expected: ROLE or ROLE/TECHNIQUE, see heddle list"
                           + (f"\n  help:     did you mean '{near[0]}'?" if near else ""))
        found += own
    return sorted(dict.fromkeys(found))


def default_folder() -> pathlib.Path:
    tests = pathlib.Path(__file__).resolve().parents[2] / "tests"
    return tests / "baselines" if (tests / "python").is_dir() else pathlib.Path("baselines")


def baseline(arguments: argparse.Namespace, stop: Callable[[], None]) -> int:
    """Answers 0; 1 if `check` found a difference; 4 if a technique's process was lost. raises: Error"""
    def say(text: str) -> None:
        if not arguments.quiet:
            print(text, file=sys.stderr, flush=True)

    if not 0.0 <= arguments.tolerance < math.inf:
        raise Error(2, f"error: --tolerance {arguments.tolerance}\n  expected: a finite number, 0 or above")
    top = pathlib.Path(arguments.folder) if arguments.folder else default_folder()
    status, folder, count, differing = 0, None, 0, 0
    with tempfile.TemporaryDirectory() as scratch, Host(arguments.device, log=lambda *_: None) as host:
        gauge = Gauge(host, arguments, pathlib.Path(scratch) / "workers.log", stop)
        names = wanted(arguments.files, list(gauge.techniques))
        waiting: list[tuple[str, dict[str, Any]]] = []
        for name in names:
            stop()
            say(f"{name}")
            try:
                now = gauge.measure(name)
            except Lost as lost:
                print(f"{name}: {lost.state}: {lost}")
                status = 4
                continue
            if folder is None and gauge.device:
                folder = top / folder_name(fingerprint(gauge.device))
                if arguments.action == "check":
                    check_folder(folder, top)
            waiting.append((name, now))
            if folder is None:  # nothing was rendered yet, so nobody knows on what
                say(f"{name}: {now['not_measured']}")
                continue
            for each, made in waiting:
                count += 1
                said = record(folder, each, made) if arguments.action == "record" else check(folder, each, made, arguments.tolerance)
                differing += bool(said)
                for line in said:
                    print(f"{each}: {line}")
            waiting.clear()
        if folder is None:
            raise Error(4, "error: nothing could be rendered, so there is nothing to keep or to compare")
        if arguments.action == "record":
            write_file(str(folder / "machine.json"), json.dumps(fingerprint(gauge.device) | {"heddle": version()}, indent=1) + "\n")
            print(f"recorded {count} techniques in {folder}, {differing} of them new or changed")
            return status
        if not arguments.files:
            for file in sorted(folder.glob("*/*.json")):
                if (gone := f"{file.parent.name}/{file.stem}") not in gauge.techniques:
                    print(f"{gone}: it was there, and is no more")
                    differing += 1
        print(f"checked {count} techniques against {folder}, {differing} differ")
    return status or int(differing > 0)


def check_folder(folder: pathlib.Path, top: pathlib.Path) -> None:
    if not folder.is_dir():
        known = ", ".join(sorted(each.parent.name for each in top.glob("*/machine.json"))) or "none"
        raise Error(2, f"error: there is no baseline of this machine and driver in '{top}'\n  found:    {known}\n  expected: "
                       f"{folder.name}\n  help:     heddle baseline record, before the change")


def record(folder: pathlib.Path, name: str, now: Mapping[str, Any]) -> list[str]:
    file = folder / f"{name}.json"
    before = read(file)
    write_file(str(file), json.dumps(now, indent=1) + "\n")
    return ["new"] if before is None else changes(before, now, 0.0)


def check(folder: pathlib.Path, name: str, now: Mapping[str, Any], tolerance: float) -> list[str]:
    before = read(folder / f"{name}.json")
    if before is None:
        return ["not in the baseline (heddle baseline record)"]
    return changes(before, now, tolerance)


def read(file: pathlib.Path) -> dict[str, Any] | None:
    """raises: Error, if the file is there and is none"""
    try:
        return json.loads(file.read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise Error(2, f"{file}: error: this is no baseline: {error}\n  help:     heddle baseline record makes it anew") from error
