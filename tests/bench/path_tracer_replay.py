# SPDX-License-Identifier: Apache-2.0
"""How much of ray_tracing/path_tracer's time is Embree's: a whole frame against a bare replay of the rays it asked for.

usage: path_tracer_replay.py [--samples N] [--width PIXELS] [--runs N] [SCENE.py ...]

PYTHONPATH must hold scripts/. Each scene is rendered `runs` times without the knob `replay` (processor time of all threads:
the whole frame, from the graph to the picture), and as often with it: recorded rays, nearest hits and shadow rays in their
order, are given to Embree again in the same threads, and nothing else is done (counter replay_us, processor time; holes of masks are looked at
by the same filter). Prints
the report that `heddle bench --json` prints: {"machine": {...}, "entries": [{"name", "value", "unit", "runs", "minimum",
"maximum"}]}, medians over runs; names are path_tracer_replay.SCENE.ratio, .whole, .replay, .rays and .us_per_ray.
"""
import argparse
import json
import os
import pathlib
import platform
import statistics
import time

import heddle
from heddle.__main__ import load_scene

SCENES = ("cornell_box.py", "street.py", "wires_and_grass.py")  # a closed room; a night of lamps; masks
GRAPH = """extent = [{width}, {height}]
output = "pt.radiance"
[[pass]]
role = "sky"
technique = "procedural"
[[pass]]
role = "surface_material"
technique = "ggx"
[[pass]]
name = "pt"
role = "ray_tracing"
technique = "path_tracer"
params.samples = {samples}
params.emission = "seen"
"""


def counts(graph) -> dict:
    return {entry["name"]: entry["count"] for entry in graph.stats()["counts"] if entry["pass"] == "pt"}


def measure(host, file: str, arguments: argparse.Namespace) -> list:
    whole, replay, ratio = [], [], []
    text = GRAPH.format(width=arguments.width, height=arguments.width * 9 // 16, samples=arguments.samples)
    with host.scene() as scene, host.parse(text) as graph:
        load_scene(scene, file)
        graph.render(scene, seed=0)  # what is made once
        for run in range(1, arguments.runs + 1):  # every seed anew: a frame of the same one is kept
            graph.set("pt.params.replay", False)
            start = time.process_time()
            graph.render(scene, seed=2 * run)
            whole.append(1e3 * (time.process_time() - start))
            graph.set("pt.params.replay", True)
            graph.render(scene, seed=2 * run + 1)
            told = counts(graph)
            if told["hits"] != told["replayed_hits"] or told["hits"] == 0:
                raise SystemExit(f"{file}: Embree found {told['hits']} hits, and {told['replayed_hits']} when asked again")
            replay.append(told["replay_us"] / 1e3)
            ratio.append(whole[-1] / replay[-1])
    rays = told["rays"] + told["shadow_rays"]
    name = f"path_tracer_replay.{pathlib.Path(file).stem}"

    def entry(what: str, unit: str, values: list) -> dict:
        return {"name": f"{name}.{what}", "value": statistics.median(values), "unit": unit, "runs": len(values),
                "minimum": min(values), "maximum": max(values)}
    return [entry("ratio", "1", ratio), entry("whole", "ms", whole), entry("replay", "ms", replay),
            {"name": f"{name}.rays", "value": rays, "unit": "1", "runs": 0},
            entry("us_per_ray", "us", [1e3 * value / rays for value in replay])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    with heddle.Host() as host:
        entries = [entry for file in arguments.scenes for entry in measure(host, file, arguments)]
    print(json.dumps({"machine": {"processor": platform.processor() or platform.machine(), "processors": os.cpu_count(),
                                  "system": platform.platform(), "load_average": os.getloadavg()[0]},
                      "entries": entries}, indent=1))


if __name__ == "__main__":
    main()
