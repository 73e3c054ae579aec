# SPDX-License-Identifier: Apache-2.0
"""What a pixel held, through the graph: the same numbers as the ports read whole, also where memory was shared."""

import json
import subprocess

import numpy as np
import pytest

import heddle

SETTINGS = ["extent=[64,48]"]
PIXELS = [(0, 0), (32, 24), (63, 47)]


def build(scene):
    material = scene.material("red", base_color=(0.8, 0.2, 0.1, 1))
    mesh = scene.mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], material)
    scene.instance(mesh)
    scene.camera((0, 0, 4), (0, 0, 0))


def values(ports, name):
    (found,) = [port for port in ports if port["name"] == name]
    (layer,) = found["layers"]
    return layer["values"]


def test_every_image_port_is_there_in_the_order_of_execution(host):
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        build(scene)
        graph.render(scene)
        (seen,) = graph.inspect(32, 24)
        stages = json.loads(graph.explain("json"))["stages"]
    places = [port["place"] for port in seen["ports"]]
    assert places == sorted(places)
    written = {use["resource"] for stage in stages for use in stage["uses"]
               if use["writes"] and use["access"] not in ("value",)}
    assert {port["name"] for port in seen["ports"]} == written


def test_values_are_those_of_the_ports_read_whole(host):
    names = ["gbuffer.depth", "gbuffer.normal", "ao.visibility", "lighting.radiance", "display.color"]
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        build(scene)
        seen = graph.inspect(*PIXELS[0], *PIXELS[1:], scene=scene)
    for name in names:  # each alone, so that the others share memory as they do for everybody
        with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
            build(scene)
            graph.keep(name)
            graph.render(scene)
            whole = graph.read(name)
        for (x, y), pixel in zip(PIXELS, seen):
            assert pixel["pixel"] == [x, y]
            assert np.array_equal(np.float32(values(pixel["ports"], name)), whole[y, x]), (name, x, y)


def test_ports_whose_memory_others_took_over_are_seen_as_they_were_made(host):
    """The heap is smaller than what is in it, so at the frame's end some of these are gone."""
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        build(scene)
        (seen,) = graph.inspect(32, 24, scene=scene)
        memory = graph.stats()["memory"]
    assert memory["transient_bytes"] < memory["transient_bytes_without_aliasing"]
    assert values(seen["ports"], "gbuffer.depth") == [4.0]
    assert values(seen["ports"], "ao.visibility")[0] > 0.9


def test_maps_with_an_extent_of_their_own_have_no_values(host):
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        (seen,) = graph.inspect(0, 0, scene=scene)
    (sky,) = [port for port in seen["ports"] if port["name"] == "sky.sky_map"]
    assert sky["texel"] is None and "layers" not in sky


def test_numbers_that_json_lacks_come_back(host):
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        (seen,) = graph.inspect(0, 0, scene=scene)
    assert values(seen["ports"], "gbuffer.depth") == [np.inf]  # nothing is there


def test_a_pixel_outside_is_an_error(host):
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        with pytest.raises(heddle.Error) as error:
            graph.inspect(64, 0, scene=scene)
        assert str(error.value) == ("error: pixel 64,0 lies outside of the frame\n"
                                    "  expected: X from 0 to 63, Y from 0 to 47")
        with pytest.raises(heddle.Error) as error:
            graph.inspect(-1, 0, scene=scene)
        assert str(error.value) == "error: (-1, 0) is no pixel\n  expected: x and y, integers of at least 0"


def test_without_a_frame_or_a_scene_there_is_nothing_to_inspect(host):
    with host.graph("deferred", SETTINGS) as graph:
        with pytest.raises(heddle.Error) as error:
            graph.inspect(0, 0)
    assert str(error.value) == "error: no scene to inspect\n  help:     say scene=, or render a frame before"


def test_inspecting_is_a_frame_like_any_other(host):
    with host.graph("deferred", SETTINGS) as graph, host.scene() as scene:
        build(scene)
        graph.render(scene)
        before = graph.read()
        graph.inspect(1, 1)
        assert np.array_equal(graph.read(), before)


def run(command, root, *words):
    return subprocess.run([command, "inspect", *words], cwd=root, capture_output=True, text=True)


def test_the_command_prints_a_table_and_the_same_as_json(command, root):
    words = ["deferred", "10,20", "63,47", "--set", SETTINGS[0], "-q"]
    table = run(command, root, *words)
    assert table.returncode == 0, table.stderr
    lines = table.stdout.splitlines()
    assert lines[0] == "pixel 10,20 of 64 x 48, frame 0"
    assert lines[1].split() == ["stage", "port", "format", "unit", "value"]
    seen = json.loads(run(command, root, *words, "--json").stdout)
    assert [pixel["pixel"] for pixel in seen["pixels"]] == [[10, 20], [63, 47]]
    assert [line.split()[2] for line in lines[2:2 + len(seen["pixels"][0]["ports"])]] == [
        port["name"] for port in seen["pixels"][0]["ports"]]


def test_scenes_in_python_are_inspected_too(command, root):
    words = ["scripts/scenes/material_grid.py", "32,24", "--set", SETTINGS[0]]
    table = run(command, root, *words)
    assert table.returncode == 0, table.stderr
    assert table.stdout.startswith("pixel 32,24 of 64 x 48, frame 0\n")
    seen = json.loads(run(command, root, *words, "--json").stdout)
    assert seen["extent"] == [64, 48] and seen["frame"] == 0


def test_the_command_without_a_pixel_says_how(command, root):
    for scene in ([], ["scripts/scenes/material_grid.py"]):
        done = run(command, root, *scene)
        assert done.returncode == 2
        assert done.stderr == ("error: no pixel was named\n"
                               "  expected: X,Y in pixels of the frame from its top left, for instance 320,180\n")
