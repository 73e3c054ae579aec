# SPDX-License-Identifier: Apache-2.0
"""Several hosts and devices in one process: each renders its own graph as if it were alone."""

import threading

import numpy as np
import pytest

import heddle

PORTS = ("lighting.radiance", "ao.visibility", None)
SETTINGS = {
    "one": ["extent=[96,54]", "ao.technique=gtao"],
    "two": ["extent=[64,80]", "ao.technique=ssao", "lighting.technique=forward", "shadow.params.filter_radius=0.2"],
}


def fill(scene, size):
    """A box on a floor; `size` makes the scenes of the hosts differ."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], dtype=np.float32) * size
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
             [1, 5, 7], [1, 7, 3]]
    paint = scene.material(base_color=(0.8, 0.5, 0.3, 1), roughness=0.6)
    flat = corners[np.array(faces).reshape(-1)]
    scene.instance(scene.mesh(flat, paint))
    floor = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=np.float32)
    scene.instance(scene.mesh(floor, paint, np.array([0, 2, 1, 0, 3, 2])))
    scene.light("directional", direction=(0.4, -1, 0.3), intensity=(9, 9, 9))
    scene.camera(position=(4, 3, 6), target=(0, 1, 0))


def frames_of(host, name, count):
    """The bytes of every port of every frame, the scene moving in between."""
    kept = []
    with host.graph("deferred", SETTINGS[name]) as graph, host.scene() as scene:
        for port in PORTS[:2]:
            graph.keep(port)
        fill(scene, 1.0 if name == "one" else 1.4)
        for frame in range(count):
            scene.camera(position=(4 - 0.3 * frame, 3, 6), target=(0, 1, 0))
            graph.render(scene, time=frame / 60)
            kept.append([graph.read(port) for port in PORTS])
    return kept


def same(first, second):
    return all(np.array_equal(a, b) for one, two in zip(first, second, strict=True) for a, b in zip(one, two, strict=True))


@pytest.fixture(scope="module")
def alone():
    """What each renders in a host that has the process to itself."""
    out = {}
    for name in SETTINGS:
        with heddle.Host() as host:
            out[name] = frames_of(host, name, 4)
    assert not np.array_equal(out["one"][0][0], out["one"][3][0])  # the camera did move
    return out


def test_two_hosts_on_two_threads_at_once(alone):
    results, errors = {}, []
    start = threading.Barrier(len(SETTINGS))

    def work(name):
        try:
            with heddle.Host() as host:
                start.wait()
                results[name] = [frames_of(host, name, 4) for _ in range(2)]
        except BaseException as error:  # a thread's exception is nobody's otherwise
            start.abort()
            errors.append(error)

    threads = [threading.Thread(target=work, args=(name,)) for name in SETTINGS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    for name in SETTINGS:
        for frames in results[name]:
            assert same(frames, alone[name]), name


def test_frames_of_two_hosts_take_turns(alone):
    with heddle.Host() as first, heddle.Host() as second:
        hosts = {"one": first, "two": second}
        graphs = {name: host.graph("deferred", SETTINGS[name]) for name, host in hosts.items()}
        scenes = {name: host.scene() for name, host in hosts.items()}
        for name, graph in graphs.items():
            for port in PORTS[:2]:
                graph.keep(port)
            fill(scenes[name], 1.0 if name == "one" else 1.4)
        for frame in range(4):
            for name, graph in graphs.items():
                scenes[name].camera(position=(4 - 0.3 * frame, 3, 6), target=(0, 1, 0))
                graph.render(scenes[name], time=frame / 60)
                assert same([[graph.read(port) for port in PORTS]], [alone[name][frame]])
        # A host counts its own frames, and opens its own plugins.
        stats = {name: graph.stats() for name, graph in graphs.items()}
        assert {name: one["frames"] for name, one in stats.items()} == {"one": 4, "two": 4}
        opened = {name: {path.split("/")[-1] for path in one["libraries"]} for name, one in stats.items()}
        assert opened["one"] - opened["two"] == {"gtao.so", "deferred.so"}
        assert opened["two"] - opened["one"] == {"ssao.so", "forward.so"}
        for graph in graphs.values():
            graph.close()
        for scene in scenes.values():
            scene.close()


def test_a_host_goes_and_the_other_renders_on(alone):
    with heddle.Host() as stays:
        with heddle.Host() as goes:
            frames_of(goes, "two", 1)
        assert same(frames_of(stays, "one", 4), alone["one"])


def test_an_error_of_one_host_is_not_the_others(alone):
    with heddle.Host() as fails, heddle.Host() as works:
        with pytest.raises(heddle.Error, match="no_such"):
            fails.graph("deferred", ["ao.technique=no_such"])
        assert same(frames_of(works, "one", 4), alone["one"])


def test_graphs_that_show_a_scene_in_turn_see_the_same_motion():
    settings = ["extent=[64,48]", "ao.technique=none"]
    with heddle.Host() as host, host.graph("studio", settings) as one, host.graph("studio", settings) as two, \
            host.scene() as scene:
        fill(scene, 1.0)
        place = np.eye(4)
        seen = {one: [], two: []}
        for graph in (one, two):
            graph.keep("gbuffer.motion")
        for frame, turns in enumerate([(one, two), (two, one), (one, two, one), (two, one)]):
            place[0, 3] = 0.25 * frame
            scene.move(0, place)
            for graph in turns:
                graph.render(scene)
                seen[graph].append(np.array(graph.read("gbuffer.motion")))
    fastest = [[round(float(np.abs(motion).max()), 2) for motion in seen[graph]] for graph in (one, two)]
    assert [step > 0.5 for step in fastest[0]] == [False, True, True, False, True], fastest  # nothing has moved in between
    assert [step > 0.5 for step in fastest[1]] == [False, True, True, True], fastest
    assert np.array_equal(seen[one][1], seen[two][1])
