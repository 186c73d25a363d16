"""The figures of a light that is dragged in the window, direct and indirect light together."""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.launches import measure_dragged_light

# By scene: degrees by which its sky turns, and factors on its emitters.
DRAGS = {"room": ((5.0, 30.0), ()), "vase": ((), (0.5, 0.1)), "teatray": ((5.0, 77.0), ())}
NAMES = (*(f"drag_{kind}_{name}" for name in DRAGS for kind in ("error", "indirect_error")), "drag_jump", "drag_step_s")


@dataclass(frozen=True)
class DragEffort:
    """The picture, bounces, and the longest that a scene may take."""

    resolution: tuple[int, int] = (192, 144)
    n_bounces: int = 4
    timeout_s: float = 1800.0


def drag_figures(effort: DragEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    size = "{}x{}".format(*effort.resolution)
    how = f"{size}, {effort.n_bounces} bounces: the last picture of a drag"
    figures, jumps, seconds = list[Figure](), dict[str, float](), dict[str, float]()
    for name, (turns, dims) in DRAGS.items():
        report(f"a dragged light: {name}")
        figure = f"drag_error_{name}"
        try:
            with tempfile.TemporaryDirectory(prefix="insitu-drag-") as folder:
                found = measure_dragged_light(
                    name, effort.resolution, effort.n_bounces, turns, dims, Path(folder), effort.timeout_s
                )
        except NotMeasured as error:
            figures += [not_measured(each, str(error)) for each in (figure, f"drag_indirect_error_{name}")]
            continue
        errors = {drag: each["error"] for drag, each in found.items()}
        figures.append(Figure(figure, tuple(errors.values()), f"{how} against the exact one", errors))
        errors = {drag: each["indirect"] for drag, each in found.items()}
        how_far = f"{how}, its indirect light over the exact direct light, against the exact one"
        figures.append(Figure(f"drag_indirect_error_{name}", tuple(errors.values()), how_far, errors))
        jumps |= {f"{name}, {drag}": each["jump"] for drag, each in found.items()}
        seconds |= {f"{name}, {drag}": each["step_s"] for drag, each in found.items()}
    if not jumps:
        return figures + [not_measured(name, "no drag was measured") for name in NAMES[-2:]]
    how_far = f"{how} and the exact one: mean difference of what the screen shows"
    median = statistics.median(seconds.values())
    return [
        *figures,
        Figure("drag_jump", tuple(jumps.values()), how_far, jumps),
        Figure("drag_step_s", (median,), f"{size}: from an angle to its picture, the median of all drags", seconds),
    ]
