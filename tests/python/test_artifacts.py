# SPDX-License-Identifier: Apache-2.0
"""What sky/environment_map keeps on disk, as the command uses it: once for all processes, by image and parameters."""

import json
import os
import subprocess

import numpy as np
import pytest

import heddle

GRAPH = """
extent = [8, 8]
output = "sky.mean_radiance"
[[pass]]
name = "sky"
role = "sky"
technique = "environment_map"
params.resolution = "64"
"""


class Folder:
    """A cache, an image and a graph of one test."""

    def __init__(self, path, command, host):
        self.path, self.command, self.host = path, command, host
        self.cache = path / "cache"
        self.image = path / "sky.exr"
        (path / "graph.toml").write_text(GRAPH)

    def start(self, name, *arguments):
        words = [self.command, "run", str(self.path / "graph.toml"), "--environment", str(self.image),
                 "--output", str(self.path / f"{name}.exr"), "--stats", str(self.path / f"{name}.json"), *arguments]
        return subprocess.Popen(words, env={**os.environ, "HEDDLE_CACHE": str(self.cache)}, stderr=subprocess.PIPE, text=True)

    def finish(self, process, name):
        """(what stats say of the artifact, bytes of the picture's texels, stderr)"""
        stderr = process.communicate()[1]
        assert process.returncode == 0, stderr
        artifact, = json.loads((self.path / f"{name}.json").read_text())["artifacts"]
        return artifact, self.host.read_image(str(self.path / f"{name}.exr")).tobytes(), stderr

    def run(self, *arguments):
        return self.finish(self.start("run", *arguments), "run")

    def files(self):
        return sorted(path.name for path in (self.cache / "artifacts").iterdir())


@pytest.fixture
def folder(host, tmp_path, command):
    made = Folder(tmp_path, command, host)
    host.write_image(str(made.image), np.random.default_rng(1).uniform(0, 2, (16, 32, 3)).astype(np.float32))
    return made


def test_a_second_process_takes_what_the_first_made(folder):
    first, picture, stderr = folder.run()
    assert (first["pass"], first["stage"], first["origin"]) == ("sky", "integrate", "made")
    assert f"artifact of pass 'sky', integrate: made, {first['bytes'] / 2**20:.1f} MiB" in stderr.splitlines()
    assert folder.files() == [first["key"] + ".artifact"]
    second, same, stderr = folder.run()
    assert second == {**first, "origin": "cache"} and same == picture
    assert f"artifact of pass 'sky', integrate: from the cache, {first['bytes'] / 2**20:.1f} MiB" in stderr.splitlines()
    assert folder.run("--remake")[:2] == (first, picture)
    assert len(folder.files()) == 1


def test_only_the_image_and_what_the_work_depends_on_make_another(folder, host):
    key = folder.run()[0]["key"]

    def origin(*arguments):
        artifact = folder.run(*arguments)[0]
        assert (artifact["origin"] == "cache") == (artifact["key"] == key)
        return artifact["origin"]

    assert origin("--environment-rotation", "1", "--environment-scale", "3") == "cache"
    assert origin("--set", "sky.params.samples=8", "--set", "sky.params.specular_size=8") == "cache"
    assert origin("--set", "sky.params.levels=4") == "made"
    assert origin("--set", "sky.params.brightest=64") == "made"
    assert origin("--set", "sky.params.resolution='128'") == "made"
    pixels = host.read_image(str(folder.image))[..., :3].copy()
    before = pixels[3, 5, 1]
    pixels[3, 5, 1] = np.nextafter(before, np.float32(9))
    host.write_image(str(folder.image), pixels)
    assert origin() == "made", "one bit of one texel"
    pixels[3, 5, 1] = before
    host.write_image(str(folder.image), pixels)
    assert origin() == "cache", "by contents, not by the file's time"


def test_two_processes_at_once_make_the_same(folder):
    both = [folder.start(name) for name in ("one", "other")]
    (one, picture, _), (other, same, _) = [folder.finish(process, name) for process, name in zip(both, ("one", "other"))]
    assert one["key"] == other["key"] and picture == same
    assert folder.files() == [one["key"] + ".artifact"]


def test_a_damaged_artifact_is_told_and_made_again(folder):
    artifact, picture, _ = folder.run()
    file = folder.cache / "artifacts" / folder.files()[0]
    whole = file.read_bytes()
    file.write_bytes(whole[:len(whole) // 2])
    again, same, stderr = folder.run()
    assert again == artifact and same == picture and file.read_bytes() == whole
    assert (f"{folder.path / 'graph.toml'}:4:1: warning: pass 'sky' (sky/environment_map): the artifact {file} is damaged: "
            "its bytes are not those that were written; it is made again") in stderr.splitlines()


def test_python_hosts_share_it_and_may_make_it_again(folder, host, monkeypatch):
    monkeypatch.setenv("HEDDLE_CACHE", str(folder.cache))
    origins = []
    for remake in (False, False, True):
        with heddle.Host(remake=remake) as made, made.scene() as scene:
            scene.set_environment(made.read_image(str(folder.image)))
            with made.graph(str(folder.path / "graph.toml")) as graph:
                graph.render(scene)
                origins += [artifact["origin"] for artifact in graph.stats()["artifacts"]]
    assert origins == ["made", "cache", "made"]
