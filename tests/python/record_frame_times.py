# SPDX-License-Identifier: Apache-2.0
"""Frame times of this machine for test_statistics.py: record_frame_times.py NAME FRAMES [LOAD] >> frame_times.csv

LOAD processes count meanwhile, on the other processors. A line a trace: name, device, then milliseconds from submission to
fence, one a frame.
"""

import subprocess
import sys

import heddle
from heddle.__main__ import load_scene

name, frames, load = sys.argv[1], int(sys.argv[2]), int((sys.argv[3:] or ["0"])[0])
busy = [subprocess.Popen([sys.executable, "-c", "while True: sum(range(10**6))"]) for _ in range(load)]
try:
    with heddle.Host() as host, host.scene() as scene, host.graph("deferred", ["extent=[96,54]"]) as graph:
        load_scene(scene, "cornell_box.py")
        times = []
        for _ in range(frames + 20):  # the first compile and warm up
            graph.render(scene, anew=True)
            times.append(graph.stats()["submit_ms"])
        print(",".join([name, graph.stats()["device"]["name"].replace(",", ";"), *(f"{ms:.4g}" for ms in times[20:])]))
finally:
    for process in busy:
        process.kill()
