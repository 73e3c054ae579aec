# SPDX-License-Identifier: Apache-2.0
"""Metrics of images in numpy arrays. No host is needed."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library as c
from .host import Error, _choice, _heddle, _to_array, _to_image

TONE_MAPPERS = ("aces", "hable", "reinhard")


def metrics() -> list[dict]:
    """Which metrics there are: [{"name", "formula", "better": "lower" or "higher", "map": what its error image holds}].
    "percentile_P" stands for any number, as in percentile_99.9."""
    return json.loads(_heddle.heddle_metrics().decode())


def compare(a: ArrayLike, b: ArrayLike, metric: str | Sequence[str] | None = None, *, pixels_per_degree: float | None = None,
            exposures: tuple[float, float, int] | None = None, tone_mapper: str = "aces", threads: int = 0) -> Any:
    """Metrics of an image against a reference. No host is needed.

    a, b:      (height, width, channels) or (height, width), b the reference; float32 arrays that are contiguous are read
               where they are, others are converted
    metric:    a name of metrics(), or several; None: all but flip and hdr_flip, which must be told how values are encoded:
               flip takes them as encoded in sRGB, 0 to 1; hdr_flip as linear radiance
    pixels_per_degree: of both FLIPs; None: 67.02, a display 0.7 m and 3840 pixels wide that is seen from 0.7 m
    exposures: of hdr_flip: start, stop and count, in stops; None: from the reference (Andersson et al. 2021). Fix them
               where several comparisons are to be comparable
    tone_mapper: of hdr_flip: aces, hable or reinhard
    threads:   0: one for each processor; no bit of a result depends on it
    returns:   a float for one name (inf: psnr of equal images); else {name: {"value", "formula", "better", and what it was
               measured with}}, an infinite value None
    raises:    Error if shapes differ, a value is not finite (names the first such pixel), or a metric is unknown
    """
    described, _ = _compare(a, b, metric, False, pixels_per_degree, exposures, tone_mapper, threads)
    if not isinstance(metric, str):
        return described["metrics"]
    value = described["metrics"][metric]["value"]
    return float("inf") if value is None else float(value)


def error_image(a: ArrayLike, b: ArrayLike, metric: str, *, pixels_per_degree: float | None = None,
                exposures: tuple[float, float, int] | None = None, tone_mapper: str = "aces",
                threads: int = 0) -> NDArray[np.float32]:
    """A metric's error, pixel by pixel: float32 (height, width, channels), one channel for ssim, flip and hdr_flip;
    metrics() says what a pixel holds. Arguments as of compare()."""
    return _compare(a, b, metric, True, pixels_per_degree, exposures, tone_mapper, threads)[1]


def compare_with_map(a: ArrayLike, b: ArrayLike, metric: str, *, exposures: tuple[float, float, int] | None = None,
                     tone_mapper: str = "aces") -> tuple[dict, NDArray[np.float32]]:
    """What compare(a, b, [metric])[metric] and error_image(a, b, metric) say, of one run, which takes half the time."""
    described, map = _compare(a, b, metric, True, None, exposures, tone_mapper, 0)
    return described["metrics"][metric], map


def _compare(a: ArrayLike, b: ArrayLike, metric: str | Sequence[str] | None, is_map_wanted: bool,
             pixels_per_degree: float | None, exposures: tuple[float, float, int] | None, tone_mapper: str,
             threads: int) -> tuple[dict, Any]:
    image, _keep_a = _to_image(a)
    reference, _keep_b = _to_image(b)
    names = [metric] if isinstance(metric, str) else list(metric or [])
    start, stop, count = exposures or (0.0, 0.0, 0)
    if exposures is not None and not 1 <= count <= 1000:
        raise Error(2, f"error: {count} exposures were asked for\n  expected: 1 to 1000")
    options = c.CompareOptions(ctypes.sizeof(c.CompareOptions), c.COMPARE_MAPS if is_map_wanted else 0,
                               ",".join(names).encode(), pixels_per_degree or 0.0, start, stop, count,
                               _choice(tone_mapper, TONE_MAPPERS, "tone mapper"), threads, 0)
    handle = ctypes.c_void_p()
    status = _heddle.heddle_compare(ctypes.byref(image), ctypes.byref(reference), ctypes.byref(options),
                                    ctypes.byref(handle))
    try:
        array = None
        if not status and is_map_wanted:
            found = c.Image(ctypes.sizeof(c.Image))
            status = _heddle.heddle_comparison_map(handle, names[0].encode(), ctypes.byref(found))
            array = None if status else _to_array(found)
        if status:
            raise Error(status, _heddle.heddle_error(None).decode())
        return json.loads(_heddle.heddle_comparison_describe(handle).decode()), array
    finally:
        _heddle.heddle_comparison_destroy(handle)
