# SPDX-License-Identifier: Apache-2.0
"""A variant of a study in a process of its own: does what it is told, line by line, and nothing in between.

A request is a JSON object with "do", the name of a method of Worker, and its arguments; the answer is a JSON object, or
{"error", "status"}. Whoever asks has its pipes as standard input and output; what else is printed goes to stderr. It ends
with its standard input.
"""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import pathlib
import random
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from . import Error, Graph, Host, Scene
from .__main__ import Update, imported_files, load_scene, scene_path, stays
from .study import extended


def open_scene(host: Host, described: Mapping[str, Any]) -> tuple[Scene, Update, list[str]]:
    """A scene with its overlays and camera, at its time, what moves it, and the files that it was made of.

    described: {"file", "arguments": [[name, value]] of a Python scene, "overlays", "camera": name or None, "time"}
    """
    scene = host.scene()
    try:
        update = load_scene(scene, described["file"], arguments=dict(described["arguments"]))
        for overlay in described["overlays"]:
            scene.load(overlay)
        cameras = scene.describe().get("cameras", [])
        if described["camera"] is not None:
            if described["camera"] not in cameras:
                raise Error(2, f"the scene has no camera '{described['camera']}'\n  expected: one of {', '.join(cameras)}")
            scene.use_camera(cameras.index(described["camera"]))
        update(scene, described["time"])
        own = {str(scene_path(described["file"])), str(pathlib.Path(__file__).with_name("shapes.py"))}
        return scene, update, sorted(own | {*described["overlays"], *scene.files(), *imported_files(described["file"])})
    except BaseException:
        scene.close()
        raise


def open_graph(host: Host, graph: str, settings: Sequence[str], adds: str | None = None) -> Graph:
    """A graph; adds: what stands behind its passes, as TOML. raises: Error"""
    return host.graph(graph, settings) if adds is None else host.parse(extended(graph, adds), f"{graph}, extended", "", settings)


def host_bytes() -> dict[str, int]:
    """Of this process, all graphs and the scene in it: what it holds now, and the most that it ever held."""
    found = {}
    for line in pathlib.Path("/proc/self/status").read_text().splitlines():
        for key, name in (("VmRSS:", "process_bytes"), ("VmHWM:", "process_peak_bytes")):
            if line.startswith(key):
                found[name] = 1024 * int(line.split()[1])
    return found


@contextlib.contextmanager
def placed_by_chance() -> Iterator[None]:
    """Meanwhile each thread of this process runs on one processor, which a coin chooses; then on any. Threads wake up where they
    ran last, and stay beside, or in the way of, what else runs there: without the coin that would be a process's own for a whole
    study, and two equal variants would differ by it."""
    allowed = sorted(os.sched_getaffinity(0))
    threads = [int(each) for each in os.listdir("/proc/self/task")]
    try:
        for thread in threads:
            with contextlib.suppress(OSError):  # it may have ended
                os.sched_setaffinity(thread, {random.choice(allowed)})
        yield
    finally:
        for thread in threads:
            with contextlib.suppress(OSError):
                os.sched_setaffinity(thread, allowed)


class Worker:
    def __init__(self) -> None:
        self.host: Host | None = None
        self.scene: Scene | None = None
        self.update: Update = stays
        self.time = 0.0
        self.graphs: dict[str, Graph] = {}

    def devices(self, device: str | None) -> dict:
        """The devices with their drivers that are there."""
        with Host(device, log=lambda *_: None) as host:
            return {"devices": host.devices()}

    def open(self, scene: dict, device: str | None) -> dict:
        """The host, and the scene with its overlays and camera. Answers with the files that it was made of, and the devices
        with their drivers that are there."""
        self.host = Host(device, log=lambda severity, text: print(text, file=sys.stderr) if severity < 2 else None)
        self.time = scene["time"]
        self.scene, self.update, files = open_scene(self.host, scene)
        return {"files": files, "devices": self.host.devices()}

    def load(self, point: str, graph: str, settings: list[str], keep: str | None, adds: str | None = None) -> dict:
        """A graph with its settings, and passes that it does not have, as TOML, under the name of a point. keep: the port that
        will be read. Plans nothing yet. Answers with its files."""
        assert self.host is not None
        made = self.graphs[point] = open_graph(self.host, graph, settings, adds)
        if keep is not None:
            made.keep(keep)
        return {"files": made.files()}

    def passes(self, point: str) -> dict:
        """What became of each pass in a frame: [{"name", "role", "technique", "is_pruned", "reason"}]."""
        graph = self.graphs[point]
        graph.render(self._scene(), time=self.time, anew=True)
        known = ("name", "role", "technique", "is_pruned", "reason")
        return {"passes": [{key: each[key] for key in known} for each in json.loads(graph.explain("json"))["passes"]],
                "output": graph.describe()["output"]}

    def render(self, point: str, frames: int, seed: int = 0, cut: bool = False) -> dict:
        """Frames that measure nothing but themselves: of each the milliseconds from submission to fence, and those that the
        processors worked for it in this process, all threads together."""
        graph, scene, times, worked = self.graphs[point], self._scene(), [], []
        for frame in range(frames):
            begun = time.process_time()
            with placed_by_chance() if frame == 0 else contextlib.nullcontext():
                graph.render(scene, time=self.time, seed=seed, cut=cut and frame == 0, anew=True)
            worked.append(1e3 * (time.process_time() - begun))
            times.append(graph.stats()["submit_ms"])
        return {"ms": times, "processor_ms": worked}

    def profile(self, point: str, frames: int) -> dict:
        """Frames that are submitted stage by stage: {pass: milliseconds of each frame}, memory and counters."""
        graph, passes = self.graphs[point], {}
        for _ in range(frames):
            graph.render(self._scene(), time=self.time, anew=True, profile=True)
            sums: dict[str, float] = {}
            for stage in graph.stats()["stages"]:
                sums[stage["pass"]] = sums.get(stage["pass"], 0.0) + stage["wall_ms"]
            for name, ms in sums.items():
                passes.setdefault(name, []).append(ms)
        graph.render(self._scene(), time=self.time, anew=True)
        stats = graph.stats()
        return {"passes": passes, "memory": stats["memory"] | host_bytes(), "counters": stats["counters"], "device": stats["device"],
                "counts": stats["counts"], "instances": stats["instances"]}

    def ports(self, point: str, of: str) -> dict:
        """Images that a pass makes."""
        ports = self.graphs[point].describe()["ports"]
        return {"images": [each["name"] for each in ports if each["type"] == "image" and each["name"].startswith(f"{of}.")]}

    def read(self, point: str, port: str, file: str) -> dict:
        """Writes a port of the last frame as an array of numpy, whole or not at all."""
        partial = pathlib.Path(f"{file}.{os.getpid()}.partial")
        pixels = self.graphs[point].read(port)
        try:
            content = io.BytesIO()  # np.save into a full disk says no reason
            np.save(content, pixels)
            partial.write_bytes(content.getbuffer())
            partial.replace(file)
        except OSError:
            partial.unlink(missing_ok=True)
            raise
        return {"shape": pixels.shape}

    def explain(self, point: str) -> dict:
        """How a frame is planned: its passes, which of them were dropped and why, what they read and write, memory."""
        self.graphs[point].render(self._scene(), time=self.time, anew=True)
        return {"explain": json.loads(self.graphs[point].explain("json"))}

    def forget(self, point: str) -> dict:
        self.graphs.pop(point).close()
        return {}

    def _scene(self) -> Scene:
        assert self.scene is not None
        return self.scene


def main() -> None:
    # The answers' pipe is nobody else's: what scenes or plugins print must not end up in it.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    worker = Worker()
    for line in sys.stdin:
        request: dict[str, Any] = json.loads(line)
        try:
            answer = getattr(worker, request.pop("do"))(**request)
        except Error as error:
            answer = {"error": str(error), "status": error.status}
        except OSError as error:  # of what the study writes: a disk that is full. Libraries and scenes raise Error
            answer = {"error": f"{error.strerror}: {error.filename or request.get('file', '')}", "errno": error.errno or errno.EIO}
        print(json.dumps(answer), file=answers, flush=True)
    if worker.host is not None:
        worker.host.close()


if __name__ == "__main__":
    main()
