"""Box select: after its key a rectangle is dragged over the picture, and what is seen in it is selected.

An object is in it where a pixel of it is; a lamp also by its middle, because it may be too small to be seen, or turned
away. What is in a group comes with its group, as with a click. With Shift held when the button is let go the objects
are selected as well, with Ctrl no longer. Esc or a right click leaves it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.arranging import placed_objects
from app.document.document import Document
from app.document.selection import group_around
from app.document.view_state import ViewState
from app.operators.selecting import BoxMode
from engine.core.camera import camera_frame, project
from engine.scene.description import Camera
from ui import theme as look
from ui.panels.actions import Action, HoldGrip, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.panels.picture_overlays import has_moved, plate
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import BoxGrip, StatusMessage

Box = tuple[float, float, float, float]  # left, top, right, bottom, pixels of the picture
HOW = "Box select: drag over objects.  Shift adds, Ctrl removes, Esc leaves"
NOT_THERE = "the picture has moved on from the objects that it knows; select again when it is there"
_LEAST = 3.0  # pixels: a rectangle that is smaller was a click


def begin(context: PanelContext) -> list[Action]:
    """Wait for a rectangle."""
    if context.picture is None or context.state.grip is not None:
        return []
    if _has_moved_on(context):
        return [SetPanel({"message": StatusMessage(NOT_THERE, context.now)})]
    mouse = imgui.get_mouse_pos()
    return [HoldGrip(BoxGrip("box", (mouse.x, mouse.y)))]


def go_on(context: PanelContext, placed: PictureRect, picture: Picture) -> list[Action]:
    """The actions of the mouse by now; draws the rectangle."""
    grip, mouse = context.state.grip, imgui.get_mouse_pos()
    assert isinstance(grip, BoxGrip)
    if _has_moved_on(context):
        return [HoldGrip(None), SetPanel({"message": StatusMessage(NOT_THERE, context.now)})]
    if imgui.is_mouse_clicked(imgui.MouseButton_.right):
        return [HoldGrip(None)]
    _draw(context, placed, grip, mouse)
    if not grip.is_drawn:
        if imgui.is_mouse_clicked(imgui.MouseButton_.left):
            return [HoldGrip(replace(grip, offset=(mouse.x, mouse.y), is_drawn=True))]
        return []
    if imgui.is_mouse_down(imgui.MouseButton_.left):
        return []
    io, ends = imgui.get_io(), (grip.offset, (mouse.x, mouse.y))
    mode: BoxMode = "remove" if io.key_ctrl else "add" if io.key_shift else "replace"
    if max(abs(ends[1][0] - ends[0][0]), abs(ends[1][1] - ends[0][1])) < context.px(_LEAST):
        return [HoldGrip(None)]
    box = box_between(placed.point(*ends[0]), placed.point(*ends[1]))
    lamps = lamp_places(context.document, context.resting_box_of, context.camera, (picture.width, picture.height))
    found = names_in(context.document, context.objects_in(*box), lamps, box)
    return [HoldGrip(None), RunOperator("select", boxed(context.view, found, mode))]


def _has_moved_on(context: PanelContext) -> bool:
    """Whether the picture shows another view than the one whose objects are known."""
    status = context.status
    return status.is_away and (status.follows_input or status.draws_moving and has_moved(context))


def box_between(start: tuple[float, float], end: tuple[float, float]) -> Box:
    """The rectangle between two corners."""
    (x, y), (u, v) = start, end
    return min(x, u), min(y, v), max(x, u), max(y, v)


def lamp_places(
    document: Document, resting_box: Callable[[str], NDArray[np.float64] | None], camera: Camera,
    resolution: tuple[int, int],
) -> dict[str, tuple[float, float]]:  # fmt: skip
    """Where the middles of the shown lamps are in the picture, pixels, of those in front of the camera."""
    places = dict[str, tuple[float, float]]()
    lamps = [state.name for state in document.shown if state.emits]
    for lamp in placed_objects(document, lamps, resting_box):
        towards = lamp.centre - np.array(camera.position)
        if towards @ camera_frame(camera)[2] > 0.0:
            x, y = project(camera, resolution, towards).tolist()
            places[lamp.name] = x, y
    return places


def names_in(
    document: Document, seen: Iterable[str], lamps: Mapping[str, tuple[float, float]], box: Box
) -> tuple[str, ...]:
    """The objects in a rectangle, with those of their groups: what is seen in it, and lamps whose middle is."""
    left, top, right, bottom = box
    there = [name for name, (x, y) in lamps.items() if left <= x <= right and top <= y <= bottom]
    found = {name for each in (*seen, *there) for name in group_around(document, each)}
    return tuple(state.name for state in document.objects if state.name in found and state.visible)


def boxed(view: ViewState, found: tuple[str, ...], mode: BoxMode) -> tuple[str, ...] | None:
    """What is selected then: the active object stays that, where it still is selected."""
    now = view.selected_objects
    if mode == "remove":
        names = tuple(name for name in now if name not in found)
    else:
        names = tuple(dict.fromkeys((*now, *found))) if mode == "add" else found
    active = [name for name in now[-1:] if name in names]
    return (*(name for name in names if name not in active), *active) or None


def _draw(context: PanelContext, placed: PictureRect, grip: BoxGrip, mouse: ImVec2) -> None:
    """Lines through the mouse, then the rectangle."""
    draw_list, ink = imgui.get_window_draw_list(), look.pack(look.grey(240, 0.9))
    shade = look.pack(look.grey(0, 0.45))
    imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
    if grip.is_drawn:
        corner = ImVec2(*grip.offset)
        draw_list.add_rect_filled(corner, mouse, look.pack(look.with_alpha(look.ACCENT, 0.12)))
        for width, colour in ((3.0, shade), (1.0, ink)):
            draw_list.add_rect(corner, mouse, colour, thickness=context.px(width))
    else:
        far_x, far_y = placed.x + placed.width, placed.y + placed.height
        for start, end in (
            (ImVec2(placed.x, mouse.y), ImVec2(far_x, mouse.y)), (ImVec2(mouse.x, placed.y), ImVec2(mouse.x, far_y)),
        ):  # fmt: skip
            for width, colour in ((3.0, shade), (1.0, ink)):
                draw_list.add_line(start, end, colour, context.px(width))
    place = ImVec2(max(placed.x, 0.0) + context.px(12), max(placed.y, 0.0) + context.px(10))
    plate(context, draw_list, place, HOW, look.TEXT)
