"""The named figures of `make measure`: what each is, its limit, and its values with their spread.

A figure is made of samples, one a repetition; its value is their median, or the worst of them where the promise says
"always". A figure that could not be measured stands there all the same, with the reason in place of the value.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from app.system.atomic import save_file
from engine.core.errors import InsituError


@dataclass(frozen=True)
class Spec:
    """What a figure is: its unit, the largest value that meets the promise, or the least where more is better (None: no
    promise), how samples combine."""

    unit: str
    limit: float | None = None
    combine: Literal["median", "worst"] = "median"
    more_is_better: bool = False


BRUTE = "of brute-force shadow rays"
SPECS: dict[str, Spec] = {
    "precompute_ratio_4000": Spec(BRUTE, 1.0),
    "precompute_ratio_400": Spec(BRUTE, 0.15),
    "visibility_ratio": Spec(BRUTE, 0.15, "worst"),
    "visibility_wrong": Spec("of answers above the horizon", 2e-4, "worst"),
    "edit_ms_30": Spec("ms", 33.0),
    "edit_ms_128": Spec("ms", 100.0),
    "exact_ms": Spec("ms", 300.0),
    "api_edit_ms": Spec("ms", 20.0),
    "curve_switch_s": Spec("s", 0.2, "worst"),
    "window_s": Spec("s", 1.5, "worst"),
    "first_picture_s": Spec("s", 3.0),
    "worst_stall_ms": Spec("ms", 50.0, "worst"),
    "transport_mb": Spec("MB", 250.0),
    # Of indirect light:
    "freeze_s_cornell": Spec("s", 0.25, "worst"),
    "freeze_s_room": Spec("s", 0.5, "worst"),
    "gi_edit_ms": Spec("ms", 33.0),
    "gi_memory_mb_cornell": Spec("MB", 300.0),
    "gi_memory_growth": Spec("of linear growth from the fewest objects", 1.0, "worst"),
    "gi_first_s": Spec("s", 5.0),
    "gi_first_error": Spec("relRMSE", 0.15, "worst"),
    "gi_error_cornell": Spec("relRMSE", 0.03),
    "gi_mean_cornell": Spec("relative difference of means", 0.01),
    "gi_error_teatray": Spec("relRMSE", 0.03),
    "gi_mean_teatray": Spec("relative difference of means", 0.01),
    "gi_precompute_ratio_peer": Spec("of one path-traced still of equal error", 0.25),
    # Beside the promised names:
    "gi_error_8_cornell": Spec("relRMSE", 0.02),
    "gi_error_8_teatray": Spec("relRMSE", 0.02),
    "first_picture_cold_s": Spec("s", 20.0),
    "exact_picture_s": Spec("s"),
    "brute_force_s": Spec("s"),
    "rays_per_s": Spec("rays/s"),
    "oracle_error": Spec("relRMSE", 0.005),
    "oracle_mean": Spec("relative difference of means", 0.005),
    "reference_error": Spec("relRMSE", 0.02, "worst"),
    "reference_mean": Spec("relative difference of means", 0.005, "worst"),
}
_OF_A_ROOM = {"direct_error": 0.015, "direct_mean": 0.003, "error": 0.02, "mean": 0.005}
SPECS |= {
    f"room_{kind}_{room}": Spec("relRMSE" if kind.endswith("error") else "relative difference of means", limit)
    for room in ("stairwell", "ajar", "storeroom")
    for kind, limit in _OF_A_ROOM.items()
}
SPECS |= {name: Spec("relRMSE", 0.05) for name in ("room_gloss_direct_error", "room_gloss_error")}
SPECS |= {f"edge_error_{name}": Spec("relRMSE", 0.025) for name in ("teatray", "bunny")}
SPECS |= {f"edge_cost_{name}": Spec("of transport without edges", 1.5) for name in ("teatray", "bunny")}
SPECS |= {
    "orbit_error_teatray_320": Spec("relRMSE", 0.06),
    "orbit_error_bunny_320": Spec("relRMSE", 0.06),
    "orbit_rest_error_teatray": Spec("relRMSE", 0.04),
    "orbit_rest_error_bunny": Spec("relRMSE", 0.025),
    "orbit_fps_moving": Spec("frames/s", 20.0, more_is_better=True),
    "orbit_fps_gpu": Spec("frames/s", 100.0, more_is_better=True),
    "orbit_rest_s": Spec("s", 0.35),
    "orbit_edit_s": Spec("s", 0.4),
    "orbit_placing_s": Spec("s", 2.0),
    "orbit_precompute_s": Spec("s", 30.0),
    "orbit_turn_stall_ms": Spec("ms", 50.0, "worst"),
    "turn_error": Spec("relRMSE", 0.1),
    "turn_cpu_s": Spec("s"),
    "relight_rows_s": Spec("s"),
    **{
        f"drag_{kind}_{name}": Spec("relRMSE", 0.05, "worst")
        for kind in ("error", "indirect_error")
        for name in ("room", "vase", "teatray")
    },
    "drag_jump": Spec("of 255, mean over the picture", 2.0, "worst"),
    "drag_step_s": Spec("s"),
    "mix_ms_8": Spec("ms", 16.0),
    "mix_ms_64": Spec("ms", 33.0),
    "mix_error": Spec("relRMSE", 0.005, "worst"),
    "light_drag_first_ms": Spec("ms", 200.0),
    "light_drag_exact_s": Spec("s", 2.0),
    "move_first_s": Spec("s", 1.0),
    "inverse_ms": Spec("ms", 100.0),
    "inverse_curve_error": Spec("relRMSE", 0.02, "worst"),
    "photo_curve_error": Spec("relRMSE", 0.05, "worst"),
    "photo_relight_error": Spec("relRMSE", 0.05, "worst"),
    # Of objects that are dragged in Orbit:
    "orbit_move_ms": Spec("ms"),
    "orbit_move_ratio": Spec("of preparing all"),
    "orbit_move_share": Spec("of all points"),
    "zh_error_random_6": Spec("RMS", 0.00908),
    "zh_error_mesh_3": Spec("RMS", 0.045),
    "zh_fit_s": Spec("s", 60.0),
    "deform_fps": Spec("frames/s", 60.0, more_is_better=True),
    "deform_fps_gpu": Spec("frames/s", 500.0, more_is_better=True),
    "deform_error_bent": Spec("relRMSE", 0.1),
    "deform_error_undeformed": Spec("relRMSE", None),
    "deform_lamp_ms": Spec("ms"),
    "deform_lamp_ratio": Spec("of tracing its light"),
    "deform_lamp_error": Spec("relRMSE", None),
    "deform_painted_ms": Spec("ms"),
}


class NotMeasured(InsituError):
    """A figure cannot be measured here; the message says why."""


@dataclass(frozen=True)
class Figure:
    """One measured number. samples: one a repetition, empty where it could not be measured; how: in words.

    parts: what else belongs to it, by name (one scene each, the seconds it is made of, ...).
    """

    name: str
    samples: tuple[float, ...]
    how: str
    parts: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.name not in SPECS:
            raise ValueError(f"figure {self.name!r} has no entry in SPECS")
        if not all(math.isfinite(sample) for sample in self.samples):
            raise ValueError(f"{self.name}: samples {self.samples}, expected finite numbers")

    @property
    def spec(self) -> Spec:
        return SPECS[self.name]

    @property
    def value(self) -> float | None:
        """The samples as one number; None where there are none."""
        if not self.samples:
            return None
        return max(self.samples) if self.spec.combine == "worst" else statistics.median(self.samples)

    @property
    def met(self) -> bool | None:
        """Whether the limit is kept; None where there is no limit or no value."""
        if self.value is None or self.spec.limit is None:
            return None
        return self.value >= self.spec.limit if self.spec.more_is_better else self.value <= self.spec.limit

    def as_json(self) -> dict[str, Any]:
        """The figure as it stands in figures.json."""
        spread: dict[str, float | None] = {"min": None, "median": None, "max": None}
        if self.samples:
            spread = {
                "min": min(self.samples),
                "median": statistics.median(self.samples),
                "max": max(self.samples),
            }
        return {
            "value": self.value,
            "limit": self.spec.limit,
            "met": self.met,
            "unit": self.spec.unit,
            "spread": spread,
            "repetitions": len(self.samples),
            "how": self.how,
            "parts": dict(self.parts),
        }


def not_measured(name: str, reason: str) -> Figure:
    """A figure without a value."""
    return Figure(name, (), f"not measured: {reason}")


def write_figures(file: Path, figures: Sequence[Figure], facts: Mapping[str, Any]) -> None:
    """Write figures by name, and the facts of the run and the machine beside them, as JSON."""
    content = {figure.name: figure.as_json() for figure in figures} | dict(facts)
    save_file(file, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())


def summary_lines(figures: Sequence[Figure]) -> list[str]:
    """One line a figure, for the terminal: value, spread, limit, whether it is kept."""
    lines = []
    for figure in figures:
        if figure.value is None:
            lines.append(f"{figure.name:24s} {figure.how}")
            continue
        limit = "" if figure.spec.limit is None else f"  limit {figure.spec.limit:g}"
        verdict = {True: "  met", False: "  NOT met", None: ""}[figure.met]
        spread = f"({min(figure.samples):.4g} to {max(figure.samples):.4g})"
        lines.append(f"{figure.name:24s} {figure.value:10.4g} {figure.spec.unit} {spread}{limit}{verdict}")
    return lines
