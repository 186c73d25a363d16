"""The edits of painted lights: what is painted onto the environment, in which order, where and how bright."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from numpy.typing import ArrayLike

from app.document.document import Document
from app.document.light_state import LightState, painted_key
from app.document.painted_parameters import FILE, TITLES, changed_painted, new_painted
from app.document.scene_objects import numbered_name
from app.document.targets import PLACE, check_presence
from app.system.paths import full_path
from engine.core.errors import InsituError, LoadError, list_names
from engine.core.safe_files import resolved
from engine.light.painted_lights import PAINTED_KINDS, PaintedKind, angles_in_environment
from engine.material.parameters import ParameterError
from engine.scene.description import valid_name

MAX_PAINTED = 64


@dataclass(frozen=True)
class AddPainted:
    """Paint another light over all others. name: "" for that of its kind; values: of its parameters, and of an image
    its `file`."""

    kind: PaintedKind
    name: str = ""
    values: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        return f"paint {self.name or TITLES.get(self.kind, self.kind).lower()}"

    def apply(self, document: Document) -> Document:
        light, values = document.light, dict(self.values)
        if len(light.painted) >= MAX_PAINTED:
            raise InsituError(f"there are {MAX_PAINTED} painted lights already, which is the most")
        taken = {each.name for each in light.painted}
        if self.name in taken:
            raise InsituError(f"there is a painted light {self.name!r} already; name another")
        own = Path(str(values.get(FILE, ""))).stem if self.kind == "image" else TITLES.get(self.kind, self.kind)
        painted = new_painted(self.kind, self.name or _free_name(own, taken), values)
        return replace(document, light=replace(light, painted=(*light.painted, painted)))


@dataclass(frozen=True)
class SetPainted:
    """Set values of a painted light: of its parameters, its `name`, its `position` in the list (0 is painted first), or
    an image's `file`."""

    light: str
    values: tuple[tuple[str, Any], ...]

    @classmethod
    def of(cls, light: str, name: str, value: Any) -> SetPainted:
        """Set a single one."""
        return cls(light, ((name, value),))

    @property
    def label(self) -> str:
        return f"{self.light} {', '.join(name for name, _ in self.values)}"

    def apply(self, document: Document) -> Document:
        light, place = document.light, place_of(document, self.light)
        own, position = light.painted[place], place
        for name, value in self.values:
            if name == PLACE:
                position = _checked_position(value, len(light.painted))
            else:
                own = changed_painted(own, name, value)
        others = [each for i, each in enumerate(light.painted) if i != place]
        if own.name in [each.name for each in others]:
            raise InsituError(f"there is a painted light {own.name!r} already; name another")
        others.insert(position, own)
        changed = replace(light, painted=tuple(others))
        if own.name != self.light:
            changed = changed.with_renamed_rows({painted_key(self.light): painted_key(own.name)})
        return replace(document, light=changed)


@dataclass(frozen=True)
class RemovePainted:
    """Take a painted light away, with its row in the mix."""

    light: str

    @property
    def label(self) -> str:
        return f"delete {self.light}"

    def apply(self, document: Document) -> Document:
        light, place = document.light, place_of(document, self.light)
        rows = {key: row for key, row in light.mix if key != painted_key(self.light)}
        left = light.painted[:place] + light.painted[place + 1 :]
        return replace(document, light=replace(light, painted=left).with_rows(rows))


def painted_addition(path: str, name: str, value: Any) -> AddPainted:
    """The command that paints a light: `value` is its kind, an image's file, or a table with `kind` and values."""
    if isinstance(value, str):
        if value in PAINTED_KINDS:
            return AddPainted(value, name)
        return AddPainted("image", name, ((FILE, full_path(value)),))
    if not isinstance(value, Mapping) or not isinstance(value.get("kind"), str):
        raise LoadError(path, "value", value, f"one of {', '.join(PAINTED_KINDS)}, an image, or a table with its kind")
    values = {key: full_path(each) if key == FILE and isinstance(each, str) else each for key, each in value.items()}
    return AddPainted(cast(PaintedKind, values.pop("kind")), name, tuple(values.items()))


def with_painted(path: str, light: str, name: str, value: Any) -> SetPainted | RemovePainted:
    """The command that sets what a path names of a painted light. Raises LoadError."""
    if name == "deleted":
        check_presence(path, name, value)
        return RemovePainted(light)
    return SetPainted.of(light, name, full_path(value) if name == FILE and isinstance(value, str) else value)


def _free_name(own: str, taken: set[str]) -> str:
    """The name of a kind or a file, with a number where others have it."""
    name = valid_name(own, "Image")
    return numbered_name(name, taken) if name in taken else name


def painted_towards(light: LightState, name: str, direction: ArrayLike) -> SetPainted:
    """The command that puts the middle of a painted light, or a sky's sun, in a direction of the world."""
    azimuth, elevation = angles_in_environment(direction, light.rotation, light.tilt)
    return SetPainted(name, (("azimuth", azimuth), ("elevation", elevation)))


def place_of(document: Document, name: str) -> int:
    """The place of a painted light in the list. Raises InsituError where there is none of this name."""
    names = [each.name for each in document.light.painted]
    if name not in names:
        raise InsituError(f"there is no painted light {name!r}; available: {list_names(names) or 'none'}")
    return names.index(name)


def add_image(file: Path, values: Mapping[str, Any] | None = None) -> AddPainted:
    """Paint an image: as a card of its proportions, or all around where it is a panorama by its size."""
    return AddPainted("image", "", ((FILE, str(resolved(file))), *(values or {}).items()))


def _checked_position(value: Any, n: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != int(value) or not 0 <= value < n:
        raise ParameterError(PLACE, value, f"a whole number from 0 to {n - 1}")
    return int(value)
