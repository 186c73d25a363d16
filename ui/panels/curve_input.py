"""Mouse and keyboard on the curve: which handle is under the mouse, what pressing, dragging and the wheel do; Tab
chooses a handle, the arrow keys move it.

Everything is measured from the `CurveGrip` that the press made; mouse and keys share the effect of moving a handle
(`move_handle`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import CurveEdit, SetOperators
from app.document.view_state import SetView
from engine.curve.operators import Curve, apply_operators
from engine.material.layer import Layer
from ui.panels import curve_plot as plot
from ui.panels import widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import (
    END_NAMES,
    HALF_PI,
    Knob,
    OperatorGroup,
    Pull,
    defaults_from,
    drag_knob,
    drag_region,
    knob_of,
    new_operators,
    regions_around,
    tool_of,
    with_regions,
)
from ui.panels.number_fields import PIXELS_TO_DOUBLE
from ui.panels.plot_axes import zoomed
from ui.panels.window_state import FINE, CurveGrip, KeyGrip, Travel

GRAB_DISTANCE = 9.0
PULL_DISTANCE = 10.0
SMALLEST_X_SPAN = 0.002


@dataclass(frozen=True)
class DrawnCurves:
    """The selected curve: what generates it, its operators, and the samples drawn (angles (N,), values (N, 3))."""

    key: str
    factor: str
    layer: Layer
    generated: Curve
    operators: tuple[CurveEdit, ...]
    editable: bool


def grip_of(context: PanelContext) -> CurveGrip | None:
    """The gesture on the curve, when one is under way."""
    grip = context.state.grip
    return grip if isinstance(grip, CurveGrip) else None


def knob(curves: DrawnCurves, group: OperatorGroup) -> Knob:
    """The place of the magnitude handle on the curve as it is."""
    below = curves.operators if group.index is None else curves.operators[: group.index]
    return knob_of(group, apply_operators(below, curves.generated))


def interact(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup
) -> tuple[str | None, list[Action]]:
    """The mouse on the plot: which handle is under it, and what its drag does."""
    corner = ImVec2(frame.x.start - context.px(10), frame.y.end - context.px(plot.FLAG_STRIP))
    size = ImVec2(frame.x.end + context.px(10) - corner.x, frame.y.start - corner.y)
    imgui.set_cursor_screen_pos(corner)
    buttons = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_middle
    imgui.invisible_button("ground", size, buttons)
    handles = _handle_places(context, curves, frame, group) if curves.editable else {}
    for name, place in handles.items():
        context.handles.note(f"curve.{name}", *place)
    context.handles.note("curve.line", *_on_the_line(curves, frame))
    context.handles.note("curve.plot", 0.5 * (frame.x.start + frame.x.end), 0.5 * (frame.y.start + frame.y.end))
    mouse, grip = imgui.get_mouse_pos(), grip_of(context)
    hot = None
    if imgui.is_item_hovered() and grip is None:
        hot = _under_mouse(context, curves, frame, group, handles, mouse)
        _show_cursor(hot, group)
        _explain(hot, group)
    actions: list[Action] = []
    if imgui.is_item_activated():
        actions += _take_hold(context, curves, frame, group, hot, mouse)
    elif imgui.is_item_active() and grip is not None:
        actions += _drag(context, curves, frame, group, grip, mouse)
    if imgui.is_item_deactivated() and grip is not None:
        actions += [EndDrag(), HoldGrip(None)]
    if imgui.is_item_hovered() and grip is None:
        actions += _zoom(context, frame, mouse)
    return hot, actions


def _on_the_line(curves: DrawnCurves, frame: plot.Frame) -> tuple[float, float]:
    """A place on the curve, a twentieth of the visible angle from the left, where a script can drag it."""
    gamma = frame.x.low + 0.05 * (frame.x.high - frame.x.low)
    value = float(apply_operators(curves.operators, curves.generated)(np.array([gamma])).max())
    return frame.x.to_pixel(gamma), frame.y.to_pixel(value)


def _handle_places(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup
) -> dict[str, tuple[float, float]]:
    """Where each handle can be grabbed, by name, those drawn on top first."""
    flags = plot.flag_places(frame, group.regions, context.px(plot.FLAG) + 1)
    top = frame.y.end - context.px(plot.FLAG_STRIP - 2) + 0.5 * context.px(plot.FLAG)
    places = {"magnitude": plot.knob_place(context, frame, knob(curves, group))}
    places |= {name: (x, top) for name, x in zip(END_NAMES, flags, strict=True)}
    return places | {"region": (0.5 * (flags[1] + flags[2]), top)}


def _under_mouse(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    handles: dict[str, tuple[float, float]],
    mouse: ImVec2,
) -> str | None:
    reach = context.px(GRAB_DISTANCE)
    for name in ("magnitude", *END_NAMES):
        if name in handles and np.hypot(mouse.x - handles[name][0], mouse.y - handles[name][1]) <= reach:
            return name
    if not handles:
        return None
    if mouse.y < frame.y.end:
        inside = handles["a"][0] <= mouse.x <= handles["d"][0]
        return "region" if inside else None
    if not frame.contains(mouse.x, mouse.y):
        return None
    gamma = frame.x.to_value(mouse.x)
    values = apply_operators(curves.operators, curves.generated)(np.array([gamma]))[0]
    if np.abs(frame.y.to_pixels(values) - mouse.y).min() <= context.px(PULL_DISTANCE):
        return "pull"
    bars = {name: abs(frame.x.to_pixel(end) - mouse.x) for name, end in zip(END_NAMES, group.regions, strict=True)}
    nearest = min(bars, key=lambda name: bars[name])
    return nearest if bars[nearest] <= context.px(5) else None


def _show_cursor(hot: str | None, group: OperatorGroup) -> None:
    cursor = imgui.MouseCursor_
    if hot in (*END_NAMES, "region"):
        imgui.set_mouse_cursor(cursor.resize_ew)
    elif hot in ("magnitude", "pull"):
        axes = {operator.axis for operator in group.operators}
        both = cursor.resize_all if len(axes) == 2 else cursor.resize_ew if "x" in axes else cursor.resize_ns
        imgui.set_mouse_cursor(both)


def _explain(hot: str | None, group: OperatorGroup) -> None:
    texts = {
        "a": "a: the edit begins here; nothing left of it changes.",
        "b": "b: from here the edit acts at full strength.",
        "c": "c: up to here the edit acts at full strength.",
        "d": "d: the edit ends here; nothing right of it changes.",
        "region": "Move the whole region along the angle.",
        "magnitude": f"How strong: drag to {group.first.kind} the curve. The picture follows.",
        "pull": f"Pull the curve here: add a new {group.first.kind} of this part.",
    }
    if hot in texts:
        widgets.tooltip(texts[hot])


def _take_hold(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    hot: str | None,
    mouse: ImVec2,
) -> list[Action]:
    if imgui.is_mouse_double_clicked(0) and hot is None:
        return [SetView.of(curve_zoom=None)]
    hot = "pan" if imgui.is_mouse_clicked(2) else hot
    if hot is None:
        return [SetView.of(operator=None), SetPanel({"handle": None})]
    if hot == "pull":
        regions = regions_around(frame.x.to_value(mouse.x), frame.x.high - frame.x.low)
        group = OperatorGroup(new_operators(tool_of(group), regions, group.first.channels), None)
    handle = "magnitude" if hot == "pull" else hot
    place = (mouse.x, mouse.y) if handle == "pan" else handle_position(curves, frame, group, handle)
    grip = dataclasses.replace(
        grip_at(CurveGrip, curves, frame, group, handle, place),
        travel=Travel((mouse.x, mouse.y), fine=imgui.get_io().key_shift),
    )
    actions: list[Action] = [BeginDrag(None), HoldGrip(grip)]
    if hot == "pull":
        actions.append(SetView.of(operator=None, **defaults_from(group)))
    return actions if hot == "pan" else [*actions, SetPanel({"handle": grip.handle})]


AnyGrip = TypeVar("AnyGrip", bound=CurveGrip)


def grip_at(
    kind: type[AnyGrip],
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    handle: str,
    offset: tuple[float, float],
) -> AnyGrip:
    """A gesture that begins now, on a handle of the operators in use."""
    return kind(
        handle=handle,
        offset=offset,
        operators=curves.operators,
        index=group.index,
        pair=group.pair,
        regions=group.regions,
        x_range=(frame.x.low, frame.x.high),
        y_range=(frame.y.low, frame.y.high),
    )


def handle_position(curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, handle: str) -> tuple[float, float]:
    """The true position of a handle, pixels, also off the plot, so that nothing jumps; of the region its left end."""
    if handle == "magnitude":
        feature = knob(curves, group)
        return frame.x.to_pixel(feature.x), frame.y.to_pixel(feature.y)
    end = 0 if handle == "region" else END_NAMES.index(handle)
    return frame.x.to_pixel(group.regions[end]), frame.y.start


def _drag(
    context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup, grip: CurveGrip, mouse: ImVec2
) -> list[Action]:
    if grip.handle == "pan":
        return _pan(frame, grip, mouse)
    if grip.index is None and not imgui.is_mouse_dragging(0, 1.0) and group.index is None:
        return []
    travel = grip.travel.with_fine((mouse.x, mouse.y), imgui.get_io().key_shift)
    held = dataclasses.replace(grip, travel=travel)
    actions = move_handle(context, curves, frame, group, held, travel.distance_to((mouse.x, mouse.y)))
    return actions if held == grip else [HoldGrip(held), *actions]


def move_handle(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: CurveGrip,
    moved: tuple[float, float],
) -> list[Action]:
    """The actions of moving the grabbed handle by so many pixels right and down."""
    if grip.handle == "magnitude":
        return move_knob(context, curves, frame, group, grip, moved)
    # The shift is exactly 0 where the pointer is back at its start, or has moved only up and down.
    shift = frame.x.to_value(grip.offset[0] + moved[0]) - frame.x.to_value(grip.offset[0])
    start = 0.0 if grip.handle == "region" else grip.regions[END_NAMES.index(grip.handle)]
    return move_ends(curves, grip, start + shift)


def move_ends(curves: DrawnCurves, grip: CurveGrip, to: float) -> list[Action]:
    """The grabbed handle, an end or the region, moved to angle `to` (the region: by it, from its start)."""
    regions = drag_region(grip, to)
    actions: list[Action] = [SetView.of(regions=regions)]
    if grip.index is not None:
        actions.insert(0, SetOperators(curves.key, curves.factor, with_regions(grip, regions)))
    return actions


def move_knob(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: CurveGrip,
    moved: tuple[float, float],
) -> list[Action]:
    """The ring dragged by so many pixels right and down."""
    if grip.index is None:
        group = OperatorGroup(new_operators(context.view.active_tool, grip.regions, context.view.channels), None)
    wanted = frame.y.to_value(grip.offset[1] + moved[1])
    to = (frame.x.to_value(grip.offset[0] + moved[0]), max(wanted, min(0.0, frame.y.low)))
    right, up = moved[0] / context.px(PIXELS_TO_DOUBLE), -moved[1] / context.px(PIXELS_TO_DOUBLE)
    operators = grip.operators
    if grip.index is None or moved != (0.0, 0.0):
        operators = drag_knob(grip, group, curves.generated, Pull(to, (2.0**right, 2.0**up)))
    index = len(grip.operators) if grip.index is None else grip.index
    actions: list[Action] = [SetOperators(curves.key, curves.factor, operators)]
    return [*actions, SetView.of(operator=index)] if context.view.operator != index else actions


def _pan(frame: plot.Frame, grip: CurveGrip, mouse: ImVec2) -> list[Action]:
    dx = frame.x.to_value(mouse.x) - frame.x.to_value(grip.offset[0])
    shift = min(max(-dx, -grip.x_range[0]), HALF_PI - grip.x_range[1])
    x_range = (grip.x_range[0] + shift, grip.x_range[1] + shift)
    return [SetView.of(curve_zoom=(*x_range, *grip.y_range)), HoldGrip(dataclasses.replace(
        grip, x_range=x_range, offset=(mouse.x, mouse.y)))]  # fmt: skip


def _zoom(context: PanelContext, frame: plot.Frame, mouse: ImVec2) -> list[Action]:
    wheel = imgui.get_io().mouse_wheel
    if wheel == 0.0 or not frame.contains(mouse.x, mouse.y):
        return []
    factor = 0.85**wheel
    x_range, y_range = (frame.x.low, frame.x.high), (frame.y.low, frame.y.high)
    if imgui.get_io().key_shift:
        y_range = (y_range[0], y_range[0] + (y_range[1] - y_range[0]) * factor)
    else:
        x_range = zoomed(*x_range, frame.x.to_value(mouse.x), max(factor, SMALLEST_X_SPAN / (x_range[1] - x_range[0])),
                         (0.0, HALF_PI))  # fmt: skip
    return [SetView.of(curve_zoom=(*x_range, *y_range))]


# --------------------------------------------------------------------------------------------------------- the keyboard
#
# A key that is held is one gesture, however often it repeats: it begins at the press and ends when all arrow keys are
# up, so it is one step of the history. The keys belong to the curve unless another panel's controls have the keyboard.


HANDLES = ("magnitude", *END_NAMES, "region")
# Shares of the plot's width and height, so that zooming in makes the keys finer: one degree where all 90 are shown.
WIDTH_A_STEP, HEIGHT_A_STEP = 1.0 / 90.0, 1.0 / 50.0
AMPLIFIED_A_STEP = 0.05

Key = imgui.Key
ARROWS = {Key.left_arrow: (-1, 0), Key.right_arrow: (1, 0), Key.up_arrow: (0, -1), Key.down_arrow: (0, 1)}


def move_by_keys(context: PanelContext, curves: DrawnCurves, frame: plot.Frame, group: OperatorGroup) -> list[Action]:
    """The actions of the keys pressed or held in this pass on the handles."""
    grip = context.state.grip
    if isinstance(grip, KeyGrip):
        _claim()
        if not any(imgui.is_key_down(key) for key in ARROWS):
            return [EndDrag(), HoldGrip(None)]
        return _moved_by_keys(context, curves, frame, group, grip, _key_steps(context.repeated))
    if grip is not None or not curves.editable or not _has_keyboard(context):
        return []
    _claim()
    if context.repeated == Key.tab or imgui.internal.is_key_pressed(Key.tab, 0, _OWNER):
        return [SetPanel({"handle": next_handle(context.state.handle, back=imgui.get_io().key_shift)})]
    steps = _key_steps()
    if steps == (0, 0):
        return []
    handle = context.state.handle or HANDLES[0]
    begun = grip_at(KeyGrip, curves, frame, group, handle, offset=handle_position(curves, frame, group, handle))
    return [BeginDrag(None), SetPanel({"handle": handle}), *_moved_by_keys(context, curves, frame, group, begun, steps)]


def next_handle(handle: str | None, back: bool = False) -> str:
    """The handle after (or before) this one; the first, or last, where none is chosen."""
    if handle is None:
        return HANDLES[-1 if back else 0]
    return HANDLES[(HANDLES.index(handle) + (-1 if back else 1)) % len(HANDLES)]


_OWNER = 0x1A5170


def _has_keyboard(context: PanelContext) -> bool:
    """Whether the curve has the keyboard.

    It does not while the user types, a list or a dialog is open, another panel has the keyboard, or a modifier makes
    shortcuts of the keys.
    """
    io = imgui.get_io()
    if context.keys_taken or io.key_ctrl or io.key_alt or io.key_super or imgui.is_any_item_active():
        return False
    if context.state.question is not None or context.view.show_shortcuts:
        return False
    return not io.nav_visible or imgui.is_window_focused(int(imgui.FocusedFlags_.root_and_child_windows))


def _claim() -> None:
    """Keep imgui from moving between controls by the same keys."""
    for key in (*ARROWS, Key.tab):
        imgui.internal.set_key_owner(key, _OWNER)


def _key_steps(repeated: imgui.Key | None = None) -> tuple[int, int]:
    """Steps right and down of the arrow keys pressed in this pass, or repeated."""
    pressed = [ARROWS[key] for key in ARROWS if key == repeated or imgui.internal.is_key_pressed(key, 0, _OWNER)]
    return sum(right for right, _ in pressed), sum(down for _, down in pressed)


def _moved_by_keys(
    context: PanelContext,
    curves: DrawnCurves,
    frame: plot.Frame,
    group: OperatorGroup,
    grip: KeyGrip,
    steps: tuple[int, int],
) -> list[Action]:
    """The gesture continued by so many steps, and its actions now."""
    if steps == (0, 0):
        return []
    size = FINE if imgui.get_io().key_shift else 1.0
    across, down = (size * step for step in _key_step(context, frame, group, grip))
    moved = grip.moved[0] + steps[0] * across, grip.moved[1] + steps[1] * down
    grip = dataclasses.replace(grip, moved=moved)
    return [HoldGrip(grip), *move_handle(context, curves, frame, group, grip, moved)]


def _key_step(context: PanelContext, frame: plot.Frame, group: OperatorGroup, grip: KeyGrip) -> tuple[float, float]:
    """Pixels right and down per press."""
    if grip.handle == "magnitude" and group.first.kind == "amplify":
        step = math.log2(1.0 + AMPLIFIED_A_STEP) * context.px(PIXELS_TO_DOUBLE)
        return step, step
    return WIDTH_A_STEP * (frame.x.end - frame.x.start), HEIGHT_A_STEP * (frame.y.start - frame.y.end)
