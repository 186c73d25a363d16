"""A parameter that varies over the surface, in the material panel: its image, the channel, and the values at black and
at white, in place of the parameter's own row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import imgui

from app.document.commands.maps import SetParameterMap
from app.operators.registry import keys_of
from engine.material.layer import Layer
from engine.material.layer_maps import CHANNELS, WEIGHT_CHANNEL
from engine.material.parameter_maps import MAPPED_KINDS, RESPONSES, ParameterMap, parameter_map_from
from engine.material.parameters import FRESNEL, Parameter, Value
from ui.panels import rows, widgets
from ui.panels.actions import Action, AskFile
from ui.panels.context import PanelContext
from ui.panels.maps import GAP, file_button, image_label
from ui.theme import Icon

HINT = (
    "An image whose channel gives this parameter at each point of the surface: PNG, JPEG or OpenEXR, laid out by the "
    "mesh's texture coordinates. The picture is a blend of a few values; the plan says how many, and the error."
)
CHANNEL_HINT = "The channel of the image that is read; green is roughness, blue metalness in glTF's images."
SQUARE_HINT = "The parameter follows the channel's square: roughness in glTF's images, whose square is α."
CHANNEL_WIDTH = 64.0


def can_vary(layer: Layer, parameter: Parameter) -> bool:
    """Whether a parameter can have a map: a number or a colour of the model. The Fresnel R belongs to two layers."""
    return parameter.kind in MAPPED_KINDS and parameter.name != FRESNEL.name and not layer.rises


def draw_button(context: PanelContext, key: str, parameter: Parameter, width: float) -> list[Action]:
    """The row of a parameter without a map: a button that chooses an image."""
    widgets.label(context, "", width)
    return _file(context, key, parameter, "", imgui.get_content_region_avail().x)


def draw(
    context: PanelContext, key: str, parameter: Parameter, map_: ParameterMap, own: ParameterMap | None, width: float
) -> list[Action]:
    """The rows of a parameter with a map; own: as the scene's file has it, None where it has none."""
    name, gap, side = parameter.name, context.px(GAP), imgui.get_frame_height()
    widgets.label(context, parameter.label, width)
    channel_width = context.px(CHANNEL_WIDTH)
    room = imgui.get_content_region_avail().x - channel_width - side - 2.0 * gap
    actions = _file(context, key, parameter, map_.image.file, room)
    imgui.same_line(0.0, gap)
    imgui.set_next_item_width(channel_width)
    choices = [widgets.Choice(WEIGHT_CHANNEL.title_of(channel), key=channel) for channel in CHANNELS]
    picked = widgets.choose(
        context, f"material.{name}_map.channel", choices, [CHANNELS.index(map_.image.channel)], CHANNEL_HINT
    )
    if picked is not None:
        actions.append(SetParameterMap(key, name, {"channel": CHANNELS[picked]}))
    imgui.same_line(0.0, gap)
    hint = f"The same value everywhere again; {keys_of('undo')} brings the image back."
    if widgets.icon_button(context, f"clear_{name}_map", Icon.CLOSE, hint):
        actions.append(SetParameterMap(key, name, None))
    back = own or parameter_map_from(parameter, map_.image.file)
    actions += _end(context, key, parameter, "Black", map_.low, back.low, width, lambda value: (value, map_.high))
    actions += _end(context, key, parameter, "White", map_.high, back.high, width, lambda value: (map_.low, value))
    widgets.label(context, "", width)
    if widgets.switch(context, f"material.{name}_map.square", "Squared", SQUARE_HINT, map_.response == "square"):
        other = RESPONSES[1 - RESPONSES.index(map_.response)]
        actions.append(SetParameterMap(key, name, {"response": other}))
    return actions


def _end(
    context: PanelContext, key: str, parameter: Parameter, label: str, value: Value, own: Value, width: float,
    range_with: Callable[[Value], tuple[Value, Value]],
) -> list[Action]:  # fmt: skip
    """The row of the value at one end of the channel; own: what a right click sets it back to."""
    shown = replace(
        parameter, label=label, tooltip=f"{parameter.label} where the channel is {label.lower()}. Shown when idle."
    )

    def make(new: Value) -> Action:
        return SetParameterMap(key, parameter.name, {"range": range_with(new)})

    row = rows.Row(shown, value, make, f"material.{parameter.name}_map.{label.lower()}", own)
    return rows.draw(context, row, width)


def _file(context: PanelContext, key: str, parameter: Parameter, file: str, room: float) -> list[Action]:
    words = image_label(file) or "Map…"
    ask = AskFile("open_parameter_map", f"{key}.{parameter.name}")
    return file_button(context, f"material.{parameter.name}_map", words, file, HINT, room, ask)
