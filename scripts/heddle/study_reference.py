# SPDX-License-Identifier: Apache-2.0
"""What a study calls true: a technique of the same role, another role's where the contract names one, or images."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from . import Error
from .study import (FUNCTION_PORT, PHYSICAL, REFERENCE_KEYS, TRUTHS, Reader, Reference, SceneChoice, absolute, check_extent, extended, load,
                    rung_values, slug, swap)


def read_reference(reader: Reader, given: Any, graph: str, settings: tuple[str, ...], role: str | None, pass_name: str | None,
                   scenes: Sequence[SceneChoice], port: str | None) -> Reference | None:
    """As written, else what the role names. raises nothing: mistakes are the reader's"""
    if isinstance(given, str):  # in short: reference = "physical"
        given = {"truth": given}
    if given is not None and not isinstance(given, dict):
        reader.fail(("reference",), "'reference' says what is true", found=f"reference = {given!r}",
                    expected="reference = \"physical\", or a table [reference]")
        return None
    table = reader.check_table(("reference",), given or {}, REFERENCE_KEYS)
    if "file" in table:
        return read_files(reader, table, scenes)
    truth = table.get("truth")
    if truth is not None and truth not in TRUTHS:
        reader.unknown(("reference", "truth"), "truth", truth, TRUTHS)
        return None
    if truth is not None and "technique" in table:
        reader.fail(("reference", "technique"), "'truth' is the technique that the role's contract names, and 'technique' another "
                    "one", expected="one of them")
        return None
    own_graph = reader.file(table["graph"]) if "graph" in table else graph
    parts = table.get("parts", 8)
    if not 1 <= parts <= 1000:
        reader.fail(("reference", "parts"), "'parts' is out of range", found=f"{parts}", expected="1 to 1000")
    if parts == 1:
        reader.warn(("reference", "parts"), "of one rendering nobody knows how sure it is, and no verdict asks",
                    found="parts = 1", help="2 or more; of those without randomness no more than two are made")
    own = tuple(table.get("set", []))
    if truth == "physical":
        return read_physical(reader, own_graph, settings, own, role, pass_name, port, parts)
    named: tuple[str, ...] = ()
    if "technique" in table:
        named = swap(reader, ("reference",), table, role, pass_name)
    elif truth == "same_model" or ("graph" not in table and "set" not in table):
        found = most_accurate(reader, role, pass_name, truth)
        if found is None:
            return None
        named = found
    everything = (*settings, *named, *own)
    if reader.is_pass_known or ("technique" not in table and "graph" in table):
        place = ("reference", "set") if "set" in table else ("reference",)
        if described := load(reader, place, own_graph, everything):
            check_extent(reader, place, "the reference", described["extent"])
    return Reference(own_graph, everything, parts)


def most_accurate(reader: Reader, role: str | None, pass_name: str | None, truth: str | None) -> tuple[str, ...] | None:
    """Settings of the technique of the same role that its contract names, at the last rung of each ladder that it does not
    speak of; None, and a mistake, if there is none."""
    references = reader.roles[role].get("references") or {} if role is not None else {}
    # A technique of another role is no other word for the pass.
    physical = references.get("physical")
    if physical is not None and (physical["technique"].split("/")[0] != role or truth is not None):
        physical = None
    stated = references.get("same_model") or physical
    if stated is None or pass_name is None:
        if reader.is_pass_known and not reader.errors:
            reader.fail(("reference",), "nothing says what is true", expected="[reference] with technique, graph or set")
        return None
    technique = stated["technique"].split("/")[-1]
    known = reader.techniques.get((role or "", technique))
    last = {each["name"]: rung_values(each)[-1] for each in known["parameters"] if each["ladder"]} if known else {}
    return (f"{pass_name}.technique={technique}",
            *[f"{pass_name}.params.{key}={value}" for key, value in (last | stated["params"]).items()])


def read_physical(reader: Reader, graph: str, settings: tuple[str, ...], own: tuple[str, ...], role: str | None,
                  pass_name: str | None, port: str | None, parts: int) -> Reference | None:
    """The graph with one more pass, PHYSICAL: the technique of another role that the contract names, which makes what is
    compared as a port of its own. What the contract calls shared it takes from the pass that is studied."""
    if role is None or pass_name is None:
        if reader.is_pass_known:
            reader.fail(("reference", "truth"), "of which role is that the truth?", expected="'role' or 'pass' at the top")
        return None
    stated = (reader.roles[role].get("references") or {}).get("physical")
    if stated is None:
        with_one = []
        for name, each in reader.roles.items():
            other = (each.get("references") or {}).get("physical")
            # One of another role that shows nothing of what is compared would be refused, too.
            if other and (other["port"] or other["technique"].split("/")[0] == name):
                with_one.append(name)
        reader.fail(("reference", "truth"), f"role '{role}' names no physical reference",
                    expected=f"a role that does: {', '.join(sorted(with_one))}", help="[reference] with technique, graph or set")
        return None
    name, of = stated["technique"], tuple(stated["technique"].split("/"))
    if of not in reader.techniques:
        reader.fail(("reference", "truth"), f"the physical reference of role '{role}', {name}, is not installed",
                    help="[reference] with technique, graph or set")
        return None
    measured = (reader.roles[role].get("measure") or {}).get("port") or ""
    if of[0] == role:  # a pass of the study's own kind: as any technique of the role
        named = (f"{pass_name}.technique={of[1]}",
                 *[f"{pass_name}.params.{key}={value}" for key, value in stated["params"].items()])
        load(reader, ("reference",), graph, (*settings, *named, *own))
        return Reference(graph, (*settings, *named, *own), parts)
    if not stated["port"]:
        reader.fail(("reference", "truth"), f"role '{role}' names {name} as its physical reference, and no port of it that shows "
                    "what is compared", help="[reference] with technique, graph or set")
        return None
    # What a function answers is compared as an image of its own.
    shown = f"{pass_name}.{measured}" if measured else FUNCTION_PORT
    if port is not None and port != shown:
        reader.fail(("reference", "truth"), f"the physical reference of role '{role}' shows what '{shown}' does",
                    found=f"port = \"{port}\"", expected="no 'port' at the top, or that one")
        return None
    described = load(reader, ("reference",), graph, settings)
    if not described:
        return None
    check_extent(reader, ("reference",), "the reference", described["extent"])
    there = next((each for each in described["passes"] if each["name"] == pass_name), {})
    shared = {key: there.get("parameters", {}).get(of_pass) for key, of_pass in stated["shared"].items()}
    params = stated["params"] | {key: value for key, value in shared.items() if value is not None}
    warn_of_other_truths(reader, pass_name, name, {of_pass: shared[key] for key, of_pass in stated["shared"].items()})
    adds = f'[[pass]]\nname = "{PHYSICAL}"\nrole = "{of[0]}"\ntechnique = "{of[1]}"\n'
    everything = (*settings, *[f"{PHYSICAL}.params.{key}={value}" for key, value in params.items()], *own)
    made = f"{PHYSICAL}.{stated['port']}"
    try:
        with reader.host.parse(extended(absolute(graph), adds), f"{graph} with {name}", "", list(everything)) as parsed:
            parsed.keep(made)
    except Error as error:
        reader.fail(("reference", "set") if own else ("reference",), f"the graph does not take {name}:\n    "
                    + str(error).replace("\n", "\n    "))
        return None
    return Reference(graph, everything, parts, port=made, adds=adds)


def warn_of_other_truths(reader: Reader, pass_name: str, name: str, shared: Mapping[str, Any]) -> None:
    """All points are compared with one truth, which has the graph's values of what is shared: of a point with another value
    that is part of its error. A study may ask just that, so it is no mistake; said once for a place."""
    told: set[tuple] = set()
    for point, own in reader.parameters.items():
        for parameter, truth in shared.items():
            place, value = own.get(parameter, ((), None))
            if truth is None or value is None or value == truth or (place, parameter) in told:
                continue
            told.add((place, parameter))
            reader.warn(place, f"'{point}' is compared with the truth of another {parameter}",
                        found=f"{pass_name}.params.{parameter}={value}, and {truth} in {name}",
                        help=f"to compare it with its own, set {pass_name}.params.{parameter} in 'set' at the top, for all")


def read_files(reader: Reader, table: Mapping[str, Any], scenes: Sequence[SceneChoice]) -> Reference | None:
    """Images from elsewhere, one a scene: "{scene}" in the file's name is the scene's."""
    place = ("reference", "file")
    for key in ("truth", "technique", "graph", "set", "parts"):
        if key in table:
            reader.fail(("reference", key), f"'{key}' says how the reference is rendered, and 'file' that it is an image",
                        expected="one of them")
    if len(scenes) > 1 and "{scene}" not in table["file"]:
        reader.fail(place, "one image is the reference of several scenes", found=f"file = \"{table['file']}\"",
                    expected="{scene} in its name, for " + ", ".join(slug(scene.name) for scene in scenes))
        return None
    files = []
    for scene in scenes:
        file = reader.file(table["file"].replace("{scene}", slug(scene.name)))
        if not pathlib.Path(file).exists():
            reader.fail(place, f"there is no image '{file}', the reference of scene '{scene.name}'")
            continue
        try:
            height, width = reader.host.read_image(file).shape[:2]
        except Error as error:
            reader.fail(place, "the reference cannot be read:\n    " + str(error).replace("\n", "\n    "))
            continue
        check_extent(reader, place, f"the reference '{file}'", [width, height])
        files.append(file)
    return Reference("", (), 1, tuple(files))
