# SPDX-License-Identifier: Apache-2.0
"""A second, independent reading of glTF in numpy float64: the corners of all triangles at a time. For tests alone: it
trusts its files."""

import base64
import json
import pathlib
import struct
import urllib.parse

import numpy as np

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class File:
    def __init__(self, path):
        path = pathlib.Path(path)
        data = path.read_bytes()
        self.chunk = b""
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.json = json.loads(data[20:20 + length])
            self.chunk = data[28 + length:]
        else:
            self.json = json.loads(data)
        self.buffers = [self.chunk if "uri" not in buffer else base64.b64decode(buffer["uri"].split(",", 1)[1])
                        if buffer["uri"].startswith("data:")
                        else (path.parent / urllib.parse.unquote(buffer["uri"])).read_bytes()
                        for buffer in self.json.get("buffers", [])]

    def elements(self, view, offset, kind, width, count):
        view = self.json["bufferViews"][view]
        size = np.dtype(kind).itemsize * width
        stride = view.get("byteStride", size)
        start = view.get("byteOffset", 0) + offset
        raw = np.frombuffer(self.buffers[view["buffer"]], np.uint8)
        rows = start + stride * np.arange(count)[:, None] + np.arange(size)
        return np.ascontiguousarray(raw[rows]).view(kind).reshape(count, width)

    def accessor(self, index):
        """(count, width), float64 for floats and normalized integers, else integers."""
        made = self.json["accessors"][index]
        kind, width, count = COMPONENTS[made["componentType"]], WIDTHS[made["type"]], made["count"]
        if "bufferView" in made:
            values = self.elements(made["bufferView"], made.get("byteOffset", 0), kind, width, count).copy()
        else:
            values = np.zeros((count, width), kind)
        if "sparse" in made:
            sparse = made["sparse"]
            places = self.elements(sparse["indices"]["bufferView"], sparse["indices"].get("byteOffset", 0),
                                   COMPONENTS[sparse["indices"]["componentType"]], 1, sparse["count"])[:, 0]
            values[places] = self.elements(sparse["values"]["bufferView"], sparse["values"].get("byteOffset", 0), kind,
                                           width, sparse["count"])
        if made.get("normalized"):
            values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return values.astype(np.float64) if values.dtype.kind == "f" else values


def unit(q):
    return q / np.linalg.norm(q)


def sampled(times, values, interpolation, time, is_rotation):
    """Keys -> the value at a time. values: (keys, width), cubic (keys, 3, width)."""
    cubic = interpolation == "CUBICSPLINE"
    points = values[:, 1] if cubic else values
    if time <= times[0] or len(times) == 1:
        return points[0]
    if time >= times[-1]:
        return points[-1]
    k = int(np.searchsorted(times, time, side="right")) - 1
    if interpolation == "STEP":
        return points[k]
    step = times[k + 1] - times[k]
    t = (time - times[k]) / step
    if cubic:
        return ((2 * t**3 - 3 * t**2 + 1) * points[k] + step * (t**3 - 2 * t**2 + t) * values[k, 2]
                + (-2 * t**3 + 3 * t**2) * points[k + 1] + step * (t**3 - t**2) * values[k + 1, 0])
    if is_rotation:
        a, b = unit(points[k]), unit(points[k + 1])
        d = a @ b
        b, d = (-b, -d) if d < 0 else (b, d)
        angle = np.arccos(min(d, 1.0))
        if angle < 1e-6:  # then the chord is the arc, to 1e-13
            return (1 - t) * a + t * b
        return (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / np.sin(angle)
    return (1 - t) * points[k] + t * points[k + 1]


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = unit(np.asarray(node.get("rotation", (0, 0, 0, 1)), np.float64))
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def corners(file, time, animation=0):
    """(m, 3, 3) float64: corners of all triangles in the file's order, and the largest distance from which a coordinate
    was rounded."""
    made = file.json
    nodes = [dict(node) for node in made.get("nodes", [])]
    if animation is not None and animation < len(made.get("animations", [])):
        source = made["animations"][animation]
        for channel in source["channels"]:
            sampler = source["samplers"][channel["sampler"]]
            path, node = channel["target"]["path"], channel["target"]["node"]
            times = file.accessor(sampler["input"])[:, 0]
            values = np.asarray(file.accessor(sampler["output"]), np.float64)
            interpolation = sampler.get("interpolation", "LINEAR")
            width = values.size // len(times) // (3 if interpolation == "CUBICSPLINE" else 1)
            values = values.reshape((len(times), 3, width) if interpolation == "CUBICSPLINE" else (len(times), width))
            nodes[node][path] = sampled(times, values, interpolation, time, path == "rotation")
    places = [None] * len(nodes)
    parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}

    def place(i):
        if places[i] is None:
            local = local_matrix(nodes[i])
            places[i] = place(parents[i]) @ local if i in parents else local
        return places[i]

    shown = []

    def visit(i):
        shown.append(i)
        for child in nodes[i].get("children", []):
            visit(child)

    for root in made["scenes"][made.get("scene", 0)]["nodes"]:
        visit(root)
    result, origins = [], []
    for i in shown:
        node = nodes[i]
        if "mesh" not in node:
            continue
        mesh = made["meshes"][node["mesh"]]
        weights = node.get("weights", mesh.get("weights", ()))
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) != 4 or "POSITION" not in primitive["attributes"]:
                continue
            positions = np.asarray(file.accessor(primitive["attributes"]["POSITION"]), np.float64)
            for weight, target in zip(weights, primitive.get("targets", [])):
                if "POSITION" in target:
                    positions = positions + weight * file.accessor(target["POSITION"])
            index = (file.accessor(primitive["indices"])[:, 0].astype(int) if "indices" in primitive
                     else np.arange(len(positions)))
            homogeneous = np.column_stack([positions, np.ones(len(positions))])
            if "skin" in node and "JOINTS_0" in primitive["attributes"]:
                skin = made["skins"][node["skin"]]
                bind = (file.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
                        if "inverseBindMatrices" in skin else np.tile(np.eye(4), (len(skin["joints"]), 1, 1)))
                joints = np.stack([place(joint) @ bind[k] for k, joint in enumerate(skin["joints"])])
                weight = np.asarray(file.accessor(primitive["attributes"]["WEIGHTS_0"]), np.float64)
                blended = np.einsum("nk,nkij->nij", weight, joints[file.accessor(primitive["attributes"]["JOINTS_0"])])
                blended /= weight.sum(1)[:, None, None]
                world = np.einsum("nij,nj->ni", blended, homogeneous)[:, :3]
                mirrored = np.linalg.det(blended[:, :3, :3]) < 0
                origins.append(joints[0][:3, 3])
            else:
                world = (homogeneous @ place(i).T)[:, :3]
                mirrored = np.full(len(world), np.linalg.det(place(i)[:3, :3]) < 0)
                origins.append(place(i)[:3, 3])
            triangles = index.reshape(-1, 3)
            flip = mirrored[triangles[:, 0]]
            triangles = np.where(flip[:, None], triangles[:, [0, 2, 1]], triangles)
            result.append(world[triangles])
    everything = np.concatenate(result)
    reach = np.concatenate([everything.reshape(-1, 3), np.array(origins)])
    return everything, np.abs(reach - reach.mean(0)).max() * 2 + 1


def durations(file):
    return [max((file.accessor(sampler["input"]).max() for sampler in animation["samplers"]), default=0.0)
            for animation in file.json.get("animations", [])]
