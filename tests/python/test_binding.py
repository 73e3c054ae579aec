# SPDX-License-Identifier: Apache-2.0
"""The ctypes declarations against the C headers: every prototype, every structure."""

import ctypes
import re
import subprocess

import pytest

from heddle import _library
from heddle.comparison import TONE_MAPPERS
from heddle.host import ALPHA_MODES, LIGHT_TYPES

POINTERS_TO_OPAQUE = ("heddle_host", "heddle_scene", "heddle_graph", "heddle_comparison")
STRUCTURES = {
    "heddle_host_options": _library.HostOptions, "heddle_image": _library.Image, "heddle_texels": _library.Texels,
    "heddle_texture": _library.Texture, "heddle_mesh": _library.Mesh, "heddle_material": _library.SceneMaterial,
    "heddle_light": _library.SceneLight,
    "heddle_camera": _library.Camera, "heddle_render_options": _library.RenderOptions, "HeddleLight": _library.Light,
    "HeddleMaterial": _library.Material, "heddle_triangles": _library.Triangles,
    "heddle_load_options": _library.LoadOptions, "heddle_environment": _library.Environment,
    "heddle_compare_options": _library.CompareOptions,
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
    if name == "void" and stars:
        return {1: ctypes.c_void_p, 2: ctypes.POINTER(ctypes.c_void_p)}[stars]
    plain = {"uint8_t": ctypes.c_uint8, "void": None, "heddle_status": ctypes.c_int32, "uint32_t": ctypes.c_uint32, "uint64_t": ctypes.c_uint64,
             "double": ctypes.c_double, "float": ctypes.c_float}
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


# Constants of the headers that the package says in words of its own, by prefix: None where they are methods' business.
CONSTANTS = {
    "HEDDLE_NONE": _library.NONE, "HEDDLE_HOST_VALIDATION": _library.HOST_VALIDATION, "HEDDLE_HOST_CHECK": _library.HOST_CHECK,
    "HEDDLE_HOST_REMAKE": _library.HOST_REMAKE, "HEDDLE_HOST_LIVE": _library.HOST_LIVE,
    "HEDDLE_RENDER_PROFILE": _library.RENDER_PROFILE, "HEDDLE_RENDER_ANEW": _library.RENDER_ANEW,
    "HEDDLE_CANCELLED": _library.CANCELLED, "HEDDLE_ANIMATION_LOOP": _library.ANIMATION_LOOP,
    "HEDDLE_LOAD_TRUSTED": _library.LOAD_TRUSTED, "HEDDLE_TEXTURE_COUNT": _library.TEXTURE_COUNT,
    "HEDDLE_OWNER_SCENE": _library.OWNER_SCENE, "HEDDLE_OWNER_INSTANCE": _library.OWNER_INSTANCE,
    "HEDDLE_OWNER_MATERIAL": _library.OWNER_MATERIAL, "HEDDLE_OWNER_LIGHT": _library.OWNER_LIGHT,
    "HEDDLE_LIGHT_CASTS_SHADOW": 1, "HEDDLE_MATERIAL_DOUBLE_SIDED": 1, "HEDDLE_MATERIAL_UNLIT": 2,
    "HEDDLE_FILTER_NEAREST_MAGNIFIED": 1, "HEDDLE_HOST_REMAKE": _library.HOST_REMAKE,
    "HEDDLE_COMPARE_MAPS": _library.COMPARE_MAPS,
    **{f"HEDDLE_TONE_MAPPER_{name.upper()}": i for i, name in enumerate(TONE_MAPPERS)},
    **{f"HEDDLE_LIGHT_{name.upper()}": i for i, name in enumerate(LIGHT_TYPES)},
    **{f"HEDDLE_ALPHA_{name.upper()}": i for i, name in enumerate(ALPHA_MODES)},
}


def test_constants_have_the_headers_values(root, tmp_path):
    names = sorted(CONSTANTS)
    prints = "".join(f'printf("%lld ", (long long)({name}));' for name in names)
    source = tmp_path / "constants.c"
    source.write_text("#include <stdio.h>\n#include <heddle/components.h>\n#include <heddle/heddle.h>\n"
                      f"int main(void) {{ {prints} return 0; }}\n")
    program = tmp_path / "constants"
    subprocess.run(["cc", "-std=c11", f"-I{root / 'api'}", source, "-o", program], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    assert dict(zip(names, map(int, printed))) == {name: CONSTANTS[name] for name in names}


def test_every_constant_of_the_application_header_is_bound_or_known_to_have_no_use(root):
    text = (root / "api" / "heddle" / "heddle.h").read_text()
    declared = set(re.findall(r"^#define (HEDDLE_\w+) \w", text, re.M))
    # Python's textures are linear or nearest in all directions; files alone ask for the rest.
    unused = {"HEDDLE_FILTER_NEAREST_MINIFIED", "HEDDLE_FILTER_NEAREST_LEVEL", "HEDDLE_FILTER_FINEST_LEVEL"}
    assert declared - unused == declared & set(CONSTANTS)


def test_every_structure_of_the_application_header_is_bound(root):
    text = (root / "api" / "heddle" / "heddle.h").read_text()
    assert set(re.findall(r"^\} (heddle_\w+);", text, re.M)) <= set(STRUCTURES)


@pytest.mark.parametrize("name", STRUCTURES)
def test_every_field_is_bound_with_its_type(root, name):
    """Layouts alone would not tell a float from an integer of its size."""
    headers = "".join((root / "api" / "heddle" / file).read_text() for file in ("heddle.h", "records.h"))
    headers = re.sub(r"/\*.*?\*/|//[^\n]*", "", headers, flags=re.S)
    if name.startswith("Heddle"):
        body = re.search(rf"HEDDLE_BEGIN_RECORD\({name}\)(.*?)HEDDLE_END_RECORD", headers, re.S).group(1)
        floats = {field: kind != "UINT" for kind, field in re.findall(r"HEDDLE_(FLOAT|UINT|MAT)\d?\((\w+)\)", body)}
        kinds = {field: ctypes.c_float if is_float else ctypes.c_uint32 for field, is_float in floats.items()}
    else:
        body = re.search(rf"typedef struct {name} \{{(.*?)\}} {name};", headers, re.S).group(1)
        kinds = {}
        for declaration in filter(str.strip, body.split(";")):
            if "(" in declaration:  # a function
                kinds[re.search(r"\(\*\s*(\w+)\)", declaration).group(1)] = None
                continue
            words = re.sub(r"\bconst\b", "", declaration).strip()
            kind, rest = words.split(None, 1)
            for part in rest.split(","):
                field = re.search(r"(\w+)\s*(\[\w+\])?$", part.strip()).group(1)
                kinds[field] = c_type(kind.rstrip("*") + ("*" if "*" in words else ""))
    bound = {}
    for field, kind in structure_fields(STRUCTURES[name]):
        bound[field] = kind
    assert list(bound) == list(kinds)
    for field, kind in kinds.items():
        if kind is not None:
            assert bound[field] == kind, field


def structure_fields(structure):
    """(name, type), of arrays their element's."""
    for field, kind in structure._fields_:
        yield field, kind._type_ if issubclass(kind, ctypes.Array) else kind


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
