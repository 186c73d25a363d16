"""The images of the selected layer, its texture and its weight map: a part of the material panel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.commands.maps import SetMap
from app.document.commands.paint import ClearMap
from engine.material.layer_maps import MAX_REPEATS, SPACES, LayerMaps
from ui import theme as look
from ui.panels import number_fields, paint, widgets
from ui.panels.actions import Action, AskFile, BeginDrag, EndDrag, ReloadImages
from ui.panels.context import Handles, PanelContext
from ui.panels.picture import Picture
from ui.theme import Icon, Theme

# How far an image's row reaches from the middle of its button, to the sides and up and down, pixels at scale 1.
ROW_REACH, ROW_HALF = 150.0, 14.0
LABELS = {"texture": "Texture", "weight": "Weight map"}
HINTS = {
    "texture": "An image whose colours multiply the layer: PNG, JPEG or OpenEXR, laid out by the mesh's texture "
    "coordinates. Files may be dropped on this row, a PNG or JPEG anywhere.",
    "weight": "A grey image with the weight of the layer: white is all of it, black none. Two layers with one "
    "map, in one of them inverted, are blended by it. Files may be dropped on this row.",
}
SPACE_CHOICES = (
    ("Auto", "Auto: as files of this kind usually are, sRGB with 8 bits per channel, else linear."),
    ("sRGB", "sRGB: meant for a screen."),
    ("Linear", "Linear: proportional to reflectance."),
)


def draw(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The rows of both images."""
    actions = _image(context, key, "texture", maps, width)
    if maps.texture:
        actions += _strength(context, key, maps, width) + _repeats(context, key, maps, width)
    actions += _image(context, key, "weight", maps, width) + paint.draw(context, key, maps, width)
    if context.map_refusal:
        widgets.caption(context.map_refusal)
    return actions


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
    side, gap = imgui.get_frame_height(), context.px(4)
    there = bool(name) if what == "texture" else maps.has_weight
    right = side + gap if there else 0.0
    if there and what == "weight":
        right += _segment_width(context, "Invert") + gap
    actions: list[Action] = []
    if there and (thumbnail := context.map_thumbnails.get(what)) is not None:
        if _thumbnail(context, what, thumbnail, side, bool(name)) and name:
            actions.append(ReloadImages(key))
        imgui.same_line(0.0, gap)
    words = image_label(name) if name else _without_file(maps) if there else "Load an image…"
    actions += _file_button(context, key, what, name, words, imgui.get_content_region_avail().x - right)
    if not there:
        return actions
    imgui.same_line(0.0, gap)
    if what == "weight":
        actions += _invert(context, key, maps)
        imgui.same_line(0.0, gap)
    what_goes = "the map, image and strokes" if what == "weight" else "the image"
    if widgets.icon_button(context, f"clear_{what}", Icon.CLOSE, f"Removes {what_goes}; Ctrl+Z brings it back."):
        actions.append(ClearMap(key) if what == "weight" else SetMap(key, what, ""))
    return actions


def _without_file(maps: LayerMaps) -> str:
    """The label of a weight map without an image."""
    return "Painted" if maps.strokes else "Even"


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


def _file_button(context: PanelContext, key: str, what: str, name: str, words: str, room: float) -> list[Action]:
    inside = room - 2.0 * imgui.get_style().frame_padding.x
    fits = imgui.calc_text_size(words).x <= inside
    text = words if fits else widgets.fitting(short_label(words), inside)
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT if name else look.TEXT_SOFT))
    imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0.0, 0.5))
    pressed = imgui.button(f"{text}##{what}", ImVec2(max(room, 1.0), 0.0))
    imgui.pop_style_var()
    imgui.pop_style_color()
    context.handles.note_item(f"material.{what}")
    widgets.tooltip(f"{name}\n\n{HINTS[what]}" if name else HINTS[what])
    return [AskFile(f"open_{what}", key)] if pressed else []


def _strength(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    widgets.label(context, "Strength", width)
    touch, moved = number_fields.slider(
        context, "texture_strength", maps.texture_strength, 0.0, 1.0, handle="material.texture_strength"
    )
    widgets.tooltip("Strength of the texture: 1 is all of it, 0 the plain layer.")
    return _edits(touch, key, "texture_strength", moved)


def _repeats(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The repeats of the texture across and upwards, and how its numbers are meant."""
    widgets.label(context, "Repeats", width)
    gap = context.px(4)
    room = imgui.get_content_region_avail().x - _segment_width(context, "Linear") - 2.0 * gap
    actions: list[Action] = []
    for index, (axis, across) in enumerate((("u", "across"), ("v", "upwards"))):
        imgui.set_next_item_width(0.5 * room)
        value = maps.texture_scale[index]
        touch, moved = number_fields.number(
            context, f"repeats {axis}", value, f"{axis} × %.3g", f"material.texture_scale.{axis}",
            -MAX_REPEATS, MAX_REPEATS,
        )  # fmt: skip
        hint = f"How often the texture repeats {across}; below 0 it is mirrored."
        widgets.tooltip(f"{hint} Drag sideways, or double-click to type.")
        pair = (moved, maps.texture_scale[1]) if index == 0 else (maps.texture_scale[0], moved)
        actions += _edits(replace(touch, changed=touch.changed and abs(moved) >= 1e-3), key, "texture_scale", pair)
        imgui.same_line(0.0, gap)
    return actions + _space(context, key, maps)


def _space(context: PanelContext, key: str, maps: LayerMaps) -> list[Action]:
    """One button that steps through the three colour spaces."""
    chosen = SPACES.index(maps.texture_space)
    text, meaning = SPACE_CHOICES[chosen]
    hint = f"Colour space of the file. {meaning} Click to change it."
    least = _segment_width(context, "Linear") / context.theme.scale
    pressed = widgets.segments(context, "material.texture_space", [(text, hint)], -1, least=least)
    return [] if pressed is None else [SetMap(key, "texture_space", SPACES[(chosen + 1) % len(SPACES)])]


def _invert(context: PanelContext, key: str, maps: LayerMaps) -> list[Action]:
    hint = "Invert the map: the layer is where the map is black."
    pressed = widgets.segments(context, "material.weight_invert", [("Invert", hint)], 0 if maps.weight_invert else -1)
    return [] if pressed is None else [SetMap(key, "weight_invert", not maps.weight_invert)]


def _segment_width(context: PanelContext, text: str) -> float:
    """The width of a button of `widgets.segments` with such a text."""
    return widgets.rich_width(text) + context.px(16)


def _edits(touch: number_fields.Touch, key: str, name: str, value: object) -> list[Action]:
    """One drag of a control as one step of the history."""
    actions: list[Action] = []
    if touch.began:
        actions.append(BeginDrag(f"{key} {name.replace('_', ' ')}"))
    if touch.changed:
        actions.append(SetMap(key, name, value))
    if touch.ended:
        actions.append(EndDrag())
    return actions
