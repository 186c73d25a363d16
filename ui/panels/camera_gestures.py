"""Gestures that move the camera, over the picture by mouse or trackpad.

    middle drag orbits, Shift pans, Ctrl goes nearer or farther         as in Blender
    Alt left drag orbits, Alt middle pans, Alt right nearer or farther  as in Maya
    the wheel goes nearer what is under the mouse; or two fingers orbit, Shift pan, Ctrl nearer or farther

Zooming and panning the picture itself uses the same buttons with Ctrl and Alt (`ui.panels.viewport_layout`). Drags are
measured from where they began, so that a pointer that returns restores the camera to the last bit; the scene follows
the pointer, at the depth of what it grabbed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from imgui_bundle import imgui

from app.document.view_state import SetView, Viewpoint
from app.files.preferences import Mouse, Scroll
from engine.scene.camera_moves import (
    depth_of,
    distance,
    dolly_camera,
    orbit_camera,
    pan_camera,
    point_at,
)
from engine.scene.description import Camera
from ui.panels.actions import Action, BeginCameraDrag, DragCamera, EndCameraDrag, HoldGrip, MoveCameraTo, SetPanel
from ui.panels.context import PanelContext
from ui.panels.picture import Picture
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import Grip, ScrollTurn

Gesture = Literal["orbit", "pan", "dolly"]
# Mouse buttons (0 left, 1 right, 2 middle) with modifier keys.
DRAGS: dict[Mouse, dict[tuple[int, str], Gesture]] = {
    "blender": {(2, ""): "orbit", (2, "shift"): "pan", (2, "ctrl"): "dolly"},
    "maya": {(0, "alt"): "orbit", (2, "alt"): "pan", (1, "alt"): "dolly"},
}
SCROLLS: dict[Scroll, dict[str, Gesture]] = {
    "dolly": {"": "dolly"},
    "orbit": {"": "orbit", "shift": "pan", "ctrl": "dolly"},
}
DEGREES_A_PIXEL, PIXELS_TO_HALVE = 0.4, 150.0
# Per notch of the wheel, of which a trackpad reports small fractions.
NOTCH_DEGREES, NOTCH_HEIGHTS, NOTCH_NEARER = 12.0, 0.06, 0.85
# Wheel turns with less than this between them are one step of the view's history, seconds.
PAUSE_SECONDS = 1.0
# Pixels at scale 1 after which a press is a drag.
DRAG_DISTANCE = 3.0


@dataclass(frozen=True)
class CameraGrip(Grip):
    """A drag of the camera. `offset` is where the mouse grabbed it, pixels, with this button; `camera` as it was then,
    `depth` of what was under the mouse, metres; `begun`: the pointer has moved since."""

    gesture: Gesture
    button: int
    camera: Camera
    depth: float
    begun: bool = False


def held_keys() -> str:
    """The modifiers held, in a fixed order: "", "shift", "ctrl+alt"."""
    io = imgui.get_io()
    held = {"shift": io.key_shift, "ctrl": io.key_ctrl, "alt": io.key_alt}
    return "+".join(name for name, is_held in held.items() if is_held)


def navigate(context: PanelContext, placed: PictureRect, picture: Picture) -> list[Action] | None:
    """The actions of the mouse over the picture, the item drawn last, on the camera; None where it does something
    else."""
    grip = context.state.grip
    if isinstance(grip, CameraGrip):
        return _drag(context, grip, placed)
    if grip is not None or not imgui.is_item_hovered():
        return None
    for (button, held), gesture in DRAGS[context.preferences.mouse].items():
        if imgui.is_mouse_clicked(button) and held_keys() == held:
            return _take_hold(context, gesture, button, placed, picture)
    return _scroll(context, placed, picture)


def was_a_click(context: PanelContext, actions: list[Action]) -> bool:
    """Whether a left button that could have moved the camera was released where it was pressed."""
    grip = context.state.grip
    return isinstance(grip, CameraGrip) and grip.button == 0 and not grip.begun and HoldGrip(None) in actions


# ---------------------------------------------------------------------------------------------------------------- drags


def _take_hold(
    context: PanelContext, gesture: Gesture, button: int, placed: PictureRect, picture: Picture
) -> list[Action]:
    mouse = imgui.get_mouse_pos()
    depth = _depth_at(context, placed.pixel(mouse.x, mouse.y, picture))
    grip = CameraGrip("camera", (mouse.x, mouse.y), gesture, button, context.camera, depth)
    return [HoldGrip(grip), SetView.of(hovered=None)]


def _drag(context: PanelContext, grip: CameraGrip, placed: PictureRect) -> list[Action]:
    imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
    mouse = imgui.get_mouse_pos()
    across, down = mouse.x - grip.offset[0], mouse.y - grip.offset[1]
    actions: list[Action] = []
    if not grip.begun and math.hypot(across, down) >= context.px(DRAG_DISTANCE):
        grip = replace(grip, begun=True)
        actions += [HoldGrip(grip), BeginCameraDrag(grip.gesture)]
    if grip.begun:
        camera = drag_camera(grip, across, down, context.theme.scale, placed.height)
        actions.append(DragCamera(Viewpoint(camera, context.view.resolution)))
    if not imgui.is_mouse_down(grip.button):
        actions += [EndCameraDrag(), HoldGrip(None)]
    return actions


def drag_camera(grip: CameraGrip, across: float, down: float, scale: float, height: float) -> Camera:
    """The camera after the mouse has moved so many pixels right and down; height: of the picture on screen."""
    if across == down == 0.0:
        return grip.camera  # to the last bit
    if grip.gesture == "orbit":
        rate = math.radians(DEGREES_A_PIXEL / scale)
        return orbit_camera(grip.camera, -rate * across, rate * down)
    if grip.gesture == "pan":
        return pan_camera(grip.camera, -across / height, down / height, grip.depth)
    return dolly_camera(grip.camera, 2.0 ** ((down - across) / (scale * PIXELS_TO_HALVE)))


def _depth_at(context: PanelContext, pixel: tuple[int, int] | None) -> float:
    """The depth of what a pixel of the picture shows, metres; the target's where that is unknown."""
    spot = None if pixel is None or context.status.is_away else context.spot_at(*pixel)
    depth = 0.0 if spot is None else depth_of(context.camera, spot.place)
    return depth if depth > 0.0 else distance(context.camera)


# --------------------------------------------------------------------------------------------------------------- scroll


def _scroll(context: PanelContext, placed: PictureRect, picture: Picture) -> list[Action] | None:
    io = imgui.get_io()
    x, y = io.mouse_wheel_h, io.mouse_wheel
    gesture = SCROLLS[context.preferences.scroll].get(held_keys())
    if gesture is None or not (x or y):
        return None
    turn = _turn(context, gesture, placed, picture)
    camera = scroll_camera(context.camera, gesture, x, y, turn.about)
    look = Viewpoint(camera, context.view.resolution)
    return [MoveCameraTo(look, gesture, f"scroll from {turn.began}"), SetPanel({"scroll": turn})]


def _turn(context: PanelContext, gesture: Gesture, placed: PictureRect, picture: Picture) -> ScrollTurn:
    """The wheel turn under way, or a new one; it keeps the point that it began about."""
    mouse, turn = imgui.get_mouse_pos(), context.state.scroll
    place = (mouse.x, mouse.y)
    goes_on = turn is not None and (turn.gesture, turn.place) == (gesture, place)
    if turn is not None and goes_on and context.now - turn.last <= PAUSE_SECONDS:
        return replace(turn, last=context.now)
    depth = _depth_at(context, placed.pixel(*place, picture))
    about = point_at(context.camera, (picture.width, picture.height), *placed.point(*place), depth)
    return ScrollTurn(gesture, context.now, context.now, place, (float(about[0]), float(about[1]), float(about[2])))


def scroll_camera(camera: Camera, gesture: Gesture, x: float, y: float, about: tuple[float, float, float]) -> Camera:
    """The camera after so many notches right and forward, or as far with two fingers; about: the point whose place in
    the picture a dolly does not change."""
    if gesture == "orbit":
        return orbit_camera(camera, -math.radians(NOTCH_DEGREES * x), math.radians(NOTCH_DEGREES * y))
    if gesture == "pan":
        return pan_camera(camera, -NOTCH_HEIGHTS * x, NOTCH_HEIGHTS * y)
    return dolly_camera(camera, NOTCH_NEARER**y, about)
