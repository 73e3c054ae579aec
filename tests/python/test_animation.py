# SPDX-License-Identifier: Apache-2.0
"""Scenes at given times against positions worked out in numpy float64 from the raw buffers, for hand-made files and for
real ones where a folder of them is there."""

import json
import os
import pathlib
import struct
import subprocess

import numpy as np
import pytest

import gltf_reference
import heddle

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = pathlib.Path(os.environ.get("HEDDLE_GLTF_FOLDER") or ROOT.parent / "shared" / "assets" / "gltf")
FILES = sorted(FOLDER.rglob("*.gl*")) if FOLDER.is_dir() else []
SHARES = (0.0, 0.137, 0.5, 0.833, 1.0, 1.7)  # of an animation's duration; the last holds its end


def expect_poses(host, path):
    """The largest error of all corners at all times, as a share of the bound."""
    file = gltf_reference.File(path)
    worst = 0.0
    with host.scene() as scene:
        scene.load(path)
        durations = gltf_reference.durations(file)
        for animation in range(max(len(durations), 1)):
            if durations:
                scene.use_animation(animation)
            for share in SHARES if durations else (0.0,):
                time = share * durations[animation] if durations else 0.0
                scene.set_time(time)
                triangles = scene.triangles()
                found = triangles["positions"][triangles["indices"]]
                expected, reach = gltf_reference.corners(file, time, animation)
                assert found.shape == expected.shape
                # Two roundings to float32 of numbers up to `reach`, half a step each: bent vertices about their joint, and
                # triangles about the middle of the scene. What is done in float64 is 1e-9 of that.
                bound = reach * 2.0**-24 * 2
                error = np.abs(found - expected).max()
                assert error <= bound, f"animation {animation} at {time} s: {error} m, bound {bound}"
                worst = max(worst, error / bound)
    return worst


@pytest.mark.parametrize("path", FILES or [None], ids=lambda path: path.name if path else "no files")
def test_real_files_are_posed_as_numpy_poses_them(host, path):
    if path is None:
        pytest.skip(f"there is no folder of glTF files at {FOLDER}; HEDDLE_GLTF_FOLDER names one")
    print(f"{path.name}: {expect_poses(host, path):.3f} of the bound")


class Maker:
    """Writes .glb files from numpy arrays."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "bufferViews": [], "accessors": []}
        self.data = b""

    def view(self, array):
        self.data += bytes(-len(self.data) % 4)
        raw = np.ascontiguousarray(array).tobytes()
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)})
        self.data += raw
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array, normalized=False):
        array = np.asarray(array)
        width = 1 if array.ndim == 1 else array.shape[1]
        kinds = {np.dtype(kind): code for code, kind in gltf_reference.COMPONENTS.items()}
        made = {"bufferView": self.view(array), "componentType": kinds[array.dtype], "count": len(array),
                "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[width]}
        if normalized:
            made["normalized"] = True
        self.json["accessors"].append(made)
        return len(self.json["accessors"]) - 1

    def write(self, path):
        self.data += bytes(-len(self.data) % 4)
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 28 + len(text) + len(self.data)) + struct.pack("<I", len(text))
                         + b"JSON" + text + struct.pack("<I", len(self.data)) + b"BIN\0" + self.data)


def everything(path):
    """Two skinned, morphed tubes with sparse targets under moving parents; each interpolation on each property."""
    rng = np.random.default_rng(7)
    made = Maker()
    count, joints, targets = 60, 3, 2
    rest = rng.normal(size=(count, 3)).astype(np.float32)
    weights = rng.integers(1, 255, size=(count, 4)).astype(np.uint8)
    sparse_places = np.sort(rng.choice(count, 7, replace=False)).astype(np.uint16)
    primitive = {"attributes": {"POSITION": made.accessor(rest),
                                "NORMAL": made.accessor((rest / np.linalg.norm(rest, axis=1)[:, None]).astype(np.float32)),
                                "JOINTS_0": made.accessor(rng.integers(0, joints, size=(count, 4)).astype(np.uint8)),
                                "WEIGHTS_0": made.accessor(weights, normalized=True)},
                 "indices": made.accessor(rng.permutation(count).astype(np.uint16)),
                 "targets": [{"POSITION": made.accessor(rng.normal(size=(count, 3)).astype(np.float32))}]}
    made.json["accessors"].append({
        "componentType": 5126, "count": count, "type": "VEC3",
        "sparse": {"count": 7, "indices": {"bufferView": made.view(sparse_places), "componentType": 5123},
                   "values": {"bufferView": made.view(rng.normal(size=(7, 3)).astype(np.float32))}}})
    primitive["targets"].append({"POSITION": len(made.json["accessors"]) - 1})
    flat = {**primitive, "attributes": {"POSITION": primitive["attributes"]["POSITION"]}}
    made.json["meshes"] = [{"primitives": [primitive], "weights": [0.25, 0]}, {"primitives": [flat], "weights": [0, 0.5]}]
    bind = rng.normal(size=(joints, 16)).astype(np.float32)
    bind[:, [3, 7, 11]], bind[:, 15] = 0, 1
    made.json["skins"] = [{"joints": [3, 4, 5], "inverseBindMatrices": made.accessor(bind)}]
    made.json["nodes"] = [
        {"children": [1, 2, 3], "translation": [1e5, 20.5, -3e4], "rotation": [0.1, 0.2, 0.3, 0.9]},
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9]}, {"mesh": 1, "scale": [2, -0.5, 1.5]},
        {"children": [4], "translation": [0, 1, 0]}, {"children": [5], "rotation": [0, 0.6, 0, 0.8]},
        {"scale": [1.2, 0.7, 1.1]}]
    animations = []
    for interpolation in ("LINEAR", "STEP", "CUBICSPLINE"):
        animation = {"channels": [], "samplers": []}
        parts = 3 if interpolation == "CUBICSPLINE" else 1

        def add(node, path, values, normalized=False, animation=animation, interpolation=interpolation):
            keys = len(values) // parts // (targets if path == "weights" else 1)
            times = np.cumsum(rng.uniform(0.1, 0.9, keys)).astype(np.float32)
            animation["samplers"].append({"input": made.accessor(times), "output": made.accessor(values, normalized),
                                          "interpolation": interpolation})
            animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}})

        add(0, "translation", (rng.normal(size=(4 * parts, 3)) * 100).astype(np.float32))
        add(2, "scale", rng.uniform(-2, 2, size=(3 * parts, 3)).astype(np.float32))
        for node, kind in ((0, np.float32), (3, np.int16), (4, np.int8), (5, np.uint16), (2, np.uint8)):
            values = rng.normal(size=(5 * parts, 4))
            values /= np.linalg.norm(values, axis=1)[:, None]
            if np.dtype(kind).kind in "iu":
                values = np.round((np.abs(values) if np.dtype(kind).kind == "u" else values) * np.iinfo(kind).max)
            add(node, "rotation", values.astype(kind), np.dtype(kind).kind in "iu")
        for node, kind in ((1, np.float32), (2, np.uint8)):
            values = rng.uniform(0, 1, size=4 * parts * targets)
            add(node, "weights", (values * 255 if kind == np.uint8 else values).astype(kind), kind == np.uint8)
        animations.append(animation)
    made.json["animations"] = animations
    made.write(path)
    return path


def test_every_interpolation_property_and_number_is_posed_as_numpy_poses_it(host, tmp_path):
    assert expect_poses(host, everything(tmp_path / "everything.glb")) > 0


def test_time_of_a_frame_poses_the_scene_and_repeated_frames_upload_nothing(host, tmp_path):
    path = everything(tmp_path / "everything.glb")
    expected = {}
    with host.scene() as scene:
        scene.load(path)
        for time in (0.0, 0.7):
            scene.set_time(time)
            expected[time] = scene.triangles()["positions"]
    with host.graph("studio", ["extent=[32,32]"]) as graph, host.scene() as scene:
        scene.load(path)
        uploads = []
        for time in (0.0, 0.7, 0.7, 0.7, None):
            graph.render(scene, time=time)
            uploads.append(graph.stats()["counters"]["uploaded_bytes"])
        assert (scene.triangles()["positions"] == expected[0.7]).all()
        assert (expected[0.0] != expected[0.7]).any()
        vertices = scene.describe()["counts"]["vertices"]
        assert uploads[1] > vertices * 64, "the bent shapes"
        assert 0 < uploads[2] < vertices * 64, "places alone: what moved has arrived"
        assert uploads[3] == uploads[4] == 0


def test_animations_are_chosen_by_name_or_number(host, tmp_path):
    made = everything(tmp_path / "a.glb")
    with host.scene() as scene:
        scene.load(made)
        assert [each["name"] for each in scene.describe()["animations"]] == ["animation 0", "animation 1", "animation 2"]
        scene.set_time(0.5)
        scene.use_animation("animation 2")
        by_name = scene.triangles()["positions"]
        scene.use_animation(None)
        assert (scene.triangles()["positions"] != by_name).any()
        scene.use_animation(2)
        assert (scene.triangles()["positions"] == by_name).all()
        with pytest.raises(heddle.Error) as raised:
            scene.use_animation("walk")
        assert str(raised.value) == ("error: the scene has no animation 'walk'\n"
                                     "  expected: one of animation 0, animation 1, animation 2")


def turning(path):
    """A triangle that turns once a second; three animations of the same motion."""
    made = Maker()
    made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": made.accessor(
        np.array([[-1, -1, 0], [1, -1, 0], [0, 1.5, 0]], np.float32))}, "material": 0}]}]
    # White in a white world would not be seen.
    made.json["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.1, 0.1, 1], "metallicFactor": 0}}]
    made.json["nodes"] = [{"mesh": 0}]
    angles = np.arange(5) * np.pi / 2
    turns = np.stack([0 * angles, 0 * angles, np.sin(angles / 2), np.cos(angles / 2)], axis=1).astype(np.float32)
    sampler = {"input": made.accessor(np.linspace(0, 1, 5).astype(np.float32)), "output": made.accessor(turns)}
    made.json["animations"] = [{"samplers": [sampler], "channels": [
        {"sampler": 0, "target": {"node": 0, "path": "rotation"}}]} for _ in range(3)]
    made.write(path)
    return path


def test_the_command_writes_every_frame_of_an_animation(command, tmp_path):
    made = turning(tmp_path / "a.glb")

    def run(*arguments):
        return subprocess.run([command, "run", "studio", made, "--set", "extent=[32,32]", *arguments], capture_output=True,
                              text=True)

    done = run("--time", "0.2", "--frames", "3", "--time-step", "0.25", "--output", tmp_path / "f_%03d.png")
    assert done.returncode == 0, done.stderr
    frames = [(tmp_path / f"f_{i:03}.png").read_bytes() for i in range(3)]
    assert len(set(frames)) == 3
    assert run("--time", "0.7", "--output", tmp_path / "last.png").returncode == 0
    assert (tmp_path / "last.png").read_bytes() == frames[2]
    assert run("--time", "0.7", "--animation", "none", "--output", tmp_path / "rest.png").returncode == 0
    assert (tmp_path / "rest.png").read_bytes() != frames[2]
    wrong = run("--animation", "walk")
    assert wrong.returncode == 2
    assert wrong.stderr == ("error: the scene has no animation 'walk'\n"
                            "  expected: one of animation 0, animation 1, animation 2\n")
