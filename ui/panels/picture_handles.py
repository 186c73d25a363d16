"""Handles in the picture that can be dragged: a grip at the end of a line. Each mode defines its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.system.lazy_import import import_named
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, BeginDrag, HoldGrip
from ui.panels.context import PanelContext
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import Grip

Place = tuple[float, float]
RADIUS, REACH = 6.0, 10.0


@dataclass(frozen=True)
class PictureHandle:
    """A grip at a place on screen, a line with it; the action of dragging it to a place, as one step of the history
    called `label`; hint: its tooltip; by_line: whether it can be grabbed anywhere along the line."""

    name: str
    place: Place
    line: Sequence[Place]
    label: str
    hint: str
    drag: Callable[[Place], list[Action]]
    by_line: bool = False

    def distance_to(self, x: float, y: float) -> float:
        """The distance of a place on screen from where it can be grabbed."""
        spot = complex(x, y)
        ends = [complex(*each) for each in self.line] if self.by_line else []
        return min(
            [
                abs(spot - complex(*self.place)),
                *(_distance_to_line(spot, *pair) for pair in zip(ends, ends[1:], strict=False)),
            ]
        )


def handles_of(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The mode's handles; registered for scripts."""
    found: list[PictureHandle] = import_named(context.mode.handles)(context, placed) if context.mode.handles else []
    for handle in found:
        context.handles.note(handle.name, *handle.place)
    return found


def under_mouse(context: PanelContext, handles: Sequence[PictureHandle]) -> PictureHandle | None:
    """The handle that a press would grab: of several the nearest, and a small one before one along a line."""
    mouse = imgui.get_mouse_pos()
    away = [(each.by_line, each.distance_to(mouse.x, mouse.y), i) for i, each in enumerate(handles)]
    near = [each for each in away if each[1] <= context.px(REACH)]
    return handles[min(near)[2]] if near else None


def _distance_to_line(spot: complex, start: complex, end: complex) -> float:
    """The distance from a line segment."""
    along = end - start
    share = ((spot - start) * along.conjugate()).real / max(abs(along) ** 2, 1e-12)
    return abs(spot - start - min(max(share, 0.0), 1.0) * along)


def held_handle(context: PanelContext, handles: Sequence[PictureHandle]) -> PictureHandle | None:
    """The handle that is being dragged."""
    grip = context.state.grip
    return next((each for each in handles if grip is not None and grip.handle == each.name), None)


def take_hold(handle: PictureHandle) -> list[Action]:
    """Grab a handle under the mouse, which keeps its offset from the mouse."""
    mouse = imgui.get_mouse_pos()
    offset = mouse.x - handle.place[0], mouse.y - handle.place[1]
    return [BeginDrag(handle.label), HoldGrip(Grip(handle.name, offset))]


def drag_actions(context: PanelContext, handle: PictureHandle) -> list[Action]:
    """The actions of the drag by now."""
    grip, mouse = context.state.grip, imgui.get_mouse_pos()
    assert grip is not None
    return handle.drag((mouse.x - grip.offset[0], mouse.y - grip.offset[1]))


def hover(handle: PictureHandle) -> None:
    """Show its tooltip."""
    imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
    widgets.tooltip(handle.hint)


def draw(context: PanelContext, handles: Sequence[PictureHandle]) -> None:
    """Draw over the picture, in the panel's draw list: thin, and legible on any background."""
    draw_list = imgui.get_window_draw_list()
    lit = held_handle(context, handles) or (under_mouse(context, handles) if imgui.is_item_hovered() else None)
    for handle in handles:
        points: list[ImVec2 | tuple[float, float] | list[float]] = [ImVec2(*place) for place in handle.line]
        ink = look.ACCENT if handle is lit else look.grey(235, 0.9)
        for width, colour in ((3.5, look.grey(0, 0.45)), (1.4, ink)):
            draw_list.add_polyline(points, look.pack(colour), context.px(width), 0)
    for handle in handles:
        middle, radius = ImVec2(*handle.place), context.px(RADIUS)
        ink = look.ACCENT if handle is lit else look.grey(240)
        draw_list.add_circle_filled(middle, radius + context.px(1.5), look.pack(look.grey(0, 0.55)))
        draw_list.add_circle_filled(middle, radius, look.pack(ink))
