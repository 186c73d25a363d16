"""The edits of the mix of lights: which are on, how strong they are, colours, groups and what they exclude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

from app.document.document import Document
from app.document.light_mix import lights_of
from app.document.light_state import ENVIRONMENT_KEY, MIX_FIELDS, PLAIN_ROW, RGB, MixRow, group_key, group_of
from engine.core.blackbody import LEAST_KELVIN, MOST_KELVIN
from engine.core.errors import InsituError, list_names
from engine.material.parameters import Parameter, ParameterError

STRENGTH = Parameter(
    "strength",
    "scalar",
    0.0,
    "Strength",
    "Stops by which the light is brighter than it is on its own: one stop doubles it.",
    minimum=-20.0,
    maximum=20.0,
    soft=(-6.0, 6.0),
    form="%+.2f",
)
COLOUR = Parameter(
    "colour",
    "rgb",
    (1.0, 1.0, 1.0),
    "Colour",
    "Multiplies the light, per channel. In place of a temperature.",
    maximum=1000.0,
    step=0.005,
    form="%.3f",
)
KELVIN = Parameter(
    "kelvin",
    "scalar",
    6500.0,
    "Temperature",
    "Colours the light as a black body of this temperature, no brighter: 2,700 K is a bulb, 6,500 K about white.",
    minimum=LEAST_KELVIN,
    maximum=MOST_KELVIN,
    soft=(1700.0, 15000.0),
    logarithmic=True,
    form="%.0f K",
)
MOST_LETTERS = 64


@dataclass(frozen=True)
class SetMix:
    """Set a value of a light's row in the mix, or of a group's, by its key (`app.document.light_state`).

    A colour takes the place of a temperature, and a temperature (0: none) that of a colour. The group of a group is its
    name: another one renames it, "" dissolves it.
    """

    light: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{group_of(self.light) or self.light.removeprefix('light.')} {self.name}"

    def apply(self, document: Document) -> Document:
        light = document.light
        there = dict.fromkeys((*lights_of(document), ENVIRONMENT_KEY, *map(group_key, light.groups)))
        if self.light not in there:
            raise InsituError(f"there is no light {self.light!r}; available: {list_names(there)}")
        row = changed_row(light.row(self.light), self.name, self.value)
        names = [state.name for state in document.objects]
        before = light.row(self.light).excludes  # may have some that the scene no longer has
        if self.name == "excludes" and (unknown := set(row.excludes).difference(names, before)):
            raise InsituError(f"there is no object {min(unknown)!r}; available: {list_names(names)}")
        if self.name == "group" and group_of(self.light):
            return replace(document, light=light.with_renamed_group(group_of(self.light), row.group))
        return replace(document, light=light.with_row(self.light, row))


def changed_row(row: MixRow, name: str, value: Any) -> MixRow:
    """A row with another value. Raises ParameterError for one that it does not accept."""
    match name:
        case "on" | "solo":
            if not isinstance(value, bool):
                raise ParameterError(name, value, "true or false")
            return replace(row, on=value) if name == "on" else replace(row, solo=value)
        case "strength":
            return replace(row, strength=cast(float, STRENGTH.accept(value)))
        case "colour":
            return replace(row, colour=cast(RGB, COLOUR.accept(value)), kelvin=0.0)
        case "kelvin":
            kelvin = 0.0 if value == 0 and not isinstance(value, bool) else cast(float, KELVIN.accept(value))
            return replace(row, colour=PLAIN_ROW.colour, kelvin=kelvin)
        case "group":
            if not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
                raise ParameterError(name, value, f"a name of at most {MOST_LETTERS} letters")
            return replace(row, group=value.strip())
        case "excludes":
            if isinstance(value, str) or not isinstance(value, Sequence) or not all(isinstance(n, str) for n in value):
                raise ParameterError(name, value, "a list of names of objects")
            return replace(row, excludes=tuple(sorted(set(value))))
    raise InsituError(f"a light has no {name!r} in the mix; it has {list_names(MIX_FIELDS)}")
