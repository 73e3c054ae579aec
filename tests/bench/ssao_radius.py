# SPDX-License-Identifier: Apache-2.0
"""What ambient_occlusion/ssao costs, by the radius in pixels and by how far its depth is reduced; and by how much the time of
a frame swings while the camera comes close, with the radius limited, with more samples in its place, and with neither.

usage: ssao_radius.py [--extent WIDTH HEIGHT] [--points N] [--repeats N] [--steps N] [--device NAME] [--json FILE]

Needs the standard library alone, and libheddle.so where scripts/heddle looks for it (HEDDLE_LIBRARY names another). The
camera looks straight at a relief of boxes, so that a radius is as many pixels everywhere.

The first table: time of the pass alone, reduction included: each stage is submitted and waited for by itself, and what that
takes with nothing to do (the same stages on 8 x 8 pixels) is taken off. The second: the dolly, from 16 radii away to one;
swing is (largest - least) / median over its steps, of the whole frame's time from submission to fence, and of the pass.
All times are medians; repeats are interleaved, so that what else the machine does falls on all cells alike.
"""
import argparse
import ctypes
import importlib.util
import json
import math
import pathlib
import random
import statistics
import sys
from ctypes import byref

ROOT = pathlib.Path(__file__).resolve().parents[2]
ANGLE = 0.9  # vertical, radians
RADII_PX = (8, 16, 32, 64, 128)
DIVISORS = (1, 2, 4)
LIMITERS = ("radius", "samples", "none")
DISTANCE = 10.0  # metres, of the first table
GRAPH = """extent = [{width}, {height}]
output = "ao.visibility"
[[pass]]
role = "gbuffer"
technique = "raster"
[[pass]]
name = "ao"
role = "ambient_occlusion"
technique = "ssao"
params.points = {points}
params.tight_share = 0.0
params.blur_passes = 1
"""


def load_library():
    """heddle._library by itself: the package around it wants numpy."""
    spec = importlib.util.spec_from_file_location("heddle_library", ROOT / "scripts" / "heddle" / "_library.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module, module.load()


c, heddle = load_library()


class Bench:
    """A host with the relief, and graphs of it."""

    def __init__(self, device):
        self.host = ctypes.c_void_p()
        self.scene = ctypes.c_void_p()
        self._log = c.LogFunction(lambda _user, level, text: print(text.decode(), file=sys.stderr) if level < 2 else None)
        options = c.HostOptions(ctypes.sizeof(c.HostOptions), 0, device.encode() if device else None, None, None, self._log)
        if heddle.heddle_create(byref(options), byref(self.host)):
            sys.exit(heddle.heddle_error(None).decode())
        self.check(heddle.heddle_scene_create(self.host, byref(self.scene)))
        self.add_relief()
        self.camera = ctypes.c_uint32()
        self.check(heddle.heddle_scene_add_camera(self.scene, None, byref(camera_at(DISTANCE)), byref(self.camera)))
        self.check(heddle.heddle_scene_use_camera(self.scene, self.camera))

    def check(self, status):
        if status:
            sys.exit(heddle.heddle_error(self.host).decode())

    def add_relief(self):
        """Pillars of 0.25 m, 0 to 0.3 m high, over 40 x 24 m: also what one sees from far away fills the view."""
        chance = random.Random(1)
        side, columns, rows = 0.25, 160, 96
        positions, indices = [], []
        for j in range(rows):
            for i in range(columns):
                x, y, top = (i - columns / 2) * side, (j - rows / 2) * side, chance.uniform(0.0, 0.3)
                corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]
                first = len(positions) // 3
                for z in (top, -0.1):
                    for corner in corners:
                        positions += (*corner, z)
                for a, b, d, e in ((0, 1, 2, 3), (4, 5, 1, 0), (5, 6, 2, 1), (6, 7, 3, 2), (7, 4, 0, 3)):
                    indices += (first + a, first + b, first + d, first + a, first + d, first + e)
        mesh = c.Mesh(struct_size=ctypes.sizeof(c.Mesh), vertex_count=len(positions) // 3, index_count=len(indices),
                      positions=(ctypes.c_float * len(positions))(*positions),
                      indices=(ctypes.c_uint32 * len(indices))(*indices))
        material = c.SceneMaterial(struct_size=ctypes.sizeof(c.SceneMaterial))
        material.textures[:] = [c.NONE] * c.TEXTURE_COUNT
        material.record.base_color[:] = (0.8, 0.8, 0.8, 1.0)
        material.record.ior = 1.5
        ids = [ctypes.c_uint32() for _ in range(3)]
        identity = (ctypes.c_double * 16)(*[float(i % 5 == 0) for i in range(16)])
        self.check(heddle.heddle_scene_add_material(self.scene, None, byref(material), byref(ids[0])))
        self.check(heddle.heddle_scene_add_mesh(self.scene, None, byref(mesh), ids[0], byref(ids[1])))
        self.check(heddle.heddle_scene_add_instance(self.scene, None, ids[1], identity, byref(ids[2])))

    def graph(self, width, height, points):
        text = GRAPH.format(width=width, height=height, points=points)
        made = ctypes.c_void_p()
        self.check(heddle.heddle_graph_parse(self.host, text.encode(), b"ssao_radius.toml", str(ROOT).encode(), None, 0,
                                             byref(made)))
        return made

    def set(self, graph, **parameters):
        for name, value in parameters.items():
            self.check(heddle.heddle_graph_set(graph, f"ao.params.{name}={value}".encode()))

    def look_from(self, distance):
        self.check(heddle.heddle_scene_set_camera(self.scene, self.camera, byref(camera_at(distance))))

    def frame(self, graph, is_profiled):
        """Milliseconds: of each of the pass's stages on the GPU where the frame is profiled, else of the whole frame."""
        options = c.RenderOptions(struct_size=ctypes.sizeof(c.RenderOptions),
                                  flags=(c.RENDER_PROFILE if is_profiled else 0) | c.RENDER_ANEW)
        self.check(heddle.heddle_render(graph, self.scene, byref(options)))
        text = ctypes.c_char_p()
        self.check(heddle.heddle_stats(graph, byref(text)))
        stats = json.loads(text.value)
        if not is_profiled:
            return stats["submit_ms"]
        return {stage["stage"]: stage["wall_ms"] for stage in stats["stages"]
                if stage["pass"] == "ao" and stage["stage"] != "pattern"}

    def device(self):
        text = ctypes.c_char_p()
        self.check(heddle.heddle_devices(self.host, byref(text)))
        return json.loads(text.value)


def camera_at(distance):
    return c.Camera(struct_size=ctypes.sizeof(c.Camera), position=(0.0, 0.0, distance), rotation=(0.0, 0.0, 0.0, 1.0),
                    vertical_angle=ANGLE)


def metres(radius_px, height, distance):
    """The radius that is so many pixels at a distance: card equation rpx = R H / (2 tan(angle / 2) z)."""
    return radius_px * 2 * math.tan(ANGLE / 2) * distance / height


def least_times(bench, points, repeats):
    """Of the stages where there is nothing to do."""
    graph = bench.graph(8, 8, points)
    bench.look_from(DISTANCE)
    seen = [bench.frame(graph, True) for _ in range(repeats + 2)][2:]
    heddle.heddle_graph_destroy(graph)
    return {stage: statistics.median(one[stage] for one in seen) for stage in seen[0]}


def measure_radii(bench, width, height, points, repeats):
    """{(divisor, radius in pixels): {stage: ms}}"""
    least = least_times(bench, points, repeats)
    bench.look_from(DISTANCE)
    graphs = {}
    for divisor in DIVISORS:
        graphs[divisor] = bench.graph(width, height, points)
        bench.set(graphs[divisor], limiter='"none"', depth_divisor=divisor)
    seen = {(divisor, radius): [] for divisor in DIVISORS for radius in RADII_PX}
    for repeat in range(repeats + 1):
        for (divisor, radius), times in seen.items():
            bench.set(graphs[divisor], radius=metres(radius, height, DISTANCE))
            time = bench.frame(graphs[divisor], True)
            if repeat > 0:  # the first of each compiles
                times.append(time)
    for graph in graphs.values():
        heddle.heddle_graph_destroy(graph)
    return {cell: {stage: max(0.0, statistics.median(one[stage] for one in times) - least[stage]) for stage in times[0]}
            for cell, times in seen.items()}


def measure_dolly(bench, width, height, points, repeats, steps):
    """{limiter: ([ms of the frame at each step], [ms of the pass])}"""
    radius = 0.5
    distances = [radius * 16 ** (1 - step / (steps - 1)) + 0.3 for step in range(steps)]  # 0.3: before the highest pillar
    graphs = {}
    for limiter in LIMITERS:
        graphs[limiter] = bench.graph(width, height, points)
        bench.set(graphs[limiter], limiter=f'"{limiter}"', radius=radius, depth_divisor=1)
    seen = {limiter: ([[] for _ in distances], [[] for _ in distances]) for limiter in LIMITERS}
    for repeat in range(repeats + 1):
        for step, distance in enumerate(distances):
            bench.look_from(distance)
            for limiter in LIMITERS:
                whole, alone = bench.frame(graphs[limiter], False), sum(bench.frame(graphs[limiter], True).values())
                if repeat > 0:
                    seen[limiter][0][step].append(whole)
                    seen[limiter][1][step].append(alone)
    for graph in graphs.values():
        heddle.heddle_graph_destroy(graph)
    return {limiter: tuple([statistics.median(times) for times in kind] for kind in both) for limiter, both in seen.items()}


def swing(times):
    return (max(times) - min(times)) / statistics.median(times)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--extent", type=int, nargs=2, default=(1920, 1080), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--points", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--device")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.repeats < 1 or arguments.steps < 2 or min(arguments.extent) < 1:
        parser.error("--repeats wants 1 or more, --steps 2 or more, --extent two sizes")
    width, height = arguments.extent
    bench = Bench(arguments.device)

    cells = measure_radii(bench, width, height, arguments.points, arguments.repeats)
    print(f"{width} x {height} pixels, {arguments.points} points, medians of {arguments.repeats}\n")
    print("| depth_divisor | reduction, ms | " + " | ".join(f"{radius} px, ms" for radius in RADII_PX) +
          f" | {RADII_PX[-1]} px : {RADII_PX[0]} px |")
    print("|---" * (len(RADII_PX) + 3) + "|")
    growth = {}
    for divisor in DIVISORS:
        totals = [sum(cells[divisor, radius].values()) for radius in RADII_PX]
        reduction = statistics.median(cells[divisor, radius]["reduce"] for radius in RADII_PX)
        growth[divisor] = totals[-1] / max(totals[0], 1e-9)
        print(f"| {divisor} | {reduction:.4f} | " + " | ".join(f"{total:.4f}" for total in totals) +
              f" | {growth[divisor]:.2f} |")
    print(f"\nThe pass's time grows {growth[4]:.2f} times with depth_divisor 4 and {growth[1]:.2f} times with 1, from "
          f"{RADII_PX[0]} to {RADII_PX[-1]} px: {'less' if growth[4] < growth[1] else 'NOT less'} with the reduced depth.\n")

    dolly = measure_dolly(bench, width, height, arguments.points, arguments.repeats, arguments.steps)
    print("| limiter | frame, ms: least, median, largest | swing | pass, ms: least, median, largest | swing |")
    print("|---|---|---|---|---|")
    for limiter, kinds in dolly.items():
        row = [f"{min(times):.4f}, {statistics.median(times):.4f}, {max(times):.4f} | {100 * swing(times):.1f} %"
               for times in kinds]
        print(f"| {limiter} | {row[0]} | {row[1]} |")
    if arguments.json:
        arguments.json.write_text(json.dumps({
            "extent": [width, height], "points": arguments.points, "repeats": arguments.repeats, "devices": bench.device(),
            "pass_ms": [{"depth_divisor": divisor, "radius_px": radius, **stages} for (divisor, radius), stages in cells.items()],
            "dolly": {limiter: {"frame_ms": frame, "pass_ms": alone} for limiter, (frame, alone) in dolly.items()}}, indent=2))


if __name__ == "__main__":
    main()
