"""The transform of the selected object: where it was moved to by hand, three numbers a row, in the Material panel."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from imgui_bundle import imgui

from app.document.commands.poses import POSITION, ROTATION, SCALE, SetTransform
from app.document.targets import TRANSFORM_FIELDS
from app.operators.registry import keys_of
from engine.scene.transform import Transform
from ui.panels import gizmo, rows, widgets
from ui.panels.actions import Action, SetPanel
from ui.panels.context import PanelContext

STEPS_A_SIZE = 200.0  # pixels of a drag that move an object by its own size
PUT_BACK = "Put it back"
HINT = "Rows for where the object is, how it is turned, and its size."


def is_shown(context: PanelContext) -> bool:
    """Whether the rows are in the panel: they are asked for, handles are in the picture, or the object is a lamp, which
    has no material that needs their room."""
    selected, state = context.view.selected, context.state
    if selected is None:
        return False
    return state.shows_transform or bool(state.gizmo) or context.document.object(selected.object).is_lamp


def draw(context: PanelContext) -> list[Action]:
    """The rows of the selected object, which is one."""
    assert context.view.selected is not None
    state, actions = context.document.object(context.view.selected.object), list[Action]()
    imgui.separator_text(f"Transform of {state.name}")
    for parameter in (replace(POSITION, step=_size(context, state.name) / STEPS_A_SIZE), ROTATION, SCALE):
        field = TRANSFORM_FIELDS[parameter.name]
        row = rows.Row(
            parameter, getattr(state.transform, field), partial(_set, state.name, field),
            f"transform.{parameter.name}", parameter.default, parts=rows.AXES,
        )  # fmt: skip
        actions += rows.draw(context, row)
    offered = [each for each in gizmo.TOOLS if each != "aim" or context.facing_of(state.name) is not None]
    tools = [(each.capitalize(), _hint(context, each)) for each in offered]
    room = widgets.segments_width(context, [text for text, _ in tools]) / context.theme.scale
    widgets.label(context, "Handles", least=room)
    shown = offered.index(context.state.gizmo) if context.state.gizmo in offered else -1
    if (chosen := widgets.segments(context, "transform.tool", tools, shown)) is not None:
        actions.append(SetPanel({"gizmo": "" if chosen == shown else offered[chosen]}))
    hint = f"Where the scene's file has it; {keys_of('undo')} brings it back here."
    if state.transform != Transform() and widgets.text_button(context, "transform.reset", PUT_BACK, hint):
        actions.append(SetTransform(state.name))
    return actions


def _hint(context: PanelContext, tool: str) -> str:
    keys = context.keys_of(f"gizmo_{tool}")
    return f"Handles in the picture{f' ({keys})' if keys else ''}; again: none."


def _set(name: str, field: str, value: tuple[float, float, float]) -> SetTransform:
    return SetTransform(name, **{field: value})


def _size(context: PanelContext, name: str) -> float:
    """The longest edge of an object's box where its file has it, in metres."""
    box = context.resting_box_of(name)
    return 1.0 if box is None else max(float(np.ptp(box, axis=0).max()), 1e-3)
