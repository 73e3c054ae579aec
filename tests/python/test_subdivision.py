# SPDX-License-Identifier: Apache-2.0
"""Subdivided glTF: faces from FB_ngon_encoding, components from extras, cages that bend, and the technique against its
reference through the gbuffer."""

import numpy as np
import pytest

from test_animation import Maker

SMALL = ["extent=[96,64]"]
CUBE = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float32)
QUADS = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def write_cube(path, *, quads=True, moves=None, levels=3, morph=None):
    """A cube under a node; it moves by a node's animation, or by a morph target, in a second."""
    made = Maker()
    triangles = np.array([(f[0], f[i], f[i + 1]) for f in QUADS for i in (1, 2)], dtype=np.uint16).reshape(-1)
    primitive = {"attributes": {"POSITION": made.accessor(CUBE)}, "indices": made.accessor(triangles)}
    if quads:
        primitive["extensions"] = {"FB_ngon_encoding": {}}
    mesh = {"primitives": [primitive]}
    node = {"mesh": 0, "extras": {"heddle": {"subdivision.surface": {"levels": levels}}}}
    times = made.accessor(np.array([0, 1], dtype=np.float32))
    if morph is not None:
        primitive["targets"] = [{"POSITION": made.accessor(np.asarray(morph, dtype=np.float32))}]
        mesh["weights"] = [0.0]
        made.json["animations"] = [{"samplers": [{"input": times, "output": made.accessor(np.array([0, 1], dtype=np.float32))}],
                                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]
    if moves is not None:
        places = np.array([(0, 0, 0), moves], dtype=np.float32)
        made.json["animations"] = [{"samplers": [{"input": times, "output": made.accessor(places)}],
                                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]
    made.json["meshes"] = [mesh]
    made.json["nodes"] = [node]
    made.json["extensionsUsed"] = ["FB_ngon_encoding"]
    made.write(path)
    return path


def frames(host, path, times, ports=("gbuffer.depth", "gbuffer.motion", "gbuffer.normal"), settings=()):
    """What the ports hold in the last of some frames."""
    with host.graph("studio", [*SMALL, *settings]) as graph, host.scene() as scene:
        scene.load(path)
        scene.camera((0, 1, 5), (0, 0, 0), vertical_angle=0.7)
        for port in ports:
            graph.keep(port)
        before = 0.0
        for time in times:
            scene.set_time(time)
            graph.render(scene, time=time, time_step=time - before)
            before = time
        return {port: graph.read(port) for port in ports}


def test_cages_that_bend_move_as_what_is_moved(host, tmp_path):
    step = (0.3, 0.1, -0.2)
    moved = frames(host, write_cube(tmp_path / "moved.glb", moves=step), (0.4, 0.5, 0.6))
    bent = frames(host, write_cube(tmp_path / "bent.glb", morph=[step] * 8), (0.4, 0.5, 0.6))
    covered = np.isfinite(moved["gbuffer.depth"]) & np.isfinite(bent["gbuffer.depth"])
    assert covered.sum() > 500
    assert (np.isfinite(moved["gbuffer.depth"]) != np.isfinite(bent["gbuffer.depth"])).sum() <= 2
    assert np.abs(moved["gbuffer.depth"][covered] - bent["gbuffer.depth"][covered]).max() < 1e-3
    motion = np.abs(moved["gbuffer.motion"] - bent["gbuffer.motion"])[covered[..., 0]]
    assert np.abs(moved["gbuffer.motion"][covered[..., 0]]).max() > 0.3, "there is motion"
    assert motion.max() < 0.01


def test_a_cage_at_rest_again_has_no_motion(host, tmp_path):
    path = write_cube(tmp_path / "bent.glb", morph=[(0.3, 0.1, -0.2)] * 8)
    # What rounding leaves of anything that stands still.
    assert np.abs(frames(host, path, (0.4, 0.6, 0.6))["gbuffer.motion"]).max() < 1e-4


@pytest.mark.parametrize("time", (0.0, 0.7))
def test_the_reference_sees_the_same_surface(host, tmp_path, time):
    twist = [(-0.6 * z * (y > 0), 0, 0.6 * x * (y > 0)) for x, y, z in CUBE]
    path = write_cube(tmp_path / "twisted.glb", morph=twist, levels=5)
    found = frames(host, path, (0.0, 0.35, time))
    truth = frames(host, path, (0.0, 0.35, time), settings=["subdivision.technique=limit"])
    covered = np.isfinite(found["gbuffer.depth"]) & np.isfinite(truth["gbuffer.depth"])
    assert covered.sum() > 500
    assert (np.isfinite(found["gbuffer.depth"]) != np.isfinite(truth["gbuffer.depth"])).sum() <= 2
    for port, bound in (("gbuffer.depth", 1e-4), ("gbuffer.motion", 1e-3)):
        assert np.abs(found[port][covered[..., 0]] - truth[port][covered[..., 0]]).max() < bound, port


def test_quads_are_found_where_the_file_marks_them(host, tmp_path):
    quads = frames(host, write_cube(tmp_path / "quads.glb"), (0.0,))["gbuffer.depth"]
    triangles = frames(host, write_cube(tmp_path / "triangles.glb", quads=False), (0.0,))["gbuffer.depth"]
    both = np.isfinite(quads) & np.isfinite(triangles)
    # A cage of triangles has another surface, not the symmetric one of the quads.
    assert np.abs(quads[both] - triangles[both]).max() > 0.01
