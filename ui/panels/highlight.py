"""Painting a highlight with the mouse over the picture: the brush's controls, its circle, its strokes, and what they
have reached."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from imgui_bundle import ImVec2, imgui

from app.modes.placement.painted_curves import SOLVED, Solved
from engine.inverse.highlight_brush import EFFECTS, Effect, HighlightBrush
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import (
    Action,
    BeginDrag,
    DragHighlight,
    EndDrag,
    HoldGrip,
    PickHighlight,
    PressHighlight,
    ReleaseHighlight,
    SetPanel,
)
from ui.panels.context import PanelContext
from ui.panels.paint import STEP
from ui.panels.window_state import HIGHLIGHT_BRUSH, HighlightGrip
from ui.theme import Icon

STRIP = 560.0  # the least width of the strip, at scale 1
Point = tuple[float, float]

EFFECT_LABELS: dict[Effect, tuple[str, str]] = {
    "brighter": ("Brighter", "The highlight becomes brighter under the brush. With Ctrl held, darker."),
    "darker": ("Darker", "The highlight becomes darker under the brush. With Ctrl held, brighter."),
    "tint": ("Tint", "It takes this colour under the brush, and stays as bright as it is."),
    "as_there": ("As there", "It becomes what another place is: Ctrl and a click choose the place."),
}
SOLVED_LABELS: dict[Solved, tuple[str, str]] = {
    "curve": ("Curve", "The selected curve is solved for."),
    "curves": ("Both curves", "All curves of the layer are solved for, in turn."),
    "scale": ("Scale", "Only the layer's scale or albedo is solved for: all of the highlight alike."),
}
COLOUR_HINTS = {
    "tint": "The colour that is painted; the picture stays as bright as it is.",
    "as_there": "The hue that is painted, as bright as the place that was chosen.",
}
REACHED = (
    "How much of what you painted the curves can do. Colours over the picture say where they cannot: from red to "
    "yellow it stays too bright, from blue to white too dark."
)


def is_on(context: PanelContext) -> bool:
    """Whether dragging over the picture paints a highlight."""
    return context.state.paints_highlight


def draw_strip(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The brush's controls at the lower edge of the picture, near the pointer."""
    if not is_on(context) or room.x < context.px(STRIP):
        return []
    actions: list[Action] = []
    foot = ImVec2(corner.x + 0.5 * room.x, corner.y + room.y - context.px(10))
    with widgets.strip(context, "Highlight###highlight", foot, ImVec2(0.5, 1.0), ImVec2(8, 6)) as is_seen:
        if is_seen:
            actions += _effects(context)
            actions += _numbers(context)
    return actions


def _effects(context: PanelContext) -> list[Action]:
    """What the brush does, what is solved for, and what has been reached."""
    brush, gap = context.state.highlight, context.px(6)
    pressed = widgets.segments(
        context, "highlight.effect", [EFFECT_LABELS[each] for each in EFFECTS], EFFECTS.index(brush.effect)
    )
    actions = [] if pressed is None else [_with(brush, effect=EFFECTS[pressed])]
    if brush.effect in ("tint", "as_there"):
        imgui.same_line(0.0, gap)
        touch, picked = rows.swatch(context, "highlight.colour", _shown(brush), COLOUR_HINTS[brush.effect])
        if touch.changed and max(picked) > 0.0:
            bright = (max(brush.colour) or 1.0) / max(picked)  # it stays as bright as it is
            actions.append(_with(brush, colour=tuple(bright * value for value in picked)))
    imgui.same_line(0.0, context.px(14))
    chosen = widgets.segments(
        context, "highlight.solved", [SOLVED_LABELS[each] for each in SOLVED], SOLVED.index(context.state.solved)
    )
    return actions + ([] if chosen is None else [SetPanel({"solved": SOLVED[chosen]})])


def _shown(brush: HighlightBrush) -> tuple[float, float, float]:
    """The brush's colour at full brightness."""
    largest = max(brush.colour)
    red, green, blue = (value / largest if largest > 0.0 else 1.0 for value in brush.colour)
    return red, green, blue


def _numbers(context: PanelContext) -> list[Action]:
    """The sliders, what has been reached, and a button that ends painting."""
    brush, gap, actions = context.state.highlight, context.px(6), list[Action]()
    first = True
    for parameter in HIGHLIGHT_BRUSH:
        name = parameter.name
        if name == "stops" and brush.effect not in ("brighter", "darker"):
            continue
        if not first:
            imgui.same_line(0.0, gap)
        first = False
        imgui.set_next_item_width(context.px(112))
        actions += rows.control(
            context,
            rows.Row(
                parameter, getattr(brush, name), partial(_with_value, brush, name), f"highlight.{name}",
                parameter.default, drag=None,
            ),
        )  # fmt: skip
    imgui.same_line(0.0, gap)
    reached = context.highlight_reached
    imgui.align_text_to_frame_padding()
    imgui.text_colored(look.TEXT_SOFT, "Reached  –" if reached is None else f"Reached {100.0 * reached:.0f} %")
    widgets.tooltip(REACHED)
    imgui.same_line(0.0, gap)
    if widgets.icon_button(context, "highlight_off", Icon.CLOSE, "End painting (Esc)."):
        actions.append(SetPanel({"paints_highlight": False}))
    return actions


def _with(brush: HighlightBrush, **changes: object) -> Action:
    return SetPanel({"highlight": replace(brush, **changes)})  # type: ignore[arg-type]


def _with_value(brush: HighlightBrush, name: str, value: float) -> Action:
    return _with(brush, **{name: value})


def resize(brush: HighlightBrush, steps: int) -> Action:
    """The brush, larger or smaller by so many steps."""
    low, high = HIGHLIGHT_BRUSH[0].limits
    return _with(brush, radius=min(max(brush.radius * STEP**steps, low), high))


# ---------------------------------------------------------------------------------------------------------- the picture


def begin(context: PanelContext, place: Point) -> list[Action]:
    """The button was pressed at a place of the picture, in its pixels."""
    brush, inverts = context.state.highlight, imgui.get_io().key_ctrl
    if brush.effect == "as_there" and inverts:
        return [PickHighlight(place)]
    opposite: dict[Effect, Effect] = {"brighter": "darker", "darker": "brighter"}
    if inverts:
        brush = replace(brush, effect=opposite.get(brush.effect, brush.effect))
    press = PressHighlight(brush, context.state.solved, place)
    return [BeginDrag(), press, HoldGrip(HighlightGrip("highlight", place))]


def go_on(context: PanelContext, grip: HighlightGrip, place: Point) -> list[Action]:
    """The button is held and the mouse is at a place of the picture."""
    if place == grip.offset:
        return []
    return [DragHighlight((place,)), HoldGrip(HighlightGrip("highlight", place))]


def end() -> list[Action]:
    """The button was released."""
    return [ReleaseHighlight(), EndDrag(), HoldGrip(None)]


def draw_circle(context: PanelContext, scale: float) -> None:
    """The brush's circle about the mouse; scale: pixels of the screen per pixel of the picture."""
    mouse, brush = imgui.get_mouse_pos(), context.state.highlight
    draw_list, line = imgui.get_window_draw_list(), context.px(1.5)
    inner = brush.radius * brush.hardness
    for ink, more in ((look.grey(0, 0.55), line), (look.grey(245), 0.0)):
        draw_list.add_circle(mouse, brush.radius * scale + 0.5 * more, look.pack(ink), 0, line + more)
    if 0.0 < brush.hardness < 1.0:
        draw_list.add_circle(mouse, inner * scale, look.pack(look.grey(245, 0.35)), 0, context.px(1.0))
