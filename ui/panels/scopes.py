"""Scopes over the picture, in its lower left corner: a histogram, or a waveform of luma or of the channels side by
side, of what is shown."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.operators.registry import keys_of
from engine.render.scopes import LEVELS, Scopes
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_state import SCOPES
from ui.theme import Icon

WIDTH, HEIGHT, MARGIN = 276.0, 120.0, 10.0
CHOICES = (
    ("Histogram", "How many pixels have each value of red, green, blue and luma on screen."),
    ("Luma", "Luma in each column of the picture: its columns across, black at the bottom, white at the top."),
    ("Parade", "The same of red, green and blue, side by side."),
)
INKS = ((0.95, 0.30, 0.28, 0.85), (0.35, 0.85, 0.38, 0.85), (0.38, 0.55, 1.0, 0.9), (0.85, 0.85, 0.85, 0.6))
HEAD, WORDS = 46.0, 38.0  # of the strip above and below the plot
CLIPPED = 5e-4  # share of pixels from where on a channel's clipping is said


def height(context: PanelContext, room: ImVec2) -> float:
    """How much of the panel's lower left corner they take; 0 where they are not shown."""
    is_shown = bool(context.state.scope) and room.x >= context.px(WIDTH + 2 * MARGIN)
    return context.px(HEAD + HEIGHT + WORDS + MARGIN) if is_shown and room.y >= context.px(HEIGHT + 80) else 0.0


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The scopes, where they are switched on and the picture's panel has room for them."""
    if not height(context, room):
        return []
    scopes = context.scopes()
    if scopes is None:
        return []
    actions: list[Action] = []
    at = ImVec2(corner.x + context.px(MARGIN), corner.y + room.y - context.px(MARGIN))
    with widgets.strip(context, "Scopes###scopes", at, ImVec2(0.0, 1.0), ImVec2(10, 8)) as is_seen:
        if is_seen:
            imgui.dummy(ImVec2(context.px(WIDTH), 0))
            actions += _title(context)
            place, size = imgui.get_cursor_screen_pos(), ImVec2(context.px(WIDTH), context.px(HEIGHT))
            imgui.dummy(size)
            context.handles.note_item("scopes.plot")
            _draw_plot(context, scopes, place, size)
            _draw_words(scopes)
    return actions


def _title(context: PanelContext) -> list[Action]:
    state, actions = context.state, list[Action]()
    pressed = widgets.segments(context, "scopes.kind", CHOICES, SCOPES.index(state.scope))
    if pressed is not None:
        actions.append(SetPanel({"scope": SCOPES[pressed]}))
    imgui.same_line()
    hint = "Whether counts are on a linear or a logarithmic scale."
    text = "log" if state.scope_is_log else "linear"
    if widgets.text_button(context, "scopes.log", text, hint, enabled=state.scope == "histogram"):
        actions.append(SetPanel({"scope_is_log": not state.scope_is_log}))
    widgets.same_line_at_right(imgui.get_frame_height())
    if widgets.icon_button(context, "scopes.close", Icon.CLOSE, f"Close this. ({keys_of('scopes')})"):
        actions.append(SetPanel({"scope": ""}))
    return actions


def _draw_plot(context: PanelContext, scopes: Scopes, place: ImVec2, size: ImVec2) -> None:
    draw_list, end = imgui.get_window_draw_list(), ImVec2(place.x + size.x, place.y + size.y)
    draw_list.add_rect_filled(place, end, look.pack(look.WELL), context.px(3))
    if context.state.scope != "histogram":
        picture = context.waveform(scopes, context.state.scope == "parade")
        if picture is not None:
            draw_list.add_image(picture.reference, place, end)
        return
    for share in (0.25, 0.5, 0.75):
        x = place.x + share * size.x
        draw_list.add_line(ImVec2(x, place.y), ImVec2(x, end.y), look.pack(look.grey(255, 0.08)))
    heights = bar_heights(scopes.counts, context.state.scope_is_log)
    for plane in (3, 0, 1, 2):
        xs = place.x + (np.arange(LEVELS) + 0.5) * size.x / LEVELS
        ys = end.y - heights[plane] * (size.y - context.px(4))
        places = zip(xs.tolist(), ys.tolist(), strict=True)
        draw_list.add_polyline([ImVec2(x, y) for x, y in places], look.pack(INKS[plane]), context.px(1.2), 0)


def bar_heights(counts: np.ndarray, is_log: bool) -> np.ndarray:
    """Counts (4, 256) as heights from 0 to 1. The ends, where all clipped pixels are, do not set the scale."""
    values = np.log1p(counts) if is_log else counts.astype(np.float64)
    return np.minimum(values / max(float(values[:, 1:-1].max()), 1.0), 1.0)


def _draw_words(scopes: Scopes) -> None:
    """What is clipped, and of how many pixels this is."""
    words = []
    for name, shares in (("black", scopes.black), ("white", scopes.white)):
        if max(shares) >= CLIPPED:
            parts = "  ".join(f"{letter} {share:.1%}" for letter, share in zip("RGB", shares, strict=True))
            words.append(f"{name}  {parts}")
    imgui.push_font(None, look.SMALL_SIZE)
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted("   ".join(words) or "nothing is clipped")
    if scopes.n_pixels < scopes.n_all:
        imgui.text_unformatted(f"of {scopes.n_pixels:,} of {scopes.n_all:,} pixels, evenly")
    imgui.pop_style_color()
    imgui.pop_font()
