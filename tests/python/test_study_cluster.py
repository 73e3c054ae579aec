# SPDX-License-Identifier: Apache-2.0
"""Studies on many machines: what any worker makes is what this process makes, whoever dies meanwhile; who would make
something else refuses."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
from conftest import ROOT
from test_study import SMALL, options, run, table, written

import heddle
from heddle import study as definition
from heddle import study_cluster, study_items, study_run

# Of a worker: tests wait for no other study. Another build is one whose package differs.
PRELOAD = """\
import pathlib
from heddle import study_items
study_items.LOCK = pathlib.Path({lock!r})
if {is_other}:
    from heddle import study_cluster
    study_items.build = study_cluster.build = lambda: {{"version": "0", "library": "1", "package": "2"}}
"""


class Cluster:
    """A scheduler and workers without nannies, each a process."""

    def __init__(self, folder: pathlib.Path):
        self.folder, self.number = folder, 0
        self.workers: dict[str, subprocess.Popen] = {}  # by address
        self.environment = os.environ | {"PYTHONPATH": str(ROOT / "scripts")}
        self.file = folder / "scheduler.json"
        self.scheduler = self.start("dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file))
        self.wait(self.file.exists)

    def start(self, program, *words):
        with open(self.folder / f"{program}.log", "ab") as log:
            return subprocess.Popen([sys.executable, "-m", f"distributed.cli.{program}", *words], env=self.environment,
                                    stdout=log, stderr=log, cwd=self.folder)

    def wait(self, condition):
        while not condition():  # ends with the test, however slow the machine is
            assert self.scheduler.poll() is None, (self.folder / "dask_scheduler.log").read_text()
            time.sleep(0.1)

    def worker(self, is_other=False):
        self.number += 1
        preload = self.folder / f"preload_{self.number}.py"
        preload.write_text(PRELOAD.format(lock=str(self.folder / "lock"), is_other=is_other))
        process = self.start("dask_worker", "--scheduler-file", str(self.file), "--no-nanny", "--nthreads", "1", "--no-dashboard",
                             "--name", f"w{self.number}", "--local-directory", str(self.folder), "--preload", str(preload))
        self.workers[f"w{self.number}"] = process
        return process

    def by_address(self, client):
        return {address: self.workers[str(each["name"])] for address, each in client.scheduler_info()["workers"].items()}

    def close(self):
        for process in [*self.workers.values(), self.scheduler]:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.fixture(scope="module", autouse=True)
def lock_of_our_own(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_items, "LOCK", tmp_path_factory.mktemp("lock") / "lock")
        yield


def is_time(row):
    return row["unit"] in ("ms", "log ratio") or row["quantity"].startswith("memory process")


def without_times(rows):
    """All of a table but what depends on time and process; of times, which rows there are."""
    fixed = [row for row in rows if not is_time(row)]
    for row in fixed:
        row.pop("is_on_front")
    return fixed, [(row["variant"], row["knobs"], row["quantity"], row["state"], row["samples"], row["machine"])
                   for row in rows if is_time(row)]


@pytest.mark.skipif(not os.environ.get("HEDDLE_TEST_ALL"), reason="half a minute, and many on a busy machine: scripts/test --all")
def test_a_cluster_of_which_workers_are_killed_makes_the_same_table(cluster, tmp_path, monkeypatch, capfd):
    here = tmp_path / "here"
    here.mkdir()
    assert run(here) == 0
    killed, made = [], []
    connect = study_cluster.Cluster.__init__

    def connected(self, *words):
        made.append(self)
        connect(self, *words)

    def kill(address):
        """As the kernel does, in the middle of an item; another one comes."""
        process = cluster.by_address(made[0]._client)[address]
        process.send_signal(signal.SIGKILL)
        process.wait()
        killed.append(address)
        cluster.worker()

    put, append = study_run.Store.put, study_run.Store.append

    def put_error(self, key, value):
        put(self, key, value)
        if "seeds" in value and not killed:
            # Whoever is at the next image; else anybody.
            busy = [address for address, items in made[0]._client.processing().items() if items]
            kill((busy or list(made[0]._machines))[0])

    def append_round(self, key, value):
        append(self, key, value)
        if value["round"] == 2 and len(killed) == 1:
            kill(made[0]._place)

    monkeypatch.setattr(study_cluster.Cluster, "__init__", connected)
    monkeypatch.setattr(study_run.Store, "put", put_error)
    monkeypatch.setattr(study_run.Store, "append", append_round)
    for is_other in (False, False, True):
        cluster.worker(is_other)
    there = tmp_path / "there"
    there.mkdir()
    client = __import__("distributed").Client(scheduler_file=str(cluster.file), set_as_default=False)
    cluster.wait(lambda: len(client.scheduler_info()["workers"]) == 3)
    try:
        assert run(there, cluster=client.scheduler.address, quiet=False) == 0
    finally:
        client.close()
    said = capfd.readouterr().err
    assert len(killed) == 2 and killed[0] != killed[1], said
    assert said.count("is left out: it has another build of Heddle: {'version': '0'") == 1, said
    assert all(f"cluster: worker {address} is gone" in said for address in killed), said
    assert without_times(table(there)) == without_times(table(here))
    # What there is, the cluster does not do again; nor does this process, on the same machine.
    monkeypatch.setattr(study_items.Worker, "ask", lambda *_, **__: pytest.fail("nothing is left to do"))
    before = table(there)
    assert run(there) == 0
    assert table(there) == before


def test_a_scheduler_that_is_not_there_is_said(tmp_path):
    with pytest.raises(heddle.Error, match="the cluster 'tcp://127.0.0.1:9' cannot be reached: .*\n  expected: the address of a "
                                           "Dask scheduler") as raised:
        run(tmp_path, cluster="tcp://127.0.0.1:9", timeout=5)
    assert raised.value.status == 4
    with pytest.raises(heddle.Error, match="the cluster 'nonsense://' cannot be reached"):
        run(tmp_path, cluster="nonsense://")


def test_without_dask_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(heddle.Error, match="needs Dask distributed, which is not installed .*\n  help:     apt-get install "
                                           "python3-distributed") as raised:
        run(tmp_path, cluster="local")
    assert raised.value.status == 3


def test_whoever_has_other_files_refuses_and_names_them():
    expected = {"heddle:scripts/graphs/deferred.toml": "a", "/scenes/house.glb": "b"}
    study_items.check_contents(dict(expected), expected)
    for found, message in ((expected | {"/scenes/house.glb": "c"}, "/scenes/house.glb is another one than where"),
                           ({"/scenes/house.glb": "b"}, f"{ROOT}/scripts/graphs/deferred.toml is not read here, but where"),
                           (expected | {"/scenes/wall.png": "d"}, "/scenes/wall.png is read here, and not where")):
        with pytest.raises(study_items.Refused, match=message):
            study_items.check_contents(found, expected)


def test_an_item_with_other_contents_is_refused_before_anything_is_rendered(host, tmp_path, monkeypatch):
    asked, ask = [], study_items.Worker.ask
    monkeypatch.setattr(study_items.Worker, "ask", lambda self, do, **a: asked.append(do) or ask(self, do, **a))
    scene = {"file": "heddle:scripts/scenes/cornell_box.py", "camera": "front", "time": 0.0, "overlays": [], "arguments": []}
    residents = study_items.Residents(scene, None, 60, tmp_path, lambda: None, study_items.Contents())
    point = {"name": "few", "owner": "few", "graph": "studio", "settings": ["extent=[32,18]"], "keep": "ao.visibility",
             "expected": {study_items.LIBRARY: "another"}}
    try:
        with pytest.raises(study_items.Refused, match="where the study was begun"):
            residents.do({"do": "part", "scene": scene, "port": "ao.visibility", "settle": 1, "point": point, "seed": 0})
    finally:
        residents.close()
    assert asked == ["open", "load"]


def test_paths_below_the_folder_of_heddle_are_each_machine_s_own(tmp_path, monkeypatch):
    assert study_items.portable(ROOT / "scripts" / "scenes" / "atrium.py") == "heddle:scripts/scenes/atrium.py"
    monkeypatch.chdir(tmp_path)
    assert study_items.portable("house.glb") == str(tmp_path / "house.glb")
    monkeypatch.setattr(study_items, "ROOT", pathlib.Path("/opt/heddle"))
    assert study_items.own("heddle:scripts/scenes/atrium.py") == "/opt/heddle/scripts/scenes/atrium.py"
    assert study_items.own("deferred") == "deferred"


def test_times_of_two_machines_are_never_compared(host, tmp_path, monkeypatch):
    study = definition.read(host, written(tmp_path, SMALL))

    class Executor:
        machine = "first"

        def place(self):
            return {"id": self.machine}

    executor = Executor()
    store = study_run.Store(tmp_path)
    scene = study_run.SceneRun(study, study.scenes[0], store, options(), tmp_path, host, executor, study_items.Contents(),
                               print, lambda: None, 0.0)
    scene.keys = {point.name: point.name for point in study.points}
    line = {"order": ["few", study_items.AGAIN], "ms": [[1.0], [2.0]], "processor_ms": [[1.0], [2.0]], "keys": {"few": "few", study_items.AGAIN: "few"}}
    store.append(scene.times_key(), line)
    assert [each["order"] for each in scene.finished_rounds()] == [["few", study_items.AGAIN]]
    executor.machine = "second"
    assert scene.finished_rounds() == []
    executor.machine = "first"
    scene.keys["few"] = "changed"
    assert not any(each["order"] for each in scene.finished_rounds())


def test_a_scheduler_that_ends_is_said_and_nothing_waits_for_it(tmp_path):
    made = Cluster(tmp_path)
    try:
        made.worker()
        client = __import__("distributed").Client(scheduler_file=str(made.file), set_as_default=False)
        address = client.scheduler.address
        client.close()
        executor = study_cluster.Cluster(address, None, 60.0, print, lambda: None)
        made.scheduler.kill()
        made.scheduler.wait()
        executor._timeout = 1.0
        scene = {"file": "heddle:scripts/scenes/cornell_box.py", "camera": "front", "time": 0.0, "overlays": [], "arguments": []}
        item = {"do": "part", "scene": scene, "device": None, "timeout": 60.0, "port": "ao.visibility", "settle": 1, "seed": 0,
                "point": {"name": "few", "owner": "few", "graph": "studio", "settings": [], "keep": None, "expected": {}}}
        for ask in (lambda: list(executor.run([item])), lambda: executor.at_place(item)):
            with pytest.raises(heddle.Error, match="the cluster's scheduler is gone: .*\n  help:     what was measured is kept"):
                ask()
        executor.close()
    finally:
        made.close()
