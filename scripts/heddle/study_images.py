# SPDX-License-Identifier: Apache-2.0
"""Images of a study: kept beside its results without loss, in files that a page can read from disk.

A page that was opened from disk may read no other file but scripts, so an image is one: `heddleImage(name, head, text)`, the
text being base64 of a raw deflate stream. In it are the bits of all values, each less the one to its left (modulo 2^bits,
so that not a bit is lost, NaN included), sorted by significance: all the most significant bytes first. heddle/report/pixels.js
is the other end.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import pathlib
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

Head = dict[str, Any]
TYPES: dict[str, Any] = {"f32": np.uint32, "f16": np.uint16, "u8": np.uint8}
LARGEST_HALF = 65504.0


def pack(values: NDArray, level: int = 6) -> tuple[Head, bytes]:
    """values:  float32, float16 or uint8 (height, width, channels)
    returns: what unpack() must know, and the deflated bytes"""
    kind = {"float32": "f32", "float16": "f16", "uint8": "u8"}[values.dtype.name]
    bits = np.ascontiguousarray(values).view(TYPES[kind])
    less = bits.copy()
    less[:, 1:] -= bits[:, :-1]
    # (bytes from the most significant on, channels, height, width)
    planes = less.astype(less.dtype.newbyteorder(">")).view(np.uint8).reshape(*bits.shape, -1).transpose(3, 2, 0, 1)
    deflate = zlib.compressobj(level, zlib.DEFLATED, -15)
    packed = deflate.compress(np.ascontiguousarray(planes).tobytes()) + deflate.flush()
    height, width, channels = values.shape
    return {"width": width, "height": height, "channels": channels, "type": kind}, packed


def unpack(head: Head, packed: bytes) -> NDArray:
    """The inverse of pack(), to the bit. raises: ValueError, zlib.error if the bytes are not those of `head`"""
    kind = TYPES[head["type"]]
    size = np.dtype(kind).itemsize
    planes = np.frombuffer(zlib.decompress(packed, -15), np.uint8).reshape(
        size, head["channels"], head["height"], head["width"])
    less = np.ascontiguousarray(planes.transpose(2, 3, 1, 0)).view(np.dtype(kind).newbyteorder(">"))[..., 0].astype(kind)
    bits = np.add.accumulate(less, axis=1, dtype=kind)
    return bits if head["type"] == "u8" else bits.view({"f32": np.float32, "f16": np.float16}[head["type"]])


def fingerprint(image: NDArray[np.float32]) -> str:
    """SHA-256 of an image's shape and of the bytes of its values: what "bytes are equal" means."""
    return hashlib.sha256(json.dumps(image.shape).encode() + np.ascontiguousarray(image, np.float32).tobytes()).hexdigest()


def file_of(folder: pathlib.Path, key: str) -> pathlib.Path:
    return folder / "images" / f"{key}.js"


def keep(folder: pathlib.Path, key: str, image: NDArray[np.float32]) -> Head:
    """Writes FOLDER/images/KEY.js, whole or not at all. image: float32 (height, width, channels). raises: OSError"""
    exact = image.astype(np.float16) if is_half(image) else image
    head, packed = pack(exact)
    head["sha256"] = fingerprint(image)
    path = file_of(folder, key)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{key}.{os.getpid()}.partial")
    arguments = json.dumps([key, head, base64.b64encode(packed).decode()])
    partial.write_text(f"heddleImage({arguments[1:-1]});\n")
    partial.replace(path)
    return head


def head_of(folder: pathlib.Path, key: str) -> Head | None:
    """Of a kept image; None if there is none. Reads its first bytes alone."""
    try:
        with open(file_of(folder, key)) as file:
            begin = file.read(4096)
        decoder = json.JSONDecoder()
        return decoder.raw_decode(begin, begin.index("{"))[0]
    except (OSError, ValueError):
        return None


def load(folder: pathlib.Path, key: str) -> NDArray[np.float32]:
    """A kept image as it was. raises: OSError, ValueError if it is not there or damaged"""
    text = file_of(folder, key).read_text().strip()
    try:
        _, head, data = json.loads("[" + text.removeprefix("heddleImage(").removesuffix(");") + "]")
        image = unpack(head, base64.b64decode(data)).astype(np.float32)
    except (zlib.error, KeyError, TypeError) as error:
        raise ValueError(f"{file_of(folder, key)} is damaged: {error}") from error
    if fingerprint(image) != head["sha256"]:
        raise ValueError(f"{file_of(folder, key)} is damaged: its values are not those that were kept")
    return image


def is_half(image: NDArray[np.float32]) -> bool:
    """Whether every value is one of float16, bit by bit."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.array_equal(image.astype(np.float16).astype(np.float32).view(np.uint32),
                              np.ascontiguousarray(image).view(np.uint32))


def halved(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Half as wide and high, rounded up: means of 2 x 2 pixels, of fewer at an odd edge. Sums in float64."""
    height, width, channels = image.shape
    even = np.pad(image.astype(np.float64), ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return even.reshape((height + 1) // 2, 2, (width + 1) // 2, 2, channels).mean(axis=(1, 3)).astype(np.float32)


def to_half(image: NDArray[np.float32], mantissa: int = 10) -> NDArray[np.float16]:
    """Rounded to float16 with so many bits of mantissa (10: all of them): a relative error of 2^-(mantissa + 1) at most for
    values from 6.1e-5 on; what lies beyond 65504 becomes that; NaN stays."""
    with np.errstate(invalid="ignore"):
        half = np.clip(image, -LARGEST_HALF, LARGEST_HALF).astype(np.float16)
    drop = 10 - mantissa
    if drop <= 0:
        return half
    bits = half.view(np.uint16)
    sign, rest = bits & 0x8000, (bits & 0x7FFF).astype(np.uint32)
    mask = (1 << drop) - 1
    rounded = np.minimum(rest + (1 << (drop - 1)), 0x7BFF) & ~mask
    return np.where(rest > 0x7C00, bits, sign | rounded.astype(np.uint16)).astype(np.uint16).view(np.float16)
