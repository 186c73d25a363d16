"""What is marked on the picture: its crop, drawn with the mouse, and pinned pixels with a list of their values."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui

from app.document.view_state import MOST_PROBES, Probe, SetView
from app.operators.registry import keys_of
from engine.render.crop import Crop
from ui import theme as look
from ui.panels import inspection, picture_overlays, stored_pictures, widgets
from ui.panels.actions import Action, BeginDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import Grip, StatusMessage
from ui.theme import Icon

CROP = "picture.crop"
DIM, MARK, REACH, MARGIN = 0.6, 5.0, 8.0, 10.0
LEGEND, ZOOM = 76.0, 44.0  # heights at the panel's lower edge
LIST_WIDTH, BESIDE = 320.0, 260.0  # of the list, and of the legend of errors at the left

# ------------------------------------------------------------------------------------------------------------- the crop


def begin_crop(placed: PictureRect, mouse: ImVec2) -> list[Action]:
    """Begin to draw it, from a corner in fractions of the picture."""
    return [BeginDrag("crop"), HoldGrip(Grip(CROP, _place(placed, mouse)))]


def drag_crop(placed: PictureRect, grip: Grip, mouse: ImVec2) -> list[Action]:
    """The crop from there to the mouse; none while that is less than a pixel."""
    crop = Crop.between(grip.offset, _place(placed, mouse))
    is_small = crop is None or min(
        (crop.right - crop.left) * placed.width, (crop.lower - crop.upper) * placed.height
    ) < max(placed.scale, 2.0)
    return [] if is_small else [SetView.of(crop=crop)]


def end_crop() -> list[Action]:
    """The next drag is an ordinary one again."""
    return [SetPanel({"draws_crop": False})]


def draw_crop(context: PanelContext, placed: PictureRect) -> None:
    """Dim what is outside, whole pixels as they are saved, and draw a line around the rest."""
    crop, picture = context.view.crop, context.picture
    if crop is None or picture is None:
        return
    x, y, width, height = crop.box((picture.width, picture.height))
    across, down = placed.width / picture.width, placed.height / picture.height
    # Whole pixels of the screen: smooth edges of rectangles side by side would show as lines.
    left, right = (round(placed.x + column * across) for column in (x, x + width))
    top, low = (round(placed.y + row * down) for row in (y, y + height))
    end_x, end_y = placed.x + placed.width, placed.y + placed.height
    draw_list, ink = imgui.get_window_draw_list(), look.pack(look.grey(0, DIM))
    for x0, y0, x1, y1 in (
        (placed.x, placed.y, end_x, top), (placed.x, low, end_x, end_y), (placed.x, top, left, low),
        (right, top, end_x, low),
    ):  # fmt: skip
        if x1 > x0 and y1 > y0:
            draw_list.add_rect_filled(ImVec2(x0, y0), ImVec2(x1, y1), ink)
    draw_list.add_rect(ImVec2(left, top), ImVec2(right, low), look.pack(look.grey(230, 0.8)), 0.0, context.px(1))


def crop_label(context: PanelContext) -> str:
    """What is said over the picture of its crop, or of how to draw one; "" for nothing."""
    if context.state.draws_crop:
        return "Drag a rectangle over the picture; Esc leaves"
    crop, picture = context.view.crop, context.picture
    if crop is None or picture is None:
        return ""
    _, _, width, height = crop.box((picture.width, picture.height))
    return f"Crop {width} x {height} ({keys_of('clear_crop')})"


def _place(placed: PictureRect, mouse: ImVec2) -> tuple[float, float]:
    return (mouse.x - placed.x) / max(placed.width, 1.0), (mouse.y - placed.y) / max(placed.height, 1.0)


# -------------------------------------------------------------------------------------------------------- pinned pixels


def pin(context: PanelContext, placed: PictureRect, picture: Picture) -> list[Action]:
    """Pin the pixel under the mouse, where a key asked for it; or unpin the one that is there."""
    if not context.state.pins_probe:
        return []
    done: list[Action] = [SetPanel({"pins_probe": False})]
    mouse, probes = imgui.get_mouse_pos(), context.view.probes
    pixel = placed.pixel(mouse.x, mouse.y, picture)
    if pixel is None or not imgui.is_item_hovered():
        return [*done, _say(context, "put the mouse on the pixel that is to be pinned")]
    reach = context.px(REACH)  # where pixels are large, the whole pixel is the pin's
    near = [each for each in probes if _distance(placed, each, mouse) <= reach or pixel_of(each, picture) == pixel]
    if near:
        nearest = min(near, key=lambda each: _distance(placed, each, mouse))
        return [*done, SetView.of(probes=tuple(each for each in probes if each is not nearest))]
    if len(probes) == MOST_PROBES:
        return [*done, _say(context, f"{MOST_PROBES} pixels are pinned; unpin one first")]
    probe = (pixel[0] + 0.5) / picture.width, (pixel[1] + 0.5) / picture.height
    return [*done, SetView.of(probes=(*probes, probe))]


def _say(context: PanelContext, text: str) -> Action:
    return SetPanel({"message": StatusMessage(text, context.now)})


def _distance(placed: PictureRect, probe: Probe, mouse: ImVec2) -> float:
    return math.hypot(placed.x + probe[0] * placed.width - mouse.x, placed.y + probe[1] * placed.height - mouse.y)


def pixel_of(probe: Probe, picture: Picture) -> tuple[int, int]:
    """The pixel (column, row) of a picture that a probe is on."""
    return min(int(probe[0] * picture.width), picture.width - 1), min(
        int(probe[1] * picture.height), picture.height - 1
    )


def draw_probes(context: PanelContext, placed: PictureRect) -> None:
    """A numbered ring around each pinned pixel."""
    draw_list = imgui.get_window_draw_list()
    for number, (u, v) in enumerate(context.view.probes, 1):
        at = ImVec2(placed.x + u * placed.width, placed.y + v * placed.height)
        context.handles.note(f"viewport.probe.{number}", at.x, at.y)
        radius = max(context.px(MARK), 0.75 * placed.scale)
        draw_list.add_circle(at, radius, look.pack(look.grey(0, 0.8)), 0, context.px(3))
        draw_list.add_circle(at, radius, look.pack(look.ACCENT), 0, context.px(1.5))
        picture_overlays.plate(
            context, draw_list, ImVec2(at.x + radius + context.px(8), at.y - context.px(9)), str(number), look.TEXT
        )


def draw_list_of_probes(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The values of pinned pixels, in the panel's lower right corner: linear light, and stops above the first."""
    probes, picture = context.view.probes, context.picture
    if not probes or picture is None or room.x < context.px(LIST_WIDTH):
        return []
    actions: list[Action] = []
    # Above the legend of stops, or the zoom.
    foot = LEGEND if inspection.shows_stops(context) else MARGIN if context.view.fit else ZOOM
    if stored_pictures.legend(context) and room.x < context.px(LIST_WIDTH + BESIDE):
        foot = max(foot, LEGEND)
    at = ImVec2(corner.x + room.x - context.px(MARGIN), corner.y + room.y - context.px(foot))
    with widgets.strip(context, "Pinned pixels###probes", at, ImVec2(1.0, 1.0), ImVec2(10, 8)) as is_seen:
        if is_seen and imgui.begin_table("probes", 5, imgui.TableFlags_.sizing_fixed_fit):
            first: float | None = None
            for number, probe in enumerate(probes, 1):
                column, row = pixel_of(probe, picture)
                values = context.values_at(column, row, context.state.values_side)
                first = values.stops if values is not None and first is None else first
                linear = "" if values is None else "  ".join(f"{value:.3g}" for value in values.radiance)
                stops = "" if values is None else _stops(values.stops, first, number)
                for text in (str(number), f"{column}, {row}", linear, stops):
                    imgui.table_next_column()
                    imgui.align_text_to_frame_padding()
                    imgui.text_unformatted(text)
                imgui.table_next_column()
                hint = f"Unpin this pixel. ({keys_of('pin_probe')} with the mouse on it)"
                if widgets.icon_button(context, f"probe.{number}", Icon.CLOSE, hint):
                    actions.append(SetView.of(probes=tuple(each for each in probes if each is not probe)))
            imgui.end_table()
    return actions


def _stops(stops: float, first: float | None, number: int) -> str:
    """Of the first above middle grey, of others above the first."""
    if number == 1 or first is None or math.isinf(stops) or math.isinf(first):
        return f"{stops:+.2f} stops"
    return f"{stops - first:+.2f} to 1"
