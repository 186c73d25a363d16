"""The lines of a plan that a person may set, by name, and what to: one table for window, sessions and commands.

"lights", "patches", "sphere", "precision", "bounces", "rays", "edges" are of the whole picture; "teapot.1.theta_h" is
of one curve, by its layer's key and its name: as many bands. What a scene has of them `engine.planner` says. "points"
and
"coefficients" are Orbit's, "transfer_rays" and "lobes" Deform's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from engine.core.errors import InsituError
from engine.scene.description import MAX_BOUNCES

LineValue = int | str

FEWEST_LIGHTS, MOST_LIGHTS = 20, 80_000
# Rays through a pixel at an edge (`engine.scene.edges`); 0: through its centre alone.
EDGE_RAYS = (0, 4, 8, 16)
# Rays of a fan of indirect light.
HEMISPHERE_RAYS = (128, 256, 512, 1024)
# What can be stored: rows of factor A may be long, the runs of factor B are counted in bytes.
MAX_BANDS_OVERRIDDEN = (512, 128)
OFF = "off"


@dataclass(frozen=True)
class _Line:
    """What one may be: expected says it in words."""

    takes: Callable[[LineValue], bool]
    expected: str


def _in_range(least: int, most: int) -> _Line:
    return _Line(
        lambda value: isinstance(value, int) and least <= value <= most, f"a whole number from {least} to {most:,}"
    )


_LINES = {
    "lights": _in_range(FEWEST_LIGHTS, MOST_LIGHTS),
    "patches": _in_range(FEWEST_LIGHTS, MOST_LIGHTS),
    "sphere": _Line(lambda value: value in (0, 1), "0 or 1"),
    "precision": _Line(lambda value: value in ("half", "float"), "half or float"),
    "bounces": _in_range(1, MAX_BOUNCES),
    "rays": _Line(lambda value: value in HEMISPHERE_RAYS, "128, 256, 512 or 1024"),
    "edges": _Line(lambda value: value in EDGE_RAYS, "off, 4, 8 or 16"),
    "points": _in_range(0, 200_000),
    "coefficients": _in_range(20, 1280),
    "transfer_rays": _in_range(32, 20_000),
    "lobes": _in_range(1, 4),
}
PICTURE_LINES = tuple(_LINES)
# Beside bounces, those of the modes whose light hangs on neither lights nor bands.
MODE_LINES = {"orbit": ("points", "coefficients"), "deform": ("transfer_rays", "lobes")}


def checked_line(line: str, value: object) -> LineValue:
    """What one of `PICTURE_LINES` is set to. Raises InsituError for what it cannot be."""
    if line == "edges" and value == OFF:
        return 0
    if isinstance(value, bool) or not isinstance(value, int | str) or not _LINES[line].takes(value):
        raise _line_error(line, value, _LINES[line].expected)
    return value


def checked_bands(line: str, value: object, n_factors: int) -> int:
    """How many bands one of n_factors curves of a layer is set to. Raises InsituError."""
    most = MAX_BANDS_OVERRIDDEN[0] if n_factors == 1 else min(MAX_BANDS_OVERRIDDEN)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most or value & (value - 1):
        raise _line_error(line, value, f"a power of two from 1 to {most}")
    return value


def bands_of_lines(key: str, planned: Mapping[str, int], lines: Mapping[str, LineValue]) -> dict[str, int]:
    """J of each curve of a layer, as planned or as its line has been set: one that another model of the layer was given
    more bands by than this one can have counts for nothing."""
    counts = dict(planned)
    for name in planned:
        with suppress(InsituError):
            counts[name] = checked_bands(name, lines.get(f"{key}.{name}"), len(planned))
    return counts


def _line_error(line: str, value: object, expected: str) -> InsituError:
    return InsituError(f"plan: {line} = {value}, expected {expected}")
