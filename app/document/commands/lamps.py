"""The edits of lamps by numbers: how large they are, the cones of spots, and the point that they shine at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from app.document.document import Document, ObjectState
from app.document.targets import LAMP_FIELDS
from engine.core.errors import InsituError, LoadError
from engine.core.plain_values import is_number
from engine.light.cones import LEAST_OUTER, MOST_ANGLE, Cone
from engine.material.parameters import Parameter, ParameterError
from engine.scene.lamp_shape import HEIGHT, RADIUS, WIDTH, LampShape
from engine.scene.transform import MOST_METRES, Transform, Triple

INNER, OUTER, TARGET = "inner_angle", "outer_angle", "target"
_STAYS = "Its radiance stays: a larger light gives more."


def _metres(name: str, label: str, tooltip: str) -> Parameter:
    return Parameter(
        name, "scalar", 1.0, label, f"{tooltip} {_STAYS}", minimum=0.0, maximum=MOST_METRES, step=0.0, form="%.4g m"
    )


def _degrees(name: str, label: str, tooltip: str, least: float) -> Parameter:
    return Parameter(
        name, "scalar", 30.0, label, tooltip, minimum=least, maximum=MOST_ANGLE, form="%.1f°", soft=(least, MOST_ANGLE)
    )


PARAMETERS = {
    WIDTH: _metres(WIDTH, "Width", "Of the rectangle, along its own X."),
    HEIGHT: _metres(HEIGHT, "Height", "Of the rectangle, along its own Y."),
    RADIUS: _metres(RADIUS, "Radius", "Of the disc or the ball."),
    INNER: _degrees(INNER, "Inner angle", "From the axis: within it the spot has all of its radiance.", 0.0),
    OUTER: _degrees(OUTER, "Outer angle", "From the axis, half of the cone: beyond it the spot is dark.", LEAST_OUTER),
    TARGET: Parameter(
        TARGET, "rgb", (0.0, 0.0, 0.0), "Target",
        "The point that the light shines at, in metres of the world. It goes along when the light is moved.",
        minimum=-MOST_METRES, maximum=MOST_METRES, step=0.005, form="%.3f",
    ),
}  # fmt: skip


def lamp_fields(state: ObjectState) -> tuple[str, ...]:
    """What can be set of a lamp by numbers; nothing of other objects."""
    if state.lamp is None:
        return ()
    cone = (INNER, OUTER) if state.lamp.cone is not None else ()
    return (*state.lamp.sizes, *cone, *((TARGET,) if state.lamp.facing is not None else ()))


def lamp_value(state: ObjectState, name: str) -> Any:
    """One of these values. Raises InsituError where the object has none of that name."""
    shape = _shape_of(state, name)
    if name == TARGET:
        return target_of(state)
    if name in (INNER, OUTER):
        assert state.cone is not None
        return state.cone.inner if name == INNER else state.cone.outer
    return shape.size(name, state.transform)


def target_of(state: ObjectState) -> Triple | None:
    """The point that a lamp shines at; None of one that shines to all sides."""
    point = None if state.lamp is None else state.lamp.target(state.transform, state.target_distance)
    if point is None:
        return None
    x, y, z = (float(f"{each:.9g}") for each in point)  # what was set is read again, but for its last digits
    return x, y, z


@dataclass(frozen=True)
class SetLampSize:
    """Set a size of a lamp, `width`, `height` or `radius`, in metres; it scales the lamp, whose radiance stays."""

    object: str
    name: str
    metres: float

    @property
    def label(self) -> str:
        return f"{self.name} of {self.object}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        shape = _shape_of(state, self.name)
        metres = cast(float, PARAMETERS[self.name].accept(self.metres))
        try:
            transform = shape.resized(self.name, metres, state.transform)
        except ValueError as error:
            raise InsituError(f"{self.object}: {error}") from None
        return document.with_object(replace(state, transform=transform))


@dataclass(frozen=True)
class SetCone:
    """Set the half angles of a spot's cone, degrees; None: the present one. The angle that is set counts: an inner one
    takes the outer along where it is larger, and an outer one the inner where it is smaller."""

    object: str
    inner: float | None = None
    outer: float | None = None

    @property
    def label(self) -> str:
        return f"cone of {self.object}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        _shape_of(state, OUTER if self.inner is None else INNER)
        cone = state.cone
        assert cone is not None
        try:
            if self.inner is not None and self.outer is not None:
                cone = Cone(_degrees_of(INNER, self.inner), _degrees_of(OUTER, self.outer))
            elif self.inner is not None:
                cone = cone.with_inner(_degrees_of(INNER, self.inner))
            elif self.outer is not None:
                cone = cone.with_outer(_degrees_of(OUTER, self.outer))
        except ParameterError:
            raise
        except ValueError as error:
            raise InsituError(f"{self.object}: {error}") from None
        own = None if state.lamp is None else state.lamp.cone
        return document.with_object(replace(state, new_cone=None if cone == own else cone))


@dataclass(frozen=True)
class SetTarget:
    """Turn a lamp to shine at a point, metres. before: the transform that it is turned from, None for the present
    one."""

    object: str
    point: Triple
    before: Transform | None = None

    @property
    def label(self) -> str:
        return f"aim {self.object}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        shape = _shape_of(state, TARGET)
        point = np.array(PARAMETERS[TARGET].accept(self.point))
        transform = shape.aimed_at(point, self.before or state.transform)
        distance = float(np.linalg.norm(point - shape.pivot - transform.translation))
        if not distance > 1e-6:
            raise InsituError(f"{self.object} cannot shine at its own centre; expected a target elsewhere")
        return document.with_object(replace(state, transform=transform, target_distance=distance))


def with_lamp_value(path: str, name: str, field: str, value: Any) -> SetLampSize | SetCone | SetTarget:
    """The command that sets a value of a lamp to one from a file or a command line. Raises LoadError."""
    if field == TARGET:
        numbers = value if isinstance(value, (list, tuple)) else ()
        if len(numbers) != 3 or not all(map(is_number, numbers)):
            raise LoadError(path, "value", value, "three numbers: the point, metres along X, Y and Z")
        x, y, z = map(float, numbers)
        return SetTarget(name, (x, y, z))
    if not is_number(value):
        raise LoadError(path, "value", value, PARAMETERS[field].expected)
    if field in (INNER, OUTER):
        return SetCone(name, **{"inner" if field == INNER else "outer": float(value)})
    return SetLampSize(name, field, float(value))


def _degrees_of(name: str, value: float) -> float:
    return cast(float, PARAMETERS[name].accept(value))


def _shape_of(state: ObjectState, name: str) -> LampShape:
    """The shape of a lamp that has such a value. Raises InsituError for any other object."""
    if state.lamp is None or name not in lamp_fields(state):
        if name == TARGET:
            raise InsituError(f"{state.name} shines to all sides or not at all, expected a flat light or a spot")
        known = ", ".join(lamp_fields(state)) or "none of " + ", ".join(LAMP_FIELDS)
        raise InsituError(f"{state.name} has no {name}; expected {known}")
    return state.lamp
