"""The rows of a lamp by numbers: how large it is, the cone of a spot, and what it shines at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from app.document.commands.lamps import (
    INNER,
    OUTER,
    PARAMETERS,
    TARGET,
    SetCone,
    SetLampSize,
    SetTarget,
    lamp_fields,
    lamp_value,
)
from app.document.document import ObjectState
from engine.scene.transform import Transform
from ui.panels import rows
from ui.panels.actions import Action
from ui.panels.arranging import placed_in
from ui.panels.context import PanelContext
from ui.panels.surface_snap import target_of


def draw(context: PanelContext, state: ObjectState, panel: str) -> list[Action]:
    """The rows of a lamp; none of other objects. panel: how their handles' names begin."""
    actions: list[Action] = []
    for name in lamp_fields(state):
        actions += _target(context, state, panel) if name == TARGET else _number(context, state, name, panel)
    return actions


def _number(context: PanelContext, state: ObjectState, name: str, panel: str) -> list[Action]:
    assert state.lamp is not None
    parameter, own = PARAMETERS[name], replace(state, transform=Transform(), new_cone=None)
    make: Callable[[float], Any] = partial(SetLampSize, state.name, name)
    if name in (INNER, OUTER):
        make = partial(_set_cone, state.name, name)
    else:
        low, high = state.lamp.range_of(name, state.transform)
        parameter = replace(parameter, minimum=low, maximum=high)
    row = rows.Row(parameter, lamp_value(state, name), make, f"{panel}.{name}", lamp_value(own, name))
    return rows.draw(context, row)


def _set_cone(name: str, angle: str, degrees: float) -> SetCone:
    return SetCone(name, degrees) if angle == INNER else SetCone(name, outer=degrees)


def _target(context: PanelContext, state: ObjectState, panel: str) -> list[Action]:
    """The point that it shines at, which the handle to aim shows."""
    light = placed_in(context, state.name)
    point = None if light is None else target_of(context, light)
    if point is None:
        return []
    x, y, z = point.tolist()
    make = partial(SetTarget, state.name)
    return rows.draw(context, rows.Row(PARAMETERS[TARGET], (x, y, z), make, f"{panel}.{TARGET}", parts=rows.AXES))
