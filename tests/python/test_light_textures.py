# SPDX-License-Identifier: Apache-2.0
"""Images on rectangle lights against float64 quadrature of the textured area integral, and their hard cases."""

import itertools

import numpy as np
import pytest

import heddle

SIZE = 64
GRAPH = """extent = [{size}, {size}]
output = "lighting.radiance"
[[pass]]
name = "material"
role = "surface_material"
technique = "ggx"
[[pass]]
name = "gbuffer"
role = "gbuffer"
technique = "raster"
params.precision = "float32"
[[pass]]
name = "lighting"
role = "lighting"
technique = "{technique}"
params.precision = "float32"
"""
HEIGHT, TILT = 3.0, 0.5  # of the camera: metres over the floor, radians from straight down


@pytest.fixture(scope="module")
def module_host():
    with heddle.Host() as made:
        yield made


@pytest.fixture(params=["deferred", "forward"])
def technique(request):
    return request.param


@pytest.fixture(scope="module")
def render(module_host, tmp_path_factory):
    """render(light, texture, ...) -> float64 radiance of a floor of 2 m under a rectangle light."""
    graphs = {}
    tmp_path = tmp_path_factory.mktemp("graphs")

    def body(texture, light=None, technique="deferred", material=None, before=None, size=SIZE):
        if (technique, size) not in graphs:
            file = tmp_path / f"{technique}{size}.toml"
            file.write_text(GRAPH.format(technique=technique, size=size))
            graphs[technique, size] = module_host.graph(file)
        with module_host.scene() as scene:
            surface = scene.material(**(material or {"base_color": (0.8, 0.8, 0.8, 1), "roughness": 1.0}))
            floor = scene.mesh([[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]], surface, indices=[0, 1, 2, 0, 2, 3],
                               normals=[[0, 1, 0]] * 4)
            scene.instance(floor)
            arguments = {"position": (0, 1, 0), "direction": (0, -1, 0), "tangent": (1, 0, 0), "half_extent": (1, 1, 0),
                         "intensity": (1, 1, 1), "casts_shadow": False} | (light or {})
            lamp = scene.light("rectangle", texture=texture, **arguments)
            scene.camera((0, HEIGHT, HEIGHT * np.tan(TILT)), (0, 0, 0), vertical_angle=0.7)
            if before is not None:
                before(scene, lamp, arguments)
            graph = graphs[technique, size]
            graph.render(scene, cut=True)
            return graph.read().astype(np.float64)[..., :3]

    yield body
    for graph in graphs.values():
        graph.close()


def floor_points(size=SIZE):
    """Where the pixels' rays meet the floor, and the directions from there to the camera."""
    eye = np.array([0, HEIGHT, HEIGHT * np.tan(TILT)])
    forward = -eye / np.linalg.norm(eye)
    right = np.array([1.0, 0, 0])
    up = np.cross(right, forward)
    half = np.tan(0.35)
    x, y = np.meshgrid((np.arange(size) + 0.5) / size * 2 - 1, 1 - (np.arange(size) + 0.5) / size * 2)
    rays = forward + half * (x[..., None] * right + y[..., None] * up)
    points = eye + rays * (-eye[1] / rays[..., 1])[..., None]
    return points, -rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def blocks(width=32, height=16, seed=3):
    """Coarse noise of three colours, 4 x 2 texels a block."""
    random = np.random.default_rng(seed)
    return np.kron(random.random((height // 2, width // 4, 3)), np.ones((2, 4, 1))).astype(np.float32)


def truth(texture, points, views, height, half_extent, alpha=None, taps=4):
    """Share of the constant light's reflection that the textured light's has: diffuse, or specular of a metal.

    The integrand of single-bounce GGX (Walter et al. 2007) or of Lambert, at taps x taps points of each texel."""
    rows, columns = texture.shape[:2]
    u = (np.arange(columns * taps) + 0.5) / (columns * taps)
    v = (np.arange(rows * taps) + 0.5) / (rows * taps)
    across, along = np.meshgrid((2 * u - 1) * half_extent[0], (1 - 2 * v) * half_extent[1])  # tangent +X, top +Z
    texels = np.kron(texture, np.ones((taps, taps, 1)))
    shares = np.zeros(points.shape)
    for index in np.ndindex(points.shape[:2]):
        offset = np.stack([across - points[index][0], np.full_like(across, height), along - points[index][2]], -1)
        squared = (offset**2).sum(-1)
        to_light = offset / np.sqrt(squared)[..., None]
        weight = to_light[..., 1] ** 2 / squared  # both cosines are the same: floor and light are parallel
        if alpha is not None:
            half = to_light + views[index]
            half /= np.linalg.norm(half, axis=-1, keepdims=True)
            a2, n_dot_v = alpha * alpha, views[index][1]
            distribution = a2 / (np.pi * (half[..., 1] ** 2 * (a2 - 1) + 1) ** 2)
            n_dot_l = to_light[..., 1]
            visibility = 0.5 / (n_dot_l * np.sqrt(n_dot_v**2 * (1 - a2) + a2) + n_dot_v * np.sqrt(n_dot_l**2 * (1 - a2) + a2))
            weight = weight * distribution * visibility
        shares[index] = (texels * weight[..., None]).sum((0, 1)) / weight.sum()
    return shares


DIFFUSE = {"base_color": (0.8, 0.8, 0.8, 1), "roughness": 1.0, "ior": 1.0}


def metal(roughness):
    return {"base_color": (1, 1, 1, 1), "roughness": roughness, "metalness": 1.0}


def test_a_constant_texture_of_one_changes_no_bit(render, technique):
    for material in (DIFFUSE, metal(0.3), {"base_color": (0.5, 0.6, 0.7, 1), "roughness": 0.5}):
        plain = render(None, technique=technique, material=material)
        for shape in ((1, 1), (5, 3), (16, 64)):
            np.testing.assert_array_equal(render(np.ones(shape, np.float32), technique=technique, material=material), plain)


def test_a_constant_texture_scales_the_light(render, technique):
    material = {"base_color": (0.5, 0.6, 0.7, 1), "roughness": 0.4}
    colour = (3.0, 0.25, 7.0)
    np.testing.assert_allclose(render(np.full((7, 5, 3), colour, np.float32), technique=technique, material=material),
                               render(None, {"intensity": colour}, technique, material), rtol=1e-6)


@pytest.mark.parametrize("height, worst, mean", [(0.1, 0.15, 0.035), (0.5, 0.06, 0.02), (2.0, 0.015, 0.006), (20.0, 5e-4, 3e-4)])
def test_diffuse_light_is_the_area_integral(render, height, worst, mean):
    texture = blocks()
    light = {"position": (0, height, 0), "half_extent": (1, 0.5, 0)}
    shares = render(texture, light, material=DIFFUSE) / render(None, light, material=DIFFUSE)
    points, views = floor_points()
    step = 4
    error = np.abs(
        shares[::step, ::step] - truth(texture, points[::step, ::step], views[::step, ::step], height, (1, 0.5)))
    print(f"diffuse, {height} m over the floor: worst {error.max():.4f}, rms {np.sqrt((error**2).mean()):.4f}")
    assert error.max() < worst and np.sqrt((error**2).mean()) < mean


@pytest.mark.parametrize("roughness, height, worst, mean", [
    (roughness, height, worst, mean) for (roughness, worst, mean), height in itertools.product(
        [(0.1, 0.3, 0.04), (0.3, 0.18, 0.05), (0.6, 0.1, 0.035)], [0.5, 2.0])])
def test_specular_light_is_the_area_integral(render, roughness, height, worst, mean):
    texture = blocks()
    light = {"position": (0, height, 0), "half_extent": (1, 0.5, 0)}
    plain = render(None, light, material=metal(roughness))
    shares = render(texture, light, material=metal(roughness)) / np.maximum(plain, 1e-30)
    points, views = floor_points()
    step = 4
    expected = truth(texture, points[::step, ::step], views[::step, ::step], height, (1, 0.5), roughness**2, taps=8)
    seen = plain[::step, ::step].max(-1) > 0.01 * plain.max()  # where the light is reflected at all
    error = np.abs(shares[::step, ::step] - expected)[seen]
    print(f"roughness {roughness}, {height} m: worst {error.max():.4f}, rms {np.sqrt((error**2).mean()):.4f}, {seen.sum()} points")
    assert seen.sum() > 10
    assert error.max() < worst and np.sqrt((error**2).mean()) < mean


def test_the_image_lies_on_the_light_as_it_is_seen_from_below(render, technique):
    # Just under the light the floor shows the texel above it: tangent +X is the image's right, +Z its top.
    texture = np.zeros((2, 2, 3), np.float32)
    texture[0, 0], texture[0, 1], texture[1, 0], texture[1, 1] = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)
    image = render(texture, {"position": (0, 0.02, 0), "half_extent": (0.8, 0.8, 0)}, technique, DIFFUSE)
    points, _ = floor_points()

    def at(x, z):
        return image[np.unravel_index(np.argmin((points[..., 0] - x) ** 2 + (points[..., 2] - z) ** 2), points.shape[:2])]

    for x, z, texel in ((-0.6, 0.6, (1, 0, 0)), (0.6, 0.6, (0, 1, 0)), (-0.6, -0.6, (0, 0, 1)), (0.6, -0.6, (1, 1, 1))):
        np.testing.assert_allclose(at(x, z), 0.8 * np.array(texel), atol=0.05)


def test_a_mirror_shows_the_image(render):
    texture = np.zeros((4, 4, 3), np.float32)
    texture[:, 2:, 0] = 5.0
    image = render(texture, {"position": (0, 1, 0)}, material=metal(0.0))
    points, views = floor_points()
    # Where the mirrored ray meets the light's plane.
    met = points - views * np.array([1, -1, 1]) / views[..., 1:2]
    on_face = (np.abs(met[..., 0]) < 0.95) & (np.abs(met[..., 2]) < 0.95) & (np.abs(met[..., 0]) > 0.3)
    assert on_face.sum() > 50
    expected = np.where(met[..., 0] > 0, 5.0, 0.0)
    np.testing.assert_allclose(image[..., 0][on_face], expected[on_face], rtol=0.06, atol=1e-6)
    assert image[..., 1:].max() == 0


def test_what_reaches_nothing_stays_dark(render, technique):
    texture = blocks()
    for light in ({"direction": (0, 1, 0)},                          # the floor is behind it
                  {"position": (0, -1, 0), "direction": (0, 1, 0)},  # below the horizon
                  {"position": (0, 0, 0), "direction": (0, 1, 0)}):  # the floor is its plane, and it shines upwards
        assert render(texture, light, technique, metal(0.5)).max() == 0
        assert render(texture, light, technique, DIFFUSE).max() == 0
    assert render(np.zeros((8, 8), np.float32), {}, technique, {"base_color": (1, 1, 1, 1), "roughness": 0.3}).max() == 0


def test_a_floor_that_is_the_light_s_plane_stays_between_dark_and_the_light(render, technique):
    # Whether a point is before the light is a matter of its position's rounding: each is one or the other.
    texture = blocks()
    for material in (metal(0.5), DIFFUSE):
        plain = render(None, {"position": (0, 0, 0)}, technique, material)
        image = render(texture, {"position": (0, 0, 0)}, technique, material)
        assert np.isfinite(image).all() and (image <= plain * texture.max() + 1e-6).all()


@pytest.mark.parametrize("half_extent, height", [((1e-4, 1e-4, 0), 1.0), ((500.0, 500.0, 0), 1.0), ((2.0, 0.001, 0), 0.5),
                                                 ((1.0, 1.0, 0), 1e-4)])
def test_sizes_from_tiny_to_huge_stay_in_the_texture_s_range(render, technique, half_extent, height):
    texture = 0.25 + 0.5 * blocks()
    light = {"position": (0.01, height, 0.02), "half_extent": half_extent}
    for material in (DIFFUSE, metal(0.2)):
        plain = render(None, light, technique, material)
        seen = plain > 1e-6 * plain.max()
        shares = render(texture, light, technique, material)[seen] / plain[seen]
        assert np.isfinite(shares).all()
        assert texture.min() - 1e-5 < shares.min() and shares.max() < texture.max() + 1e-5


def test_grazing_light_is_finite_and_between_the_texels(render):
    texture = 0.25 + 0.5 * blocks()
    light = {"position": (-1.5, 0.05, 0), "direction": (1, 0, 0), "tangent": (0, 0, 1), "half_extent": (1, 0.04, 0)}
    for material in (DIFFUSE, metal(0.1), metal(1.0)):
        plain = render(None, light, material=material)
        seen = plain > 1e-6 * plain.max()
        shares = render(texture, light, material=material)[seen] / plain[seen]
        assert seen.sum() > 1000
        assert texture.min() - 1e-5 < shares.min() and shares.max() < texture.max() + 1e-5


def test_one_texel_of_1e5_lights_as_its_share_of_the_area(render):
    texture = np.zeros((64, 64), np.float32)
    texture[20, 40] = 1e5
    light = {"position": (0, 30, 0)}  # from where the light is nearly a point
    shares = render(texture, light, material=DIFFUSE) / render(None, light, material=DIFFUSE)
    np.testing.assert_allclose(shares, 1e5 / 64**2, rtol=0.01)
    near = render(texture, {"position": (0, 0.3, 0)}, material=metal(0.1))
    assert np.isfinite(near).all() and near.max() > 1e3


@pytest.mark.parametrize("value, said", [(np.nan, "nan"), (np.inf, "inf"), (-1.0, "-1"), (1e20, "1e+20")])
def test_a_texel_that_is_no_radiance_is_refused_with_its_place(module_host, value, said):
    texture = np.ones((4, 6, 3), np.float32)
    texture[2, 5, 1] = value
    with module_host.scene() as scene:
        lamp = scene.light("rectangle", (1, 1, 1), half_extent=(1, 1, 0), name="screen")
        with pytest.raises(heddle.Error) as error:
            scene.set_light_texture(lamp, texture)
        assert str(error.value) == f"error: light 'screen': its texture's texel 5, 2 is {said}: expected 0 to 1e+18"
        bulb = scene.light("point", (1, 1, 1), name="bulb")
        with pytest.raises(heddle.Error) as error:
            scene.set_light_texture(bulb, texture[:2])
        assert "light 'bulb' has no face to show a texture on" in str(error.value)


def test_blended_surfaces_are_lit_by_it_too(module_host, tmp_path):
    graph_file = tmp_path / "graph.toml"
    graph_file.write_text(GRAPH.format(technique="forward", size=32).replace("lighting.radiance", "transparency.radiance") +
                          '[[pass]]\nname = "transparency"\nrole = "transparency"\ntechnique = "sorted"\n')
    pictures = []
    for alpha_mode, settings in (("opaque", ["output=lighting.radiance"]), ("blend", [])):
        with module_host.scene() as scene, module_host.graph(graph_file, settings) as graph:
            surface = scene.material(base_color=(0.8, 0.7, 0.6, 1), roughness=0.4, alpha_mode=alpha_mode)
            scene.instance(scene.mesh([[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]], surface, indices=[0, 1, 2, 0, 2, 3],
                                      normals=[[0, 1, 0]] * 4))
            scene.light("rectangle", (3, 3, 3), position=(0, 1, 0), half_extent=(1, 1, 0), texture=blocks(), casts_shadow=False)
            scene.camera((0, 3, 1.5), (0, 0, 0))
            graph.render(scene)
            pictures.append(graph.read())
    assert pictures[0].max() > 0.5 and pictures[0][..., :3].std() > 0.05
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-5)


def test_it_stays_when_the_light_changes_and_goes_with_none(render):
    texture = blocks()
    red = {"intensity": (2, 0, 0)}
    expected = render(texture, red)
    np.testing.assert_array_equal(render(texture, before=lambda scene, lamp, light: scene.set_light(
        lamp, "rectangle", **(light | red))), expected)
    np.testing.assert_array_equal(render(texture, before=lambda scene, lamp, light: scene.set_light_texture(lamp, None)),
                                  render(None))


def test_two_lights_have_their_own(render):
    both = render(blocks(), before=lambda scene, lamp, light: scene.light(
        "rectangle", texture=blocks(8, 8, 5), **(light | {"position": (0.5, 0.7, 0)})))
    alone = render(blocks()) + render(blocks(8, 8, 5), {"position": (0.5, 0.7, 0)})
    np.testing.assert_allclose(both, alone, rtol=1e-5, atol=1e-7)


def test_an_overlay_names_the_file(module_host, tmp_path):
    texture = blocks()
    module_host.write_image(tmp_path / "film.exr", texture)
    overlay = tmp_path / "lit.scene.toml"
    text = ('[[light]]\nname = "screen"\ntype = "rectangle"\nintensity = [2, 2, 2]\nposition = [0, 1, 0]\n'
            'half_extent = [1, 1, 0]\n')
    overlay.write_text(text + 'texture = "film.exr"\n')
    (tmp_path / "graph.toml").write_text(GRAPH.format(technique="deferred", size=32))

    def picture(change):
        with module_host.scene() as scene, module_host.graph(tmp_path / "graph.toml") as graph:
            floor = scene.mesh([[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]], scene.material(),
                               indices=[0, 1, 2, 0, 2, 3])
            scene.instance(floor)
            change(scene)
            scene.camera((0, 3, 1), (0, 0, 0))
            graph.render(scene)
            return graph.read(), scene.files()

    loaded, files = picture(lambda scene: scene.load(overlay))
    made, _ = picture(lambda scene: scene.light("rectangle", (2, 2, 2), position=(0, 1, 0), half_extent=(1, 1, 0),
                                                texture=texture, casts_shadow=True))
    np.testing.assert_array_equal(loaded, made)
    assert str(tmp_path / "film.exr") in files
    for value, what in (("gone.exr", "there is no such image"), ("../film.exr", "names a file outside of the overlay's folder")):
        overlay.write_text(text + f'texture = "{value}"\n')
        with pytest.raises(heddle.Error) as error:
            picture(lambda scene: scene.load(overlay))
        assert str(error.value).startswith(f"{overlay}:7:11: error: light") and what in str(error.value)
    overlay.write_text(text.replace("rectangle", "point") + 'texture = "film.exr"\n')
    with pytest.raises(heddle.Error, match="this light has no face to show a texture on"):
        picture(lambda scene: scene.load(overlay))

    # Its shape may be said elsewhere: by the scene that the overlay lies on.
    overlay.write_text('[[light]]\nname = "lamp"\ntexture = "film.exr"\n')

    def over(shape):
        def fill(scene):
            scene.light(shape, (1, 1, 1), half_extent=(1, 1, 0), name="lamp")
            scene.load(overlay)
        return fill

    with pytest.raises(heddle.Error) as error:
        picture(over("sphere"))
    assert str(error.value) == (f"{overlay}:3:11: error: light 'lamp': this light has no face to show a texture on\n"
                                "  found:    'lamp' is of the type sphere\n"
                                "  expected: type = \"rectangle\"")
    picture(over("rectangle"))


def test_scenes_without_one_pay_nothing(module_host, tmp_path):
    """What the device holds, is given and does is the same as where the port is not bound."""
    (tmp_path / "graph.toml").write_text(GRAPH.format(technique="deferred", size=32))

    def numbers(settings):
        with module_host.scene() as scene, module_host.graph(tmp_path / "graph.toml", settings) as graph:
            scene.instance(scene.mesh([[-1, 0, -1], [0, 0, 1], [1, 0, -1]], scene.material()))
            scene.light("rectangle", (2, 2, 2), position=(0, 1, 0), half_extent=(1, 1, 0))
            scene.camera((0, 3, 1), (0, 0, 0))
            graph.render(scene)
            counters = graph.stats()["counters"]
            return {name: counters[name] for name in ("device_memory_bytes", "uploaded_bytes", "commands", "pipelines_created")}

    unbound = numbers(["lighting.inputs.light_textures=none"])
    assert numbers([]) == unbound
