# SPDX-License-Identifier: Apache-2.0
"""A view in which nothing of the scene is: what would work on surfaces does not run, and no pixel tells."""

import numpy as np
import pytest

import heddle

TECHNIQUES = {"ssao": ["reduce", "occlude", "blur", "resolve"], "gtao": ["horizon", "denoise"], "ray_traced": ["trace"]}
AT_SCENE, AWAY = (0.0, 1.0, 0.0), (0.0, 1.0, 12.0)  # the camera stands at z = 6


def fill(scene):
    """A corner of floor and wall with a ball's worth of creases, lit by the sun."""
    plaster = scene.material(base_color=(0.8, 0.7, 0.6), roughness=0.7)
    floor = scene.mesh([[-2, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]], plaster, indices=[0, 1, 2, 0, 2, 3])
    wall = scene.mesh([[-2, 0, -2], [2, 0, -2], [2, 3, -2], [-2, 3, -2]], plaster, indices=[0, 1, 2, 0, 2, 3])
    scene.instance(floor)
    scene.instance(wall)
    scene.light("directional", (3, 3, 3), direction=(0.4, -1, -0.3))
    return scene.camera((0, 1, 6), AT_SCENE, vertical_angle=0.8)


def dispatches(graph):
    return graph.stats()["counters"]["dispatches"]


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_occlusion_of_an_empty_view_takes_no_dispatch(technique):
    settings = ["extent=[64,40]", f"ao.technique={technique}", "ao.params.radius=1.5", "output=ao.visibility"]
    with heddle.Host(check=True) as host, host.scene() as scene, host.graph("deferred", settings) as graph:
        camera = fill(scene)
        graph.keep("gbuffer.depth")
        graph.render(scene)
        seen, work = graph.read(), dispatches(graph)
        assert seen.min() < 0.9 and (work > 0 or technique == "ray_traced")
        scene.move_camera(camera, (0, 1, 6), AWAY, 0.8)
        graph.render(scene)
        assert np.isinf(graph.read("gbuffer.depth")).all()
        assert dispatches(graph) == 0 and graph.stats()["counters"]["draws"] == 0
        assert (graph.read() == 1).all()
        graph.check(scene, 2)  # one of its runs culls nothing, draws all, and so dispatches: bytes must agree
        scene.move_camera(camera, (0, 1, 6), AT_SCENE, 0.8)
        graph.render(scene)
        assert dispatches(graph) == work
        assert (graph.read() == seen).all()


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_the_picture_of_an_empty_view_is_the_one_without_occlusion(technique):
    """Background pixels and all; and the frames before and after it are what they are without it."""
    pictures, work = {}, {}
    for name in ("none", technique):
        with heddle.Host() as host, host.scene() as scene:
            camera = fill(scene)
            with host.graph("deferred", ["extent=[64,40]", f"ao.technique={name}"] + ([] if name == "none" else ["ao.params.radius=1.5"])) as graph:
                graph.render(scene)  # makes tables, once
                for target in (AT_SCENE, AWAY, AT_SCENE):
                    scene.move_camera(camera, (0, 1, 6), target, 0.8)
                    graph.render(scene, time=0)
                    pictures.setdefault(name, []).append(graph.read())
                    work.setdefault(name, []).append(dispatches(graph))
    assert (pictures[technique][1] == pictures["none"][1]).all()
    assert work[technique][1] == work["none"][1]
    assert (pictures[technique][0] != pictures["none"][0]).any()
    assert (pictures[technique][0] == pictures[technique][2]).all() and work[technique][0] == work[technique][2]


def test_what_stands_at_the_edge_of_the_view_is_not_an_empty_view():
    """A sliver of the wall in one column of pixels is occluded as if nobody asked whether it is there."""
    with heddle.Host() as host, host.scene() as scene:
        camera = fill(scene)
        with host.graph("deferred", ["extent=[64,40]", "ao.technique=gtao", "output=ao.visibility"]) as graph:
            graph.keep("gbuffer.depth")
            counts = []
            for x in np.linspace(2, 14, 25):
                scene.move_camera(camera, (0, 1, 6), (x, 1, 0), 0.8)
                graph.render(scene, cut=True)
                covered = np.isfinite(graph.read("gbuffer.depth")).sum()
                counts.append((covered, dispatches(graph)))
                assert covered == 0 or counts[-1][1] == counts[0][1]
            assert any(0 < covered < 100 for covered, _ in counts)
            assert counts[-1] == (0, 0)


def test_without_a_technique_the_baked_map_counts_again_exactly():
    """`none` is no pass: no dispatch of it is left, and the material's own map is restored to the bit."""
    with heddle.Host() as host, host.scene() as scene:
        fill(scene)
        frames = []
        with host.graph("deferred", ["extent=[64,40]"]) as graph:
            graph.render(scene)  # makes tables, once
            for technique in ("none", "ssao", "none", "gtao", "none"):
                graph.set(f"ao.technique={technique}")
                if technique != "none":
                    graph.set("ao.params.radius", 1.5)
                graph.render(scene, time=0)
                frames.append((graph.read(), dispatches(graph)))
        for picture, count in frames[2::2]:
            assert (picture == frames[0][0]).all() and count == frames[0][1]
        for picture, count in frames[1::2]:
            assert (picture != frames[0][0]).any() and count > frames[0][1]
