# SPDX-License-Identifier: Apache-2.0
"""What the command line takes for a number, and what it says of words that it does not know."""

from __future__ import annotations

import argparse
import difflib
import re
from typing import NoReturn


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' is no number") from error


def frame_budget(text: str) -> float:
    value = number(text)
    if not 0 <= value <= 10000:  # nan too
        raise argparse.ArgumentTypeError(f"'{text}' is out of range: 0 to 10000 milliseconds")
    return value


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number") from error


MOST_FRAMES = 1_000_000  # as the command has it for other scenes


def frame_count(text: str) -> int:
    count = whole(text)
    if not 1 <= count <= MOST_FRAMES:
        raise argparse.ArgumentTypeError(f"{count} is no number of frames: expected 1 to {MOST_FRAMES}")
    return count


def joined(words: list[str]) -> list[str]:
    """The same, with --budget=-4ms for --budget -4ms: argparse would take the value for an option, and say that none was
    given."""
    found: list[str] = []
    for word in words:
        if found and found[-1] == "--budget" and re.match(r"-[\d.]", word):
            found[-1] += f"={word}"
        else:
            found.append(word)
    return found


class Parser(argparse.ArgumentParser):
    """Says what is wrong as all other errors are said - what was found, what is expected, what is near - and not how the whole
    command is used."""

    def error(self, message: str) -> NoReturn:
        message = message.removeprefix("argument ")
        if choice := re.fullmatch(r"([^:]+): invalid choice: '(.*)' \(choose from (.*)\)", message, re.DOTALL):
            self.refuse(f"{choice[1]} has no '{choice[2]}'", choice[2], choice[3].replace("'", "").split(", "))
        self.exit(2, f"error: {message}\n  help:     {self.prog} --help\n")

    def refuse_option(self, word: str) -> NoReturn:
        """One that the command does not have: by its letters the nearest, else the one that is called so elsewhere."""
        word, _, _ = word.partition("=")
        known = sorted({option for action in self._actions for option in action.option_strings if option.startswith("--")})
        others = [f"--{name}" for name in OTHER_NAMES.get(word.lstrip("-"), ())]
        self.refuse(f"{self.prog} has no option '{word}'", word, known, next((each for each in others if each in known), None))

    def refuse(self, message: str, word: str, known: list[str], near: str | None = None) -> NoReturn:
        near = near or next(iter(difflib.get_close_matches(word, known, 1)), None)
        self.exit(2, f"error: {message}\n  expected: one of {', '.join(known)}\n  help:     "
                  + (f"did you mean '{near}'? " if near else "") + f"{self.prog} --help says what they do\n")


# What an option is called in one command, or in another program, and in a command that lacks it.
OTHER_NAMES = {
    "output": ("folder",), "out": ("folder", "output"), "o": ("folder", "output"), "dir": ("folder",), "directory": ("folder",),
    "folder": ("output",), "results": ("folder",), "repeats": ("rounds",), "runs": ("rounds", "repeats"),
    "samples": ("rounds", "repeats"), "rounds": ("repeats",), "minutes": ("budget",), "param": ("set",), "params": ("set",),
    "size": ("set",), "extent": ("set",), "resolution": ("set",), "width": ("set",), "height": ("set",), "gpu": ("device",),
    "metrics": ("metric",), "silent": ("quiet",), "ports": ("port",),
}
