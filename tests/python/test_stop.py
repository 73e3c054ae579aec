# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C and SIGTERM: the work stops where nothing is half done, with status 130; a second signal ends it at once."""

import json
import pathlib
import signal
import subprocess
import time

import pytest

import heddle
from conftest import default_signals

FRAMES = ["--set", "extent=[64,48]", "--frames", "100000", "--output"]
# One scene for the command itself, one that the command hands to Python.
SCENES = {"command": [], "python": ["scripts/scenes/material_grid.py"]}


def start(command, root, arguments):
    return subprocess.Popen([command, "run", "deferred", *arguments], cwd=root, stderr=subprocess.PIPE, text=True,
                            preexec_fn=default_signals)


def wait_for(condition, process):
    """Ends by itself only with the process: what is waited for comes, however slow the machine."""
    while not condition():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.01)


def catches(process, number):
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    caught = int(status.split("SigCgt:")[1].split()[0], 16)
    return bool(caught >> (number - 1) & 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("scene", SCENES)
def test_a_signal_stops_between_frames_and_leaves_whole_files(command, root, host, tmp_path, scene, number):
    process = start(command, root, [*SCENES[scene], *FRAMES, str(tmp_path / "%05d.png")])
    wait_for(lambda: (tmp_path / "00001.png").exists(), process)
    process.send_signal(number)
    stderr = process.communicate()[1]
    assert process.returncode == 130, stderr
    assert stderr.splitlines()[-1] == "stopped"
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == [f"{frame:05d}.png" for frame in range(len(files))], "every frame up to one, and nothing else"
    for name in files:
        assert host.read_image(tmp_path / name).shape == (48, 64, 4)


@pytest.mark.parametrize("scene", SCENES)
def test_a_second_signal_ends_the_process_at_once(command, root, tmp_path, scene):
    process = start(command, root, [*SCENES[scene], *FRAMES, str(tmp_path / "%05d.png")])
    wait_for(lambda: (tmp_path / "00001.png").exists() and catches(process, signal.SIGINT), process)
    process.send_signal(signal.SIGSTOP)  # so that both are there before anything else happens
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)
    stderr = process.communicate()[1]
    assert process.returncode in (128 + signal.SIGINT, 128 + signal.SIGTERM)
    assert "stopped" not in stderr, "nothing is tidied up"


def test_statistics_are_written_whole(command, root, tmp_path):
    file = tmp_path / "stats.json"
    for scene in SCENES.values():
        done = subprocess.run([command, "run", "deferred", *scene, "--set", "extent=[64,48]", "-q", "--stats", str(file),
                               "-o", str(tmp_path / "out.png"), "--frames", "4"], cwd=root, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        stats = json.loads(file.read_text())
        assert stats["frames"] == 4 and stats["counters"]["draws"] > 0
        assert stats["run"]["frames"] == 4
        assert 0 < stats["run"]["minimum_ms"] <= stats["run"]["median_ms"] <= stats["run"]["maximum_ms"]
        assert sorted(path.name for path in tmp_path.iterdir()) == ["out.png", "stats.json"]
        file.unlink()


def test_a_file_that_cannot_be_written_is_an_error(command, root, tmp_path):
    for scene in SCENES.values():
        done = subprocess.run([command, "run", "deferred", *scene, "--set", "extent=[64,48]", "-q", "--stats",
                               "/proc/missing/stats.json", "-o", str(tmp_path / "out.png")],
                              cwd=root, capture_output=True, text=True)
        assert done.returncode == 4
        assert done.stderr == "error: cannot write '/proc/missing/stats.json'\n"


def test_a_cancelled_frame_says_so_and_the_next_one_renders(host):
    with host.graph("deferred", ["extent=[64,48]"]) as graph, host.scene() as scene:
        graph.render(scene)
        before = graph.read()
        host.cancel()
        with pytest.raises(heddle.Error) as error:
            graph.render(scene)
        assert error.value.status == 6
        assert str(error.value) == "error: stopped, as heddle_cancel asked for"
        graph.render(scene)
        assert (graph.read() == before).all()


@pytest.mark.parametrize("place", ["the file itself", "build", "update"])
def test_one_signal_stops_a_scene_that_never_returns(command, root, tmp_path, place):
    scene = tmp_path / "endless.py"
    begun = tmp_path / "begun"
    endless = f"open({str(begun)!r}, 'w').close()\n{{indent}}while True:\n{{indent}}    pass\n"
    parts = {"the file itself": endless.format(indent=""),
             "build": "def build(scene):\n    " + endless.format(indent="    "),
             "update": "def build(scene):\n    pass\ndef update(scene, time):\n    " + endless.format(indent="    ")}
    scene.write_text(parts[place])
    process = start(command, root, [str(scene), "--output", str(tmp_path / "never.png")])
    wait_for(begun.exists, process)
    process.send_signal(signal.SIGINT)
    stderr = process.communicate()[1]
    assert process.returncode == 130, stderr
    assert stderr.splitlines()[-1] == "stopped"
