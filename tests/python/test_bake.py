# SPDX-License-Identifier: Apache-2.0
"""Bakes of role bake_visibility: stopped, gone on with, found again, shown, and refused."""

import json
import subprocess

import pytest

import heddle
from heddle.__main__ import load_scene

from conftest import BUILD

JOB = """kind = "job"
[[pass]]
name = "bake"
role = "bake_visibility"
technique = "{technique}"
params.spacing = 0.5
{more}
"""
MAPS = "params.directions = 112\nparams.resolution = 128"
BAKES = {
    "hemicube": ("hemicube", "params.resolution = 8\nparams.batch = 102"),
    "float_sums": ("depth_maps", MAPS),
    "settling": ("depth_maps", f"{MAPS}\nparams.settled = 0.02"),
    "split_ramp": ("depth_maps", f'{MAPS}\nparams.pipeline = "split_ramp"'),
    "gpu_compare": ("depth_maps", f'{MAPS}\nparams.pipeline = "gpu_compare"'),
    "cpu_compare": ("depth_maps", f'{MAPS}\nparams.pipeline = "cpu_compare"'),
}


class Enough(Exception):
    pass


def bake(folder, text, progress=None):
    """Another host on the folder's cache -> the artifact's bytes, its origin, its report's rows."""
    (folder / "bake.toml").write_text(text)
    with heddle.Host(log=lambda _severity, _text: None) as host, host.scene() as scene:
        load_scene(scene, "scripts/scenes/cornell_box.py")
        with host.job(folder / "bake.toml") as job:
            told = job.run(scene, progress=progress)
            return job.artifact("bake.occlusion"), told["artifacts"][0]["origin"], told["reports"][0]["rows"]


@pytest.fixture
def folder(tmp_path, monkeypatch, root):
    monkeypatch.setenv("HEDDLE_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(root)
    return tmp_path


@pytest.mark.parametrize("name", BAKES)
def test_a_bake_that_was_stopped_goes_on_and_leaves_the_same(folder, monkeypatch, name):
    technique, more = BAKES[name]
    text = JOB.format(technique=technique, more=more)
    artifacts = folder / "cache" / "artifacts"

    def stop_at(share):
        def stop(activity, done):
            # Shares that slices of 1, 8 and 16 of 112 directions, or of 102 of 714 elements, come to, and no stage's
            # place in the order.
            if activity.endswith("of pass 'bake'") and abs(done - share) < 0.002:
                raise Enough
        return stop

    for share in (1 / 7, 4 / 7):
        with pytest.raises(Enough):
            bake(folder, text, stop_at(share))
    assert len(list(artifacts.iterdir())) == 1, "what is unfinished, and nothing half"
    made, origin, rows = bake(folder, text)
    assert origin == "made" and len(list(artifacts.iterdir())) == 2, "with its pieces; what was unfinished is gone"
    assert bake(folder, text)[:2] == (made, "cache")
    monkeypatch.setenv("HEDDLE_CACHE", str(folder / "other"))
    assert bake(folder, text) == (made, "made", rows), "as if it had not been stopped"


def test_a_frame_shows_what_a_job_has_baked_and_does_not_bake_again(folder, command):
    (folder / "bake.toml").write_text(JOB.format(technique="depth_maps", more=MAPS))
    (folder / "frame.toml").write_text('extends = "baked_ao"\nextent = [64, 48]\n[[pass]]\nname = "ao"\n'
                                       'inputs.occlusion = "bake.toml#occlusion"\n')
    def run():
        stats = folder / "stats.json"
        done = subprocess.run([command, "run", folder / "frame.toml", "scripts/scenes/cornell_box.py", "--frames", "2",
                               "--stats", stats, "--output", folder / "out.png"], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return json.loads(stats.read_text())
    first, second = run(), run()
    assert first["artifacts"][0]["origin"] == "made" and second["artifacts"][0]["origin"] == "cache"
    assert second["counters"]["uploaded_bytes"] < 16384, "values stay on the GPU"
    assert any(library.endswith("baked.so") for library in second["libraries"])
    assert not any("bake_visibility" in library for library in second["libraries"]), "who bakes is not even opened"


def test_without_the_pass_nothing_of_it_is_loaded(folder, command):
    stats = folder / "stats.json"
    done = subprocess.run([command, "run", "baked_ao", "scripts/scenes/cornell_box.py", "--set", "extent=[64,48]",
                           "--set", "ao.technique=none", "--stats", stats, "--output", folder / "out.png"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = json.loads(stats.read_text())
    assert told["artifacts"] == [] and not (folder / "cache" / "artifacts").exists()
    assert not any("bake" in library.rsplit("/", 1)[1] for library in told["libraries"])


def test_what_is_no_bake_is_refused(folder, command):
    (folder / "job.toml").write_text('kind = "job"\n[[pass]]\nname = "count"\nrole = "job_probe"\ntechnique = "count"\n')
    (folder / "frame.toml").write_text('extends = "baked_ao"\n[[pass]]\nname = "ao"\n'
                                       'inputs.occlusion = "job.toml#table"\n')
    plugins = f"{BUILD}/tests/plugins:{BUILD}/lib/heddle/plugins"
    done = subprocess.run([command, "run", folder / "frame.toml", "scripts/scenes/cornell_box.py", "--plugins", plugins,
                           "--set", "extent=[64,48]", "--output", folder / "out.png"], capture_output=True, text=True)
    assert done.returncode == 2 and not (folder / "out.png").exists()
    assert ("pass 'ao' (ambient_occlusion/baked): input 'occlusion' is no baked visibility: it does not begin as an artifact of "
            "role bake_visibility does; bind it to the output of a job's pass of role bake_visibility") in done.stderr


def test_the_check_proves_a_bake(folder, command):
    for name, (technique, more) in BAKES.items():
        (folder / "bake.toml").write_text(JOB.format(technique=technique, more=more).replace("112", "24").replace("102", "2"))
        done = subprocess.run([command, "check", folder / "bake.toml", "tests/fuzz/gltf_corpus/plain.glb"],
                              capture_output=True, text=True)
        assert done.returncode == 0 and "nothing found" in done.stdout, (name, done.stdout, done.stderr)
