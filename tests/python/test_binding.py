# SPDX-License-Identifier: Apache-2.0
"""The ctypes declarations against the C headers: every prototype, every structure."""

import ctypes
import re
import subprocess

import pytest

from heddle import _library

POINTERS_TO_OPAQUE = ("heddle_host", "heddle_scene", "heddle_graph")
STRUCTURES = {
    "heddle_host_options": _library.HostOptions, "heddle_image": _library.Image, "heddle_texture": _library.Texture,
    "heddle_mesh": _library.Mesh, "heddle_material": _library.SceneMaterial, "heddle_light": _library.SceneLight,
    "heddle_camera": _library.Camera, "heddle_render_options": _library.RenderOptions, "HeddleLight": _library.Light,
    "HeddleMaterial": _library.Material, "heddle_triangles": _library.Triangles,
    "heddle_load_options": _library.LoadOptions, "heddle_environment": _library.Environment,
}


def c_type(text):
    """The ctypes type that a C parameter or result stands for."""
    text = re.sub(r"\bconst\b", "", text)
    text = re.sub(r"\s+", " ", text).strip()
    array = re.search(r"\[\d*\]$", text)
    text = re.sub(r"\[\d*\]$", "", text)
    name = re.match(r"(\w+)", text).group(1)
    stars = text.count("*") + (1 if array else 0)
    if name in POINTERS_TO_OPAQUE:
        return {1: ctypes.c_void_p, 2: ctypes.POINTER(ctypes.c_void_p)}[stars]
    if name == "char":
        return {1: ctypes.c_char_p, 2: ctypes.POINTER(ctypes.c_char_p)}[stars]
    plain = {"void": None, "heddle_status": ctypes.c_int32, "uint32_t": ctypes.c_uint32, "double": ctypes.c_double}
    base = plain[name] if name in plain else STRUCTURES[name]
    return base if stars == 0 else ctypes.POINTER(base)


def prototypes(root):
    text = (root / "api" / "heddle" / "heddle.h").read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    found = {}
    for result, name, arguments in re.findall(r"HEDDLE_EXPORT\s+([\w\s*]+?)\b(heddle_\w+)\(([^)]*)\)", text):
        arguments = [] if arguments.strip() == "void" else [a.strip() for a in arguments.split(",")]
        found[name] = (c_type(result), [c_type(a) for a in arguments])
    return found


def test_every_exported_function_is_bound_with_its_types(root):
    declared = prototypes(root)
    assert len(declared) >= 30
    assert set(declared) == set(_library.PROTOTYPES)
    for name, (result, arguments) in declared.items():
        assert (result, arguments) == _library.PROTOTYPES[name], name


@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_have_the_c_layout(root, tmp_path, name):
    structure = STRUCTURES[name]
    fields = [field[0] for field in structure._fields_]
    offsets = "".join(f'printf("%zu ", offsetof({name}, {field}));' for field in fields)
    source = tmp_path / "layout.c"
    source.write_text("#include <stdio.h>\n#include <heddle/heddle.h>\n"
                      f'int main(void) {{ {offsets} printf("%zu", sizeof({name})); return 0; }}\n')
    program = tmp_path / "layout"
    subprocess.run(["cc", "-std=c11", f"-I{root / 'api'}", source, "-o", program], check=True)
    printed = [int(word) for word in subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()]
    assert printed == [getattr(structure, field).offset for field in fields] + [ctypes.sizeof(structure)]
