# SPDX-License-Identifier: Apache-2.0
"""Every technique that ships, in every graph and job that ships, under Vulkan's validation layer: no message at all.

Two frames of each graph, a technique swapped while it runs, two more. Small pictures and one host: what costs is making
pipelines."""

import os
import pathlib

import numpy as np
import pytest

import heddle
from heddle import shapes

GRAPHS = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "graphs"
pytestmark = pytest.mark.skipif(not os.environ.get("HEDDLE_TEST_ALL"), reason="minutes: scripts/test --all runs it")

# Of each graph: settings beyond the size, and (pass, technique) swapped in one after the other.
FRAMES = {
    "deferred": ([], [("ao", "ssao"), ("ao", "ray_traced"), ("shadow", "cascaded"), ("shadow", "ray_traced"),
                      ("contact", "none"), ("lighting", "forward"), ("subdivision", "limit"),
                      ("subdivision", "vertex_program"), ("display", "ocio"), ("sky", "none")]),
    "baked_ao": (["bake_occlusion.toml#bake.params.spacing=1"], [("ao", "gtao")]),
    "environment": ([], [("sky", "procedural")]),
    "furnace": ([], [("lighting", "forward")]),
    "path_traced": (["path_tracer.params.samples=2"], [("sky", "uniform")]),
    "reference_ao": (["ao.params.samples=4"], [("ao", "gtao")]),
    "studio": ([], [("sky", "procedural")]),
    "supersampled": (["aa.params.samples=2"], [("aa", "multiframe")]),
    "tiled": (["output=light_count.color", "light_assignment.params.fewest=0"], [("light_assignment", "brute_force")]),
    "virtual_texture": ([], [("source", "resident")]),
    "virtual_image": (["image_store.toml#store.params.extent=256"], [("source", "resident")]),
}
# Of each job: techniques, and parameters that make little of it.
JOBS = {
    "bake_occlusion": {"bake_visibility/depth_maps": ["spacing=1"], "bake_visibility/hemicube": ["spacing=1"],
                       "bake_visibility/ray_traced": ["spacing=1"]},
    "image_store": {"texture_store/tiled": ["extent=256"]},
}
SHOWN = """
extends = "tiled.toml"
output = "shown.image"
[[pass]]
name = "shown"
role = "function_image"
technique = "%s"
after = "lighting"
"""
FUNCTIONS = ("light_assignment", "shadow", "sky", "surface_material")


def build(scene, stored=False):
    """A yard of 4 m with something for every technique: masks, glass, a subdivided cage, a virtual texture, two meshes
    that show the same, lamps."""
    chequers = np.full((8, 8, 4), 255, np.uint8)
    chequers[::2, ::2] = chequers[1::2, 1::2] = (200, 40, 40, 0)
    texture = scene.texture(chequers)
    grey = scene.material("grey", (0.5, 0.5, 0.5))
    masked = scene.material("masked", base_color_texture=texture, alpha_mode="mask", double_sided=True)
    glass = scene.material("glass", (0.4, 0.6, 0.8, 0.5), alpha_mode="blend", roughness=0.1)
    clear = scene.material("clear", (0.9, 1, 0.9), transmission=0.8, roughness=0.0)
    virtual = scene.material("virtual")
    scene.component("texture_source.virtual", {"source": "stored", "image": 0} if stored else
                    {"source": "uvgrid", "extent": 1024}, material=virtual)

    def put(material, shape, *place):
        return scene.instance(scene.mesh(material=material, **shape), shapes.translation(*place))

    put(grey, shapes.quad((-2, 0, 2), (4, 0, 0), (0, 0, -4)), 0, 0, 0)
    put(virtual, shapes.quad((-2, 0, -1.5), (4, 0, 0), (0, 2, 0)), 0, 0, 0)
    put(masked, shapes.quad((-0.5, 0, 0), (1, 0, 0), (0, 1, 0)), -1, 0, 0)
    put(glass, shapes.quad((-0.5, 0, 0), (1, 0, 0), (0, 1, 0)), 1, 0, 0.3)
    put(clear, shapes.sphere(0.3, 8), 0.4, 0.3, 0.6)
    coarse, fine = (put(grey, shapes.sphere(0.2, segments), -0.6, 0.2, 1) for segments in (6, 16))
    scene.component("mesh_detail.fine", {"of": coarse}, instance=fine)
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.4
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    cage = scene.instance(scene.mesh(corners, grey, faces=faces), shapes.translation(0, 0.6, 0))
    scene.component("subdivision.surface", {"levels": 1}, instance=cage)
    scene.light("directional", (10000.0,) * 3, direction=(-0.4, -1, -0.3))
    scene.light("spot", (300.0,) * 3, position=(1, 2, 1), outer_angle=0.5)
    scene.light("rectangle", (300.0,) * 3, position=(0, 2, 0), half_extent=(0.3, 0.2, 0), texture=np.ones((4, 4, 3), np.float32))
    scene.set_environment(np.ones((4, 8, 3), np.float32))
    scene.camera((0, 1.2, 4), (0, 0.6, 0))


class Layer:
    """A host under the layer, what the layer said, and the techniques whose libraries graphs have opened."""

    def __init__(self):
        self.messages: list[str] = []
        self.opened: set[str] = set()
        self.host = heddle.Host(validation=True, remake=True, log=self.hear)

    def hear(self, _severity, text):
        # The layer's own: "Validation Error: [ VUID-... ]", "Validation Performance Warning: ...".
        if "Validation" in text:
            self.messages.append(text)

    def note(self, woven):
        self.opened |= {"/".join(pathlib.Path(library).parts[-3:-1]) for library in woven.stats()["libraries"]}
        assert self.messages == []

    def render(self, graph, scene):
        for frame in range(2):
            graph.render(scene, time=frame / 60, time_step=1 / 60, anew=True)
        graph.read()
        self.note(graph)


@pytest.fixture(scope="module")
def layer(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEDDLE_CACHE", str(tmp_path_factory.mktemp("cache")))  # the jobs really run
        made = Layer()
        with made.host:
            yield made
    assert made.messages == [], "when the host ended"


@pytest.mark.parametrize("name", FRAMES)
def test_frames_and_swaps_of_a_graph_are_silent(layer, name):
    settings, swaps = FRAMES[name]
    with layer.host.scene() as scene, layer.host.graph(name, ["extent=[64,48]", *settings]) as graph:
        build(scene, stored=name == "virtual_image")
        layer.render(graph, scene)
        for swapped, technique in swaps:
            graph.swap(swapped, technique)
            layer.render(graph, scene)
    assert layer.messages == []


@pytest.mark.parametrize("function", FUNCTIONS)
def test_functions_as_images_are_silent(layer, function):
    with layer.host.scene() as scene, \
            layer.host.parse(SHOWN % function, folder=GRAPHS, settings=["extent=[64,48]"]) as graph:
        build(scene)
        layer.render(graph, scene)


@pytest.mark.parametrize("name, role, technique", [(name, *each.split("/")) for name in JOBS for each in JOBS[name]])
def test_jobs_are_silent(layer, name, role, technique):
    with layer.host.scene() as scene, layer.host.job(name) as job:
        build(scene)
        made = next(each["name"] for each in job.describe()["passes"] if each["role"] == role)
        job.swap(made, technique)
        for setting in JOBS[name][f"{role}/{technique}"]:
            job.set(f"{made}.params.{setting}")
        result = job.run(scene)
        assert [each["origin"] for each in result["artifacts"]] == ["made"] and result["errors"] == 0
        layer.note(job)


def test_every_graph_and_every_technique_that_ships_was_there(layer):
    assert {*FRAMES, *JOBS} == {file.stem for file in GRAPHS.glob("*.toml")}
    assert {each["id"] for each in layer.host.list()["techniques"]} - layer.opened == set()
