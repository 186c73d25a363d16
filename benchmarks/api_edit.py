"""How long a picture takes after an edit, through the Python interface: figure `api_edit_ms`, at most 20.

    .venv/bin/python -m benchmarks.api_edit [--scene teatray] [--resolution 512] [--edits 30] [--bounces N]

prints median and worst, wall time and the processors' time, as JSON. Run it on a machine that is otherwise idle.

Each edit sets one operator of the sharpest curve of the scene's first layer that is not Lambertian to other regions and
another height, as a drag does, and asks for the picture. The first edits, which make the planes of transport along that
curve, are left out.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.interface import Curve, Operator, Scene
from app.interface import open as open_scene
from benchmarks.figures import SPECS, Figure, not_measured
from engine.scene.builtin import DEFAULT_SCENE

_N_SKIPPED = 2


@dataclass(frozen=True)
class ApiEditEffort:
    """The picture (width, height), and edits that are timed."""

    resolution: tuple[int, int] = (512, 512)
    n_edits: int = 30


def api_edit_figures(effort: ApiEditEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """The figure `api_edit_ms`, after one bounce; None: left out."""
    if effort is None:
        return [not_measured("api_edit_ms", "left out of a quick run")]
    report("edits through the Python interface")
    wall_ms, cpu_ms = edit_times(open_scene(DEFAULT_SCENE, resolution=effort.resolution), effort.n_edits, 1)
    size = "{} × {}".format(*effort.resolution)
    return [
        Figure(
            "api_edit_ms", wall_ms, f"{DEFAULT_SCENE} at {size}, 1 bounce: from an edit of a curve to its picture",
            {"processor_ms": statistics.median(cpu_ms)},
        )
    ]  # fmt: skip


def edit_times(scene: Scene, n_edits: int, n_bounces: int | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Milliseconds that edit and picture take together, of each edit: wall time, and the processors' time."""
    curve = _edited_curve(scene)
    scene.image(bounces=n_bounces)
    wall_ms, cpu_ms = [], []
    for i in range(n_edits + _N_SKIPPED):
        started, before = time.perf_counter(), time.process_time()
        reach = 0.1 + 0.02 * (i % 12)
        curve.operators = [Operator("amplify", "y", 0.0, 0.0, reach, reach + 0.3, 1.1 + 0.05 * (i % 7))]
        scene.image(bounces=n_bounces)
        wall_ms.append(1e3 * (time.perf_counter() - started))
        cpu_ms.append(1e3 * (time.process_time() - before))
    return tuple(wall_ms[_N_SKIPPED:]), tuple(cpu_ms[_N_SKIPPED:])


def _edited_curve(scene: Scene) -> Curve:
    """The first of the first layer with gloss, else of the first layer."""
    layers = [scene[name][layer] for name in scene for layer in scene[name]]
    layer = next((each for each in layers if each.model != "lambert"), layers[0])
    return layer[next(iter(layer))]


def main() -> None:
    parser = argparse.ArgumentParser(description="Time a picture after an edit through the Python interface.")
    parser.add_argument("--scene", default="teatray")
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--edits", type=int, default=30)
    parser.add_argument("--bounces", type=int)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    scene = open_scene(options.scene, resolution=(options.resolution, options.resolution))
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
