# SPDX-License-Identifier: Apache-2.0
"""Where the build is, and one host for all tests of the process."""

import os
import pathlib
import signal

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ.setdefault("HEDDLE_DEVICE", "llvmpipe")
BUILD = pathlib.Path(os.environ.get("HEDDLE_BUILD", ROOT / "build"))
os.environ.setdefault("HEDDLE_LIBRARY", str(BUILD / "lib" / "libheddle.so"))


def default_signals():
    """For preexec_fn: a process that is started in the background may have been told to ignore SIGINT, and its children
    would."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture(scope="session")
def command():
    return str(BUILD / "bin" / "heddle")


@pytest.fixture
def host():
    import heddle

    with heddle.Host() as made:
        yield made
