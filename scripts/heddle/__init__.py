# SPDX-License-Identifier: Apache-2.0
"""Heddle from Python: hosts, scenes from numpy arrays, graphs, rendering, read-back, comparison.

The package binds the C API (api/heddle/heddle.h) by ctypes and adds nothing to it but comfort.

    import heddle
    with heddle.Host() as host, host.scene() as scene, host.graph("deferred") as graph:
        scene.load("model.glb")
        graph.render(scene)
        pixels = graph.read()                  # float32 (height, width, channels)
"""

from .comparison import compare, error_image, metrics
from .host import Error, Graph, Host, Job, Scene, version

__all__ = ["Error", "Graph", "Host", "Job", "Scene", "compare", "error_image", "metrics", "version"]
