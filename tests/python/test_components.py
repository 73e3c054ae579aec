# SPDX-License-Identifier: Apache-2.0
"""Components: what a scene says of one light's shadows is what the techniques do, from Python, files and overlays."""

import json
import subprocess

import numpy as np
import pytest

import heddle
from heddle import shapes

# A floor, a lamp over it, and nothing else that shines. Contact shadows only where a test asks for them.
DARK = ["extent=[96,54]", "sky.technique=none", "ao.technique=none"]
NO_CONTACT = [*DARK, "contact.technique=none"]


def room(scene, lights=((0.0, 2.0, 0.0),), occluder=True):
    """A floor of 8 m seen from above, a plate half way to each lamp. Returns the lamps' ids."""
    paint = scene.material("paint", (0.5, 0.5, 0.5, 1), roughness=1)
    floor = scene.mesh(**shapes.quad((-4, 0, 4), (8, 0, 0), (0, 0, -8)), material=paint)
    scene.instance(floor)
    plate = scene.mesh(**shapes.box((0.5, 0.02, 0.5)), material=paint)
    lamps = []
    for i, (x, y, z) in enumerate(lights):
        if occluder:
            place = np.eye(4)
            place[:3, 3] = (x, 0.5 * y, z)
            scene.instance(plate, place)
        lamps.append(scene.light("point", (50, 50, 50), position=(x, y, z), name=f"lamp {i}"))
    scene.camera((0, 5, 4), (0, 0, 0), name="eye")
    return lamps


def radiance(host, settings, fill, component=None):
    """The frame's radiance for a scene that `fill` builds; component: (lamp's number, properties)."""
    with host.graph("deferred", settings) as graph, host.scene() as scene:
        graph.keep("lighting.radiance")
        lamps = fill(scene)
        for number, properties in component or ():
            scene.component("shadow.settings", properties, light=lamps[number])
        graph.render(scene)
        return graph.read("lighting.radiance")


def test_a_lamp_in_a_box_shines_through_it_when_its_near_distance_is_larger(host):
    def boxed(scene):
        lamps = room(scene, occluder=False)
        shade = scene.mesh(**shapes.box((0.3, 0.3, 0.3)), material=0)
        place = np.eye(4)
        place[:3, 3] = (0, 2, 0)
        scene.instance(shade, place)
        return lamps

    floor = (slice(30, 48), slice(30, 66))  # in front of the box, which is seen against the far floor
    bare = radiance(host, NO_CONTACT, lambda scene: room(scene, occluder=False))[floor]
    dark = radiance(host, NO_CONTACT, boxed)[floor]
    lit = radiance(host, NO_CONTACT, boxed, [(0, {"near_distance": 0.28})])[floor]
    assert bare[..., :3].min() > 0.1
    assert dark[..., :3].max() == 0
    # A box's corner is 0.26 m away; what is beyond 0.28 m is as if there were no box, to the bit.
    assert lit.tobytes() == bare.tobytes()


def test_priority_decides_which_of_two_lamps_gets_the_only_maps(host):
    lamps = [(-1.5, 2.0, 0.0), (1.5, 2.0, 0.0)]
    settings = [*NO_CONTACT, "shadow.params.views=6"]

    def fill(scene):
        return room(scene, lamps)

    both = radiance(host, [*NO_CONTACT, "shadow.params.views=12"], fill)
    first = radiance(host, settings, fill)
    also_first = radiance(host, settings, fill, [(0, {"priority": 1})])
    second = radiance(host, settings, fill, [(1, {"priority": 1})])
    assert first.tobytes() == also_first.tobytes()
    assert first.tobytes() != second.tobytes()
    # Under its own plate a lamp's share is gone only if it has maps: each picture is as dark as both maps' at one of the two.
    darker = [(picture[..., 0] > both[..., 0] * 1.05).sum() for picture in (first, second)]
    assert min(darker) > 20
    brighter_left = (first - both)[..., 0][:, :48].sum(), (second - both)[..., 0][:, :48].sum()
    assert brighter_left[1] > brighter_left[0]


def test_a_filter_radius_of_a_light_is_what_the_parameter_would_be_for_all(host):
    plain = radiance(host, NO_CONTACT, room)
    for radius in (0, 6):
        by_parameter = radiance(host, [*NO_CONTACT, f"shadow.params.filter_radius={radius}"], room)
        by_component = radiance(host, NO_CONTACT, room, [(0, {"filter_radius": radius})])
        assert by_component.tobytes() == by_parameter.tobytes()
        assert by_component.tobytes() != plain.tobytes()


def test_a_contact_distance_of_a_light_reaches_the_shader(host):
    settings = [*DARK, "shadow.technique=none", "contact.params.distance=1.5", "contact.params.thickness=0.5"]
    with_rays = radiance(host, settings, room)
    without = radiance(host, [*settings, "contact.technique=none"], room)
    assert with_rays.tobytes() != without.tobytes()
    assert radiance(host, settings, room, [(0, {"contact_distance": 0})]).tobytes() == without.tobytes()
    other = [setting for setting in settings if "distance" not in setting] + ["contact.params.distance=0.1"]
    assert radiance(host, other, room, [(0, {"contact_distance": 1.5})]).tobytes() == with_rays.tobytes()
    # A component that says something else leaves the parameter in force.
    assert radiance(host, settings, room, [(0, {"priority": 3})]).tobytes() == with_rays.tobytes()


def test_a_component_that_changes_between_frames_counts_from_the_next_one(host):
    with host.graph("deferred", NO_CONTACT) as graph, host.scene() as scene:
        graph.keep("lighting.radiance")
        lamp = room(scene)[0]
        frames = []
        for radius in (None, 6, 1.5):
            if radius is not None:
                scene.component("shadow.settings", {"filter_radius": radius}, light=lamp)
            graph.render(scene, cut=True)
            frames.append(graph.read("lighting.radiance"))
        assert frames[0].tobytes() != frames[1].tobytes()
        assert frames[0].tobytes() == frames[2].tobytes()  # 1.5 is the parameter's default


def test_a_scene_says_its_components_and_has_them_as_features(host):
    with host.scene() as scene:
        lamp = room(scene)[0]
        assert "shadow.settings" not in scene.describe()["features"]
        scene.component("shadow.settings", {"priority": 2, "near_distance": np.float32(0.5)}, light=lamp)
        description = scene.describe()
        assert "shadow.settings" in description["features"]
        assert description["components"] == [
            {"name": "shadow.settings", "on": "light", "id": 0, "properties": {"priority": 2, "near_distance": 0.5}}]


@pytest.mark.parametrize("call, text", [
    (lambda scene: scene.component("shadow.setings", {}, light=0),
     "error: light 0 'lamp 0': no role reads a component 'shadow.setings'\n  expected: one of mesh_detail.fine, shadow.settings, subdivision.surface, texture_source.virtual\n"
     "  help:     did you mean 'shadow.settings'?"),
    (lambda scene: scene.component("shadow.settings", {"prioriti": 1}, light=0),
     "error: light 0 'lamp 0': the component 'shadow.settings' has no property 'prioriti'\n"
     "  expected: one of priority, near_distance, filter_radius, contact_distance\n  help:     did you mean 'priority'?"),
    (lambda scene: scene.component("shadow.settings", {"priority": 1.5}, light=0),
     "error: light 0 'lamp 0': 'priority' has the wrong type\n  found:    1.5\n"
     "  expected: an integer, -1000 to 1000"),
    (lambda scene: scene.component("shadow.settings", {"near_distance": 0}, light=0),
     "error: light 0 'lamp 0': 'near_distance' is out of range\n  found:    0\n  expected: a number, m, 1e-06 to 1000"),
    (lambda scene: scene.component("shadow.settings", {}),
     "error: scene: the component 'shadow.settings' cannot sit here\n  found:    scene\n  expected: light"),
    (lambda scene: scene.component("shadow.settings", {}, light=3), "error: there is no light 3: the scene has 1"),
    (lambda scene: scene.component("shadow.settings", {}, light=0, instance=0),
     "error: the component 'shadow.settings' was given several owners\n"
     "  expected: one of instance, material, light, or none of them for the scene"),
])
def test_mistakes_say_what_was_meant(host, call, text):
    with host.scene() as scene:
        room(scene)
        with pytest.raises(heddle.Error) as raised:
            call(scene)
        assert (raised.value.status, str(raised.value)) == (2, text)
        assert scene.describe()["components"] == []


def test_the_command_lists_a_roles_components(command):
    run = subprocess.run([command, "list", "shadow"], capture_output=True, text=True, check=True)
    assert "  component shadow.settings, on light: How the shadows of one light are made" in run.stdout
    assert "contact_distance" in run.stdout
    listed = json.loads(subprocess.run([command, "list", "--json"], capture_output=True, text=True, check=True).stdout)
    role = next(each for each in listed["roles"] if each["name"] == "shadow")
    assert [each["name"] for each in role["components"]] == ["shadow.settings"]
    readers = {each["id"] for each in listed["techniques"] if "shadow.settings" in each["components"]}
    assert {"shadow/shadow_map", "shadow/ray_marched_screen"} <= readers


def test_an_overlay_changes_the_shadows_of_a_light(command, tmp_path):
    scene = tmp_path / "room.py"
    scene.write_text("import sys\nsys.path.insert(0, r'%s')\nfrom test_components import room\n\n\ndef build(scene):\n"
                     "    room(scene)\n" % __file__.rsplit("/", 1)[0])
    overlay = tmp_path / "soft.scene.toml"
    overlay.write_text('[[light]]\nname = "lamp 0"\ncomponents.shadow.settings.filter_radius = 6\n')
    pictures = []
    for more in ([], ["--overlay", str(overlay)]):
        out = tmp_path / f"{len(pictures)}.exr"
        sets = [word for setting in [*NO_CONTACT, "params.exposure=4"] for word in ("--set", setting)]
        subprocess.run([command, "run", str(scene), *sets, *more, "--output", str(out), "-q"], check=True)
        with heddle.Host() as host:
            pictures.append(host.read_image(out))
    assert pictures[0].tobytes() != pictures[1].tobytes()
