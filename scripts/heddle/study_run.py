# SPDX-License-Identifier: Apache-2.0
"""Running a study: variants in processes of their own that take turns, errors apart from times, everything kept.

What is measured is kept in FOLDER/measured under names that say what went into it (contents of libraries, graphs, shaders,
scenes, settings, machine), each file whole or not there; what is there is not measured again, so that a study that was
interrupted goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import errno
import fcntl
import hashlib
import io
import json
import math
import os
import pathlib
import selectors
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from . import Error, Host, compare, metrics, version
from . import statistics as s
from . import study as definition
from . import study_images as images
from ._library import CANCELLED, find
from .study import Point, SceneChoice, Study, slug

WARM_FRAMES = 10  # the fewest that tell whether frames are still changing
PROFILED_FRAMES = 7
SEEDS = 8  # images of a technique that is random
# One for the machine, not for the user, whose TMPDIR may be another; the second where the first cannot be opened.
LOCK = pathlib.Path("/tmp/heddle-study.lock")
OWN_LOCK = pathlib.Path(tempfile.gettempdir()) / f"heddle-study-{os.getuid()}.lock"
# Workers that are no variant's.
AGAIN, REFERENCE = "(the first again)", "(reference)"


class Lost(Exception):
    """A worker crashed, hung, or said that it cannot."""

    def __init__(self, state: str, text: str):
        super().__init__(text)
        self.state = state  # "crashed", "hung" or "failed"


class Worker:
    """study_worker.py in a process of its own. What it prints goes to a file."""

    def __init__(self, log: pathlib.Path, timeout: float, stop: Callable[[], None]):
        self.timeout, self.stop = timeout, stop
        self._log = open(log, "ab")
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(
            [str(pathlib.Path(__file__).resolve().parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])}
        # A session of its own: Ctrl-C is the study's, which ends its workers where nothing is half done.
        self.process = subprocess.Popen([sys.executable, "-m", "heddle.study_worker"], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=self._log, env=environment, start_new_session=True)
        self._answers = b""

    def ask(self, do: str, **arguments: Any) -> dict:
        """raises: Lost; after "crashed" and "hung" the process is gone"""
        try:
            assert self.process.stdin is not None
            self.process.stdin.write(json.dumps({"do": do} | arguments).encode() + b"\n")
            self.process.stdin.flush()
            answer = json.loads(self._line())
        except (BrokenPipeError, EOFError):
            code = self.process.wait()
            self.close()
            what = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit status {code}"
            raise Lost("crashed", f"the process ended {what}; what it said is in {self._log.name}") from None
        except TimeoutError:
            self.close()
            raise Lost("hung", f"no answer for {self.timeout:g} s (--timeout); what it said is in {self._log.name}") from None
        if "error" in answer:
            raise Lost("failed", answer["error"])
        return answer

    def _line(self) -> bytes:
        deadline = time.monotonic() + self.timeout
        with selectors.DefaultSelector() as selector:
            pipe = self.process.stdout
            assert pipe is not None
            selector.register(pipe, selectors.EVENT_READ)
            while b"\n" not in self._answers:
                if not selector.select(0.5):
                    self.stop()
                    if time.monotonic() > deadline:
                        raise TimeoutError
                    continue
                more = os.read(pipe.fileno(), 65536)
                if not more:
                    raise EOFError
                self._answers += more
        line, self._answers = self._answers.split(b"\n", 1)
        return line

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()
        self._log.close()


# ---- What is kept ----

def digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:32]


class Contents:
    """Hashes of files, each read once."""

    def __init__(self) -> None:
        self._known: dict[str, str] = {}

    def of(self, files: Sequence[str]) -> list[str]:
        return [self._one(file) for file in sorted(files)]

    def known(self) -> dict[str, str]:
        """{file: hash} of all that was ever asked for."""
        return dict(self._known)

    def _one(self, file: str) -> str:
        if file not in self._known:
            try:
                content = pathlib.Path(file).read_bytes()
            except OSError:  # a role's optional file that is not there
                content = b""
            self._known[file] = hashlib.sha256(content).hexdigest()
        return self._known[file]


class Store:
    """FOLDER/measured: JSON by key, whole or not there."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder / "measured"
        self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, key: str, ending: str = ".json") -> pathlib.Path:
        return self.folder / f"{key}{ending}"

    def get(self, key: str) -> Any:
        try:
            return json.loads(self.path(key).read_text())
        except (OSError, ValueError):
            return None

    def put(self, key: str, value: Any) -> Any:
        write(self.path(key), json.dumps(value))
        return value

    def lines(self, key: str) -> list[Any]:
        """What append() wrote; a last line that is not whole is left out."""
        try:
            text = self.path(key, ".jsonl").read_text()
        except OSError:
            return []
        return [json.loads(line) for line in text.split("\n")[:-1]]

    def append(self, key: str, value: Any) -> None:
        path = self.path(key, ".jsonl")
        if path.exists() and not path.read_bytes().endswith(b"\n") and path.stat().st_size:
            kept = path.read_bytes().rpartition(b"\n")
            path.write_bytes(kept[0] + kept[1])  # what an interrupted run left half written
        with open(path, "a") as file:
            file.write(json.dumps(value) + "\n")
            file.flush()
            os.fsync(file.fileno())


def write(path: pathlib.Path, text: str) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.write_text(text)
    partial.replace(path)


# ---- The machine ----

def machine() -> dict[str, Any]:
    """What times depend on, beside the device."""
    model = ""
    with contextlib.suppress(OSError):
        for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    return {"processor": model, "processors": os.cpu_count(), "system": f"{os.uname().sysname} {os.uname().release}"}


def busy_seconds() -> float:
    """Processor time that the whole machine has used, stolen by its host included."""
    with contextlib.suppress(OSError, ValueError):
        user, nice, system, _idle, _wait, irq, softirq, steal = map(
            int, pathlib.Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9])
        return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")
    return 0.0


def used_seconds(process: int) -> float:
    with contextlib.suppress(OSError, ValueError, IndexError):
        fields = pathlib.Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def open_lock(path: pathlib.Path) -> int:
    """A descriptor of a file that is made if it is not there. A file of another user is opened to be read, which is enough
    for a lock: Linux refuses O_CREAT of such a file in /tmp (fs.protected_regular). raises: OSError"""
    flags = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK  # neither a link elsewhere nor a pipe that nobody writes
    for _ in range(10):
        with contextlib.suppress(FileNotFoundError):
            return os.open(path, os.O_RDONLY | flags)
        with contextlib.suppress(FileExistsError):  # another study was faster
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | flags, 0o644)
            with contextlib.suppress(OSError):
                os.fchmod(descriptor, 0o644)  # whatever the umask: other users' studies wait too
            return descriptor
    raise OSError(errno.EAGAIN, "it comes and goes")


@contextlib.contextmanager
def timing_alone(say: Callable[[str], None], stop: Callable[[], None]) -> Iterator[None]:
    """One study times on a machine at once."""
    try:
        lock, descriptor = LOCK, open_lock(LOCK)
    except OSError as error:
        say(f"warning: the machine's lock {LOCK} cannot be opened ({error.strerror}): other users' studies may time meanwhile")
        try:
            lock, descriptor = OWN_LOCK, open_lock(OWN_LOCK)
        except OSError as own:
            say(f"warning: nor can {OWN_LOCK} ({own.strerror}): no study waits for another")
            yield
            return
    try:
        is_said = False
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not is_said:
                    say(f"another study is timing on this machine ({lock}); waiting for it")
                    is_said = True
                stop()
                time.sleep(0.2)
        yield
    finally:
        os.close(descriptor)


# ---- A scene of a study ----

class SceneRun:
    """All that is measured on one scene. Points that are lost have a state other than "ok", and the others go on."""

    def __init__(self, study: Study, scene: SceneChoice, store: Store, options: argparse.Namespace, folder: pathlib.Path,
                 contents: Contents, say: Callable[[str], None], stop: Callable[[], None], deadline: float):
        self.study, self.scene, self.store, self.options, self.folder = study, scene, store, options, folder
        self.contents, self.say, self.stop = contents, say, stop
        self.deadline = deadline  # of time.monotonic(): the study's budget ends
        self.workers: dict[str, Worker] = {}  # by variant, AGAIN for the first variant's double
        self.state: dict[str, tuple[str, str]] = {point.name: ("ok", "") for point in study.points}
        self.keys: dict[str, str] = {}  # what a point's images depend on
        self.scene_files: list[str] = []
        self.devices: list[dict] = []
        self.warm: dict[str, dict] = {}
        self.measured: dict[str, dict] = {}  # profile() of points
        self.errors: dict[str, dict[str, dict]] = {}
        self.rounds: list[dict] = []
        self.foreign: float | None = None  # share of the processors that other programs used while rounds were timed
        self.kept: dict[str, str] = {}  # keys of images.load(): the first seed of points, and REFERENCE
        self.explained: dict[str, str] = {}  # keys of the store: how points' frames were planned
        self.changing: dict[str, int] = {}  # frames of the warm-up of points that were still changing after them

    def close(self) -> None:
        for worker in self.workers.values():
            worker.process.kill()  # all of them, before any is waited for: they give back much memory
        for worker in self.workers.values():
            worker.close()
        self.workers.clear()

    def alive(self) -> list[Point]:
        return [point for point in self.study.points if self.state[point.name][0] == "ok"]

    # Workers

    def start(self, owner: str) -> Worker:
        """A worker with the scene, under a variant's name."""
        worker = Worker(self.folder / "workers.log", self.options.timeout, self.stop)
        scene = {"file": self.scene.file, "camera": self.scene.camera, "time": self.scene.time,
                 "overlays": list(self.scene.overlays)}
        try:
            opened = worker.ask("open", scene=scene, device=self.options.device)
            self.scene_files, self.devices = opened["files"], opened["devices"]
        except BaseException:
            worker.close()
            raise
        self.workers[owner] = worker
        return worker

    def load_points(self) -> None:
        """Every point's graph in its variant's process; keys of what they will be."""
        for point in self.study.points:
            self.guard(point, lambda point=point: self.load(point, point.variant))
        if not self.alive():  # nothing can be measured: the scene, the device, or all settings are wrong
            state, text = self.state[self.study.points[0].name]
            raise Error(2 if state == "failed" else 4, f"{self.scene.where}: error: nothing of scene '{self.scene.name}' can be "
                        f"rendered\n    " + text.replace("\n", "\n    "))
        self.say(f"{self.scene.name}: {len(self.alive())} points are loaded")

    def load(self, point: Point, owner: str) -> None:
        worker = self.workers[owner] if owner in self.workers else self.start(owner)
        files = worker.ask("load", point=point.name, graph=point.graph, settings=list(point.settings), keep=self.study.port)
        self.keys[point.name] = self.key_of(point.graph, point.settings, files["files"])

    def key_of(self, graph: str, settings: Sequence[str], files: Sequence[str]) -> str:
        return digest("image", self.contents.of([str(find()), *files, *self.scene_files]), settings, self.scene.camera,
                      self.scene.time, self.study.port, self.study.settle, self.options.device,
                      os.environ.get("HEDDLE_DEVICE"), self.devices)

    def guard(self, point: Point, work: Callable[[], Any]) -> Any:
        """Runs work for a point. What a lost worker took with it is loaded again for the others; the point is not."""
        try:
            self.stop()
            return work()
        except Lost as lost:
            self.state[point.name] = (lost.state, str(lost))
            self.say(f"{self.scene.name}: {point.name} {lost.state}: {lost}")
            if lost.state != "failed":
                for owner in [owner for owner, worker in self.workers.items() if worker.process.poll() is not None]:
                    self.revive(owner)
            return None

    def revive(self, owner: str) -> None:
        self.workers.pop(owner).close()
        points = [self.study.points[0]] if owner == AGAIN else [p for p in self.study.points if p.variant == owner]
        for other in points:
            if self.state[other.name][0] == "ok":
                try:
                    self.load(other, owner)
                except Lost as lost:
                    self.state[other.name] = (lost.state, str(lost))
                    self.say(f"{self.scene.name}: {other.name} {lost.state}: {lost}")

    # Warm-up and what it will take

    def warm_up(self) -> None:
        for point in self.alive():
            self.guard(point, lambda point=point: self.warm_point(point, point.variant))

    def warm_point(self, point: Point, owner: str) -> None:
        ask = self.workers[owner].ask
        first = ask("render", point=point.name, frames=2)["ms"]
        # Frames of seconds have long left their beginning behind, and ten of them would take as long as the study.
        if first[1] > 2000:
            self.warm[point.name] = {"frames": 2, "warm_after": 1, "ms": first[1]}
            return
        frames: list[float] = []
        for _ in range(3):  # never longer: what keeps changing is said, and measured as it is
            frames += ask("render", point=point.name, frames=WARM_FRAMES)["ms"]
            after = s.warm_up(frames)
            if after is not None:
                break
        self.warm[point.name] = {"frames": len(frames) + 2, "warm_after": None if after is None else after + 2,
                                 "ms": float(np.median(frames[len(frames) // 2:]))}

    def estimate_seconds(self) -> float:
        """Of what is not measured yet: rounds, profiles and images. The reference is known once its first part is there."""
        points = self.alive()
        frame = {point.name: self.warm[point.name]["ms"] / 1e3 for point in points}
        if not points:
            return 0.0
        turns = [*points, points[0]]
        rounds = self.study.rounds - len(self.finished_rounds())
        seconds = max(rounds, 0) * 2 * (self.study.frames + 1) * sum(frame[point.name] for point in turns)
        for point in points:
            if self.store.get(self.profile_key(point)) is None:
                seconds += (PROFILED_FRAMES + 1) * frame[point.name]
            if self.study.reference is not None and self.store.get(self.images_key(point)) is None:
                seconds += SEEDS * self.study.settle * frame[point.name]
        return seconds

    def check_budget(self, rest: float) -> None:
        """Before anything is timed: a study that would take longer than it may says so now."""
        if time.monotonic() + rest > self.deadline:
            raise Error(2, f"error: this study would take about {duration(rest)} more; its budget is "
                           f"{self.study.budget_minutes:g} min\n  help:     --budget MINUTES; or fewer rounds, frames, scenes or "
                           "values of knobs, smaller images, a cheaper reference. What was measured is kept")

    # Errors

    def reference_images(self) -> list[np.ndarray]:
        """The independent parts of the reference; one if it has no randomness."""
        reference = self.study.reference
        assert reference is not None
        worker = self.workers.get(REFERENCE) or self.start(REFERENCE)
        files = worker.ask("load", point=REFERENCE, graph=reference.graph, settings=list(reference.settings),
                           keep=self.study.port)["files"]
        key = self.key_of(reference.graph, reference.settings, files)
        parts: list[np.ndarray] = []
        for part in range(reference.parts):
            self.stop()
            # Seeds of techniques begin at 0: noise is never compared with itself.
            seed = 1_000_000 + part
            file = self.store.path(digest("part", key, seed), ".npy")
            if not file.exists():
                begun = time.monotonic()
                worker.ask("render", point=REFERENCE, frames=self.study.settle, seed=seed, cut=True)
                worker.ask("read", point=REFERENCE, port=self.study.port, file=str(file))
                if part == 0 and reference.parts > 1:
                    rest = (time.monotonic() - begun) * (reference.parts - 1)
                    self.say(f"{self.scene.name}: the reference takes {duration(rest)} more at most")
                    self.check_budget(rest + self.estimate_seconds())
            parts.append(np.load(file))
            if part == 1 and np.array_equal(parts[0], parts[1]):
                return parts[:1]
        return parts

    def measure_errors(self) -> None:
        """Errors of every point against the reference, per seed and with each part of the reference left out."""
        if self.study.reference is None:
            return
        try:
            parts = self.reference_images()
        except Lost as lost:
            self.say(f"{self.scene.name}: the reference {lost.state}: {lost}")
            for point in self.study.points:
                self.state[point.name] = (lost.state, f"the reference: {lost}")
            return
        finally:
            if REFERENCE in self.workers:
                self.workers.pop(REFERENCE).close()
        stack = np.stack(parts).astype(np.float64)
        total = stack.sum(axis=0)
        whole = (total / len(parts)).astype(np.float32)
        without = [((total - part) / (len(parts) - 1)).astype(np.float32) for part in stack] if len(parts) > 1 else []
        np.save(self.folder / f"reference_{slug(self.scene.name)}.npy", whole)
        self.kept[REFERENCE] = digest("kept", images.fingerprint(whole))
        if images.head_of(self.folder, self.kept[REFERENCE]) is None:
            images.keep(self.folder, self.kept[REFERENCE], whole)
        known = {"reference": digest(hashlib.sha256(whole.tobytes()).hexdigest(), len(parts), self.study.metrics,
                                     self.study.exposures, self.study.tone_mapper, str(find()), self.contents.of([str(find())]))}
        for point in self.alive():
            key = digest("errors", self.keys[point.name], known["reference"], SEEDS)
            found = self.store.get(key)
            if found is None:
                found = self.guard(point, lambda point=point: self.errors_of(point, whole, without))
                if found is not None:
                    self.store.put(key, found)
            if found is not None:
                self.errors[point.name] = found
                self.guard(point, lambda point=point: self.keep_image(point))

    def keep_image(self, point: Point, image: np.ndarray | None = None) -> None:
        """Of the first seed, for the report. A study of before reports has errors without it: then it is rendered again."""
        key = self.kept[point.name] = digest("kept", self.keys[point.name])
        if images.head_of(self.folder, key) is not None:
            return
        if image is None:
            image = self.render_image(point, 0)
        images.keep(self.folder, key, image)

    def render_image(self, point: Point, seed: int) -> np.ndarray:
        ask = self.workers[point.variant].ask
        file = self.store.folder / f".image.{os.getpid()}.npy"
        ask("render", point=point.name, frames=self.study.settle, seed=seed, cut=True)
        ask("read", point=point.name, port=self.study.port, file=str(file))
        image = np.load(file)
        file.unlink()
        return image

    def images_key(self, point: Point) -> str:
        return digest("images", self.keys[point.name])

    def errors_of(self, point: Point, whole: np.ndarray, without: list[np.ndarray]) -> dict:
        """{"seeds": {metric: [error]}, "parts": {metric: [error of the first seed with a part left out]}, "is_random"}."""
        result: dict = {"seeds": {m: [] for m in self.study.metrics}, "parts": {m: [] for m in self.study.metrics},
                        "is_random": True}
        first = None
        for seed in range(SEEDS):
            self.stop()
            image = self.render_image(point, seed)
            if seed == 0:
                self.keep_image(point, image)
            if seed == 1 and np.array_equal(image, first):
                result["is_random"] = False
                break
            for metric in self.study.metrics:
                result["seeds"][metric].append(self.error(image, whole, metric))
                if seed == 0:
                    first = image
                    result["parts"][metric] = [self.error(image, part, metric) for part in without]
        self.store.put(self.images_key(point), {"point": point.name})
        return result

    def error(self, image: np.ndarray, reference: np.ndarray, metric: str) -> float:
        try:
            value = compare(image, reference, metric, exposures=self.study.exposures, tone_mapper=self.study.tone_mapper)
        except Error as error:
            raise Lost("failed", str(error)) from error
        return float(value)

    # Times

    def times_key(self) -> str:
        return digest("times", [self.keys.get(point.name) for point in self.study.points], machine(), self.study.frames)

    def finished_rounds(self) -> list[dict]:
        """Those in which everybody took part who is still there."""
        names = {point.name for point in self.alive()} | {AGAIN}
        return [each for each in self.store.lines(self.times_key()) if names <= set(each["order"])]

    def profile_key(self, point: Point) -> str:
        return digest("profile", self.keys[point.name], machine(), PROFILED_FRAMES)

    def measure_passes(self) -> None:
        """Pass by pass, apart from all other times: submitting stage by stage makes a frame slower."""
        for point in self.alive():
            key = self.profile_key(point)
            found = self.store.get(key)
            if found is None:
                found = self.guard(point, lambda point=point: self.workers[point.variant].ask(
                    "profile", point=point.name, frames=PROFILED_FRAMES))
                if found is not None:
                    self.store.put(key, found)
            if found is not None:
                self.measured[point.name] = found
            key = digest("explain", self.keys[point.name])
            if self.state[point.name][0] == "ok" and self.store.get(key) is None:
                explained = self.guard(point, lambda point=point: self.workers[point.variant].ask("explain", point=point.name))
                if explained is not None:
                    self.store.put(key, explained["explain"])
            self.explained[point.name] = key

    def measure_times(self) -> None:
        """Rounds of turns. A point that is lost on the way leaves; what it and the others finished stays."""
        points = self.alive()
        if len(self.finished_rounds()) < self.study.rounds and AGAIN not in self.workers and points:
            self.guard(points[0], lambda: self.load(points[0], AGAIN))
            self.guard(points[0], lambda: self.warm_point(points[0], AGAIN))
        while self.alive() and len(self.finished_rounds()) < self.study.rounds:
            self.time_round()
        self.rounds = self.store.lines(self.times_key())
        # Of all rounds, whichever run took them.
        others, passed = (sum(each["others"][i] for each in self.rounds if "others" in each) for i in (0, 1))
        if passed > 1:
            self.foreign = max(0.0, others / passed)
        for each in self.rounds:
            self.changing |= each.get("changing", {})

    def time_round(self) -> None:
        """One round, kept if nobody is lost in it."""
        points = self.alive()
        by_name = {point.name: (point.variant, point) for point in points} | {AGAIN: (AGAIN, self.study.points[0])}
        number = len(self.store.lines(self.times_key()))
        order = s.turns(list(by_name), 1, self.study.seed + number)[0]
        times = []
        begun, busy, own = time.monotonic(), busy_seconds(), self.own_seconds()
        for name in order:
            owner, point = by_name[name]
            # The first frame of a turn finds caches that others have filled, and does not count.
            answer = self.guard(point, lambda: self.workers[owner].ask(
                "render", point=point.name, frames=self.study.frames + 1))
            if answer is None:
                return
            times.append(answer["ms"][1:])
        # Seconds of processors: used by other programs, and all that there were.
        others = [(busy_seconds() - busy) - (self.own_seconds() - own), (time.monotonic() - begun) * (os.cpu_count() or 1)]
        changing = {name: warm["frames"] for name, warm in self.warm.items() if warm["warm_after"] is None}
        self.store.append(self.times_key(), {"round": number, "order": order, "ms": times, "others": others,
                                             "changing": changing})
        done = len(self.finished_rounds())
        if done in (1, self.study.rounds) or done % 5 == 0:
            self.say(f"{self.scene.name}: round {done} of {self.study.rounds}")

    def own_seconds(self) -> float:
        return sum(used_seconds(pid) for pid in [os.getpid(), *[w.process.pid for w in self.workers.values()]])


def duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


# ---- Rows ----

COLUMNS = ["study", "scene", "variant", "knobs", "state", "quantity", "unit", "value", "low", "high", "confidence", "samples",
           "against", "verdict", "difference", "difference_low", "difference_high", "floor", "smallest_seen", "is_on_front",
           "formula", "note"]


def rows_of(run: SceneRun) -> tuple[list[dict], list[str]]:
    """One row for each point and quantity, and what speaks against the machine."""
    study, rows = run.study, []
    baseline = study.points[0]
    better = {each["name"]: (each["better"], each["formula"]) for each in metrics()}

    def row(point: Point, quantity: str, unit: str, interval: s.Interval | None = None, samples: int = 0, **more: Any) -> None:
        state, text = run.state[point.name]
        rows.append({"study": study.name, "scene": run.scene.name, "variant": point.variant,
                     "knobs": " ".join(f"{knob}={value}" for knob, value in point.knobs), "state": state, "quantity": quantity,
                     "unit": unit, "samples": samples, "note": text.split("\n")[0] if state != "ok" else ""} | more)
        if interval is not None:
            rows[-1] |= {"value": interval.value, "low": interval.low, "high": interval.high,
                         "confidence": interval.confidence}

    def told(verdict: s.Verdict) -> dict[str, Any]:
        return {"against": baseline.name, "verdict": verdict.word, "difference": verdict.difference.value,
                "difference_low": verdict.difference.low, "difference_high": verdict.difference.high, "floor": verdict.floor,
                "smallest_seen": verdict.smallest_seen}

    values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
    # The first point itself may have been lost: then there is nothing to compare with.
    again = [each[AGAIN] - each[baseline.name] for each in values if baseline.name in each]
    floor, noise = (s.floor_of(again), s.reach(again)) if again else (0.0, 0.0)
    restless: list[str] = []
    for point in study.points:
        if run.state[point.name][0] != "ok":
            row(point, "frame", "ms")
            continue
        frames = [ms for each in run.rounds for name, turn in zip(each["order"], each["ms"]) if name == point.name for ms in turn]
        if frames:
            turns = [float(np.median(turn)) for each in run.rounds for name, turn in zip(each["order"], each["ms"])
                     if name == point.name]
            more: dict[str, Any] = {}
            if point is not baseline and again:
                both = [each for each in values if point.name in each and baseline.name in each]
                more = told(s.decide([each[point.name] - each[baseline.name] for each in both], floor,
                                     math.log1p(study.resolution), noise))
            row(point, "frame", "ms", s.median(turns), len(frames),
                formula="median over turns, submission to last fence; difference: of logarithms", **more)
            if point is baseline:
                restless = s.unrest(frames, floor, math.log1p(study.resolution), run.foreign)
                row(point, "frame noise floor", "log ratio", s.difference(again), len(again),
                    formula="the same variant against itself, in another process")
        if point.name in run.changing:
            restless.append(f"frames of {point.name} were still changing after {run.changing[point.name]} of them")
        if found := run.measured.get(point.name):
            for name, times in found["passes"].items():
                row(point, f"pass {name}", "ms", s.median(times), len(times), formula="submitted and waited for stage by stage")
            for name, value in found["memory"].items():
                row(point, f"memory {name}", "bytes", value=value)
            for name, value in found["counters"].items():
                if isinstance(value, (int, float)):
                    row(point, f"count {name}", "1", value=value)
        for metric, errors in run.errors.get(point.name, {}).get("seeds", {}).items():
            parts = run.errors[point.name]["parts"][metric]
            direction, formula = better.get(metric, ("lower", "P-th percentile of |a-b|, nearest rank"))
            compared = point is not baseline and baseline.name in run.errors
            if not is_finite(run.errors[point.name], metric):
                more = unmeasured(run, point, baseline, metric) if compared else {}
                row(point, metric, "1", samples=len(errors), formula=formula, **{"note": why_not_finite(errors)} | more)
                continue
            own = s.reference_floor(parts) if len(parts) > 1 else 0.0
            interval = error_interval(errors, own)
            more = {}
            if compared and is_finite(run.errors[baseline.name], metric):
                more = told(error_verdict(run, point, baseline, metric, direction))
            elif compared:
                more = unmeasured(run, point, baseline, metric)
            row(point, metric, "1", interval, len(errors), formula=formula, **more)
    return rows, restless


def made_by(run: SceneRun) -> dict:
    """What made a scene's numbers: enough to make any of them again, and to show its image and its frame."""
    reference = run.study.reference
    values = [s.round_values(each["order"], [float(np.median(turn)) for turn in each["ms"]]) for each in run.rounds]
    return {
        "scene": run.scene.name, "file": absolute(run.scene.file), "camera": run.scene.camera, "time": run.scene.time,
        "overlays": [absolute(each) for each in run.scene.overlays], "devices": run.devices, "device": run.options.device,
        "reference": None if reference is None else {
            "graph": absolute(reference.graph), "settings": list(reference.settings), "parts": reference.parts,
            "image": run.kept.get(REFERENCE)},
        "points": [{
            "name": point.name, "variant": point.variant, "knobs": [list(each) for each in point.knobs],
            "graph": absolute(point.graph), "settings": list(point.settings), "image": run.kept.get(point.name),
            "explained": run.explained.get(point.name),
            "device": run.measured.get(point.name, {}).get("device"),
        } for point in run.study.points],
        # Of each round the mean logarithm of milliseconds; the first point takes part twice.
        "rounds": [{name: round(value, 7) for name, value in each.items()} for each in values],
    }


def absolute(file: str) -> str:
    """A file's whole path; what comes with Heddle goes by its name."""
    path = pathlib.Path(file)
    return str(path.resolve()) if path.exists() else file


def command_line() -> str:
    """What was typed, as near as Python knows."""
    return shlex.join(["heddle", *sys.argv[1:]] if sys.argv[1:2] == ["study"] else ["heddle", "study"])


def is_finite(found: dict, metric: str) -> bool:
    return all(math.isfinite(each) for each in [*found["seeds"][metric], *found["parts"][metric]])


def why_not_finite(errors: Sequence[float]) -> str:
    if any(math.isnan(each) for each in errors):
        return "not a number"
    return "infinite: equal images" if any(math.isinf(each) for each in errors) else "infinite against a part of the reference"


def unmeasured(run: SceneRun, point: Point, baseline: Point, metric: str) -> dict[str, Any]:
    """The verdict where an error is not finite, as psnr is of equal images: such have no difference that could be measured."""
    a, b = (run.errors[each.name] for each in (baseline, point))
    if set(a["seeds"][metric]) == set(b["seeds"][metric]) == {math.inf}:
        return {"against": baseline.name, "verdict": s.SAME, "note": "infinite: both images equal the reference"}
    odd = point if not is_finite(b, metric) else baseline
    return {"against": baseline.name, "verdict": s.UNDECIDED,
            "note": f"{metric} of {odd.name} is {why_not_finite(run.errors[odd.name]['seeds'][metric])}"}


def error_interval(errors: Sequence[float], floor: float) -> s.Interval:
    """Of seeds, and of the reference's own variance on top of it."""
    middle = s.difference(errors) if len(errors) >= s.FEWEST_ROUNDS else s.median(errors)
    return s.Interval(middle.value, middle.low - floor, middle.high + floor, 1.0 - s.FALSE_VERDICTS)


def error_verdict(run: SceneRun, point: Point, baseline: Point, metric: str, direction: str) -> s.Verdict:
    """The rule of times: differences seed by seed, with the reference's own variance as the floor."""
    sign = -1.0 if direction == "higher" else 1.0
    a, b = (run.errors[each.name]["seeds"][metric] for each in (baseline, point))
    count = max(len(a), len(b), SEEDS)
    differences = [sign * (b[i % len(b)] - a[i % len(a)]) for i in range(count)]
    parts_a, parts_b = (run.errors[each.name]["parts"][metric] for each in (baseline, point))
    floor = s.reference_floor([y - x for x, y in zip(parts_a, parts_b)]) if len(parts_a) > 1 else 0.0
    verdict = s.decide(differences, floor, run.study.error_resolution * abs(float(np.median(a))))
    if sign > 0:
        return verdict
    # Told as it is: what is better has more of it.
    found = verdict.difference
    return definition.dataclasses.replace(
        verdict, difference=s.Interval(-found.value, -found.high, -found.low, found.confidence))


def mark_front(rows: list[dict], metric: str) -> None:
    """Which points of a scene no other one beats in both frame time and the error, by their middle values."""
    better = {each["name"]: each["better"] for each in metrics()}
    sign = -1.0 if better.get(metric) == "higher" else 1.0
    for scene in {row["scene"] for row in rows}:
        def values(quantity: str) -> dict[tuple, dict]:
            return {(row["variant"], row["knobs"]): row for row in rows
                    if row["scene"] == scene and row["quantity"] == quantity and row.get("value") is not None}
        times, errors = values("frame"), values(metric)
        points = {key: (times[key]["value"], sign * errors[key]["value"]) for key in times if key in errors}
        for key, (time_, error) in points.items():
            beaten = any(t <= time_ and e <= error and (t, e) != (time_, error) for t, e in points.values())
            errors[key]["is_on_front"] = not beaten


def write_table(folder: pathlib.Path, rows: list[dict], report: dict) -> None:
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write(folder / "results.csv", text.getvalue())
    write(folder / "results.json", json.dumps(report | {"rows": rows}, indent=1, default=str, allow_nan=False))


def finite(rows: list[dict]) -> list[dict]:
    """JSON has no infinity: what is not finite is left out."""
    return [{key: value for key, value in row.items() if not (isinstance(value, float) and not math.isfinite(value))}
            for row in rows]


# ---- The command ----

UNGATED = 4  # the status of a gate that came to no verdicts


def run_study(options: argparse.Namespace, stop: Callable[[], None]) -> int:
    """Answers the exit status. raises: Error; of a gate never with a status that is a verdict's"""
    try:
        return measure(options, stop)
    except Error as error:
        if options.gate and error.status != CANCELLED:
            raise Error(UNGATED, str(error)) from error
        raise
    except OSError as error:  # a disk that is full, a folder that may not be written
        raise Error(UNGATED, f"error: the study's files cannot be written or read: {error}\n  help:     what was measured "
                             "before is kept; the same command goes on from there") from error
    except Exception:
        if not options.gate:
            raise
        traceback.print_exc()  # Python's own status would be "worse"
        return UNGATED


def measure(options: argparse.Namespace, stop: Callable[[], None]) -> int:
    def say(text: str) -> None:
        if not options.quiet:
            print(text, file=sys.stderr, flush=True)

    with Host(options.device, log=lambda *_: None) as host:
        if options.role is not None:
            if not options.files:
                raise Error(2, "error: --role needs a scene\n  help:     heddle study --role ambient_occlusion atrium.py")
            study = definition.of_role(host, options.role, options.files, options.set)
        elif len(options.files) != 1 or options.set:
            raise Error(2, "error: heddle study takes one study file, or --role ROLE with scenes\n  found:    "
                           f"{len(options.files)} files" + (" and --set" if options.set else ""))
        else:
            study = definition.read(host, options.files[0])
    if options.rounds is not None and options.rounds < s.FEWEST_ROUNDS:
        raise Error(2, f"error: --rounds {options.rounds}\n  expected: at least {s.FEWEST_ROUNDS}: fewer decide nothing")
    study = definition.dataclasses.replace(study, **{key: value for key, value in (
        ("rounds", options.rounds), ("budget_minutes", options.budget)) if value is not None})
    folder = pathlib.Path(options.folder or pathlib.Path("out") / study.name)
    say(f"{study.title}: {len(study.scenes)} scenes, {len(study.points)} points, {study.rounds} rounds of "
        f"{study.frames} frames twice, {', '.join(study.metrics)} of {study.port}")
    if options.dry_run:
        for point in study.points:
            print(f"{point.name}: {' '.join(point.settings)}")
        return 0
    try:
        folder.mkdir(parents=True, exist_ok=True)
        store, contents = Store(folder), Contents()
    except OSError as error:
        raise Error(UNGATED, f"error: the folder '{folder}' for the results cannot be made: {error.strerror}\n"
                             "  help:     --folder says where they go") from error
    rows: list[dict] = []
    restless: dict[str, list[str]] = {}
    made: list[dict] = []
    begun = time.monotonic()
    for number, scene in enumerate(study.scenes):
        run = SceneRun(study, scene, store, options, folder, contents, say, stop, begun + 60 * study.budget_minutes)
        try:
            run.load_points()
            run.warm_up()
            rest = run.estimate_seconds() * (len(study.scenes) - number)  # other scenes take as long, for all that is known
            say(f"{scene.name}: about {duration(rest)} to go, and the reference; {study.budget_minutes:g} min at most")
            run.check_budget(rest)
            run.measure_errors()
            with timing_alone(say, stop):
                run.measure_times()
                run.measure_passes()
        finally:
            run.close()
        own, restless[scene.name] = rows_of(run)
        rows += own
        mark_front(rows, study.metrics[0])
        made.append(made_by(run))
        report = {"study": definition.dataclasses.asdict(study), "heddle": version(), "machine": machine(),
                  "restless": restless, "false_verdicts": s.FALSE_VERDICTS, "power": s.POWER,
                  "command": command_line(), "made_by": made, "files": contents.known()}
        write_table(folder, finite(rows), report)
    from . import report as page
    from . import study_chart

    chart = study_chart.draw(study, rows, folder)
    print_summary(study, rows, restless)
    for name in ("results.csv", "results.json"):
        say(f"wrote {folder / name}")
    say(f"wrote {chart}" if chart else study_chart.why_none(study, rows))
    say(f"wrote {page.write(folder)}")
    return gate(rows) if options.gate else (0 if all(row["state"] == "ok" for row in rows) else 4)


def gate(rows: list[dict]) -> int:
    """0, 1 "worse" or lost, 2 "undecided"."""
    verdicts = {row.get("verdict") for row in rows}
    if s.WORSE in verdicts or any(row["state"] != "ok" for row in rows):
        return 1
    return 2 if s.UNDECIDED in verdicts else 0


def print_summary(study: Study, rows: list[dict], restless: dict[str, list[str]]) -> None:
    for scene in dict.fromkeys(row["scene"] for row in rows):
        print(f"\n{scene}")
        print(f"  {'':<36} {'frame, ms':>28}   {study.metrics[0]:>36}")
        for point in study.points:
            key = (point.variant, " ".join(f"{knob}={value}" for knob, value in point.knobs))
            own = {row["quantity"]: row for row in rows if row["scene"] == scene and (row["variant"], row["knobs"]) == key}
            first = own.get("frame", {"state": "failed", "note": ""})
            if first["state"] != "ok":
                print(f"  {point.name:<36} {first['state']}: {first['note']}")
                continue
            print(f"  {point.name:<36} {cell(first):>28}   {cell(own.get(study.metrics[0], {})):>36}"
                  + (" *" if own.get(study.metrics[0], {}).get("is_on_front") else ""))
            for quantity in ("frame", *study.metrics):
                row = own.get(quantity, {})
                if row.get("verdict"):
                    if "difference" not in row:
                        print(f"      {quantity}: {row['verdict']} against {row['against']} ({row['note']})")
                        continue
                    scale = "" if quantity == "frame" else f" {row['unit']}" if row["unit"] != "1" else ""
                    print(f"      {quantity}: {row['verdict']} than {row['against']}" if row["verdict"] in (s.BETTER, s.WORSE)
                          else f"      {quantity}: {row['verdict']} against {row['against']}", end="")
                    print(f" ({spell(quantity, row['difference'])}, {spell(quantity, row['difference_low'])} to "
                          f"{spell(quantity, row['difference_high'])}; smallest seen {spell(quantity, row['smallest_seen'])})"
                          + scale)
        for text in restless.get(scene, []):
            print(f"  warning: {text}")
    print("\n* no other point beats it in both frame time and error. Intervals hold the true value with 95 % and more.")


def spell(quantity: str, value: float) -> str:
    if not math.isfinite(value):
        return "any"
    return f"{100 * math.expm1(value):+.1f} %" if quantity == "frame" else f"{value:+.3g}"


def cell(row: dict) -> str:
    if row.get("value") is None:
        return row.get("note") or "-"
    return f"{row['value']:.5g} ({row['low']:.4g} to {row['high']:.4g})"
