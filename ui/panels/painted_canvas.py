"""The environment's picture with its painted lights, on which they are selected, moved and sized.

It is drawn in the world's frame, as the small picture above it: -Z in the middle, turned and tilted with the light.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands.painted import SetPainted, painted_towards
from app.document.light_state import LightState
from engine.light.painted_lights import PaintedLight, angles_in_environment, world_directions
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.window_state import PaintedGrip, PaintedSelection, Place, Travel

HINT = (
    "The environment with its painted lights, -Z in the middle. Click one to select it, drag it, or its corner to size "
    "it; with Shift finely."
)
NAME = "painted.picture"
REACH = 9.0
_STEPS = np.linspace(-1.0, 1.0, 13)

Float64Array = NDArray[np.float64]


def draw(context: PanelContext) -> list[Action]:
    """The picture, as wide as the panel."""
    width = imgui.get_content_region_avail().x
    corner, size = imgui.get_cursor_screen_pos(), ImVec2(width, 0.5 * width)
    imgui.invisible_button(NAME, size)
    context.handles.note_item(NAME)
    widgets.tooltip(HINT)
    canvas = _Canvas(context.document.light, corner.x, corner.y, width)
    actions = _input(context, canvas)
    draw_list, end = imgui.get_window_draw_list(), ImVec2(corner.x + size.x, corner.y + size.y)
    draw_list.add_rect_filled(corner, end, look.pack(look.WELL), context.px(3))
    if context.environment is not None:
        scrolled(draw_list, context.environment, corner, end, context.document.light.rotation / 360.0)
    draw_list.push_clip_rect(corner, end, True)
    for light in context.document.light.painted:
        _draw_light(context, draw_list, canvas, light)
    draw_list.pop_clip_rect()
    return actions


def scrolled(draw_list: imgui.ImDrawList, picture: Picture, corner: ImVec2, end: ImVec2, shift: float) -> None:
    """The environment with column `shift` of its width at the left edge, in the two parts at the seam."""
    upper, lower = picture.corners()
    shift = shift % 1.0
    seam = corner.x + (1.0 - shift) * (end.x - corner.x)
    draw_list.add_image(picture.reference, corner, ImVec2(seam, end.y), ImVec2(shift, upper.y), ImVec2(1.0, lower.y))
    if shift > 0.0:
        draw_list.add_image(
            picture.reference, ImVec2(seam, corner.y), end, ImVec2(0.0, upper.y), ImVec2(shift, lower.y)
        )


class _Canvas:
    """The picture's place on screen: pixels of directions, and back."""

    def __init__(self, light: LightState, x: float, y: float, width: float) -> None:
        self._light, self._x, self._y, self._width = light, x, y, width

    def places(self, directions: Float64Array) -> Float64Array:
        """Pixels (N, 2) of directions (N, 3) in the environment's frame."""
        x, y, z = world_directions(directions, self._light.rotation, self._light.tilt).T
        across = np.arctan2(x, -z) / (2.0 * math.pi) + 0.5
        down = np.arctan2(np.hypot(x, z), y) / math.pi
        return np.stack([self._x + across * self._width, self._y + 0.5 * down * self._width], axis=1)

    def place(self, direction: Float64Array) -> Place:
        """The pixel of one direction."""
        x, y = self.places(direction[None])[0].tolist()
        return x, y

    def direction(self, place: Place) -> Float64Array:
        """The direction in the world at a pixel, around the seam and not beyond the poles."""
        across = 2.0 * math.pi * ((place[0] - self._x) / self._width - 0.5)
        down = min(max(2.0 * (place[1] - self._y) / self._width, 0.0), 1.0) * math.pi
        return np.array([math.sin(down) * math.sin(across), math.cos(down), -math.sin(down) * math.cos(across)])

    def inside(self, light: PaintedLight, place: Place) -> bool:
        """Whether a pixel shows a light that is smaller than the whole environment."""
        if light.surrounds:
            return False
        x, y, z = light.frame @ self._in_environment(place)
        if light.kind == "disc":
            return bool(math.acos(min(max(z, -1.0), 1.0)) <= math.radians(light.width / 2.0))
        half = [math.tan(math.radians(each / 2.0)) for each in (light.width, light.height)]
        return bool(z > 0.0 and abs(x) <= half[0] * z and abs(y) <= half[1] * z)

    def sized(self, light: PaintedLight, place: Place) -> SetPainted:
        """The command that puts a light's corner, or its rim, at a pixel."""
        x, y, z = light.frame @ self._in_environment(place)
        if light.kind in ("disc", "gradient"):
            angle = math.degrees(math.acos(min(max(z, -1.0), 1.0)))
            least, most = (0.5, 360.0) if light.kind == "disc" else (1.0, 180.0)
            return SetPainted.of(
                light.name, "width", min(max(2.0 * angle if light.kind == "disc" else angle, least), most)
            )
        width, height = (
            min(max(2.0 * math.degrees(math.atan2(abs(each), max(z, 1e-9))), 0.5), 170.0) for each in (x, y)
        )
        return SetPainted(light.name, (("width", width), ("height", height)))

    def _in_environment(self, place: Place) -> Float64Array:
        azimuth, elevation = angles_in_environment(self.direction(place), self._light.rotation, self._light.tilt)
        return PaintedLight("", azimuth=azimuth, elevation=elevation).frame[2]


def outline(light: PaintedLight) -> Float64Array:
    """Directions (N, 3) in the environment's frame along a light's rim; none where it is all around."""
    if light.surrounds:
        return np.empty((0, 3))
    if light.kind == "disc":
        around = np.linspace(0.0, 2.0 * math.pi, 49)
        sine, cosine = math.sin(math.radians(light.width / 2.0)), math.cos(math.radians(light.width / 2.0))
        local = np.stack([sine * np.cos(around), sine * np.sin(around), np.full(49, cosine)], axis=1)
        return np.asarray(local @ light.frame)
    right, top = (math.tan(math.radians(each / 2.0)) for each in (light.width, light.height))
    ones = np.ones_like(_STEPS)
    u = np.concatenate([_STEPS, ones, -_STEPS, -ones])
    v = np.concatenate([-ones, _STEPS, ones, -_STEPS])
    local = np.stack([right * u, top * v, np.ones(len(u))], axis=1)
    return np.asarray(local @ light.frame / np.linalg.norm(local, axis=1, keepdims=True))


def size_handle(light: PaintedLight) -> Float64Array | None:
    """The direction of what a drag sizes it by: a card's upper right corner, a disc's right, a gradient's far end."""
    half = math.radians(light.width / 2.0)
    if light.kind in ("sky", "image") and light.surrounds:
        return None
    if light.kind == "disc":
        local = np.array([math.sin(half), 0.0, math.cos(half)])
    elif light.kind == "gradient":
        local = np.array([0.0, -math.sin(2.0 * half), math.cos(2.0 * half)])
    else:
        local = np.array([math.tan(half), math.tan(math.radians(light.height / 2.0)), 1.0])
    return np.asarray(local @ light.frame / np.linalg.norm(local))


# -------------------------------------------------------------------------------------------------------------- input


def _input(context: PanelContext, canvas: _Canvas) -> list[Action]:
    mouse, grip = imgui.get_mouse_pos(), context.state.grip
    place, fine = (mouse.x, mouse.y), imgui.get_io().key_shift
    if imgui.is_item_activated():
        return _begin(context, canvas, place, fine)
    if not isinstance(grip, PaintedGrip) or grip.handle not in ("move", "size"):
        return []
    if imgui.is_item_deactivated():
        return [EndDrag(), HoldGrip(None)]
    light = next((each for each in context.document.light.painted if each.name == grip.light), None)
    if not imgui.is_item_active() or light is None:
        return []
    travel = grip.travel.with_fine(place, fine)
    across, down = travel.distance_to(place)
    to = grip.offset[0] + across, grip.offset[1] + down
    held = HoldGrip(replace(grip, travel=travel))
    if (across, down) == (0.0, 0.0):
        return [held]
    if grip.handle == "size":
        return [held, canvas.sized(light, to)]
    return [held, painted_towards(context.document.light, light.name, canvas.direction(to))]


def _begin(context: PanelContext, canvas: _Canvas, place: Place, fine: bool) -> list[Action]:
    """The mouse was pressed: at the selected light's size handle, or on a light, the upper one first."""
    selected, reach = context.painted, context.px(REACH)
    if selected is not None and (handle := size_handle(selected)) is not None:
        corner = canvas.place(handle)
        if math.dist(corner, place) <= reach:
            grip = PaintedGrip("size", corner, selected.name, Travel(place, fine=fine))
            return [BeginDrag(f"size {selected.name}"), HoldGrip(grip)]
    lights = [*context.document.light.painted[::-1]]
    if selected is not None:
        lights.insert(0, selected)
    middles = {each.name: canvas.place(each.frame[2]) for each in lights}
    near = [each for each in lights if math.dist(middles[each.name], place) <= reach]
    hit = next(iter([*near, *(each for each in lights if canvas.inside(each, place))]), None)
    if hit is None:
        return []
    grip = PaintedGrip("move", middles[hit.name], hit.name, Travel(place, fine=fine))
    chosen = SetPanel({"painted": PaintedSelection(hit.name, (context.view.selected, context.view.sun))})
    return [chosen, BeginDrag(f"move {hit.name}"), HoldGrip(grip)]


# ------------------------------------------------------------------------------------------------------------- drawing


def _draw_light(context: PanelContext, draw_list: imgui.ImDrawList, canvas: _Canvas, light: PaintedLight) -> None:
    is_selected = context.painted == light
    ink = look.ACCENT if is_selected else look.grey(235, 0.8)
    places = canvas.places(outline(light)).tolist()
    jump = 0.25 * imgui.get_item_rect_size().x
    for thickness, colour in ((3.0, look.grey(0, 0.45)), (1.5 if is_selected else 1.0, ink)):
        for start, end in zip(places, places[1:], strict=False):
            if abs(start[0] - end[0]) < jump:  # else it goes around the seam
                draw_list.add_line(ImVec2(*start), ImVec2(*end), look.pack(colour), context.px(thickness))
    x, y = canvas.place(light.frame[2])
    context.handles.note(f"painted.{light.name}", x, y)
    arm = context.px(4)
    for thickness, colour in ((3.0, look.grey(0, 0.45)), (1.5, ink)):
        draw_list.add_line(ImVec2(x - arm, y), ImVec2(x + arm, y), look.pack(colour), context.px(thickness))
        draw_list.add_line(ImVec2(x, y - arm), ImVec2(x, y + arm), look.pack(colour), context.px(thickness))
    if is_selected and (handle := size_handle(light)) is not None:
        x, y = canvas.place(handle)
        context.handles.note(f"painted.{light.name}.size", x, y)
        side = context.px(4)
        draw_list.add_rect_filled(ImVec2(x - side, y - side), ImVec2(x + side, y + side), look.pack(ink))
        draw_list.add_rect(ImVec2(x - side, y - side), ImVec2(x + side, y + side), look.pack(look.grey(20)))
