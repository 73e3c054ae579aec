# SPDX-License-Identifier: Apache-2.0
"""Picture: an image from a file, 24 x 24 m, on the wall of a yard and, in small, on its floor.

For techniques of role texture_source, in the graph virtual_image, whose job image_store says which image:
--set 'image_store.toml#store.params.images=["/home/me/map.tif"]'. update(scene, time) walks from the far end of the yard to
where one can read it. Cameras: walker, close (one metre away), floor (along the floor).
"""

import numpy as np

from heddle import shapes

SIDE = 24.0  # metres
EYE = 1.7
WALK = 12.0  # seconds to the wall


def sheet(corner, across, down) -> dict:
    """A parallelogram; uv (0, 0) at its corner, as the image's top left."""
    corner, across, down = (np.asarray(v, float) for v in (corner, across, down))
    normal = np.cross(down, across)
    return {"positions": np.array([corner, corner + down, corner + down + across, corner + across]),
            "normals": np.tile(normal / np.linalg.norm(normal), (4, 1)), "indices": np.array([0, 1, 2, 0, 2, 3]),
            "uv0": np.array([[0, 0], [0, 1], [1, 1], [1, 0]], float)}


def build(scene) -> None:
    half = SIDE / 2
    painting = scene.material("picture", (1, 1, 1, 1), roughness=0.9)
    scene.component("texture_source.virtual", {"source": "stored", "image": 0}, material=painting)
    wall = sheet((half, SIDE + 1, 0), (-SIDE, 0, 0), (0, -SIDE, 0))  # faces -Z, and the sun
    scene.instance(scene.mesh(material=painting, name="wall", **wall))
    floor = sheet((half, 0.05, -2), (-SIDE, 0, 0), (0, 0, -SIDE))
    scene.instance(scene.mesh(material=painting, name="floor", **floor))
    stone = scene.material("stone", (0.42, 0.4, 0.37, 1), roughness=0.9)
    ground = sheet((60, -0.02, 2), (-120, 0, 0), (0, 0, -90))
    scene.instance(scene.mesh(material=stone, name="ground", **ground))
    post = scene.mesh(material=stone, name="post", **shapes.box((0.4, 3.0, 0.4)))
    for z in np.arange(-40, -4, 6):
        for x in (-half - 1.5, half + 1.5):
            scene.instance(post, shapes.translation(x, 1.5, z))
    eye, target = view(0.0)
    scene.camera(eye, target, name="walker")
    scene.camera((-1.0, EYE, -1.0), (-1.0, EYE + 0.2, 0.0), name="close", use=False)
    scene.camera((0.0, 0.6, -27.0), (0.0, 0.0, -15.0), name="floor", use=False)


def view(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Where from and where to: the picture's middle from afar, what is at eye level from near."""
    part = np.clip(time / WALK, 0, 1)
    z = -44.0 * (1.2 / 44.0) ** part
    return np.array([-2.0 * part, EYE, z]), np.array([-2.0 * part, (1 - part) * SIDE / 2 + part * EYE, 0.0])


def update(scene, time: float) -> None:
    scene.move_camera(0, *view(time))
