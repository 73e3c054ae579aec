# SPDX-License-Identifier: Apache-2.0
"""What the techniques cost with their default parameters, each in a shipped graph and scene: the times in the techniques'
READMEs are of this.

usage: techniques.py [--extent WIDTH HEIGHT] [--rounds N] [--frames N] [--device NAME] [--only SCENE ...]

Prints a table a scene: the median frame, from first submission to last fence, with 95 % of its rounds' medians between the
two figures behind it; how much longer that is than the line which has no figure there; and the time of the changed pass's own stages where each
is submitted and waited for by itself, what an empty submission takes included. All graphs of a scene are open at once and
take turns in a random order, so that what else the machine does falls on all of them alike. What cannot run here, for want of
a library or a device's feature, says so. Needs scripts/ in PYTHONPATH, and numpy.
"""
import argparse
import pathlib
import random
import statistics
import sys

import heddle
from heddle.__main__ import load_scene

ROOT = pathlib.Path(__file__).resolve().parents[2]
# scene: (graph, pass that changes or None, {line: settings}); each first line is what the others are compared with
TABLES = {
    "atrium": [
        ("deferred", None, {"as shipped": []}),
        ("deferred", "ao", {"ambient_occlusion: none": ["ao.technique=none"],
                            "ambient_occlusion/gtao": [],
                            "ambient_occlusion/ssao": ["ao.technique=ssao"],
                            "ambient_occlusion/ray_traced (CPU)": ["ao.technique=ray_traced"]}),
        ("deferred", "shadow", {"shadow: none": ["shadow.technique=none"],
                                "shadow/shadow_map": [],
                                "shadow/cascaded": ["shadow.technique=cascaded"],
                                "shadow/ray_traced": ["shadow.technique=ray_traced"]}),
        ("deferred", "contact", {"contact: none": ["contact.technique=none"], "shadow/ray_marched_screen": []}),
        ("deferred", "sky", {"sky/procedural": [], "sky/uniform": ["sky.technique=uniform"]}),
        ("deferred", "gbuffer", {"gbuffer/raster, packed": [], "gbuffer/raster, float32": ["gbuffer.params.precision=float32"]}),
        ("deferred", "lighting", {"lighting/deferred": [], "lighting/forward": ["lighting.technique=forward"]}),
        ("deferred", "display", {"display/linear": [], "display/ocio": ["display.technique=ocio"]}),
    ],
    "street": [
        ("tiled", "light_assignment", {"light_assignment: none": ["light_assignment.technique=none"],
                                       "light_assignment/brute_force": ["light_assignment.technique=brute_force"],
                                       "light_assignment/tiled": []}),
    ],
    "subdivision": [
        ("deferred", "subdivision", {"subdivision: none": ["subdivision.technique=none"],
                                     "subdivision/catmull_clark": [],
                                     "subdivision/vertex_program": ["subdivision.technique=vertex_program"],
                                     "subdivision/limit": ["subdivision.technique=limit"]}),
    ],
    "material_grid": [
        ("studio", "material", {"surface_material: none": ["material.technique=none"], "surface_material/ggx": []}),
    ],
    "wires_and_grass": [
        ("supersampled", "aa", {"antialiasing: none": ["aa.technique=none"],
                                "antialiasing/supersampled, 4 samples": ["aa.params.samples=4"],
                                "antialiasing/multiframe, one sample a frame": ["aa.technique=multiframe", "aa.params.kernel=r2",
                                                                                  "aa.params.samples=65536"]}),
    ],
    "highway": [
        ("virtual_texture", "source", {"texture_source: none": ["source.technique=none"],
                                       "texture_source/resident": ["source.technique=resident"],
                                       "texture_source/virtual": []}),
    ],
}


class Line:
    """A graph that takes its turn."""

    def __init__(self, host, name, graph, pass_name, settings):
        self.name, self.pass_name, self.medians, self.own, self.error = name, pass_name, [], [], None
        try:
            self.graph = host.graph(graph, settings)
        except heddle.Error as error:
            self.graph, self.error = None, first_line(error)

    def frames(self, scene, count):
        """Fewer where they take longer than a second together."""
        times = []
        while len(times) < count and sum(times) < 1000:
            times.append(self.frame(scene, False)["submit_ms"])
        return times

    def frame(self, scene, is_profiled):
        self.graph.render(scene, anew=True, profile=is_profiled)
        return self.graph.stats()

    def turn(self, scene, count):
        if self.error is not None:
            return
        try:
            self.medians.append(statistics.median(self.frames(scene, count)))
            if self.pass_name is not None:
                stages = self.frame(scene, True)["stages"]
                self.own.append(sum(stage["wall_ms"] for stage in stages if stage["pass"] == self.pass_name))
        except heddle.Error as error:
            self.error = first_line(error)


def first_line(error):
    return str(error).splitlines()[0]


def measure(scene_name, options):
    with heddle.Host(options.device, log=lambda *_: None) as host:
        scene = host.scene()
        load_scene(scene, str(ROOT / "scripts" / "scenes" / f"{scene_name}.py"), arguments={})
        extent = "extent=[{},{}]".format(*options.extent)
        groups = [[Line(host, name, graph, pass_name, [extent, *settings]) for name, settings in rows.items()]
                  for graph, pass_name, rows in TABLES[scene_name]]
        lines = [line for group in groups for line in group]
        for line in lines:  # compiles, and fills caches of tiles and maps
            if line.error is None:
                line.turn(scene, options.warm_up)
                line.medians.clear()
                line.own.clear()
        chance = random.Random(1)
        for _ in range(options.rounds):
            for line in chance.sample(lines, len(lines)):
                line.turn(scene, options.frames)
        return host.devices(), groups


def interval(values):
    """Where 95 % of the values are, or all of few."""
    ordered, beside = sorted(values), len(values) // 40
    return ordered[beside], ordered[-1 - beside]


def show(scene_name, groups, extent):
    print(f"\n{scene_name}, {extent[0]} x {extent[1]}\n\n| technique | frame, ms | more, ms | its own stages, ms |\n|---|---|---|---|")
    for group in groups:
        for line in group:
            if line.error is not None:
                print(f"| {line.name} | {line.error} | | |")
                continue
            frame, (least, most) = statistics.median(line.medians), interval(line.medians)
            is_compared = line is not group[0] and group[0].error is None
            more = f"{frame - statistics.median(group[0].medians):+.2f}" if is_compared else ""
            own = f"{statistics.median(line.own):.2f}" if line.own else ""
            print(f"| {line.name} | {frame:.2f} ({least:.2f} to {most:.2f}) | {more} | {own} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--extent", type=int, nargs=2, default=(1920, 1080), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--frames", type=int, default=5, help="of a graph's turn")
    parser.add_argument("--warm-up", type=int, default=30, help="frames of each graph before anything is timed")
    parser.add_argument("--device", help="part of its name, or its number")
    parser.add_argument("--only", nargs="+", default=list(TABLES), choices=list(TABLES), metavar="SCENE")
    options = parser.parse_args()
    for scene_name in options.only:
        try:
            devices, groups = measure(scene_name, options)
        except heddle.Error as error:
            sys.exit(f"{scene_name}: {error}")
        if scene_name == options.only[0]:
            print("\n".join(str(each.get("name")) + ", " + str(each.get("driver_version")) for each in devices))
        show(scene_name, groups, options.extent)
        sys.stdout.flush()


if __name__ == "__main__":
    main()
