# SPDX-License-Identifier: Apache-2.0
"""libheddle.so through ctypes: structures and prototypes exactly as in api/heddle/heddle.h and records.h."""

import ctypes
import os
import pathlib
from ctypes import POINTER, Structure, c_char_p, c_double, c_float, c_int32, c_uint8, c_uint32, c_uint64, c_void_p

NONE = 0xFFFFFFFF
TEXTURE_COUNT = 5
HOST_VALIDATION = 1
HOST_CHECK = 2
HOST_REMAKE = 4
HOST_LIVE = 8
RENDER_PROFILE = 1
RENDER_ANEW = 2
ANIMATION_LOOP = 1
LOAD_TRUSTED = 1
COMPARE_MAPS = 1
CANCELLED = 6
OWNER_SCENE, OWNER_INSTANCE, OWNER_MATERIAL, OWNER_LIGHT = range(4)

LogFunction = ctypes.CFUNCTYPE(None, c_void_p, c_uint32, c_char_p)
ProgressFunction = ctypes.CFUNCTYPE(c_uint32, c_void_p, c_char_p, c_double)


class Light(Structure):
    """HeddleLight: see records.h for units and meaning of every field."""

    _fields_ = [
        ("position_rel", c_float * 3), ("type", c_uint32),
        ("direction", c_float * 3), ("range", c_float),
        ("intensity", c_float * 3), ("radius", c_float),
        ("tangent", c_float * 3), ("segment_length", c_float),
        ("half_extent", c_float * 3), ("flags", c_uint32),
        ("cos_inner", c_float), ("cos_outer", c_float), ("id", c_uint32), ("texture", c_uint32),
    ]


class Material(Structure):
    """HeddleMaterial: see records.h."""

    _fields_ = [
        ("base_color", c_float * 4), ("emissive", c_float * 3), ("alpha_cutoff", c_float),
        ("metalness", c_float), ("roughness", c_float), ("normal_scale", c_float), ("occlusion_strength", c_float),
        ("alpha_mode", c_uint32), ("flags", c_uint32), ("ior", c_float), ("transmission", c_float),
        ("texture_layer", c_uint32 * 4), ("texture_layer_4", c_uint32), ("texture_uv_sets", c_uint32),
        ("texture_group", c_uint32), ("id", c_uint32),
        ("uv_rotation_scale", c_float * 4), ("uv_offset", c_float * 2), ("reserved_", c_float * 2),
        ("uv_rotation_scale_1", c_float * 4), ("uv_rotation_scale_2", c_float * 4), ("uv_rotation_scale_3", c_float * 4),
        ("uv_rotation_scale_4", c_float * 4), ("uv_offset_1_2", c_float * 4), ("uv_offset_3_4", c_float * 4),
    ]


class HostOptions(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("flags", c_uint32), ("device", c_char_p), ("plugin_path", c_char_p),
        ("cache_path", c_char_p), ("log", LogFunction), ("log_user", c_void_p),
        ("progress", ProgressFunction), ("progress_user", c_void_p),
    ]


class Image(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("channels", c_uint32),
        ("pixels", POINTER(c_float)),
    ]


class Texels(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("format", c_uint32),
        ("texel_bytes", c_uint32), ("reserved", c_uint32), ("size", c_uint64), ("bytes", c_void_p),
    ]


class Texture(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("is_srgb", c_uint32),
        ("wrap_u", c_uint32), ("wrap_v", c_uint32), ("filter", c_uint32), ("rgba", POINTER(c_uint8)),
    ]


class Mesh(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("vertex_count", c_uint32), ("index_count", c_uint32), ("reserved", c_uint32),
        ("positions", POINTER(c_float)), ("normals", POINTER(c_float)), ("tangents", POINTER(c_float)),
        ("uv0", POINTER(c_float)), ("uv1", POINTER(c_float)), ("colors", POINTER(c_float)),
        ("indices", POINTER(c_uint32)), ("face_count", c_uint32), ("crease_count", c_uint32),
        ("face_sizes", POINTER(c_uint32)), ("creases", POINTER(c_uint32)), ("sharpness", POINTER(c_float)),
    ]


class SceneMaterial(Structure):
    _fields_ = [("struct_size", c_uint32), ("textures", c_uint32 * TEXTURE_COUNT), ("record", Material)]


class SceneLight(Structure):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32), ("position", c_double * 3), ("record", Light)]


class Camera(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("is_orthographic", c_uint32), ("position", c_double * 3), ("rotation", c_double * 4),
        ("vertical_angle", c_double), ("aspect", c_double), ("near_distance", c_double), ("far_distance", c_double),
    ]


class LoadOptions(Structure):
    _fields_ = [("struct_size", c_uint32), ("flags", c_uint32), ("memory_limit", c_uint64)]


class Triangles(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("vertex_count", c_uint32), ("triangle_count", c_uint32), ("reserved", c_uint32),
        ("origin", c_double * 3), ("positions", POINTER(c_float)), ("normals", POINTER(c_float)), ("uvs", POINTER(c_float)),
        ("indices", POINTER(c_uint32)), ("materials", POINTER(c_uint32)),
    ]


class Environment(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("channels", c_uint32),
        ("pixels", POINTER(c_float)), ("scale", c_double), ("rotation", c_double * 4),
    ]


class RenderOptions(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("flags", c_uint32), ("time", c_double), ("time_step", c_double), ("seed", c_uint64),
        ("cut", c_uint32), ("reserved", c_uint32),
    ]


class CompareOptions(Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("flags", c_uint32), ("metrics", c_char_p), ("pixels_per_degree", c_double),
        ("start_exposure", c_double), ("stop_exposure", c_double), ("exposure_count", c_uint32), ("tone_mapper", c_uint32),
        ("threads", c_uint32), ("reserved", c_uint32),
    ]


_TEXT = POINTER(c_char_p)
_ID = POINTER(c_uint32)
_MATRIX = POINTER(c_double)

# name: (result, arguments). Pointers to hosts, scenes and graphs are void pointers.
PROTOTYPES = {
    "heddle_version": (c_char_p, []),
    "heddle_create": (c_int32, [POINTER(HostOptions), POINTER(c_void_p)]),
    "heddle_destroy": (None, [c_void_p]),
    "heddle_error": (c_char_p, [c_void_p]),
    "heddle_list": (c_int32, [c_void_p, _TEXT]),
    "heddle_cancel": (None, [c_void_p]),
    "heddle_schema": (c_int32, [c_void_p, c_char_p, _TEXT]),
    "heddle_devices": (c_int32, [c_void_p, _TEXT]),
    "heddle_doctor": (c_int32, [c_void_p, _TEXT]),
    "heddle_scene_create": (c_int32, [c_void_p, POINTER(c_void_p)]),
    "heddle_scene_destroy": (None, [c_void_p]),
    "heddle_scene_load": (c_int32, [c_void_p, c_char_p]),
    "heddle_scene_load_with": (c_int32, [c_void_p, c_char_p, POINTER(LoadOptions)]),
    "heddle_scene_add_texture": (c_int32, [c_void_p, c_char_p, POINTER(Texture), _ID]),
    "heddle_scene_add_material": (c_int32, [c_void_p, c_char_p, POINTER(SceneMaterial), _ID]),
    "heddle_scene_add_mesh": (c_int32, [c_void_p, c_char_p, POINTER(Mesh), c_uint32, _ID]),
    "heddle_scene_add_instance": (c_int32, [c_void_p, c_char_p, c_uint32, _MATRIX, _ID]),
    "heddle_scene_add_light": (c_int32, [c_void_p, c_char_p, POINTER(SceneLight), _ID]),
    "heddle_scene_add_camera": (c_int32, [c_void_p, c_char_p, POINTER(Camera), _ID]),
    "heddle_scene_set_instance": (c_int32, [c_void_p, c_uint32, _MATRIX]),
    "heddle_scene_set_light": (c_int32, [c_void_p, c_uint32, POINTER(SceneLight)]),
    "heddle_scene_set_light_texture": (c_int32, [c_void_p, c_uint32, POINTER(Image)]),
    "heddle_scene_set_camera": (c_int32, [c_void_p, c_uint32, POINTER(Camera)]),
    "heddle_scene_set_environment": (c_int32, [c_void_p, POINTER(Environment)]),
    "heddle_scene_set_component": (c_int32, [c_void_p, c_uint32, c_uint32, c_char_p, c_char_p]),
    "heddle_scene_use_camera": (c_int32, [c_void_p, c_uint32]),
    "heddle_scene_get_camera": (c_int32, [c_void_p, c_uint32, c_uint32, POINTER(Camera)]),
    "heddle_scene_describe": (c_int32, [c_void_p, _TEXT]),
    "heddle_scene_files": (c_int32, [c_void_p, _TEXT]),
    "heddle_scene_use_animation": (c_int32, [c_void_p, c_uint32, c_uint32]),
    "heddle_scene_set_time": (c_int32, [c_void_p, c_double]),
    "heddle_scene_triangles": (c_int32, [c_void_p, POINTER(Triangles)]),
    "heddle_graph_load": (c_int32, [c_void_p, c_char_p, POINTER(c_char_p), c_uint32, POINTER(c_void_p)]),
    "heddle_graph_parse": (
        c_int32, [c_void_p, c_char_p, c_char_p, c_char_p, POINTER(c_char_p), c_uint32, POINTER(c_void_p)]),
    "heddle_graph_destroy": (None, [c_void_p]),
    "heddle_graph_explain": (c_int32, [c_void_p, c_char_p, _TEXT]),
    "heddle_graph_explain_pass": (c_int32, [c_void_p, c_char_p, c_char_p, _TEXT]),
    "heddle_graph_describe": (c_int32, [c_void_p, _TEXT]),
    "heddle_graph_keep": (c_int32, [c_void_p, c_char_p]),
    "heddle_graph_set": (c_int32, [c_void_p, c_char_p]),
    "heddle_graph_get": (c_int32, [c_void_p, c_char_p, _TEXT]),
    "heddle_graph_reload": (c_int32, [c_void_p]),
    "heddle_graph_files": (c_int32, [c_void_p, _TEXT]),
    "heddle_render": (c_int32, [c_void_p, c_void_p, POINTER(RenderOptions)]),
    "heddle_read": (c_int32, [c_void_p, c_char_p, c_uint32, c_uint32, POINTER(Image)]),
    "heddle_read_into": (
        c_int32, [c_void_p, c_char_p, c_uint32, c_uint32, POINTER(c_float), c_uint64, POINTER(Image)]),
    "heddle_read_texels": (
        c_int32, [c_void_p, c_char_p, c_uint32, c_uint32, c_void_p, c_uint64, POINTER(Texels)]),
    "heddle_inspect": (
        c_int32, [c_void_p, c_void_p, POINTER(RenderOptions), POINTER(c_uint32), c_uint32, c_char_p, _TEXT]),
    "heddle_graph_check": (c_int32, [c_void_p, c_void_p, POINTER(RenderOptions), c_uint32, _TEXT]),
    "heddle_stats": (c_int32, [c_void_p, _TEXT]),
    "heddle_job_run": (c_int32, [c_void_p, c_void_p, POINTER(RenderOptions), _TEXT]),
    "heddle_job_artifact": (c_int32, [c_void_p, c_char_p, POINTER(c_void_p), POINTER(c_uint64)]),
    "heddle_image_read": (c_int32, [c_void_p, c_char_p, POINTER(Image)]),
    "heddle_image_write": (c_int32, [c_void_p, c_char_p, POINTER(Image)]),
    "heddle_image_compare": (c_int32, [c_void_p, POINTER(Image), POINTER(Image), c_char_p, _TEXT]),
    "heddle_metrics": (c_char_p, []),
    "heddle_compare": (
        c_int32, [POINTER(Image), POINTER(Image), POINTER(CompareOptions), POINTER(c_void_p)]),
    "heddle_comparison_destroy": (None, [c_void_p]),
    "heddle_comparison_describe": (c_char_p, [c_void_p]),
    "heddle_comparison_map": (c_int32, [c_void_p, c_char_p, POINTER(Image)]),
    "heddle_write_error_image": (c_int32, [c_void_p, c_char_p, POINTER(Image), c_double]),
}


def find() -> pathlib.Path:
    """Path of libheddle.so: HEDDLE_LIBRARY, else an installed prefix, else build/ of the source tree."""
    chosen = os.environ.get("HEDDLE_LIBRARY")
    if chosen:
        return pathlib.Path(chosen)
    package = pathlib.Path(__file__).resolve().parent
    candidates = [
        package.parents[2] / "libheddle.so",  # PREFIX/lib/heddle/python/heddle
        package.parents[1] / "build" / "lib" / "libheddle.so",  # scripts/heddle of the source tree
    ]
    for candidate in candidates:
        if candidate.exists():
            return candidate
    places = ", ".join(str(candidate) for candidate in candidates)
    raise ImportError(f"libheddle.so was not found in {places}: build Heddle, or set HEDDLE_LIBRARY to its path")


def load() -> ctypes.CDLL:
    """The library, with every prototype set."""
    library = ctypes.CDLL(str(find()))
    for name, (result, arguments) in PROTOTYPES.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library
