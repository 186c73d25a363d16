"""The edits of poses: the time of animations, the deformers and the transform of each object, as commands like those
of `app.document.commands`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from app.document.document import Document, ObjectState
from app.document.targets import TRANSFORM_FIELDS
from engine.core.errors import InsituError, LoadError
from engine.core.plain_values import is_number
from engine.material.parameters import Parameter
from engine.realtime.deformers import KINDS
from engine.realtime.zonal_harmonics.pose import MAX_GROWTH, Deformation, Moment, largest_growth
from engine.scene.transform import LEAST_SCALE, MOST_DEGREES, MOST_METRES, MOST_SCALE, Transform, Triple

MAX_DEFORMERS = 16
POSITION = Parameter(
    "position", "rgb", (0.0, 0.0, 0.0), "Position", "Metres from its place in the scene's file, along X, Y and Z.",
    minimum=-MOST_METRES, maximum=MOST_METRES, form="%.3f",
)  # fmt: skip
ROTATION = Parameter(
    "rotation", "rgb", (0.0, 0.0, 0.0), "Rotation", "Degrees about X, then Y, then Z, through the centre of its box.",
    minimum=-MOST_DEGREES, maximum=MOST_DEGREES, step=0.5, form="%.1f°",
)  # fmt: skip
SCALE = Parameter(
    "scale", "rgb", (1.0, 1.0, 1.0), "Scale", "Factors along X, Y and Z, before the rotation.",
    minimum=LEAST_SCALE, maximum=MOST_SCALE, step=0.005, form="%.3f",
)  # fmt: skip


@dataclass(frozen=True)
class SetPose:
    """Set the deformers of an object, one after another; none: as its file has it."""

    object: str
    deformations: tuple[Deformation, ...] = ()

    @property
    def label(self) -> str:
        return f"pose of {self.object}"

    def apply(self, document: Document) -> Document:
        if len(self.deformations) > MAX_DEFORMERS:
            raise InsituError(f"{self.object} has {MAX_DEFORMERS} deformers; remove one to add another")
        if (times := largest_growth(self.deformations)) > MAX_GROWTH:
            larger = f"{self.object}: its deformers make it {times:.3g} times as large"
            raise InsituError(f"{larger}, expected at most {MAX_GROWTH:g} times")
        return document.with_object(replace(document.object(self.object), deformations=self.deformations))


@dataclass(frozen=True)
class AddDeformer:
    """Add a deformer of a kind after the others of an object."""

    object: str
    kind: str
    amount: float = 0.0
    axis: str = "y"

    @property
    def label(self) -> str:
        return f"{self.kind} {self.object}"

    def apply(self, document: Document) -> Document:
        row = document.object(self.object).deformations
        return SetPose(self.object, (*row, _deformation(self.kind, self.amount, self.axis))).apply(document)


@dataclass(frozen=True)
class SetDeformer:
    """Set the amount or the axis of one of an object's deformers; None: the present one."""

    object: str
    index: int
    amount: float | None = None
    axis: str | None = None

    @property
    def label(self) -> str:
        return f"deform {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        old = row[self.index]
        amount = old.amount if self.amount is None else self.amount
        row[self.index] = _deformation(old.kind, amount, self.axis or old.axis)
        return SetPose(self.object, tuple(row)).apply(document)


@dataclass(frozen=True)
class MoveDeformer:
    """Move one of an object's deformers to the place of another."""

    object: str
    index: int
    to: int

    @property
    def label(self) -> str:
        return f"reorder the deformers of {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        row.insert(min(max(self.to, 0), len(row) - 1), row.pop(self.index))
        return SetPose(self.object, tuple(row)).apply(document)


@dataclass(frozen=True)
class RemoveDeformer:
    """Remove one of an object's deformers."""

    object: str
    index: int

    @property
    def label(self) -> str:
        return f"remove a deformer of {self.object}"

    def apply(self, document: Document) -> Document:
        row = _row(document, self.object, self.index)
        del row[self.index]
        return SetPose(self.object, tuple(row)).apply(document)


@dataclass(frozen=True)
class SetTime:
    """Pose an object, None: all animated ones, as an animation has it at a time, seconds; None: as its file has it.
    clip: its name; None: the one that is shown, or an object's first. Objects without one of that name do not
    change."""

    time: float | None
    clip: str | None = None
    object: str | None = None

    @property
    def label(self) -> str:
        return "rest" if self.time is None else f"time {self.time:.2f} s"

    def apply(self, document: Document) -> Document:
        requested = document.objects if self.object is None else (document.object(self.object),)
        animated = [state for state in requested if state.animations]
        if not animated:
            raise InsituError(f"{self.object or 'the scene'} has no animation")
        there = list(dict.fromkeys(each.name for state in animated for each in state.animations))
        if self.clip is not None and self.clip not in there:
            raise InsituError(f"animation {self.clip!r}, expected one of {', '.join(there)}")
        for state in animated:
            document = document.with_object(replace(state, moment=self._moment_of(state)))
        return document

    def _moment_of(self, state: ObjectState) -> Moment | None:
        if self.time is None:
            return None
        clip = self.clip or (state.moment.clip if state.moment is not None else state.animations[0].name)
        return _at(clip, self.time) if clip in [each.name for each in state.animations] else state.moment


@dataclass(frozen=True)
class SetTransform:
    """Place an object by hand: its translation, metres, rotation, degrees, and scale, relative to its place in the
    scene's file (`engine.scene.transform`); None: the present ones. Without any: back to that place."""

    object: str
    translation: Triple | None = None
    rotation: Triple | None = None
    scale: Triple | None = None

    @property
    def label(self) -> str:
        set_parts = [name for name in _VERBS if getattr(self, name) is not None]
        verb = _VERBS[set_parts[0]] if len(set_parts) == 1 else "place" if set_parts else "put back"
        return f"{verb} {self.object}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        given = {name: value for name in _VERBS if (value := getattr(self, name)) is not None}
        try:
            transform = replace(state.transform, **given) if given else Transform()
        except ValueError as error:
            raise InsituError(f"{self.object}: {error}") from None
        return document.with_object(replace(state, transform=transform))


@dataclass(frozen=True)
class PlaceObjects:
    """Place several objects by hand at once: their transforms, by their names; label: of the step."""

    transforms: tuple[tuple[str, Transform], ...]
    label: str

    def apply(self, document: Document) -> Document:
        placed = dict(self.transforms)
        for name in placed:
            document.object(name)
        objects = tuple(
            replace(state, transform=placed[state.name]) if state.name in placed else state
            for state in document.objects
        )
        return replace(document, objects=objects)


_VERBS = {"translation": "move", "rotation": "rotate", "scale": "scale"}


@dataclass(frozen=True)
class MoveObject:
    """Move an object further: by metres, by rotations about the axes of the world, degrees, and by factors."""

    object: str
    by: Triple = (0.0, 0.0, 0.0)
    rotate: Triple = (0.0, 0.0, 0.0)
    scale: Triple = (1.0, 1.0, 1.0)

    @property
    def label(self) -> str:
        return f"move {self.object}"

    def apply(self, document: Document) -> Document:
        old = document.object(self.object).transform
        x, y, z = (a + b for a, b in zip(old.translation, self.by, strict=True))
        along_x, along_y, along_z = (a * b for a, b in zip(old.scale, self.scale, strict=True))
        rotation = old.rotated(self.rotate).rotation if any(self.rotate) else old.rotation
        return SetTransform(self.object, (x, y, z), rotation, (along_x, along_y, along_z)).apply(document)


def with_placement(path: str, name: str, part: str, value: Any) -> SetTransform:
    """The command that sets a part of an object's transform, `position`, `rotation` or `scale`, to a value from a file
    or a command line; one number is a scale in all directions. Raises LoadError."""
    numbers = [value] * 3 if part == "scale" and is_number(value) else value
    if not isinstance(numbers, (list, tuple)) or len(numbers) != 3 or not all(map(is_number, numbers)):
        raise LoadError(path, "value", value, "three numbers, along X, Y and Z" + " or one" * (part == "scale"))
    x, y, z = map(float, numbers)
    return SetTransform(name, **{TRANSFORM_FIELDS[part]: (x, y, z)})


def with_time(value: Any, name: str | None = None) -> SetTime:
    """The command that moves an object, None: all, to a time from a file or a command line. Raises LoadError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise LoadError(f"{name}.time" if name else "time", "value", value, "a finite number of seconds")
    return SetTime(float(value), object=name)


def with_amounts(document: Document, name: str, amounts: Mapping[str, Any]) -> SetPose:
    """The command that sets the amounts of an object's deformers, by kind: of the first of a kind, and where there is
    none of a new one after the others. Raises InsituError."""
    row = list(document.object(name).deformations)
    for kind, amount in amounts.items():
        there = next((i for i, each in enumerate(row) if each.kind == kind), len(row))
        row[there : there + 1] = [_deformation(kind, amount, row[there].axis if there < len(row) else "y")]
    return SetPose(name, tuple(row))


def _row(document: Document, name: str, index: int) -> list[Deformation]:
    row = list(document.object(name).deformations)
    if not 0 <= index < len(row):
        raise InsituError(f"{name} has {len(row) or 'no'} deformers, none at {index}")
    return row


def _at(clip: str, time: float) -> Moment:
    try:
        return Moment(clip, time)
    except ValueError as error:
        raise InsituError(str(error)) from None


def _deformation(kind: str, amount: Any, axis: str) -> Deformation:
    if isinstance(amount, bool) or not isinstance(amount, (int, float)):
        low, high = KINDS[kind].limits if kind in KINDS else (0.0, 0.0)
        raise LoadError(kind, "value", amount, f"a number from {low:g} to {high:g}")
    try:
        return Deformation(kind, float(amount), axis)
    except ValueError as error:
        raise InsituError(str(error)) from None
