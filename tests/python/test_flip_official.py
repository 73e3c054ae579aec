# SPDX-License-Identifier: Apache-2.0
"""FLIP against the authors' own implementation, flip-evaluator of PyPI, on 200 generated pairs of odd sizes each."""

import os
import sys

import numpy as np
import pytest
from conftest import ROOT

import heddle

PAIRS = 200
# Their float32 sums run in another order than ours, and powers amplify what differs near 0; their mean is summed in float32.
PIXEL, MEAN = 1e-3, 1e-4


@pytest.fixture(scope="module")
def official():
    os.environ["OMP_NUM_THREADS"] = "1"  # its threads wait for each other at full load: minutes on a busy machine
    sys.path.insert(0, str(ROOT / "build" / "python"))
    try:
        from flip_evaluator import nbflip
    except ImportError as error:
        reason = f"flip-evaluator is not there ({error}): scripts/setup installs it into build/python from PyPI"
        if os.environ.get("HEDDLE_TEST_ALL"):
            pytest.fail(reason)
        pytest.skip(reason)
    finally:
        sys.path.pop(0)
    return nbflip


def picture(rng, width, height):
    """Noise, noise of 8 bits, waves with edges, one colour, or a dark gradient: (height, width, 3), 0 to 1."""
    kind = rng.integers(5)
    y, x = np.mgrid[:height, :width]
    if kind == 2:
        pixels = np.stack([np.sin(0.1 * x) ** 2, np.cos(0.2 * y) ** 2, (x // 7 + y // 5) % 2], -1)
    elif kind == 3:
        pixels = np.broadcast_to(rng.random(3), (height, width, 3))
    elif kind == 4:
        pixels = np.repeat((0.1 * x / width)[..., None], 3, -1)
    else:
        pixels = rng.random((height, width, 3))
        pixels = np.round(255 * pixels) / 255 if kind == 1 else pixels
    return np.ascontiguousarray(pixels, np.float32)


def changed(rng, pixels):
    """Noise of any strength, a shift by a pixel, another picture, or a single pixel that differs."""
    kind = rng.integers(4)
    if kind == 0:
        pixels = pixels + rng.normal(0, 10 ** rng.uniform(-3, 0), pixels.shape)
    elif kind == 1:
        pixels = np.roll(pixels, 1, axis=int(rng.integers(2)))
    elif kind == 2:
        pixels = picture(rng, pixels.shape[1], pixels.shape[0])
    else:
        pixels = pixels.copy()
        pixels[pixels.shape[0] // 2, pixels.shape[1] // 3] = rng.random(3)
    return np.ascontiguousarray(np.clip(pixels, 0, 1), np.float32)


def pairs():
    rng = np.random.default_rng(20200707)
    for _ in range(PAIRS):
        # From one pixel on; far narrower and far wider than the filters, never a multiple of the 16 that are done at a time.
        width, height = (2 * int(rng.integers(0, 64)) + 1 for _ in range(2))
        reference = picture(rng, width, height)
        yield rng, reference, changed(rng, reference)


def worst(ours, theirs, mean):
    theirs = np.asarray(theirs).reshape(ours.shape)
    return float(np.abs(ours - theirs).max()), abs(float(ours.mean(dtype=np.float64)) - mean)


def test_flip_is_the_authors_own(official):
    seen = np.zeros(2)
    for rng, reference, test in pairs():
        ppd = 67.02064 if rng.integers(2) else float(rng.uniform(15, 120))
        theirs, mean, _ = official.evaluate(reference, test, False, True, False, True, {"ppd": ppd})
        ours = heddle.error_image(test, reference, "flip", pixels_per_degree=ppd)[..., 0]
        assert heddle.compare(test, reference, "flip", pixels_per_degree=ppd) == ours.mean(dtype=np.float64)
        seen = np.maximum(seen, worst(ours, theirs, mean))
    print(f"largest difference of a pixel {seen[0]:.2g}, of a mean {seen[1]:.2g}")
    assert seen[0] <= PIXEL and seen[1] <= MEAN


@pytest.mark.parametrize("tone_mapper", ["aces", "hable", "reinhard"])
def test_hdr_flip_is_the_authors_own(official, tone_mapper):
    seen = np.zeros(2)
    for i, (rng, reference, test) in enumerate(pairs()):
        if i % 3 != heddle.comparison.TONE_MAPPERS.index(tone_mapper):
            continue
        scale = np.float32(2 ** rng.uniform(-8, 8))
        reference, test = scale * (reference + np.float32(1e-3)), scale * test
        wanted = {"tonemapper": tone_mapper}
        exposures = None
        if rng.integers(2):  # fixed by the study, else from the reference
            exposures = (-3.0, 2.5, 5)
            wanted |= {"startExposure": -3.0, "stopExposure": 2.5, "numExposures": 5}
        theirs, mean, used = official.evaluate(reference, test, True, False, False, True, wanted)
        ours = heddle.error_image(test, reference, "hdr_flip", exposures=exposures, tone_mapper=tone_mapper)[..., 0]
        described = heddle.compare(test, reference, ["hdr_flip"], exposures=exposures, tone_mapper=tone_mapper)["hdr_flip"]
        assert described["exposures"] == used["numExposures"]
        assert described["start_exposure"] == pytest.approx(used["startExposure"], abs=1e-4)
        assert described["stop_exposure"] == pytest.approx(used["stopExposure"], abs=1e-4)
        seen = np.maximum(seen, worst(ours, theirs, mean))
    print(f"largest difference of a pixel {seen[0]:.2g}, of a mean {seen[1]:.2g}")
    assert seen[0] <= PIXEL and seen[1] <= MEAN
