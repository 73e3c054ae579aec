# SPDX-License-Identifier: Apache-2.0
"""Graphs prove themselves from Python and from the command; a host without check mode says how to get one."""

import json
import subprocess

import pytest

import heddle

TINY = ["extent=[64,48]"]


def test_three_frames_of_the_default_graph_are_proven():
    with heddle.Host(check=True) as host, host.graph("deferred", TINY) as graph, host.scene() as scene:
        for _ in range(3):
            graph.render(scene)


def test_bytes_depend_neither_on_the_order_nor_on_memory():
    with heddle.Host(check=True) as host, host.graph("deferred", TINY) as graph, host.scene() as scene:
        report = graph.check(scene, frames=2)
    assert report["frames"] == 2
    assert report["seen_both_ways"] == report["unordered_pairs"]
    assert report["compared"] == ["display.color"]


def test_a_host_without_check_mode_says_so(host):
    with host.graph("deferred", TINY) as graph, host.scene() as scene:
        with pytest.raises(heddle.Error) as error:
            graph.check(scene)
    assert str(error.value) == "error: a graph is checked on a host that was made without HEDDLE_HOST_CHECK"


def test_the_command_checks(command):
    done = subprocess.run([command, "check", "deferred", "--set", TINY[0], "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frames"] == 3


def test_a_checked_run_renders_three_frames_and_says_so(command, tmp_path):
    picture = tmp_path / "out.png"
    done = subprocess.run([command, "run", "deferred", "--set", TINY[0], "--check", "-o", str(picture)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "checked 3 frames: every hazard and layout is covered" in done.stderr
    assert picture.exists()
