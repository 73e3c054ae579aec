# SPDX-License-Identifier: Apache-2.0
"""The window of `heddle view` for scenes written in Python: libheddle_view.so through ctypes, which calls back for hosts
and scenes. The structure is exactly that of host/view/module.h."""

from __future__ import annotations

import ctypes
import json
import os
import traceback
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_char_p, c_double, c_int32, c_size_t, c_uint32, c_uint64, c_void_p
from typing import Any

from . import _library as c
from .host import Error, Host, Scene

_REVISION = 2
FRAME_BUDGET = 33.0  # milliseconds: thirty pictures a second, as the command's

_Open = ctypes.CFUNCTYPE(c_int32, c_void_p, c_void_p, POINTER(c_void_p))
_LoadScene = ctypes.CFUNCTYPE(c_int32, c_void_p, c_uint32, POINTER(c_void_p))
_Pose = ctypes.CFUNCTYPE(c_int32, c_void_p, c_uint32, c_double)
_SceneFiles = ctypes.CFUNCTYPE(c_int32, c_void_p, POINTER(c_char_p))
_ErrorText = ctypes.CFUNCTYPE(c_void_p, c_void_p)
_IsStopped = ctypes.CFUNCTYPE(c_uint32, c_void_p)
_Close = ctypes.CFUNCTYPE(None, c_void_p)


class _Application(ctypes.Structure):
    _fields_ = [
        ("struct_size", c_uint32), ("revision", c_uint32), ("graphs", c_char_p * 2), ("settings", POINTER(c_char_p) * 2),
        ("setting_counts", c_uint32 * 2), ("width", c_uint32), ("height", c_uint32), ("time", c_double),
        ("time_step", c_double), ("seed", c_uint64), ("script", c_char_p), ("user", c_void_p), ("open", _Open),
        ("load_scene", _LoadScene), ("pose", _Pose), ("scene_files", _SceneFiles), ("error", _ErrorText),
        ("is_stopped", _IsStopped), ("close", _Close), ("frame_budget_ms", c_double),
    ]


def _module() -> ctypes.CDLL:
    file = os.environ.get("HEDDLE_VIEW_MODULE") or str(c.find().resolve().parent / "libheddle_view.so")
    try:
        module = ctypes.CDLL(file, mode=os.RTLD_NOW | os.RTLD_NODELETE)
        module.heddle_view_run.argtypes = [POINTER(_Application), c_char_p, c_size_t]
        module.heddle_view_run.restype = c_int32
        module.heddle_view_tell.argtypes = [c_void_p, c_uint32, c_char_p]
        module.heddle_view_tell.restype = None
        module.heddle_view_progress.argtypes = [c_void_p, c_char_p, c_double]
        module.heddle_view_progress.restype = c_uint32
    except (OSError, AttributeError) as error:
        raise Error(3, f"error: the window's module cannot be opened\n  found:    {error}\n  expected: {file}\n"
                       "  help:     install the Debian packages libglfw3, libgl1 and libstb0; where Heddle was built without its "
                       "window, libglfw3-dev and libimgui-dev, and build again") from error
    return module


class _Closed(Exception):
    """The window was closed while the host was at work."""


def show(open_host: Callable[[Callable[[int, str], None], Callable[[str, float], None]], Host],
         make_scene: Callable[[Host], tuple[Scene, Callable[[Scene, float], None]]],
         scene_files: Callable[[Scene], Sequence[str]], is_stopped: Callable[[], bool],
         graphs: Sequence[str | None], settings: Sequence[Sequence[str]], window: tuple[int, int] = (0, 0),
         time: float = 0.0, time_step: float = 1 / 60, seed: int = 0, script: str | None = None,
         frame_budget: float = FRAME_BUDGET) -> None:
    """Opens the window and returns when it is closed.

    open_host:   called once with (log, progress), which the host is to be made with
    make_scene:  called with the host, anew when a file has changed: a scene, and what moves it to a time in seconds
    scene_files: called with a scene: paths of all that it was made of
    is_stopped:  whether a signal asked for the end
    graphs:      files or shipped names of A and B; B None: one picture
    settings:    of A and B, "ao.technique=gtao"
    window:      width and height in pixels; 0: as the picture needs
    frame_budget: milliseconds in which loops render on, while nothing changes, before the picture is shown again; 0: it
                 is shown after each frame
    raises:      Error; status 6 after is_stopped

    All of them but is_stopped are called on a thread of the window's own, the only one that uses the host.
    """
    module = _module()
    made: list[Any] = [None, {}]  # the host; (scene, update) of each variant
    texts: dict[str, Any] = {"error": None, "files": None}

    def guarded(body: Callable[[], None]) -> int:
        try:
            body()
        except _Closed:
            texts["error"] = ctypes.create_string_buffer(b"the window was closed")
            return c.CANCELLED
        except Error as error:
            texts["error"] = ctypes.create_string_buffer(str(error).encode())
            return error.status
        except BaseException:  # nothing may leave into C
            texts["error"] = ctypes.create_string_buffer(b"error: " + traceback.format_exc().strip().encode())
            return 4
        return 0

    def open(_user, view, out):
        def log(severity: int, text: str) -> None:
            module.heddle_view_tell(view, severity, text.encode())

        def progress(activity: str, fraction: float) -> None:
            if module.heddle_view_progress(view, activity.encode(), fraction):
                raise _Closed

        def body() -> None:
            made[0] = open_host(log, progress)
            out[0] = made[0]._handle.value

        return guarded(body)

    def load_scene(_user, variant, out):
        def body() -> None:
            fresh = make_scene(made[0])
            if variant in made[1]:
                made[1][variant][0].close()
            made[1][variant] = fresh
            out[0] = fresh[0]._handle.value

        return guarded(body)

    def pose(_user, variant, time):
        scene, update = made[1][variant]
        return guarded(lambda: update(scene, time))

    def files(_user, out):
        def body() -> None:
            texts["files"] = json.dumps([str(file) for file in scene_files(made[1][0][0])]).encode()
            out[0] = texts["files"]

        return guarded(body)

    def close(_user):
        def body() -> None:
            for scene, _update in made[1].values():
                scene.close()
            made[0].close()

        guarded(body)

    arrays = [(c_char_p * max(1, len(of)))(*[setting.encode() for setting in of]) for of in settings]
    application = _Application(
        ctypes.sizeof(_Application), _REVISION, (c_char_p * 2)(*[graph and graph.encode() for graph in graphs]),
        (POINTER(c_char_p) * 2)(*[ctypes.cast(array, POINTER(c_char_p)) for array in arrays]),
        (c_uint32 * 2)(*[len(of) for of in settings]), *window, time, time_step, seed, script and script.encode(), None,
        _Open(open), _LoadScene(load_scene), _Pose(pose), _SceneFiles(files),
        _ErrorText(lambda _user: ctypes.addressof(texts["error"])), _IsStopped(lambda _user: int(is_stopped())),
        _Close(close), frame_budget)
    message = ctypes.create_string_buffer(16384)
    status = module.heddle_view_run(ctypes.byref(application), message, len(message))
    if status:
        raise Error(status, message.value.decode(errors="replace"))
