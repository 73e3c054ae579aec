# SPDX-License-Identifier: Apache-2.0
"""Material grid: spheres of all roughnesses (columns, 0 to 1) and metalnesses (rows, 0 to 1), and below them two rows of
dielectrics, index of refraction 1 to 2.5 by column: smooth, and half rough. For looking at a BRDF; every ball has a
material of its own, 0.9 m apart.
"""

import numpy as np

from heddle import shapes

COLUMNS, ROWS = 11, 6
SPACING = 0.9  # metres


def build(scene) -> None:
    ball = shapes.sphere(0.4, 48)
    columns = np.linspace(0, 1, COLUMNS)

    def place(material, column, row):
        x, y = (column - (COLUMNS - 1) / 2) * SPACING, (row + 2) * SPACING + 0.5
        scene.instance(scene.mesh(material=material, name=f"ball {column} {row}", **ball), shapes.translation(x, y, 0))

    for row, metalness in enumerate(np.linspace(0, 1, ROWS)):
        for column, roughness in enumerate(columns):
            name = f"roughness {roughness:.1f}, metalness {metalness:.1f}"
            place(scene.material(name, (0.95, 0.64, 0.54, 1), metalness=float(metalness), roughness=float(roughness)), column, row)
    for column, share in enumerate(columns):
        for row, roughness in ((-1, 0.05), (-2, 0.5)):
            ior = 1 + 1.5 * float(share)
            place(scene.material(f"ior {ior:.2f}, roughness {roughness}", (0.05, 0.12, 0.25, 1), roughness=roughness, ior=ior),
                  column, row)
    floor = scene.material("floor", (0.35, 0.35, 0.35, 1), roughness=0.9)
    width = COLUMNS * SPACING + 6
    scene.instance(scene.mesh(material=floor, name="floor", **shapes.quad((-width / 2, 0, 6), (width, 0, 0), (0, 0, -10))))
    scene.light("directional", (3.0, 2.8, 2.5), direction=(-0.4, -0.6, -0.7), name="key")
    middle = (ROWS + 2) / 2 * SPACING
    scene.camera((0, middle + 0.3, 13.5), (0, middle, 0), vertical_angle=0.62, name="front")
    scene.camera((-2.2, middle, 3.2), (-1.6, middle - 0.5, 0), vertical_angle=0.9, name="close", use=False)
