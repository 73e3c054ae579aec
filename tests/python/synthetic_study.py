# SPDX-License-Identifier: Apache-2.0
"""The folder of a study that nobody measured: times and images that are made up, in the files that a study leaves."""

import argparse
import json
import math
import pathlib

import numpy as np

import heddle
from heddle import study as definition
from heddle import study_images as images
from heddle import study_items, study_run


def picture(width, height, channels, scene):
    """float32 (height, width, channels): a smooth picture with edges and highlights, linear radiance from 0 to about 30."""
    y, x = np.mgrid[0:height, 0:width] / max(width, height)
    base = 0.5 + 0.4 * np.sin(9 * x + scene) * np.cos(7 * y * (1 + scene))
    base = np.where((x * 7 + y * 3).astype(int) % 2, base, 0.3 * base)
    spots = 30 * np.exp(-((x - 0.7) ** 2 + (y - 0.2) ** 2) * 900)
    return np.stack([(base * (1 - 0.2 * c) + spots) for c in range(channels)], axis=2).astype(np.float32)


def write_study(folder, explain, variants=30, scenes=5, size=(64, 36), channels=3, rounds=15, title="Thirty of them",
                points=1, lost=(), is_encoded=False):
    """Writes results.json, measured/ and images/ into FOLDER; answers {(scene, point): image}. Variants get slower and
    nearer to the reference; their images are half floats. explain: JSON of a graph; lost: names of points that crashed."""
    folder = pathlib.Path(folder)
    (folder / "measured").mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(1)
    port = "display.color" if is_encoded else "lighting.radiance"
    choices = tuple(definition.SceneChoice("cornell_box.py", f"view{n}", 0.0, ()) for n in range(scenes))
    all_points = tuple(
        definition.Point(f"technique{v:02}", "studio", ("extent=[64,36]", f"ao.params.steps={2 + v}"),
                         (("steps", 2 ** (1 + p)),) if points > 1 else ())
        for v in range(variants) for p in range(points))
    study = definition.Study("synthetic", title, port, "lighting", choices, all_points,
                             definition.Reference("studio", ("extent=[64,36]",), 4), ("rmse", "ssim"), rounds, 3, 1, 0.02, 0.02,
                             30.0, None, "aces", 0)
    made, rows, restless, kept = [], [], {}, {}
    (folder / "measured" / "explained.json").write_text(json.dumps(explain))
    for n, choice in enumerate(choices):
        reference = picture(*size, channels, n).astype(np.float16).astype(np.float32)
        names, errors, state, times = {}, {}, {}, {}
        names[study_run.REFERENCE] = f"reference{n}"
        images.keep(folder, names[study_run.REFERENCE], reference)
        kept[n, study_run.REFERENCE] = reference
        for v, point in enumerate(all_points):
            if point.name in lost:
                state[point.name] = ("crashed", "the process ended by SIGSEGV")
                continue
            state[point.name] = ("ok", "")
            noise = random.standard_normal(reference.shape).astype(np.float32) * np.float32(0.2 / (1 + v))
            image = np.maximum(reference + noise * (0.2 + reference), 0).astype(np.float16).astype(np.float32)
            if is_encoded:
                image = np.clip(image, 0, 1)
            names[point.name] = f"image{n}x{v}"
            images.keep(folder, names[point.name], image)
            kept[n, point.name] = image
            rmse = float(np.sqrt(np.mean((image.astype(np.float64) - reference) ** 2)))
            found = {"rmse": [rmse], "ssim": [1 / (1 + 5 * rmse)]}
            errors[point.name] = {"seeds": found, "parts": {m: [e[0] * f for f in (0.99, 1.0, 1.01, 1.0)] for m, e in found.items()},
                                  "is_random": False, "machine": "m"}
            times[point.name] = math.log(4.0 + 0.5 * v)
        alive = [point for point in all_points if point.name in times]
        turns = []
        for r in range(rounds):
            order = [point.name for point in alive] + [study_run.AGAIN]
            order += order[::-1]
            ms = [[math.exp(times.get(name, times[alive[0].name]) + 0.004 * random.standard_normal() + 0.02 * r)] * 3 for name in order]
            turns.append({"round": r, "order": order, "ms": ms, "processor_ms": [[2 * each for each in turn] for turn in ms]})
        passes = [each["name"] for each in explain["passes"] if not each["is_pruned"]]
        measured = {point.name: {"passes": {name: [0.3 + 0.05 * i + 0.01 * k for k in range(7)] for i, name in enumerate(passes)},
                                 "memory": {"transient_bytes": 123456}, "counters": {"draws": 7},
                                 "machine": "m", "device": {"name": "made up", "driver": "none"}} for point in alive}
        run = argparse.Namespace(
            study=study, scene=choice, state=state, rounds=turns, changing={}, measured=measured, errors=errors, foreign=0.01, reference_size=1.0,
            kept=names, explained={point.name: "explained" for point in alive}, machine="m",
            executor=argparse.Namespace(place=lambda: {"devices": [{"name": "made up"}]}), options=argparse.Namespace(device=None))
        own, restless[choice.name] = study_run.rows_of(run)
        rows += own
        made.append(study_run.made_by(run))
    study_run.mark_front(rows, study.metrics[0])
    report = {"study": definition.dataclasses.asdict(study), "heddle": "0", "machine": study_items.machine(), "restless": restless,
              "false_verdicts": 0.025, "power": 0.99, "command": "heddle study synthetic.toml", "made_by": made,
              "files": {"/nowhere/gtao.so": 64 * "a"}}
    study_run.write_table(folder, study_run.finite(rows), report)
    return kept


def explained():
    """Of the shipped graph with a sky, on a host of its own."""
    with heddle.Host(log=lambda *_: None) as host, host.graph("deferred", ["extent=[64,36]"]) as graph:
        return json.loads(graph.explain("json"))
