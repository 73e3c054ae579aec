# SPDX-License-Identifier: Apache-2.0
"""How much error does a millisecond buy? Two techniques of ambient occlusion over their knobs, against the reference.

Runs as a script, and cell by cell in editors that know `# %%` (VS Code, Spyder, PyCharm, Jupyter with jupytext):

    PYTHONPATH=scripts python3 scripts/examples/compare_occlusion.py --folder out

Writes into the folder: the frame as each technique makes it at its most accurate, what it made of the occlusion, the
table occlusion.csv, and with matplotlib the plot occlusion.png: error over time, a curve a technique.
"""

# %% What is compared. Cells below read nothing but these.
import argparse
import csv
import itertools
import pathlib
import statistics
import sys

import numpy as np

import heddle
from heddle.__main__ import load_scene

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--scene", default="atrium.py", help="a scene of scripts/scenes, a Python file or a glTF file")
parser.add_argument("--techniques", default="gtao,ray_traced", help="of the role ambient_occlusion, separated by commas")
parser.add_argument("--extent", default="320,180", help="pixels")
parser.add_argument("--repeats", type=int, default=5, help="frames that are timed for each setting")
parser.add_argument("--steps", type=int, default=4, help="values of each knob, the first of its ladder")
parser.add_argument("--reference-samples", type=int, default=1024, help="rays a pixel of the reference")
parser.add_argument("--folder", default="out", type=pathlib.Path)
# A notebook's kernel has arguments of its own.
options, _ = parser.parse_known_args()
ROLE, PASS, PORT = "ambient_occlusion", "ao", "ao.visibility"
techniques = options.techniques.split(",")
options.folder.mkdir(parents=True, exist_ok=True)

# %% Host, scene and graph stay open for all that follows: in a notebook, run on from here as often as you like.
host = heddle.Host()
scene = host.scene()
load_scene(scene, options.scene)
graph = host.graph("deferred", [f"extent=[{options.extent}]"])
graph.keep(PORT)

listed = host.list()
known = {each["name"]: each for each in listed["techniques"] if each["role"] == ROLE}
role = next(each for each in listed["roles"] if each["name"] == ROLE)
for name in techniques:
    if name not in known:
        sys.exit(f"error: role '{ROLE}' has no technique '{name}'\n  expected: one of {', '.join(known)}")

# %% The reference: the role names it. Its rays start from another seed than its rival's, so that noise is not compared
# with itself.
reference_technique = role["references"]["same_model"]["technique"].split("/")[1]
graph.swap(PASS, reference_technique)
graph.set(f"{PASS}.params.samples", options.reference_samples)
graph.render(scene, seed=1)
reference = graph.read(PORT)
print(f"reference: {reference_technique} with {options.reference_samples} rays a pixel, "
      f"mean visibility {reference.mean():.4f}")

# %% Every technique over the ladder of its knobs, cheapest first: all combinations of as many values as asked for.
def settings_of(technique: dict) -> list[dict]:
    """[{knob: value}] from cheap to accurate: the i-th value of every ladder together."""
    ladders = {each["name"]: each["ladder"] for each in technique["parameters"] if each["ladder"]}
    rungs = itertools.zip_longest(*ladders.values())
    chosen, last = [], {}
    for rung in itertools.islice(rungs, options.steps):
        last = {name: value if value is not None else last[name] for name, value in zip(ladders, rung)}
        chosen.append({name: int(value) if value == int(value) else value for name, value in last.items()})
    return chosen


def measure(name: str, setting: dict) -> dict:
    """Renders with a technique and a setting: {"technique", "setting", "rmse", "ms" of the pass alone, median}."""
    graph.swap(PASS, name)
    for knob, value in setting.items():
        graph.set(f"{PASS}.params.{knob}", value)
    graph.render(scene)  # compiles: not timed
    times = []
    for _ in range(options.repeats):
        graph.render(scene, profile=True)
        times.append(sum(stage["wall_ms"] for stage in graph.stats()["stages"] if stage["pass"] == PASS))
    error = host.compare(graph.read(PORT), reference)["rmse"]
    return {"technique": name, "setting": " ".join(f"{k}={v}" for k, v in setting.items()), "rmse": error,
            "ms": statistics.median(times)}


rows = []
for name in techniques:
    for setting in settings_of(known[name]):
        rows.append(measure(name, setting))
        print("{technique:<12} {setting:<28} rmse {rmse:.5f} {ms:10.2f} ms".format(**rows[-1]))
    host.write_image(options.folder / f"occlusion_{name}.png", graph.read())
    host.write_image(options.folder / f"occlusion_{name}_visibility.png", graph.read(PORT))

# %% The table, and which settings no other one beats in both.
with open(options.folder / "occlusion.csv", "w", newline="") as file:
    writer = csv.DictWriter(file, fieldnames=list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
front = [row for row in rows
         if not any(other["rmse"] <= row["rmse"] and other["ms"] < row["ms"] for other in rows)]
print("not beaten: " + "; ".join(f"{row['technique']} {row['setting']}" for row in front))

# %% Error over time.
try:
    import matplotlib

    if not hasattr(sys, "ps1"):
        matplotlib.use("Agg")
    import matplotlib.pyplot as plt
except ImportError:
    print("matplotlib is not installed, so there is no plot; the numbers are in "
          f"{options.folder / 'occlusion.csv'}\n  help: on Debian, apt-get install python3-matplotlib")
else:
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name in techniques:
        own = [row for row in rows if row["technique"] == name]
        knobs = [word.split("=") for word in own[0]["setting"].split()]
        axes.plot([row["ms"] for row in own], [row["rmse"] for row in own], "o-",
                  label=f"{name} ({', '.join(knob for knob, _ in knobs)})")
        for i, row in enumerate(own):  # the knobs' values; above and below in turns, for what lies close together
            values = ", ".join(word.split("=")[1] for word in row["setting"].split())
            axes.annotate(values, (row["ms"], row["rmse"]), textcoords="offset points", ha="center",
                          xytext=(0, 7 if i % 2 == 0 else -14), fontsize=8)
    axes.set(xscale="log", yscale="log", xlabel="time of the pass, ms (median)",
             ylabel=f"RMSE of visibility against {reference_technique}, {options.reference_samples} rays",
             title=f"Ambient occlusion, {pathlib.Path(options.scene).stem}, {'x'.join(map(str, reference.shape[1::-1]))}")
    axes.grid(True, which="both", alpha=0.3)
    axes.margins(0.15)
    axes.legend()
    figure.savefig(options.folder / "occlusion.png", dpi=120)
    print(f"wrote {options.folder / 'occlusion.png'}")

# %% Done: everything that the host made goes with it.
host.close()
