"""How long a picture takes after an edit, through the Python interface.

Each edit sets one operator of the sharpest curve of the scene's first layer that is not Lambertian to other regions and
another height, as a drag does, and asks for the picture. The first edits, which make the planes of transport along that
curve, are left out.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from app.interface import Curve, Operator, Scene
from app.interface import open as open_scene
from app.measure.figures import Figure, not_measured
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
