"""From speed to accuracy along what was measured: the settings of each mode's knobs that nothing beats in both.

The table `front.toml` is written by `app.measure.front` and says where its numbers are from. A mode's knobs are
fields of the view: where they stand says where the slider does, and nothing else is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from app.document.view_state import SetView, ViewState
from engine.scene.toml_text import parse_toml

# Knobs of what is made ready at points, which takes as long for a picture of any size.
POINT_SETTINGS = frozenset({"n_points", "n_rays"})
FRONT_FILE = Path(__file__).with_name("front.toml")


@dataclass(frozen=True)
class FrontPoint:
    """A setting of a mode's knobs, fields of the view by name, with the error it was measured to have, relative RMS,
    and the seconds that a picture takes."""

    knobs: tuple[tuple[str, int], ...]
    error: float
    seconds: float

    def is_set(self, view: ViewState) -> bool:
        """Whether the view's knobs stand like this."""
        return all(getattr(view, name) == value for name, value in self.knobs)

    @property
    def command(self) -> SetView:
        """What sets them so."""
        return SetView(self.knobs)


@dataclass(frozen=True)
class ParetoFront:
    """The stops of every mode, from the quickest to the truest, of pictures of so many pixels; origin: who measured
    them, and of what."""

    origin: str
    n_pixels: int
    points: Mapping[str, tuple[FrontPoint, ...]]

    def position(self, mode: str, view: ViewState) -> float | None:
        """Where the view's knobs stand, 0 (quickest) to 1 (truest); None where that is not on the front."""
        stops = self.points[mode]
        return next((i / (len(stops) - 1) for i, stop in enumerate(stops) if stop.is_set(view)), None)

    def nearest_point(self, mode: str, accuracy: float) -> FrontPoint:
        """The stop next to a place between 0 and 1."""
        stops = self.points[mode]
        return stops[round(min(max(accuracy, 0.0), 1.0) * (len(stops) - 1))]

    def seconds(self, stop: FrontPoint, n_pixels: int) -> float:
        """That a picture of so many pixels takes at a stop."""
        if POINT_SETTINGS.intersection(name for name, _ in stop.knobs):
            return stop.seconds
        return stop.seconds * max(n_pixels, 1) / self.n_pixels


@cache
def load_front() -> ParetoFront:
    """The table as it is kept beside this file."""
    return parse_front(FRONT_FILE.read_text(encoding="utf-8"))


def parse_front(text: str) -> ParetoFront:
    """The table by its text."""
    table = parse_toml(text, FRONT_FILE.name)
    stops = {mode: tuple(map(_parse_point, rows)) for mode, rows in table["stops"].items()}
    return ParetoFront(table["origin"], table["n_pixels"], stops)


def _parse_point(row: Mapping[str, float]) -> FrontPoint:
    knobs = tuple((name, int(value)) for name, value in row.items() if name not in ("error", "seconds"))
    return FrontPoint(knobs, row["error"], row["seconds"])


def format_front(origin: str, n_pixels: int, stops: Mapping[str, Sequence[FrontPoint]]) -> str:
    """The text of a table."""
    lines = [f'origin = "{origin}"', f"n_pixels = {n_pixels}"]
    for mode, rows in stops.items():
        for stop in rows:
            lines += ["", f"[[stops.{mode}]]", *(f"{name} = {value}" for name, value in stop.knobs)]
            lines += [f"error = {stop.error:.3g}", f"seconds = {stop.seconds:.3g}"]
    return "\n".join(lines) + "\n"
