# SPDX-License-Identifier: Apache-2.0
"""Jobs as the command and the package run them: outputs, reports, exit status, signals, progress."""

import json
import os
import signal
import struct
import subprocess

import pytest

import heddle

from conftest import BUILD, default_signals

JOB = """kind = "job"
[[pass]]
name = "count"
role = "job_probe"
technique = "count"
"""
FRAMES = """extent = [8, 8]
output = "show.color"
[[pass]]
name = "show"
role = "job_probe"
technique = "show"
inputs.links = "job.toml#table"
"""
PLUGINS = f"{BUILD}/tests/plugins:{BUILD}/lib/heddle/plugins"
NUMBERS = struct.pack("8d", *range(1, 9))


class Folder:
    def __init__(self, path, command):
        self.path, self.command = path, command
        (path / "job.toml").write_text(JOB)
        (path / "frames.toml").write_text(FRAMES)
        self.environment = {**os.environ, "HEDDLE_CACHE": str(path / "cache")}

    def run(self, *arguments, **more):
        words = [self.command, *[str(word) for word in arguments], "--plugins", PLUGINS]
        return subprocess.run(words, env={**self.environment, **more}, capture_output=True, text=True, preexec_fn=default_signals)

    def files(self):
        return sorted((self.path / "cache" / "artifacts").iterdir())


@pytest.fixture
def folder(tmp_path, command):
    return Folder(tmp_path, command)


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDDLE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "job.toml").write_text(JOB)
    (tmp_path / "frames.toml").write_text(FRAMES)
    with heddle.Host(plugin_path=PLUGINS, log=lambda _severity, _text: None) as host:
        yield host


def test_the_command_runs_a_job_and_writes_what_it_leaves(folder):
    first = folder.run("run", folder.path / "job.toml", "--output", f"count.table={folder.path}/out/table.bin",
                       "--output", f"count.report={folder.path}/out/report.json", "--stats", folder.path / "stats.json")
    assert first.returncode == 0, first.stderr
    assert (folder.path / "out" / "table.bin").read_bytes() == NUMBERS
    rows = json.loads((folder.path / "out" / "report.json").read_text())
    assert rows[3] == {"level": "info", "message": "a slice is done", "values": {"slice": 3, "of": "count"}}
    assert first.stdout.splitlines()[3] == "count.report: info: a slice is done (slice 3, of count)"
    file, = folder.files()
    assert f"artifact 'count.table': made, 0.0 MiB, {file}" in first.stderr.splitlines()
    stats = json.loads((folder.path / "stats.json").read_text())
    assert stats["artifacts"][0]["file"] == str(file) and stats["reports"][0]["rows"] == rows
    again = folder.run("run", folder.path / "job.toml")
    assert f"artifact 'count.table': from the cache, 0.0 MiB, {file}" in again.stderr.splitlines()
    assert again.stdout == first.stdout and not (folder.path / "heddle.png").exists()
    assert f"artifact 'count.table': made, 0.0 MiB, {file}" in folder.run(
        "run", folder.path / "job.toml", "--remake").stderr.splitlines()


def test_an_error_of_a_report_is_the_exit_status(folder):
    for origin in ("made", "from the cache"):
        ran = folder.run("run", folder.path / "job.toml", "--set", "count.params.fails=true")
        assert ran.returncode == 1, ran.stderr
        assert f"artifact 'count.table': {origin}" in ran.stderr
        assert ran.stdout.splitlines()[-1] == "count.report: error: it was asked to fail (limit nan)"
        assert ran.stderr.splitlines()[-1].endswith(" s, 1 errors were reported")


def test_what_a_job_cannot_do_is_told(folder):
    ran = folder.run("run", folder.path / "job.toml", "--frames", "3")
    assert (ran.returncode, ran.stderr) == (
        2, f"error: --frames is for graphs of frames, and '{folder.path}/job.toml' is a job: it runs once\n")
    ran = folder.run("run", folder.path / "job.toml", "--output", "out.bin")
    assert (ran.returncode, ran.stderr) == (
        2, "error: the job leaves 2 things, and --output names none of them\n"
           "  expected: PASS.PORT=FILE with one of count.table, count.report\n")
    ran = folder.run("inspect", folder.path / "job.toml", "0,0")
    assert ran.returncode == 2 and "this graph is a job, and renders no frames" in ran.stderr


def test_an_output_of_a_job_that_fails_takes_no_other_one_with_it(folder):
    ran = folder.run("run", folder.path / "job.toml", "--output", "count.table=/proc/nowhere/table.bin",
                     "--output", f"count.report={folder.path}/report")  # bytes and rows need no extension
    assert ran.returncode == 4 and ran.stderr.splitlines()[-1] == "error: cannot write '/proc/nowhere/table.bin'"
    assert json.loads((folder.path / "report").read_text())
    named = folder.run("run", folder.path / "job.toml", "--output", "count.table")
    assert (named.returncode, named.stderr.splitlines()[0]) == (2, "error: --output 'count.table' is a port, and no file")


def test_a_killed_job_goes_on(folder):
    killed = folder.run("run", folder.path / "job.toml", HEDDLE_PROBE_KILL_AT="2")
    assert killed.returncode == -signal.SIGKILL
    assert [file.suffix for file in folder.files()] == [".artifact"], "what is unfinished is whole too"
    ran = folder.run("run", folder.path / "job.toml", "--output", f"count.table={folder.path}/table.bin")
    assert "pass 'count': stage 'count' goes on where an earlier run was stopped" in ran.stderr.splitlines()
    assert (folder.path / "table.bin").read_bytes() == NUMBERS
    assert len(folder.files()) == 1


def test_signals_stop_between_slices_and_the_next_run_goes_on(folder):
    stopped = folder.run("run", folder.path / "job.toml", HEDDLE_PROBE_INTERRUPT_AT="1")
    assert stopped.returncode == 130
    assert stopped.stderr.count("): slice ") == 2
    assert stopped.stderr.splitlines()[-2:] == [
        "pass 'count': what stage 'count' has done is kept; the next run goes on there", "stopped"]
    ran = folder.run("run", folder.path / "job.toml")
    assert ran.stderr.count("): slice ") == 2 and ran.returncode == 0


def test_scenes_in_python_are_inspected(folder):
    """A job of a scene that Python builds runs in Python: the same outputs, report and status, and the same cache."""
    (folder.path / "areas.toml").write_text('kind = "job"\n[[pass]]\nname = "areas"\nrole = "job_probe"\ntechnique = "areas"\n')
    scene = folder.path / "flat.py"
    for width, status in ((2.0, 0), (0.0, 1)):
        scene.write_text("def build(scene):\n"
                         f"    scene.instance(scene.mesh([[0, 0, 0], [{width}, 0, 0], [0, 1, 0]], scene.material(), "
                         "normals=[[0, 0, 1]] * 3))\n")
        for origin in ("made", "from the cache"):
            ran = folder.run("run", folder.path / "areas.toml", scene, "--output", f"areas.table={folder.path}/areas.bin",
                             "--output", f"areas.report={folder.path}/report.json")
            assert ran.returncode == status, ran.stderr
            assert f"artifact 'areas.table': {origin}, 0.0 MiB" in ran.stderr
            assert struct.unpack("d", (folder.path / "areas.bin").read_bytes()) == (width / 2,)
            assert len(json.loads((folder.path / "report.json").read_text())) == status
            assert ran.stdout == ("areas.report: error: a triangle has no area (triangle 0)\n" if status else "")
    assert len(folder.files()) == 2


def test_a_watched_job_runs_again_when_its_file_changes(folder):
    words = [folder.command, "run", str(folder.path / "job.toml"), "--plugins", PLUGINS, "--watch"]
    process = subprocess.Popen(words, env=folder.environment, stderr=subprocess.PIPE, text=True, preexec_fn=default_signals)
    lines = []

    def wait_for(text):
        for line in process.stderr:
            lines.append(line)
            if text in line:
                return
        raise AssertionError("".join(lines))

    try:
        wait_for("artifact 'count.table': made")
        (folder.path / "job.toml").write_text(JOB + "params.first = 9\n")
        wait_for("artifact 'count.table': made")
        (folder.path / "job.toml").write_text(JOB)
        wait_for("artifact 'count.table': from the cache")
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate()
    assert process.returncode == 130


def test_frames_say_where_their_artifacts_came_from(folder):
    for origin in ("made", "from the cache"):
        ran = folder.run("run", folder.path / "frames.toml", "--output", folder.path / "frame.exr")
        assert ran.returncode == 0, ran.stderr
        assert f"artifact 'job.toml#count.table': {origin}, 0.0 MiB" in ran.stderr.splitlines()


def test_check_explain_and_completion_know_jobs(folder):
    checked = folder.run("check", folder.path / "job.toml")
    assert checked.returncode == 0 and "nothing found" in checked.stdout, checked.stderr
    explained = folder.run("explain", folder.path / "job.toml")
    assert explained.stdout.startswith(f"{folder.path}/job.toml: a job; keeps 'count.table', 'count.report'\n")
    completed = subprocess.run([folder.command, "complete", "run", str(folder.path / "job.toml"), "--output", "count."],
                               env={**folder.environment, "HEDDLE_PLUGIN_PATH": f"{BUILD}/tests/plugins"}, capture_output=True, text=True)
    assert "count.table=" in completed.stdout and "count.report=" in completed.stdout


@pytest.mark.parametrize("words", [["check"], ["check", "--json"], ["explain"], ["explain", "--format", "json"],
                                   ["explain", "--why", "count"]], ids=" ".join)
def test_check_and_explain_of_jobs_take_scenes_in_python(folder, words):
    (folder.path / "nothing.py").write_text("def build(scene):\n    pass\n")
    without, of_python = [folder.run(words[0], folder.path / "job.toml", *scene, *words[1:])
                          for scene in ([], [folder.path / "nothing.py"])]
    assert of_python.returncode == 0, of_python.stderr
    assert of_python.stdout and sorted(of_python.stdout.split()) == sorted(without.stdout.split())


def test_python_runs_jobs(jobs, tmp_path):
    told = []
    with jobs.job(tmp_path / "job.toml", ["count.params.size=4"]) as job:
        result = job.run(progress=lambda activity, done: told.append((activity, done)))
        assert result["artifacts"][0]["origin"] == "made" and result["errors"] == 0
        assert struct.unpack("4d", job.artifact()) == (1, 2, 3, 4)
        assert [done for activity, done in told if activity == "stage 'count' of pass 'count'" and done > 0] == [0.25, 0.5, 0.75, 1]
        job.set("count.params.first", 5)
        job.run()
        assert struct.unpack("4d", job.artifact("count.table")) == (5, 6, 7, 8)
        with pytest.raises(heddle.Error, match="the job left no artifact 'count.tables'"):
            job.artifact("count.tables")
        assert job.get("kind") == "job"
    with pytest.raises(heddle.Error, match="this graph is a job, and renders no frames"):
        jobs.graph(tmp_path / "job.toml")
    with pytest.raises(heddle.Error, match="this graph renders frames, and is no job"):
        jobs.job(tmp_path / "frames.toml")


def test_what_progress_raises_ends_a_job_that_goes_on(jobs, tmp_path):
    class Enough(Exception):
        pass

    def stop(_activity, done):
        if done == 0.5:
            raise Enough

    said = []
    with jobs.job(tmp_path / "job.toml") as job:
        with pytest.raises(Enough):
            job.run(progress=stop)
        assert len(list((tmp_path / "cache" / "artifacts").iterdir())) == 1, "two slices are kept"
        assert job.run(progress=lambda _activity, done: said.append(done))["artifacts"][0]["origin"] == "made"
        assert [done for done in said if done > 0] == [0.75, 1.0]
        assert job.artifact() == NUMBERS


def test_a_schema_takes_jobs(jobs):
    schema = jobs.schema()
    assert schema["allOf"][0]["properties"]["kind"]["enum"] == ["frame", "job"]
    jsonschema = pytest.importorskip("jsonschema")
    passes = [{"role": "job_probe", "technique": "count", "inputs": {"base": "other.toml#count.table"}}]
    jsonschema.validate({"kind": "job", "pass": passes}, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"pass": passes}, schema)
