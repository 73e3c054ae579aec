# SPDX-License-Identifier: Apache-2.0
"""Subdivided cages: a cube, the same with creases, a cup, and a figure extruded from boxes.

Everything but the floor and the small cage carries subdivision.surface. In the shipped graphs the pass `subdivision` makes
surfaces of them; to see cages: heddle run scripts/scenes/subdivision.py --set subdivision.technique=none
"""

import numpy as np

from heddle import shapes

# Cells of the figure, in units of a quarter of a metre: x, y, z. No two touch in an edge or corner alone.
FIGURE = ([(x, y, 0) for x in (-1, 0, 1) for y in (5, 6, 7)]  # trunk
          + [(side, y, 0) for side in (-1, 1) for y in range(5)] + [(side, 0, 1) for side in (-1, 1)]  # legs, feet
          + [(side * x, 7, 0) for side in (-1, 1) for x in (2, 3, 4)]  # arms
          + [(0, 8, 0)] + [(x, y, z) for x in (-1, 0, 1) for y in (9, 10) for z in (-1, 0, 1)])  # neck, head

SIDES = {(1, 0, 0): ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)), (-1, 0, 0): ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)),
         (0, 1, 0): ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)), (0, -1, 0): ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
         (0, 0, 1): ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)), (0, 0, -1): ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))}


def cells(filled):
    """Positions and quads of the boundary of unit cells at integer places."""
    present, points, faces = set(filled), {}, []
    for cell in filled:
        for step, corners in SIDES.items():
            if tuple(np.add(cell, step)) in present:
                continue
            faces.append([points.setdefault(tuple(np.add(cell, corner)), len(points)) for corner in corners])
    return np.array(list(points), dtype=np.float32), faces


def cube():
    """Positions and quads of [-1, 1]^3."""
    positions, faces = cells([(0, 0, 0)])
    return positions * 2 - 1, faces


def build(scene) -> None:
    floor = scene.material("floor", (0.5, 0.5, 0.5, 1), roughness=0.9)
    clay = scene.material("clay", (0.62, 0.36, 0.26, 1), roughness=0.6)
    blue = scene.material("blue", (0.2, 0.32, 0.6, 1), roughness=0.4)
    green = scene.material("green", (0.35, 0.5, 0.25, 1), roughness=0.5, double_sided=True)
    scene.instance(scene.mesh(material=floor, name="floor", **shapes.quad((-8, 0, 6), (16, 0, 0), (0, 0, -12))), name="floor")

    positions, faces = cube()
    place = shapes.scaling(0.55, 0.55, 0.55)
    smooth = scene.mesh(positions, clay, faces=faces, name="cube")
    one = scene.instance(smooth, shapes.translation(-2.4, 0.47, 0) @ place, "cube")
    scene.component("subdivision.surface", {"levels": 4}, instance=one)
    scene.instance(smooth, shapes.translation(-3.6, 0.25, 0.9) @ shapes.scaling(0.25, 0.25, 0.25), "cage")

    # The rim on top is sharp for ever, the one below for two levels.
    top = [i for i, p in enumerate(positions) if p[1] > 0]
    edges = sorted({tuple(sorted((face[i], face[i - 1]))) for face in faces for i in range(4)})
    creases = [(a, b, 10.0 if a in top else 2.0) for a, b in edges if (a in top) == (b in top)]
    creased = scene.mesh(positions, blue, faces=faces, creases=creases, name="creased")
    one = scene.instance(creased, shapes.translation(-0.8, 0.47, 0) @ place, "creased")
    scene.component("subdivision.surface", {"levels": 4}, instance=one)

    # Open at the top: its border is a curve.
    cup = scene.mesh(positions, green, faces=[face for face in faces if not all(i in top for i in face)], name="cup")
    one = scene.instance(cup, shapes.translation(0.8, 0.4, 0) @ shapes.rotation_y(0.4) @ place, "cup")
    scene.component("subdivision.surface", {"levels": 4, "border": "corners_pinned"}, instance=one)

    positions, faces = cells(FIGURE)
    figure = scene.mesh((positions - (0.5, 0, 0.5)) * 0.22, clay, faces=faces, name="figure")
    one = scene.instance(figure, shapes.translation(2.6, 0, 0) @ shapes.rotation_y(-0.3), "figure")
    scene.component("subdivision.surface", {"levels": 3}, instance=one)

    scene.light("directional", (60000.0,) * 3, direction=(-0.5, -1, -0.6), name="sun")
    scene.camera((0, 2.9, 7.4), (-0.1, 0.85, 0), vertical_angle=0.58, name="front")
