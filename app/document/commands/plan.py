"""Edits of the plan: a line overridden by the user, or set back (the lines: `engine.planner`); and the user's choice of
bands and bounces [BenArtzi07, sect. 5.2], where the plan gives what is not chosen.

J of the first bounce determines the transport, so it is part of the document, and undone; the number of bounces that
are shown and the bands of the second belong to the view.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from app.document.document import Document
from app.document.targets import resolve
from app.document.view_state import SetView
from engine.core.errors import InsituError, LoadError
from engine.settings import PICTURE_LINES, SETTINGS, LineValue, bands_of_lines, checked_bands, checked_line

AUTO = "auto"  # in scripts and command lines: as planned


@dataclass(frozen=True)
class OverrideLine:
    """Set a line of the plan to `value`, None: as planned. A curve's line is its path, "teapot.1.theta_h"."""

    line: str
    value: LineValue | None

    @property
    def label(self) -> str:
        return f"plan: {self.line} {'as planned' if self.value is None else self.value}"

    def apply(self, document: Document) -> Document:
        line, value = self.line, self.value
        if line in PICTURE_LINES:
            value = None if value is None else checked_line(line, value)
        else:
            line, n_factors = _curve(document, line)
            value = None if value is None else checked_bands(line, value, n_factors)
        lines = {name: set_to for name, set_to in document.overrides if name != line}
        if value is not None:
            lines[line] = value
        return replace(document, overrides=tuple(sorted(lines.items())))


def override_from_value(line: str, value: object) -> OverrideLine:
    """The command for a value of a script or a command line: "auto" is as planned."""
    if value == AUTO:
        return OverrideLine(line, None)
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise InsituError(f"plan: {line} = {value}, expected a whole number, or a word")
    return OverrideLine(line, value)


def active_overrides(document: Document) -> dict[str, LineValue]:
    """The overrides of lines that exist: a layer may have got another model since."""
    lines = dict(document.overrides)
    if not lines:
        return {}
    found = {line: value for line, value in lines.items() if line in PICTURE_LINES}
    for key, layer in document.layers():
        none = {factor.name: 0 for factor in layer.model.factors}
        found |= {f"{key}.{name}": n for name, n in bands_of_lines(key, none, lines).items() if n}
    return found


def _curves(document: Document) -> Iterator[str]:
    return (f"{key}.{factor.name}" for key, layer in document.layers() for factor in layer.model.factors)


def _curve(document: Document, path: str) -> tuple[str, int]:
    """The plan's line for a transport curve, and the number of curves of its layer."""
    there = ", ".join((*PICTURE_LINES, *_curves(document)))
    try:
        target = resolve(document, path)
    except InsituError as error:
        raise InsituError(f"the plan has no line {path!r} to override; lines are: {there}") from error
    factors = () if target.key is None else document.layer(target.key).model.factors
    if target.name not in [factor.name for factor in factors]:
        raise InsituError(f"the plan has no line {path!r} to override; lines are: {there}")
    return f"{target.key}.{target.name}", len(factors)


FIRST_BANDS = "series.first"
FirstBands = Literal[1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
FIRST_BANDS_CHOICES: tuple[int, ...] = get_args(FirstBands)


@dataclass(frozen=True)
class SetFirstBands:
    """Choose J, the bands of the sharpest curves at the first bounce from the camera; None: as many as are planned."""

    bands: int | None

    @property
    def label(self) -> str:
        return "bands as planned" if self.bands is None else f"{self.bands} bands at the first bounce"

    def apply(self, document: Document) -> Document:
        return replace(document, first_bands=_checked(self.bands))


def set_first_bands(value: Any) -> SetFirstBands:
    """The command that gives ``series.first`` a value: a number of bands, or "auto"."""
    return SetFirstBands(None if value == AUTO else _checked(value))


def set_series(path: str, value: Any) -> SetView | None:
    """The change of view that gives ``series.bounces`` or ``series.second`` a value; None for any other path.

    Raises LoadError for a value that it cannot have.
    """
    if path == "series.bounces":
        bounces = SETTINGS["n_bounces"]
        if isinstance(value, bool) or value not in bounces.values:
            raise LoadError(path, "value", value, bounces.expected)
        return SetView.of(n_bounces=int(value))
    if path == "series.second":
        choices = SETTINGS["second_bands"].values
        if isinstance(value, bool) or value not in (*choices, "all"):
            raise LoadError(path, "value", value, f"{', '.join(map(str, choices))} or all")
        return SetView.of(second_bands=None if value == "all" else int(value))
    return None


def _checked(bands: Any) -> int | None:
    """The number when it is one of bands, else LoadError."""
    if bands is None:
        return None
    if not isinstance(bands, bool) and bands in FIRST_BANDS_CHOICES:
        return int(bands)
    raise LoadError(FIRST_BANDS, "value", bands, f"one of {', '.join(map(str, FIRST_BANDS_CHOICES))}")
