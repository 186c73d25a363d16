"""How long a picture takes after an edit, through the Python interface: figure `api_edit_ms`, at most 20.

    .venv/bin/python benchmarks/api_edit.py [--scene teatray] [--resolution 512] [--edits 30] [--bounces N]

The edits are those of `app.measure.api_edits`. Prints median and worst, wall time and the processors' time, as JSON.
Run it on a machine that is otherwise idle.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

import insitu
from app.measure.api_edits import edit_times
from app.measure.figures import SPECS


def main() -> None:
    parser = argparse.ArgumentParser(description="Time a picture after an edit through the Python interface.")
    parser.add_argument("--scene", default="teatray")
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--edits", type=int, default=30)
    parser.add_argument("--bounces", type=int)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    scene = insitu.open(options.scene, resolution=(options.resolution, options.resolution))
    wall_ms, cpu_ms = edit_times(scene, options.edits, options.bounces)
    figures = {
        "api_edit_ms": statistics.median(wall_ms),
        "api_edit_worst_ms": max(wall_ms),
        "api_edit_processor_ms": statistics.median(cpu_ms),
        "limit_ms": SPECS["api_edit_ms"].limit,
    }
    text = json.dumps({**figures, "scene": options.scene, "resolution": options.resolution})
    print(text)
    if options.output:
        options.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
