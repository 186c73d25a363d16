"""The edit of the plan: a line overridden by the user, or set back. The meaning of the lines: `engine.planner`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from app.document.document import Document, resolve
from engine.core.errors import InsituError
from engine.plan_lines import PICTURE_LINES, LineValue, bands_of_lines, checked_bands, checked_line

AS_PLANNED = "auto"


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
    if value == AS_PLANNED:
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
