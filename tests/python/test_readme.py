# SPDX-License-Identifier: Apache-2.0
"""Every command that a README shows is run, on small pictures."""

import json
import os
import pathlib
import re
import shlex
import signal
import struct
import subprocess
import time

import numpy as np
import pytest

import heddle
from conftest import ROOT, default_signals

# Run by whoever runs these tests, or by themselves; and what another test runs from an installed copy.
OTHERS = ("scripts/", "cmake ", "DIR/", "HEDDLE_PLUGIN_PATH=", "source ", "build/bin/heddle new-technique",
          "build/bin/heddle bench", "dask-scheduler ")
TAKES_A_SIZE = ("run", "view", "compare", "inspect", "check")


# What a command of ours begins with: `time` and settings of its environment may stand before it.
COMMAND = r"(?:time )?(?:[A-Z_]+=\S+ )*(?:build/bin/)?heddle\s+[a-z-]+"


def commands_of(text):
    """The commands in fenced blocks, in indented ones and between backticks, with what stands before `heddle` but `time`."""
    text = text.replace("\\\n", " ")
    fenced = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.M | re.S)
    lines = [line for _, kind, block in fenced.findall(text) if kind == "sh" for line in block.splitlines()]
    text = fenced.sub("", text)
    lines += re.findall(rf"^(?: {{4,}}|\t)({COMMAND} .+)$", text, re.M)
    lines += [" ".join(code.split()) for code in re.findall(rf"`({COMMAND}\s[^`]+)`", text)]
    found = []
    for line in lines:
        # A graph's name and a job's pass are joined by a # too.
        words = re.split(r"(?:^|\s)#", line)[0].strip().removeprefix("time ")
        # Forms with a word in capitals or dots for what the reader chooses are no commands.
        if words and not words.startswith(OTHERS) and not re.search(r"\.\.\.|(?<!\$)\b[A-Z]{2,}\b| A B$|\| source", words):
            found.append(words)
    return found


def all_commands():
    files = [ROOT / "README.md", ROOT / "api" / "SHADERS.md", *sorted((ROOT / "plugins").glob("*/*/README.md"))]
    for file in files:
        for words in commands_of(file.read_text()):
            yield pytest.param(words, id=f"{file.parent.name}: {words}"[:120])


def write_model(path):
    """A blended and an opaque triangle, one of which an animation moves, as a .glb."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
    times = np.array([0, 1], np.float32)
    places = np.array([[0, 0, 0], [0, 0.5, 0]], np.float32)
    parts = [positions.tobytes(), times.tobytes(), places.tobytes()]
    offsets = np.cumsum([0] + [len(part) for part in parts]).tolist()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"mesh": 1, "translation": [0.3, 0, 0.5]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": material}]} for material in (0, 1)],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.2, 1]}},
                      {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.8, 0.5]}}],
        "animations": [{"samplers": [{"input": 1, "output": 2}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
        "buffers": [{"byteLength": offsets[-1]}],
        "bufferViews": [{"buffer": 0, "byteOffset": offset, "byteLength": len(part)}
                        for offset, part in zip(offsets, parts)],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0],
                       "max": [1, 1, 0]},
                      {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
                      {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(parts)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)) + struct.pack("<I4s", len(text), b"JSON") +
                     text + struct.pack("<I4s", len(data), b"BIN\0") + data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, command):
    """A folder that looks like the repository's root, with the files that the READMEs name."""
    made = tmp_path_factory.mktemp("readme")
    (made / "scripts").symlink_to(ROOT / "scripts")
    (made / "build").symlink_to(pathlib.Path(command).parents[1])
    for name in ("model.glb", "scene.glb", "AlphaBlendModeTest.glb"):
        write_model(made / name)
    with heddle.Host() as host:
        sky = np.full((8, 16, 3), 0.4, np.float32)
        sky[1, 3] = 60
        host.write_image(made / "sky.hdr", sky)
        host.write_image(made / "map.png", sky.clip(0, 1))
        for name, scale in (("a.exr", 1.0), ("b.exr", 1.1)):
            host.write_image(made / name, sky * np.float32(scale))
    study = (ROOT / "README.md").read_text().split("```toml\n")
    text = next(text for text in study if "[[variant]]" in text).split("```")[0]
    (made / "mine.toml").write_text(text.replace('technique = "mine"', 'technique = "ssao"'))
    return made


def run(words, folder, environment):
    """The command's status and what it said; --watch goes on until its picture is there and it is told to stop."""
    process = subprocess.Popen(["bash", "-c", "exec " + words if " > " not in words else words], cwd=folder, text=True,
                               env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               preexec_fn=default_signals)
    if "--watch" not in words:
        said, _ = process.communicate(timeout=300)
        return process.returncode, said
    picture = folder / shlex.split(words)[shlex.split(words).index("--output") + 1]
    while process.poll() is None and not picture.exists():
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    return (0 if process.returncode == 130 else process.returncode), said


@pytest.mark.parametrize("words", all_commands())
def test_the_command_runs(words, folder, command):
    environment = os.environ | {"PATH": f"{pathlib.Path(command).parent}:{os.environ['PATH']}"}
    environment.pop("PYTHONPATH", None)
    subcommand = re.search(r"heddle (\S+)", words)[1]
    words = words.replace("320,180", "16,9")
    if "bake" in words:
        words = words.replace("scenes/atrium", "scenes/cornell_box")  # minutes
    if subcommand in TAKES_A_SIZE and not re.search(r"\.exr \S+\.exr", words):
        words += " --set 'extent=[32,18]'"
    if subcommand == "view":  # on a screen in memory, and closed at once
        (folder / "quit.script").write_text("wait\nquit\n")
        words += "" if "--script" in words else " --script quit.script"
        words = words if words.startswith("xvfb-run") else f"xvfb-run -a {words}"
    if subcommand == "study":
        words += " --dry-run"  # minutes; test_study measures small ones
    if subcommand == "tune":
        words += " --dry-run"  # as long; test_tune makes times up
    if subcommand == "baseline":
        words = words.replace("ambient_occlusion", "ambient_occlusion/gtao") + " --folder baselines"
    if "--output" in words:
        named = [word.split("=")[-1] for word in shlex.split(words)[shlex.split(words).index("--output") + 1:][:1]]
        for name in named:
            (folder / name).unlink(missing_ok=True)
    status, said = run(words, folder, environment)
    assert status == 0, said
    if "--output" in words and "%" not in words:
        assert (folder / named[0]).stat().st_size > 0


def test_commands_are_found_wherever_a_page_shows_them():
    page = """Text with `heddle list shadow`, `time heddle run a.glb --frames 2` and `HEDDLE_DEVICE=llvmpipe build/bin/heddle
doctor --json`; no commands: `heddle run A B`, `heddle run ...`, `heddle`, heddle run prose.glb.

    heddle explain deferred \\
        --why ao   # a comment
    time build/bin/heddle compare a.exr b.exr

- in a list
  ```sh
  build/bin/heddle doctor
  ```
```toml
    heddle run not_a_command.glb
```
"""
    assert commands_of(page) == [
        "build/bin/heddle doctor", "heddle explain deferred          --why ao", "build/bin/heddle compare a.exr b.exr",
        "heddle list shadow", "heddle run a.glb --frames 2", "HEDDLE_DEVICE=llvmpipe build/bin/heddle doctor --json"]


def test_commands_were_found():
    found = [parameter.values[0] for parameter in all_commands()]
    assert len([words for words in found if words.startswith("build/bin/heddle run")]) >= 5
    assert {re.search(r"heddle (\S+)", words)[1] for words in found} >= {"run", "view", "compare", "list", "explain", "inspect", "check"}
