# SPDX-License-Identifier: Apache-2.0
"""Hosts, scenes and graphs as Python objects over the C API."""

from __future__ import annotations

import contextlib
import ctypes
import json
import pathlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library as c
from ._toml import plain, toml

_heddle = c.load()

LIGHT_TYPES = ("directional", "point", "spot", "sphere", "capsule", "cone", "wedge", "box", "rectangle", "environment")
ALPHA_MODES = ("opaque", "mask", "blend")
WRAPS = ("repeat", "mirror", "clamp")
# A value of a setting or of a component's property.
Value = Union[bool, int, float, str, Sequence[Any]]
_Self = TypeVar("_Self", bound="_Object")


class Error(RuntimeError):
    """A call failed. `status` is the heddle_status (2 bad input, 3 unsupported, 4 failed, 5 bug, 6 cancelled)."""

    def __init__(self, status: int, message: str):
        super().__init__(message)
        self.status = status


def version() -> str:
    """Version of the library, "0.1.0"."""
    return _heddle.heddle_version().decode()


def _encode(text: str | None) -> bytes | None:
    return None if text is None else text.encode()


def _floats(values: ArrayLike | None, columns: int, what: str) -> NDArray[np.float32] | None:
    if values is None:
        return None
    array = np.ascontiguousarray(values, dtype=np.float32)
    if array.ndim != 2 or array.shape[1] != columns:
        raise Error(2, f"error: {what} has shape {array.shape}: expected (n, {columns})")
    return array


def _pointer(array: NDArray | None, kind: Any) -> Any:
    return None if array is None else array.ctypes.data_as(ctypes.POINTER(kind))


def _choice(value: str, names: Sequence[str], what: str) -> int:
    if value not in names:
        raise Error(2, f"error: unknown {what} '{value}'\n  expected: one of {', '.join(names)}")
    return names.index(value)


class _Object:
    """An object of the C API; destroyed by close(), `with`, or with the Python object.

    Finalizers run in any order (cycles, the end of the interpreter), so a host keeps the handles of what was made from it
    and destroys those first; what lost its host that way does nothing more.
    """

    _destroy: Callable[[Any], Any]

    def __init__(self, handle: ctypes.c_void_p, host: Host | None):
        self._raw: int | None = handle.value
        self._host = host
        self._children: dict[int, Callable] = {}
        if host is not None:
            host._children[handle.value or 0] = type(self)._destroy

    @property
    def _handle(self) -> ctypes.c_void_p:
        if self._raw is None or (self._host is not None and self._raw not in self._host._children):
            raise Error(2, f"error: this {type(self).__name__} is closed, or its Host is")
        return ctypes.c_void_p(self._raw)

    def close(self) -> None:
        """Destroys the object, and for a host everything made from it; a second call does nothing."""
        raw, self._raw = getattr(self, "_raw", None), None
        if raw is None:
            return
        if self._host is not None:
            destroy = self._host._children.pop(raw, None)
            if destroy is not None:
                destroy(raw)
            return
        # Graphs before scenes: a graph may hold what it uploaded of a scene.
        for child, end in sorted(self._children.items(), key=lambda item: item[1] is not Graph._destroy):
            end(child)
        self._children.clear()
        type(self)._destroy(raw)

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def _check(self, status: int) -> None:
        if not status:
            return
        host: Any = self._host if self._host is not None else self
        raised, host._raised = host._raised, None
        if raised is not None:  # by the progress callback: the call ended for its sake
            raise raised
        raise Error(status, _heddle.heddle_error(host._handle).decode())


class Host(_Object):
    """Roles, techniques and a device. Opens no plugin and no device before the first frame.

    device:      part of a device's name or its index; None: lavapipe, else the first usable
    validation:  run with Vulkan's validation layer; what it finds raises Error
    check:       prove of each frame that barriers cover every hazard, and search what passes make for NaN, Inf and values
                 out of their role's range; what is found raises Error. Slow. Render three frames
    plugin_path: folders separated by ':'; None: the library's own
    remake:      make artifacts that the cache holds again, and replace them
    live:        wait for no frame before the next one: stages with latency take the newest copy of the GPU's work that is
                 there, and no bytes are promised. Not together with check
    log:         called with (severity 0 error, 1 warning, 2 information; text); None: warnings go to stderr
    progress:    called with (what the host is at, how much of that is done, 0..1) while it loads, plans and renders; what
                 it raises, an interrupt from the keyboard too, ends the call, leaves everything as before, and is raised
                 by the call
    raises:      Error
    """

    _destroy = _heddle.heddle_destroy

    def __init__(self, device: str | None = None, validation: bool = False, plugin_path: str | None = None,
                 log: Callable[[int, str], None] | None = None, check: bool = False,
                 progress: Callable[[str, float], object] | None = None, remake: bool = False,
                 live: bool = False):
        self._raised: BaseException | None = None
        say = log if log is not None else _log_to_stderr
        self._log = c.LogFunction(lambda _user, severity, text: say(severity, text.decode()))
        flags = (c.HOST_VALIDATION if validation else 0) | (c.HOST_CHECK if check else 0)
        flags |= (c.HOST_REMAKE if remake else 0) | (c.HOST_LIVE if live else 0)
        self._listeners: list[Callable[[str, float], object]] = [] if progress is None else [progress]
        tell: Any = c.ProgressFunction
        self._progress = tell(self._tell)
        options = c.HostOptions(ctypes.sizeof(c.HostOptions), flags, _encode(device), _encode(plugin_path), None,
                                self._log, None, self._progress, None)
        handle = ctypes.c_void_p()
        status = _heddle.heddle_create(ctypes.byref(options), ctypes.byref(handle))
        if status:
            raise Error(status, _heddle.heddle_error(None).decode())
        super().__init__(handle, None)

    def _tell(self, _user: Any, activity: bytes, fraction: float) -> int:
        try:
            for progress in self._listeners:
                progress(activity.decode(), fraction)
        except BaseException as raised:  # nothing may leave into C
            self._raised = raised
            return 1
        return 0

    @contextlib.contextmanager
    def _told(self, progress: Callable[[str, float], object] | None) -> Iterator[None]:
        """One more who is told of progress meanwhile."""
        if progress is not None:
            self._listeners.append(progress)
        try:
            yield
        finally:
            if progress is not None:
                self._listeners.remove(progress)

    def _text(self, function: Any) -> str:
        text = ctypes.c_char_p()
        self._check(function(self._handle, ctypes.byref(text)))
        return _decode(text)

    def cancel(self) -> None:
        """Stops the frame that renders, or else the next one: its call raises Error with status 6. From any thread."""
        _heddle.heddle_cancel(self._handle)

    def schema(self, kind: str = "graph") -> dict:
        """A JSON Schema (draft 7) of "graph" files, made from manifests alone, or of "scene" overlays."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_schema(self._handle, kind.encode(), ctypes.byref(text)))
        return json.loads(text.value.decode())

    def list(self) -> dict:
        """Roles and techniques, from manifests alone."""
        return json.loads(self._text(_heddle.heddle_list))

    def devices(self) -> Sequence[dict]:
        """Vulkan devices of this machine."""
        return json.loads(self._text(_heddle.heddle_devices))["devices"]

    def doctor(self) -> dict:
        """What this machine lacks, and what each technique does here."""
        return json.loads(self._text(_heddle.heddle_doctor))

    def scene(self) -> Scene:
        """An empty scene."""
        handle = ctypes.c_void_p()
        self._check(_heddle.heddle_scene_create(self._handle, ctypes.byref(handle)))
        return Scene(handle, self)

    def graph(self, file: str | pathlib.Path = "deferred", settings: Sequence[str] = ()) -> Graph:
        """A graph from a TOML file, or a shipped one by name; settings as "ao.technique=gtao".

        raises: Error, also for a file that is a job
        """
        made = self._weave(file, settings)
        if isinstance(made, Job):
            made.close()
            raise Error(2, f"{file}: error: this graph is a job, and renders no frames\n  help:     Host.job opens it")
        return made

    def job(self, file: str | pathlib.Path, settings: Sequence[str] = ()) -> Job:
        """A job from a TOML file that says kind = "job"; settings as for `graph`.

        raises: Error, also for a graph that renders frames
        """
        made = self._weave(file, settings)
        if isinstance(made, Graph):
            made.close()
            raise Error(2, f"{file}: error: this graph renders frames, and is no job\n  help:     a job says kind = \"job\"; "
                           "Host.graph opens the others")
        return made

    def _weave(self, file: str | pathlib.Path, settings: Sequence[str]) -> Graph | Job:
        texts = (ctypes.c_char_p * max(len(settings), 1))(*[setting.encode() for setting in settings])
        handle = ctypes.c_void_p()
        self._check(_heddle.heddle_graph_load(self._handle, str(file).encode(), texts, len(settings),
                                              ctypes.byref(handle)))
        graph = Graph(handle, self)
        if graph.describe()["kind"] == "frame":
            return graph
        graph._raw = None  # the handle is the job's now
        return Job(handle, self)

    def parse(self, text: str, name: str = "text", folder: str | pathlib.Path = "", settings: Sequence[str] = ()) -> Graph:
        """A graph from TOML text, which errors call `name`; files that it names are looked for in `folder`.

        raises: Error
        """
        texts = (ctypes.c_char_p * max(len(settings), 1))(*[setting.encode() for setting in settings])
        handle = ctypes.c_void_p()
        self._check(_heddle.heddle_graph_parse(self._handle, text.encode(), name.encode(), str(folder).encode(), texts,
                                               len(settings), ctypes.byref(handle)))
        return Graph(handle, self)

    def read_image(self, file: str | pathlib.Path) -> NDArray[np.float32]:
        """float32 (height, width, channels); values of 8-bit files are 0..1 as stored."""
        image = c.Image(ctypes.sizeof(c.Image))
        self._check(_heddle.heddle_image_read(self._handle, str(file).encode(), ctypes.byref(image)))
        return _to_array(image)

    def write_image(self, file: str | pathlib.Path, pixels: ArrayLike) -> None:
        """pixels: (height, width, channels) or (height, width); 8-bit formats clamp to 0..1 and round."""
        image, _keep = _to_image(pixels)
        self._check(_heddle.heddle_image_write(self._handle, str(file).encode(), ctypes.byref(image)))

    def write_error_image(self, file: str | pathlib.Path, image: ArrayLike, white: float = 1.0) -> None:
        """Writes what error_image() made: numbers into .exr, .hdr and .pfm, else false colours from 0, black, to `white`."""
        record, _keep = _to_image(image)
        self._check(_heddle.heddle_write_error_image(self._handle, str(file).encode(), ctypes.byref(record), white))

    def compare(self, pixels: ArrayLike, reference: ArrayLike, difference: str | pathlib.Path | None = None) -> dict:
        """Metrics of pixels against a reference of the same shape (rmse, mse, relmse, psnr, mean_difference, maximum,
        percentile_99, ...; formulas in host/compare/metrics.hpp). difference: file for |pixels - reference|.

        raises: Error if shapes differ or a value is not finite (names the first such pixel)
        """
        a, _keep_a = _to_image(pixels)
        b, _keep_b = _to_image(reference)
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_image_compare(self._handle, ctypes.byref(a), ctypes.byref(b),
                                                 _encode(None if difference is None else str(difference)),
                                                 ctypes.byref(text)))
        return json.loads(_decode(text))


class Scene(_Object):
    """What is rendered. Everything added gets an id, counted from 0 by kind."""

    _destroy = _heddle.heddle_scene_destroy
    _time = 0.0  # of the last set_time or render

    def load(self, file: str | pathlib.Path, trusted: bool = False, memory_limit: int = 0) -> None:
        """Adds a glTF 2.0 file (.gltf, .glb), all of it or nothing.

        memory_limit: bytes that loading may make, added up, which bounds its time too; 0: 4 GiB
        trusted:      no limit, and files outside of the file's folder may be read
        """
        options = c.LoadOptions(ctypes.sizeof(c.LoadOptions), c.LOAD_TRUSTED if trusted else 0, memory_limit)
        self._check(_heddle.heddle_scene_load_with(self._handle, str(file).encode(), ctypes.byref(options)))

    def texture(self, pixels: ArrayLike, srgb: bool = True, wrap: str = "repeat", name: str | None = None,
                nearest: bool = False) -> int:
        """pixels: uint8 (height, width, 4), top row first. wrap: repeat, mirror or clamp. nearest: texels are seen as
        squares. Returns the id. raises: Error for another shape, and for numbers that are no integers of 0 to 255"""
        given = np.asarray(pixels)
        array = np.ascontiguousarray(given, dtype=np.uint8)
        if given.dtype.kind not in "iub" or not np.array_equal(array, given):
            raise Error(2, f"error: a texture is of {given.dtype}: expected uint8, 0 to 255\n  help:     "
                           "(255 * pixels + 0.5).astype(numpy.uint8) for numbers of 0 to 1")
        if array.ndim != 3 or array.shape[2] != 4:
            raise Error(2, f"error: a texture has shape {array.shape}: expected (height, width, 4)")
        side = _choice(wrap, WRAPS, "wrap")
        record = c.Texture(ctypes.sizeof(c.Texture), array.shape[1], array.shape[0], int(srgb), side, side, int(nearest),
                           _pointer(array, ctypes.c_uint8))
        return self._add(_heddle.heddle_scene_add_texture, name, ctypes.byref(record))

    def material(self, name: str | None = None, base_color: Sequence[float] = (0.8, 0.8, 0.8, 1.0),
                 metalness: float = 0.0, roughness: float = 0.5, emissive: Sequence[float] = (0, 0, 0),
                 alpha_mode: str = "opaque", alpha_cutoff: float = 0.5, double_sided: bool = False, unlit: bool = False,
                 ior: float = 1.5, normal_scale: float = 1.0, occlusion_strength: float = 1.0,
                 base_color_texture: int | None = None, metallic_roughness_texture: int | None = None,
                 normal_texture: int | None = None, occlusion_texture: int | None = None,
                 emissive_texture: int | None = None, transmission: float = 0.0) -> int:
        """glTF's metallic-roughness model. Colours linear Rec.709, emissive in cd/m^2; transmission: share of light, 0 to
        1, that passes what the surface reflects at once. Returns the id."""
        record = c.Material()
        color = tuple(base_color) + (1.0,) * (4 - len(base_color))
        record.base_color[:] = color
        record.emissive[:] = tuple(emissive)
        record.alpha_cutoff = alpha_cutoff
        record.metalness = metalness
        record.roughness = roughness
        record.normal_scale = normal_scale
        record.occlusion_strength = occlusion_strength
        record.alpha_mode = _choice(alpha_mode, ALPHA_MODES, "alpha_mode")
        record.flags = (1 if double_sided else 0) | (2 if unlit else 0)
        record.ior = ior
        record.transmission = transmission
        record.uv_rotation_scale[:] = (1, 0, 0, 1)
        textures = (base_color_texture, metallic_roughness_texture, normal_texture, occlusion_texture, emissive_texture)
        ids = (ctypes.c_uint32 * c.TEXTURE_COUNT)(*[c.NONE if t is None else t for t in textures])
        material = c.SceneMaterial(ctypes.sizeof(c.SceneMaterial), ids, record)
        return self._add(_heddle.heddle_scene_add_material, name, ctypes.byref(material))

    def mesh(self, positions: ArrayLike, material: int, indices: ArrayLike | None = None,
             normals: ArrayLike | None = None, tangents: ArrayLike | None = None, uv0: ArrayLike | None = None,
             uv1: ArrayLike | None = None, colors: ArrayLike | None = None, name: str | None = None,
             faces: Sequence[Sequence[int]] | None = None,
             creases: Sequence[tuple[int, int, float]] | None = None) -> int:
        """positions (n, 3) metres; indices (m, 3) or (3m,); normals (n, 3); tangents (n, 4); uv0, uv1 (n, 2);
        colors (n, 4) linear. Normals and tangents are made where missing. Returns the id.

        faces: in place of indices: lists of vertices, 3 or more each, counter-clockwise, convex and nearly flat. They are
            drawn as triangles; what subdivides surfaces sees the faces.
        creases: edges that a subdivided surface keeps sharp: (vertex, vertex, sharpness), a vertex by itself as (vertex,
            vertex, sharpness) with the same twice. 0 is smooth, n sharp for n levels, 10 and above for ever."""
        if faces is not None and indices is not None:
            raise Error(2, "error: a mesh has indices and faces: expected one of them")
        arrays = {
            "positions": _floats(positions, 3, "positions"), "normals": _floats(normals, 3, "normals"),
            "tangents": _floats(tangents, 4, "tangents"), "uv0": _floats(uv0, 2, "uv0"), "uv1": _floats(uv1, 2, "uv1"),
            "colors": _floats(colors, 4, "colors"),
        }
        count = len(positions)  # type: ignore[arg-type]  # two-dimensional, as _floats found
        for what, array in arrays.items():
            if array is not None and len(array) != count:
                raise Error(2, f"error: {what} has {len(array)} rows: expected {count}, as positions")
        sizes = None if faces is None else np.array([len(face) for face in faces], dtype=np.uint32)
        if faces is not None:
            indices = [corner for face in faces for corner in face]
        index = None if indices is None else np.ascontiguousarray(indices, dtype=np.uint32).reshape(-1)
        edges = None if creases is None else np.array([(a, b) for a, b, _ in creases], dtype=np.uint32).reshape(-1)
        sharpness = None if creases is None else np.array([s for _, _, s in creases], dtype=np.float32)
        record = c.Mesh(ctypes.sizeof(c.Mesh), count, 0 if index is None else len(index), 0,
                        *[_pointer(array, ctypes.c_float) for array in arrays.values()],
                        _pointer(index, ctypes.c_uint32), 0 if sizes is None else len(sizes),
                        0 if sharpness is None else len(sharpness), _pointer(sizes, ctypes.c_uint32),
                        _pointer(edges, ctypes.c_uint32), _pointer(sharpness, ctypes.c_float))
        return self._add(_heddle.heddle_scene_add_mesh, name, ctypes.byref(record), ctypes.c_uint32(material))

    def instance(self, mesh: int, transform: ArrayLike | None = None, name: str | None = None) -> int:
        """A mesh placed by a 4x4 matrix (rows and columns as written in mathematics, float64). Returns the id."""
        return self._add(_heddle.heddle_scene_add_instance, name, ctypes.c_uint32(mesh), _matrix(transform))

    def move(self, instance: int, transform: ArrayLike) -> None:
        """Places an instance anew; where it was in the last frame is its previous place, however often it moves."""
        self._check(_heddle.heddle_scene_set_instance(self._handle, instance, _matrix(transform)))

    def light(self, type: str, intensity: Sequence[float], position: Sequence[float] = (0, 0, 0),
              direction: Sequence[float] = (0, -1, 0), range: float = 0.0, inner_angle: float = 0.0,
              outer_angle: float = np.pi / 4, radius: float = 0.0, tangent: Sequence[float] = (1, 0, 0),
              segment_length: float = 0.0, half_extent: Sequence[float] = (0, 0, 0), casts_shadow: bool = True,
              name: str | None = None, texture: ArrayLike | None = None) -> int:
        """One of directional (lux), point, spot, capsule, cone, wedge (candela), box (lux), sphere, rectangle (cd/m^2),
        environment. Linear Rec.709; metres; angles in radians from the axis; records.h says the rest. texture: of a
        rectangle, see set_light_texture. Returns the id."""
        light = _light(type, intensity, position, direction, range, inner_angle, outer_angle, radius, tangent, segment_length,
                       half_extent, casts_shadow)
        index = self._add(_heddle.heddle_scene_add_light, name, ctypes.byref(light))
        if texture is not None:
            self.set_light_texture(index, texture)
        return index

    def set_light(self, light: int, type: str, intensity: Sequence[float], position: Sequence[float] = (0, 0, 0),
                  direction: Sequence[float] = (0, -1, 0), range: float = 0.0, inner_angle: float = 0.0,
                  outer_angle: float = np.pi / 4, radius: float = 0.0, tangent: Sequence[float] = (1, 0, 0),
                  segment_length: float = 0.0, half_extent: Sequence[float] = (0, 0, 0), casts_shadow: bool = True) -> None:
        """Changes a light into what Scene.light would make of the same arguments; it keeps its id and name."""
        record = _light(type, intensity, position, direction, range, inner_angle, outer_angle, radius, tangent, segment_length,
                        half_extent, casts_shadow)
        self._check(_heddle.heddle_scene_set_light(self._handle, light, ctypes.byref(record)))

    def set_light_texture(self, light: int, pixels: ArrayLike | None) -> None:
        """An image that a rectangle light shines with: its radiance at a point is its intensity times the texel there.

        pixels: float32 (height, width) or (height, width, 1, 3 or 4), seen from the lit side with the light's tangent to the
                right; linear Rec.709, finite, 0 or above; copied. None: none
        raises: Error for what is not so, with the first wrong texel
        """
        image = None if pixels is None else _to_image(pixels)
        self._check(_heddle.heddle_scene_set_light_texture(self._handle, light,
                                                           None if image is None else ctypes.byref(image[0])))

    def component(self, name: str, properties: Mapping[str, Value] | None = None, *, instance: int | None = None,
                  material: int | None = None, light: int | None = None) -> None:
        """Puts a component, "shadow.settings", on a thing of the scene, or changes properties of the one that it has.

        properties: {"priority": 2, "near_distance": 0.1}; numbers, lists of three numbers, booleans and words, as the role
                    that reads the component declares them (`heddle list ROLE`, Host.list)
        instance, material, light: the id of what it sits on; none of them: the scene itself
        raises:     Error for what no role declares, with the nearest right name, and for values of a wrong type or range
        """
        owners = [(c.OWNER_INSTANCE, instance), (c.OWNER_MATERIAL, material), (c.OWNER_LIGHT, light)]
        given = [(kind, index) for kind, index in owners if index is not None]
        if len(given) > 1:
            raise Error(2, f"error: the component '{name}' was given several owners\n  expected: one of instance, material, "
                           "light, or none of them for the scene")
        kind, index = given[0] if given else (c.OWNER_SCENE, 0)
        text = json.dumps({key: plain(value) for key, value in (properties or {}).items()})
        self._check(_heddle.heddle_scene_set_component(self._handle, kind, index, name.encode(), text.encode()))

    def camera(self, position: Sequence[float], target: Sequence[float], vertical_angle: float = 0.9,
               up: Sequence[float] = (0, 1, 0), near: float = 0.0, use: bool = True, name: str | None = None, *,
               orthographic_half_height: float | None = None) -> int:
        """A camera that looks at a point. vertical_angle in radians; near: metres, what is nearer is cut away;
        0: 0.01, in a scene of less than 10 m a thousandth of its diagonal. orthographic_half_height: metres from the middle
        of the picture to its upper edge; makes the camera orthographic, and vertical_angle is then not read; None: a
        perspective camera. Returns the id."""
        camera = _camera(position, target, vertical_angle, up, near, orthographic_half_height)
        index = self._add(_heddle.heddle_scene_add_camera, name, ctypes.byref(camera))
        if use:
            self.use_camera(index)
        return index

    def move_camera(self, camera: int, position: Sequence[float], target: Sequence[float], vertical_angle: float = 0.9,
                    up: Sequence[float] = (0, 1, 0), near: float = 0.0, *,
                    orthographic_half_height: float | None = None) -> None:
        """Changes a camera, all of it, as `camera` makes one; it keeps its id and name."""
        made = _camera(position, target, vertical_angle, up, near, orthographic_half_height)
        self._check(_heddle.heddle_scene_set_camera(self._handle, camera, ctypes.byref(made)))

    def set_environment(self, pixels: ArrayLike | None, scale: float = 1.0, angle: float = 0.0,
                        rotation: Sequence[float] | None = None) -> None:
        """Light from infinitely far away; None: none. Seen by graphs with sky/environment_map, as `environment` is.

        pixels:   float32 (height, width) or (height, width, 1, 3 or 4), equirectangular: -Z in the middle, +X to the
                  right of it, +Y on top; linear Rec.709, finite, 0 or above; copied
        scale:    cd/m^2 of 1; 0: dark
        angle:    radians that it is turned about +Y; or
        rotation: quaternion x y z w, scene from image, of any length but 0
        raises:   Error for what is not so
        """
        if pixels is None:
            self._check(_heddle.heddle_scene_set_environment(self._handle, None))
            return
        array = np.ascontiguousarray(pixels, dtype=np.float32)
        if array.ndim == 2:
            array = array[:, :, None]
        if array.ndim != 3:
            raise Error(2, f"error: the environment has shape {array.shape}: expected (height, width, 1, 3 or 4)")
        if not 0 <= scale < float("inf"):
            raise Error(2, f"error: the environment's scale is {scale}: expected a finite number, 0 or above")
        if scale == 0:  # of which the library takes 1
            array, scale = np.zeros_like(array), 1.0
        quaternion = (0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)) if rotation is None else tuple(rotation)
        if len(quaternion) != 4 or not any(quaternion):
            raise Error(2, f"error: the environment's rotation is {quaternion}: expected a quaternion x, y, z, w, not all 0")
        record = c.Environment(ctypes.sizeof(c.Environment), array.shape[1], array.shape[0], array.shape[2],
                               _pointer(array, ctypes.c_float), scale, (ctypes.c_double * 4)(*quaternion))
        self._check(_heddle.heddle_scene_set_environment(self._handle, ctypes.byref(record)))

    def use_camera(self, index: int | None) -> None:
        """Which camera renders; None: one made to see the whole scene."""
        if index is not None and not 0 <= index < c.NONE:
            raise Error(2, f"error: there is no camera {index}: expected 0 or above, or None")
        self._check(_heddle.heddle_scene_use_camera(self._handle, c.NONE if index is None else index))

    def set_time(self, time: float) -> None:
        """Poses what animations move at a time in seconds; Graph.render does it too."""
        self._check(_heddle.heddle_scene_set_time(self._handle, time))
        self._time = float(time)

    def use_animation(self, animation: int | str | None, loop: bool = False) -> None:
        """Which animation of its file plays, by name or number; None: all files are at rest.

        loop: after its end it begins again; else it holds its last pose. raises: Error with the names that there are.
        """
        names = [each["name"] for each in self.describe()["animations"]]
        if animation is None:
            index = c.NONE
        elif animation in names:
            index = names.index(animation)
        elif isinstance(animation, int) or animation.isdigit():
            index = int(animation)
        else:
            index = len(names)
        if index != c.NONE and not 0 <= index < len(names):
            raise Error(2, f"error: the scene has no animation '{animation}'\n  expected: "
                           f"{'one of ' + ', '.join(names) if names else 'none: the scene has no animations'}")
        self._check(_heddle.heddle_scene_use_animation(self._handle, index, c.ANIMATION_LOOP if loop else 0))

    def triangles(self) -> dict[str, NDArray]:
        """All triangles as the scene is posed: positions float64 (n, 3) in metres, rounded to float32 about the middle of
        the scene; normals float32 (n, 3); uvs float32 (n, 2); indices uint32 (m, 3); materials uint32 (m,)."""
        found = c.Triangles(ctypes.sizeof(c.Triangles))
        self._check(_heddle.heddle_scene_triangles(self._handle, ctypes.byref(found)))
        vertices, triangles = found.vertex_count, found.triangle_count

        def array(pointer: Any, shape: tuple[int, ...], kind: Any) -> NDArray:
            # A copy: the scene makes the arrays anew when it moves or changes.
            return np.ctypeslib.as_array(pointer, shape).copy() if shape[0] else np.zeros(shape, kind)

        relative = array(found.positions, (vertices, 3), np.float32)
        return {
            "positions": relative.astype(np.float64) + np.array(found.origin),
            "normals": array(found.normals, (vertices, 3), np.float32), "uvs": array(found.uvs, (vertices, 2), np.float32),
            "indices": array(found.indices, (triangles, 3), np.uint32),
            "materials": array(found.materials, (triangles,), np.uint32),
        }

    def files(self) -> list[str]:
        """Paths of the files that were read for the scene, with those that they name."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_scene_files(self._handle, ctypes.byref(text)))
        return json.loads(text.value.decode())

    def describe(self) -> dict:
        """Counts, bounds, names, animations, components and features."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_scene_describe(self._handle, ctypes.byref(text)))
        return json.loads(_decode(text))

    def _add(self, function: Any, name: str | None, *arguments: Any) -> int:
        index = ctypes.c_uint32()
        self._check(function(self._handle, _encode(name), *arguments, ctypes.byref(index)))
        return index.value


class _Woven(_Object):
    """Passes of techniques, as a graph's file weaves them."""

    _destroy = _heddle.heddle_graph_destroy

    def keep(self, port: str) -> None:
        """Keeps a port, "ao.visibility", readable after the frames to come."""
        self._check(_heddle.heddle_graph_keep(self._handle, port.encode()))

    def get(self, key: str | None = None) -> Any:
        """What a setting of that key says now: get("ao.params.radius") -> 0.5, get("ao.technique") -> "gtao",
        get("ao.inputs.depth") -> "gbuffer.depth", get("ao") -> all of a pass; None: everything.

        raises: Error with the nearest right name
        """
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_graph_get(self._handle, _encode(key), ctypes.byref(text)))
        return json.loads(_decode(text))

    def set(self, setting: str, value: Value | None = None) -> None:
        """Changes a setting between frames: set("ao.params.radius=1.5"), or set("ao.params.radius", 1.5).

        A parameter changes in place; anything else makes a new plan at the next frame.
        """
        if isinstance(value, Mapping):
            raise Error(2, f"error: the setting '{setting}' was given a dict\n  expected: a number, a word, True or False, or a "
                           "list of them\n  help:     one call for each key: " +
                           (f"set(\"{setting}.{next(iter(value))}\", ...)" if value else f"set(\"{setting}.NAME\", ...)"))
        text = setting if value is None else f"{setting}={toml(value)}"
        self._check(_heddle.heddle_graph_set(self._handle, text.encode()))

    def swap(self, pass_name: str, technique: str) -> str:
        """Gives a pass another technique of its role ("none": the role's neutral value). Returns the one that it had."""
        before: str = self.get(f"{pass_name}.technique")
        self.set(f"{pass_name}.technique", technique)
        return before

    def reload(self) -> None:
        """Reads the graph's file again and applies what was set since; edited shaders, and rebuilt plugins that no other
        graph holds, count from the next frame on. On an error the graph is as before."""
        self._check(_heddle.heddle_graph_reload(self._handle))

    def read(self, port: str | None = None, layer: int = 0, mip: int = 0,
             out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """float32 (height, width, channels) of a kept port, or of the graph's output (None).

        The host writes into the array itself, once, from memory that it shares with the device: texels become float32
        there (unorm 0..1), so nothing of the device is ever seen that a later frame could change, and the array lives as
        long as you keep it.

        out:    an array of that shape to write into, C-contiguous: frames after frames without new memory
        raises: Error for a port that was not kept, or an `out` of another shape, type or layout
        """
        _check_part(layer, mip)
        image = c.Image(ctypes.sizeof(c.Image))
        self._check(_heddle.heddle_read_into(self._handle, _encode(port), layer, mip, None, 0, ctypes.byref(image)))
        shape = (image.height, image.width, image.channels)
        array = np.empty(shape, np.float32) if out is None else out
        expected = f"\n  expected: a float32 array {shape}, contiguous and writeable"
        if not isinstance(array, np.ndarray):
            raise Error(2, f"error: 'out' is of type {type(array).__name__}{expected}")
        if array.shape != shape or array.dtype != np.float32 or not (array.flags.c_contiguous and array.flags.writeable):
            raise Error(2, f"error: 'out' is {array.dtype} {array.shape}, {'' if array.flags.c_contiguous else 'not '}"
                           f"contiguous, {'' if array.flags.writeable else 'not '}writeable{expected}")
        self._check(_heddle.heddle_read_into(self._handle, _encode(port), layer, mip, _pointer(array, ctypes.c_float),
                                             array.size, ctypes.byref(image)))
        return array

    def read_texels(self, port: str | None = None, layer: int = 0, mip: int = 0) -> tuple[NDArray[np.uint8], int]:
        """The same as the device has it: uint8 (height, width, bytes of a texel), or (bytes,) of a compressed format; and the
        VkFormat's number. `display.color` is 37, VK_FORMAT_R8G8B8A8_UNORM: its bytes are what image files and screens take,
        and nothing is converted on the way."""
        _check_part(layer, mip)
        texels = c.Texels(ctypes.sizeof(c.Texels))
        self._check(_heddle.heddle_read_texels(self._handle, _encode(port), layer, mip, None, 0, ctypes.byref(texels)))
        array = np.empty(texels.size, np.uint8)
        self._check(_heddle.heddle_read_texels(self._handle, _encode(port), layer, mip, array.ctypes.data, array.size,
                                               ctypes.byref(texels)))
        shape = (texels.height, texels.width, texels.texel_bytes) if texels.texel_bytes else (texels.size,)
        return array.reshape(shape), texels.format

    def check(self, scene: Scene, frames: int = 3, time: float = 0.0, time_step: float = 0.0, seed: int = 0) -> dict:
        """Proves that the graph does what it declares, on a host made with check=True.

        Renders frames from the first on in every order of stages that declared accesses allow and over memory filled with
        two patterns; the bytes of the output and of kept ports must agree. Afterwards the graph is as before its first
        frame.

        returns: {"frames", "runs", "orders", "unordered_pairs", "seen_both_ways": int, "poisons", "compared": list,
                  "lists": those whose elements were seen in two orders, "overflowed": frames that were not compared,
                  because a list had no room in them}
        raises:  Error, with the first thing that was found
        """
        options = c.RenderOptions(ctypes.sizeof(c.RenderOptions), 0, time, time_step, seed, 0, 0)
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_graph_check(self._handle, scene._handle, ctypes.byref(options), frames,
                                               ctypes.byref(text)))
        return json.loads(_decode(text))

    def stats(self) -> dict:
        """Of the last frame: {"wall_ms": recording and running, "submit_ms": from submission to fence, "stages": of a
        profiled frame [{"pass", "stage", "wall_ms", "cpu_ms"}], "counters": commands and bytes, "lists":
        [{"name", "capacity", "count", "overflow": elements that had no room}], "counts": what techniques count
        [{"pass", "name", "count"}], "memory": bytes,
        "libraries", "device", "frames": since the graph was planned}."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_stats(self._handle, ctypes.byref(text)))
        return json.loads(_decode(text))

    def files(self) -> list[str]:
        """Paths of the files that `reload` would read: graphs, roles, manifests, libraries, shaders."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_graph_files(self._handle, ctypes.byref(text)))
        return json.loads(_decode(text))

    def explain(self, format: str = "text", why: str | None = None) -> str:
        """What was decided and why: text, json or dot. why: of one pass: why it runs or does not, why it stands where it
        stands, where each of its settings comes from; text or json."""
        text = ctypes.c_char_p()
        if why is None:
            self._check(_heddle.heddle_graph_explain(self._handle, format.encode(), ctypes.byref(text)))
        else:
            self._check(_heddle.heddle_graph_explain_pass(self._handle, why.encode(), format.encode(), ctypes.byref(text)))
        return _decode(text)

    def describe(self) -> dict:
        """What the graph says, without planning it: file, extent, output, presets, passes with their techniques, parameters
        and inputs, and the names and types of all ports."""
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_graph_describe(self._handle, ctypes.byref(text)))
        return json.loads(text.value.decode())


class Graph(_Woven):
    """A frame graph that renders scenes."""

    _last: tuple[Scene, float, int] | None = None  # scene, time_step and seed of the last frame

    def render(self, scene: Scene, time: float | None = None, time_step: float = 0.0, seed: int = 0, cut: bool = False,
               profile: bool = False, anew: bool = False) -> None:
        """Renders one frame and waits for it, with what animations move posed at `time` in seconds (None: the time of
        the last Scene.set_time or frame, at first 0). profile: stage by stage, timed one by one.

        A graph whose loops are complete (supersampling) submits nothing while nothing changes; anew: it does."""
        options = self._options(scene, time, time_step, seed, cut, profile, anew)
        self._check(_heddle.heddle_render(self._handle, scene._handle, ctypes.byref(options)))
        scene._time = options.time

    def _options(self, scene: Scene, time: float | None, time_step: float, seed: int, cut: bool = False,
                 profile: bool = False, anew: bool = False) -> c.RenderOptions:
        time = scene._time if time is None else float(time)
        if not 0 <= seed < 2**64:
            raise Error(2, f"error: the seed is {seed}: expected an integer of 0 to 2^64 - 1")
        self._last = (scene, time_step, seed)
        flags = (c.RENDER_PROFILE if profile else 0) | (c.RENDER_ANEW if anew else 0)
        return c.RenderOptions(ctypes.sizeof(c.RenderOptions), flags, time, time_step, seed, int(cut), 0)

    def inspect(self, x: int, y: int, *more: tuple[int, int], scene: Scene | None = None, time: float | None = None,
                time_step: float | None = None, seed: int | None = None, format: str = "json") -> list[dict] | str:
        """Renders one frame, and says what every image port held at pixel (x, y) of it, and at `more` of them as (x, y).

        scene, time_step, seed: None: those of the last frame
        time:    None: the scene's time
        returns: for each pixel {"pixel": [x, y], "ports": [...]}, each version of each image port in the order of
                 execution: name, pass, port, technique, stage, place, format, extent, unit, changes, texel, and layers of
                 float values; what is no number is float nan or inf. format "text": a table for people
        raises:  Error for a pixel outside of the frame
        """
        text = self._inspect([(x, y), *more], scene, time, time_step, seed, format)
        if format != "json":
            return text
        seen = json.loads(text)["pixels"]
        for pixel in seen:
            for port in pixel["ports"]:
                for layer in port.get("layers", []):
                    layer["values"] = [float(value) for value in layer["values"]]
        return seen

    def _inspect(self, pixels, scene, time, time_step, seed, format) -> str:
        last_scene, last_step, last_seed = self._last or (None, 0.0, 0)
        scene = last_scene if scene is None else scene
        if scene is None:
            raise Error(2, "error: no scene to inspect\n  help:     say scene=, or render a frame before")
        for pixel in pixels:
            if len(pixel) != 2 or any(int(number) != number or not 0 <= number < 2**32 for number in pixel):
                raise Error(2, f"error: {pixel} is no pixel\n  expected: x and y, integers of at least 0")
        options = self._options(scene, time, last_step if time_step is None else time_step,
                                last_seed if seed is None else seed)
        numbers = (ctypes.c_uint32 * (2 * len(pixels)))(*[int(number) for pixel in pixels for number in pixel])
        text = ctypes.c_char_p()
        self._check(_heddle.heddle_inspect(self._handle, scene._handle, ctypes.byref(options), numbers, len(pixels),
                                           format.encode(), ctypes.byref(text)))
        scene._time = options.time
        return text.value.decode()


class Job(_Woven):
    """A graph that is no frame: it bakes, encodes or inspects, once, and leaves artifacts and reports."""

    def run(self, scene: Scene | None = None, time: float | None = None, seed: int = 0,
            progress: Callable[[str, float], object] | None = None) -> dict:
        """Makes what the job leaves, unless the cache holds it, and says what there is.

        scene:    what it works on, posed at `time` in seconds (None: as it is posed); None: an empty one
        progress: called with (what the host is at, how much of that is done, 0..1), beside the host's own; what it raises
                  ends the run and is raised by it. Nothing is left half made; stages that can go on do so in the next run
        returns:  {"wall_ms", "errors": rows of level "error", "artifacts": [{"name", "origin": "made" or "cache", "key",
                  "file", "bytes"}], "reports": [{"name", "origin", "key", "file", "rows": [{"level", "message", "values"}]}]}
        raises:   Error; with status 6 after Host.cancel
        """
        host = self._host
        assert host is not None  # it was made by one
        if scene is None:
            with host.scene() as empty:
                return self.run(empty, time, seed, progress)
        if not 0 <= seed < 2**64:
            raise Error(2, f"error: the seed is {seed}: expected an integer of 0 to 2^64 - 1")
        options = c.RenderOptions(ctypes.sizeof(c.RenderOptions), 0, scene._time if time is None else float(time), 0.0, seed,
                                  0, 0)
        text = ctypes.c_char_p()
        with host._told(progress):
            self._check(_heddle.heddle_job_run(self._handle, scene._handle, ctypes.byref(options), ctypes.byref(text)))
        scene._time = options.time
        return json.loads(_decode(text))

    def artifact(self, name: str | None = None) -> bytes:
        """Bytes of an artifact, "bake.links", that the last run made or found; None: of the job's output, or of its only
        artifact. raises: Error with the names that there are"""
        data, size = ctypes.c_void_p(), ctypes.c_uint64()
        self._check(_heddle.heddle_job_artifact(self._handle, _encode(name), ctypes.byref(data), ctypes.byref(size)))
        return ctypes.string_at(data, size.value) if size.value else b""


def _decode(text: ctypes.c_char_p) -> str:
    return (text.value or b"").decode()


def _light(type: str, intensity: Sequence[float], position: Sequence[float], direction: Sequence[float], range: float,
           inner_angle: float, outer_angle: float, radius: float, tangent: Sequence[float], segment_length: float,
           half_extent: Sequence[float], casts_shadow: bool) -> c.SceneLight:
    record = c.Light()
    record.type = _choice(type, LIGHT_TYPES, "light type")
    record.intensity[:] = tuple(intensity)
    unit = np.asarray(direction, dtype=np.float64)
    length = np.linalg.norm(unit)
    if not (np.isfinite(length) and length > 0):
        raise Error(2, f"error: the light's direction is {tuple(unit)}: expected a finite vector that is not zero")
    record.direction[:] = tuple(unit / length)
    record.range = range
    record.radius = radius
    record.tangent[:] = tuple(tangent)
    record.segment_length = segment_length
    record.half_extent[:] = tuple(half_extent)
    record.flags = 1 if casts_shadow else 0
    record.cos_inner = np.cos(inner_angle)
    record.cos_outer = np.cos(outer_angle)
    return c.SceneLight(ctypes.sizeof(c.SceneLight), 0, (ctypes.c_double * 3)(*position), record)


def _check_part(layer: int, mip: int) -> None:
    for what, number in (("layer", layer), ("mip", mip)):
        if int(number) != number or not 0 <= number < 2**32:
            raise Error(2, f"error: there is no {what} {number}\n  expected: an integer of at least 0")


def _log_to_stderr(severity: int, text: str) -> None:
    if severity < 2:
        print(text, file=sys.stderr)


def _to_array(image: c.Image) -> NDArray[np.float32]:
    # One copy: the host keeps one image that it read from a file, and the next read_image replaces it.
    return np.ctypeslib.as_array(image.pixels, (image.height, image.width, image.channels)).copy()


def _to_image(pixels: ArrayLike) -> tuple[c.Image, NDArray[np.float32]]:
    array = np.ascontiguousarray(pixels, dtype=np.float32)
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3:
        raise Error(2, f"error: an image has shape {array.shape}: expected (height, width, channels)")
    height, width, channels = array.shape
    return c.Image(ctypes.sizeof(c.Image), width, height, channels, _pointer(array, ctypes.c_float)), array


def _matrix(transform: ArrayLike | None) -> Any:
    matrix = np.eye(4) if transform is None else np.asarray(transform, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise Error(2, f"error: a transform has shape {matrix.shape}: expected (4, 4)")
    return (ctypes.c_double * 16)(*matrix.T.reshape(-1))  # C wants columns


def _camera(position: Sequence[float], target: Sequence[float], vertical_angle: float, up: Sequence[float],
            near: float, half_height: float | None) -> c.Camera:
    if half_height is not None and not 0 < half_height < float("inf"):
        raise Error(2, f"error: a camera's orthographic_half_height is {half_height}\n  expected: metres, above 0, or None")
    return c.Camera(ctypes.sizeof(c.Camera), 0 if half_height is None else 1, (ctypes.c_double * 3)(*position),
                    (ctypes.c_double * 4)(*_look_rotation(position, target, up)),
                    vertical_angle if half_height is None else half_height, 0.0, near, 0.0)


def _look_rotation(position: Sequence[float], target: Sequence[float],
                   up: Sequence[float]) -> tuple[float, float, float, float]:
    """Quaternion x y z w of a view along -Z from position to target."""
    back = np.asarray(position, dtype=np.float64) - np.asarray(target, dtype=np.float64)
    length = np.linalg.norm(back)
    if length == 0:
        raise Error(2, "error: a camera's target is its position")
    back /= length
    right = np.cross(np.asarray(up, dtype=np.float64), back)
    if np.linalg.norm(right) < 1e-9:  # straight up or down: any right will do
        right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    m = np.stack([right, np.cross(back, right), back], axis=1)
    # The largest of the four components is computed first, so that nothing cancels.
    w2 = np.array([1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2],
                   1 - m[0, 0] - m[1, 1] + m[2, 2], 1 + m[0, 0] + m[1, 1] + m[2, 2]])
    k = int(np.argmax(w2))
    s = 2.0 * np.sqrt(w2[k])
    if k == 3:
        q = [(m[2, 1] - m[1, 2]) / s, (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s, s / 4]
    elif k == 0:
        q = [s / 4, (m[0, 1] + m[1, 0]) / s, (m[0, 2] + m[2, 0]) / s, (m[2, 1] - m[1, 2]) / s]
    elif k == 1:
        q = [(m[0, 1] + m[1, 0]) / s, s / 4, (m[1, 2] + m[2, 1]) / s, (m[0, 2] - m[2, 0]) / s]
    else:
        q = [(m[0, 2] + m[2, 0]) / s, (m[1, 2] + m[2, 1]) / s, s / 4, (m[1, 0] - m[0, 1]) / s]
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])
