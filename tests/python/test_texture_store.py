# SPDX-License-Identifier: Apache-2.0
"""Images from files as virtual textures, by the command: what is shown, and what memory the cutting takes."""

import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

import heddle

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
MEBIBYTE = 1 << 20


# A process begins with the peak of the one that starts it, and tests may hold gigabytes: a small one starts the command.
STARTER = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[2:])
_, status, used = os.wait4(process.pid, 0)
open(sys.argv[1], "w").write(str(used.ru_maxrss * 1024))
sys.exit(os.waitstatus_to_exitcode(status))
"""


def run(command, folder, *arguments):
    """The process's peak memory in bytes, and what it printed."""
    peak = folder / "peak"
    done = subprocess.run(["/usr/bin/python3", "-S", "-c", STARTER, str(peak), command, "run", *map(str, arguments)],
                          env={**os.environ, "HEDDLE_CACHE": str(folder / "cache")}, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    return int(peak.read_text()), done.stdout


def test_an_image_hangs_on_the_wall(command, tmp_path, host):
    # Four colours, so that which way up it hangs is seen: red, green; blue, grey.
    image = np.zeros((300, 500, 3), np.float32)
    image[:150, :250] = (0.8, 0.1, 0.1)
    image[:150, 250:] = (0.1, 0.8, 0.1)
    image[150:, :250] = (0.1, 0.1, 0.8)
    image[150:, 250:] = 0.5
    host.write_image(tmp_path / "quarters.png", image)
    scene = tmp_path / "wall.py"
    scene.write_text((SCRIPTS / "scenes" / "picture.py").read_text() + """
def build(scene, build=build):
    build(scene)
    scene.camera((0, 13, -30), (0, 13, 0), name="before", use=True)
""")
    images = f'image_store.toml#store.params.images=["{tmp_path}/quarters.png"]'
    _, said = run(command, tmp_path, "virtual_image", scene, "--camera", "before", "--frames", "8", "--set", "extent=[64,64]",
                  "--set", images, "--output", f"gbuffer.base_color={tmp_path}/base.exr", "--stats", tmp_path / "stats.json")
    base = host.read_image(tmp_path / "base.exr")[..., :3]
    codes = {"red": (0.8, 0.1, 0.1), "green": (0.1, 0.8, 0.1), "blue": (0.1, 0.1, 0.8), "grey": (0.5, 0.5, 0.5)}
    for name, (y, x) in {"red": (20, 20), "green": (20, 44), "blue": (44, 20), "grey": (44, 44)}.items():
        # A flat block is at most a step of 8 bits off, lavapipe's unpacking another, the gbuffer's own 8 bits a third.
        assert np.abs(base[y, x] - codes[name]).max() <= 3 / 255, (name, base[y, x])
    counts = {one["name"]: one["count"] for one in json.loads((tmp_path / "stats.json").read_text())["counts"]}
    assert counts["tiles_resident"] >= 1 and counts["tiles_missing"] == 0
    # The same again takes the tiles from the cache, and says so.
    _, said = run(command, tmp_path, "image_store", scene, "--set", images.split("#")[1])
    assert "from the cache" in said


EXTENTS = (1024, 16384) if os.environ.get("HEDDLE_TEST_ALL") else (1024, 4096)


def test_cutting_takes_no_more_memory_for_a_larger_image(command, tmp_path):  # H6
    peaks = []
    for extent in EXTENTS:
        peak, _ = run(command, tmp_path, "image_store", SCRIPTS / "scenes" / "cornell_box.py", "--set",
                      f"store.params.extent={extent}", "--set", "store.params.source=ramp", "--set",
                      "store.params.compression=none")
        peaks.append(peak)
        for file in (tmp_path / "cache").rglob("*.store"):
            file.unlink()
    print(*(f"{extent}: {peak / MEBIBYTE:.0f} MiB" for extent, peak in zip(EXTENTS, peaks)))
    # Level 0 of the larger one alone is 60 MiB more. Of blocks at most 32 MiB are in memory, and the small image fills 5.
    assert peaks[1] - peaks[0] < 40 * MEBIBYTE
    assert max(peaks) < 256 * MEBIBYTE
