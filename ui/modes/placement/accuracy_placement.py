"""Placement's part of the Accuracy panel: lights, bounces, bands and precision, and the progress of the picture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.document.commands.plan import SetFirstBands
from app.document.display_names import with_display_names
from app.document.effective_settings import effective_view, override_lines_of
from app.document.view_state import SetView
from app.modes.placement.placement_status import PlacementStatus
from engine.settings import N_PATCHES
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext

LIGHT_CHOICES = (400, 1000, 4000, 10000)
PATCH_CHOICES = (256, N_PATCHES, 3000, 10000)
BOUNCE_CHOICES = (1, 2, 3, 4)
FIRST_BANDS = {"Auto": None, "16": 16, "32": 32, "64": 64, "128": 128, "256": 256}
SECOND_BANDS = {"All": None, "16": 16, "8": 8, "1": 1}
FIRST_HINT = (
    "Bands J of the sharpest curves at the first bounce from the camera: more follow finer edits, and take more memory "
    "and time. Auto: as many as each curve needs."
)
SECOND_HINT = (
    "Bands of each curve at the second bounce. 1: by albedo, as if surfaces were diffuse there; more keep the "
    "directions of glossy reflection."
)
LIGHTS_HINT = (
    "Triangle lights that stand for the environment in the finished picture: more are more accurate and take longer."
)
PATCHES_HINT = (
    "Patches that emitters are cut into in the finished picture: more give more accurate shadows and take longer."
)
BOUNCES_HINT = "Reflections between light and camera. 1 is direct light; more add colour bleeding and indirect light."
EDGES = {"Auto edges": None, "No edges": 0, "4 edge rays": 4, "8 edge rays": 8, "16 edge rays": 16}
EDGES_HINT = (
    "Rays through each pixel where objects meet or normals turn fast: smooth edges and rims, for a little more time "
    "and memory. Auto: as many as the scene requires."
)
GAP = 4.0
# The width that a number of lights and one of patches need side by side.
LIGHTS_WIDTH = 132.0
# And that of the bands of two bounces.
BANDS_WIDTH = 140.0


def draw(context: PanelContext) -> list[Action]:
    """The choices, and the measured figures."""
    status = context.status
    assert isinstance(status, PlacementStatus)
    context = replace(context, view=effective_view(context.view, context.document))
    actions: list[Action] = []
    for action in _quality(context, status):
        actions += override_lines_of(action, context.document) if isinstance(action, SetView) else [action]
    imgui.spacing()
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(imgui.get_style().item_spacing.x, context.px(1)))
    selected = context.view.selected
    for name, value, hint in figures(status, None if selected is None else selected.key):
        widgets.figure(name, value, with_display_names(context.document, hint))
    imgui.pop_style_var()
    return actions


def _quality(context: PanelContext, status: PlacementStatus) -> list[Action]:
    settings = context.view.settings
    actions: list[Action] = []
    if any(state.emits for state in context.document.objects):
        actions += _lights_and_patches(context)
    else:
        least = _least(context, map(_short, LIGHT_CHOICES))
        actions += _numbers(context, "Lights", "n_lights", LIGHT_CHOICES, LIGHTS_HINT, least)
    actions += _numbers(context, "Bounces", "n_bounces", BOUNCE_CHOICES, BOUNCES_HINT)
    if status.bounces_note:
        widgets.caption(status.bounces_note)
    actions += _series(context)
    options = (
        ("Half", "Half floats on the graphics card: half the memory, errors of a thousandth."),
        ("Float", "Full floats on the graphics card: twice the memory, increments without rounding."),
    )
    chosen = 0 if settings.precision == "half" else 1
    gap = context.px(GAP)
    widgets.label(context, "Transport", least=2.0 * _least(context, [text for text, _ in options]) + GAP)
    room = imgui.get_content_region_avail().x - gap
    least = (0.5 * room - 1) / 2 / context.theme.scale
    pressed = widgets.segments(context, "accuracy.precision", options, chosen, least=least)
    if pressed is not None:
        actions.append(SetView.of(precision="half" if pressed == 0 else "float"))
    imgui.same_line(0.0, gap)
    picked = _combo(context, "accuracy.edges", EDGES, settings.n_edge_rays, 0.5 * room, EDGES_HINT)
    actions += [SetView.of(n_edge_rays=n) for n in picked]
    if status.transport_note:
        widgets.caption(with_display_names(context.document, status.transport_note))
    return actions


def _numbers(
    context: PanelContext, title: str, name: str, choices: Sequence[int], hint: str, least: float | None = None
) -> list[Action]:
    """A line with a button for each choice of a setting."""
    widgets.label(context, title, **({} if least is None else {"least": least}))
    chosen = getattr(context.view.settings, name)
    pressed = widgets.segments(
        context, f"accuracy.{title.lower()}", [(_short(n), hint) for n in choices],
        choices.index(chosen) if chosen in choices else -1, least=_share(context, len(choices)),
    )  # fmt: skip
    return [] if pressed is None else [SetView.of(**{name: choices[pressed]})]


def _lights_and_patches(context: PanelContext) -> list[Action]:
    """Where there are emitters: both numbers on one line."""
    settings = context.view.settings
    widgets.label(context, "Lights", least=LIGHTS_WIDTH)
    gap = context.px(GAP)
    room = imgui.get_content_region_avail().x - gap
    lights = {_short(n): n for n in LIGHT_CHOICES}
    actions: list[Action] = [
        SetView.of(n_lights=pick)
        for pick in _combo(context, "accuracy.lights", lights, settings.n_lights, 0.4 * room, LIGHTS_HINT)
        if pick is not None
    ]
    imgui.same_line(0.0, gap)
    patches = {f"{_short(n)} patches": n for n in PATCH_CHOICES}
    chosen = _combo(context, "accuracy.patches", patches, settings.n_patches, 0.6 * room, PATCHES_HINT)
    return actions + [SetView.of(n_patches=pick) for pick in chosen if pick is not None]


def _series(context: PanelContext) -> list[Action]:
    """The bands of each bounce from the camera: the first and the second can be chosen, later ones depend on albedo."""
    actions: list[Action] = []
    settings = context.view.settings
    widgets.label(context, "Bands", least=BANDS_WIDTH if settings.n_bounces > 1 else widgets.LEAST_CONTROL)
    n_later = settings.n_bounces - 2
    later = "  1" * n_later
    gap = context.px(GAP)
    room = imgui.get_content_region_avail().x - (imgui.calc_text_size(later).x if later else 0.0)
    both = settings.n_bounces > 1
    first = context.document.first_bands
    chosen = _combo(context, "accuracy.first", FIRST_BANDS, first, (room - gap) / 2 if both else room, FIRST_HINT)
    actions += [SetFirstBands(pick) for pick in chosen]
    if both:
        imgui.same_line(0.0, gap)
        second = settings.second_bands
        chosen = _combo(context, "accuracy.second", SECOND_BANDS, second, (room - gap) / 2, SECOND_HINT)
        actions += [SetView.of(second_bands=pick) for pick in chosen]
    if n_later > 0:
        imgui.same_line(0.0, 0.0)
        imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
        imgui.text_unformatted(later)
        imgui.pop_style_color()
        widgets.tooltip("Bounces after the second go by albedo: one band each.")
    return actions


def _combo(
    context: PanelContext, name: str, choices: Mapping[str, int | None], chosen: int | None, width: float, hint: str
) -> list[int | None]:
    """A list of numbers; returns what was picked, if anything."""
    texts, numbers = list(choices), list(choices.values())
    marked = [numbers.index(chosen)] if chosen in numbers else []
    shown = texts[marked[0]] if marked else str(chosen)
    if imgui.calc_text_size(shown).x > width - 2.0 * imgui.get_style().frame_padding.x:
        shown = shown.partition(" ")[0]  # the number alone: "768 patches"
    imgui.set_next_item_width(width)
    picked = widgets.choose(context, name, [widgets.Choice(text) for text in texts], marked, hint, shown=shown)
    return [] if picked is None else [numbers[picked]]


def _least(context: PanelContext, texts: Iterable[str]) -> float:
    """The width, at scale 1, of segments of these texts."""
    return widgets.segments_width(context, list(texts)) / context.theme.scale


def _share(context: PanelContext, count: int) -> float:
    """The width, at scale 1, of each of `count` segments that fill the rest of the line."""
    return max(imgui.get_content_region_avail().x - (count - 1), 1.0) / count / context.theme.scale


def _short(count: int) -> str:
    return f"{count // 1000}k" if count >= 1000 else str(count)


def figures(status: PlacementStatus, selected: str | None = None) -> list[tuple[str, str, str]]:
    """(name, value, explanation) of every measured figure; selected: the key of the layer that is."""
    shown = f"{status.shown_coefficients} of {status.wanted_coefficients}" if status.wanted_coefficients else "–"
    bands = dict(status.bands)
    if selected in bands:
        shown = f"{shown}, {_bands(bands[selected])}"
    plan = "\n".join(f"{key}: {_bands(counts)}" for key, counts in status.bands)
    return [
        (
            "Coefficients",
            shown,
            "Wavelet coefficients of the selected curve that the picture shows, and the bands of its layer's transport."
            f"\n{plan}",
        ),
        (
            "Memory",
            f"{status.memory_mb:.0f} MB, transport {status.precomputed_mb:.0f} MB",
            "Main memory of the window and the worker; precomputed transport, which redraws an edited curve at once.\n"
            f"On the graphics card: {status.gpu_mb:.0f} MB, with the selected curve's transport.",
        ),
    ]


def _bands(counts: tuple[int, ...]) -> str:
    """The bands of a layer's curves, as they are shown."""
    return "bands " + " × ".join(map(str, counts)) if counts else "no bands: fixed"
