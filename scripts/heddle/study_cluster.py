# SPDX-License-Identifier: Apache-2.0
"""Items of a study on many machines, by Dask distributed: images and errors on any worker, times on one.

Workers are started by whoever runs the cluster, with the same build of Heddle on their PYTHONPATH; "local" starts some on this
machine for as long as the study takes. A worker that has another build or other files refuses, and is left out with its
reason. What a killed worker was at is done by another one. Times are taken on one worker as long as it is there, while the
study asks no other one for anything; when another machine takes over, what it measures is kept apart.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import pathlib
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from . import Error
from .study_items import Contents, Lost, Refused, Residents, build, fingerprint, timing_alone
from .study_run import Answer, Moved

TOPIC = "heddle-study"  # what workers say to people
ATTEMPTS = 5  # at one item, each ended by workers that died
MOVES = 20  # of the place that times
IDLE_SECONDS = 900.0  # after which the processes of a study that asks for nothing more are ended
IMAGE_PROCESSES = 2  # of variants at once in a thread of a worker that makes images


# ---- On a worker ----

_lock = threading.Lock()
_residents: dict[Any, tuple[tuple, Residents]] = {}  # of a thread that makes images, and of times
_reapers: dict[Any, threading.Timer] = {}
_contents = Contents()


@functools.lru_cache(maxsize=None)
def _folder() -> pathlib.Path:
    made = tempfile.mkdtemp(prefix="heddle-study-")
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return pathlib.Path(made)


def describe(device: str | None) -> dict:
    """Fingerprint of the worker's machine, or {"error"}."""
    try:
        return fingerprint(device)
    except (Lost, Error, OSError, ImportError) as error:
        return {"error": str(error)}


def perform(item: dict, is_timed: bool, asked_by: dict, truth: dict | None = None) -> dict:
    """What Residents says of an item: {"machine", "worker"} and "value", "lost" [state, text, point], "refused" or "errno" and
    "text". Everything that crosses is plain."""
    from distributed import get_worker

    worker = get_worker()
    answer: dict[str, Any] = {"worker": worker.address}

    def say(text: str) -> None:
        worker.log_event(TOPIC, f"{worker.address}: {text}")

    try:
        if build() != asked_by:
            raise Refused(f"it has another build of Heddle: {build()}, and the study {asked_by}")
        answer["machine"] = fingerprint(item["device"])["id"]
        owner = "times" if is_timed else threading.get_ident()
        residents = _take(owner, item, is_timed)
        try:
            with timing_alone(say, residents.check_open) if item["do"] in ("round", "profile") else contextlib.nullcontext():
                answer["value"] = residents.do(item, truth)
        finally:
            _give_back(owner)
    except Lost as lost:
        answer["lost"] = [lost.state, str(lost) + _last_words(lost), lost.point or item["point"]["name"]]
    except Refused as refused:
        answer["refused"] = str(refused)
    except OSError as error:
        answer |= {"errno": error.errno, "text": str(error)}
    return answer


def keep(truth: dict) -> dict:
    """The reference, on a worker: other workers get it from there, and Dask makes it again when that one is lost."""
    return truth


def end_residents() -> None:
    with _lock:
        for _, residents in _residents.values():
            residents.close()
        _residents.clear()
        for timer in _reapers.values():
            timer.cancel()
        _reapers.clear()


def _take(owner: Any, item: dict, is_timed: bool) -> Residents:
    scene = (repr(item["scene"]), item["device"], item["timeout"])
    with _lock:
        if owner in _reapers:
            _reapers.pop(owner).cancel()
        known = _residents.get(owner)
        if known is not None and known[0] != scene:
            known[1].close()
            known = None
        if known is None:
            known = (scene, Residents(item["scene"], item["device"], item["timeout"], _folder(), lambda: None, _contents,
                                      None if is_timed else IMAGE_PROCESSES))
            _residents[owner] = known
        return known[1]


def _give_back(owner: Any) -> None:
    """Nobody may come again: the study was killed, for instance."""
    def reap() -> None:
        with _lock:
            if _reapers.get(owner) is timer and owner in _residents:
                _residents.pop(owner)[1].close()

    timer = threading.Timer(IDLE_SECONDS, reap)
    timer.daemon = True
    with _lock:
        _reapers[owner] = timer
    timer.start()


def _last_words(lost: Lost) -> str:
    """Who reads that cannot open the worker's file."""
    log = _folder() / "workers.log"
    if lost.state == "failed" or not log.exists():
        return ""
    return "\n" + "\n".join(log.read_text(errors="replace").splitlines()[-5:])


# ---- Who asks ----

class Cluster:
    """Does items on the workers of a Dask scheduler. The interface is that of study_run.Here."""

    def __init__(self, address: str, device: str | None, timeout: float, say: Callable[[str], None], stop: Callable[[], None]):
        try:
            import dask
            import distributed
        except ImportError as error:
            raise Error(3, f"error: --cluster needs Dask distributed, which is not installed ({error})\n"
                           "  help:     apt-get install python3-distributed, or pip install distributed") from error
        self._distributed, self._device, self._timeout, self._say, self._stop = distributed, device, timeout, say, stop
        self._local: Any = None
        self._machines: dict[str, dict] = {}  # fingerprints by address of workers
        self._seen: dict[str, dict] = {}  # by their ids, also of those that are gone
        self._refused: dict[str, str] = {}
        self._place: str | None = None
        self._moves = 0
        # Workers that were started as a help may take a while, and die without a word each time.
        dask.config.set({"distributed.comm.timeouts.connect": "20s"})
        try:
            if address == "local":
                # Processes of their own, so that one may die; rendering uses all processors as it is.
                self._local = distributed.LocalCluster(
                    n_workers=max(2, (os.cpu_count() or 1) // 2), threads_per_worker=1, processes=True, dashboard_address=None,
                    silence_logs=50)
                address = self._local.scheduler_address
            self._client = distributed.Client(address, timeout="20s", set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            if self._local is not None:
                self._local.close()
            raise Error(4, f"error: the cluster '{address}' cannot be reached: {error}\n  expected: the address of a Dask "
                           "scheduler, tcp://HOST:8786, or local") from error
        try:
            self._client.subscribe_topic(TOPIC, lambda event: self._say(f"cluster: {event[1]}"))
            self._wait_for_worker()
            self._say("cluster: " + ", ".join(f"{address} ({each['host']})" for address, each in self._machines.items()))
        except BaseException:
            self.close()
            raise

    @property
    def width(self) -> int:
        return max(1, len(self._machines))

    def machines(self) -> list[dict]:
        """Fingerprints of those that do items, or did, the one that times first."""
        place = self.place()
        return [place] + [each for each in self._seen.values() if each["id"] != place["id"]]

    def place(self) -> dict:
        """The fingerprint of the machine that times."""
        if self._place not in self._machines:
            self._wait_for_worker()
            # The first by name: the same one when the study goes on.
            self._place = min(self._machines, key=lambda address: (self._machines[address]["id"], address))
        return self._machines[self._place or ""]

    def run(self, items: Sequence[dict], truth: dict | None = None) -> Iterator[tuple[int, Answer]]:
        """The items by number with their answers, as they come. raises: Error, OSError"""
        kept = self._client.submit(keep, truth, pure=False) if truth is not None and items else None
        waiting = {self._submit(item, False, kept, None): i for i, item in enumerate(items)}
        attempts = [0] * len(items)
        try:
            while waiting:
                for future in self._finished(list(waiting)):
                    i = waiting.pop(future)
                    answer = self._answer(future)
                    if answer is None:
                        attempts[i] += 1
                        if attempts[i] >= ATTEMPTS:
                            raise Error(4, f"error: {ATTEMPTS} times the cluster's workers ended while they were at "
                                           f"'{items[i]['do']}' of {items[i]['point']['name']}\n  help:     their logs say why")
                    if answer is None or isinstance(answer, Refused):
                        waiting[self._submit(items[i], False, kept, None)] = i
                    else:
                        yield i, answer
                if waiting and self._is_stuck(waiting):
                    for future in [future for future in waiting if not future.done()]:
                        self._cancel(future)
                        i = waiting.pop(future)
                        waiting[self._submit(items[i], False, kept, None)] = i
        finally:
            for future in waiting:
                self._cancel(future)

    def at_place(self, item: dict) -> Answer:
        """Of an item that is timed. raises: Moved, Error, OSError"""
        machine = self.place()["id"]
        place = self._place
        future = self._submit(item, True, None, [place or ""])
        try:
            while not self._finished([future]):
                if place not in self._look():
                    self._move()
            answer = self._answer(future)
        finally:
            self._cancel(future)
        if answer is None or isinstance(answer, Refused) or answer.machine != machine:
            self._move()
        assert isinstance(answer, Answer)
        return answer

    def timing(self) -> contextlib.AbstractContextManager:
        """The worker's machine is locked by each item."""
        return contextlib.nullcontext()

    def used(self) -> float | None:
        """Of the processors of other machines nothing is known."""
        return None

    def end(self, owner: str) -> None:
        """Workers end what has become too much by themselves."""

    def close(self) -> None:
        with contextlib.suppress(Exception):  # whoever is gone needs no end
            self._client.run(end_residents, on_error="ignore")
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)
        if self._local is not None:
            with contextlib.suppress(Exception):
                self._local.close(timeout=5)

    # Workers that come and go

    def _look(self) -> dict[str, dict]:
        """Fingerprints of the workers that are there now; who is new is asked."""
        there = self._there()
        for address in set(self._machines) - there:
            self._say(f"cluster: worker {address} is gone")
            del self._machines[address]
        new = there - set(self._machines) - set(self._refused)
        if new:
            found = self._client.run(describe, self._device, workers=list(new), on_error="return")
            for address, each in found.items():
                if isinstance(each, BaseException) or "error" in each:
                    if isinstance(each, (ImportError, AttributeError)):
                        self._refuse(address, f"it cannot import Heddle ({each}): start it with PYTHONPATH={pathlib.Path(__file__).parents[1]}")
                    elif not isinstance(each, OSError):  # else it is gone again
                        self._refuse(address, str(each["error"] if isinstance(each, dict) else each))
                elif each["build"] != build():
                    self._refuse(address, f"it has another build of Heddle: {each['build']}, and here is {build()}")
                else:
                    self._machines[address] = each
                    self._seen.setdefault(each["id"], each)
        return self._machines

    def _there(self) -> set[str]:
        """Addresses of the scheduler's workers. raises: Error if it is gone"""
        deadline = time.monotonic() + self._timeout
        while True:
            reason = f"the connection is {self._client.status}"
            if self._client.status == "running":
                try:
                    return set(self._client.scheduler_info()["workers"])
                except (OSError, self._distributed.TimeoutError) as error:
                    reason = str(error)
            self._stop()
            if time.monotonic() > deadline or self._client.status == "closed":
                raise Error(4, f"error: the cluster's scheduler is gone: {reason}\n  help:     what was measured is kept; the same "
                               "command goes on from there, with another --cluster or without")
            time.sleep(0.2)

    def _refuse(self, address: str, reason: str) -> None:
        if address not in self._refused:
            self._refused[address] = reason
            self._say(f"cluster: worker {address} is left out: {reason}")
        self._machines.pop(address, None)

    def _wait_for_worker(self) -> None:
        deadline = time.monotonic() + self._timeout
        while not self._look():
            self._stop()
            known = self._there()
            if time.monotonic() > deadline or (known and known <= set(self._refused)):
                why = "".join(f"\n    {address}: {reason}" for address, reason in self._refused.items())
                raise Error(4, "error: no worker of the cluster can do the study" + (why or f"\n  found:    none in "
                            f"{self._timeout:g} s (--timeout)") + "\n  help:     PYTHONPATH=scripts dask-worker ADDRESS, or "
                            "python3 -m distributed.cli.dask_worker, on machines with the same build. What was measured is kept")
            time.sleep(0.2)

    def _move(self) -> None:
        self._place = None
        self._moves += 1
        if self._moves > MOVES:
            raise Error(4, f"error: {MOVES} times the worker that times was lost\n  help:     its log says why. What was "
                           "measured is kept")
        self.place()
        raise Moved

    # Items

    def _submit(self, item: dict, is_timed: bool, kept: Any, workers: list[str] | None) -> Any:
        if workers is None and self._refused:
            self._wait_for_worker()
            workers = list(self._machines)
        return self._client.submit(perform, item, is_timed, build(), kept, pure=False, workers=workers, allow_other_workers=False)

    def _cancel(self, future: Any) -> None:
        if self._client.status == "running":
            with contextlib.suppress(OSError, self._distributed.TimeoutError):  # the scheduler has gone with it
                future.cancel()

    def _finished(self, futures: list) -> list:
        """Those that are done; waits half a second for the first."""
        self._stop()
        for _ in range(10):
            if done := [future for future in futures if future.done()]:
                return done
            time.sleep(0.05)
        return []

    def _is_stuck(self, waiting: dict) -> bool:
        """Whether items wait for workers that are gone; waits itself while there is none at all."""
        before = set(self._machines)
        if not self._look():
            self._wait_for_worker()
        return bool(self._refused) and before - set(self._machines) != set()

    def _answer(self, future: Any) -> Answer | Refused | None:
        """None: its worker is gone. raises: OSError, Error"""
        if future.status == "cancelled":
            return None
        if future.status == "error":
            error = future.exception()
            if isinstance(error, (self._distributed.scheduler.KilledWorker, self._distributed.CancelledError, OSError)):
                return None
            raise Error(4, f"error: a worker of the cluster failed: {type(error).__name__}: {error}") from error
        found = future.result()
        if "refused" in found:
            self._refuse(found["worker"], found["refused"])
            return Refused(found["refused"])
        if "errno" in found:
            raise OSError(found["errno"], f"on worker {found['worker']}: {found['text']}")
        if "lost" in found:
            state, text, point = found["lost"]
            return Answer(found["machine"], lost=Lost(state, f"on worker {found['worker']}: {text}", point))
        return Answer(found["machine"], found["value"])
