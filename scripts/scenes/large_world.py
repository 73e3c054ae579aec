# SPDX-License-Identifier: Apache-2.0
"""Large world: a plain of 40 km with rows of towers from 10 m to 20 km away, all of it 100 km from the scene's origin.

Float32 has steps of 8 mm there: positions that pass through it would shake and tear. The same file with OFFSET zero
must give the same picture; `build(scene, offset)` takes another.
"""

import numpy as np

from heddle import shapes

OFFSET = (100_000.25, 500.125, -100_000.75)  # metres; exact in float64, not in float32


def build(scene, offset=OFFSET) -> None:
    origin = np.asarray(offset, dtype=np.float64)
    plain = scene.material("plain", (0.30, 0.26, 0.18, 1), roughness=1.0)
    stone = [scene.material(f"stone {i}", (*color, 1), roughness=0.7) for i, color in enumerate(((0.6, 0.55, 0.5), (0.5, 0.2, 0.12), (0.25, 0.3, 0.4)))]
    bronze = scene.material("bronze", (0.72, 0.43, 0.20, 1), metalness=1.0, roughness=0.3)

    def place(mesh, x, y, z, turn=0.0, size=(1, 1, 1), name=None):
        scene.instance(mesh, shapes.translation(*(origin + (x, y, z))) @ shapes.rotation_y(turn) @ shapes.scaling(*size), name)

    # Squares grow with their distance, so that each is flat to float32 in itself.
    tile = scene.mesh(material=plain, name="ground", **shapes.quad((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1)))
    place(tile, 0, 0, 0, size=(64, 1, 64))
    size = 64.0
    while size < 40_000:
        for i in range(-1, 2):
            for k in range(-1, 2):
                if (i, k) != (0, 0):
                    place(tile, i * size, 0, k * size, size=(size, 1, size))
        size *= 3

    tower = shapes.merge(shapes.box((6, 18, 6), (0, 9, 0)), shapes.box((7, 1, 7), (0, 18.5, 0)),
                         *[shapes.box((1, 1.4, 1), (x, 19.7, z)) for x in (-3, -1, 1, 3) for z in (-3, 3)])
    towers = [scene.mesh(material=key, name=f"tower {i}", **tower) for i, key in enumerate(stone)]
    for row, distance in enumerate(np.geomspace(30, 20_000, 16)):
        for side in (-1, 1):
            scale = max(1.0, distance / 500)
            place(towers[row % 3], side * (12 + 0.18 * distance), 0, -distance, 0.2 * row, (scale, scale, scale), f"tower {row} {side}")
    # Near things with detail, on which shaking would show first.
    place(scene.mesh(material=stone[0], name="plinth", **shapes.box((1.6, 0.9, 1.6), (0, 0.45, 0))), 0, 0, -4)
    place(scene.mesh(material=bronze, name="ball", **shapes.sphere(0.6, 48)), 0, 1.5, -4)
    ring = scene.mesh(material=bronze, name="ring", **shapes.torus(1.1, 0.03, 48, 8))
    for i in range(6):
        place(ring, 0, 1.5, -4, i * np.pi / 6)
    position = origin + (1.2, 1.9, 1.5)
    scene.camera(position, origin + (0.1, 1.7, -8), vertical_angle=0.9, name="walker")
    scene.camera(origin + (60, 320, 260), origin + (0, 0, -900), vertical_angle=0.7, name="bird", use=False)
    scene.use_camera(0)
