"""The selected layer's model and parameters; every control is built from the model's parameter table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from app.document.commands.layers import SetFresnelTerm, SetModel, SetParameter, SetUnder, SetVariant
from app.document.commands.light import EMISSION, STRENGTH, SetEmission
from app.document.commands.linked_objects import LinkObjects
from app.document.document import ObjectState, Selection
from app.document.light_mix import emission_of
from app.document.light_state import RGB
from app.document.linked_layers import linked_indices, possible_covers
from app.document.linked_objects import linked_objects
from app.document.selection import selected_sun
from app.files.materials import describe_measurement
from app.operators.files import VariantChoice
from app.system.lazy_import import import_named
from engine.core.errors import list_names
from engine.material import MODELS, Layer, Parameter
from engine.material.bumps import BUMP_STRENGTH, COAT_STRENGTH, TANGENT_ANGLE
from engine.material.measured import HIGHLIGHT_MODELS
from engine.material.opacity import OPAQUE
from engine.material.parameters import INDICES, Value, index_of_reflectance, reflectance_of_index
from engine.measured.measurement import Measurement
from ui import theme as look
from ui.panels import lamp_rows, light_colour, maps, material_matching, parameter_maps, rows, suns, transform, widgets
from ui.panels.actions import Action, RunOperator, SetPanel
from ui.panels.brdf import is_anisotropic
from ui.panels.context import PanelContext
from ui.theme import Icon

LARGEST_LABEL = 136.0
SWITCH_WIDTH = 26.0
IMAGES_HINT = (
    "Images: a texture that multiplies the layer, maps of its parameters and of its weight, and the object's bumps and "
    "opacity."
)
SET_HINT = "A variant of the stage, as its file has it: the file is read again, and edits stay."
VARIANT_HINT = "A look of the whole scene, as its file has it. It replaces edits of materials."
UNDER_HINT = "The layer that lies on this one, a clear coat or a sheen: what it reflects is lost to this one."
ANGLES_OF_NOTE = np.radians([0.0, 80.0])
FRESNEL_HINT = (
    "Fresnel: a second, additive layer of the same curves, edited once, that rises towards grazing angles: the colour "
    "becomes R, what is reflected head-on, and the rest comes at grazing angles."
)


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window: the mode's controls for the selected object, its material and transform."""
    tools = import_named(context.mode.tools)(context) if context.mode.tools else []
    return [*tools, *_material(context), *(transform.draw(context) if transform.is_shown(context) else [])]


def _material(context: PanelContext) -> list[Action]:
    selection = context.view.selected
    width = widgets.LABEL_WIDTH if selection is None else _labels_of(context, selection)
    actions = _variant(context, width)
    sun = selected_sun(context.document, context.view)
    if sun is not None:
        imgui.text(sun.name)
        widgets.caption("A sun; its strength and colour in the mix are in the Light panel.")
        return actions + suns.draw(context, sun, "selected_sun")
    if selection is None:
        imgui.text_disabled("Nothing selected")
        widgets.caption("Click an object in the picture, or a layer in the list.")
        return actions
    state = context.document.object(selection.object)
    actions += _users(context, state)
    if state.emission is not None:
        actions += _emission(context, state, state.emission)
    if state.is_lamp:
        return actions
    if state.emits:
        imgui.spacing()
    layer = context.document.layer(selection.key)
    editable = state.editable and not context.document.is_frozen(selection.key)
    actions += _heading(context, selection, layer, editable)
    imgui.begin_disabled(not editable)
    actions += _model(context, selection.key, layer, width)
    material_matching.draw_result(context, selection.object)
    for parameter in layer.parameter_table:
        actions += _parameter(context, selection.key, layer, parameter, width)
    actions += _under(context, selection.key, state, layer, width)
    if _shows_tangent(context, state):
        actions += maps.draw_tangent(context, state, width)
    if _shows_images(context, layer):
        actions += maps.draw(context, selection.key, layer.maps, width)
    if _shows_bumps(context, state, layer):
        actions += maps.draw_bumps(context, state, layer, selection.key, width)
    if context.state.shows_images or state.opacity != OPAQUE:
        actions += maps.draw_opacity(context, state, width)
    imgui.end_disabled()
    if note := _cover_note(layer):
        widgets.caption(note)
    if note := _sharing_note(state, selection.layer):
        widgets.caption(note)
    if context.status.material_note:
        widgets.caption(context.status.material_note)
    return actions


def _users(context: PanelContext, state: ObjectState) -> list[Action]:
    """With which objects it shares its material, and what gives it one of its own, where it shares it."""
    linked = linked_objects(context.document, state.name)
    if not linked:
        return []
    imgui.align_text_to_frame_padding()
    hint = f"Shared with {list_names(linked, 8)}: edits of one are edits of all. Click: it is edited alone from now on."
    is_pressed = widgets.icon_button(context, "material.single_user", Icon.LINK, hint, lit=True)
    imgui.same_line()
    text = f"Shared with {list_names(linked, 2)}"
    imgui.text_colored(look.ACCENT, widgets.shortened(text, imgui.get_content_region_avail().x))
    widgets.tooltip(hint)
    return [LinkObjects((state.name,))] if is_pressed else []


def _shows_bumps(context: PanelContext, state: ObjectState, layer: Layer) -> bool:
    own = state.bumps.file or state.bumps.coat_normal_map or layer.frame == "coat"
    return context.state.shows_images or bool(own)


def _shows_tangent(context: PanelContext, state: ObjectState) -> bool:
    return is_anisotropic(context) or state.bumps.rotates_tangents


def _labels_of(context: PanelContext, selection: Selection) -> float:
    """The width of the labels of what is selected, which all rows have."""
    state = context.document.object(selection.object)
    if state.is_lamp:
        return widgets.LABEL_WIDTH
    layer = context.document.layer(selection.key)
    of_object = [BUMP_STRENGTH, COAT_STRENGTH] if _shows_bumps(context, state, layer) else []
    of_object += [TANGENT_ANGLE] if _shows_tangent(context, state) else []
    return _label_width(context, (*layer.parameter_table, *of_object))


def _variant(context: PanelContext, width: float) -> list[Action]:
    """The choice among the variants of the scene's materials, where its files have some."""
    actions, names = _variant_sets(context, width), context.document.variants
    if not names:
        return actions
    choices, now = [widgets.Choice(name, "", name) for name in names], context.document.variant
    widgets.label(context, "Variant", width, rows.WIDE_CONTROL)
    chosen = [names.index(now)] if now else []
    picked = widgets.choose(context, "material.variant", choices, chosen, VARIANT_HINT, now or "Edited")
    return actions if picked is None else [*actions, SetVariant(names[picked])]


def _variant_sets(context: PanelContext, width: float) -> list[Action]:
    """The choices among the variants of the sets of a stage, which it is opened again for."""
    actions: list[Action] = []
    for group in context.report.variant_sets:
        choices = [widgets.Choice(name, "", name) for name in group.variants]
        widgets.label(context, group.name, width, rows.WIDE_CONTROL)
        chosen = [group.variants.index(group.chosen)] if group.chosen in group.variants else []
        picked = widgets.choose(
            context, f"material.set.{group.name}", choices, chosen, SET_HINT, group.chosen or "None"
        )
        if picked is not None:
            actions.append(RunOperator("variant_set", VariantChoice(set=group.name, variant=group.variants[picked])))
    return actions


def _under(context: PanelContext, key: str, state: ObjectState, layer: Layer, width: float) -> list[Action]:
    """The choice of the layer that lies on this one, where the object has any that can."""
    names = ("", *possible_covers(state.layers, layer))
    if len(names) == 1 or layer.rises:
        return []
    titles = {each.name: each.title for each in state.layers}
    choices = [widgets.Choice(titles.get(name, "Nothing"), "", name) for name in names]
    widgets.label(context, "Under", width, rows.WIDE_CONTROL)
    chosen = names.index(layer.under) if layer.under in names else 0
    picked = widgets.choose(context, "material.under", choices, [chosen], UNDER_HINT)
    return [] if picked is None else [SetUnder(key, names[picked])]


def _cover_note(layer: Layer) -> str:
    """What the layers above take from this one."""
    above = [cover.title for cover in layer.covers if cover.visible]
    if not above:
        return ""
    facing, slanted = 100.0 * (1.0 - layer.uncovered_share(ANGLES_OF_NOTE))
    return f"{' and '.join(above)} on it takes {facing:.0f} % of it, seen head-on, and {slanted:.0f} % at 80°."


def _sharing_note(state: ObjectState, index: int) -> str:
    """Which layers are edited along with this one, and in which curves."""
    layer, others = state.layers[index], [i for i in linked_indices(state.layers, index) if i != index]
    if layer.rises:
        lead = state.layers[linked_indices(state.layers, index)[0]]
        return f"All of this is shared with {lead.title}: edited in one, it follows in the other."
    sharing = [state.layers[i].title for i in others if not state.layers[i].rises]
    return f"Curves, and what drives them, are shared with {', '.join(sharing)}." if sharing else ""


def _heading(context: PanelContext, selection: Selection, layer: Layer, editable: bool) -> list[Action]:
    title = f"/  {layer.title}"
    room, gap = imgui.get_content_region_avail().x, imgui.get_style().item_spacing.x
    context.theme.push_bold()
    # The object's name is shortened before the layer's, but not below half of the line.
    imgui.text_unformatted(
        widgets.shortened(selection.object, max(room - gap - imgui.calc_text_size(title).x, 0.5 * room))
    )
    imgui.pop_font()
    imgui.same_line()
    imgui.text_disabled(widgets.shortened(title, imgui.get_content_region_avail().x))
    widgets.tooltip(f"{selection.object} / {layer.title}")
    if not editable:
        imgui.same_line()
        imgui.text_disabled(Icon.FROZEN)
        widgets.tooltip("Frozen or fixed: thaw it, or make it editable, in the object list.")
    return _switches(context, selection, layer, editable)


def _shows_images(context: PanelContext, layer: Layer) -> bool:
    return context.state.shows_images or not layer.maps.is_plain or bool(layer.parameter_maps)


def _switches(context: PanelContext, selection: Selection, layer: Layer, editable: bool) -> list[Action]:
    """The switches of rows that are seldom used, at the right: of the object's transform, and, where the layer can be
    edited, for images, which layers that have images always show, and of a second term; and a menu of models to match
    the material with."""
    has_term = editable and (layer.rises or not layer.follows)
    switches = [(Icon.DIAGONAL, "material.transform", transform.HINT, transform.is_shown(context))]
    if editable:
        switches.append((Icon.IMAGE, "material.images", IMAGES_HINT, _shows_images(context, layer)))
    if has_term:
        switches.append(("F", "material.fresnel_term", FRESNEL_HINT, layer.fresnel is not None))
    gap, least = context.px(4), SWITCH_WIDTH
    widgets.same_line_at_right(
        sum(widgets.segments_width(context, [text], least) for text, *_ in switches)
        + gap * (len(switches) - 1)
        + (gap + imgui.get_frame_height() if editable else 0.0)
    )
    top = imgui.get_cursor_pos_y() - imgui.get_style().frame_padding.y  # aligns the text
    pressed = set()
    for index, (text, name, hint, is_on) in enumerate(switches):
        if index:
            imgui.same_line(0.0, gap)
        imgui.set_cursor_pos_y(top)
        if widgets.switch(context, name, text, hint, is_on, least):
            pressed.add(name)
    actions: list[Action] = []
    if editable:
        imgui.same_line(0.0, gap)
        imgui.set_cursor_pos_y(top)
        actions += _match_material(context, selection.object)
    if "material.transform" in pressed:
        without = {} if not transform.is_shown(context) else {"gizmo": ""}  # which would keep the rows there
        actions.append(SetPanel({"shows_transform": not transform.is_shown(context), **without}))
    if "material.images" in pressed:
        actions.append(SetPanel({"shows_images": not context.state.shows_images}))
    if "material.fresnel_term" in pressed:
        actions.append(SetFresnelTerm(selection.key, layer.fresnel is None))
    return actions


def _label_width(context: PanelContext, parameters: Sequence[Parameter]) -> float:
    """The width of a column, at scale 1, in which the longest label fits, within limits."""
    longest = max((widgets.rich_width(widgets.subscripted(each.label)) for each in parameters), default=0.0)
    return min(max(longest / context.theme.scale + 10.0, widgets.LABEL_WIDTH), LARGEST_LABEL)


def _model(context: PanelContext, key: str, layer: Layer, width: float) -> list[Action]:
    highlights = tuple(HIGHLIGHT_MODELS.values())
    of_measured = highlights if layer.model in highlights else (layer.model,)
    models = [each for each in MODELS.values() if not each.needs_file or each in of_measured]
    choices = [widgets.Choice(model.label, model.tooltip, model.name) for model in models]
    hint = f"{layer.model.tooltip} Another model starts from its own defaults; edits of curves that both have stay."
    widgets.label(context, "Model", width, rows.WIDE_CONTROL)
    picked = widgets.choose(context, "material.model", choices, [models.index(layer.model)], hint)
    return [] if picked is None else [SetModel(key, models[picked].name)]


def _match_material(context: PanelContext, name: str) -> list[Action]:
    """A button that lists the models that all of the object's material can be matched with."""
    if widgets.icon_button(
        context, "material.match_material", "≈", f"Match {name} with a model. {material_matching.HINT}"
    ):
        imgui.open_popup("match material")
    if not imgui.begin_popup("match material"):
        return []
    actions = material_matching.models(context, "material.match_material", name, name)
    imgui.end_popup()
    return actions


def _parameter(context: PanelContext, key: str, layer: Layer, parameter: Parameter, width: float) -> list[Action]:
    value = layer.values[parameter.name]
    if isinstance(value, Measurement):
        widgets.label(context, parameter.label, width)
        return _measured(value)
    own = _own_value(context, key, layer, parameter)
    later = "Self-shadowing follows when idle." if "quotient" in parameter.drives else ""
    row = rows.Row(
        parameter, value, partial(SetParameter, key, parameter.name), f"material.{parameter.name}", own, note=later
    )
    if map_ := layer.parameter_map(parameter.name):
        described = _own_layer(context, key, layer)
        own_map = None if described is None else described.parameter_map(parameter.name)
        return parameter_maps.draw(context, key, parameter, map_, own_map, width)
    actions = rows.draw(context, row, width)
    if context.state.shows_images and parameter_maps.can_vary(layer, parameter):
        actions += parameter_maps.draw_button(context, key, parameter, width)
    index = INDICES.get(parameter.name)
    if index is None:
        return actions
    # The same reflectance, as an index of refraction.
    row = rows.Row(
        index, index_of_reflectance(value),
        lambda n: SetParameter(key, parameter.name, reflectance_of_index(n)),
        f"material.{index.name}", index_of_reflectance(own), note=later,
    )  # fmt: skip
    return actions + rows.draw(context, row, width)


def _measured(value: Measurement) -> list[Action]:
    """The file's name; with the facts about it as a tooltip."""
    imgui.align_text_to_frame_padding()
    name = Path(value.file).name or "nothing"
    imgui.text_unformatted(widgets.fitting(name, imgui.get_content_region_avail().x))
    widgets.tooltip(f"{describe_measurement(value)}, so that unedited layers are the measurement.\n{value.file}")
    return []


def _own_value(context: PanelContext, key: str, layer: Layer, parameter: Parameter) -> Value:
    """A parameter as the scene's file has it, else its default."""
    described = _own_layer(context, key, layer)
    return parameter.default if described is None else described.values.get(parameter.name, parameter.default)


def _own_layer(context: PanelContext, key: str, layer: Layer) -> Layer | None:
    """A layer as the scene's file has it; None where the file has no such layer, or another model."""
    described = next((own for name, own in context.scene_document.layers() if name == key), None)
    return None if described is None or described.model is not layer.model else described


# ------------------------------------------------------------------------------------------- the light of an emitter


def _emission(context: PanelContext, state: ObjectState, emission: RGB) -> list[Action]:
    """The heading, and the strength and colour of the object's light."""
    context.theme.push_bold()
    imgui.text_unformatted(state.name)
    imgui.pop_font()
    imgui.same_line()
    imgui.text_disabled("/  light")
    imgui.begin_disabled(state.frozen)
    own = next((each for name, each in emission_of(context.scene_document) if name == state.name), None)
    actions = rows.draw(
        context,
        rows.Row(
            STRENGTH, max(emission), lambda strength: SetEmission(state.name, light_colour.scaled(emission, strength)),
            "emitter.strength", None if own is None else max(own),
        ),
    )  # fmt: skip
    parameter = replace(EMISSION, step=max(max(emission), STRENGTH.minimum) / 200.0)
    actions += light_colour.draw(context, rows.Row(parameter, emission, partial(SetEmission, state.name), "emitter"))
    imgui.end_disabled()
    actions += lamp_rows.draw(context, state, "lamp")
    if note := context.status.emitter_note:
        widgets.caption(f"{note[0].upper()}{note[1:]}.")
    return actions
