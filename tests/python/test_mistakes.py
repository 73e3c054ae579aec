# SPDX-License-Identifier: Apache-2.0
"""Lines that are wrong: what the command says of them, for scenes in Python and for others."""

import subprocess

import pytest


def said(command, *words):
    done = subprocess.run([command, *words], capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == "" and "Traceback" not in done.stderr, done.stderr
    return done.stderr.splitlines()


@pytest.mark.parametrize("count", ["0", "-3"])
@pytest.mark.parametrize("words", [["run"], ["inspect", "1,1"], ["check"]], ids=lambda words: words[0])
def test_there_is_at_least_one_frame(command, words, count):
    first, _help = said(command, *words, "cornell_box.py", "--frames", count)
    assert first == f"error: --frames: {count} is no number of frames: expected 1 to 1000000"
    assert count in said(command, *words, "none.glb", "--frames", count)[0]


@pytest.mark.parametrize("words, first", [
    (["run", "cornell_box.py", "--time", "abc"], "error: --time: 'abc' is no number"),
    (["run", "cornell_box.py", "--seed", "1.5"], "error: --seed: '1.5' is no whole number"),
    (["tune", "cornell_box.py", "--time", "abc"], "error: --time: 'abc' is no number"),
    (["tune", "cornell_box.py", "--budget", "-4ms"], "error: --budget '-4ms' is no time of a frame"),
    (["run", "cornell_box.py", "--frame", "3"], "error: unrecognized arguments: --frame"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")
def test_a_wrong_value_is_one_error_without_usage(command, words, first):
    lines = said(command, *words)
    assert lines[0] == first and len(lines) == 2


@pytest.mark.parametrize("words, first, nearest", [
    (["runn"], "error: there is no command 'runn'", "run"),
    (["lst"], "error: there is no command 'lst'", "list"),
    (["list", "ambient_oclusion"], "error: there is no role 'ambient_oclusion'", "ambient_occlusion"),
    (["study", "ambient_oclusion"], "error: there is neither a file nor a shipped study 'ambient_oclusion'",
     "ambient_occlusion"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")
def test_a_wrong_name_is_told_with_the_nearest(command, words, first, nearest):
    lines = said(command, *words)
    assert lines[0] == first and lines[-1] == f"  help:     did you mean '{nearest}'?" and len(lines) == 3


def test_a_name_that_is_near_to_none_is_told_without(command):
    lines = said(command, "xyzzyxyzzy")
    assert len(lines) == 2 and lines[1].startswith("  expected: one of run, ")
