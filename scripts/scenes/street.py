# SPDX-License-Identifier: Apache-2.0
"""Street at night: 512 lights of five kinds in a lane of houses 160 m long, for techniques that choose among lights.

Street lamps are spots, shop windows rectangles, lanterns spheres, strings of bulbs points, and cars drive by with two
headlights each: update(scene, time) moves them. Everything random has a seed. Night: exposures of 4 to 7.
build(scene, lights=64) lights an even choice of so many of them; everything else stays.
"""

import numpy as np

from heddle import shapes

LENGTH, WIDTH = 160.0, 9.0  # metres
HOUSES = 20  # along each side
CARS = 8
BULBS, LANTERNS = 344, 80  # the rest of the 512: 40 street lamps, 32 windows, 16 headlights
LIGHTS = 512
SPEED = 8.0  # metres a second

_cars = []  # (instance, lights, lane, start), of the scene that was built last


def color_of(temperature: float) -> np.ndarray:
    """Linear Rec.709 of a black body, its largest component 1: a fit by straight lines in the logarithm, 1500 to 8000 K."""
    share = np.clip(np.log(temperature / 1500) / np.log(8000 / 1500), 0, 1)
    return np.array([1.0 - 0.35 * max(share - 0.8, 0) / 0.2, 0.28 + 0.60 * share, 0.02 + 0.98 * share**1.5])


def car_shape() -> dict:
    body = shapes.prism([(-2.1, 0.35), (2.1, 0.35), (2.15, 0.75), (1.2, 0.85), (-2.0, 0.95), (-2.15, 0.7)], 1.7)
    cabin = shapes.prism([(-1.7, 0.9), (1.1, 0.85), (0.5, 1.4), (-1.3, 1.42)], 1.5)
    wheel = shapes.lathe([(0.0001, -0.1), (0.32, -0.1), (0.32, 0.1), (0.0001, 0.1)], 16)
    turned = {**wheel, "positions": wheel["positions"][:, [0, 2, 1]] * (1, 1, -1), "normals": wheel["normals"][:, [0, 2, 1]] * (1, 1, -1)}
    return shapes.merge(body, cabin, *[shapes.moved(turned, (x, 0.32, z)) for x in (-1.4, 1.4) for z in (-0.8, 0.8)])


class Lit:
    """A scene of whose lights an even choice shines; those that do not are None."""

    def __init__(self, scene, lights: int):
        self.scene, self.lights, self.asked = scene, lights, 0

    def __call__(self, *arguments, **more):
        self.asked += 1
        if self.asked * self.lights // LIGHTS == (self.asked - 1) * self.lights // LIGHTS:
            return None
        return self.scene.light(*arguments, **more)


def build(scene, lights: int = LIGHTS) -> None:
    if not 1 <= lights <= LIGHTS:
        raise ValueError(f"{lights} lights: 1 to {LIGHTS} are there")
    light = Lit(scene, lights)
    generator = np.random.default_rng(21)
    half, side = LENGTH / 2, WIDTH / 2
    material = {
        "road": scene.material("wet asphalt", (0.06, 0.06, 0.065, 1), roughness=0.28),
        "stone": scene.material("pavement", (0.25, 0.24, 0.22, 1), roughness=0.8),
        "iron": scene.material("iron", (0.08, 0.09, 0.09, 1), metalness=0.6, roughness=0.5),
        "glass": scene.material("bulb", (0.9, 0.9, 0.9, 1), emissive=(60, 40, 18)),
        "lantern": scene.material("paper lantern", (0.9, 0.3, 0.15, 1), roughness=0.9, emissive=(24, 7, 2.5)),
        "window": scene.material("lit window", (0.2, 0.2, 0.2, 1), roughness=0.3, emissive=(14, 9, 4.5)),
        "dark": scene.material("dark window", (0.03, 0.04, 0.06, 1), roughness=0.05),
        "frame": scene.material("window frame", (0.45, 0.42, 0.38, 1), roughness=0.7),
    }
    walls = [scene.material(f"plaster {i}", (*color, 1), roughness=0.9)
             for i, color in enumerate(((0.45, 0.36, 0.26), (0.32, 0.20, 0.15), (0.38, 0.38, 0.36), (0.24, 0.28, 0.24)))]

    def mesh(shape, name, key):
        return scene.mesh(material=key if isinstance(key, int) else material[key], name=name, **shape)

    def place(index, *at, turn=0.0, size=(1, 1, 1)):
        return scene.instance(index, shapes.translation(*at) @ shapes.rotation_y(turn) @ shapes.scaling(*size))

    place(mesh(shapes.quad((-half, 0, side), (LENGTH, 0, 0), (0, 0, -WIDTH)), "road", "road"), 0, 0, 0)
    kerb = mesh(shapes.box((LENGTH, 0.15, 2.5)), "pavement", "stone")
    for sign in (-1, 1):
        place(kerb, 0, 0.075, sign * (side + 1.25))

    # Houses of 3 to 5 storeys; shutters and sills are parts of their own, windows lit here and there.
    blocks = [mesh(shapes.box((LENGTH / HOUSES, 1, 6), (0, 0.5, 0)), f"house {i}", walls[i]) for i in range(len(walls))]
    lit, dark = mesh(shapes.quad((-0.5, 0, 0), (1, 0, 0), (0, 1.5, 0)), "lit window", "window"), mesh(shapes.quad((-0.5, 0, 0), (1, 0, 0), (0, 1.5, 0)), "dark window", "dark")
    sill, jamb = mesh(shapes.box((1.3, 0.08, 0.25)), "sill", "frame"), mesh(shapes.box((0.1, 1.6, 0.12)), "jamb", "frame")
    cornice = mesh(shapes.box((LENGTH / HOUSES + 0.1, 0.35, 0.5)), "cornice", "frame")
    shop = mesh(shapes.quad((-1.5, 0, 0), (3, 0, 0), (0, 2.2, 0)), "shop window", "window")
    shops = 0
    for sign in (-1, 1):
        turn, front = (0.0, -side - 2.5) if sign < 0 else (np.pi, side + 2.5)
        for i in range(HOUSES):
            x = -half + (i + 0.5) * LENGTH / HOUSES
            storeys = int(generator.integers(3, 6))
            height = 3.4 + 3.0 * (storeys - 1)
            place(blocks[int(generator.integers(len(blocks)))], x, 0, front + sign * 3.0, size=(1, height, 1))
            place(cornice, x, height - 0.2, front - sign * 0.1)
            for storey in range(1, storeys):
                for k in (-1.3, 1.3) if storey % 2 else (-2.4, 0, 2.4):
                    y = 3.4 + 3.0 * (storey - 1) + 0.9
                    place(lit if generator.random() < 0.3 else dark, x + k, y, front - sign * 0.02, turn=turn)
                    place(sill, x + k, y - 0.05, front - sign * 0.1)
                    for edge in (-0.58, 0.58):
                        place(jamb, x + k + edge, y + 0.75, front - sign * 0.04)
            if i % 5 != 4 and shops < 32:
                shops += 1
                place(shop, x, 0.5, front - sign * 0.03, turn=turn)
                light("rectangle", (14, 9, 4.5), (x, 1.6, front - sign * 0.04), (0, 0, -sign), range=14, tangent=(1, 0, 0),
                            half_extent=(1.5, 1.1, 0), casts_shadow=False, name=f"shop {shops}")

    # Street lamps every eight metres, both sides.
    pole = mesh(shapes.merge(shapes.lathe([(0.16, 0), (0.12, 0.3), (0.06, 0.5), (0.05, 4.6)], 12),
                             shapes.tube([(0, 4.55, 0), (0, 4.95, 0.15), (0, 5.05, 0.6), (0, 4.95, 1.0)], 0.035, 8),
                             shapes.moved(shapes.lathe([(0.22, 0), (0.05, 0.2)], 12), (0, 4.8, 1.0))), "street lamp", "iron")
    bulb = mesh(shapes.sphere(0.05, 10), "bulb", "glass")
    for i in range(20):
        for sign in (-1, 1):
            x, z = -half + 4 + i * 8, sign * (side + 0.3)
            place(pole, x, 0.15, z, turn=0.0 if sign < 0 else np.pi)
            place(bulb, x, 4.97, z - sign * 1.0, size=(2, 2, 2))
            light("spot", color_of(2600) * 1400, (x, 4.93, z - sign * 1.0), (0, -1, 0), range=16, inner_angle=0.6,
                        outer_angle=1.2, casts_shadow=False, name=f"street lamp {i} {'north' if sign < 0 else 'south'}")

    # Strings of bulbs over the street, in a parabola, with a wire; and lanterns between them.
    strings, per_string = 8, BULBS // 8
    for s in range(strings):
        x = -half + (s + 0.5) * LENGTH / strings
        t = np.linspace(-1, 1, per_string)
        line = np.stack([x + 6 * t, 6.2 + 1.2 * t * t, (side + 2.4) * t], 1)
        place(mesh(shapes.tube(line + (0, 0.06, 0), 0.008, 4), f"wire {s}", "iron"), 0, 0, 0)
        for k, (bx, by, bz) in enumerate(line):
            place(bulb, bx, by, bz)
            light("point", color_of(generator.uniform(1800, 3200)) * 3.0, (bx, by, bz), range=5.0, casts_shadow=False,
                        name=f"bulb {s} {k}")
    ball = mesh(shapes.sphere(0.22, 16), "lantern", "lantern")
    for k in range(LANTERNS):
        x, z = -half + (k + 0.5) * LENGTH / LANTERNS, (side + 1.6) * (1 if k % 2 else -1)
        y = 3.0 + 0.25 * generator.random()
        place(ball, x, y, z, size=(1, 1.25, 1))
        light("sphere", (24, 7, 2.5), (x, y, z), range=7.0, radius=0.22, casts_shadow=False, name=f"lantern {k}")

    # Cars in two lanes.
    _cars.clear()
    paints = [scene.material(f"paint {i}", (*color, 1), metalness=0.3, roughness=0.25)
              for i, color in enumerate(((0.35, 0.02, 0.02), (0.03, 0.08, 0.3), (0.5, 0.5, 0.5), (0.02, 0.02, 0.02)))]
    shape = car_shape()
    bodies = [mesh(shape, f"car {i}", paint) for i, paint in enumerate(paints)]
    for k in range(CARS):
        lane = -1 if k % 2 else 1
        start = -half + (k + 0.5) * LENGTH / CARS
        instance = place(bodies[k % len(bodies)], 0, 0, 0)
        pair = [light("spot", color_of(4300) * 900, range=40.0, inner_angle=0.12, outer_angle=0.45, casts_shadow=False,
                              name=f"headlight {k} {side_name}") for side_name in ("left", "right")]
        _cars.append((instance, pair, lane, start))
    update(scene, 0.0)
    scene.camera((-58, 1.7, 0.8), (-20, 2.6, -0.6), vertical_angle=0.95, name="walker")
    scene.camera((-70, 15, 3.0), (-30, 1, -1), vertical_angle=0.9, name="roof", use=False)
    scene.use_camera(0)


def update(scene, time: float) -> None:
    """Drives the cars, at SPEED and from one end to the other, to where they are at a time."""
    half = LENGTH / 2
    for instance, lights, lane, start in _cars:
        x = (start + lane * SPEED * time + half) % LENGTH - half
        z = -lane * WIDTH / 4
        scene.move(instance, shapes.translation(x, 0, z) @ shapes.rotation_y(0.0 if lane > 0 else np.pi))
        for light, across in zip(lights, (-0.6, 0.6)):
            if light is None:
                continue
            scene.set_light(light, "spot", color_of(4300) * 900, (x + lane * 2.2, 0.65, z + across), (lane, -0.06, 0), range=40.0,
                            inner_angle=0.12, outer_angle=0.45, casts_shadow=False)
