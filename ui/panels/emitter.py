"""The light of the selected emitter: its strength and colour, above its material or, without one, alone."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.commands.light import EMISSION, SetEmission
from app.document.document import RGB, ObjectState
from ui.panels import colour_controls, number_fields, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag
from ui.panels.context import PanelContext

LEAST_STRENGTH, LARGEST_STRENGTH = 0.01, 1e5


def draw(context: PanelContext, state: ObjectState, emission: RGB) -> list[Action]:
    """The heading and the controls."""
    context.theme.push_bold()
    imgui.text_unformatted(state.name)
    imgui.pop_font()
    imgui.same_line()
    imgui.text_disabled("/  light")
    imgui.begin_disabled(state.frozen)
    actions = _strength(context, state.name, emission)
    actions += _colour(context, state.name, emission)
    imgui.end_disabled()
    if note := context.status.emitter_note:
        widgets.caption(f"{note[0].upper()}{note[1:]}.")
    return actions


def _strength(context: PanelContext, name: str, emission: RGB) -> list[Action]:
    """Scales all three channels."""
    widgets.label(context, "Strength")
    touch, moved = number_fields.slider(
        context, "strength", max(emission), LEAST_STRENGTH, LARGEST_STRENGTH, "%.4g", True, handle="emitter.strength",
        title="Strength", pixels_to_double=number_fields.PIXELS_TO_DOUBLE,
    )  # fmt: skip
    widgets.tooltip("Radiance of the brightest channel. The light itself follows at once.")
    return _edits(touch, name, scaled(emission, moved), "strength")


def scaled(emission: RGB, strength: float) -> RGB:
    """The colour with this as its brightest channel; black becomes white."""
    largest = max(emission)
    red, green, blue = (strength * value / largest if largest > 0.0 else strength for value in emission)
    return red, green, blue


def _colour(context: PanelContext, name: str, emission: RGB) -> list[Action]:
    """The radiance of each channel, and a swatch whose wheel keeps the strength."""
    actions: list[Action] = []
    widgets.label(context, "Colour")
    hint = f"{EMISSION.tooltip} Drag sideways, or double-click to type."
    speed = max(max(emission), LEAST_STRENGTH) / 200.0
    numbers = colour_controls.NumberTriple(
        "emitter", EMISSION.label, hint, EMISSION.minimum, EMISSION.maximum, speed, "%.4g"
    )
    for touch, moved in colour_controls.row(context, numbers, emission, swatch=True):
        actions += _edits(touch, name, moved, "colour")
    hint = "The colour at full brightness. Click for a colour wheel; the strength stays."
    touch, picked = colour_controls.swatch(context, numbers, scaled(emission, 1.0), hint)
    return actions + _edits(touch, name, scaled(picked, max(emission)), "colour")


def _edits(touch: number_fields.Touch, name: str, emission: RGB, what: str) -> list[Action]:
    """One drag of a control as one step of the history."""
    actions: list[Action] = [BeginDrag(f"{name} {what}")] if touch.began else []
    actions += [SetEmission(name, emission)] if touch.changed else []
    return [*actions, EndDrag()] if touch.ended else actions
