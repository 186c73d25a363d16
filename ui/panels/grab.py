"""Moving, rotating and scaling without a handle, as in Blender: after a key the selected objects follow the mouse, with
no button held, until a click or Enter; Esc or a right click takes it back.

Meanwhile X, Y and Z constrain it to an axis of the world, a second time to the active object's own, a third time to
none; with Shift to the two other axes. Digits type how far: metres along the axis, degrees about it, or a factor. Ctrl
snaps to steps, Shift is fine; where snapping is on, a move without an axis goes over surfaces, or the ground. No other
key, and no control under the mouse, gets what is pressed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from engine.core.camera import camera_frame
from engine.scene.transform import LEAST_SCALE, MOST_METRES, MOST_SCALE
from ui import theme as look
from ui.panels import gizmo
from ui.panels.actions import Action, BeginDrag, CancelDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.arranging import (
    AXES,
    SNAP_DEGREES,
    SNAP_SCALE,
    Arranged,
    arranged,
    objects_of,
    own_axes,
)
from ui.panels.context import PanelContext
from ui.panels.picture_handles import Place, value_at
from ui.panels.picture_overlays import plate
from ui.panels.surface_snap import aim_under, stand_under
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import GrabGrip, PanelState, StatusMessage, Travel

Float64Array = NDArray[np.float64]
Key = imgui.Key

WORDS = {"move": "Move", "rotate": "Rotate", "scale": "Scale", "aim": "Aim"}
UNITS = {"move": " m", "rotate": "°", "scale": " times", "aim": ""}
MOST_TYPED = 12
LEAST_REACH = 8.0  # pixels from the middle: nearer than this the mouse has no direction
_OWNER = 0x1A5173
_BUTTONS = (Key.mouse_left, Key.mouse_right, Key.mouse_middle)
_CONFIRM = (Key.enter, Key.keypad_enter, Key.space)
_DIGITS = {
    **{getattr(Key, f"_{n}"): str(n) for n in range(10)}, **{getattr(Key, f"keypad{n}"): str(n) for n in range(10)},
    Key.period: ".", Key.keypad_decimal: ".", Key.minus: "-", Key.keypad_subtract: "-",
}  # fmt: skip
_N_PIECES = 48  # of the line that shows an axis


def begin(kind: str, context: PanelContext) -> list[Action]:
    """Let the selected objects follow the mouse."""
    start = objects_of(context)
    if not start or context.picture is None or context.state.grip is not None:
        return []
    if kind == "aim" and context.facing_of(start[-1].name) is None:
        reason = f"{start[-1].name} shines to all sides, or not at all; select a flat light or a spot"
        return [SetPanel({"message": StatusMessage(reason, context.now)})]
    mouse = imgui.get_mouse_pos()
    label = f"{kind} {start[0].name if len(start) == 1 else f'{len(start)} objects'}"
    grip = GrabGrip("grab", (mouse.x, mouse.y), start, kind, Travel((mouse.x, mouse.y)))
    return [BeginDrag(label), HoldGrip(grip)]


def claim_input(state: PanelState) -> None:
    """Keep mouse buttons and keys from all controls while objects follow the mouse, or a rectangle is drawn; at the
    start of a pass."""
    if state.grip is not None and state.grip.takes_input:
        for key in (*_BUTTONS, *_CONFIRM):
            imgui.internal.set_key_owner(key, _OWNER)


def is_under_way(context: PanelContext) -> bool:
    """Whether objects follow the mouse."""
    return isinstance(context.state.grip, GrabGrip)


def go_on(context: PanelContext, placed: PictureRect) -> list[Action]:
    """The actions of the mouse and the keys by now."""
    grip = context.state.grip
    assert isinstance(grip, GrabGrip)
    found = arranged(context, placed)
    if found is None or imgui.is_mouse_clicked(imgui.MouseButton_.right):
        return [CancelDrag()]
    mouse = imgui.get_mouse_pos()
    if grip.kind != "aim":
        grip = _with_keys(grip)
    grip = replace(grip, travel=grip.travel.with_fine((mouse.x, mouse.y), bool(imgui.get_io().key_shift)))
    pointer = _pointer(grip, (mouse.x, mouse.y))
    if grip.kind == "rotate":
        grip = replace(grip, angle=_angle(found, grip, pointer))
    actions = {"move": _move, "rotate": _rotate, "scale": _scale, "aim": _aim}[grip.kind](found, grip, pointer)
    _draw(found, grip)
    imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
    if imgui.is_mouse_clicked(imgui.MouseButton_.left) or any(imgui.is_key_pressed(key, False) for key in _CONFIRM):
        return [*actions, EndDrag(), HoldGrip(None)]
    return [*actions, HoldGrip(grip)] if grip != context.state.grip else actions


def _with_keys(grip: GrabGrip) -> GrabGrip:
    """The gesture with the axis and the number after the keys pressed in this pass."""
    across = bool(imgui.get_io().key_shift)
    for number, name in enumerate(AXES):
        if imgui.is_key_pressed(getattr(Key, name), False):
            grip = _constrained(grip, number, across)
    for key, character in _DIGITS.items():
        if imgui.is_key_pressed(key, False) and len(grip.typed) < MOST_TYPED:
            grip = replace(grip, typed=with_character(grip.typed, character))
    if imgui.is_key_pressed(Key.backspace, False):
        grip = replace(grip, typed=grip.typed[:-1])
    return grip


def _constrained(grip: GrabGrip, axis: int, across: bool) -> GrabGrip:
    """First to the world's axis, then to the object's own, then to none."""
    if grip.axis != axis or grip.across != across:
        return replace(grip, axis=axis, across=across, own=False)
    return replace(grip, own=True) if not grip.own else replace(grip, axis=None, across=False, own=False)


def with_character(typed: str, character: str) -> str:
    """A number after another character: a minus changes its sign, a second point is none."""
    if character == "-":
        return typed[1:] if typed.startswith("-") else f"-{typed}"
    return typed if character == "." and "." in typed else typed + character


def typed_value(typed: str) -> float | None:
    """The number that has been typed, None while there is none."""
    try:
        return float(typed)
    except ValueError:
        return None


def _pointer(grip: GrabGrip, mouse: Place) -> Place:
    """Where the mouse would be if Shift had not made it slow."""
    across, down = grip.travel.distance_to(mouse)
    return grip.offset[0] + across, grip.offset[1] + down


def _axes(arranged: Arranged, grip: GrabGrip) -> Float64Array:
    """The axes that it is constrained to, the columns of (3, 3)."""
    return own_axes(arranged.start[-1]) if grip.own else np.eye(3)


# --------------------------------------------------------------------------------------------------------------- moving


def _move(arranged: Arranged, grip: GrabGrip, pointer: Place) -> list[Action]:
    axes, typed = _axes(arranged, grip), typed_value(grip.typed)
    axis = axes[:, 0 if grip.axis is None else grip.axis]
    if typed is not None:
        return arranged.moved(np.clip(typed, -MOST_METRES, MOST_METRES) * axis)
    if grip.axis is None and arranged.stands:
        if pointer == grip.offset:  # they stay where they are until the mouse moves
            return arranged.moved(np.zeros(3))
        return stand_under(arranged, pointer, (pointer[0] - grip.offset[0], pointer[1] - grip.offset[1]))
    if grip.axis is None:
        by, which = _across_plane(arranged, grip, pointer, camera_frame(arranged.context.camera)[2]), np.full(3, True)
    elif grip.across:
        by, which = _across_plane(arranged, grip, pointer, axis), np.arange(3) != grip.axis
    else:
        by, which = _along(arranged, grip, pointer, axis) * axis, np.arange(3) == grip.axis
    return arranged.moved(by if grip.own else arranged.snapped_move(by, which))


def _aim(arranged: Arranged, grip: GrabGrip, pointer: Place) -> list[Action]:
    return aim_under(arranged, pointer)


def _along(arranged: Arranged, grip: GrabGrip, pointer: Place, axis: Float64Array) -> float:
    """By how many metres along an axis the middle is nearest to the pointer, which holds it where it did."""
    first, place = arranged.first_middle, arranged.place_of(arranged.first_middle)
    now = float((arranged.middle - first) @ axis)
    if place is None:
        return now
    to = place[0] + pointer[0] - grip.offset[0], place[1] + pointer[1] - grip.offset[1]
    arm = arranged.arm_at(first)
    return value_at(lambda by: arranged.place_of(first + by * axis), now, to, 0.01 * arm, 4.0 * arm,
                    (now - MOST_METRES, now + MOST_METRES))  # fmt: skip


def _across_plane(arranged: Arranged, grip: GrabGrip, pointer: Place, normal: Float64Array) -> Float64Array:
    """The move (3,) that keeps the middle in a plane, and under the pointer as it was; as it is beyond the horizon."""
    first, place = arranged.first_middle, arranged.place_of(arranged.first_middle)
    to = None if place is None else (
        float(place[0]) + pointer[0] - grip.offset[0], float(place[1]) + pointer[1] - grip.offset[1]
    )  # fmt: skip
    met = None if to is None else arranged.on_plane(to, first, normal)
    if pointer == grip.offset:
        return np.zeros(3)
    return arranged.middle - first if met is None else met - first


# ------------------------------------------------------------------------------------------------- rotating and scaling


def _angle(arranged: Arranged, grip: GrabGrip, pointer: Place) -> float:
    """By how many degrees the pointer has gone about the middle on screen, counter-clockwise, whole turns as well."""
    place = arranged.place_of(arranged.first_middle)
    if place is None or pointer == grip.offset:
        return 0.0
    (x0, y0), (x1, y1) = np.subtract(grip.offset, place), np.subtract(pointer, place)
    if np.hypot(x1, y1) < 1.0:
        return grip.angle
    angle = float(np.degrees(np.arctan2(y0, x0) - np.arctan2(y1, x1)))
    return angle + 360.0 * round((grip.angle - angle) / 360.0)


def _rotate(arranged: Arranged, grip: GrabGrip, pointer: Place) -> list[Action]:
    towards_viewer = -camera_frame(arranged.context.camera)[2]
    axis = towards_viewer if grip.axis is None else _axes(arranged, grip)[:, grip.axis]
    typed = typed_value(grip.typed)
    faces = np.array(arranged.context.camera.position) - arranged.first_middle
    degrees = (
        arranged.in_steps(grip.angle if axis @ faces >= 0.0 else -grip.angle, SNAP_DEGREES) if typed is None else typed
    )
    return arranged.rotated(axis, degrees)


def _scale(arranged: Arranged, grip: GrabGrip, pointer: Place) -> list[Action]:
    factor = typed_value(grip.typed)
    if factor is None:
        place = arranged.place_of(arranged.first_middle)
        if place is None:
            return []
        before, after = (float(np.hypot(*np.subtract(each, place))) for each in (grip.offset, pointer))
        factor = (
            arranged.in_steps(after / before, SNAP_SCALE)
            if before > LEAST_REACH
            else 1.0 + (after - before) / LEAST_REACH
        )
    which = np.full(3, True) if grip.axis is None else (np.arange(3) == grip.axis) != grip.across
    factors = np.where(which, np.clip(factor, LEAST_SCALE, MOST_SCALE), 1.0)
    own = arranged.about is None and (grip.axis is None or grip.own)
    return arranged.scaled(factors, None if own else _axes(arranged, grip))


# ------------------------------------------------------------------------------------------------------------- drawing


def _draw(arranged: Arranged, grip: GrabGrip) -> None:
    """The outlines, the axes that it is constrained to, and what is being done."""
    context = arranged.context
    gizmo.draw_outlines(arranged)
    axes, middle = _axes(arranged, grip), arranged.first_middle
    for number in range(3):
        if grip.axis is not None and (number == grip.axis) != grip.across:
            _draw_axis(arranged, middle, axes[:, number], look.CHANNELS[number])
    place = ImVec2(max(arranged.placed.x, 0.0) + context.px(12), max(arranged.placed.y, 0.0) + context.px(54))
    plate(context, imgui.get_window_draw_list(), place, described(arranged, grip), look.TEXT)


def _draw_axis(arranged: Arranged, middle: Float64Array, axis: Float64Array, ink: look.Colour) -> None:
    """A line through the middle, as far as it is in front of the camera."""
    arm, draw_list = arranged.arm_at(middle), imgui.get_window_draw_list()
    reach = np.sinh(np.linspace(-5.0, 5.0, _N_PIECES + 1)) * arm
    places = [arranged.on_screen(middle + by * axis) for by in reach]
    for start, end in zip(places, places[1:], strict=False):
        if start is not None and end is not None:
            line = ImVec2(*start[0]), ImVec2(*end[0])
            draw_list.add_line(*line, look.pack(look.with_alpha(ink, 0.9)), arranged.context.px(1.5))


def described(arranged: Arranged, grip: GrabGrip) -> str:
    """What is being done, by how much, and along which axes."""
    before, now = arranged.start[-1].transform, arranged.active.transform
    if grip.kind == "aim":
        return f"{WORDS['aim']} {arranged.active.name} at what is under the mouse"
    if grip.typed:
        said = f"{grip.typed}|{UNITS[grip.kind]}"
    elif grip.kind == "move":
        by = np.subtract(now.translation, before.translation)
        said = "   ".join(f"{name.upper()} {value:.3f}" for name, value in zip(AXES, by, strict=True)) + UNITS["move"]
    elif grip.kind == "rotate":
        said = f"{arranged.in_steps(grip.angle, SNAP_DEGREES):.1f}°"
    else:
        grown = np.divide(now.scale, before.scale)
        said = "   ".join(f"{name.upper()} {value:.3f}" for name, value in zip(AXES, grown, strict=True))
    along = ""
    if grip.axis is not None:
        named = "".join(name for k, name in enumerate(AXES.upper()) if (k == grip.axis) != grip.across)
        along = f"   {'about' if grip.kind == 'rotate' else 'along'} {'its own ' if grip.own else ''}{named}"
    return f"{WORDS[grip.kind]}   {said}{along}"
