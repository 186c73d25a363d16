"""The place of the picture in its panel, fitted, or zoomed and panned; and the gestures that change it.

With Ctrl and Alt held the wheel zooms about the mouse and a drag pans the picture: without them both move the camera
(`ui.panels.camera`). Rejected: leaving empty room beside a picture that is larger than its panel; it stops at
its edges, so that it cannot be lost.
"""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.document.view_state import LIMITS, SetView, ViewState
from ui.panels.actions import Action, HoldGrip
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.window_state import Grip

PAN = "picture.pan"
ZOOM_STEP = 1.2


@dataclass(frozen=True)
class PictureRect:
    """The place of the picture on screen: upper left corner, and screen pixels per pixel of the picture."""

    x: float
    y: float
    width: float
    height: float
    scale: float

    def pixel(self, x: float, y: float, picture: Picture) -> tuple[int, int] | None:
        """(column, row) of the picture under a screen position; None beside it."""
        across, down = (x - self.x) / self.scale, (y - self.y) / self.scale  # infinite where the mouse is nowhere
        is_inside = 0.0 <= across < picture.width and 0.0 <= down < picture.height
        return (int(across), int(down)) if is_inside else None

    def point(self, x: float, y: float) -> tuple[float, float]:
        """The place of a screen position on the picture, in its pixels; also beside it."""
        return (x - self.x) / self.scale, (y - self.y) / self.scale


@dataclass(frozen=True)
class ViewportRect:
    """The panel's inside: upper left corner and size on screen, for one picture."""

    x: float
    y: float
    width: float
    height: float
    picture: Picture

    @property
    def fitting(self) -> float:
        """The scale at which all of the picture is visible, as large as its aspect ratio allows."""
        return min(self.width / self.picture.width, self.height / self.picture.height)

    def place(self, view: ViewState) -> PictureRect:
        """The picture's place in this view."""
        if view.fit:
            return self.at(self.fitting, self.x, self.y)
        (u, v), scale = view.centre, view.zoom
        width, height = scale * self.picture.width, scale * self.picture.height
        return self.at(scale, self.x + 0.5 * self.width - u * width, self.y + 0.5 * self.height - v * height)

    def at(self, scale: float, x: float, y: float) -> PictureRect:
        """The picture with its corner as near to a place as its size allows."""
        width, height = scale * self.picture.width, scale * self.picture.height
        left, top = _start(self.x, self.width, width, x), _start(self.y, self.height, height, y)
        return PictureRect(round(left), round(top), round(width), round(height), scale)

    def shown(self, scale: float, x: float, y: float) -> SetView:
        """The change of view that puts the picture's corner there."""
        placed = self.at(scale, x, y)
        u = (self.x + 0.5 * self.width - placed.x) / max(placed.width, 1.0)
        v = (self.y + 0.5 * self.height - placed.y) / max(placed.height, 1.0)
        return SetView.of(fit=False, zoom=scale, centre=(u, v))


def viewport_rect(corner: ImVec2, size: ImVec2, picture: Picture) -> ViewportRect:
    """The rectangle of a panel."""
    return ViewportRect(corner.x, corner.y, size.x, size.y, picture)


def pane_places(
    room: tuple[float, float], count: int, aspect: float, label: float, gap: float
) -> list[tuple[float, float, float, float]]:
    """The places (x, y, width, height) of so many panes in a room, row by row: so that a picture of this aspect ratio
    is as large as possible in each, above a label of this height, with gaps between."""

    def place(columns: int) -> tuple[float, float]:
        rows = -(-count // columns)
        return (room[0] - (columns - 1) * gap) / columns, (room[1] - (rows - 1) * gap) / rows

    def picture_width(columns: int) -> float:
        width, height = place(columns)
        return min(width, (height - label) * aspect)

    columns = max((n for n in range(1, count + 1) if count % n == 0), key=picture_width)
    width, height = place(columns)
    return [
        (round((n % columns) * (width + gap)), round((n // columns) * (height + gap)), int(width), int(height))
        for n in range(count)
    ]


def _start(corner: float, room: float, extent: float, wanted: float) -> float:
    """Where the picture begins along one axis: in the middle where it is the smaller, else so that the panel is
    full."""
    if extent <= room:
        return corner + 0.5 * (room - extent)
    return min(max(wanted, corner + room - extent), corner)


def zoom_at(room: ViewportRect, placed: PictureRect, steps: float, x: float, y: float) -> SetView:
    """Zoom by so many steps about a place on screen; no smaller than all of it, or than pixel for pixel."""
    least, most = min(room.fitting, 1.0), LIMITS["zoom"][1]
    scale = min(max(placed.scale * ZOOM_STEP**steps, least), most)
    if scale == least == room.fitting:
        return SetView.of(fit=True)
    column, row = placed.point(x, y)
    return room.shown(scale, x - column * scale, y - row * scale)


def is_magnifying() -> bool:
    """Whether the keys are held with which the mouse zooms and pans."""
    io = imgui.get_io()
    return bool(io.key_ctrl and io.key_alt)


def gestures(context: PanelContext, room: ViewportRect, placed: PictureRect, pane: str = "") -> list[Action]:
    """Zoom and pan, over the item drawn last; pane: where there are several, its name."""
    io, grip = imgui.get_io(), context.state.grip
    mouse = imgui.get_mouse_pos()
    if grip is not None:
        ends = grip.handle.startswith(PAN) and not _is_pressed()
        return _pan(room, placed, grip, mouse) if ends or grip.handle == f"{PAN}{pane}" else []
    if not (imgui.is_item_hovered() and is_magnifying()):
        return []
    if imgui.is_mouse_clicked(0) or imgui.is_mouse_clicked(2):
        return [HoldGrip(Grip(f"{PAN}{pane}", (mouse.x - placed.x, mouse.y - placed.y)))]
    wheel = io.mouse_wheel
    return [zoom_at(room, placed, wheel, mouse.x, mouse.y)] if wheel else []


def _is_pressed() -> bool:
    """Whether a button is down that pans."""
    return bool(imgui.is_mouse_down(0) or imgui.is_mouse_down(2))


def _pan(room: ViewportRect, placed: PictureRect, grip: Grip, mouse: ImVec2) -> list[Action]:
    if not _is_pressed():
        return [HoldGrip(None)]
    imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
    x, y = mouse.x - grip.offset[0], mouse.y - grip.offset[1]
    moved = room.at(placed.scale, x, y)
    return [room.shown(placed.scale, x, y)] if (moved.x, moved.y) != (placed.x, placed.y) else []
