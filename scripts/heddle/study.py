# SPDX-License-Identifier: Apache-2.0
"""Study files: TOML -> what is to be measured, with every mistake found, at its line, before anything is rendered."""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import json
import pathlib
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from . import Error, Host, metrics
from .__main__ import load_scene, scene_path


@dataclasses.dataclass(frozen=True)
class SceneChoice:
    """A scene, a camera of it and a time: what all variants render."""

    file: str
    camera: str | None
    time: float
    overlays: tuple[str, ...]
    where: str = ""  # its file:line:column in the study
    arguments: tuple[tuple[str, Any], ...] = ()  # of a Python scene's build()

    @property
    def name(self) -> str:
        words = [pathlib.Path(self.file).stem, *[f"{key}={value}" for key, value in self.arguments],
                 *[pathlib.Path(o).stem for o in self.overlays]]
        words += [self.camera] if self.camera is not None else []
        return " ".join(words + ([f"{self.time:g} s"] if self.time else []))


@dataclasses.dataclass(frozen=True)
class Point:
    """A variant at one setting of its knobs."""

    variant: str
    graph: str
    settings: tuple[str, ...]  # all of them, as for Host.graph
    knobs: tuple[tuple[str, Any], ...]  # what tells it from the variant's other points, cheapest first

    @property
    def name(self) -> str:
        return " ".join([self.variant, *[f"{knob}={value}" for knob, value in self.knobs]])


@dataclasses.dataclass(frozen=True)
class Reference:
    graph: str
    settings: tuple[str, ...]
    parts: int  # independent renderings, by their seeds
    files: tuple[str, ...] = ()  # images of the scenes instead of renderings
    port: str | None = None  # that is compared with the study's; None: the same
    adds: str | None = None  # passes that the graph does not have, as TOML


@dataclasses.dataclass(frozen=True)
class Study:
    name: str
    title: str
    port: str
    pass_name: str | None  # whose time is told beside the frame's
    scenes: tuple[SceneChoice, ...]
    points: tuple[Point, ...]  # the first is what the others are compared with
    reference: Reference | None
    metrics: tuple[str, ...]
    rounds: int
    frames: int  # timed in a turn
    settle: int  # frames before an image is read, for techniques with a past
    resolution: float  # the smallest ratio of times that matters, minus 1
    error_resolution: float  # the smallest difference of errors that matters, as a part of the first point's error
    budget_minutes: float
    exposures: tuple[float, float, int] | None
    tone_mapper: str
    seed: int
    function_image: str | None = None  # the technique of that role which makes `port`, in graphs that are not timed
    leave_one_out: tuple[str, ...] = ()  # variants of whose first point each pass is left out in turn
    chart_pass: str | None = None  # whose own time the chart shows beside the frame's; None: pass_name
    extents: tuple[tuple[int, int], ...] = ()  # at which points are timed as well, for the cost model
    unit: str = ""  # of what is compared; empty: unknown
    warnings: tuple[str, ...] = ()  # of what a study may well mean, each with its place


# What a table may hold: the types of its values, in words for errors.
TEXT, NUMBER, WHOLE, TEXTS, NUMBERS, TABLE, TABLES, ANY = (
    "a text", "a finite number", "a whole number", "a list of texts", "a list of finite numbers", "a table", "tables", "anything")
STUDY_KEYS = {
    "title": TEXT, "graph": TEXT, "set": TEXTS, "role": TEXT, "pass": TEXT, "port": TEXT, "metrics": TEXTS, "rounds": WHOLE,
    "frames": WHOLE, "settle": WHOLE, "resolution": NUMBER, "error_resolution": NUMBER, "budget_minutes": NUMBER,
    "exposures": NUMBERS, "tone_mapper": TEXT, "seed": WHOLE, "scene": TABLES, "variant": TABLES, "reference": ANY,
    "leave_one_out": TEXTS, "extents": ANY, "chart_pass": TEXT,
}
SCENE_KEYS = {"file": TEXT, "camera": TEXT, "cameras": TEXTS, "time": NUMBER, "times": NUMBERS, "overlays": TEXTS,
              "arguments": TABLE}
VARIANT_KEYS = {"name": TEXT, "technique": TEXT, "graph": TEXT, "set": TEXTS, "knobs": ANY, "climb": TEXT}
DEFAULT_GRAPH = "deferred"
CLIMBS = ("together", "each")  # how a variant's ladders are: the i-th values of all, or one with the others as they stand
FUNCTION_PORT = "measured_function.image"  # of the pass that a study adds where a role's technique makes no image itself
REFERENCE_KEYS = {"truth": TEXT, "technique": TEXT, "graph": TEXT, "set": TEXTS, "parts": WHOLE, "file": TEXT}


TRUTHS = ("same_model", "physical")  # of a role's contract: its `references`
PHYSICAL = "physical"  # the pass that a study adds where the truth is a technique of another role


class Places:
    """Where keys stand in a TOML text: tomllib keeps no positions. Paths are ("variant", 1, "set"), ("reference", "parts")."""

    def __init__(self, file: str, text: str):
        self.file = file
        self._places: dict[tuple, tuple[int, int]] = {}
        self._instead: dict[str, str] = {}
        table: tuple = ()
        counts: dict[str, int] = {}
        for number, line in enumerate(text.splitlines(), 1):
            if header := re.match(r"\s*(\[\[?)\s*([\w.\-\"]+)\s*\]", line):
                name = header[2].strip('"')
                if header[1] == "[[":
                    counts[name] = counts.get(name, -1) + 1
                    table = (name, counts[name])
                else:
                    table = tuple(name.split("."))
                self._places[table] = (number, header.start(2) + 1)
            elif key := re.match(r"\s*\"?([\w\-]+)\"?(?:\.[\w\-.]+)?\s*=", line):
                self._places.setdefault((*table, key[1]), (number, key.start(1) + 1))

    def without(self, name: str, instead: str) -> Places:
        """The same, where the tables of a name were given otherwise: on the command line, for instance."""
        found = Places(self.file, "")
        found._places = {path: place for path, place in self._places.items() if path[0] != name}
        found._instead = self._instead | {name: instead}
        return found

    def where(self, path: tuple) -> str:
        """file:line:column of a path, or of what it stands in."""
        if path and path[0] in self._instead:
            return self._instead[path[0]]
        place = next((self._places[path[:n]] for n in range(len(path), 0, -1) if path[:n] in self._places), None)
        return f"{self.file}:{place[0]}:{place[1]}" if place else self.file

    def error(self, path: tuple, message: str, found: str = "", expected: str = "", help: str = "", level: str = "error") -> str:
        lines = [f"{self.where(path)}: {level}: {message}"]
        lines += [f"  {name + ':':<9} {text}" for name, text in (("found", found), ("expected", expected), ("help", help)) if text]
        return "\n".join(lines)


class Reader:
    """Collects mistakes, so that all of them are said at once."""

    def __init__(self, host: Host, places: Places, folder: pathlib.Path):
        self.host, self.places, self.folder = host, places, folder
        self.errors: list[str] = []
        self.warnings: list[str] = []
        self.parameters: dict[str, dict[str, tuple[tuple, Any]]] = {}  # of the studied pass at each point: (place, value)
        self.is_pass_known = True  # else that was said, and is not said again of each variant
        self._cameras: dict[tuple, list[str] | None] = {}
        self.extent: tuple[str, list[int]] | None = None  # of the first variant, and its name
        listed = host.list()
        self.roles = {role["name"]: role for role in listed["roles"]}
        self.techniques = {(each["role"], each["name"]): each for each in listed["techniques"]}

    def fail(self, path: tuple, message: str, **rest: str) -> None:
        self.errors.append(self.places.error(path, message, **rest))

    def warn(self, path: tuple, message: str, **rest: str) -> None:
        self.warnings.append(self.places.error(path, message, level="warning", **rest))

    def unknown(self, path: tuple, what: str, name: str, names: Iterable[str]) -> None:
        names = list(names)
        near = difflib.get_close_matches(name, names, 1)
        self.fail(path, f"there is no {what} '{name}'", expected=f"one of {', '.join(names)}",
                  help=f"did you mean '{near[0]}'?" if near else "")

    def check_table(self, path: tuple, table: Mapping[str, Any], keys: Mapping[str, str]) -> dict[str, Any]:
        """What is known and of the right type."""
        good = {}
        for key, value in table.items():
            if key not in keys:
                self.unknown((*path, key), "key", key, keys)
            elif not is_of(value, keys[key]):
                self.fail((*path, key), f"'{key}' is {keys[key]}", found=f"{key} = {value!r}")
            else:
                good[key] = value
        return good

    def number(self, table: Mapping[str, Any], key: str, default: Any, low: float, high: float) -> Any:
        value = table.get(key, default)
        if not low <= value <= high:
            self.fail((key,), f"'{key}' is out of range", found=f"{value}", expected=f"{low:g} to {high:g}")
            return default
        return value

    def cameras(self, path: tuple, file: str, overlays: tuple[str, ...], arguments: Mapping[str, Any]) -> list[str] | None:
        """Of a scene, which must be loaded for that; None and a mistake at `path` if it cannot be."""
        key = (file, *overlays, *arguments.items())
        if key not in self._cameras:
            self._cameras[key] = None
            try:
                with self.host.scene() as scene:
                    load_scene(scene, file, arguments=arguments)
                    for overlay in overlays:
                        scene.load(overlay)
                    self._cameras[key] = scene.describe().get("cameras", [])
            except Error as error:
                self.fail(path, "the scene cannot be loaded:\n    " + str(error).replace("\n", "\n    "))
        return self._cameras[key]

    def file(self, name: str) -> str:
        """A path from the study's folder if it is there, else as it is: the name of a shipped graph or scene."""
        beside = self.folder / name
        return str(beside) if beside.exists() else name


def is_of(value: Any, kind: str) -> bool:
    return {
        TEXT: isinstance(value, str), NUMBER: is_number(value), WHOLE: is_number(value) and isinstance(value, int),
        TEXTS: isinstance(value, list) and all(isinstance(each, str) for each in value),
        NUMBERS: isinstance(value, list) and all(map(is_number, value)),
        TABLE: isinstance(value, dict), TABLES: isinstance(value, list) and all(isinstance(each, dict) for each in value),
        ANY: True,
    }[kind]


def is_number(value: Any) -> bool:
    """Of TOML, whose numbers may be nan, inf, and whole ones beyond all floats."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -1e300 < value < 1e300


def read(host: Host, file: str, scenes: Iterable[str] = ()) -> Study:
    """A study of a file, on other scenes than its own if there are some. raises: Error with all mistakes, each at its line"""
    path = pathlib.Path(file)
    shipped = pathlib.Path(__file__).resolve().parents[1] / "studies" / (path.name if path.suffix else f"{path.name}.toml")
    if not path.exists() and shipped.exists():
        path = shipped
    try:
        text = path.read_text()
    except FileNotFoundError as error:
        known = sorted(each.stem for each in shipped.parent.glob("*.toml"))
        near = difflib.get_close_matches(path.stem, known, 1)
        raise Error(2, f"error: there is neither a file nor a shipped study '{file}'\n  expected: a study file, or one of "
                       f"{', '.join(known)}" + (f"\n  help:     did you mean '{near[0]}'?" if near else "")) from error
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise Error(2, f"error: the study '{file}' cannot be read: {why}") from error
    try:
        written = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        where = f"{path}:{place[1]}:{place[2]}" if place else str(path)
        raise Error(2, f"{where}: error: this is no TOML: {re.sub(r' *[(]at .*', '', str(error))}") from error
    places = Places(str(path), text)
    if given := list(scenes):
        written["scene"] = [{"file": str(pathlib.Path(each).resolve()) if pathlib.Path(each).exists() else each} for each in given]
        places = places.without("scene", "--scene")
    return understand(host, written, places, path.stem, path.parent)


def of_role(host: Host, role: str, scenes: list[str], settings: list[str], climb: str = "together",
            graph: str | None = None, reference: str | None = None) -> Study:
    """A study of all techniques of a role, over all their knobs, that nobody wrote: in a graph, or in the first shipped one
    that has a pass of the role. Those that need the artifact of a job, which only a graph can name, are left out, and the
    title says so; where the role makes no image, the graph's output is compared, and the title says that.
    raises: Error, also where no shipped graph has such a pass"""
    reader = Reader(host, Places("--role", ""), pathlib.Path())
    if role not in reader.roles:
        reader.unknown(("role",), "role", role, reader.roles)
        raise Error(2, "\n".join(reader.errors))
    every = sorted(name for of, name in reader.techniques if of == role)
    names = [name for name in every if not needs_artifact(reader.techniques[role, name])]
    left = [name for name in every if name not in names]
    without = f" without {', '.join(left)}, which a graph must give a job's artifact" if left else ""
    graph = graph or next((name for name, each in shipped_passes(host) if each["role"] == role), None)
    if graph is None:
        raise Error(2, f"--role: error: no shipped graph of frames has a pass of role '{role}'\n  expected: --graph with a graph "
                       "that has one")
    measure = reader.roles[role].get("measure") or {}
    seen: dict[str, str] = {}
    if measure.get("kind") != "image" and (measure.get("kind") != "function_image"
                                           or ("function_image", role) not in reader.techniques):
        with host.graph(graph, settings) as made:
            seen = {"port": made.describe()["output"]}
        without += f", seen in {seen['port']}"
    written = {"title": f"All techniques of {role}{without}", "role": role, "graph": graph, **seen, "set": settings,
               "scene": [{"file": s} for s in scenes],
               **({"reference": reference} if reference is not None else {}),
               "variant": [{"name": name, "technique": name, "knobs": "all", "climb": climb} for name in names]}
    return understand(host, written, Places("--role", ""), role, pathlib.Path())


def shipped_passes(host: Host, settings: Sequence[str] = ()) -> Iterator[tuple[str, dict[str, Any]]]:
    """(shipped graph, pass of it as the graph describes it), of graphs of frames: the default graph's first, the others' in
    the order of their names."""
    folder = pathlib.Path(__file__).resolve().parents[1] / "graphs"
    names = sorted((each.stem for each in folder.glob("*.toml")), key=lambda each: (each != DEFAULT_GRAPH, each))
    for name in names:
        try:
            with host.graph(name, settings) as graph:
                passes = graph.describe()["passes"]
        except Error:  # a job, or a graph that this machine cannot weave: its passes are found elsewhere
            continue
        yield from ((name, each) for each in passes)


def needs_artifact(technique: Mapping[str, Any]) -> bool:
    """Whether it reads what a job left: a graph must name the job."""
    return any(port["type"] == "artifact" and port["direction"] == "in" and "optional" not in port["flags"]
               for port in technique["ports"])


def understand(host: Host, written: dict[str, Any], places: Places, name: str, folder: pathlib.Path) -> Study:
    reader = Reader(host, places, folder)
    table = reader.check_table((), written, STUDY_KEYS)
    graph = reader.file(table.get("graph", DEFAULT_GRAPH))
    settings = tuple(table.get("set", []))
    described = load(reader, ("graph",) if "graph" in table else ("set",), graph, settings)
    passes = {each["name"]: each for each in described.get("passes", [])}
    before = len(reader.errors)
    role, pass_name = choose_pass(reader, table, passes)
    reader.is_pass_known = bool(described) and len(reader.errors) == before
    port, measure_metric = choose_port(reader, table, role, pass_name, described)
    known = [each["name"] for each in metrics() if each["name"] != "percentile_P"]
    wanted = tuple(table.get("metrics", [measure_metric or "rmse"]))
    if not wanted:
        reader.fail(("metrics",), "'metrics' is empty", expected="at least one, the first for the chart")
    for i, metric in enumerate(wanted):
        percentile = re.fullmatch(r"percentile_(\d+(?:\.\d+)?)", metric)
        if percentile and not 0 < float(percentile[1]) <= 100:
            reader.fail(("metrics",), f"'{metric}' is no percentile", expected="a number above 0, at most 100")
        elif not percentile and metric not in known:
            reader.unknown(("metrics",), "metric", metric, known)
        if metric in wanted[:i]:
            reader.fail(("metrics",), f"metric '{metric}' is there twice")
    exposures = None
    if "exposures" in table:
        given = table["exposures"]
        if (len(given) != 3 or not -100 <= given[0] <= given[1] <= 100 or int(given[2]) != given[2]
                or not 1 <= given[2] <= 1000 or (given[2] == 1 and given[0] != given[1])):
            reader.fail(("exposures",), "'exposures' are start, stop and count", found=f"{given}",
                        expected="-100 <= start <= stop <= 100, and 1 to 1000 of them, one only where start is stop: [-4, 4, 5]")
        else:
            exposures = (float(given[0]), float(given[1]), int(given[2]))
    tone_mapper = table.get("tone_mapper", "aces")
    if tone_mapper not in ("aces", "hable", "reinhard"):
        reader.unknown(("tone_mapper",), "tone mapper", tone_mapper, ("aces", "hable", "reinhard"))
    scenes = read_scenes(reader, table.get("scene", []))
    points = read_variants(reader, table.get("variant", []), graph, settings, role, pass_name, port)
    from .study_reference import read_reference  # it builds on this module, and imports it

    reference = read_reference(reader, table.get("reference"), graph, settings, role, pass_name, scenes, port)
    if passes and table.get("chart_pass") not in (None, *passes):
        reader.unknown(("chart_pass",), "pass", table["chart_pass"], passes)
    leave_one_out, extents = read_more(reader, table, points, graph, settings)
    study = Study(
        name, table.get("title", name), port or "", pass_name, scenes, points, reference, wanted,
        rounds=reader.number(table, "rounds", 15, 7, 1000), frames=reader.number(table, "frames", 3, 1, 1000),
        settle=reader.number(table, "settle", 1, 1, 10000), resolution=reader.number(table, "resolution", 0.02, 1e-4, 1),
        error_resolution=reader.number(table, "error_resolution", 0.02, 1e-4, 1),
        budget_minutes=reader.number(table, "budget_minutes", 30, 0, 1e6), exposures=exposures, tone_mapper=tone_mapper,
        seed=reader.number(table, "seed", 0, 0, 2**31), leave_one_out=leave_one_out,
        chart_pass=table.get("chart_pass"), extents=extents,
        function_image=role if port == FUNCTION_PORT else None, unit=unit_of(reader, port, passes),
        warnings=tuple(reader.warnings))
    if reader.errors:
        raise Error(2, "\n".join(reader.errors))
    return study


def read_more(reader: Reader, table: Mapping[str, Any], points: tuple[Point, ...], graph: str,
              settings: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[tuple[int, int], ...]]:
    """(variants whose passes are left out in turn: the first if nothing is said; extents that are timed as well)."""
    variants = list(dict.fromkeys(point.variant for point in points))
    chosen = table.get("leave_one_out", variants[:1])
    for name in chosen:
        if points and name not in variants:
            reader.unknown(("leave_one_out",), "variant", name, variants)
    extents = table.get("extents", [])
    if not isinstance(extents, list) or not all(is_of(each, NUMBERS) and len(each) == 2 and all(
            isinstance(n, int) and 1 <= n <= 16384 for n in each) for each in extents):
        reader.fail(("extents",), "'extents' are pairs of pixels", found=f"extents = {extents!r}",
                    expected="[[160, 90], [640, 360]], 1 to 16384 each")
        extents = []
    for extent in extents if not reader.errors else []:
        load(reader, ("extents",), graph, (*settings, extent_setting(extent)))
    return tuple(dict.fromkeys(chosen)), tuple(dict.fromkeys((each[0], each[1]) for each in extents))


def extent_setting(extent: Iterable[int]) -> str:
    return f"extent=[{','.join(map(str, extent))}]"


def load(reader: Reader, path: tuple, graph: str, settings: Iterable[str]) -> dict[str, Any]:
    """What a graph says with settings; {} and a mistake at `path` if it cannot be."""
    try:
        with reader.host.graph(graph, list(settings)) as made:
            return made.describe()
    except Error as error:
        reader.fail(path, "the graph does not take these settings:\n    " + str(error).replace("\n", "\n    "))
        return {}


def load_function_image(reader: Reader, path: tuple, graph: str, settings: Iterable[str], role: str,
                        pass_name: str | None) -> None:
    """A mistake at `path` if the graph with the pass that makes the image cannot be."""
    try:
        adds = with_function_image(reader.host, graph, settings, role, pass_name)
        reader.host.parse(extended(absolute(graph), adds), f"{graph} with function_image/{role}", "", list(settings)).close()
    except Error as error:
        reader.fail(path, f"no image can be made of what role '{role}' answers there:\n    "
                    + str(error).replace("\n", "\n    "))


def absolute(graph: str) -> str:
    """A file's whole path; what comes with Heddle goes by its name."""
    return str(pathlib.Path(graph).absolute()) if pathlib.Path(graph).is_file() else graph


def choose_pass(reader: Reader, table: Mapping[str, Any], passes: Mapping[str, Any]) -> tuple[str | None, str | None]:
    """(role, pass): either names the other, where there is one."""
    role, name = table.get("role"), table.get("pass")
    if role is not None and role not in reader.roles:
        reader.unknown(("role",), "role", role, reader.roles)
        return None, None
    if name is not None and passes:
        if name not in passes:
            reader.unknown(("pass",), "pass", name, passes)
            return role, None
        return role or passes[name]["role"], name
    if role is None or not passes:
        return role, None
    found = [each["name"] for each in passes.values() if each["role"] == role]
    if role in found:  # of several the one that nobody gave another name
        return role, role
    if len(found) != 1:
        reader.fail(("role",), f"the graph has {len(found)} passes of role '{role}'", found=", ".join(found),
                    expected="'pass' says which" if found else "a graph with such a pass: 'graph' says which")
        return role, None
    return role, found[0]


def choose_port(reader: Reader, table: Mapping[str, Any], role: str | None, pass_name: str | None,
                described: Mapping[str, Any]) -> tuple[str | None, str | None]:
    """(port that is compared, metric of the role's measure)."""
    names = [port["name"] for port in described.get("ports", []) if port["type"] == "image"]
    if "port" in table:
        if names and table["port"] not in names:
            reader.unknown(("port",), "image port", table["port"], names)
        return table["port"], None
    if role is None:
        return described.get("output"), None
    measure = reader.roles[role].get("measure") or {}
    if measure.get("kind") == "function_image" and ("function_image", role) in reader.techniques:
        return FUNCTION_PORT, measure.get("metric") or None
    if measure.get("kind") != "image":
        reader.fail(("role",), f"what role '{role}' makes is no image that could be compared as it is",
                    expected="'port' says which image is compared: display.color, for instance")
        return None, None
    return f"{pass_name}.{measure['port']}" if pass_name else None, measure.get("metric")


def unit_of(reader: Reader, port: str | None, passes: Mapping[str, Any]) -> str:
    """Of a pass's port as its role's contract says; empty where it says nothing."""
    pass_name, _, name = (port or "").partition(".")
    ports = reader.roles.get(passes.get(pass_name, {}).get("role"), {}).get("ports", [])
    return next((each.get("unit") or "" for each in ports if each["name"] == name), "")


def function_pass(technique: str, role: str, asked: str | None) -> str:
    """TOML of a pass that makes an image of what one pass answers, `asked`, or of the neutral body."""
    return (f'[[pass]]\nname = "{FUNCTION_PORT.split(".")[0]}"\nrole = "function_image"\ntechnique = "{technique}"\n'
            f"functions.{role} = [{json.dumps(asked) if asked is not None else ''}]\n")


def with_function_image(host: Host, graph: str, settings: Iterable[str], technique: str, pass_name: str | None) -> str:
    """What a graph needs at its end for FUNCTION_PORT, as TOML. raises: Error"""
    with host.graph(graph, list(settings)) as made:
        passes = {each["name"]: each["technique"] for each in made.describe()["passes"]}
    return function_pass(technique, technique, pass_name if passes.get(pass_name or "", "none") != "none" else None)


def extended(graph: str, adds: str) -> str:
    return f"extends = {json.dumps(graph)}\n{adds}"


def slug(text: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in text)


def read_scenes(reader: Reader, tables: list[dict]) -> tuple[SceneChoice, ...]:
    scenes: list[SceneChoice] = []
    known: dict[str, SceneChoice] = {}
    if not tables:
        reader.fail(("scene",), "a study needs a scene", expected="[[scene]] with file = \"atrium.py\"")
    for i, given in enumerate(tables):
        table = reader.check_table(("scene", i), given, SCENE_KEYS)
        if "file" not in table:
            reader.fail(("scene", i), "a scene has a file")
            continue
        file = reader.file(table["file"])
        path = scene_path(file)
        if path is None or not path.exists():
            shipped = sorted(each.name for each in (pathlib.Path(__file__).resolve().parents[1] / "scenes").glob("*.py"))
            reader.unknown(("scene", i, "file"), "scene", table["file"], shipped)
            continue
        for plural, single in (("cameras", "camera"), ("times", "time")):
            if plural in table and single in table:
                reader.fail(("scene", i, plural), f"'{single}' and '{plural}' are both there", expected="one of them")
            if table.get(plural) == []:
                reader.fail(("scene", i, plural), f"'{plural}' is empty")
        overlays = tuple(reader.file(each) for each in table.get("overlays", []))
        for overlay in overlays:
            if not pathlib.Path(overlay).exists():
                reader.fail(("scene", i, "overlays"), f"there is no overlay '{overlay}'")
        if not all(pathlib.Path(overlay).exists() for overlay in overlays):
            continue
        arguments = table.get("arguments", {})
        if not all(isinstance(each, (str, bool)) or is_number(each) for each in arguments.values()):
            reader.fail(("scene", i, "arguments"), "'arguments' are texts, numbers and truths by name",
                        found=f"arguments = {arguments!r}", expected="arguments = { lights = 64 }: build(scene, lights=64)")
            continue
        if arguments and not file.endswith(".py"):
            reader.fail(("scene", i, "arguments"), "'arguments' are those of a Python scene's build(scene, ...)",
                        found=f"file = {table['file']!r}")
            continue
        cameras = table.get("cameras", [table.get("camera")])
        times = table.get("times", [table.get("time", 0.0)])
        place = ("scene", i, "cameras" if "cameras" in table else "camera")
        if arguments or any(camera is not None for camera in cameras):
            there = reader.cameras(("scene", i, "arguments" if arguments else "file"), file, overlays, arguments)
            for camera in cameras:
                if there is not None and camera is not None and camera not in there:
                    reader.unknown(place, f"camera of scene '{table['file']}'", camera, there or ["none: it has no cameras"])
        for camera, time in itertools.product(cameras, times):
            scene = SceneChoice(file, camera, float(time), overlays, reader.places.where(place), tuple(arguments.items()))
            # Rows and the reference's file are found by it.
            other = known.setdefault(slug(scene.name), scene)
            if other is not scene:
                is_same = dataclasses.replace(scene, where="") == dataclasses.replace(other, where="")
                reader.fail(("scene", i), f"scene '{scene.name}' is there twice" if is_same else
                            f"two scenes are called '{scene.name}', and would share their rows and their reference's file",
                            found=" and ".join(dict.fromkeys([" ".join([other.file, *other.overlays]),
                                                              " ".join([file, *overlays])])),
                            help="" if is_same else "scenes are told apart by file name, overlays, camera and time")
            scenes.append(scene)
    return tuple(scenes)


def read_variants(reader: Reader, tables: list[dict], graph: str, settings: tuple[str, ...], role: str | None,
                  pass_name: str | None, port: str | None) -> tuple[Point, ...]:
    points: list[Point] = []
    if not tables:
        reader.fail(("variant",), "a study needs a variant", expected="[[variant]] with name = \"...\"")
    names: list[str] = []
    for i, given in enumerate(tables):
        path = ("variant", i)
        table = reader.check_table(path, given, VARIANT_KEYS)
        name = table.get("name", table.get("technique"))
        if name is None:
            reader.fail(path, "a variant has a name")
            continue
        if not name.strip() or name.startswith("("):
            reader.fail((*path, "name"), "a variant's name is empty or begins with a parenthesis", found=f"name = {name!r}",
                        expected="a word or more; (...) are the study's own")
        if name in names:
            reader.fail((*path, "name"), f"two variants are called '{name}'")
        names.append(name)
        swapped = swap(reader, path, table, role, pass_name)
        own = (*settings, *swapped, *table.get("set", []))
        own_graph = reader.file(table["graph"]) if "graph" in table else graph
        place = next(((*path, key) for key in ("set", "graph", "technique") if key in table), path)
        # Settings of a technique that could not be put into its pass would be wrong for the one that is there.
        is_swapped = reader.is_pass_known or ("technique" not in table and "graph" in table)
        described = load(reader, place, own_graph, own) if is_swapped else {}
        if described and port == FUNCTION_PORT:
            load_function_image(reader, place, own_graph, own, str(role), pass_name)
        elif described and port is not None and port not in [each["name"] for each in described["ports"]]:
            if table.get("technique") == "none" and port.startswith(f"{pass_name}."):
                reader.fail((*path, "technique"), f"without pass '{pass_name}' there is no '{port}', the image that is compared",
                            found="technique = \"none\"", expected="a technique, or a port of a pass that stays",
                            help="port = \"display.color\" at the top, for instance, compares what the pass does to the picture")
                continue
            reader.fail(place, f"the variant's graph has no port '{port}', which is compared")
        present = next((each for each in described.get("passes", []) if each["name"] == pass_name), None)
        if described:
            check_extent(reader, place, f"variant '{name}'", described["extent"])
        if described and present is None and "knobs" in table and reader.is_pass_known:
            reader.fail((*path, "knobs"), "of which pass are these the knobs?",
                        expected="'role' or 'pass' at the top, and the pass in the variant's graph")
        ladders = read_knobs(reader, path, table.get("knobs"), role, present)
        climb = table.get("climb", "together")
        if climb not in CLIMBS:
            reader.unknown((*path, "climb"), "way to climb", climb, CLIMBS)
        if "climb" in table and "knobs" not in table:
            reader.fail((*path, "climb"), "there are no ladders to climb", expected="'knobs' of the variant: knobs = \"all\"")
        climbed = rungs(ladders) if climb != "each" else rungs_of_each(ladders)
        if rung := next((rung for j, rung in enumerate(climbed) if rung in climbed[:j]), None):
            reader.fail((*path, "knobs"), "two points have the same values of all knobs",
                        found=" ".join(f"{knob}={value}" for knob, value in rung))
        for rung in climbed:
            everything = (*own, *[f"{pass_name}.params.{knob}={toml(value)}" for knob, value in rung])
            # A value of a file's own ladder may be out of range; one such mistake is enough.
            if rung and not reader.errors:
                load(reader, (*path, "knobs"), own_graph, everything)
            point = Point(name, own_graph, everything, rung)
            if any(point.name == each.name and each.variant != name for each in points):
                reader.fail((*path, "name"), f"a point of another variant is called '{point.name}' as well")
            points.append(point)
            written = dict.fromkeys((present or {}).get("parameters", {}), place) | {knob: (*path, "knobs") for knob, _ in rung}
            values = (present or {}).get("parameters", {}) | dict(rung)
            reader.parameters[point.name] = {key: (written[key], value) for key, value in values.items()}
    return tuple(points)


def check_extent(reader: Reader, path: tuple, what: str, extent: list[int]) -> None:
    """Images of two sizes cannot be compared."""
    if reader.extent is None:
        reader.extent = (what, extent)
    elif extent != reader.extent[1]:
        reader.fail(path, f"{what} is of another size than {reader.extent[0]}", found=f"{extent[0]} x {extent[1]}",
                    expected=f"{reader.extent[1][0]} x {reader.extent[1][1]}",
                    help="extent=[...] in 'set' at the top holds for all of them")


def swap(reader: Reader, path: tuple, table: Mapping[str, Any], role: str | None, pass_name: str | None) -> tuple[str, ...]:
    """The setting that gives the study's pass its variant's technique."""
    if "technique" not in table:
        return ()
    if pass_name is None:
        if role is None and reader.is_pass_known:
            reader.fail((*path, "technique"), "of which pass is that a technique?", expected="'role' or 'pass' at the top")
        return ()
    own = [name for of, name in reader.techniques if of == role]
    if table["technique"] not in [*own, "none"]:
        reader.unknown((*path, "technique"), f"technique of role '{role}'", table["technique"], ["none", *own])
        return ()
    return (f"{pass_name}.technique={table['technique']}",)


def toml(value: Any) -> str:
    """A knob's value as settings have it: choices are words, and need no quotes."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def read_knobs(reader: Reader, path: tuple, knobs: Any, role: str | None, present: Mapping[str, Any] | None) -> dict[str, list]:
    """{knob: values from cheap to accurate}; empty: one point."""
    if knobs is None or present is None or role is None:
        return {}
    technique = reader.techniques.get((role, present["technique"]))
    parameters = {each["name"]: each for each in technique["parameters"]} if technique else {}
    declared = {key: rung_values(each) for key, each in parameters.items() if each["ladder"]}
    if knobs == "all":
        return declared
    if isinstance(knobs, list) and all(isinstance(knob, str) for knob in knobs):
        for knob in knobs:
            if knob not in declared:
                reader.unknown((*path, "knobs"), f"knob of {role}/{present['technique']}", knob, declared)
        return {knob: declared[knob] for knob in knobs if knob in declared}
    if isinstance(knobs, dict) and all(isinstance(values, list) and values for values in knobs.values()):
        for knob in knobs:
            if knob not in parameters:
                reader.unknown((*path, "knobs"), f"parameter of {role}/{present['technique']}", knob, parameters)
        return {knob: values for knob, values in knobs.items() if knob in parameters}
    reader.fail((*path, "knobs"), "'knobs' says which ladders are climbed", found=f"knobs = {knobs!r}",
                expected="\"all\", a list of knobs, or a table of values: { steps = [2, 4, 8] }")
    return {}


def rung_values(parameter: Mapping[str, Any]) -> list:
    """A knob's ladder as settings have it."""
    if parameter["type"] == "choice":
        return [parameter["choices"][int(value)] for value in parameter["ladder"]]
    if parameter["type"] == "bool":
        return [str(bool(value)).lower() for value in parameter["ladder"]]
    return [int(value) if parameter["type"] == "int" else value for value in parameter["ladder"]]


def rungs(ladders: Mapping[str, list]) -> list[tuple[tuple[str, Any], ...]]:
    """All ladders climbed together, the i-th value of each; one that ends first stays on its last."""
    if not ladders:
        return [()]
    height = max(len(values) for values in ladders.values())
    return [tuple((knob, values[min(i, len(values) - 1)]) for knob, values in ladders.items()) for i in range(height)]


def rungs_of_each(ladders: Mapping[str, list]) -> list[tuple[tuple[str, Any], ...]]:
    """One ladder after the other, whose other knobs stay as the variant has them."""
    return [((knob, value),) for knob, values in ladders.items() for value in values] or [()]
