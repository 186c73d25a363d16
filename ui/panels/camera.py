"""The camera's controls over the picture: lens, horizon, the picture's size, and bookmarked views.

They are in the picture's upper right corner; the picture under them stays usable. Gestures move the camera there, by
mouse or trackpad:

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

from imgui_bundle import ImVec2, imgui

from app.document.view_state import Bookmark, SetView, Viewpoint
from app.files.bookmarks import MAX_NAME, remove_bookmark
from app.files.preferences import Mouse, Scroll
from app.operators.registry import keys_of
from engine.scene.camera_moves import (
    FOCAL_LENGTH,
    depth_of,
    distance,
    dolly_camera,
    focal_length,
    is_level,
    orbit_camera,
    pan_camera,
    point_at,
    with_focal_length,
)
from engine.scene.description import MAX_RESOLUTION, Camera
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import (
    Action,
    BeginCameraDrag,
    DragCamera,
    EndCameraDrag,
    HoldGrip,
    MoveCameraTo,
    RunOperator,
    SetPanel,
)
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_operators import perform
from ui.panels.window_state import Grip, ScrollTurn
from ui.theme import Icon

WIDTH, LABEL_WIDTH, GAP = 264.0, 58.0, 6.0
THUMBNAIL, LEAST_LIST, MARGIN = (64.0, 48.0), 60.0, 10.0
CAMERA_DRAG = (BeginCameraDrag("focal length"), EndCameraDrag())


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The controls, where they are switched on and the picture's panel, from its corner, has room for them."""
    if not context.state.shows_camera or not context.document.is_open or room.x < context.px(WIDTH + 2 * MARGIN):
        return []
    actions: list[Action] = []
    at = ImVec2(corner.x + room.x - context.px(MARGIN), corner.y + context.px(MARGIN))
    with widgets.strip(context, "Camera###camera", at, ImVec2(1.0, 0.0), ImVec2(10, 8)) as is_seen:
        if is_seen:
            imgui.dummy(ImVec2(context.px(WIDTH - 20), 0))
            actions += _title(context) + _lens(context) + _horizon(context) + _size(context, room)
            actions += _views(context, corner.y + room.y - context.px(2 * MARGIN))
    return actions


def _title(context: PanelContext) -> list[Action]:
    context.theme.push_bold()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted("Camera")
    imgui.pop_font()
    widgets.same_line_at_right(2 * imgui.get_frame_height() + context.px(GAP))
    actions: list[Action] = []
    hint = f"Back to the scene's own camera. ({keys_of('own_view')})"
    if widgets.icon_button(context, "camera.reset", Icon.RESET, hint, enabled=context.camera != context.own_camera):
        actions += perform(context, "own_view")
    imgui.same_line(0.0, context.px(GAP))
    if widgets.icon_button(context, "camera.close", Icon.CLOSE, f"Close this. ({keys_of('camera_panel')})"):
        actions.append(SetPanel({"shows_camera": False, "renames": None}))
    return actions


def _lens(context: PanelContext) -> list[Action]:
    camera, own = context.camera, focal_length(context.own_camera.fov_y)

    def set_focal_length(focal: float) -> Action:
        back = camera.model_copy(update={"fov_y": context.own_camera.fov_y})  # to the last bit
        moved = back if focal == own else with_focal_length(camera, focal)
        return DragCamera(Viewpoint(moved, context.view.resolution))

    row = rows.Row(
        FOCAL_LENGTH, focal_length(camera.fov_y), set_focal_length, "camera.focal", own, CAMERA_DRAG, own,
        note=f"Here {camera.fov_y:.1f}° upright.",
    )  # fmt: skip
    return rows.draw(context, row, LABEL_WIDTH)


def _horizon(context: PanelContext) -> list[Action]:
    widgets.label(context, "Horizon", LABEL_WIDTH)
    level = is_level(context.camera)
    hint = "Turn the camera about its line of sight until the horizon is level. Orbiting keeps it level."
    if widgets.text_button(context, "camera.level", "Is level" if level else "Level", hint, enabled=not level):
        return perform(context, "level")
    return []


def _size(context: PanelContext, room: ImVec2) -> list[Action]:
    """The picture's resolution: the scene's own, its panel's, or any."""
    widgets.label(context, "Picture", LABEL_WIDTH)
    panel = (min(max(round(room.x), 1), MAX_RESOLUTION), min(max(round(room.y), 1), MAX_RESOLUTION))
    size, own = context.resolution, context.own_resolution
    choices = (
        ("Scene", f"The scene's own: {own[0]} x {own[1]} pixels."),
        ("Panel", f"As large as the panel: {panel[0]} x {panel[1]} pixels."),
        (f"{size[0]} x {size[1]}…", "Any size, with its cost."),
    )
    chosen = 0 if size == own else 1 if size == panel else 2
    pressed = widgets.segments(context, "camera.size", choices, chosen)
    if pressed == 2:
        return [SetPanel({"resolution": size})]
    return [] if pressed is None else [RunOperator("resolution", (own, panel)[pressed])]


# ---------------------------------------------------------------------------------------------------------------- views


def _views(context: PanelContext, foot: float) -> list[Action]:
    """The list of bookmarked views, as high as there is room above `foot`, and a button that bookmarks this one."""
    imgui.spacing()
    actions: list[Action] = []
    bookmarks = context.view.bookmarks
    if bookmarks:
        row = context.px(THUMBNAIL[1]) + imgui.get_style().item_spacing.y
        room = foot - imgui.get_cursor_screen_pos().y - imgui.get_frame_height() - context.px(2 * GAP)
        height = min(len(bookmarks) * row, max(room, context.px(LEAST_LIST)))
        if imgui.begin_child("views", ImVec2(context.px(WIDTH - 20), height)):
            for bookmark in bookmarks:
                actions += _view(context, bookmark)
        imgui.end_child()
    if widgets.text_button(
        context, "camera.save_view", f"{Icon.ADD}  Save this view", "Save it under a name, in the session."
    ):
        actions.append(RunOperator("save_view"))
    return actions


def _view(context: PanelContext, bookmark: Bookmark) -> list[Action]:
    """A row: the thumbnail, which goes to the view, the name, and the view's buttons."""
    name = bookmark.name
    imgui.push_id(name)
    actions: list[Action] = []
    corner, size = imgui.get_cursor_screen_pos(), ImVec2(*map(context.px, THUMBNAIL))
    if imgui.invisible_button("go", size):
        actions.append(MoveCameraTo(bookmark.viewpoint, name))
    context.handles.note_item(f"camera.view.{name}")
    camera, resolution = bookmark.viewpoint
    there = camera or context.own_camera, resolution or context.own_resolution
    is_here = there == (context.camera, context.resolution)
    _thumbnail(context, bookmark, corner, size, imgui.is_item_hovered() or is_here)
    widgets.tooltip("The camera is here." if is_here else "Go there. A view that was computed before shows at once.")
    imgui.same_line(0.0, context.px(GAP + 2))
    imgui.begin_group()
    if context.state.renames == name:
        actions += _name(context, name)
    else:
        imgui.text_unformatted(widgets.fitting(name, imgui.get_content_region_avail().x))
        if imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0):
            actions.append(SetPanel({"renames": name}))
    if widgets.icon_button(context, f"camera.update.{name}", Icon.CAMERA, f"Set {name} to this view.", not is_here):
        actions.append(RunOperator("save_view", name))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"camera.rename.{name}", Icon.EDITABLE, "Rename it."):
        actions.append(SetPanel({"renames": name}))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"camera.delete.{name}", Icon.DELETE, f"Delete {name}."):
        actions.append(SetView.of(bookmarks=remove_bookmark(context.view.bookmarks, name)))
    imgui.end_group()
    imgui.pop_id()
    return actions


def _name(context: PanelContext, name: str) -> list[Action]:
    """The name as text; Enter accepts it, and so does a click elsewhere."""
    imgui.set_next_item_width(-1.0)
    if imgui.get_io().want_text_input is False:
        imgui.set_keyboard_focus_here()
    _, typed = imgui.input_text("##name", name, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item("camera.name")
    if not imgui.is_item_deactivated():
        return []
    new = typed.strip()[: MAX_NAME + 1]
    close = SetPanel({"renames": None})
    is_renamed = imgui.is_item_deactivated_after_edit() and new != name
    return [RunOperator("rename_view", (name, new)), close] if is_renamed else [close]


def _thumbnail(context: PanelContext, bookmark: Bookmark, corner: ImVec2, size: ImVec2, lit: bool) -> None:
    draw_list, rounding = imgui.get_window_draw_list(), context.px(3)
    end = ImVec2(corner.x + size.x, corner.y + size.y)
    draw_list.add_rect_filled(corner, end, look.pack(look.WELL), rounding)
    picture = context.view_thumbnail(bookmark)
    if picture is not None:
        scale = min(size.x / picture.width, size.y / picture.height)
        width, height = scale * picture.width, scale * picture.height
        start = ImVec2(corner.x + 0.5 * (size.x - width), corner.y + 0.5 * (size.y - height))
        upper, lower = picture.corners()
        draw_list.add_image(picture.reference, start, ImVec2(start.x + width, start.y + height), upper, lower)
    else:
        extent = imgui.calc_text_size(Icon.CAMERA)
        place = ImVec2(0.5 * (corner.x + end.x - extent.x), 0.5 * (corner.y + end.y - extent.y))
        draw_list.add_text(place, look.pack(look.TEXT_FAINT), Icon.CAMERA)
    if lit:
        draw_list.add_rect(corner, end, look.pack(look.ACCENT), rounding, context.px(1.5))


# --------------------------------------------------------------------------------------------- moving it in the picture


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
