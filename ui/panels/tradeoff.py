"""Speed against accuracy: what the picture costs and how far it is from exact, both measured, and what trades them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.status import Status
from app.view_state import SetView
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, CancelWork
from ui.panels.context import PanelContext
from ui.theme import Icon

LEAST_BUDGET, LARGEST_BUDGET = 2.0, 200.0
LIGHT_CHOICES = (400, 1000, 4000, 10000)
BOUNCE_CHOICES = (1, 2, 3, 4)
SECOND_BANDS = {"1": 1, "8": 8, "16": 16, "All": None}
VALUE_COLUMN = 112.0
SMALLEST_ERROR = 1e-7


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions = _budget(context)
    actions += _quality(context)
    imgui.spacing()
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(imgui.get_style().item_spacing.x, context.px(3)))
    selected = context.view.selected
    for name, value, hint in figures(context.status, None if selected is None else selected.key):
        _figure(context, name, value, hint)
    imgui.pop_style_var()
    actions += _work(context)
    return actions


def _budget(context: PanelContext) -> list[Action]:
    widgets.label(context, "Frame time")
    hand, moved = widgets.slider(
        context, "budget", context.view.frame_budget_ms, LEAST_BUDGET, LARGEST_BUDGET, "%.0f ms", True,
        handle="accuracy.frame_time",
    )  # fmt: skip
    widgets.tooltip("Time for each frame while a curve moves. Less is smoother and coarser until the hand rests; "
                    "the resting picture is exact either way.")  # fmt: skip
    return [SetView.of(frame_budget_ms=moved)] if hand.changed else []


def _quality(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    widgets.label(context, "Lights")
    hint = "Triangle lights that stand for the environment in the finished picture: more are truer and take longer."
    chosen = LIGHT_CHOICES.index(context.view.n_lights) if context.view.n_lights in LIGHT_CHOICES else -1
    choices = [(_short(n), hint) for n in LIGHT_CHOICES]
    pressed = widgets.segments(context, "accuracy.lights", choices, chosen, least=_share(context, len(choices)))
    if pressed is not None:
        actions.append(SetView.of(n_lights=LIGHT_CHOICES[pressed]))
    widgets.label(context, "Bounces")
    hint = "Reflections between light and eye. 1 is direct light; more bring colour bleeding and light from neighbours."
    chosen = BOUNCE_CHOICES.index(context.view.n_bounces) if context.view.n_bounces in BOUNCE_CHOICES else -1
    choices = [(str(n), hint) for n in BOUNCE_CHOICES]
    pressed = widgets.segments(context, "accuracy.bounces", choices, chosen, least=_share(context, len(choices)))
    if pressed is not None:
        actions.append(SetView.of(n_bounces=BOUNCE_CHOICES[pressed]))
    if context.view.n_bounces > 1:
        actions += _second_bounce(context)
    widgets.label(context, "Transport")
    options = (
        ("Half", "Half floats on the graphics card: half the memory, errors of a thousandth."),
        ("Float", "Full floats on the graphics card: twice the memory, increments without rounding."),
    )
    chosen = 0 if context.view.precision == "half" else 1
    pressed = widgets.segments(context, "accuracy.precision", options, chosen, least=_share(context, 2))
    if pressed is not None:
        actions.append(SetView.of(precision="half" if pressed == 0 else "float"))
    if context.status.transport_note:
        widgets.caption(context.status.transport_note)
    return actions


def _second_bounce(context: PanelContext) -> list[Action]:
    widgets.label(context, "2nd bounce")
    hint = ("Bands of each curve at the second bounce. 1: by albedo, as if surfaces were matt there; more let glossy "
            "ones throw light where they do. The first bounce has all, later ones go by albedo.")  # fmt: skip
    chosen = list(SECOND_BANDS.values()).index(context.view.second_bands)
    choices = [(name, hint) for name in SECOND_BANDS]
    pressed = widgets.segments(context, "accuracy.second", choices, chosen, least=_share(context, len(choices)))
    return [] if pressed is None else [SetView.of(second_bands=list(SECOND_BANDS.values())[pressed])]


def _share(context: PanelContext, count: int) -> float:
    """The width, at scale 1, of each of `count` segments that fill the rest of the line."""
    return max(imgui.get_content_region_avail().x - (count - 1), 1.0) / count / context.theme.scale


def _short(count: int) -> str:
    return f"{count // 1000}k" if count >= 1000 else str(count)


def figures(status: Status, selected: str | None = None) -> list[tuple[str, str, str]]:
    """(name, value, explanation) of every measured figure; selected: the key of the layer that is."""
    error = "–" if status.image_error is None else error_text(status.image_error)
    shown = f"{status.shown_coefficients} of {status.wanted_coefficients}" if status.wanted_coefficients else "–"
    bands = dict(status.bands)
    if selected in bands:
        shown = f"{shown}, {_bands(bands[selected])}"
    plan = "\n".join(f"{key}: {_bands(counts)}" for key, counts in status.bands)
    return [
        ("Frame", f"{status.frame_ms:.1f} ms", "Time of the last frame that drew the picture."),
        (
            "Coefficients",
            shown,
            "Wavelet coefficients of the selected curve that the picture shows, and the bands of its layer's transport."
            f"\n{plan}",
        ),
        ("Image error", error, "What the missing coefficients would still change, relative to the picture's mean."),
        *([] if status.indirect_noise is None else [_noise(status.indirect_noise)]),
        (
            "Memory",
            f"{status.memory_mb:.0f} MB, transport {status.transport_mb:.0f} MB",
            "Main memory of window and worker together; precomputed transport, which lets a curve redraw at once.\n"
            f"On the graphics card: {status.gpu_mb:.0f} MB, with the selected curve's transport.",
        ),
    ]


def _noise(noise: float) -> tuple[str, str, str]:
    hint = "What chance is left in the light of further bounces, relative to its mean: its two halves apart tell it."
    return "Indirect noise", f"{100.0 * noise:.1f} %", hint


def _bands(counts: tuple[int, ...]) -> str:
    """The bands of a layer's curves, as a person reads them."""
    return "bands " + " × ".join(map(str, counts)) if counts else "no bands: fixed"


def _figure(context: PanelContext, name: str, value: str, hint: str) -> None:
    start = imgui.get_cursor_pos_x()
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
    imgui.text_unformatted(name)
    imgui.pop_style_color()
    widgets.tooltip(hint)
    imgui.same_line(start)
    widgets.align_right(imgui.calc_text_size(value).x)
    imgui.text_unformatted(value)
    widgets.tooltip(hint)


def _work(context: PanelContext) -> list[Action]:
    """What the worker does, with its progress, and a way to stop it."""
    status = context.status
    if not status.stage:
        return []
    button = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    room = imgui.get_content_region_avail().x
    text = work_text(status)
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    imgui.same_line()
    widgets.align_right(button)
    pressed = widgets.icon_button(context, "cancel", Icon.CLOSE, "Stop computing; the picture stays as it is.")
    height = context.px(3)
    top = corner.y + button
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(
        ImVec2(corner.x, top), ImVec2(corner.x + room, top + height), look.pack(look.FRAME), height
    )
    if status.fraction > 0.0:
        end = corner.x + max(height, room * min(status.fraction, 1.0))
        draw_list.add_rect_filled(ImVec2(corner.x, top), ImVec2(end, top + height), look.pack(look.ACCENT), height)
    return [CancelWork()] if pressed else []


def work_text(status: Status) -> str:
    """Stage, share done (once there is one) and time left, on one line: "transport 78 % · 12 s left"."""
    parts = [f"{status.stage} {100.0 * status.fraction:.0f} %" if status.fraction > 0.0 else status.stage]
    if status.seconds_left is not None:
        parts.append(f"{duration(status.seconds_left)} left")
    return " · ".join(parts)


def error_text(error: float) -> str:
    """A picture's relative error in digits; 0 where single precision could not show it."""
    return "0" if error < SMALLEST_ERROR else f"{error:.2g}"


def duration(seconds: float) -> str:
    """Seconds as a person says them: "0.4 s", "12 s", "3 min"."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
