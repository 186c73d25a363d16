"""The selected layer's model and parameters; every control is built from the model's parameter table."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.commands.layers import SetFresnelTerm, SetModel, SetParameter
from app.document.document import ObjectState, Selection
from app.document.linked_layers import linked_indices
from app.files.measured_import import describe_measurement
from app.system.lazy_import import import_named
from engine.material import MODELS, Layer, Parameter
from engine.material.parameters import Value
from engine.measured.measurement import Measurement
from ui.panels import bumps, colour_controls, emitter, maps, number_fields, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

RGB = tuple[float, float, float]
LARGEST_LABEL = 136.0
# The width that three numbers, or a model's name, need.
WIDE_CONTROL = 136.0


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window: the mode's controls for the selected object, and its material."""
    tools = import_named(context.mode.tools)(context) if context.mode.tools else []
    return [*tools, *_material(context)]


def _material(context: PanelContext) -> list[Action]:
    selection = context.view.selected
    if selection is None:
        imgui.text_disabled("Nothing selected")
        widgets.caption("Click an object in the picture, or a layer in the list.")
        return []
    state = context.document.object(selection.object)
    actions = [] if state.emission is None else emitter.draw(context, state, state.emission)
    if state.is_lamp:
        return actions
    if state.emits:
        imgui.spacing()
    layer = context.document.layer(selection.key)
    editable = state.editable and not context.document.is_frozen(selection.key)
    width = _label_width(context, layer)
    actions += _heading(context, selection, layer, editable)
    imgui.begin_disabled(not editable)
    actions += _model(context, selection.key, layer, width)
    for parameter in layer.parameter_table:
        actions += _parameter(context, selection.key, layer, parameter, width)
    if _shows_images(context, layer):
        actions += maps.draw(context, selection.key, layer.maps, width)
    if context.state.shows_images or state.bumps.file:
        actions += bumps.draw(context, state, width)
    imgui.end_disabled()
    if note := _sharing_note(state, selection.layer):
        widgets.caption(note)
    if context.status.material_note:
        widgets.caption(context.status.material_note)
    return actions


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
    return _switches(context, selection.key, layer) if editable else []


def _shows_images(context: PanelContext, layer: Layer) -> bool:
    return context.state.shows_images or not layer.maps.is_plain


def _switches(context: PanelContext, key: str, layer: Layer) -> list[Action]:
    """The switches of what few layers have, at the right: images, and a second term."""
    has_term = layer.rises or not layer.follows
    gap, texts = context.px(4), ["Images", *(["Fresnel"] if has_term else [])]
    widgets.same_line_at_right(
        sum(widgets.rich_width(text) + context.px(16) for text in texts) + gap * (len(texts) - 1)
    )
    top = imgui.get_cursor_pos_y() - imgui.get_style().frame_padding.y  # aligns the text
    imgui.set_cursor_pos_y(top)
    actions = _image_switch(context, layer)
    if has_term:
        imgui.same_line(0.0, gap)
        imgui.set_cursor_pos_y(top)
        actions += _fresnel_switch(context, key, layer)
    return actions


def _image_switch(context: PanelContext, layer: Layer) -> list[Action]:
    """Whether the rows of images are shown; those of a layer that has images always are."""
    shown = _shows_images(context, layer)
    hint = "A texture that multiplies the layer, a map of how much of it there is, and the object's bumps."
    pressed = widgets.segments(context, "material.images", [("Images", hint)], 0 if shown else -1)
    return [] if pressed is None else [SetPanel({"shows_images": not context.state.shows_images})]


def _fresnel_switch(context: PanelContext, key: str, layer: Layer) -> list[Action]:
    """Whether there is a second term."""
    there = layer.fresnel is not None
    hint = (
        "A second, additive layer of the same curves, edited once, that rises towards grazing angles: the colour "
        "becomes R, what is reflected head-on, and the rest comes at grazing angles."
    )
    pressed = widgets.segments(context, "material.fresnel_term", [("Fresnel", hint)], 0 if there else -1)
    return [] if pressed is None else [SetFresnelTerm(key, not there)]


def _label_width(context: PanelContext, layer: Layer) -> float:
    """The width of a column, at scale 1, in which the model's longest label fits, within limits."""
    longest = max((widgets.rich_width(widgets.subscripted(p.label)) for p in layer.parameter_table), default=0.0)
    return min(max(longest / context.theme.scale + 10.0, widgets.LABEL_WIDTH), LARGEST_LABEL)


def _model(context: PanelContext, key: str, layer: Layer, width: float) -> list[Action]:
    actions: list[Action] = []
    widgets.label(context, "Model", width, WIDE_CONTROL)
    if widgets.begin_combo("##model", layer.model.label):
        for model in (each for each in MODELS.values() if not each.needs_file or each is layer.model):
            pressed, _ = imgui.selectable(model.label, model is layer.model)
            widgets.tooltip(model.tooltip)
            if pressed and model is not layer.model:
                actions.append(SetModel(key, model.name))
        imgui.end_combo()
    context.handles.note_item("material.model")
    widgets.tooltip(
        f"{layer.model.tooltip} Another model starts from its own defaults; edits of curves that both have stay."
    )
    return actions


def _parameter(context: PanelContext, key: str, layer: Layer, parameter: Parameter, width: float) -> list[Action]:
    value = layer.values[parameter.name]
    least = WIDE_CONTROL if isinstance(value, tuple) else widgets.LEAST_CONTROL
    n_lines = 2 if widgets.is_stacked(context, width, least) else 1
    reset = _right_clicked(n_lines) and not isinstance(parameter.default, Measurement)
    widgets.label(context, parameter.label, width, least)
    imgui.push_id(parameter.name)
    if isinstance(value, Measurement):
        actions = _measured(value)
    elif isinstance(value, str):
        actions = _choice(context, key, parameter, value)
    elif isinstance(value, tuple):
        actions = _colour(context, key, parameter, value)
    else:
        actions = _scalar(context, key, parameter, value)
    if reset:
        actions = [SetParameter(key, parameter.name, _own_value(context, key, layer, parameter))]
    imgui.pop_id()
    return actions


def _right_clicked(n_lines: int) -> bool:
    """Whether the row about to be drawn, of so many lines, is clicked with the right button."""
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    height = imgui.get_frame_height() + (n_lines - 1) * imgui.get_frame_height_with_spacing()
    end = ImVec2(corner.x + room.x, corner.y + height)
    inside = imgui.is_mouse_hovering_rect(corner, end) and imgui.is_window_hovered()
    return inside and imgui.is_mouse_clicked(1)


def _measured(value: Measurement) -> list[Action]:
    """The file's name; with the facts about it as a tooltip."""
    imgui.align_text_to_frame_padding()
    name = Path(value.file).name or "nothing"
    imgui.text_unformatted(widgets.fitting(name, imgui.get_content_region_avail().x))
    widgets.tooltip(f"{describe_measurement(value)}, so that unedited layers are the measurement.\n{value.file}")
    return []


def _own_value(context: PanelContext, key: str, layer: Layer, parameter: Parameter) -> Value:
    """A parameter as the scene's file has it; where the file has no such layer, or another model, its default."""
    described = next((own for name, own in context.scene_document.layers() if name == key), None)
    if described is None or described.model is not layer.model:
        return parameter.default
    return described.values.get(parameter.name, parameter.default)


def _hint(context: PanelContext, key: str, parameter: Parameter) -> str:
    later = " Self-shadowing follows when idle." if "quotient" in parameter.drives else ""
    own = _own_value(context, key, context.document.layer(key), parameter)
    return f"{parameter.tooltip}{later} Right click: back to {value_text(own)}."


def value_text(value: Value) -> str:
    """A parameter's value for a tooltip."""
    if isinstance(value, tuple):
        return f"{value[0]:.4g}" if len(set(value)) == 1 else ", ".join(f"{each:.3g}" for each in value)
    return choice_label(value) if isinstance(value, str) else f"{value:.4g}"


def _choice(context: PanelContext, key: str, parameter: Parameter, value: str) -> list[Action]:
    actions: list[Action] = []
    if widgets.begin_combo("##choice", choice_label(value)):
        for choice in parameter.choices:
            pressed, _ = imgui.selectable(choice_label(choice), choice == value)
            if pressed and choice != value:
                actions.append(SetParameter(key, parameter.name, choice))
        imgui.end_combo()
    context.handles.note_item(f"material.{parameter.name}")
    widgets.tooltip(_hint(context, key, parameter))
    return actions


def choice_label(choice: str) -> str:
    """A choice as it is shown; short ones are upper-case abbreviations."""
    return choice.upper() if len(choice) <= 3 else choice.capitalize()


def _scalar(context: PanelContext, key: str, parameter: Parameter, value: float) -> list[Action]:
    text = number_format(parameter)
    touch, moved = number_fields.slider(
        context, parameter.name, value, parameter.minimum, parameter.maximum, text, parameter.logarithmic,
        handle=f"material.{parameter.name}", title=parameter.label,
        pixels_to_double=abs(parameter.power) * number_fields.PIXELS_TO_DOUBLE if parameter.logarithmic else None,
    )  # fmt: skip
    widgets.tooltip(_hint(context, key, parameter))
    return _edits(touch, key, parameter, moved)


def number_format(parameter: Parameter) -> str:
    """A number format with as many digits as the range requires, and the unit."""
    digits = "%.4g" if parameter.logarithmic else "%.3f" if parameter.maximum <= 10.0 else "%.4g"
    return f"{digits} {parameter.unit}".rstrip().replace(" °", "°")


def _edits(touch: number_fields.Touch, key: str, parameter: Parameter, value: float | RGB) -> list[Action]:
    """One drag of a control as one step of the history."""
    actions: list[Action] = []
    if touch.began:
        actions.append(BeginDrag(f"{key} {parameter.name.replace('_', ' ')}"))
    if touch.changed:
        actions.append(SetParameter(key, parameter.name, value))
    if touch.ended:
        actions.append(EndDrag())
    return actions


def _colour(context: PanelContext, key: str, parameter: Parameter, value: RGB) -> list[Action]:
    """Three numbers; a swatch with a colour wheel where they are reflectances."""
    actions: list[Action] = []
    hint = f"{_hint(context, key, parameter)} Drag sideways, or double-click to type."
    numbers = colour_controls.NumberTriple(
        f"material.{parameter.name}", parameter.label, hint,
        parameter.minimum, parameter.maximum, min((parameter.maximum - parameter.minimum) / 400.0, 0.02), "%.3f",
    )  # fmt: skip
    swatch = parameter.maximum <= 1.0
    for touch, moved in colour_controls.row(context, numbers, value, swatch):
        actions += _edits(touch, key, parameter, moved)
    if swatch:
        touch, picked = colour_controls.swatch(
            context, numbers, value, f"{parameter.tooltip} Click for a colour wheel."
        )
        low, high = parameter.minimum, parameter.maximum
        red, green, blue = (min(max(v, low), high) for v in picked)
        actions += _edits(touch, key, parameter, (red, green, blue))
    return actions
