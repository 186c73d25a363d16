"""While a handle of the curve is dragged: the helper function of the operator, in a corner of the plot.

It is what the operator makes of a base function: of y = 0 for a translation in height, of y = 1 for an amplification,
of y = x along the angle [BenArtzi07, figs 9.1-9.4] (`engine.curve.operators.helper_function`). The curve is then added
to it, multiplied by it, or taken at it.
"""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import ImVec2, imgui

from engine.curve.operators import Operator, helper_function, unique_sorted
from ui import theme as look
from ui.panels import curve_plot as plot
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import core
from ui.panels.plot_axes import Axis, value_label
from ui.panels.window_state import CurveGrip

WIDTH, HEIGHT, GAP, TITLE = 118.0, 74.0, 8.0, 18.0
# Room for the whole of the plot's curve beside it: in a smaller plot there is no helper.
LEAST_WIDTH, LEAST_HEIGHT = 300.0, 108.0
RESULTS = {
    ("translate", "y"): "f + h",
    ("amplify", "y"): "b + (f − b) h",
    ("translate", "x"): "f(h)",
    ("amplify", "x"): "f(h)",
}


def draw(context: PanelContext, frame: plot.Frame, grip: CurveGrip, operators: tuple[Operator, ...]) -> None:
    """The helper functions of the operators in use, on the side of the plot where they do not act."""
    across, down = frame.end.x - frame.corner.x, frame.end.y - frame.corner.y
    if across < context.px(LEAST_WIDTH) or down < context.px(LEAST_HEIGHT):
        return
    step = context.px(WIDTH + GAP)
    is_right = core(grip.regions) < 0.5 * (grip.x_range[0] + grip.x_range[1])
    left = frame.end.x - step * len(operators) if is_right else frame.corner.x + context.px(GAP)
    top = frame.corner.y + context.px(TITLE + GAP)
    for i, operator in enumerate(operators):
        _draw_one(context, ImVec2(left + i * step, top), operator, (frame.x.low, frame.x.high))


def _draw_one(context: PanelContext, corner: ImVec2, operator: Operator, x_range: tuple[float, float]) -> None:
    draw, scale = imgui.get_window_draw_list(), context.theme.scale
    end = ImVec2(corner.x + context.px(WIDTH), corner.y + context.px(HEIGHT))
    draw.add_rect_filled(corner, end, look.pack(look.with_alpha(look.grey(30), 0.92)), context.px(4))
    draw.add_rect(corner, end, look.pack(look.grey(70)), context.px(4))
    x = unique_sorted(np.concatenate([np.linspace(*x_range, 160), np.clip(operator.regions, *x_range)]))
    helper, base = helper_function(operator, x)
    low, high = value_span(operator, helper, base)
    inset = context.px(5)
    inner = plot.Frame(
        Axis(*x_range, corner.x + inset, end.x - inset), Axis(low, high, end.y - inset, corner.y + context.px(TITLE))
    )
    draw.push_clip_rect(corner, end, True)
    plot.draw_line(inner, x, base, look.with_alpha(look.TEXT, 0.45), scale)
    plot.draw_line(inner, x, helper, look.ACCENT, 1.75 * scale)
    draw.pop_clip_rect()
    imgui.push_font(None, look.SMALL_SIZE)
    place = ImVec2(corner.x + inset, corner.y + context.px(3))
    draw.add_text(place, look.pack(look.TEXT_SOFT), RESULTS[operator.kind, operator.axis])
    value = extreme_text(operator, helper, base)
    draw.add_text(ImVec2(end.x - inset - imgui.calc_text_size(value).x, place.y), look.pack(look.ACCENT), value)
    imgui.pop_font()


def value_span(operator: Operator, helper: np.ndarray, base: np.ndarray) -> tuple[float, float]:
    """The heights that are shown: of both functions, with 0 where it is a height."""
    low, high = float(min(helper.min(), base.min())), float(max(helper.max(), base.max()))
    if operator.axis == "y":
        low, high = min(low, 0.0), max(high, operator.neutral_magnitude)
    margin = 0.08 * (high - low) or 0.5
    return low - margin, high + margin


def extreme_text(operator: Operator, helper: np.ndarray, base: np.ndarray) -> str:
    """How far the helper function is from its base at most: a value, a factor or degrees."""
    farthest = int(np.argmax(np.abs(helper - base)))
    if operator.axis == "x":
        return f"{math.degrees(helper[farthest] - base[farthest]):+.2g}°"
    value = float(helper[farthest])
    label = value_label(value, 0.01 * abs(value) or 1.0)
    return f"× {label}" if operator.kind == "amplify" else label
