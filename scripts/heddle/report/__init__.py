# SPDX-License-Identifier: Apache-2.0
"""A study's folder -> report.html: one page that opens from disk, without a server, a network or a file beside it.

Its numbers are those of results.json; its images those of images/, as large as the page may be: whole where they are small,
else half as wide and high, with the worst tiles whole; the page reads whole ones from images/ when it is asked to.
"""

from __future__ import annotations

import base64
import datetime
import hashlib
import html
import itertools
import json
import os
import pathlib
import platform
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import Error, Host, error_image, metrics
from .. import statistics as s
from .. import study_images as images
from ..comparison import compare_with_map
from .verdict import verdict

HERE = pathlib.Path(__file__).parent
SCRIPTS = ("base.js", "pixels.js", "chart.js", "viewer.js", "passes.js", "frame_graph.js", "page.js")
# Bytes of the page. Where whole images take less than WHOLE, they are in it.
BUDGET, WHOLE = 60_000_000, 8_000_000
WORST_TILES = 6
FEWEST_TILES = 2
Json = dict[str, Any]


class Level(NamedTuple):
    """How much of an image is in the page."""

    scale: int  # so many times narrower and lower
    mantissa: int | None  # bits of a float16's mantissa; None: as it is, to the bit


LEVELS = [Level(1, None), Level(2, 10), Level(2, 7), Level(2, 5), Level(4, 7), Level(4, 5), Level(8, 5), Level(16, 5)]


class Kept(NamedTuple):
    """An image of the study and what it is compared with."""

    key: str
    reference: str | None  # key; None: it is the reference
    metric: str
    is_encoded: bool  # as displays want it, not linear


def write(folder: pathlib.Path, budget: int = BUDGET, whole: int = WHOLE) -> pathlib.Path:
    """Writes FOLDER/report.html from what a study left in FOLDER, whole or not at all; answers its path.

    budget: bytes that the page has at most, if the numbers alone leave room for that
    whole:  bytes up to which whole images are in it
    raises: OSError, ValueError if there is no results.json
    """
    results = json.loads((folder / "results.json").read_text())
    page = Page(folder, results)
    text = page.text(budget, whole)
    path = folder / "report.html"
    partial = path.with_name(f".report.{os.getpid()}.partial")
    with open(partial, "w", encoding="utf-8") as file:
        file.writelines(text)
    partial.replace(path)
    return path


class Page:
    def __init__(self, folder: pathlib.Path, results: Json):
        self.folder, self.results = folder, results
        self.study = results["study"]
        self.made = results.get("made_by", [])
        self.exposures = tuple(self.study["exposures"]) if self.study.get("exposures") else None
        self._explained: dict[str, Json | None] = {}

    def text(self, budget: int, whole: int) -> Iterator[str]:
        data = self.data()
        rest = sum(len(part.encode()) for part in assemble(data | {"images": {}}, []))
        kept = self.images()
        blobs, levels = fit(self, kept, max(budget - rest - 1000, 0), whole)
        data["images"] = {key: head for key, (head, _) in blobs.items()}
        data["level"] = {"scale": levels.scale, "mantissa": levels.mantissa}
        return assemble(data, [text for _, parts in blobs.values() for text in parts])

    # Numbers

    def data(self) -> Json:
        """All that the page's scripts know, but for pixels."""
        formulas, graphs, settings = Interned(), Interned(), Interned()
        points, scenes = [], []
        for number, made in enumerate(self.made):
            reference = made["reference"]
            scenes.append({key: made[key] for key in ("scene", "file", "arguments", "camera", "time", "overlays", "devices", "device")}
                          | {"reference": reference, "restless": self.results["restless"].get(made["scene"], [])})
            for point in made["points"]:
                knobs = " ".join(f"{knob}={value}" for knob, value in point["knobs"])
                rows = [row for row in self.results["rows"] if (row["scene"], row["variant"], row["knobs"]) ==
                        (made["scene"], point["variant"], knobs)]
                explained = self.explained(point["explained"])
                points.append({
                    "scene": number, "name": point["name"], "variant": point["variant"], "knobs": point["knobs"],
                    "graph": point["graph"], "settings": point["settings"], "image": self.known(point["image"]),
                    "state": rows[0]["state"] if rows else "failed", "note": rows[0]["note"] if rows else "",
                    "device": settings.of(point.get("device")),
                    "frame_graph": graphs.of(trimmed(explained)) if explained else None,
                    "parameters": settings.of(parameters(explained)) if explained else None,
                    "rows": {row["quantity"]: short(row, formulas) for row in rows},
                })
            if reference is not None:
                reference["image"] = self.known(reference["image"])
        better = {each["name"]: each for each in metrics()}
        unit = self.unit()
        return {
            "title": self.study["title"], "study": {key: value for key, value in self.study.items()
                                                    if key not in ("points", "scenes", "reference")},
            "metrics": [{"name": name, "better": better.get(name, {"better": "lower"})["better"], "unit": metric_unit(name, unit)}
                        for name in self.study["metrics"]],
            "is_encoded": self.is_encoded(),
            "scenes": scenes, "points": points, "formulas": formulas.values, "graphs": graphs.values,
            "interned": settings.values, "leave_one_out": self.results.get("leave_one_out", []),
            "verdict": verdict(self.study, self.results["rows"], self.results["restless"]),
            "command": self.results.get("command", ""), "machine": self.results["machine"],
            "versions": {"heddle": self.results["heddle"], "Python": platform.python_version(), "numpy": np.__version__},
            "files": {file: value[:16] for file, value in self.results.get("files", {}).items()},
            "rounds": [made["rounds"] for made in self.made],
            "false_verdicts": self.results["false_verdicts"], "power": self.results["power"],
            "written": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        }

    def explained(self, key: str | None) -> Json | None:
        if key is None:
            return None
        if key not in self._explained:
            try:
                self._explained[key] = json.loads((self.folder / "measured" / f"{key}.json").read_text())
            except (OSError, ValueError):
                self._explained[key] = None
        return self._explained[key]

    def role(self) -> str | None:
        """Of the pass whose port is compared; None if no point was planned."""
        pass_name = self.study["port"].split(".")[0]
        for made in self.made:
            for point in made["points"]:
                explained = self.explained(point["explained"])
                for each in explained["passes"] if explained else []:
                    if each["name"] == pass_name:
                        return each["role"]
        return None

    def is_encoded(self) -> bool:
        """Whether the port that is compared holds what displays want: sRGB, 0 to 1."""
        return self.role() == "display"

    def unit(self) -> str:
        """Of the values of the port that is compared, as its role states it; "" where there is none, or none is known."""
        role, port = self.role(), self.study["port"].split(".")[-1]
        if role is None:
            return ""
        try:
            with Host(log=lambda *_: None) as host:
                roles = host.list()["roles"]
        except Error:
            return ""  # numbers are worth a page without their unit
        stated = (each["unit"] for own in roles if own["name"] == role for each in own["ports"]
                  if each["name"] == port and each["direction"] == "out")
        unit = next(stated, "")
        return "" if unit == "1" else unit

    # Images

    def known(self, key: str | None) -> str | None:
        return key if key is not None and images.head_of(self.folder, key) is not None else None

    def images(self) -> list[Kept]:
        found: dict[str, Kept] = {}
        metric, encoded = self.study["metrics"][0], self.is_encoded()
        for made in self.made:
            reference = self.known((made["reference"] or {}).get("image"))
            if reference is not None:
                found[reference] = Kept(reference, None, metric, encoded)
            for point in made["points"]:
                key = self.known(point["image"])
                if key is not None and key not in found:
                    found[key] = Kept(key, reference, metric, encoded)
        return list(found.values())

    def flip(self, kept: Kept, image: NDArray, reference: NDArray) -> tuple[Json, NDArray[np.uint8] | None]:
        """FLIP's map against the reference in 255 steps, kept from run to run, and what it was made with."""
        name = "flip" if kept.is_encoded else "hdr_flip"
        key = hashlib.sha256(json.dumps([kept.key, kept.reference, name, self.exposures, self.study["tone_mapper"]]).encode())
        path = self.folder / "measured" / f"flip_{key.hexdigest()[:32]}.npz"
        with_what: Json = {"exposures": self.exposures, "tone_mapper": self.study["tone_mapper"]}
        try:
            with np.load(path) as found:
                return json.loads(str(found["head"])), found["map"]
        except (OSError, ValueError, KeyError):
            pass
        try:
            described, map = compare_with_map(image, reference, name, **with_what)
        except Error as error:
            return {"name": name, "why_none": str(error).split("\n")[0].removeprefix("error: ")}, None
        head = {"name": name} | described
        steps = np.rint(255 * np.clip(map, 0, 1)).astype(np.uint8)
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.name}.{os.getpid()}.partial.npz")
        np.savez_compressed(partial, head=json.dumps(head), map=steps)
        partial.replace(path)
        return head, steps

    def worst_tiles(self, kept: Kept, image: NDArray, reference: NDArray, count: int) -> tuple[int, list[Json]]:
        """(their side in pixels, the tiles with the largest mean error, largest first)."""
        map = error_map(image, reference, kept.metric)
        side = tile_side(*map.shape)
        tops, lefts = np.arange(0, map.shape[0], side), np.arange(0, map.shape[1], side)
        sums = np.add.reduceat(np.add.reduceat(map, tops, axis=0), lefts, axis=1)
        means = sums / np.outer(np.diff(tops, append=map.shape[0]), np.diff(lefts, append=map.shape[1]))
        # Of equal ones the first from the top left.
        worst = [np.unravel_index(each, means.shape) for each in np.argsort(-means, axis=None, kind="stable")[:count]]
        return side, [{"x": int(x) * side, "y": int(y) * side, "error": float(means[y, x])} for y, x in worst if means[y, x] > 0]


def error_map(image: NDArray, reference: NDArray, metric: str) -> NDArray[np.float64]:
    """(height, width): what the metric averages, or |a-b| where it has no map; 0 where that is no number."""
    try:
        map = error_image(image, reference, metric if not metric.startswith("percentile") else "rmse")
    except Error:
        map = image - reference
    return np.nan_to_num(np.abs(map.astype(np.float64)), nan=0.0, posinf=0.0).mean(axis=2)


def tile_side(height: int, width: int) -> int:
    """A sixteenth of the longer side, in steps of 8, 8 to 64 pixels."""
    return min(max(8 * round(max(height, width) / 16 / 8), 8), 64)


# ---- Pixels in the page ----

def metric_unit(metric: str, unit: str) -> str:
    """The unit of the metric of values in UNIT; "" for what is a ratio, a count or a sum over models of seeing."""
    if not unit:
        return ""
    if metric in ("rmse", "mean_difference", "maximum") or metric.startswith("percentile_"):
        return unit
    return f"({unit})^2" if metric == "mse" else ""


Blob = tuple[Json, list[str]]  # what the scripts know of an image; its data, as elements of the page


def fit(page: Page, kept: Sequence[Kept], budget: int, whole: int) -> tuple[dict[str, Blob], Level]:
    """As much of every image as the budget allows, of all the same: the scripts' heads and the elements with the pixels."""
    count = WORST_TILES
    for number, level in enumerate(LEVELS):
        limit = min(whole, budget) if level.scale == 1 else budget
        # A few tell whether all could fit; then all are counted.
        some = kept[::max(1, len(kept) // 6)]
        if number == len(LEVELS) - 1 or not some or size_of(encoded(page, some, level, count)) * len(kept) / len(some) <= 1.1 * limit:
            blobs = encoded(page, kept, level, count)
            if size_of(blobs) <= limit or number == len(LEVELS) - 1:
                return blobs, level
        if level.scale > 1:
            count = max(FEWEST_TILES, count - 1)
    raise AssertionError


def size_of(blobs: dict[str, Blob]) -> int:
    return sum(len(json.dumps(head)) + sum(map(len, parts)) for head, parts in blobs.values())


def encoded(page: Page, kept: Sequence[Kept], level: Level, tile_count: int) -> dict[str, Blob]:
    blobs: dict[str, Blob] = {}
    names = (f"p{number}" for number in itertools.count())
    reference_key, reference = None, None
    for each in kept:
        try:
            whole = images.load(page.folder, each.key)
        except (OSError, ValueError):
            continue  # the page says that it is not there
        parts: list[str] = []

        def add(values: NDArray, place: Json | None = None) -> Json:
            head, packed = images.pack(values)
            head |= {"id": next(names)} | (place or {})
            parts.append(f'<script type="text/plain" id="{head["id"]}">{base64.b64encode(packed).decode()}</script>\n')
            return head

        colors = whole[..., :3]
        head: Json = {"file": f"images/{each.key}.js", "width": whole.shape[1], "height": whole.shape[0],
                      "channels": whole.shape[2], "sha256": images.fingerprint(whole),
                      "not_finite": int(np.count_nonzero(~np.isfinite(whole).all(axis=2)))}
        head["pixels"] = add(reduced(colors, level))
        if each.reference is not None:
            if reference_key != each.reference:
                try:
                    reference_key, reference = each.reference, images.load(page.folder, each.reference)
                except (OSError, ValueError):
                    reference_key, reference = each.reference, None
            if reference is None or reference.shape != whole.shape:
                head["flip"] = {"why_none": "there is no reference of this size"}
            else:
                head["flip"], map = page.flip(each, whole, reference)
                if map is not None:
                    head["flip"]["pixels"] = add(reduced_map(map, level))
                side, head["tiles"] = page.worst_tiles(each, whole, reference, tile_count)
                head["tile_side"] = side
                if level.scale > 1:
                    for tile in head["tiles"]:
                        x, y = tile["x"], tile["y"]
                        for name, source in (("pixels", colors), ("reference", reference[..., :3])):
                            part = source[y:y + side, x:x + side]
                            tile[name] = add(part.astype(np.float16) if images.is_half(part) else part)
        blobs[each.key] = (head, parts)
    return blobs


def reduced(image: NDArray[np.float32], level: Level) -> NDArray:
    scale = level.scale
    while scale > 1:
        image, scale = images.halved(image), scale // 2
    if level.mantissa is None:
        return image.astype(np.float16) if images.is_half(image) else np.ascontiguousarray(image)
    return images.to_half(image, level.mantissa)


def reduced_map(map: NDArray[np.uint8], level: Level) -> NDArray[np.uint8]:
    scale, values = level.scale, map.astype(np.float32)
    while scale > 1:
        values, scale = images.halved(values), scale // 2
    return np.rint(values).astype(np.uint8)


# ---- Parts of the data ----

class Interned:
    """Values by number, equal ones once."""

    def __init__(self) -> None:
        self.values: list[Any] = []
        self._numbers: dict[str, int] = {}

    def of(self, value: Any) -> int:
        key = json.dumps(value, sort_keys=True)
        if key not in self._numbers:
            self._numbers[key] = len(self.values)
            self.values.append(value)
        return self._numbers[key]


def short(row: Json, formulas: Interned) -> Json:
    """A row of results.json without what its point says already."""
    left = {key: value for key, value in row.items() if value not in ("", None) and key not in
            ("study", "scene", "variant", "knobs", "state", "quantity", "formula")}
    left = {key: float(f"{value:.8g}") if isinstance(value, float) else value for key, value in left.items()}
    return left | ({"formula": formulas.of(row["formula"])} if row.get("formula") else {})


def parameters(explained: Json) -> Json:
    return {each["name"]: each["parameters"] for each in explained["passes"] if each["parameters"]}


def trimmed(explained: Json) -> Json:
    """What the picture of a frame graph shows: passes in the file's order, and who gives what to whom."""
    passes = [{key: each[key] for key in ("name", "role", "technique", "is_pruned", "reason")} for each in explained["passes"]]
    names = {each["name"] for each in passes}
    history = {each["name"]: each["history_of"] for each in explained["resources"] if "history_of" in each}
    edges: dict[tuple[str, str, str, str], None] = {}
    scene: dict[str, list[str]] = {}
    for each in explained["passes"]:
        sources = [*each["changes"].values(), *each["ports"].values()]
        for resource in dict.fromkeys(sources):
            kind = "previous" if resource in history else "reads"
            maker = history.get(resource, resource).rpartition(".")[0]
            if maker == "scene":
                scene.setdefault(each["name"], []).append(resource)
            elif maker in names and (maker != each["name"] or kind == "previous"):
                edges[(maker, each["name"], history.get(resource, resource), kind)] = None
        for function in each["functions"]:
            for provider in function["providers"]:
                edges[(provider, each["name"], function["role"], "answers")] = None
    stages: dict[str, list[Json]] = {}
    for number, stage in enumerate(explained["stages"], 1):
        stages.setdefault(stage["pass"], []).append({"number": number, "name": stage["stage"], "kind": stage["kind"]})
    for each in passes:
        each["stages"] = stages.get(each["name"], [])
        each["scene"] = scene.get(each["name"], [])
    shapes = {each["name"]: each["shape"] for each in explained["resources"]}
    return {"file": explained["file"], "extent": explained["extent"], "output": explained["output"], "passes": passes,
            "edges": [{"from": a, "to": b, "what": what, "kind": kind, "shape": shapes.get(what, "")}
                      for a, b, what, kind in edges],
            "loops": explained["loops"], "memory": explained["memory"], "notes": explained["notes"]}


# ---- The page ----

def unbroken(text: str) -> str:
    """No line ends between a number and its %."""
    return re.sub(r"[+-]?[\d.]+ %", r'<span class="number">\g<0></span>', text)


def assemble(data: Json, blobs: Sequence[str]) -> Iterator[str]:
    """Numbers and scripts first, so that they are painted while the pixels are still read."""
    script = "\n".join(["'use strict';", "(() => {", *((HERE / name).read_text() for name in SCRIPTS), "})();"])
    style = (HERE / "page.css").read_text()
    # What studies and scenes say is text, whatever it says; scripts are these and, beside the page, its images.
    allowed = "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"
    fields: dict[str, Callable[[], str]] = {
        "title": lambda: html.escape(data["title"]), "verdict": lambda: unbroken(html.escape(" ".join(data["verdict"]))),
        "policy": lambda: f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {allowed} 'self' file:",
        "style": lambda: style,
        "data": lambda: json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "script": lambda: script,
    }
    template = (HERE / "page.html").read_text()
    before, after = template.split("{{pixels}}")
    for part in (before, after):
        pieces = part.split("{{")
        yield pieces[0]
        for piece in pieces[1:]:
            name, rest = piece.split("}}", 1)
            yield fields[name]()
            yield rest
        if part is before:
            yield from blobs


def points_of(file: pathlib.Path) -> Json:
    """The data of a page that was written by write(). raises: OSError, ValueError if it is no such page"""
    text = file.read_text(encoding="utf-8")
    begin = text.find('<script type="application/json" id="data">')
    end = text.find("</script>", begin)
    if begin < 0 or end < 0:
        raise ValueError("there is no study in it")
    return json.loads(text[text.index(">", begin) + 1:end])
