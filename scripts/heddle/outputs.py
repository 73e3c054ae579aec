# SPDX-License-Identifier: Apache-2.0
"""--output of the command: "FILE" for what the graph is about, or "PASS.PORT=FILE"."""
from __future__ import annotations

import contextlib
import os
import pathlib
import re
from collections.abc import Iterator, Sequence

from ._library import CANCELLED
from .host import Error, Graph, Job


def parse_output(text: str) -> list[str | None]:
    """[port or None, file]. No port has a slash in its name, so "/tmp/a=b.png" is a file."""
    port, equals, file = text.partition("=")
    if not equals or "/" in port:
        return [None, text]
    if not port or not file:
        raise Error(2, f"error: --output has no {'file' if port else 'port'} beside its '='\n  found:    {text}\n"
                       "  expected: FILE, or PASS.PORT=FILE")
    return [port, file]


def parse_outputs(graph: Graph | Job, texts: Sequence[str]) -> list[list[str | None]]:
    """As parse_output, each. raises: Error, before anything is rendered, for what could not be written afterwards"""
    ports = {port["name"] for port in graph.describe()["ports"]}
    outputs = [parse_output(text) for text in texts]
    taken: set[str] = set()
    for port, file in outputs:
        if port is None and file in ports:
            raise Error(2, f"error: --output '{file}' is a port, and no file\n  expected: {file}=FILE\n"
                           f"  help:     for a file of that name write --output './{file}'")
        place = os.path.abspath(file)
        if place in taken:
            raise Error(2, f"error: two outputs were given the file '{file}'\n  expected: a file for each")
        taken.add(place)
    return outputs


def refuse_format(file: str) -> None:
    """Of an image, if its name does not say which. raises: Error"""
    if not pathlib.PurePath(file).suffix:
        raise Error(2, f"error: --output '{file}' has no extension, which says how an image is written\n"
                       "  expected: .png, .exr or another at its end")


def frame_file(file: str, frame: int) -> str:
    """The file of one frame: "frame_%04d.png" names one for each."""
    return re.sub(r"%(\d{0,2})d", lambda match: f"{frame:0{int(match.group(1) or 0)}d}", file, count=1)


class Writing:
    """Writes each of several outputs though others fail; the failures are raised together."""

    def __init__(self) -> None:
        self.failures: list[Error] = []

    @contextlib.contextmanager
    def of(self, file: str) -> Iterator[None]:
        """Of one output, whose folder is made. raises: Error for a stop alone, which ends all"""
        with contextlib.suppress(OSError):  # writing says so
            pathlib.Path(file).parent.mkdir(parents=True, exist_ok=True)
        try:
            yield
        except Error as error:
            if error.status == CANCELLED:
                raise
            self.failures.append(error)

    def finish(self) -> None:
        """raises: Error with what every failure said, and the first one's status"""
        if self.failures:
            raise Error(self.failures[0].status, "\n".join(map(str, self.failures)))


def keep_outputs(graph: Graph | Job, outputs: Sequence[Sequence[str | None]]) -> None:
    """Keeps the images that are named. What is no port of the graph may be a file's name: then it needs a folder."""
    for port, file in outputs:
        refuse_format(file)
        if port is None:
            continue
        try:
            graph.keep(port)
        except Error as error:
            raise Error(error.status, f"{error}\n  help:     if '{port}={file}' is a file, write --output './{port}={file}'") from None
