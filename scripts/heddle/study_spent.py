# SPDX-License-Identifier: Apache-2.0
"""Where a study's own time goes, part by part, so that who cuts one knows where."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator


def own_seconds() -> float:
    """Processor time of this process and of its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


class Spent:
    """Seconds of a scene's parts: of the clock, and of the processors where they are known."""

    def __init__(self, used: Callable[[], float | None], clock: Callable[[], float] = time.monotonic):
        """used: processor seconds of all of the study's processes; None: they are elsewhere"""
        self._used, self._clock = used, clock
        self.parts: dict[str, tuple[float, float | None]] = {}

    @contextlib.contextmanager
    def on(self, part: str) -> Iterator[None]:
        begun, before = self._clock(), self._used()
        try:
            yield
        finally:
            after = self._used()
            seconds, used = self.parts.get(part, (0.0, 0.0))
            self.parts[part] = (seconds + self._clock() - begun,
                                None if None in (used, before, after) else used + after - before)

    def rows(self, scene: str) -> list[dict]:
        """As results.json has them. processor_s: of all threads of all of the study's processes; None: not known"""
        return [{"scene": scene, "part": part, "s": round(seconds, 2), "processor_s": None if used is None else round(used, 2)}
                for part, (seconds, used) in self.parts.items()]

    def said(self) -> str:
        """In words: "61 s (100 s of processors): warm-up 20 s, rounds 41 s"; parts below a second are left out."""
        seconds = sum(each for each, _ in self.parts.values())
        used = [each for _, each in self.parts.values()]
        known = "" if None in used else f" ({sum(used):.0f} s of processors)"
        long = ", ".join(f"{part} {each:.0f} s" for part, (each, _) in self.parts.items() if each >= 1.0)
        return f"{seconds:.0f} s{known}" + (f": {long}" if long else "")
