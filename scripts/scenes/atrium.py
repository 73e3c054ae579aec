# SPDX-License-Identifier: Apache-2.0
"""Atrium: a colonnaded courtyard of two storeys, open to the sky, of thousands of instanced parts.

Heddle's default scene. Everything is made here: geometry, textures, lamps. About 35 m long, 19 m wide, 12 m high; the
sun comes from the graph's sky, the lamps are point lights of 150 cd under the galleries and one spot over the fountain.
"""

import numpy as np

from heddle import shapes

LENGTH, WIDTH = 28.0, 12.0  # of the open court, metres
BAY = 3.5  # from column to column
COLUMN = 3.4  # height
STOREY = 5.0
AISLE = 3.2  # depth of the galleries


def noise(size: int, seed: int, octaves: int = 5) -> np.ndarray:
    """Tileable value noise in 0..1, (size, size)."""
    generator = np.random.default_rng(seed)
    total, weight = np.zeros((size, size)), 0.0
    for octave in range(octaves):
        cells = 4 << octave
        grid = generator.random((cells, cells))
        x = np.arange(size) * cells / size
        i, f = np.floor(x).astype(int), x - np.floor(x)
        f = f * f * (3 - 2 * f)
        j = (i + 1) % cells
        rows = grid[i] * (1 - f)[:, None] + grid[j] * f[:, None]
        total += (rows[:, i] * (1 - f) + rows[:, j] * f) / 2**octave
        weight += 1 / 2**octave
    return total / weight


def to_srgb8(linear: np.ndarray, alpha: np.ndarray | None = None) -> np.ndarray:
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    full = np.ones(linear.shape[:2]) if alpha is None else alpha
    return np.round(np.clip(np.dstack([encoded, full]), 0, 1) * 255).astype(np.uint8)


def normal_map(height: np.ndarray, strength: float) -> np.ndarray:
    """Tangent-space normals of a tileable height field."""
    dx = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * strength
    dy = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * strength
    n = np.dstack([-dx, dy, np.ones_like(height)])
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round(np.dstack([n * 0.5 + 0.5, np.ones_like(height)]) * 255).astype(np.uint8)


def stone_blocks(size: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Ashlar of 2 x 4 blocks: colour and height."""
    y, x = np.mgrid[0:size, 0:size] / size
    row = np.floor(y * 4)
    u, v = (x * 2 + 0.5 * (row % 2)) % 1.0, (y * 4) % 1.0
    joint = np.minimum(np.minimum(u, 1 - u) * 2, np.minimum(v, 1 - v))
    block = np.clip(joint / 0.06, 0, 1)
    grain = noise(size, 1)
    shade = 0.75 + 0.25 * np.random.default_rng(2).random((4, 3))[row.astype(int) % 4, np.floor(x * 2 + 0.5 * (row % 2)).astype(int) % 2]
    color = np.array([0.62, 0.52, 0.40]) * (0.7 + 0.5 * grain)[..., None] * shade[..., None] * (0.55 + 0.45 * block)[..., None]
    return to_srgb8(np.clip(color, 0, 1)), block * 0.6 + grain * 0.4


def paving(size: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Chequered marble slabs: colour, and roughness in green, metalness 0 in blue."""
    y, x = np.mgrid[0:size, 0:size] / size
    dark = (np.floor(x * 2) + np.floor(y * 2)) % 2
    veins = np.abs(noise(size, 3, 6) - 0.5) * 2
    joint = np.clip(np.minimum(np.minimum((x * 2) % 1, 1 - (x * 2) % 1), np.minimum((y * 2) % 1, 1 - (y * 2) % 1)) / 0.015, 0, 1)
    color = np.where(dark[..., None] > 0.5, [0.28, 0.10, 0.07], [0.62, 0.58, 0.50]) * (0.6 + 0.5 * np.sqrt(veins))[..., None]
    color = color * (0.3 + 0.7 * joint)[..., None]
    rough = 0.25 + 0.25 * noise(size, 4) + 0.4 * (1 - joint)
    packed = np.dstack([np.ones_like(rough), np.clip(rough, 0, 1), np.zeros_like(rough), np.ones_like(rough)])
    return to_srgb8(np.clip(color, 0, 1)), np.round(packed * 255).astype(np.uint8)


def leaves(size: int = 128) -> np.ndarray:
    """Ivy: leaf discs on nothing; alpha is a mask."""
    generator = np.random.default_rng(5)
    y, x = np.mgrid[0:size, 0:size] / size
    color, alpha = np.zeros((size, size, 3)) + [0.05, 0.16, 0.03], np.zeros((size, size))
    for _ in range(70):
        cx, cy, r, turn = *generator.random(2), 0.035 + 0.04 * generator.random(), 2 * np.pi * generator.random()
        dx, dy = (x - cx + 0.5) % 1 - 0.5, (y - cy + 0.5) % 1 - 0.5
        angle = np.arctan2(dy, dx) - turn
        inside = np.hypot(dx, dy) < r * (0.75 + 0.25 * np.cos(3 * angle))
        color[inside] = np.array([0.06, 0.22, 0.04]) * (0.6 + 0.9 * generator.random())
        alpha[inside] = 1.0
    return to_srgb8(color, alpha)


def materials(scene) -> dict[str, int]:
    wall_color, wall_height = stone_blocks()
    floor_color, floor_rough = paving()
    wall = scene.texture(wall_color, name="ashlar")
    wall_normal = scene.texture(normal_map(wall_height, 3.0), srgb=False, name="ashlar normals")
    plaster_normal = scene.texture(normal_map(noise(256, 6), 1.5), srgb=False, name="plaster normals")
    made = {
        "wall": scene.material("ashlar", (1, 1, 1, 1), roughness=0.85, base_color_texture=wall, normal_texture=wall_normal),
        "plaster": scene.material("plaster", (0.68, 0.62, 0.52, 1), roughness=0.9, normal_texture=plaster_normal),
        "marble": scene.material("marble", (0.74, 0.71, 0.66, 1), roughness=0.35),
        "floor": scene.material("paving", (1, 1, 1, 1), roughness=1.0, base_color_texture=scene.texture(floor_color, name="paving"),
                                metallic_roughness_texture=scene.texture(floor_rough, srgb=False, name="paving roughness")),
        "wood": scene.material("beams", (0.20, 0.11, 0.06, 1), roughness=0.7),
        "bronze": scene.material("bronze", (0.72, 0.43, 0.20, 1), metalness=1.0, roughness=0.32),
        "water": scene.material("water", (0.02, 0.05, 0.06, 1), roughness=0.04, ior=1.33),
        "lamp": scene.material("lamp glass", (0.9, 0.8, 0.6, 1), roughness=0.3, emissive=(2500, 1700, 800)),
        "tile": scene.material("roof tiles", (0.42, 0.17, 0.09, 1), roughness=0.85),
        "dark tile": scene.material("weathered roof tiles", (0.30, 0.13, 0.08, 1), roughness=0.9),
        "ivy": scene.material("ivy", (1, 1, 1, 1), roughness=0.6, alpha_mode="mask", double_sided=True,
                              base_color_texture=scene.texture(leaves(), name="ivy")),
    }
    for name, color in (("red", (0.45, 0.03, 0.02)), ("green", (0.04, 0.22, 0.06)), ("blue", (0.03, 0.07, 0.35))):
        made[name] = scene.material(f"{name} cloth", (*color, 1), roughness=0.95, double_sided=True)
    return made


def column_shape() -> dict:
    """Base, shaft with entasis, and capital, 3.4 m high."""
    y = np.linspace(0.3, 3.0, 7)
    shaft = [(0.24 - 0.05 * ((t - 0.3) / 2.7) ** 2, t) for t in y]
    turned = shapes.lathe([(0.30, 0.14), (0.33, 0.18), (0.30, 0.24), (0.25, 0.27), *shaft, (0.22, 3.02), (0.22, 3.06),
                           (0.26, 3.10), (0.32, 3.24)], 24)
    return shapes.merge(turned, shapes.box((0.7, 0.14, 0.7), (0, 0.07, 0)), shapes.box((0.74, 0.16, 0.74), (0, 3.32, 0)))


def roof_tile(length: float, radius: float, up: bool) -> dict:
    """Half a pipe along z, its back up or down, a little wider at its lower end so that the next one slides under."""
    angles = np.linspace(0, np.pi, 7) if up else np.linspace(0, -np.pi, 7)
    ends = ((0.0, radius), (length, radius * 1.15))
    positions = np.array([(r * np.cos(a), r * np.sin(a), z) for z, r in ends for a in angles])
    normals = np.tile([(np.cos(a), np.sin(a), 0.0) for a in angles], (2, 1)) * (1 if up else -1)
    n, i = len(angles), np.arange(len(angles) - 1)
    strip = np.concatenate([np.stack([i, n + i, n + i + 1], 1), np.stack([i, n + i + 1, i + 1], 1)])
    return {"positions": positions, "normals": normals, "uv0": positions[:, [0, 2]], "indices": strip}


def voussoirs(span: float, rise: float, count: int, depth: float) -> list[dict]:
    """The stones of an arch: wedges of 0.22 m over a half ellipse, the keystone larger."""
    stones = []
    for k in range(count):
        edges = np.pi * (1 - np.linspace(k + 0.04, k + 0.96, 4) / count)
        key = k == count // 2
        inner = np.stack([0.5 * span * np.cos(edges), rise * np.sin(edges)], 1)
        outward = np.stack([rise * np.cos(edges), 0.5 * span * np.sin(edges)], 1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        outer = inner + outward * (0.32 if key else 0.22)
        parts = [shapes.prism([inner[i + 1], outer[i + 1], outer[i], inner[i]], depth + (0.06 if key else 0.0))
                 for i in range(3)]
        stones.append(shapes.merge(*parts))
    return stones


def trim(place, mesh, material, half_l, half_w) -> None:
    """What makes the walls a building: dentils, coffers, pilasters, tiles, voussoirs' neighbours; counted in thousands."""
    outer_l, outer_w, slab = half_l + AISLE, half_w + AISLE, 0.4
    dentil = mesh(shapes.box((0.13, 0.16, 0.12)), "dentil", "plaster")
    string = mesh(shapes.box((BAY, 0.07, 0.2)), "string course", "marble")
    for level in (STOREY, 2 * STOREY):
        y = level - slab - 0.08
        for side in (-1, 1):
            for i in range(int(2 * half_l / 0.26)):
                place(dentil, -half_l + 0.13 + i * 0.26, y, side * (half_w - 0.30))
            for i in range(int(2 * half_w / 0.26)):
                place(dentil, side * (half_l - 0.30), y, -half_w + 0.13 + i * 0.26, np.pi / 2)
            for i in range(int(2 * half_l / BAY)):
                place(string, -half_l + (i + 0.5) * BAY, level - slab + 0.03, side * (half_w - 0.32))
    # Coffered ceilings of the galleries: frames of four boards in every field between the beams.
    board, cross = mesh(shapes.box((0.09, 0.07, AISLE - 0.3)), "coffer board", "wood"), mesh(shapes.box((1.0, 0.07, 0.09)), "coffer cross", "wood")
    for level in (0.0, STOREY):
        y = level + STOREY - slab - 0.035
        for i in range(int(2 * outer_l / 1.1) - 1):
            for side in (-1, 1):
                x = -outer_l + 1.1 + i * 1.1
                place(board, x, y, side * (half_w + AISLE / 2))
                for k in (-1, 0, 1):
                    place(cross, x, y, side * (half_w + AISLE / 2 + k * AISLE / 4))
    # Pilasters against the outer walls, opposite to the columns, each of base, shaft and capital.
    base, capital = mesh(shapes.box((0.62, 0.3, 0.22)), "pilaster base", "marble"), mesh(shapes.box((0.66, 0.24, 0.26)), "pilaster capital", "marble")
    shaft = mesh(shapes.merge(*[shapes.box((0.09, STOREY - slab - 0.54, 0.12), (0.11 * k, 0, 0.02 * (k % 2))) for k in range(-2, 3)]), "pilaster", "plaster")
    for level in (0.0, STOREY):
        for i in range(int(2 * half_l / BAY) + 1):
            for side in (-1, 1):
                x, z, turn = -half_l + i * BAY, side * (outer_w - 0.07), 0.0 if side < 0 else np.pi
                place(base, x, level + 0.15, z, turn)
                place(shaft, x, level + 0.3 + (STOREY - slab - 0.54) / 2, z, turn)
                place(capital, x, level + STOREY - slab - 0.12, z, turn)
    # Roof of pan and cover tiles, falling towards the court, with a ridge along the outer wall.
    slope, tile_length = 0.30, 0.62
    rows = int(np.ceil((AISLE + 0.9) / np.cos(slope) / tile_length))
    covers = [mesh(roof_tile(tile_length + 0.08, 0.11, True), f"cover tile {key}", key) for key in ("tile", "dark tile")]
    pan = mesh(roof_tile(tile_length * rows, 0.13, False), "pan tiles", "dark tile")
    generator = np.random.default_rng(11)
    def slope_at(x, z, turn):
        return shapes.translation(x, 2 * STOREY + 1.55, z) @ shapes.rotation_y(turn) @ shapes.rotation_x(slope)
    fields = [((-outer_l + 0.2 + i * 0.31, -outer_w), 0.0) for i in range(int(2 * outer_l / 0.31))]
    fields += [((outer_l - 0.2 - i * 0.31, outer_w), np.pi) for i in range(int(2 * outer_l / 0.31))]
    for (x, z), turn in fields:
        place.at(pan, slope_at(x, z, turn) @ shapes.translation(0.155, 0.07, 0))
        for row in range(rows):
            kind = covers[int(generator.random() < 0.3)]
            place.at(kind, slope_at(x, z, turn) @ shapes.translation(0, 0.12 + 0.012 * (row % 2), row * tile_length))
    ridge = mesh(roof_tile(0.55, 0.16, True), "ridge tile", "tile")
    for side in (-1, 1):
        for i in range(int(2 * outer_l / 0.5)):
            place.at(ridge, shapes.translation(-outer_l + 0.2 + i * 0.5, 2 * STOREY + 1.62, side * outer_w) @ shapes.rotation_y(np.pi / 2))
    rafter = mesh(shapes.box((0.12, 0.14, (AISLE + 0.8) / np.cos(slope)), (0, 0, (AISLE + 0.8) / np.cos(slope) / 2)), "rafter", "wood")
    parapet = mesh(shapes.box((BAY, 1.5, 0.3)), "attic", "plaster")
    for side in (-1, 1):
        turn, z = (0.0, -outer_w) if side < 0 else (np.pi, outer_w)
        for i in range(int(2 * outer_l / 0.7)):
            place.at(rafter, slope_at(-outer_l + 0.35 + i * 0.7, z, turn) @ shapes.translation(0, -0.1, 0))
        for i in range(int(2 * outer_l / BAY) + 1):
            place(parapet, -outer_l + min((i + 0.5) * BAY, 2 * outer_l - BAY / 2), 2 * STOREY + 0.75, side * (outer_w + 0.05))


class Placer:
    """scene.instance by place and turn, or by matrix."""

    def __init__(self, scene):
        self.scene = scene

    def __call__(self, index, x, y, z, turn=0.0, name=None):
        return self.at(index, shapes.translation(x, y, z) @ shapes.rotation_y(turn), name)

    def at(self, index, transform, name=None):
        return self.scene.instance(index, transform, name)


def build(scene) -> None:
    material = materials(scene)
    place = Placer(scene)

    def mesh(shape, name, key):
        return scene.mesh(material=material[key], name=name, **shape)

    half_l, half_w = LENGTH / 2, WIDTH / 2
    outer_l, outer_w = half_l + AISLE, half_w + AISLE

    # Ground and gallery floors.
    place(mesh(shapes.quad((-outer_l, 0, outer_w), (2 * outer_l, 0, 0), (0, 0, -2 * outer_w)), "court", "floor"), 0, 0, 0)
    slab = 0.4
    for level in (STOREY, 2 * STOREY):
        for side in (-1, 1):
            place(mesh(shapes.box((2 * outer_l, slab, AISLE)), "gallery", "plaster"), 0, level - slab / 2, side * (half_w + AISLE / 2))
            place(mesh(shapes.box((AISLE, slab, WIDTH)), "gallery end", "plaster"), side * (half_l + AISLE / 2), level - slab / 2, 0)

    # Outer walls, 0.4 m thick.
    height = 2 * STOREY
    for side in (-1, 1):
        place(mesh(shapes.box((2 * outer_l + 0.8, height, 0.4)), "long wall", "wall"), 0, height / 2, side * (outer_w + 0.2))
        place(mesh(shapes.box((0.4, height, 2 * outer_w)), "end wall", "wall"), side * (outer_l + 0.2), height / 2, 0)

    # Columns, arches and parapets around the court, on both storeys.
    column, arch = mesh(column_shape(), "column", "marble"), None
    span = BAY - 0.5
    arch = mesh(shapes.arch(span, 1.0, 0.5, 0.25), "arch", "plaster")
    baluster = mesh(shapes.lathe([(0.05, 0), (0.07, 0.08), (0.035, 0.2), (0.075, 0.45), (0.035, 0.75), (0.06, 0.85)], 10), "baluster", "marble")
    rail = mesh(shapes.box((BAY, 0.1, 0.16)), "rail", "marble")
    lintel = mesh(shapes.box((BAY, STOREY - slab - COLUMN - 1.25, 0.5)), "lintel", "plaster")
    lamp = mesh(shapes.sphere(0.12, 16), "lamp", "lamp")
    beam = mesh(shapes.box((0.16, 0.2, AISLE)), "beam", "wood")
    stones = [mesh(stone, f"voussoir {k}", "marble" if k != 5 else "plaster")
              for k, stone in enumerate(voussoirs(span, 1.0, 11, 0.56))]
    bays = [(("x"), i) for i in range(int(LENGTH // BAY))]
    cloths = [mesh(shapes.cloth(1.9, 2.6, 5, 0.08), f"{key} cloth", key) for key in ("red", "green", "blue")]
    lintel_y = COLUMN + 1.25 + (STOREY - slab - COLUMN - 1.25) / 2

    def run_bay(x, z, turn, level, index, hangs):
        """One bay whose middle is at (x, z) and which faces along `turn`."""
        place(arch, x, level + COLUMN, z, turn)
        for stone in stones:
            place(stone, x, level + COLUMN, z, turn)
        place(lintel, x, level + lintel_y, z, turn)
        if level > 0:
            along = np.array([np.cos(turn), -np.sin(turn)])
            for k in range(9):
                offset = (k - 4) * (BAY - 0.7) / 9.0
                place(baluster, x + along[0] * offset, level, z + along[1] * offset)
            place(rail, x, level + 0.9, z, turn)
            if hangs:
                inward = np.array([np.sin(turn), np.cos(turn)])
                place(cloths[index % 3], x + inward[0] * 0.56, level + 0.85, z + inward[1] * 0.56, turn)

    for level in (0.0, STOREY):
        for i in range(int(LENGTH / BAY) + 1):
            for side in (-1, 1):
                place(column, -half_l + i * BAY, level, side * half_w)
        for i in range(1, 3):
            for side in (-1, 1):
                place(column, side * half_l, level, -half_w + i * WIDTH / 3)
        for _, i in bays:
            for side in (-1, 1):
                run_bay(-half_l + (i + 0.5) * BAY, side * half_w, 0.0 if side < 0 else np.pi, level, i + (side > 0), i % 2 == 0)
        for i in range(3):
            for side in (-1, 1):
                run_bay(side * half_l, -half_w + (i + 0.5) * WIDTH / 3, np.pi / 2 if side < 0 else -np.pi / 2, level, i, i == 1)
        # Beams under the galleries, and lamps between them.
        for i in range(int(2 * outer_l / 1.1)):
            for side in (-1, 1):
                place(beam, -outer_l + 0.55 + i * 1.1, level + STOREY - slab - 0.1, side * (half_w + AISLE / 2))
    for _, i in bays:
        if i % 2 == 0:
            for side in (-1, 1):
                x, z = -half_l + (i + 0.5) * BAY, side * (half_w + AISLE / 2)
                place(lamp, x, STOREY - slab - 0.8, z)
                scene.light("point", (150.0, 105.0, 55.0), (x, STOREY - slab - 0.8, z), range=12.0, casts_shadow=False,
                            name=f"lamp {i} {'north' if side < 0 else 'south'}")

    trim(place, mesh, material, half_l, half_w)

    # Lanterns hang on links, every second one turned.
    link = mesh(shapes.torus(0.03, 0.008, 10, 6), "link", "bronze")
    for _, i in bays:
        if i % 2 == 0:
            for side in (-1, 1):
                x, z = -half_l + (i + 0.5) * BAY, side * (half_w + AISLE / 2)
                for k in range(14):
                    place.at(link, shapes.translation(x, STOREY - slab - 0.03 - 0.05 * k, z) @ shapes.rotation_y(np.pi / 2 * (k % 2)))

    # Urns between the planters, benches along the colonnade.
    urn = mesh(shapes.lathe([(0.14, 0), (0.16, 0.05), (0.08, 0.14), (0.22, 0.42), (0.27, 0.66), (0.14, 0.86), (0.12, 0.94), (0.17, 1.0)], 24), "urn", "plaster")
    seat, leg = mesh(shapes.box((1.7, 0.09, 0.45)), "bench", "marble"), mesh(shapes.box((0.16, 0.42, 0.38)), "bench leg", "marble")
    for i in range(int(LENGTH / BAY)):
        for side in (-1, 1):
            x = -half_l + (i + 0.5) * BAY
            place(urn, x + BAY / 2, 0, side * (half_w - 0.85))
            place(seat, x, 0.465, side * (outer_w - 0.55))
            for end in (-1, 1):
                place(leg, x + 0.65 * end, 0.21, side * (outer_w - 0.55))

    # Fountain: steps, bowl, water, and a bronze ball lit by a spot.
    place(mesh(shapes.merge(shapes.lathe([(2.3, 0), (2.3, 0.15), (1.9, 0.15), (1.9, 0.3), (1.6, 0.3), (1.6, 0.75), (1.45, 0.75), (1.45, 0.45)], 48)), "fountain", "marble"), 0, 0, 0)
    place(mesh(shapes.lathe([(1.46, 0.62), (0.0001, 0.62)], 48), "water", "water"), 0, 0, 0)
    place(mesh(shapes.lathe([(0.35, 0.4), (0.2, 0.7), (0.14, 1.2), (0.3, 1.35), (0.75, 1.5), (0.75, 1.56)], 32), "bowl", "marble"), 0, 0, 0)
    place(mesh(shapes.sphere(0.45, 48), "ball", "bronze"), 0, 1.98, 0)
    scene.light("spot", (900.0, 820.0, 700.0), (0, 8.5, 3.5), (0, -6.5, -3.5), range=20.0, inner_angle=0.12,
                outer_angle=0.30, name="fountain spot")

    # Ivy on the end walls and planters in the court.
    ivy = mesh(shapes.quad((-1.5, 0, 0), (3, 0, 0), (0, 4, 0)), "ivy", "ivy")
    for z in (-3.5, 0.5, 4.0):
        place(ivy, -outer_l + 0.03, 0.2, z, np.pi / 2)
        place(ivy, outer_l - 0.03, 0.5, z, -np.pi / 2)
    planter = mesh(shapes.merge(shapes.box((0.9, 0.6, 0.9), (0, 0.3, 0))), "planter", "plaster")
    leaf = mesh(shapes.merge(*[shapes.quad((-0.45, 0, 0), (0.9, 0, 0), (0, 1.0, 0))]), "shrub", "ivy")
    for x in (-9.0, -4.5, 4.5, 9.0):
        for side in (-1, 1):
            place(planter, x, 0, side * 3.6)
            for k in range(4):
                place(leaf, x, 0.55, side * 3.6, k * np.pi / 4)

    scene.camera((-12.2, 1.75, 2.4), (2.5, 3.1, -1.6), vertical_angle=1.05, name="court")
    scene.camera((9.5, 6.8, -7.2), (-4.0, 1.2, 2.5), vertical_angle=0.95, name="gallery", use=False)
    scene.camera((2.9, 1.9, 3.2), (0, 1.4, 0), vertical_angle=0.8, name="fountain", use=False)
    scene.use_camera(0)
