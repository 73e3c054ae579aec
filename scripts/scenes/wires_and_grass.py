# SPDX-License-Identifier: Apache-2.0
"""Wires and grass: what is thinner than a pixel. A meadow of alpha-masked tufts, a chain-link fence of masked texture,
and power lines of 8 mm that run 300 m to the horizon. For antialiasing, alpha tests, shadows of thin things.

update(scene, time) bends the tufts in the wind: every tuft is sheared by a travelling wave.
"""

import numpy as np

from heddle import shapes

TUFTS = 5000
FIELD = 44.0  # metres across
POLES, SPAN = 7, 50.0  # metres from pole to pole
WIRE = 0.004  # radius, metres

_tufts = []  # (instance, place), of the scene that was built last


def encode(linear: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(np.clip(np.dstack([srgb, alpha]), 0, 1) * 255).astype(np.uint8)


def blades(size: int = 128) -> np.ndarray:
    """A dozen blades that grow from the lower edge, curved, darker at their roots; alpha is a mask."""
    generator = np.random.default_rng(31)
    y, x = np.mgrid[0:size, 0:size] / size
    up = 1 - y
    color, alpha = np.zeros((size, size, 3)) + [0.04, 0.10, 0.02], np.zeros((size, size))
    for _ in range(14):
        root, lean, height, width = generator.uniform(0.1, 0.9), generator.uniform(-0.25, 0.25), generator.uniform(0.5, 0.98), generator.uniform(0.012, 0.026)
        t = np.clip(up / height, 0, 1)
        inside = (np.abs(x - root - lean * t * t) < width * (1 - t)) & (up < height)
        tint = generator.uniform(0.7, 1.3)
        color[inside] = np.array([0.26, 0.46, 0.10]) * tint * (0.5 + 0.5 * t[inside])[:, None]
        alpha[inside] = 1
    return encode(color, alpha)


def chain_link(size: int = 64) -> np.ndarray:
    """Diagonal wires, one mesh a tile."""
    y, x = np.mgrid[0:size, 0:size] / size
    distance = np.minimum(np.abs(((x + y) % 1) - 0.5), np.abs(((x - y) % 1) - 0.5))
    wire = (distance < 0.06).astype(float)
    shade = 0.35 + 0.25 * np.clip(1 - distance / 0.06, 0, 1)
    return encode(np.dstack([shade] * 3) * [0.9, 0.95, 1.0], wire)


def hills(x, z):
    return 0.35 * np.sin(0.11 * x) * np.cos(0.09 * z) + 0.12 * np.sin(0.31 * x + 1.3) * np.sin(0.27 * z)


def build(scene) -> None:
    generator = np.random.default_rng(32)
    ground = scene.material("soil", (0.07, 0.10, 0.03, 1), roughness=1.0)
    grass = scene.material("grass", (1, 1, 1, 1), roughness=0.8, alpha_mode="mask",
                           base_color_texture=scene.texture(blades(), wrap="clamp", name="blades"))
    fence = scene.material("chain link", (1, 1, 1, 1), metalness=0.6, roughness=0.45, alpha_mode="mask", alpha_cutoff=0.4, double_sided=True,
                           base_color_texture=scene.texture(chain_link(), name="chain link"))
    steel = scene.material("steel wire", (0.35, 0.36, 0.38, 1), metalness=1.0, roughness=0.4)
    wood = scene.material("pole", (0.20, 0.15, 0.10, 1), roughness=0.9)
    insulator = scene.material("insulator", (0.55, 0.20, 0.12, 1), roughness=0.15)

    field = shapes.grid(400, 400, 100, 100, hills)
    scene.instance(scene.mesh(material=ground, name="ground", **field))

    # A tuft is three crossed squares; normals point up on both sides, as the meadow's would, so that its shading is even.
    cards = [shapes.quad((-0.35 * np.cos(a), 0, 0.35 * np.sin(a)), (0.7 * np.cos(a), 0, -0.7 * np.sin(a)), (0, 0.6, 0))
             for a in (0, np.pi / 3, 2 * np.pi / 3)]
    for card in cards:
        card["uv0"] = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
        card["normals"] = np.tile((0.0, 1.0, 0.0), (4, 1))
    cards += [{**card, "indices": card["indices"][:, ::-1]} for card in cards]
    tuft = scene.mesh(material=grass, name="tuft", **shapes.merge(*cards))
    _tufts.clear()
    for x, z in generator.uniform(-FIELD / 2, FIELD / 2, size=(TUFTS, 2)):
        size = generator.uniform(0.6, 1.5)
        at = shapes.translation(x, hills(x, z) - 0.03, z) @ shapes.rotation_y(generator.uniform(0, 2 * np.pi)) @ shapes.scaling(size, size, size)
        _tufts.append((scene.instance(tuft, at), at))

    # A fence of 1.6 m along the field, meshes of 16 cm.
    panel = shapes.quad((-1.5, 0, 0), (3, 0, 0), (0, 1.6, 0))
    panel["uv0"] = panel["uv0"] / 0.16
    mesh = scene.mesh(material=fence, name="fence", **panel)
    post = scene.mesh(material=steel, name="post", **shapes.lathe([(0.04, 0), (0.04, 1.7)], 10))
    for i in range(8):
        x = -21 + 3 * i
        scene.instance(mesh, shapes.translation(x, hills(x, 3.0) + 0.05, 3.0))
        scene.instance(post, shapes.translation(x - 1.5, hills(x - 1.5, 3.0), 3.0))

    # Poles with three wires that sag by a metre between them.
    pole = scene.mesh(material=wood, name="power pole", **shapes.merge(shapes.lathe([(0.17, 0), (0.12, 9)], 14), shapes.box((2.4, 0.16, 0.14), (0, 8.5, 0))))
    cup = scene.mesh(material=insulator, name="insulator", **shapes.lathe([(0.03, 0), (0.06, 0.06), (0.03, 0.1), (0.06, 0.16), (0.02, 0.2)], 12))
    t = np.linspace(0, 1, 25)
    sag = -4 * 1.0 * t * (1 - t)
    wire = scene.mesh(material=steel, name="power line", **shapes.tube(np.stack([0 * t, sag, -SPAN * t], 1), WIRE, 5))
    for i in range(POLES):
        z = 20 - SPAN * i
        scene.instance(pole, shapes.translation(9, hills(9.0, z), z))
        for across in (-1.1, 0.0, 1.1):
            scene.instance(cup, shapes.translation(9 + across, hills(9.0, z) + 8.58, z))
            if i + 1 < POLES:
                rise = hills(9.0, z - SPAN) - hills(9.0, z)
                matrix = shapes.translation(9 + across, hills(9.0, z) + 8.78, z)
                matrix[1, 2] = -rise / SPAN  # sheared, so that it ends at the next insulator
                scene.instance(wire, matrix)
    scene.camera((0.5, 1.6, 9.0), (3.2, 1.9, -10.0), vertical_angle=0.95, name="meadow")
    scene.camera((6.5, 1.7, 24.0), (8.9, 7.0, -40.0), vertical_angle=0.6, name="wires", use=False)
    scene.use_camera(0)


def update(scene, time: float) -> None:
    """The wind at a time: a wave that runs along x."""
    for instance, at in _tufts:
        x, z = at[0, 3], at[2, 3]
        lean = 0.12 + 0.15 * np.sin(1.7 * time - 0.35 * x + 0.2 * z) + 0.06 * np.sin(4.1 * time + x)
        bent = at.copy()
        bent[0, :3] += lean * at[1, :3]  # scene x grows with the height above the root
        scene.move(instance, bent)
