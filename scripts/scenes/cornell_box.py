# SPDX-License-Identifier: Apache-2.0
"""Cornell box: a closed room of 2 m with one red and one green wall, two boxes and a square lamp in the ceiling.

For closed forms: every surface is diffuse and without textures, the room is a cube about (0, 1, 0), and the lamp a
rectangle light of known radiance just under the ceiling. Its power is pi * RADIANCE * area; the light that reaches a
point straight below at distance d is the form factor of a rectangle (lamp_irradiance). Reflectances after Goral et al.
1984, "Modeling the Interaction of Light Between Diffuse Surfaces", rounded.

The lamp is 60 cd/m^2, so a graph with a sky shows nothing but white through the open front. Look at it with:
heddle run scripts/scenes/cornell_box.py --set sky.technique=none --set params.exposure=0
"""

import numpy as np

from heddle import shapes

SIDE = 2.0  # of the room, metres
LAMP = 0.5  # side of the lamp, metres
RADIANCE = 60.0  # of the lamp, cd/m^2
GAP = 0.01  # from the ceiling to the lamp, metres
WHITE, RED, GREEN = (0.73, 0.73, 0.73), (0.63, 0.06, 0.05), (0.14, 0.45, 0.09)


def lamp_irradiance(height: float) -> float:
    """Lux of the lamp, without shadows or bounces, on a horizontal spot of the room's axis, `height` metres above the
    floor: four corner form factors of a parallel rectangle (Siegel and Howell 1992, configuration factor B-3)."""
    d = SIDE - GAP - height
    x = LAMP / 2 / d
    a = x / np.sqrt(1 + x * x)
    return float(4 * RADIANCE * a * np.arctan(a))


def build(scene) -> None:
    h = SIDE / 2
    materials = {name: scene.material(name, (*color, 1), roughness=1.0, ior=1.0)
                 for name, color in (("white", WHITE), ("red", RED), ("green", GREEN))}
    lamp = scene.material("lamp", (0, 0, 0, 1), roughness=1.0, ior=1.0, emissive=(RADIANCE,) * 3)

    def wall(origin, u, v, material, name):
        scene.instance(scene.mesh(material=material, name=name, **shapes.quad(origin, u, v)), name=name)

    wall((-h, 0, h), (SIDE, 0, 0), (0, 0, -SIDE), materials["white"], "floor")
    wall((-h, SIDE, -h), (SIDE, 0, 0), (0, 0, SIDE), materials["white"], "ceiling")
    wall((-h, 0, -h), (SIDE, 0, 0), (0, SIDE, 0), materials["white"], "back")
    wall((-h, 0, h), (0, 0, -SIDE), (0, SIDE, 0), materials["red"], "left")
    wall((h, 0, -h), (0, 0, SIDE), (0, SIDE, 0), materials["green"], "right")
    wall((-LAMP / 2, SIDE - GAP, -LAMP / 2), (LAMP, 0, 0), (0, 0, LAMP), lamp, "lamp")
    box = scene.mesh(material=materials["white"], name="box", **shapes.box((1, 1, 1), (0, 0.5, 0)))
    for name, place, turn, size in (("tall", (-0.35, 0, -0.3), 0.30, (0.6, 1.2, 0.6)), ("short", (0.36, 0, 0.32), -0.29, (0.6, 0.6, 0.6))):
        scene.instance(box, shapes.translation(*place) @ shapes.rotation_y(turn) @ shapes.scaling(*size), name)
    scene.light("rectangle", (RADIANCE,) * 3, (0, SIDE - GAP, 0), (0, -1, 0), half_extent=(LAMP / 2, LAMP / 2, 0), name="lamp")
    scene.camera((0, 1, 4.4), (0, 1, 0), vertical_angle=0.65, name="front")
