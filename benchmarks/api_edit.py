"""How long a picture takes after an edit, through the Python interface: figure `api_edit_ms`, at most 20.

    .venv/bin/python benchmarks/api_edit.py [--scene teatray] [--resolution 512] [--edits 30] [--bounces N]

Each edit sets one operator of the sharpest curve of the scene's glossiest layer to other regions and another height, as
a drag does, and asks for the picture. The first edits, which make the planes of transport along that curve, are left
out. Prints median and worst, wall time and the processors' time, as JSON. Run it on a machine that is otherwise idle.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import insitu

LIMIT_MS = 20.0
SKIPPED = 2


def measure(scene: insitu.Scene, n_edits: int, bounces: int | None) -> dict[str, float]:
    """Milliseconds of edit and picture together."""
    layers = [scene[name][layer] for name in scene for layer in scene[name]]
    curves = [layer[factor] for layer in layers for factor in layer if layer.model != "lambert"]
    curve = curves[0]
    scene.image(bounces=bounces)
    wall, processors = [], []
    for i in range(n_edits + SKIPPED):
        started, before = time.perf_counter(), time.process_time()
        reach = 0.1 + 0.02 * (i % 12)
        curve.operators = [insitu.Operator("amplify", "y", 0.0, 0.0, reach, reach + 0.3, 1.1 + 0.05 * (i % 7))]
        scene.image(bounces=bounces)
        wall.append(1e3 * (time.perf_counter() - started))
        processors.append(1e3 * (time.process_time() - before))
    wall, processors = wall[SKIPPED:], processors[SKIPPED:]
    return {
        "api_edit_ms": statistics.median(wall),
        "api_edit_worst_ms": max(wall),
        "api_edit_processor_ms": statistics.median(processors),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Time a picture after an edit through the Python interface.")
    parser.add_argument("--scene", default="teatray")
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--edits", type=int, default=30)
    parser.add_argument("--bounces", type=int)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    scene = insitu.open(options.scene, resolution=(options.resolution, options.resolution))
    figures = measure(scene, options.edits, options.bounces)
    text = json.dumps({**figures, "limit_ms": LIMIT_MS, "scene": options.scene, "resolution": options.resolution})
    print(text)
    if options.output:
        options.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
