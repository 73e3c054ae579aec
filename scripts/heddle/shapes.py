# SPDX-License-Identifier: Apache-2.0
"""Procedural meshes as numpy arrays: dictionaries with positions, normals, uv0 and indices, ready for Scene.mesh.

Metres, +Y up, counter-clockwise front faces. Texture coordinates are in metres, so that one material repeats alike on
every shape.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def merge(*shapes: dict) -> dict:
    """One mesh of several."""
    offsets = np.cumsum([0] + [len(shape["positions"]) for shape in shapes[:-1]])
    merged = {key: np.concatenate([shape[key] for shape in shapes]) for key in ("positions", "normals", "uv0")}
    merged["indices"] = np.concatenate([shape["indices"] + offset for shape, offset in zip(shapes, offsets)])
    return merged


def moved(shape: dict, offset: ArrayLike = (0, 0, 0)) -> dict:
    """A copy elsewhere."""
    return {**shape, "positions": shape["positions"] + np.asarray(offset, dtype=np.float64)}


def quad(origin: ArrayLike, u: ArrayLike, v: ArrayLike) -> dict:
    """The parallelogram origin, origin + u, ... ; it faces cross(u, v)."""
    origin = np.asarray(origin, dtype=np.float64)
    u = np.asarray(u, dtype=np.float64)
    v = np.asarray(v, dtype=np.float64)
    normal = np.cross(u, v)
    normal /= np.linalg.norm(normal)
    lu, lv = np.linalg.norm(u), np.linalg.norm(v)
    return {
        "positions": np.array([origin, origin + u, origin + u + v, origin + v]),
        "normals": np.tile(normal, (4, 1)),
        "uv0": np.array([[0, lv], [lu, lv], [lu, 0], [0, 0]]),
        "indices": np.array([[0, 1, 2], [0, 2, 3]]),
    }


def box(size: ArrayLike, center: ArrayLike = (0, 0, 0)) -> dict:
    """An axis-aligned box, faces outward."""
    x, y, z = 0.5 * np.asarray(size, dtype=np.float64)
    faces = [
        quad((x, -y, z), (0, 0, -2 * z), (0, 2 * y, 0)), quad((-x, -y, -z), (0, 0, 2 * z), (0, 2 * y, 0)),
        quad((-x, y, z), (2 * x, 0, 0), (0, 0, -2 * z)), quad((-x, -y, -z), (2 * x, 0, 0), (0, 0, 2 * z)),
        quad((-x, -y, z), (2 * x, 0, 0), (0, 2 * y, 0)), quad((x, -y, -z), (-2 * x, 0, 0), (0, 2 * y, 0)),
    ]
    return moved(merge(*faces), center)


def lathe(profile: ArrayLike, segments: int = 24) -> dict:
    """A profile of (radius, height) points turned about +Y, going up; flat between points, smooth around."""
    profile = np.asarray(profile, dtype=np.float64)
    angles = np.linspace(0, 2 * np.pi, segments + 1)
    around = np.stack([np.cos(angles), np.zeros_like(angles), -np.sin(angles)], axis=1)
    parts = []
    length = 0.0
    for (r0, y0), (r1, y1) in zip(profile[:-1], profile[1:]):
        slope = np.hypot(r1 - r0, y1 - y0)
        if slope == 0:
            continue
        out, up = (y1 - y0) / slope, -(r1 - r0) / slope
        lower = around * r0 + (0, y0, 0)
        upper = around * r1 + (0, y1, 0)
        u = angles * max(r0, r1)
        n = len(angles)
        i = np.arange(segments)
        triangles = np.concatenate([np.stack([i, i + 1, n + i + 1], 1), np.stack([i, n + i + 1, n + i], 1)])
        parts.append({
            "positions": np.concatenate([lower, upper]),
            "normals": np.tile(around * out + (0, up, 0), (2, 1)),
            "uv0": np.concatenate([np.stack([u, np.full(n, -length)], 1), np.stack([u, np.full(n, -length - slope)], 1)]),
            "indices": triangles,
        })
        length += slope
    return merge(*parts)


def sphere(radius: float, segments: int = 32) -> dict:
    """A sphere of latitude and longitude, normals exact."""
    rows = segments // 2
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, segments + 1), indexing="ij")
    normal = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)], axis=-1).reshape(-1, 3)
    uv = np.stack([phi * radius, theta * radius], axis=-1).reshape(-1, 2)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(rows), np.arange(segments), indexing="ij"))
    a = i * (segments + 1) + j
    b = a + segments + 1
    lower = np.stack([a, b, b + 1], 1)
    upper = np.stack([a, b + 1, a + 1], 1)
    # At the poles one of the two triangles has no area.
    indices = np.concatenate([lower[i < rows - 1], upper[i > 0]])
    return {"positions": normal * radius, "normals": normal, "uv0": uv, "indices": indices}


def arch(span: float, rise: float, depth: float, thickness: float, segments: int = 16) -> dict:
    """A wall of `thickness` over a semi-elliptic opening in the x-y plane, `depth` along z, springing at y = 0.

    The outer rectangle reaches from -span/2 - thickness to span/2 + thickness, and up to rise + thickness.
    """
    t = np.linspace(np.pi, 0, segments + 1)
    inner = np.stack([0.5 * span * np.cos(t), rise * np.sin(t)], 1)
    half, top = 0.5 * span + thickness, rise + thickness
    # Every inner point has its partner on the outer rectangle, straight out from the centre.
    direction = np.stack([np.cos(t), np.sin(t)], 1)
    with np.errstate(divide="ignore"):
        reach = np.minimum(half / np.abs(direction[:, 0]), top / np.maximum(direction[:, 1], 1e-12))
    outer = direction * reach[:, None]
    z = 0.5 * depth
    n = segments + 1
    i = np.arange(segments)
    corners = np.array([[0, 1, n + 1], [0, n + 1, n]])
    strip = (corners[None] + i[:, None, None]).reshape(-1, 3)

    def face(points_a: Any, points_b: Any, za: Any, zb: Any, normals: Any, flip: Any) -> dict:
        positions = np.concatenate([np.column_stack([points_a, np.full(n, za)]), np.column_stack([points_b, np.full(n, zb)])])
        return {"positions": positions, "normals": normals, "uv0": np.column_stack([positions[:, 0] + positions[:, 2], -positions[:, 1]]),
                "indices": strip[:, ::-1] if flip else strip}

    forward = np.tile((0.0, 0.0, 1.0), (2 * n, 1))
    tangent = np.stack([0.5 * span * -np.sin(t), rise * np.cos(t)], 1)
    inward = np.stack([tangent[:, 1], -tangent[:, 0]], 1)
    inward *= -np.sign(np.sum(inward * inner, axis=1, keepdims=True) + 1e-12)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    under = np.tile(np.column_stack([inward, np.zeros(n)]), (2, 1))
    # A rectangle's corner lies between two segments and would be cut off: the corners are filled by triangles.
    parts = [face(inner, outer, z, z, forward, False), face(inner, outer, -z, -z, -forward, True),
             face(inner, inner, z, -z, under, True)]
    for sign in (-1.0, 1.0):
        k = int(np.argmin(np.abs(np.arctan2(top, sign * half) - t)))
        a, b = (outer[k], outer[k + 1]) if (t[k] - np.arctan2(top, sign * half)) >= 0 else (outer[k - 1], outer[k])
        corner = np.array([sign * half, top])
        for side, flip in ((z, True), (-z, False)):
            points = np.array([[*a, side], [*corner, side], [*b, side]])
            parts.append({"positions": points, "normals": np.tile((0, 0, 1.0 if side > 0 else -1.0), (3, 1)),
                          "uv0": np.column_stack([points[:, 0] + points[:, 2], -points[:, 1]]),
                          "indices": np.array([[0, 2, 1]] if flip else [[0, 1, 2]])})
    return merge(*parts)


def cloth(width: float, height: float, folds: float, depth: float, columns: int = 48, rows: int = 8) -> dict:
    """A hanging curtain in the x-y plane, top at y = 0, with sine folds that deepen towards the hem."""
    x, y = np.meshgrid(np.linspace(-0.5 * width, 0.5 * width, columns + 1), np.linspace(0, -height, rows + 1))
    share = 0.35 + 0.65 * (-y / height)
    phase = 2 * np.pi * folds * (x / width)
    z = depth * share * np.sin(phase)
    dz_dx = depth * share * np.cos(phase) * 2 * np.pi * folds / width
    dz_dy = depth * np.sin(phase) * (-0.65 / height)
    normal = np.stack([-dz_dx, -dz_dy, np.ones_like(z)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a = i * (columns + 1) + j
    b = a + columns + 1
    return {"positions": np.stack([x, y, z], -1).reshape(-1, 3), "normals": normal.reshape(-1, 3),
            "uv0": np.stack([x, -y], -1).reshape(-1, 2),
            "indices": np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])}


def translation(x: float, y: float, z: float) -> np.ndarray:
    """4x4 matrix."""
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def rotation_y(angle: float) -> np.ndarray:
    """4x4 matrix, radians about +Y."""
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(angle)
    matrix[0, 2] = np.sin(angle)
    matrix[2, 0] = -matrix[0, 2]
    return matrix


def torus(radius: float, tube: float, segments: int = 24, sides: int = 10) -> dict:
    """A ring around the z axis."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, segments + 1), np.linspace(0, 2 * np.pi, sides + 1), indexing="ij")
    normal = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], -1).reshape(-1, 3)
    center = np.stack([radius * np.cos(u), radius * np.sin(u), np.zeros_like(u)], -1).reshape(-1, 3)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(segments), np.arange(sides), indexing="ij"))
    a: Any = i * (sides + 1) + j
    b: Any = a + sides + 1
    return {"positions": center + tube * normal, "normals": normal,
            "uv0": np.stack([u * radius, v * tube], -1).reshape(-1, 2),
            "indices": np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])}


def prism(outline: ArrayLike, depth: float) -> dict:
    """A convex outline of the x-y plane, counter-clockwise, made `depth` thick about z = 0; flat faces."""
    outline = np.asarray(outline, dtype=np.float64)
    n, z = len(outline), 0.5 * depth
    fan = np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], 1)
    parts = []
    for side in (1.0, -1.0):
        parts.append({"positions": np.column_stack([outline, np.full(n, side * z)]), "normals": np.tile((0, 0, side), (n, 1)),
                      "uv0": np.column_stack([outline[:, 0], -outline[:, 1]]), "indices": fan if side > 0 else fan[:, ::-1]})
    for a, b in zip(outline, np.roll(outline, -1, 0)):
        parts.append(quad((*a, z), (0, 0, -depth), (b[0] - a[0], b[1] - a[1], 0)))
    return merge(*parts)


def tube(points: ArrayLike, radius: float, sides: int = 6) -> dict:
    """A pipe along a line of points (n, 3), open at its ends; smooth around and along."""
    points = np.asarray(points, dtype=np.float64)
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # The frame is carried from point to point, so that nothing twists.
    across = np.empty_like(points)
    start = np.cross(along[0], (0, 1, 0) if abs(along[0][1]) < 0.9 else (1, 0, 0))
    for k, direction in enumerate(along):
        start = start - direction * (start @ direction)
        start /= np.linalg.norm(start)
        across[k] = start
    other = np.cross(along, across)
    angles = np.linspace(0, 2 * np.pi, sides + 1)
    normal = across[:, None] * np.cos(angles)[None, :, None] + other[:, None] * np.sin(angles)[None, :, None]
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    uv = np.stack(np.broadcast_arrays(angles[None] * radius, length[:, None]), -1)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(len(points) - 1), np.arange(sides), indexing="ij"))
    a: Any = i * (sides + 1) + j
    b: Any = a + sides + 1
    return {"positions": (points[:, None] + radius * normal).reshape(-1, 3), "normals": normal.reshape(-1, 3),
            "uv0": uv.reshape(-1, 2), "indices": np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])}


def grid(size_x: float, size_z: float, columns: int, rows: int,
         height: Callable[[Any, Any], Any] | None = None) -> dict:
    """A field of squares about the origin, facing +Y; height(x, z) lifts it, with normals from central differences."""
    x, z = np.meshgrid(np.linspace(-0.5 * size_x, 0.5 * size_x, columns + 1), np.linspace(-0.5 * size_z, 0.5 * size_z, rows + 1))
    step = 1e-3
    y, normal = np.zeros_like(x), np.stack([np.zeros_like(x), np.ones_like(x), np.zeros_like(x)], -1)
    if height is not None:
        y = height(x, z)
        normal[..., 0] = (height(x - step, z) - height(x + step, z)) / (2 * step)
        normal[..., 2] = (height(x, z - step) - height(x, z + step)) / (2 * step)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a = i * (columns + 1) + j
    b = a + columns + 1
    return {"positions": np.stack([x, y, z], -1).reshape(-1, 3), "normals": normal.reshape(-1, 3),
            "uv0": np.stack([x, z], -1).reshape(-1, 2),
            "indices": np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])}


def rotation_x(angle: float) -> np.ndarray:
    """4x4 matrix, radians about +X."""
    matrix = np.eye(4)
    matrix[1, 1] = matrix[2, 2] = np.cos(angle)
    matrix[2, 1] = np.sin(angle)
    matrix[1, 2] = -matrix[2, 1]
    return matrix


def scaling(x: float, y: float, z: float) -> np.ndarray:
    """4x4 matrix."""
    return np.diag([x, y, z, 1.0])
