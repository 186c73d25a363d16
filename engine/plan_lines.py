"""The lines of a plan that the user may set, by name, with their values: one table for window, sessions and commands.

"lights", "patches", "sphere", "precision", "bounces", "rays" and "edges" apply to the whole picture. "teapot.1.theta_h"
is the number of bands of one curve, by its layer's key and its name. `engine.planner` determines which of them a scene
has. "points" and "coefficients" belong to Orbit, "transfer_rays" and "lobes" to Deform.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from engine.core.errors import InsituError
from engine.scene.description import MAX_BOUNCES

LineValue = int | str

FEWEST_LIGHTS, MOST_LIGHTS = 20, 80_000
# Rays through a pixel at an edge (`engine.scene.edges`); 0: only through its centre.
EDGE_RAYS = (0, 4, 8, 16)
# Rays per sample set of indirect light.
HEMISPHERE_RAYS = (128, 256, 512, 1024)
# Limits of the storage: rows of factor A may be long, the runs of factor B are counted in bytes.
MAX_BANDS_OVERRIDDEN = (512, 128)
OFF = "off"


@dataclass(frozen=True)
class _Line:
    """Validates one line; expected: a description of valid values."""

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
# Besides bounces, the lines of the modes whose light depends on neither lights nor bands.
MODE_LINES = {"orbit": ("points", "coefficients"), "deform": ("transfer_rays", "lobes")}


def checked_line(line: str, value: object) -> LineValue:
    """The value for one of `PICTURE_LINES`. Raises InsituError for an invalid value."""
    if line == "edges" and value == OFF:
        return 0
    if isinstance(value, bool) or not isinstance(value, int | str) or not _LINES[line].takes(value):
        raise _line_error(line, value, _LINES[line].expected)
    return value


def checked_bands(line: str, value: object, n_factors: int) -> int:
    """The number of bands for one of n_factors curves of a layer. Raises InsituError."""
    most = MAX_BANDS_OVERRIDDEN[0] if n_factors == 1 else min(MAX_BANDS_OVERRIDDEN)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most or value & (value - 1):
        raise _line_error(line, value, f"a power of two from 1 to {most}")
    return value


def bands_of_lines(key: str, planned: Mapping[str, int], lines: Mapping[str, LineValue]) -> dict[str, int]:
    """J of each curve of a layer, as planned or as overridden. Ignores a line with more bands than this model permits,
    which was set for another model of the layer."""
    counts = dict(planned)
    for name in planned:
        with suppress(InsituError):
            counts[name] = checked_bands(name, lines.get(f"{key}.{name}"), len(planned))
    return counts


def _line_error(line: str, value: object, expected: str) -> InsituError:
    return InsituError(f"plan: {line} = {value}, expected {expected}")
