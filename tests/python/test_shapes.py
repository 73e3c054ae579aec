# SPDX-License-Identifier: Apache-2.0
"""Procedural shapes: closed where they should be, facing outward, with the volume that geometry says."""

import numpy as np
import pytest

from heddle import shapes

SHAPES = {
    "box": shapes.box((1, 2, 3)), "lathe": shapes.lathe([(1, 0), (0.5, 1), (0.7, 2)]), "sphere": shapes.sphere(1.0),
    "arch": shapes.arch(3, 1, 0.5, 0.25), "cloth": shapes.cloth(2, 2, 5, 0.1), "quad": shapes.quad((0, 0, 0), (1, 0, 0), (0, 1, 0)),
    "torus": shapes.torus(1, 0.2), "prism": shapes.prism([(0, 0), (2, 0), (2, 1), (0, 1)], 0.5),
    "tube": shapes.tube([(0, 0, 0), (0, 1, 0.2), (0.5, 2, 0)], 0.1),
    "grid": shapes.grid(2, 2, 4, 4, lambda x, z: 0.1 * np.sin(3 * x)),
}


def corners(shape):
    return shape["positions"][shape["indices"]]


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_face_along_their_normals_and_have_area(name):
    shape = SHAPES[name]
    p = corners(shape)
    cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert np.linalg.norm(cross, axis=1).min() > 1e-9
    assert (np.einsum("ij,ij->i", cross, shape["normals"][shape["indices"]].sum(1)) > 0).all()
    assert np.allclose(np.linalg.norm(shape["normals"], axis=1), 1, atol=1e-12)


def volume(shape):
    p = corners(shape)
    return np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6


def test_closed_shapes_enclose_their_volume():
    assert volume(SHAPES["box"]) == pytest.approx(6, rel=1e-12)
    # A polyhedron inscribed in the sphere loses O(1/n^2) of 4/3 pi; 32 segments: below 2 %.
    assert volume(SHAPES["prism"]) == pytest.approx(1, rel=1e-12)
    # A torus holds 2 pi^2 R r^2; its polygons of 24 and 10 corners lose 1 % and 6 % of the circles they stand in.
    assert 0.9 * 2 * np.pi**2 * 0.04 < volume(SHAPES["torus"]) < 2 * np.pi**2 * 0.04
    assert 0.98 * 4 / 3 * np.pi < volume(SHAPES["sphere"]) < 4 / 3 * np.pi


def test_edges_of_the_sphere_are_shared_by_two_triangles():
    shape = SHAPES["sphere"]
    # Seams have vertices of their own: positions decide.
    _, index = np.unique(np.round(shape["positions"], 9), axis=0, return_inverse=True)
    triangles = index[shape["indices"]]
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
