"""The comparison with a stored picture: what is shown of both over the picture, and the strip that chooses it."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.view_state import DIFFERENCES, Difference
from app.operators.registry import keys_of
from engine.render.display import LEAST_ERROR, MOST_ERROR
from engine.render.picture_difference import signed_colours
from ui import theme as look
from ui.panels import picture_overlays, widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.theme import Icon

MARGIN, LIST_WIDTH, WIDE, LEAST = 10.0, 120.0, 640.0, 300.0
HEIGHT = 52.0  # of the strip in a wide panel, with its margin
CHOICES: dict[Difference, tuple[str, str]] = {
    "present": ("Now", "The present picture."),
    "stored": ("Stored", "The stored picture, in the same exposure and view."),
    "split": ("Split", "The stored picture left of a divider, the present one right of it."),
    "signed": ("Signed", "The difference of luminance: red where the present picture is brighter, blue where darker."),
    "absolute": ("Absolute", "The size of the difference in all channels, in the colours of the error map."),
}
LEGENDS = {
    "signed": "Darker or brighter than stored",
    "absolute": "Difference, relative to the mean",
}
TICKS = (-0.1, -0.01, 0.01, 0.1)
N_SHADES = 48
ERROR_HINT = (
    "relRMSE of the present picture: the root mean square of the difference divided by the stored picture's mean, in "
    "linear light, both clamped at its 99.9th percentile."
)


def overlay(context: PanelContext) -> Difference | None:
    """What of the comparison lies over the present picture, where there is something."""
    view, board = context.view, context.difference
    if not view.stored or (board.refusal and view.difference != "stored"):
        return None
    return None if _over(context) is None else view.difference


def _over(context: PanelContext) -> Picture | None:
    board = context.difference
    pictures: dict[Difference, Picture | None] = {
        "present": None, "stored": board.stored, "split": board.stored, "signed": board.colours,
        "absolute": board.colours,
    }  # fmt: skip
    return pictures[context.view.difference]


def is_split(context: PanelContext) -> bool:
    """Whether a divider is between the stored and the present picture."""
    return overlay(context) == "split"


def shows_present(context: PanelContext) -> bool:
    """Whether the present picture is seen, or a part of it."""
    return overlay(context) in (None, "split")


def stored_place(context: PanelContext, placed: PictureRect) -> PictureRect:
    """The place of the stored picture: as large as it is within that of the picture, in its own shape."""
    picture = context.difference.stored
    if picture is None:
        return placed
    scale = min(placed.width / picture.width, placed.height / picture.height)
    width, height = round(scale * picture.width), round(scale * picture.height)
    if abs(width - placed.width) <= 1 and abs(height - placed.height) <= 1:
        return placed
    x, y = placed.x + (placed.width - width) // 2, placed.y + (placed.height - height) // 2
    return PictureRect(x, y, width, height, scale)


def draw_over_picture(context: PanelContext, placed: PictureRect) -> None:
    """What is compared, in the place of the picture, in the panel's draw list."""
    view, picture, draw_list = context.view, _over(context), imgui.get_window_draw_list()
    if picture is None or overlay(context) is None:
        return
    place = stored_place(context, placed) if view.difference == "stored" else placed
    if place != placed:
        end = ImVec2(placed.x + placed.width, placed.y + placed.height)
        draw_list.add_rect_filled(ImVec2(placed.x, placed.y), end, look.pack(look.BACKDROP))
    share = min(max(view.compare_divider, 0.0), 1.0) if view.difference == "split" else 1.0
    end = ImVec2(place.x + share * place.width, place.y + place.height)
    draw_list.add_image(picture.reference, ImVec2(place.x, place.y), end, ImVec2(0, 0), ImVec2(share, 1))


def legend(context: PanelContext) -> str:
    """The words above the legend of false colours, "" where there are none."""
    return LEGENDS.get(overlay(context) or "", "")


def draw_legend(context: PanelContext, draw_list: imgui.ImDrawList, corner: ImVec2, room: float) -> None:
    """The legend's bar from an upper left corner, in this width."""
    if context.view.difference == "absolute":
        picture_overlays.draw_legend(context, draw_list, corner, room)
        return
    bar, span = context.px(picture_overlays.BAR), np.log(MOST_ERROR / LEAST_ERROR)
    places = (np.arange(N_SHADES) + 0.5) / N_SHADES * 2.0 - 1.0  # -1: the end of what is darker
    shares = np.sign(places) * LEAST_ERROR * np.exp(np.abs(places) * span)
    for i, colour in enumerate(signed_colours(shares)):
        left, right = (corner.x + room * n / N_SHADES for n in (i, i + 1))
        ink = look.pack((float(colour[0]), float(colour[1]), float(colour[2]), 1.0))
        draw_list.add_rect_filled(ImVec2(left, corner.y), ImVec2(right, corner.y + bar), ink)
    imgui.push_font(None, look.SMALL_SIZE)
    for share in TICKS:
        text = f"{100.0 * share:+g} %"
        place = 0.5 + 0.5 * np.sign(share) * np.log(abs(share) / LEAST_ERROR) / span
        x = corner.x + room * place - 0.5 * imgui.calc_text_size(text).x
        draw_list.add_text(ImVec2(x, corner.y + bar + context.px(2)), look.pack(look.TEXT_SOFT), text)
    imgui.pop_font()


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The strip at the picture's upper edge, while there is a comparison and room for it."""
    if not context.view.stored or room.x < context.px(LEAST):
        return []
    actions: list[Action] = []
    at = ImVec2(corner.x + 0.5 * room.x, corner.y + context.px(MARGIN))
    with widgets.strip(context, "Stored picture###stored", at, ImVec2(0.5, 0.0), ImVec2(10, 8)) as is_seen:
        if is_seen:
            is_wide = room.x >= context.px(WIDE)
            actions += _names(context)
            if is_wide:
                imgui.same_line()
                actions += _choice(context)
                imgui.same_line()
                _number(context, room.x)
                imgui.same_line()
                actions += _buttons(context)
            else:
                imgui.same_line()
                actions += _buttons(context)
                actions += _choice(context)
                _number(context, room.x)
    return actions


def _names(context: PanelContext) -> list[Action]:
    names = context.stored_names
    chosen = [i for i, name in enumerate(names) if name == context.view.stored]
    imgui.set_next_item_width(context.px(LIST_WIDTH))
    choices = [widgets.Choice(name) for name in names]
    hint = f"The stored picture that is compared. ({keys_of('store_picture')} stores another)"
    picked = widgets.choose(context, "stored.name", choices, chosen, hint, shown=context.view.stored)
    return [] if picked is None else [RunOperator("compare_with", names[picked])]


def _choice(context: PanelContext) -> list[Action]:
    chosen = DIFFERENCES.index(context.view.difference)
    pressed = widgets.segments(context, "stored.show", [CHOICES[each] for each in DIFFERENCES], chosen)
    return [] if pressed is None else [RunOperator("difference", DIFFERENCES[pressed])]


def error_text(error: float) -> str:
    """A relRMSE in percent, of three digits: "1.80 %", "111 %"."""
    percent = 100.0 * error
    return f"{percent:#.3g} %" if percent < 99.95 else f"{percent:.0f} %"


def _number(context: PanelContext, room: float) -> None:
    """relRMSE, or why there is none."""
    board = context.difference
    imgui.align_text_to_frame_padding()
    if board.refusal:
        imgui.push_style_color(imgui.Col_.text, look.pack(look.BAD))
        imgui.text_unformatted(widgets.shortened("another size", 0.5 * room))
        imgui.pop_style_color()
        widgets.tooltip(board.refusal)
        return
    # Of the same width while it changes, so that the strip does not tremble.
    text = "relRMSE …" if board.error is None else f"relRMSE {error_text(board.error)}"
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT if board.is_behind else look.TEXT))
    place = imgui.get_cursor_pos_x()
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    widgets.tooltip(ERROR_HINT)
    imgui.same_line(place + imgui.calc_text_size("relRMSE 0.0000 %").x, 0.0)
    imgui.dummy(ImVec2(0, 0))


def _buttons(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    if widgets.icon_button(context, "stored.remove", Icon.DELETE, "Forget this stored picture."):
        actions.append(RunOperator("remove_stored", context.view.stored))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, "stored.close", Icon.CLOSE, "End the comparison; the stored picture stays."):
        actions.append(RunOperator("compare_with", ""))
    return actions
