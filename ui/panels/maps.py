"""The images of the selected layer, its texture and its weight map, its object's bumps, and the rotation of its
tangents: parts of the material panel."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.commands.layers import SetFrame
from app.document.commands.maps import ClearMap, SetBumps, SetMap, SetOpacity
from app.document.document import ObjectState
from app.operators.registry import keys_of
from engine.material.bumps import (
    BUMP_HEIGHT,
    BUMP_REPEATS,
    BUMP_STRENGTH,
    COAT_REPEATS,
    COAT_STRENGTH,
    TANGENT_ANGLE,
    TANGENT_RANGE,
)
from engine.material.layer import Layer, object_of
from engine.material.layer_maps import SPACES, TEXTURE_SCALE, TEXTURE_SPACE, TEXTURE_STRENGTH, WEIGHT_CHANNEL, LayerMaps
from engine.material.opacity import OPACITY_CUTOFF, OPACITY_FACTOR, OPACITY_MODE
from engine.material.parameters import Parameter
from ui import theme as look
from ui.panels import paint, rows, widgets
from ui.panels.actions import Action, AskFile, ReloadImages
from ui.panels.context import Handles, PanelContext
from ui.panels.pictures import Picture
from ui.theme import Icon, Theme

# How far an image's row reaches from the middle of its button, to the sides and up and down, pixels at scale 1.
ROW_REACH, ROW_HALF = 150.0, 14.0
LABELS = {"texture": "Texture", "weight": "Weight map"}
HINTS = {
    "texture": "An image whose colours multiply the layer: PNG, JPEG or OpenEXR, laid out by the mesh's texture "
    "coordinates. Files may be dropped on this row, a PNG or JPEG anywhere.",
    "weight": "A grey image with the weight of the layer: white is all of it, black none. Two layers with one "
    "map, in one of them inverted, are blended by it. Files may be dropped on this row.",
    "normal_map": "An image of directions that turns the object's normals, under all of its layers (tangent space, as "
    "glTF has it: red to the right, green up): PNG, JPEG or OpenEXR.",
    "bump_map": "A grey image of heights that turns the object's normals, under all of its layers: PNG, JPEG or "
    "OpenEXR.",
    "coat_normal_map": "An image of directions that turns the normals of layers that have those of the coat, as the "
    "object's own normal map does for the others: PNG, JPEG or OpenEXR.",
    "opacity_map": "An image whose alpha, or, if it has none, whose brightness says how much of the object is there: "
    "PNG or OpenEXR, laid out by the mesh's texture coordinates.",
    "tangent_map": "A grey image of angles that rotate the direction of the streaks, in addition to the rotation "
    "above: PNG, JPEG or OpenEXR, laid out by the mesh's texture coordinates.",
}
VERTEX_COLOURS_HINT = "The colours of the mesh's vertices multiply the layer, and its texture if it has one."
FLIP_GREEN_HINT = (
    "The direction that green means in the normal map: up, as in glTF and OpenGL, or down, as in maps for DirectX. "
    "If relief looks pressed in, and its light comes from below, the other one is right. Shown when idle."
)
FRAME_HINT = (
    "Whose normals this layer has: those of the object's bumps, or the coat's, which are smooth or of a normal map of "
    "their own. A clear coat over a rough or woven base does not follow its relief. Shown when idle."
)
FURTHER_HINT = "A map from the file, of what lies on this layer or shares its place: it multiplies the layer as well."
ALONG_U_HINT = (
    "What the streaks run along before they are rotated: around the object's own Y axis, as a lathe leaves them, or in "
    "the direction in which the texture coordinate u grows, as in glTF files. Shown when idle."
)
VECTORS_HINT = (
    "What the map's colours mean: angles by their brightness, or directions, along u in red and along v in green, as "
    "in glTF files. Shown when idle."
)
GAP = 4.0


def draw(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The rows of both images."""
    actions = _image(context, key, "texture", maps, width)
    actions += _vertex_colours(context, key, maps, width)
    if maps.is_tinted:
        make, handle = partial(SetMap, key, TEXTURE_STRENGTH.name), "material.texture_strength"
        strength = rows.Row(TEXTURE_STRENGTH, maps.texture_strength, make, handle, TEXTURE_STRENGTH.default)
        actions += rows.draw(context, strength, width)
    if maps.texture:
        actions += _repeats(context, key, maps, width)
    actions += _image(context, key, "weight", maps, width)
    if maps.weight and maps.weight_channel != WEIGHT_CHANNEL.default:
        make = partial(SetMap, key, WEIGHT_CHANNEL.name)
        channel = rows.Row(WEIGHT_CHANNEL, maps.weight_channel, make, "material.weight_channel", WEIGHT_CHANNEL.default)
        actions += rows.draw(context, channel, width)
    actions += paint.draw(context, key, maps, width)
    for k in range(len(maps.further_weights)):
        actions += _further_weight(context, key, maps, k, width)
    if context.map_refusal:
        widgets.caption(context.map_refusal)
    return actions


def _further_weight(context: PanelContext, key: str, maps: LayerMaps, k: int, width: float) -> list[Action]:
    """The row of a further weight map: its name, its inversion, and a button to remove it."""
    further, others, gap = maps.further_weights[k], list(maps.further_weights), context.px(GAP)
    widgets.label(context, f"Weight map {k + 2}", width)
    right = imgui.get_frame_height() + _segment_width(context, "Invert") + 2.0 * gap
    words = f"{image_label(further.image.file)} {WEIGHT_CHANNEL.title_of(further.image.channel).lower()}"
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(widgets.fitting(words, imgui.get_content_region_avail().x - right))
    widgets.tooltip(f"{further.image.file}\n\n{FURTHER_HINT}")
    widgets.same_line_at_right(right - gap)
    if widgets.switch(
        context, f"material.further_{k}", "Invert", "The layer is where the map is black.", further.invert
    ):
        others[k] = replace(further, invert=not further.invert)
        return [SetMap(key, "further_weights", tuple(others))]
    imgui.same_line(0.0, gap)
    hint = f"Removes the map; {keys_of('undo')} brings it back."
    if widgets.icon_button(context, f"clear_further_{k}", Icon.CLOSE, hint):
        return [SetMap(key, "further_weights", tuple(others[:k] + others[k + 1 :]))]
    return []


def _vertex_colours(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The switch of vertex colours, where a layer of the object has them here or in the scene's file."""
    layers = (*context.document.layers(), *context.scene_document.layers())
    if not any(layer.maps.vertex_colours for other, layer in layers if object_of(other) == object_of(key)):
        return []
    widgets.label(context, "Colours", width)
    words = "Of vertices × texture" if maps.texture else "Of vertices"
    if widgets.switch(context, "material.vertex_colours", words, VERTEX_COLOURS_HINT, maps.vertex_colours):
        return [SetMap(key, "vertex_colours", not maps.vertex_colours)]
    return []


def draw_bumps(context: PanelContext, state: ObjectState, layer: Layer, key: str, width: float) -> list[Action]:
    """The rows of an object's normal or bump map, the image, and where there is one its strength and repeats; and of
    whose normals a layer has, with those of the map that layers of the coat's frame have."""
    actions = _base_bumps(context, state, width)
    if not (layer.can_cover or layer.frame == "coat"):
        return actions
    widgets.label(context, "Normals", width)
    of_coat = layer.frame == "coat"
    if widgets.switch(context, "material.frame", "Of the coat" if of_coat else "Of the base", FRAME_HINT, of_coat):
        actions.append(SetFrame(key, "base" if of_coat else "coat"))
    return actions + _coat_bumps(context, state, width) if of_coat else actions


def _coat_bumps(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    name = state.bumps.coat_normal_map
    widgets.label(context, "Coat's", width)
    if not name:
        room = imgui.get_content_region_avail().x
        return _bump_button(context, state.name, "coat_normal_map", "Normal map…", "", room)
    room = imgui.get_content_region_avail().x - imgui.get_frame_height() - context.px(GAP)
    actions = _image_with_clear(context, state.name, "coat_normal_map", name, "clear_coat_bumps", room)
    actions += _flip_green(context, state, "coat_flip_green", width)
    return actions + _bump_rows(context, state, (COAT_STRENGTH, COAT_REPEATS), width)


def _image_with_clear(context: PanelContext, name: str, kind: str, file: str, clear: str, room: float) -> list[Action]:
    """The button of an image, and the one that removes it."""
    actions = _bump_button(context, name, kind, image_label(file), file, room)
    imgui.same_line(0.0, context.px(GAP))
    if widgets.icon_button(context, clear, Icon.CLOSE, f"Remove the image; {keys_of('undo')} brings it back."):
        actions.append(SetBumps(name, kind, ""))
    return actions


def _bump_rows(
    context: PanelContext, state: ObjectState, parameters: tuple[Parameter, ...], width: float
) -> list[Action]:
    actions: list[Action] = []
    for parameter in parameters:
        value, make = getattr(state.bumps, parameter.name), partial(SetBumps, state.name, parameter.name)
        row = rows.Row(parameter, value, make, f"material.{parameter.name}", parameter.default)
        actions += rows.draw(context, row, width)
    return actions


def _base_bumps(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    bumps, gap = state.bumps, context.px(GAP)
    if not bumps.file:
        widest = imgui.calc_text_size("Normal map…").x + 2.0 * imgui.get_style().frame_padding.x
        widgets.label(context, "Bumps", width, (2.0 * widest + gap) / context.theme.scale)
        room = 0.5 * (imgui.get_content_region_avail().x - gap)
        actions = _bump_button(context, state.name, "normal_map", "Normal map…", "", room)
        imgui.same_line(0.0, gap)
        return actions + _bump_button(context, state.name, "bump_map", "Heights…", "", room)
    widgets.label(context, "Bumps", width)
    room = imgui.get_content_region_avail().x - imgui.get_frame_height() - gap
    actions = _image_with_clear(context, state.name, bumps.kind, bumps.file, "clear_bumps", room)
    if bumps.normal_map:
        actions += _flip_green(context, state, "flip_green", width)
    heights = (BUMP_HEIGHT,) if bumps.bump_map else ()
    return actions + _bump_rows(context, state, (BUMP_STRENGTH, *heights, BUMP_REPEATS), width)


def _flip_green(context: PanelContext, state: ObjectState, name: str, width: float) -> list[Action]:
    """The switch of the direction that green means."""
    widgets.label(context, "Green", width)
    is_flipped = getattr(state.bumps, name)
    words = "Down (DirectX)" if is_flipped else "Up (OpenGL)"
    if widgets.switch(context, f"material.{name}", words, FLIP_GREEN_HINT, is_flipped):
        return [SetBumps(state.name, name, not is_flipped)]
    return []


def draw_opacity(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    """The rows of an object's opacity: its mode, and where it is not all there cutoff, factor and image."""
    opacity, gap = state.opacity, context.px(GAP)
    mode, name = opacity.opacity_mode, opacity.opacity_map
    shown = {"opaque": (), "mask": (OPACITY_CUTOFF, OPACITY_FACTOR), "blend": (OPACITY_FACTOR,)}[mode]
    actions: list[Action] = []
    for parameter in (OPACITY_MODE, *shown):
        value, make = getattr(opacity, parameter.name), partial(SetOpacity, state.name, parameter.name)
        own = getattr(state.own_opacity, parameter.name)
        actions += rows.draw(context, rows.Row(parameter, value, make, f"material.{parameter.name}", own), width)
    if mode == "opaque":
        return actions
    widgets.label(context, "Image", width)
    room = imgui.get_content_region_avail().x - (imgui.get_frame_height() + gap if name else 0.0)
    words, ask = image_label(name) or "Opacity map…", AskFile("open_opacity_map", state.name)
    actions += file_button(context, "material.opacity_map", words, name, HINTS["opacity_map"], room, ask)
    if name:
        imgui.same_line(0.0, gap)
        hint = f"Remove the image; {keys_of('undo')} brings it back."
        if widgets.icon_button(context, "clear_opacity", Icon.CLOSE, hint):
            actions.append(SetOpacity(state.name, "opacity_map", ""))
    return actions


def draw_tangent(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    """The rows of the rotation of an object's tangents: the angle, its map, and what white of the map means."""
    bumps, gap = state.bumps, context.px(GAP)
    actions = _tangent_row(context, state, TANGENT_ANGLE, width)
    widgets.label(context, "Streaks", width)
    words = "Along u" if bumps.tangent_along_u else "Around the axis"
    if widgets.switch(context, "material.tangent_along_u", words, ALONG_U_HINT, bumps.tangent_along_u):
        actions.append(SetBumps(state.name, "tangent_along_u", not bumps.tangent_along_u))
    widgets.label(context, "Map", width)
    room = imgui.get_content_region_avail().x - (imgui.get_frame_height() + gap if bumps.tangent_map else 0.0)
    words = image_label(bumps.tangent_map) or "Rotation map…"
    actions += _bump_button(context, state.name, "tangent_map", words, bumps.tangent_map, room)
    if bumps.tangent_map:
        imgui.same_line(0.0, gap)
        hint = f"Remove the image; {keys_of('undo')} brings it back."
        if widgets.icon_button(context, "clear_tangent", Icon.CLOSE, hint):
            actions.append(SetBumps(state.name, "tangent_map", ""))
        words = "Vectors" if bumps.tangent_vectors else "Angles"
        widgets.label(context, "Colours", width)
        if widgets.switch(context, "material.tangent_vectors", words, VECTORS_HINT, bumps.tangent_vectors):
            actions.append(SetBumps(state.name, "tangent_vectors", not bumps.tangent_vectors))
        if not bumps.tangent_vectors:
            actions += _tangent_row(context, state, TANGENT_RANGE, width)
    return actions


def _tangent_row(context: PanelContext, state: ObjectState, parameter: Parameter, width: float) -> list[Action]:
    value, make = getattr(state.bumps, parameter.name), partial(SetBumps, state.name, parameter.name)
    row = rows.Row(parameter, value, make, f"material.{parameter.name}", parameter.default, origin=0.0)
    return rows.draw(context, row, width)


def _bump_button(context: PanelContext, name: str, kind: str, words: str, file: str, room: float) -> list[Action]:
    return file_button(context, f"material.{kind}", words, file, HINTS[kind], room, AskFile(f"open_{kind}", name))


def image_label(name: str) -> str:
    """A file's name as it is shown; of a picture inside a GLB file with its number."""
    return Path(name).name


def short_label(label: str) -> str:
    """A label where there is little room: without the suffix; the number of a picture in a GLB file stays."""
    return label if "#" in label else Path(label).stem


def image_at(handles: Handles, theme: Theme, x: float, y: float) -> str | None:
    """The image of the selected layer, "texture" or "weight", whose row is at a framebuffer pixel."""
    for name in LABELS:
        if f"material.{name}" in handles.names():
            across, down = handles.position(f"material.{name}")
            if abs(x - across) < theme.px(ROW_REACH) and abs(y - down) < theme.px(ROW_HALF):
                return name
    return None


def _image(context: PanelContext, key: str, what: str, maps: LayerMaps, width: float) -> list[Action]:
    """The picture and its file's name, which opens the file dialog; a weight map's inversion; a button to remove it."""
    widgets.label(context, LABELS[what], width)
    name = maps.texture if what == "texture" else maps.weight
    side, gap = imgui.get_frame_height(), context.px(GAP)
    there = bool(name) if what == "texture" else maps.has_weight
    right = side + gap if there else 0.0
    if there and what == "weight":
        right += _segment_width(context, "Invert") + gap
    actions: list[Action] = []
    if there and (thumbnail := context.map_thumbnails.get(what)) is not None:
        if _thumbnail(context, what, thumbnail, side, bool(name)) and name:
            actions.append(ReloadImages(key))
        imgui.same_line(0.0, gap)
    without = "Painted" if maps.strokes else "Even"
    words = image_label(name) if name else without if there else "Load an image…"
    room = imgui.get_content_region_avail().x - right
    actions += file_button(context, f"material.{what}", words, name, HINTS[what], room, AskFile(f"open_{what}", key))
    if not there:
        return actions
    imgui.same_line(0.0, gap)
    if what == "weight":
        hint = "Invert the map: the layer is where the map is black."
        if widgets.switch(context, "material.weight_invert", "Invert", hint, maps.weight_invert):
            actions.append(SetMap(key, "weight_invert", not maps.weight_invert))
        imgui.same_line(0.0, gap)
    what_goes = "the map, image and strokes" if what == "weight" else "the image"
    if widgets.icon_button(
        context, f"clear_{what}", Icon.CLOSE, f"Removes {what_goes}; {keys_of('undo')} brings it back."
    ):
        actions.append(ClearMap(key) if what == "weight" else SetMap(key, what, ""))
    return actions


def _thumbnail(context: PanelContext, what: str, picture: Picture, side: float, of_file: bool) -> bool:
    """The image within a square, with its aspect ratio; returns whether it was pressed."""
    corner, shrink = imgui.get_cursor_screen_pos(), side / max(picture.width, picture.height)
    size = ImVec2(picture.width * shrink, picture.height * shrink)
    low = ImVec2(corner.x + 0.5 * (side - size.x), corner.y + 0.5 * (side - size.y))
    draw_list = imgui.get_window_draw_list()
    draw_list.add_rect_filled(corner, ImVec2(corner.x + side, corner.y + side), look.pack(look.FRAME))
    draw_list.add_image(picture.reference, low, ImVec2(low.x + size.x, low.y + size.y), *picture.corners())
    pressed = imgui.invisible_button(f"{what}.thumbnail", ImVec2(side, side))
    context.handles.note_item(f"material.{what}.thumbnail")
    hint = "Click to reload the file."
    widgets.tooltip(hint if of_file else "The painted map, as the picture shows it on the object.")
    return pressed


def file_button(
    context: PanelContext, handle: str, words: str, file: str, hint: str, room: float, action: Action
) -> list[Action]:
    """A button `room` pixels wide with the name of an image, "" for none; pressed, it gives the action."""
    inside = room - 2.0 * imgui.get_style().frame_padding.x
    fits = imgui.calc_text_size(words).x <= inside
    text = words if fits else widgets.fitting(short_label(words), inside)
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT if file else look.TEXT_SOFT))
    imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0.0, 0.5))
    pressed = imgui.button(f"{text}##{handle}", ImVec2(max(room, 1.0), 0.0))
    imgui.pop_style_var()
    imgui.pop_style_color()
    context.handles.note_item(handle)
    widgets.tooltip(f"{file}\n\n{hint}" if file else hint)
    return [action] if pressed else []


def _repeats(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The repeats of the texture across and upwards, and one button that steps through the colour spaces."""
    make = partial(SetMap, key, TEXTURE_SCALE.name)
    row = rows.Row(TEXTURE_SCALE, maps.texture_scale, make, "material.texture_scale", TEXTURE_SCALE.default)
    widgets.label(context, TEXTURE_SCALE.label, width)
    gap, least = context.px(GAP), _segment_width(context, "Linear")
    actions = rows.pair(context, row, imgui.get_content_region_avail().x - least - gap)
    imgui.same_line(0.0, gap)
    title, hint = TEXTURE_SPACE.title_of(maps.texture_space), f"{TEXTURE_SPACE.tooltip} Click to change it."
    if widgets.switch(context, "material.texture_space", title, hint, False, least / context.theme.scale):
        following = SPACES[(SPACES.index(maps.texture_space) + 1) % len(SPACES)]
        actions.append(SetMap(key, TEXTURE_SPACE.name, following))
    return actions


def _segment_width(context: PanelContext, text: str) -> float:
    """The width of a button of `widgets.segments` with such a text."""
    return widgets.rich_width(text) + context.px(16)
