"""The panel that matches the material of an object to a photograph: what is known of the photograph, what is to be
found, and what was found."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.document.display_names import with_display_names
from app.document.document import ObjectState
from app.document.linked_layers import Layers
from app.photo.match_refusal import match_refusal
from app.photo.match_settings import (
    LINEAR_ENDINGS,
    MatchSettings,
    layers_to_match,
    possible_targets,
    with_object,
    with_start,
    written_targets,
)
from engine.inverse.camera_fit import LEAST_PAIRS
from engine.inverse.photo_targets import SCALE, Target, scale_parameter
from engine.inverse.transfer_curve import LEAST_GAMMA, MOST_GAMMA
from engine.material.layer import Layer
from engine.material.parameters import Parameter
from ui import layout
from ui import theme as look
from ui.panels import pair_picking, photo_pairs, rows, widgets
from ui.panels.actions import Action, AskFile, MatchPicture, SetPanel, StopPhoto
from ui.panels.context import PanelContext
from ui.theme import Icon

WIDTH, LABEL, LEAST_HEIGHT = 320.0, 92.0, 160.0
TRANSFERS = (
    ("sRGB", "As cameras and screens write it: PNG and JPEG files."),
    ("Linear", "Values in proportion to light."),
    ("Gamma", "Values are light to the power of one over this gamma."),
)
GAMMA = Parameter(
    "gamma", "scalar", 2.2, "Gamma", "The exponent that makes light of the file's values.", minimum=LEAST_GAMMA,
    maximum=MOST_GAMMA,
)  # fmt: skip
EXPOSURES = (
    (
        "Auto",
        "Found: what else is in the picture says how it was exposed: the environment, and objects that are right.",
    ),
    ("Known", "The factor from light to the photograph's values."),
)
EXPOSURE = Parameter(
    "exposure", "scalar", 1.0, "Exposure", "The factor from light to the photograph's values.", minimum=1e-6,
    maximum=1e6, logarithmic=True, soft=(1e-3, 1e3),
)  # fmt: skip
CLOSE = SetPanel({"match": None})
FINDS = "What is found; all else of the material stays as it is."
START = (
    "The material that the match begins with, and that remains where the photograph says nothing: the object's, or one "
    "of the library."
)
MASK = "A picture of the photograph's size that is black where it does not count: something stands before the object."
LIGHTS = (
    ("finds_rotation", "Rotation", "How the environment was turned, by what else is in the picture."),
    (
        "finds_lights",
        "Strengths",
        "How strong each light was beside the strongest, in the light mixer.",
    ),
)
ERROR = "relRMSE of pixels of the object that were held back from the match, with the material as it was and as it is."


def draw(context: PanelContext) -> list[Action]:
    """The panel while it is open; and the picking of pairs ends where that is to end."""
    settings, followed = context.state.match, pair_picking.follow(context)
    if settings is None:
        return followed
    if settings.scene != context.document.source:
        return [*followed, CLOSE]
    return [*followed, *_window(context, settings)]


def _window(context: PanelContext, settings: MatchSettings) -> list[Action]:
    corner, whole = _corner(context), imgui.get_main_viewport()
    imgui.set_next_window_pos(corner, imgui.Cond_.appearing)
    # As high as its rows, but never beyond the window: then it scrolls.
    width, most = context.px(WIDTH), whole.work_pos.y + whole.work_size.y - corner.y - context.px(8)
    imgui.set_next_window_size_constraints(ImVec2(width, 0.0), ImVec2(width, max(most, context.px(LEAST_HEIGHT))))
    imgui.set_next_window_size(ImVec2(width, 0.0))
    flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_resize
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(44)))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    visible, is_open = imgui.begin("Match a picture###match", True, flags)
    actions = _contents(context, settings) if visible else []
    imgui.end()
    imgui.pop_style_var()
    imgui.pop_style_color()
    return actions if is_open else [CLOSE]


def _corner(context: PanelContext) -> ImVec2:
    """At the upper left of the picture's panel, below its header."""
    window = imgui.internal.find_window_by_name(layout.VIEWPORT.window)
    at = imgui.get_main_viewport().work_pos if window is None else window.pos
    return ImVec2(at.x + context.px(10), at.y + context.px(48))


def _contents(context: PanelContext, settings: MatchSettings) -> list[Action]:
    imgui.begin_disabled(bool(context.photo))
    actions = _file(context, settings)
    objects = [state for state in context.document.objects if state.layers and not state.is_lamp]
    state = next((each for each in objects if each.name == settings.object), None)
    actions += _object(context, settings, objects) + _start(context, settings)
    actions += _mask(context, settings) + _transfer(context, settings) + _exposure(context, settings)
    found = context.found
    is_aligned = found is not None and (found.settings.file, found.settings.pairs) == (settings.file, settings.pairs)
    actions += photo_pairs.draw(context, settings, LABEL, found.answer.missed if found and is_aligned else ())
    if state is not None:
        actions += _targets(context, settings, layers_to_match(settings, context.document))
        actions += _lights(context, settings)
    imgui.end_disabled()
    imgui.spacing()
    actions += _buttons(context, settings)
    _found(context, settings)
    return actions


def _set(settings: MatchSettings, **changes: object) -> Action:
    return SetPanel({"match": replace(settings, **changes)})  # type: ignore[arg-type]


def _file(context: PanelContext, settings: MatchSettings) -> list[Action]:
    widgets.label(context, "Photograph", LABEL)
    name = widgets.fitting(settings.file.name, imgui.get_content_region_avail().x - context.px(16))
    hint = f"{settings.file}\nA click chooses another one. It was taken in the scene's light, by the scene's camera."
    pressed = widgets.text_button(context, "match.file", name, hint, width=-1.0)
    return [AskFile("open_photo", settings.object)] if pressed else []


def _mask(context: PanelContext, settings: MatchSettings) -> list[Action]:
    """Which pixels of the photograph count."""
    widgets.label(context, "Mask", LABEL)
    has_one = settings.mask is not None
    width = imgui.get_content_region_avail().x - (imgui.get_frame_height() + context.px(4) if has_one else 0.0)
    name = widgets.fitting(settings.mask.name, width - context.px(16)) if settings.mask else "All pixels"
    if widgets.text_button(context, "match.mask", name, MASK, width=width):
        return [AskFile("open_mask")]
    if not has_one:
        return []
    imgui.same_line(0.0, context.px(4))
    pressed = widgets.icon_button(context, "match.unmask", Icon.CLOSE, "All pixels count again.")
    return [_set(settings, mask=None)] if pressed else []


def _object(context: PanelContext, settings: MatchSettings, objects: list[ObjectState]) -> list[Action]:
    names = [state.name for state in objects]
    chosen = [names.index(settings.object)] if settings.object in names else []
    widgets.label(context, "Object", LABEL)
    picked = widgets.choose(
        context, "match.object", [widgets.Choice(name) for name in names], chosen, "Whose material is matched.",
        "" if chosen else f"{settings.object} is gone",
    )  # fmt: skip
    if picked is None:
        return []
    return [SetPanel({"match": with_object(settings, context.document, names[picked])})]


def _start(context: PanelContext, settings: MatchSettings) -> list[Action]:
    """The material that the match begins with."""
    entries = [each for each in context.library if any(possible_targets(each.material.layers))]
    names = [each.name for each in entries]
    choices = [widgets.Choice("Its own"), *(widgets.Choice(name, apart=not i) for i, name in enumerate(names))]
    begun = settings.start, settings.start_layers
    chosen = [0] if not settings.start else [
        i for i, each in enumerate(entries, 1) if (each.name, each.material.layers) == begun
    ][:1]  # fmt: skip
    widgets.label(context, "Begin with", LABEL)
    picked = widgets.choose(context, "match.start", choices, chosen, START, "" if chosen else settings.start)
    if picked is None:
        return []
    found = ("", ()) if picked == 0 else (names[picked - 1], entries[picked - 1].material.layers)
    return [SetPanel({"match": with_start(settings, context.document, *found)})]


def _transfer(context: PanelContext, settings: MatchSettings) -> list[Action]:
    widgets.label(context, "Values", LABEL)
    if settings.file.suffix.lower() in LINEAR_ENDINGS:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled("linear light, as the file has it")
        return []
    now = ("srgb", "linear").index(settings.transfer) if settings.transfer in ("srgb", "linear") else 2
    pressed = widgets.segments(context, "match.transfer", TRANSFERS, now)
    if pressed is not None:
        return [_set(settings, transfer=("srgb", "linear", f"{GAMMA.default}")[pressed])]
    if now < 2:
        return []

    def make(gamma: float) -> Action:
        return _set(settings, transfer=f"{gamma:.6g}")

    row = rows.Row(GAMMA, float(settings.transfer), make, "match.gamma", GAMMA.default, drag=None)
    return rows.draw(context, row, LABEL)


def _exposure(context: PanelContext, settings: MatchSettings) -> list[Action]:
    widgets.label(context, "Exposure", LABEL)
    known = settings.exposure is not None
    pressed = widgets.segments(context, "match.exposure", EXPOSURES, int(known))
    if pressed is not None:
        return [_set(settings, exposure=1.0 if pressed else None)]
    if settings.exposure is None:
        return []

    def make(exposure: float) -> Action:
        return _set(settings, exposure=exposure)

    row = rows.Row(EXPOSURE, settings.exposure, make, "match.factor", EXPOSURE.default, drag=None)
    return rows.draw(context, replace(row, parameter=replace(EXPOSURE, label="Factor")), LABEL)


def _targets(context: PanelContext, settings: MatchSettings, layers: Layers) -> list[Action]:
    """A line for each that can be found, under the names of layers."""
    actions: list[Action] = []
    widgets.label(context, "Find", LABEL)
    left = imgui.get_cursor_pos_x()
    targets, shown = list(possible_targets(layers)), -1
    for target, name in zip(targets, written_targets(targets), strict=True):
        layer = layers[target.layer]
        imgui.set_cursor_pos_x(left)
        if target.layer != shown:
            imgui.align_text_to_frame_padding()
            imgui.text_disabled(layer.title)
            imgui.set_cursor_pos_x(left)
            shown = target.layer
        is_chosen = name in settings.targets
        pressed = widgets.rich_checkbox(widgets.subscripted(words_of(layer, target)), name, is_chosen)
        context.handles.note_item(f"match.find.{name}")
        widgets.tooltip(FINDS)
        if pressed:
            chosen = {*settings.targets} ^ {name}
            actions.append(_set(settings, targets=tuple(each for each in written_targets(targets) if each in chosen)))
    return actions


def _lights(context: PanelContext, settings: MatchSettings) -> list[Action]:
    """What is found of the light, besides the material."""
    actions: list[Action] = []
    widgets.label(context, "Light", LABEL)
    left = imgui.get_cursor_pos_x()
    for name, words, hint in LIGHTS:
        imgui.set_cursor_pos_x(left)
        is_chosen = bool(getattr(settings, name))
        pressed, _ = imgui.checkbox(f"{words}##{name}", is_chosen)
        context.handles.note_item(f"match.{name}")
        widgets.tooltip(hint)
        if pressed:
            actions.append(_set(settings, **{name: not is_chosen}))
    return actions


def words_of(layer: Layer, target: Target) -> str:
    """What a target is called to the user."""
    if target.name in layer.model.curve_names:
        factor = next(each for each in layer.model.factors if each.name == target.name)
        return f"Curve: {factor.word}"
    named = (each for each in layer.parameter_table if each.name == target.name)
    parameter = scale_parameter(layer) if target.name == SCALE else next(named)
    assert parameter is not None
    return parameter.label


def _buttons(context: PanelContext, settings: MatchSettings) -> list[Action]:
    if context.photo:
        # At the right: the second click of a double click on Match would stop it at once.
        style = imgui.get_style()
        width = imgui.calc_text_size("Stop").x + 2.0 * style.frame_padding.x
        room = imgui.get_content_region_avail().x - width - style.item_spacing.x
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(widgets.shortened(context.photo, room))
        widgets.same_line_at_right(width)
        pressed = widgets.text_button(context, "match.stop", "Stop", "Stop; the material stays as it is.")
        return [StopPhoto()] if pressed else []
    refusal = with_display_names(context.document, match_refusal(context.document, settings))
    if not refusal and not photo_pairs.are_enough(context, settings):
        refusal = f"{len(settings.pairs)} of {LEAST_PAIRS} pairs or more"
    hint = "Find the material, in the background. What is found is one edit, which undo takes back."
    pressed = widgets.text_button(context, "match.begin", "Match", hint, enabled=not refusal)
    if refusal:
        widgets.caption(refusal)
        context.handles.note_item("match.refusal")
    if not pressed:
        return []
    # As shown: of layers that have gone meanwhile nothing is found.
    targets = written_targets(list(possible_targets(layers_to_match(settings, context.document))))
    settings = replace(settings, targets=tuple(name for name in targets if name in settings.targets))
    return [*pair_picking.leave(context), MatchPicture(settings)]


def _found(context: PanelContext, settings: MatchSettings) -> None:
    """What was found last, where it is of these settings."""
    found = context.found
    if found is None or found.settings.file != settings.file or found.settings.object != settings.object:
        return
    answer = found.answer
    imgui.separator()
    widgets.figure("Error", f"{100.0 * answer.before:.3g} % before, {100.0 * answer.error:.3g} % now", ERROR)
    context.handles.note_item("match.error")
    widgets.figure("Exposure", f"{answer.exposure:.4g}", EXPOSURE.tooltip)
    if answer.missed:
        root = (sum(each**2 for each in answer.missed) / len(answer.missed)) ** 0.5
        widgets.figure("Camera", f"points within {root:.2g} px", "Root mean square, in pixels of the photograph.")
    for note in answer.notes:
        widgets.caption(note)
