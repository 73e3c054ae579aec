# SPDX-License-Identifier: Apache-2.0
"""The scenes that come with Heddle: what is in them, the same bytes each time, and update(scene, time)."""

import importlib.util
import pathlib

import numpy as np
import pytest

import heddle
from heddle.__main__ import load_scene

SCENES = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "scenes"

# name: (instances at least, lights, materials, lower and upper corner of the bounds in metres)
EXPECTED = {
    "atrium": (4000, 9, 14, (-17.7, -0.1, -9.7), (17.7, 12, 9.7)),
    "cornell_box": (8, 1, 4, (-1, 0, -1), (1, 2, 1)),
    "material_grid": (89, 1, 89, (-8, 0, -4), (8, 7.3, 6)),
    "street": (1500, 512, 16, (-81, -0.1, -13.1), (81, 16, 13.1)),
    "wires_and_grass": (5000, 0, 6, (-200, -0.5, -281), (200, 10, 200)),
    "subdivision": (6, 1, 4, (-8, -0.2, -6), (8, 2.5, 6)),
    "highway": (202, 0, 65, (-2048, -54.2, -2048), (2048, 114.2, 2048)),
    "picture": (15, 0, 2, (-60, -0.1, -88), (60, 25.1, 2.1)),
    "large_world": (80, 0, 5, (75_000, 500, -125_000), (125_000, 1400, -75_000)),
}


def module_of(name):
    spec = importlib.util.spec_from_file_location(name, SCENES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_scene_of_the_folder_is_expected():
    assert {file.stem for file in SCENES.glob("*.py")} == set(EXPECTED)


@pytest.mark.parametrize("name", EXPECTED)
def test_scenes_have_their_parts_and_bounds_and_the_same_bytes_each_time(host, name):
    instances, lights, materials, low, high = EXPECTED[name]
    found = []
    for _ in range(2):
        with host.scene() as scene:
            load_scene(scene, str(SCENES / f"{name}.py"))
            triangles = scene.triangles()
            found.append((scene.describe(), {key: value.tobytes() for key, value in triangles.items()}))
            assert np.isfinite(triangles["positions"]).all()
            p = triangles["positions"][triangles["indices"]]
            area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
            assert (area > 0).mean() > 0.999, "triangles have area"
    assert found[0] == found[1]
    description = found[0][0]
    counts = description["counts"]
    assert counts["instances"] >= instances
    assert (counts["lights"], counts["materials"]) == (lights, materials)
    assert (np.array(description["bounds"][0]) >= low).all() and (np.array(description["bounds"][1]) <= high).all()
    assert description["cameras"] and description["warnings"] == []


@pytest.mark.parametrize("name", ["cornell_box", "material_grid", "large_world", "wires_and_grass"])
def test_scenes_render_to_finite_pictures_that_show_something(host, name):
    # The box has a lamp of 60 cd/m^2 and no sky; the others stand in the sun.
    light = ["sky.technique=none", "params.exposure=0"] if name == "cornell_box" else []
    with host.graph("deferred", ["extent=[96,54]", *light]) as graph:
        with host.scene() as scene:
            load_scene(scene, str(SCENES / f"{name}.py"))(scene, 0.5)
            graph.keep("gbuffer.depth")
            graph.render(scene, time=0.5)
            picture, depth = graph.read(), graph.read("gbuffer.depth")
    assert np.isfinite(picture).all()
    assert picture[..., :3].std() > 0.02
    assert np.isfinite(depth).mean() > 0.3, "surfaces cover the view"


def test_a_hundred_kilometres_away_is_like_here(host):
    """Depth and normals of the large world against the same world at the origin."""
    module, ports = module_of("large_world"), ("gbuffer.depth", "gbuffer.normal_geometric")
    views = []
    for offset in ((0, 0, 0), module.OFFSET):
        with host.graph("deferred", ["extent=[96,54]", "gbuffer.params.precision=float32"]) as graph, host.scene() as scene:
            for port in ports:
                graph.keep(port)
            module.build(scene, offset)
            graph.render(scene)
            views.append([graph.read(port) for port in ports])
    (depth, normal), (far_depth, far_normal) = views
    both = np.isfinite(depth[..., 0]) & np.isfinite(far_depth[..., 0])
    # The horizon's pixels may fall to either side: a hundredth of the picture at most.
    assert (np.isfinite(depth) != np.isfinite(far_depth)).mean() < 0.01
    relative = np.abs(far_depth[..., 0] / np.where(both, depth[..., 0], 1) - 1)[both]
    # float64 holds 1e5 m to 1.5e-11 m: what is left is float32's rounding of relative positions, 2^-24 a few times over,
    # times the slope of what is seen at a grazing angle; edges may move by a pixel, in a hundredth of them.
    assert np.quantile(relative, 0.99) < 1e-5
    assert np.quantile(np.abs(far_normal - normal)[both], 0.99) < 1e-5


def test_update_moves_the_cars_and_their_lights_with_them(host):
    module = module_of("street")
    with host.scene() as scene:
        module.build(scene)
        before = scene.triangles()["positions"]
        module.update(scene, 1.5)
        moved = np.linalg.norm(scene.triangles()["positions"] - before, axis=1)
        # Positions are rounded to float32 about the middle of 160 m: 4e-6 m.
        assert np.isclose(moved[moved > 1e-3], module.SPEED * 1.5, atol=1e-4).all() and (moved > 1e-3).any()
        module.update(scene, 0.0)
        assert (scene.triangles()["positions"] == before).all(), "a time is a place, whatever was before"


def test_the_lamp_of_the_cornell_box_lights_the_floor_as_its_form_factor_says(host):
    """The closed form against an integral over the lamp in float64."""
    module = module_of("cornell_box")
    n = 400
    x = (np.arange(n) + 0.5) / n * module.LAMP - module.LAMP / 2
    for height in (0.0, 1.0, 1.9):
        d = module.SIDE - module.GAP - height
        r2 = x[:, None] ** 2 + x[None, :] ** 2 + d * d
        integral = module.RADIANCE * (d * d / r2**2).sum() * (module.LAMP / n) ** 2
        # The midpoint rule is off by (LAMP / n / d)^2, at most 2e-4 here.
        assert module.lamp_irradiance(height) == pytest.approx(integral, rel=3e-4)


def test_lights_change_in_place(host):
    with host.scene() as scene:
        light = scene.light("point", (1, 1, 1), name="lamp")
        scene.set_light(light, "spot", (2, 2, 2), (1, 2, 3))
        assert scene.describe()["lights"] == ["lamp"]
        with pytest.raises(heddle.Error) as raised:
            scene.set_light(7, "spot", (2, 2, 2))
        assert "there is no light 7: the scene has 1" in str(raised.value)


@pytest.mark.parametrize(("field", "value", "expected"), [
    ("roughness", 7, "error: material 'paint': roughness is 7: expected 0 to 1"),
    ("metalness", -1, "error: material 'paint': metalness is -1: expected 0 to 1"),
    ("ior", 0, "error: material 'paint': ior is 0: expected a finite number of at least 1"),
    ("emissive", (0, float("nan"), 0), "error: material 'paint': emissive is nan: expected a finite number of at least 0"),
    ("base_color", (1, 1.5, 1, 1), "error: material 'paint': base_color is 1.5: expected 0 to 1"),
])
def test_materials_out_of_range_are_errors(host, field, value, expected):
    with host.scene() as scene, pytest.raises(heddle.Error) as raised:
        scene.material("paint", **{field: value})
    assert str(raised.value) == expected


def test_overlays_change_what_is_there_and_say_where_they_are_wrong(host, tmp_path, command):
    overlay = tmp_path / "night.scene.toml"
    overlay.write_text('[[material]]\nname = "white"\nroughness = 0.5\n[[camera]]\nname = "corner"\n'
                       'position = [0.9, 1.8, 0.9]\ntarget = [0, 0.5, 0]\n')
    with host.scene() as scene:
        load_scene(scene, str(SCENES / "cornell_box.py"))
        scene.load(overlay)
        assert scene.describe()["cameras"] == ["front", "corner"]
        overlay.write_text('[[material]]\nname = "whiet"\n')
        with pytest.raises(heddle.Error) as raised:
            scene.load(overlay)
        assert str(raised.value) == (f"{overlay}:2:8: error: material 'whiet': the scene has no such material\n"
                                     "  expected: one of white, red, green, lamp\n  help:     did you mean 'white'?")
