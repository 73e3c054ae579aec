# SPDX-License-Identifier: Apache-2.0
"""Work items of a study: plain data in, plain data out, on whichever machine does them.

An item says what is to be done, by a method of Residents, with which scene and points, and what the
files that go into it hold; Residents does it, in processes that stay between items. The machine that asks and the one that
does it have the same build of Heddle. Paths below its folder are the machine's own, all others the same on every machine,
and contents are compared before anything is rendered: whoever has other ones refuses.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import functools
import hashlib
import json
import os
import pathlib
import platform
import selectors
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from . import Error, compare, version
from . import statistics as s
from ._library import find

WARM_FRAMES = 10  # the fewest that tell whether frames are still changing
# Milliseconds of frames after which a process has left its own beginning behind, caches and clocks: what changes then is the
# machine, and a longer wait would take as long as the rounds without ending that.
WARM_LONG_ENOUGH = 2000.0
PROFILED_FRAMES = 7
SEEDS = 8  # images of a technique that is random
# One for the machine, not for the user, whose TMPDIR may be another; the second where the first cannot be opened.
LOCK = pathlib.Path("/tmp/heddle-study.lock")
OWN_LOCK = pathlib.Path(tempfile.gettempdir()) / f"heddle-study-{os.getuid()}.lock"
CLOCKS = ("ms", "processor_ms")  # what a round has of each frame: submission to fence, and processors' time
# Processes that are no variant's.
AGAIN, REFERENCE = "(the first again)", "(reference)"
ROOT = pathlib.Path(__file__).resolve().parents[2]  # of the source tree, or PREFIX/lib/heddle
OWN = "heddle:"  # a path below ROOT
LIBRARY = "libheddle.so"


class Lost(Exception):
    """A process of a point crashed, hung, or said that it cannot."""

    def __init__(self, state: str, text: str, point: str = ""):
        super().__init__(text)
        self.state = state  # "crashed", "hung" or "failed"
        self.point = point


class Refused(Exception):
    """This machine cannot do an item as it is meant: it has other files, or another build."""


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
        """raises: Lost; after "crashed" and "hung" the process is gone. OSError if it could not write a file"""
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
        if "errno" in answer:
            raise OSError(answer["errno"], answer["error"])
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


# ---- Files ----

def digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:32]


def portable(file: str | pathlib.Path) -> str:
    """A path as all machines have it."""
    path = pathlib.Path(file).absolute()
    if path.resolve().is_relative_to(ROOT):
        return OWN + str(path.resolve().relative_to(ROOT))
    return str(path)


def own(file: str) -> str:
    """A portable path as this machine has it; what is no path, the name of a shipped graph, stays."""
    return str(ROOT / file.removeprefix(OWN)) if file.startswith(OWN) else file


class Contents:
    """Hashes of files, each read once, and again when it has changed."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[tuple[int, int], str]] = {}

    def of(self, files: Iterable[str]) -> dict[str, str]:
        """{portable path: hash}, of the library too, wherever it is"""
        return {LIBRARY: self._one(str(find()))} | {portable(file): self._one(file) for file in files}

    def known(self) -> dict[str, str]:
        """{file: hash} of all that was ever asked for."""
        return {file: content for file, (_, content) in self._known.items()}

    def _one(self, file: str) -> str:
        try:
            status = os.stat(file)
            stamp = (status.st_mtime_ns, status.st_size)
            if self._known.get(file, (None,))[0] != stamp:
                self._known[file] = (stamp, hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest())
        except OSError:  # a role's optional file that is not there
            return hashlib.sha256(b"").hexdigest()
        return self._known[file][1]


def check_contents(found: Mapping[str, str], expected: Mapping[str, str]) -> None:
    """raises: Refused, naming the first file that is not as it is where the study was begun"""
    for file in sorted({*found, *expected}):
        if found.get(file) != expected.get(file):
            what = ("is another one than" if file in found and file in expected else
                    "is read here, and not" if file in found else "is not read here, but")
            raise Refused(f"{own(file)} {what} where the study was begun")


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


@functools.lru_cache(maxsize=None)
def build() -> dict[str, str]:
    """Which Heddle this process is: whoever has the same one may do each other's items."""
    package = hashlib.sha256()
    for file in sorted(pathlib.Path(__file__).resolve().parent.rglob("*.py")):
        package.update(str(file.relative_to(pathlib.Path(__file__).resolve().parent)).encode() + b"\0" + file.read_bytes())
    return {"version": version(), "library": hashlib.sha256(find().read_bytes()).hexdigest()[:16],
            "package": package.hexdigest()[:16]}


@functools.lru_cache(maxsize=None)
def fingerprint(device: str | None) -> dict[str, Any]:
    """Of this machine with its drivers and its build. "id" is the same where times may be compared. raises: Lost"""
    with tempfile.TemporaryDirectory(prefix="heddle-study-") as folder:
        worker = Worker(pathlib.Path(folder) / "log", 120, lambda: None)
        try:
            devices = worker.ask("devices", device=device)["devices"]
        finally:
            worker.close()
    measured_with = {"machine": machine(), "devices": devices, "device": device, "HEDDLE_DEVICE": os.environ.get("HEDDLE_DEVICE")}
    return measured_with | {"id": digest(measured_with)[:8], "build": build(), "host": platform.node()}


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
        except OSError as own_error:
            say(f"warning: nor can {OWN_LOCK} ({own_error.strerror}): no study waits for another")
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


# ---- Who does them ----

class Residents:
    """The processes of a scene's variants on this machine. They are started when an item needs them and stay; one that is
    lost is started again by the next item."""

    def __init__(self, scene: Mapping[str, Any], device: str | None, timeout: float, folder: pathlib.Path,
                 stop: Callable[[], None], contents: Contents, most: int | None = None):
        self.scene, self.device, self.timeout, self.folder = scene, device, timeout, folder
        self.stop, self.contents = stop, contents
        self.most = most  # processes at once, where images are made; who is timed must stay
        self.workers: dict[str, Worker] = {}  # by variant
        self._files: dict[str, list[str]] = {}  # of the scene, by variant
        self._loaded: dict[tuple[str, str], None] = {}  # (variant, point)
        self.warm: dict[tuple[str, str], dict] = {}
        self._is_closed = False

    def do(self, item: Mapping[str, Any], truth: Mapping[str, Any] | None = None) -> Any:
        """raises: Lost, which names the point; Refused; OSError"""
        self.stop()
        return getattr(self, item["do"])(item, *([truth] if truth is not None else []))

    def check_open(self) -> None:
        """raises: Refused after close(), which another thread may call"""
        if self._is_closed:
            raise Refused("the study has ended meanwhile")

    def close(self) -> None:
        self._is_closed = True
        for worker in list(self.workers.values()):
            worker.process.kill()  # all of them, before any is waited for: they give back much memory
        for owner in list(self.workers):
            self._drop(owner)

    def end(self, owner: str) -> None:
        """A process that is not needed any more."""
        if owner in self.workers:
            self._drop(owner)

    def _drop(self, owner: str) -> None:
        self.workers.pop(owner).close()
        self._files.pop(owner, None)
        for each in [each for each in self._loaded if each[0] == owner]:
            del self._loaded[each]
            self.warm.pop(each, None)

    @contextlib.contextmanager
    def _losing(self, point: Mapping[str, Any]) -> Iterator[None]:
        try:
            yield
        except Lost as lost:
            for owner in [owner for owner, worker in self.workers.items() if worker.process.poll() is not None]:
                self._drop(owner)
            raise Lost(lost.state, str(lost), point["name"]) from None

    def _ask(self, of: Mapping[str, Any], do: str, **arguments: Any) -> dict:
        with self._losing(of):
            return self.workers[of["owner"]].ask(do, **arguments)

    def load(self, item: Mapping[str, Any], point: Mapping[str, Any]) -> None:
        """A point's graph in its variant's process, with the scene, both made of what the item expects."""
        self.check_open()
        owner = point["owner"]
        with self._losing(point):
            if owner not in self.workers:
                while self.most is not None and len(self.workers) >= self.most:
                    self._drop(next(iter(self.workers)))
                worker = self.workers[owner] = Worker(self.folder / "workers.log", self.timeout, self.stop)
                scene = {**self.scene, "file": own(self.scene["file"]), "overlays": [own(each) for each in self.scene["overlays"]]}
                self._files[owner] = self._begin(owner, worker, scene)
            if (owner, point["name"]) in self._loaded:
                return
            files = self.workers[owner].ask("load", point=point["name"], graph=own(point["graph"]),
                                            settings=point["settings"], keep=point["keep"],
                                            adds=point.get("adds"))["files"]
        check_contents(self.contents.of([*files, *self._files[owner]]), point["expected"])
        self._loaded[(owner, point["name"])] = None

    def _begin(self, owner: str, worker: Worker, scene: Mapping[str, Any]) -> list[str]:
        try:
            return worker.ask("open", scene=scene, device=self.device)["files"]
        except BaseException:  # else it would stay without a scene
            self._drop(owner)
            raise

    def warm_point(self, item: Mapping[str, Any]) -> dict:
        """{"ms": of a frame with all that is done for it, as estimates need it, "frames": that it took, "warm_after": of these,
        None: it never was}."""
        point = item["point"]
        self.load(item, point)
        place = (point["owner"], point["name"])
        if place in self.warm:
            return self.warm[place]
        first = self._ask(point, "render", point=point["name"], frames=2)["ms"]
        if first[1] > WARM_LONG_ENOUGH:
            found = {"frames": 2, "warm_after": 1, "ms": first[1]}  # recording is little of so much
        else:
            frames: list[float] = []
            for _ in range(3):  # never longer: what keeps changing is said, and measured as it is
                begun = time.monotonic()
                frames += self._ask(point, "render", point=point["name"], frames=WARM_FRAMES)["ms"]
                each = 1e3 * (time.monotonic() - begun) / WARM_FRAMES
                after = s.warm_up(frames)
                if after is not None or sum(frames) > WARM_LONG_ENOUGH:
                    break
            found = {"frames": len(frames) + 2, "warm_after": None if after is None else after + 2, "ms": each}
        self.warm[place] = found
        return found

    def image(self, item: Mapping[str, Any], seed: int) -> np.ndarray:
        """Of the item's point: float32 (height, width, channels)."""
        point = item["point"]
        self.load(item, point)
        file = self.folder / f".image.{os.getpid()}.{threading.get_ident()}.npy"
        try:
            self._ask(point, "render", point=point["name"], frames=item["settle"], seed=seed, cut=True)
            self._ask(point, "read", point=point["name"], port=item["port"], file=str(file))
            return np.load(file)
        finally:
            for left in self.folder.glob(f"{file.name}*"):  # a killed process leaves its partial one
                left.unlink(missing_ok=True)

    def part(self, item: Mapping[str, Any]) -> dict:
        begun = time.monotonic()
        return {"image": self.image(item, item["seed"]), "seconds": time.monotonic() - begun}

    def errors(self, item: Mapping[str, Any], truth: Mapping[str, Any]) -> dict:
        """{"seeds": {metric: [error]}, "parts": {metric: [error of the first seed with a part left out]}, "is_random",
        "image": of the first seed}.

        truth: {"whole": image, "without": [image with a part left out]}
        """
        result: dict = {"seeds": {m: [] for m in item["metrics"]}, "parts": {m: [] for m in item["metrics"]}, "is_random": True}
        first = None
        for seed in range(SEEDS):
            self.stop()
            image = self.image(item, seed)
            if seed == 1 and np.array_equal(image, first):
                result["is_random"] = False
                break
            for metric in item["metrics"]:
                result["seeds"][metric].append(self._error(item, image, truth["whole"], metric))
                if seed == 0:
                    result["parts"][metric] = [self._error(item, image, part, metric) for part in truth["without"]]
            if seed == 0:
                result["image"] = first = image
        return result

    def _error(self, item: Mapping[str, Any], image: np.ndarray, reference: np.ndarray, metric: str) -> float:
        try:
            return float(compare(image, reference, metric, exposures=item["exposures"], tone_mapper=item["tone_mapper"]))
        except Error as error:
            raise Lost("failed", str(error), item["point"]["name"]) from error

    def round(self, item: Mapping[str, Any]) -> dict:
        """The item's points in its order: {"ms": [[of a frame] of a turn], "processor_ms": the same of the processors' time,
        "others": [seconds of processors that other programs used, all that there were], "changing": {point: frames after which
        they still were}}."""
        by_name = {point["name"]: point for point in item["points"]}
        changing = {}
        for name, point in by_name.items():
            warm = self.warm_point({**item, "point": point})
            if warm["warm_after"] is None:
                changing[name] = warm["frames"]
        times, worked = [], []
        begun, busy, own_before = time.monotonic(), busy_seconds(), self._own_seconds()
        for name in item["order"]:
            self.stop()
            # The first frame of a turn finds caches that others have filled, and does not count.
            answer = self._ask(by_name[name], "render", point=name, frames=item["frames"] + 1)
            times.append(answer["ms"][1:])
            worked.append(answer["processor_ms"][1:])
        others = [(busy_seconds() - busy) - (self._own_seconds() - own_before),
                  (time.monotonic() - begun) * (os.cpu_count() or 1)]
        return {"ms": times, "processor_ms": worked, "others": others, "changing": changing}

    def profile(self, item: Mapping[str, Any]) -> dict:
        return self.ask({**item, "request": "profile", "arguments": {"frames": PROFILED_FRAMES}})

    def ask(self, item: Mapping[str, Any]) -> dict:
        """What study_worker.py answers to the item's request about its point."""
        point = item["point"]
        self.load(item, point)
        return self._ask(point, item["request"], point=point["name"], **item["arguments"])

    def forget(self, item: Mapping[str, Any]) -> None:
        """That point is not needed any more."""
        point = item["point"]
        place = (point["owner"], point["name"])
        if place in self._loaded:
            self._ask(point, "forget", point=point["name"])
            del self._loaded[place]
            self.warm.pop(place, None)

    def _own_seconds(self) -> float:
        return sum(used_seconds(pid) for pid in [os.getpid(), *[w.process.pid for w in self.workers.values()]])
