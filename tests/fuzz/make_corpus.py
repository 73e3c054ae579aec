# SPDX-License-Identifier: Apache-2.0
"""make_corpus.py FOLDER: writes the seeds of the glTF fuzzer, small synthetic files that reach every part of the loader.

What the fuzzer finds is added beside them by hand, under a name that says what it was.
"""

import base64
import json
import pathlib
import struct
import sys


class Made:
    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [], "meshes": [],
                     "accessors": [], "bufferViews": []}
        self.data = b""

    def accessor(self, code, kind, values, code_format, count, **more):
        self.data += bytes(-len(self.data) % 4)
        raw = struct.pack(f"<{len(values)}{code_format}", *values)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)})
        self.data += raw
        self.json["accessors"].append({"bufferView": len(self.json["bufferViews"]) - 1, "componentType": code, "type": kind,
                                       "count": count, **more})
        return len(self.json["accessors"]) - 1

    def floats(self, kind, width, *values):
        return self.accessor(5126, kind, values, "f", len(values) // width)

    def triangle(self):
        return {"attributes": {"POSITION": self.floats("VEC3", 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)},
                "indices": self.accessor(5123, "SCALAR", (0, 1, 2), "H", 3)}

    def node(self, **node):
        self.json["nodes"].append(node)
        self.json["scenes"][0]["nodes"] = list(range(len(self.json["nodes"])))

    def mesh(self, primitive, **more):
        self.json["meshes"].append({"primitives": [primitive], **more})
        return len(self.json["meshes"]) - 1

    def glb(self):
        data = self.data + bytes(-len(self.data) % 4)
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(data)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        return (b"glTF" + struct.pack("<III", 2, 28 + len(text) + len(data), len(text)) + b"JSON" + text
                + struct.pack("<I", len(data)) + b"BIN\0" + data)

    def gltf(self):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        return json.dumps({**self.json, "buffers": [{"byteLength": len(self.data), "uri": uri}]}).encode()


def plain():
    made = Made()
    made.node(mesh=made.mesh(made.triangle()))
    return made


def attributes():
    made = Made()
    triangle = made.triangle()
    triangle["attributes"].update(
        NORMAL=made.accessor(5120, "VEC3", (0, 0, 127) * 3, "b", 3, normalized=True),
        TEXCOORD_0=made.accessor(5123, "VEC2", (0, 0, 65535, 0, 0, 65535), "H", 3, normalized=True),
        TEXCOORD_1=made.floats("VEC2", 2, 0, 0, 1, 0, 0, 1), TANGENT=made.floats("VEC4", 4, *(1, 0, 0, 1) * 3),
        COLOR_0=made.accessor(5121, "VEC4", (255, 0, 0, 255) * 3, "B", 3, normalized=True))
    triangle["mode"] = 5
    triangle["material"] = 0
    made.json["materials"] = [{
        "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": True, "emissiveFactor": [1, 0, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0.1, "roughnessFactor": 0.2},
        "extensions": {"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_unlit": {},
                       "KHR_materials_emissive_strength": {"emissiveStrength": 3}}}]
    made.json["extensionsUsed"] = ["KHR_materials_ior", "KHR_materials_unlit", "KHR_unknown"]
    made.node(mesh=made.mesh(triangle), matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1])
    return made


def sparse():
    made = plain()
    places = made.accessor(5121, "SCALAR", (1,), "B", 1)
    values = made.floats("VEC3", 3, 5, 6, 7)
    view = made.json["accessors"]
    view[0]["sparse"] = {"count": 1, "indices": {"bufferView": view[places]["bufferView"], "componentType": 5121},
                         "values": {"bufferView": view[values]["bufferView"]}}
    return made


def animated():
    made = Made()
    triangle = made.triangle()
    triangle["attributes"]["JOINTS_0"] = made.accessor(5121, "VEC4", (0, 1, 0, 0) * 3, "B", 3)
    triangle["attributes"]["WEIGHTS_0"] = made.floats("VEC4", 4, *(0.5, 0.5, 0, 0) * 3)
    triangle["targets"] = [{"POSITION": made.floats("VEC3", 3, 0, 0, 1, 0, 0, 0, 0, 0, 0)}]
    made.node(mesh=made.mesh(triangle, weights=[0.5]), skin=0)
    made.node(children=[2], translation=[1, 0, 0])
    made.node(rotation=[0, 0, 0, 1])
    made.json["scenes"][0]["nodes"] = [0, 1]
    made.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": made.floats("MAT4", 16, *(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1) * 2)}]
    times = made.floats("SCALAR", 1, 0, 1)
    samplers = [{"input": times, "output": made.floats("VEC4", 4, 0, 0, 0, 1, 0, 0.7, 0, 0.7)},
                {"input": times, "output": made.floats("SCALAR", 1, 0, 1), "interpolation": "STEP"},
                {"input": times, "output": made.floats("VEC3", 3, *range(18)), "interpolation": "CUBICSPLINE"}]
    made.json["animations"] = [{"samplers": samplers, "channels": [
        {"sampler": 0, "target": {"node": 2, "path": "rotation"}}, {"sampler": 1, "target": {"node": 0, "path": "weights"}},
        {"sampler": 2, "target": {"node": 1, "path": "translation"}}]}]
    return made


def lit():
    made = plain()
    made.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}},
                            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9}}]
    made.json["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 9, "range": 5, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}, {"type": "point"}]}}
    made.json["extensionsUsed"] = ["KHR_lights_punctual"]
    made.node(camera=0, extensions={"KHR_lights_punctual": {"light": 0}}, scale=[2, 2, 2])
    made.node(camera=1, extensions={"KHR_lights_punctual": {"light": 1}})
    return made


def textured():
    made = plain()
    png = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==")
    made.data += bytes(-len(made.data) % 4)
    made.json["bufferViews"].append({"buffer": 0, "byteOffset": len(made.data), "byteLength": len(png)})
    made.data += png
    made.json["images"] = [{"bufferView": len(made.json["bufferViews"]) - 1, "mimeType": "image/png"}, {"uri": "a.bin"}]
    made.json["samplers"] = [{"wrapS": 33071, "minFilter": 9984, "magFilter": 9728}]
    made.json["textures"] = [{"source": 0, "sampler": 0}]
    made.json["materials"] = [{"normalTexture": {"index": 0, "scale": 2, "extensions": {"KHR_texture_transform": {"offset": [1, 2], "rotation": 3, "scale": [4, 5], "texCoord": 1}}}}]
    made.json["meshes"][0]["primitives"][0]["material"] = 0
    return made


def external():
    made = plain()
    text = json.dumps({**made.json, "buffers": [{"byteLength": 256, "uri": "a.bin"}]})
    return text.encode()


def main():
    folder = pathlib.Path(sys.argv[1])
    for make in (plain, attributes, sparse, animated, lit, textured):
        (folder / f"{make.__name__}.glb").write_bytes(make().glb())
    (folder / "embedded.gltf").write_bytes(animated().gltf())
    (folder / "external.gltf").write_bytes(external())


main()
