# SPDX-License-Identifier: Apache-2.0
"""The authors' FLIP for `heddle bench compare`: official_flip.py PACKAGES FILE WIDTH HEIGHT.

FILE holds the reference and the test, float32 RGB. Says "ready", then for each line read how many milliseconds it took and
the mean.
"""
import sys
import time

packages, file, width, height = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
sys.path.insert(0, packages)
try:
    import numpy
    from flip_evaluator import nbflip
except ImportError as error:
    sys.exit(f"{error}; scripts/setup installs it into {packages}")

reference, test = numpy.fromfile(file, numpy.float32).reshape(2, height, width, 3)
print("ready", flush=True)
for _ in sys.stdin:
    begun = time.perf_counter()
    _, mean, _ = nbflip.evaluate(reference, test, False, True, False, True, {})
    print(1e3 * (time.perf_counter() - begun), mean, flush=True)
