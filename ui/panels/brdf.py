"""The BRDF panel: the selected layer as a lit sphere, its albedo, and one of three plots, beside its curve.

    sphere   under a fixed key, rim and dome light: it shows the material independently of the scene's light
    albedo   the share of light reflected, per channel; a warning where a curve reflects more than it receives
    lobe     the reflection of light from one angle (drag the ray), in the plane of the normal
    slice    the image over θ_h and θ_d in which measured BRDFs are shown
    albedo   (plot) the share reflected over the angle of the light

The plots mark the selected curve's regions in the accent colour (`brdf_plots`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.view_state import BRDF_PLOTS, SetView
from engine.material import kinds
from ui import theme as look
from ui.gl.brdf_views import Albedo
from ui.panels import brdf_plots, widgets
from ui.panels.actions import Action, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

LARGEST_SPHERE = 144.0
# How far quadrature may exceed 1 for a material that does not, at angles where it is that accurate.
ENERGY_TOLERANCE = 0.02
ENERGY_ANGLES = math.radians(85.0)
PLOT_HINTS = {
    "lobe": "Light reflected from one angle, by view direction. Drag the light's ray.",
    "slice": "The BRDF over θh (right: away from the mirror direction) and θd (up: towards grazing angles), the image "
    "that measured materials are shown as.",
    "albedo": "The share of light that is reflected, by the angle it comes from.",
}


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    board, selection = context.brdf, context.selected_layer
    if selection is None:
        imgui.text_disabled("Nothing selected")
        return []
    actions = _choice(context)
    places = _places(context, imgui.get_cursor_screen_pos(), imgui.get_content_region_avail())
    _sphere(context, places.sphere, places.side)
    _figures(context, places)
    if board.problem:
        imgui.set_cursor_screen_pos(places.plot)
        widgets.caption(f"This material cannot be drawn: {board.problem}")
        return actions
    return actions + _plot(context, places.plot, places.plot_size)


# Pixels at scale 1 across and down that three channels' albedo and the warning cover.
FIGURES = (100.0, 60.0)


@dataclass(frozen=True)
class BrdfLayout:
    """The rectangles of the parts: the numbers are beside the sphere, or in one line under it."""

    sphere: ImVec2
    side: int
    figures: ImVec2
    figures_width: float
    in_line: bool
    plot: ImVec2
    plot_size: ImVec2


def _places(context: PanelContext, corner: ImVec2, room: ImVec2) -> BrdfLayout:
    """A wide panel has the plot at the right, a tall one below, and the numbers where there is room for them."""
    gap, most = context.px(10), context.px(LARGEST_SPHERE)
    if room.x > 1.25 * room.y:
        side = _whole(min(room.y - context.px(76), 0.42 * room.x, most))
        wide = max(side, context.px(FIGURES[0]))
        plot = ImVec2(corner.x + wide + gap, corner.y)
        figures = ImVec2(corner.x, corner.y + side + context.px(4))
        return BrdfLayout(corner, side, figures, wide, False, plot, ImVec2(room.x - wide - gap, room.y))
    if room.y > 1.7 * room.x:
        lines, height = context.px(44), 0.78 * room.x
        side = _whole(min(room.x, room.y - height - lines, most))
        sphere = ImVec2(round(corner.x + 0.5 * (room.x - side)), corner.y)
        figures = ImVec2(corner.x, corner.y + side + context.px(6))
        plot = ImVec2(corner.x, figures.y + lines)
        return BrdfLayout(sphere, side, figures, room.x, True, plot, ImVec2(room.x, corner.y + room.y - plot.y))
    side = _whole(min(0.5 * room.x, 0.5 * room.y - gap, most))
    figures, below = ImVec2(corner.x + side + gap, corner.y), max(side, context.px(FIGURES[1])) + context.px(8)
    plot_size = ImVec2(room.x, room.y - below)
    return BrdfLayout(corner, side, figures, room.x - side - gap, False, ImVec2(corner.x, corner.y + below), plot_size)


def _whole(side: float) -> int:
    """A side in steps, so that a panel that is being resized does not require another sphere in every frame."""
    return 8 * max(int(side / 8), 5)


def _choice(context: PanelContext) -> list[Action]:
    """The choice of the plot and of what it shows."""
    view = context.view
    actions: list[Action] = []
    choices = [(name.capitalize(), PLOT_HINTS[name]) for name in BRDF_PLOTS]
    pressed = widgets.segments(context, "brdf.plot", choices, BRDF_PLOTS.index(view.brdf_plot))
    if pressed is not None:
        actions.append(SetView.of(brdf_plot=BRDF_PLOTS[pressed]))
    hint = "All visible layers of the object together; off: the selected layer alone."
    widgets.same_line_at_right(widgets.segments_width(context, ["All"], 34.0))
    if widgets.switch(context, "brdf.whole", "All", hint, view.brdf_whole, 34.0):
        actions.append(SetView.of(brdf_whole=not view.brdf_whole))
    return actions


def _sphere(context: PanelContext, corner: ImVec2, side: int) -> None:
    board = context.brdf
    board.shown.add("sphere")
    board.sphere_side = side
    imgui.set_cursor_screen_pos(corner)
    imgui.invisible_button("sphere", ImVec2(side, side))
    context.handles.note_item("brdf.sphere")
    widgets.tooltip(
        "The material on a sphere under lights of its own: a key from the upper left, a rim light behind, a dome. "
        "It follows the curve; the scene's light does not change it." + _of_curves_alone(context)
    )
    if board.sphere is not None:
        upper, lower = board.sphere.corners()
        end = ImVec2(corner.x + side, corner.y + side)
        imgui.get_window_draw_list().add_image(board.sphere.reference, corner, end, upper, lower)


def _of_curves_alone(context: PanelContext) -> str:
    """A note on measured layers while their tables are not here."""
    board = context.brdf
    if not board.curves_alone:
        return ""
    if board.why_alone:
        return f" Only the product of the curves ({board.why_alone}); the picture has all that was measured."
    return " Only the product of the curves so far; the measurement itself is on its way."


def _figures(context: PanelContext, places: BrdfLayout) -> None:
    """Equivalent albedo, per channel, and the warning."""
    context.brdf.shown.add("albedo")
    albedo, place = context.brdf.albedo, places.figures
    if albedo is None:
        return
    draw = imgui.get_window_draw_list()
    imgui.push_font(None, look.SMALL_SIZE)
    line = imgui.get_text_line_height() + context.px(1)
    draw.add_text(place, look.pack(look.TEXT_SOFT), "Albedo")
    x, y = (place.x + context.px(58), place.y) if places.in_line else (place.x, place.y + line)
    for ink, text in albedo_texts(albedo):
        draw.add_text(ImVec2(x, y), look.pack(ink), text)
        x += max(imgui.calc_text_size(text).x + context.px(5), context.px(30))
    imgui.set_cursor_screen_pos(place)
    imgui.dummy(ImVec2(places.figures_width, y + line - place.y))
    context.handles.note_item("brdf.figures")
    widgets.tooltip(
        "Albedo: the share of light from all directions that the material reflects. Indirect light uses it."
        + _of_curves_alone(context)
    )
    if warning := energy_warning(albedo):
        imgui.set_cursor_screen_pos(ImVec2(place.x, y + line + context.px(2)))
        _warning(context, warning, places)
    imgui.pop_font()


def albedo_texts(albedo: Albedo) -> list[tuple[look.Colour, str]]:
    """The equivalent albedo as numbers in their channels' colours, or as one where they agree."""
    equal = float(np.ptp(albedo.equivalent)) <= 5e-4 * max(float(albedo.equivalent.max()), 1e-6)
    inks = (look.TEXT,) if equal else look.CHANNELS
    numbers = [float(number) for number in albedo.equivalent[: len(inks)]]
    texts = [f"{number:.2f}" if number < 100.0 else f"{number:.0e}" for number in numbers]
    return list(zip(inks, texts, strict=True))


def energy_warning(albedo: Albedo) -> str:
    """In words, how much more than it receives the material reflects at most; empty where it does not."""
    shares = np.where(albedo.angles < ENERGY_ANGLES, albedo.values.max(axis=1), 0.0)
    largest = float(shares.max())
    if largest <= 1.0 + ENERGY_TOLERANCE:
        return ""
    angle = math.degrees(albedo.angles[int(shares.argmax())])
    times = f"{largest:.2f}" if largest < 10.0 else f"{largest:.0f}" if largest < 1e4 else f"{largest:.0e}"
    return f"{times}× at {angle:.0f}°"


def _warning(context: PanelContext, warning: str, places: BrdfLayout) -> None:
    draw, place = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
    line = imgui.get_text_line_height() + context.px(1)
    draw.add_text(place, look.pack(look.ACCENT), Icon.WARNING)
    first = ImVec2(place.x + context.px(18), place.y)
    draw.add_text(first, look.pack(look.TEXT), "gains light")
    beside = ImVec2(first.x + imgui.calc_text_size("gains light ").x, first.y)
    draw.add_text(beside if places.in_line else ImVec2(first.x, first.y + line), look.pack(look.TEXT_SOFT), warning)
    imgui.dummy(ImVec2(places.figures_width, line if places.in_line else 2 * line))
    context.handles.note_item("brdf.warning")
    widgets.tooltip(
        f"The material reflects more light than it receives: {warning} from the normal. With several bounces the scene "
        "grows too bright. Lower the curve or the scale."
    )


def _plot(context: PanelContext, place: ImVec2, size: ImVec2) -> list[Action]:
    if size.x < context.px(60) or size.y < context.px(50):
        return []
    actions: list[Action] = []
    match context.view.brdf_plot:
        case "lobe":
            actions = brdf_plots.lobe(context, place, size) + _plane(context, place, size)
        case "slice":
            brdf_plots.slice_image(context, place, size)
            actions = _plane(context, place, size)
        case "albedo":
            brdf_plots.albedo(context, place, size)
    if context.brdf.curves_alone:
        _alone(context, place, size)
    return actions


def _alone(context: PanelContext, place: ImVec2, size: ImVec2) -> None:
    """Note in the plot's upper right that a measured layer is shown by its curves alone."""
    imgui.push_font(None, look.SMALL_SIZE)
    text = "curves alone"
    wide = imgui.calc_text_size(text)
    below = context.px(22) if is_anisotropic(context) else 0.0
    corner = ImVec2(place.x + size.x - wide.x - context.px(13), place.y + context.px(5) + below)
    end = ImVec2(corner.x + wide.x + context.px(8), corner.y + wide.y + context.px(4))
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(corner, end, look.pack(look.WELL), context.px(3))
    draw.add_text(ImVec2(corner.x + context.px(4), corner.y + context.px(2)), look.pack(look.TEXT_SOFT), text)
    imgui.set_cursor_screen_pos(corner)
    imgui.dummy(ImVec2(end.x - corner.x, end.y - corner.y))
    context.handles.note_item("brdf.curves_alone")
    widgets.tooltip(_of_curves_alone(context).strip())
    imgui.pop_font()


def _plane(context: PanelContext, place: ImVec2, size: ImVec2) -> list[Action]:
    """The choice along or across the tangent, in the plot's upper left, where it makes a difference; of the lobe, its
    scale."""
    view = context.view
    imgui.push_font(None, look.SMALL_SIZE)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(context.px(5), context.px(1)))
    imgui.set_cursor_screen_pos(ImVec2(place.x + context.px(5), place.y + context.px(5)))
    actions: list[Action] = []
    if view.brdf_plot == "lobe":
        hint = "Logarithmic radius, four decades: shows the faint skirts beside the highlight."
        if widgets.switch(context, "brdf.log", "log", hint, view.lobe_log, 28.0):
            actions.append(SetView.of(lobe_log=not view.lobe_log))
        imgui.same_line(0.0, context.px(3))
        actions += _pick(context)
    if is_anisotropic(context):
        hint = "The plane across the tangent; off: along it, around a vessel."
        imgui.set_cursor_screen_pos(ImVec2(place.x + size.x - context.px(55), place.y + context.px(5)))
        if widgets.switch(context, "brdf.across", "across", hint, view.brdf_across, 50.0):
            actions.append(SetView.of(brdf_across=not view.brdf_across))
    imgui.pop_style_var()
    imgui.pop_font()
    return actions


def _pick(context: PanelContext) -> list[Action]:
    """Toggle the lobe in the picture."""
    on = context.state.picks_lobe or context.view.lobe_pixel is not None
    hint = (
        "Show the lobe on the surface: then click a point of the picture. Alt-click does both, and Alt-drag moves it. "
        "It shows which light around that point the layer reflects to the camera."
    )
    if not widgets.switch(context, "brdf.pick", "pick", hint, on):
        return []
    return [SetPanel({"picks_lobe": not on}), SetView.of(lobe_pixel=None)]


def is_anisotropic(context: PanelContext) -> bool:
    """Whether the selected layer has a curve over the half vector's azimuth, or a stretch in its quotient."""
    selected = context.selected_layer
    if selected is None:
        return False
    model = context.document.layer(selected.key).model
    return model.highlight_in_quotient or any(factor.gamma in kinds.HALF_AZIMUTHS for factor in model.factors)
