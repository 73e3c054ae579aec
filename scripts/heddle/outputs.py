# SPDX-License-Identifier: Apache-2.0
"""--output of the command: "FILE" for what the graph is about, or "PASS.PORT=FILE"."""
from __future__ import annotations

from collections.abc import Sequence

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


def parse_outputs(texts: Sequence[str]) -> list[list[str | None]]:
    """As parse_output, each."""
    return [parse_output(text) for text in texts]


def keep_outputs(graph: Graph | Job, outputs: Sequence[Sequence[str | None]]) -> None:
    """Keeps the ports that are named. What is no port of the graph may be a file's name: then it needs a folder."""
    for port, file in outputs:
        if port is None:
            continue
        try:
            graph.keep(port)
        except Error as error:
            raise Error(error.status, f"{error}\n  help:     if '{port}={file}' is a file, write --output './{port}={file}'") from None
