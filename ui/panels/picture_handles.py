"""Handles over the picture that can be dragged: a mode's own, and those of the selected object's transform.

A handle is defined by where it is for a value; the value that a drag means follows by a few steps of Newton's method in
the picture's plane (`value_at`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.system.lazy_import import import_named
from engine.core.camera import camera_frame, project
from engine.scene.arrangement import PlacedObject
from engine.scene.camera_moves import distance
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, BeginDrag, HoldGrip, RunOperator
from ui.panels.context import PanelContext
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import ArrangeGrip, Grip

Float64Array = NDArray[np.float64]
Place = tuple[float, float]
RADIUS, REACH = 6.0, 10.0
_ROUNDS = 4
_LEAST_DRAG = 0.5  # pixels that the mouse went from where it was pressed
_LEAST_MOVE = 5e-6  # of a handle by a step, pixels
_NEAREST = 1e-3  # of the distance to the target; a point behind the camera has no place in the picture


@dataclass(frozen=True)
class PictureHandle:
    """A grip at a place on screen, a line with it; the action of dragging it to a place, as one step of the history
    called `label`; hint: its tooltip; by_line: whether it can be grabbed anywhere along the line; ink: its colour;
    selects: the path that is selected when it is grabbed, "" for none; start: the objects that it moves, as they
    stand."""

    name: str
    place: Place
    line: Sequence[Place]
    label: str
    hint: str
    drag: Callable[[Place], list[Action]]
    by_line: bool = False
    ink: look.Colour = look.grey(240)
    selects: str = ""
    start: tuple[PlacedObject, ...] = ()

    def distance_to(self, x: float, y: float) -> float:
        """The distance of a place on screen from where it can be grabbed."""
        spot = complex(x, y)
        ends = [complex(*each) for each in self.line] if self.by_line else []
        return min(
            [
                abs(spot - complex(*self.place)),
                *(abs(spot - nearest_on_line(spot, *pair)) for pair in zip(ends, ends[1:], strict=False)),
            ]
        )


def handles_of(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The mode's handles."""
    return import_named(context.mode.handles)(context, placed) if context.mode.handles else []


def on_screen(context: PanelContext, placed: PictureRect, points: Float64Array) -> Float64Array | None:
    """Points (N, 3) of the scene on screen (N, 2); None where one is beside or behind the camera."""
    towards = points - np.array(context.camera.position)
    if not (towards @ camera_frame(context.camera)[2] > _NEAREST * distance(context.camera)).all():
        return None
    size = max(round(placed.width), 1), max(round(placed.height), 1)
    return np.asarray(project(context.camera, size, towards) + (placed.x, placed.y))


def value_at(
    seen: Callable[[float], Float64Array | None], value: float, to: Place, step: float, furthest: float,
    limits: tuple[float, float],
) -> float:  # fmt: skip
    """The value within limits with which a handle is nearest to a place on screen; seen: where it is (2,) for a value,
    None where that is not in front of the camera. value: the present one; step: of differences; furthest: the most that
    it changes in a step of Newton's method."""
    low, high = limits
    for _ in range(_ROUNDS):
        aside = step if value + step <= high else -step
        here, there = seen(value), seen(value + aside)
        if here is None or there is None:
            break
        slope = (there - here) / aside
        steepness = float(slope @ slope)
        if steepness * step * step < _LEAST_MOVE**2:  # it moves towards the camera: the pointer determines no value
            break
        wanted = float(slope @ (np.array(to) - here)) / steepness
        value = min(max(value + min(max(wanted, -furthest), furthest), low), high)
    return value


def under_mouse(context: PanelContext, handles: Sequence[PictureHandle]) -> PictureHandle | None:
    """The handle that a press would grab: of several the nearest, and a small one before one along a line."""
    mouse = imgui.get_mouse_pos()
    away = [(each.by_line, each.distance_to(mouse.x, mouse.y), i) for i, each in enumerate(handles)]
    near = [each for each in away if each[1] <= context.px(REACH)]
    return handles[min(near)[2]] if near else None


def nearest_on_line(spot: complex, start: complex, end: complex) -> complex:
    """The point of a line segment that is nearest to another."""
    along = end - start
    share = ((spot - start) * along.conjugate()).real / max(abs(along) ** 2, 1e-12)
    return start + min(max(share, 0.0), 1.0) * along


def held_handle(context: PanelContext, handles: Sequence[PictureHandle]) -> PictureHandle | None:
    """The handle that is being dragged."""
    grip = context.state.grip
    return next((each for each in handles if grip is not None and grip.handle == each.name), None)


def take_hold(handle: PictureHandle) -> list[Action]:
    """Grab a handle under the mouse, which keeps its offset from the mouse."""
    mouse = imgui.get_mouse_pos()
    offset = mouse.x - handle.place[0], mouse.y - handle.place[1]
    selection = [RunOperator("select", handle.selects)] if handle.selects else []
    grip = ArrangeGrip(handle.name, offset, handle.start) if handle.start else Grip(handle.name, offset)
    return [*selection, BeginDrag(handle.label), HoldGrip(grip)]


def drag_actions(context: PanelContext, handle: PictureHandle) -> list[Action]:
    """The actions of the drag by now; none of a click, whose grip is where it was up to rounding."""
    grip, mouse = context.state.grip, imgui.get_mouse_pos()
    assert grip is not None
    if not imgui.is_mouse_dragging(imgui.MouseButton_.left, _LEAST_DRAG):
        return []
    return handle.drag((mouse.x - grip.offset[0], mouse.y - grip.offset[1]))


def hover(handle: PictureHandle) -> None:
    """Show its tooltip."""
    imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
    widgets.tooltip(handle.hint)


def draw_handles(context: PanelContext, handles: Sequence[PictureHandle]) -> None:
    """Draw over the picture, in the panel's draw list: thin, and legible on any background. They are registered for
    scripts."""
    draw_list = imgui.get_window_draw_list()
    lit = held_handle(context, handles) or (under_mouse(context, handles) if imgui.is_item_hovered() else None)
    for handle in handles:
        points: list[ImVec2 | tuple[float, float] | list[float]] = [ImVec2(*place) for place in handle.line]
        ink = look.ACCENT if handle is lit else look.with_alpha(handle.ink, 0.9)
        for width, colour in ((4.0, look.grey(0, 0.45)), (2.0, ink)):
            draw_list.add_polyline(points, look.pack(colour), context.px(width), 0)
    for handle in handles:
        context.handles.note(handle.name, *handle.place)
        middle, radius = ImVec2(*handle.place), context.px(RADIUS)
        ink = look.ACCENT if handle is lit else handle.ink
        draw_list.add_circle_filled(middle, radius + context.px(1.5), look.pack(look.grey(0, 0.55)))
        draw_list.add_circle_filled(middle, radius, look.pack(ink))
