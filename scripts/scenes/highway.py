# SPDX-License-Identifier: Apache-2.0
"""Highway: a road through open country, one texture of 65,536 x 65,536 texels over 4 x 4 km, and no two alike.

For techniques of role texture_source, in the graph virtual_texture: update(scene, time) drives along the road at 40 m/s.
The country is cut into 8 x 8 charts, so that a float of each chart's coordinates is exact to a texel's 2,000th.
"""

import numpy as np

from heddle import shapes

SIDE, EXTENT, CHARTS = 4096.0, 65536, 8  # metres, texels, charts along each side
ROWS = 33  # points along each side of a chart
SPEED = 40.0  # metres a second
EYE = 2.4  # metres above the road


def middle(v: np.ndarray) -> np.ndarray:
    """Where the road's middle is, u by v, both 0..1: as the technique's source `road` has it."""
    return 0.5 + 0.02 * np.sin(6 * np.pi * v) + 0.006 * np.sin(22 * np.pi * v)


def height(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Hills beside the road, metres: none within 20 m of it."""
    away = np.clip((np.abs(u - middle(v)) * SIDE - 20) / 200, 0, 1)
    hills = 60 * np.sin(14 * np.pi * u + 1) * np.sin(10 * np.pi * v) + 25 * np.sin(46 * np.pi * u) * np.sin(38 * np.pi * v + 2)
    return (hills + 30) * away * away * (3 - 2 * away)


def place(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(..., 3): +X with u, -Z with 1 - v: v = 0 is the far side."""
    return np.stack([(u - 0.5) * SIDE, height(u, v), (v - 0.5) * SIDE], axis=-1)


def chart(row: int, column: int) -> dict:
    """One square of the country; uv from 0 to 1 within it."""
    s = np.linspace(0, 1, ROWS)
    x, y = np.meshgrid(s, s)
    u, v = (column + x) / CHARTS, (row + y) / CHARTS
    step = 1e-4
    du = place(u + step, v) - place(u - step, v)
    dv = place(u, v + step) - place(u, v - step)
    normal = np.cross(dv, du)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    at = np.arange(ROWS * ROWS).reshape(ROWS, ROWS)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return {"positions": place(u, v).reshape(-1, 3), "normals": normal.reshape(-1, 3),
            "uv0": np.stack([x, y], axis=-1).reshape(-1, 2), "indices": np.stack([a, b, c, a, c, d], axis=-1).reshape(-1)}


def build(scene) -> None:
    size = EXTENT // CHARTS
    for row in range(CHARTS):
        for column in range(CHARTS):
            material = scene.material(f"country {row} {column}", (1, 1, 1, 1), roughness=0.95)
            scene.component("texture_source.virtual", {"source": "road", "extent": EXTENT, "chart_size": size,
                                                       "chart_x": column * size, "chart_y": row * size}, material=material)
            scene.instance(scene.mesh(material=material, name=f"country {row} {column}", **chart(row, column)))
    post = scene.mesh(material=scene.material("post", (0.75, 0.74, 0.7, 1), roughness=0.6), name="post",
                      **shapes.box((0.12, 1.1, 0.12)))
    for v in np.arange(0.3, 0.7, 24 / SIDE):
        for side in (-26, 26):
            u = middle(v) + side / SIDE
            at = place(np.array(u), np.array(v))
            scene.instance(post, shapes.translation(at[0], at[1] + 0.5, at[2]))
    eye, target = view(0.0)
    scene.camera(eye, target, name="driver")
    hill = place(np.array(middle(0.5) + 0.03), np.array(0.53)) + (0, 60, 0)
    scene.camera(hill, place(np.array(middle(0.49)), np.array(0.48)), name="hill", use=False)


def view(time: float) -> tuple[np.ndarray, np.ndarray]:
    v = 0.62 - SPEED * time / SIDE
    ahead = v - 60 / SIDE
    return (place(np.array(middle(v) + 4 / SIDE), np.array(v)) + (0, EYE, 0),
            place(np.array(middle(ahead) + 4 / SIDE), np.array(ahead)) + (0, 0.5, 0))


def update(scene, time: float) -> None:
    eye, target = view(time)
    scene.move_camera(0, eye, target)
