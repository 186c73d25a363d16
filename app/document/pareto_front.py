"""The accuracy front from speed to accuracy, measured: the settings of each mode that no others beat in both.

The table `front.toml` is written by `app.measure.front` and names the source of its numbers. A mode's settings are
fields of `engine.settings.RenderSettings`: they determine the place of the slider, and nothing else is stored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from app.document.view_state import SetView, ViewState
from engine.scene.toml_text import parse_toml

# Settings of precomputation at points, which takes as long for a picture of any size.
POINT_SETTINGS = frozenset({"n_points", "n_rays"})
FRONT_FILE = Path(__file__).with_name("front.toml")


@dataclass(frozen=True)
class FrontPoint:
    """A mode's settings, by name, with their measured error, relative RMS, and the seconds that a
    picture takes."""

    settings: tuple[tuple[str, int], ...]
    error: float
    seconds: float

    def is_set(self, view: ViewState) -> bool:
        """Whether the view has these settings."""
        return all(getattr(view.settings, name) == value for name, value in self.settings)

    @property
    def command(self) -> SetView:
        """The command that sets them."""
        return SetView(self.settings)


@dataclass(frozen=True)
class ParetoFront:
    """The stops of every mode, from the fastest to the most accurate, for pictures of so many pixels; origin: who
    measured them, and with what."""

    origin: str
    n_pixels: int
    points: Mapping[str, tuple[FrontPoint, ...]]

    def position(self, mode: str, view: ViewState) -> float | None:
        """The place of the view's settings, 0 (fastest) to 1 (most accurate); None where they are off the front."""
        stops = self.points[mode]
        return next((i / (len(stops) - 1) for i, stop in enumerate(stops) if stop.is_set(view)), None)

    def nearest_point(self, mode: str, accuracy: float) -> FrontPoint:
        """The stop nearest to a place between 0 and 1."""
        stops = self.points[mode]
        return stops[round(min(max(accuracy, 0.0), 1.0) * (len(stops) - 1))]

    def seconds(self, stop: FrontPoint, n_pixels: int) -> float:
        """The seconds that a picture of so many pixels takes at a stop."""
        if POINT_SETTINGS.intersection(name for name, _ in stop.settings):
            return stop.seconds
        return stop.seconds * max(n_pixels, 1) / self.n_pixels


@cache
def load_front() -> ParetoFront:
    """The table stored beside this file."""
    return parse_front(FRONT_FILE.read_text(encoding="utf-8"))


def parse_front(text: str) -> ParetoFront:
    """The table by its text."""
    table = parse_toml(text, FRONT_FILE.name)
    stops = {mode: tuple(map(_parse_point, rows)) for mode, rows in table["stops"].items()}
    return ParetoFront(table["origin"], table["n_pixels"], stops)


def _parse_point(row: Mapping[str, float]) -> FrontPoint:
    settings = tuple((name, int(value)) for name, value in row.items() if name not in ("error", "seconds"))
    return FrontPoint(settings, row["error"], row["seconds"])


def format_front(origin: str, n_pixels: int, stops: Mapping[str, Sequence[FrontPoint]]) -> str:
    """The text of a table."""
    lines = [f'origin = "{origin}"', f"n_pixels = {n_pixels}"]
    for mode, rows in stops.items():
        for stop in rows:
            lines += ["", f"[[stops.{mode}]]", *(f"{name} = {value}" for name, value in stop.settings)]
            lines += [f"error = {stop.error:.3g}", f"seconds = {stop.seconds:.3g}"]
    return "\n".join(lines) + "\n"
