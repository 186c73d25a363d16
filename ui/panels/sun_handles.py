"""Suns over the picture: a mark where one stands in the sky that is seen, and handles that aim the selected one.

The handles stand about the point that the camera looks at: a ring for the azimuth, an arc for the elevation, and an
arrow towards the sun, whose end goes anywhere. They are handles like those of the gizmo, which has the same keys.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands.suns import SetSun, angles_of, direction_of, in_environment, in_world
from app.document.light_state import sun_key
from app.document.selection import selected_sun
from engine.core.camera import camera_frame, pixel_directions
from engine.light.suns import Sun
from engine.scene.camera_moves import distance
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.arranging import SNAP_DEGREES, snaps_to_steps
from ui.panels.context import PanelContext
from ui.panels.picture_handles import PictureHandle, Place, on_screen, value_at
from ui.panels.viewport_layout import PictureRect

Float64Array = NDArray[np.float64]

ARM = 0.17  # of the picture's height: the length of the arrow, and the radius of the ring
_ARC, _HALF_ARC = 1.25, 30.0  # of the arm: the radius of the arc, which goes so many degrees to both sides
_N_RING = 48
_FAR = 1e3  # distances to the target: of a point that stands for the sky
_INK = (1.0, 0.85, 0.35, 1.0)
_RAYS, _INNER, _OUTER = 8, 9.0, 13.0


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The marks of all suns that the sky of the picture shows, while the mouse is over it, and of the selected one; and
    with the gizmo its handles."""
    chosen, shows_all = selected_sun(context.document, context.view), imgui.is_item_hovered()
    found = list[PictureHandle]()
    for sun in context.document.light.suns:
        if (sun is chosen or shows_all) and (mark := _mark(context, placed, sun, sun is chosen)) is not None:
            found.append(mark)
    if chosen is not None and context.state.gizmo:
        found += _aiming(_Aim(context, placed, chosen))
    return found


def _mark(context: PanelContext, placed: PictureRect, sun: Sun, is_chosen: bool) -> PictureHandle | None:
    """A sun's mark; None where it is not in the picture, or, of one that is not selected, an object hides it."""
    towards = np.array(in_world(sun.direction, context.document.light))
    seen = on_screen(context, placed, (context.camera.position + _FAR * distance(context.camera) * towards)[None])
    if seen is None:
        return None
    (x, y), picture = seen[0].tolist(), context.picture
    pixel = None if picture is None else placed.pixel(x, y, picture)
    if pixel is None or not is_chosen and context.object_at(*pixel) is not None:
        return None
    for k in range(_RAYS):
        across, down = math.cos(2.0 * math.pi * k / _RAYS), math.sin(2.0 * math.pi * k / _RAYS)
        start, end = (ImVec2(x + context.px(r) * across, y + context.px(r) * down) for r in (_INNER, _OUTER))
        for width, ink in ((4.0, look.grey(0, 0.45)), (2.0, _INK)):
            imgui.get_window_draw_list().add_line(start, end, look.pack(ink), context.px(width))
    hint = f"{sun.name}: click to select it, drag to place it."
    drag = partial(_place, context, placed, sun)
    return PictureHandle(
        f"sun.{sun.name}", (x, y), (), f"aim {sun.name}", hint, drag, ink=_INK, selects=sun_key(sun.name)
    )


def _place(context: PanelContext, placed: PictureRect, sun: Sun, to: Place) -> list[Action]:
    """Put a sun where the camera sees a place on screen."""
    size = max(round(placed.width), 1), max(round(placed.height), 1)
    towards = pixel_directions(context.camera, size, to[0] - placed.x, to[1] - placed.y)
    return _aimed(context, sun, towards.astype(np.float64))


def _aimed(context: PanelContext, sun: Sun, towards: Float64Array) -> list[Action]:
    """Aim a sun at a direction (3,) of the world."""
    x, y, z = (towards / np.linalg.norm(towards)).tolist()
    direction = in_environment((x, y, z), context.document.light)
    return [] if direction == sun.direction else [SetSun(sun.name, "direction", direction)]


# --------------------------------------------------------------------------------------------------------------- aiming


@dataclass(frozen=True)
class _Aim:
    """The selected sun, and what its handles stand on."""

    context: PanelContext
    placed: PictureRect
    sun: Sun

    @property
    def towards(self) -> Float64Array:
        """The direction (3,) to it in the world."""
        return np.array(in_world(self.sun.direction, self.context.document.light))

    @property
    def angles(self) -> tuple[float, float]:
        """Its azimuth and elevation in the world, degrees."""
        x, y, z = self.towards.tolist()
        return angles_of((x, y, z))

    @property
    def pivot(self) -> Float64Array:
        """The point (3,) that the camera looks at."""
        return np.array(self.context.camera.target, np.float64)

    @property
    def arm(self) -> float:
        """The arrow's length, metres."""
        camera = self.context.camera
        depth = float((self.pivot - np.array(camera.position)) @ camera_frame(camera)[2])
        return ARM * 2.0 * math.tan(math.radians(camera.fov_y) / 2.0) * depth

    def on_screen(self, *ways: Float64Array) -> list[Place] | None:
        """Places on screen so far (3,) from the pivot, in arms; None where one is not in front of the camera."""
        found = on_screen(self.context, self.placed, self.pivot + self.arm * np.array(ways))
        return None if found is None else [(float(x), float(y)) for x, y in found]

    def turned_to(self, azimuth: float, elevation: float) -> list[Action]:
        """Aim the sun at these angles of the world."""
        return _aimed(self.context, self.sun, np.array(direction_of(azimuth, elevation)))


def _aiming(aim: _Aim) -> Iterator[PictureHandle]:
    azimuth, elevation = aim.angles
    label = f"aim {aim.sun.name}"
    ring = [np.array(direction_of(azimuth + degrees, 0.0)) for degrees in np.linspace(0.0, 360.0, _N_RING + 1)]
    if (line := aim.on_screen(*ring)) is not None:
        hint = f"Azimuth {azimuth:.1f}°: drag it; Ctrl snaps."
        yield PictureHandle("gizmo.azimuth", line[0], line, label, hint, partial(_turn, aim), ink=look.CHANNELS[1])
    steps = np.linspace(max(elevation - _HALF_ARC, -90.0), min(elevation + _HALF_ARC, 90.0), _N_RING // 2)
    arc = [_ARC * np.array(direction_of(azimuth, degrees)) for degrees in (elevation, *steps)]
    if (line := aim.on_screen(*arc)) is not None:
        hint = f"Elevation {elevation:.1f}°: drag it; Ctrl snaps."
        rise = partial(_rise, aim)
        yield PictureHandle("gizmo.elevation", line[0], line[1:], label, hint, rise, ink=look.CHANNELS[0])
    if (line := aim.on_screen(np.zeros(3), aim.towards)) is not None:
        hint = "Towards the sun: drag it anywhere."
        yield PictureHandle("gizmo.aim", line[1], line, label, hint, partial(_point, aim), ink=_INK)


def _turn(aim: _Aim, to: Place) -> list[Action]:
    """Turn the azimuth so that the ring's knob is nearest to a place on screen."""
    azimuth, elevation = aim.angles

    def seen(degrees: float) -> Float64Array | None:
        return _first(aim.on_screen(np.array(direction_of(degrees, 0.0))))

    return aim.turned_to(
        _snapped(aim, value_at(seen, azimuth, to, 0.5, 30.0, (azimuth - 180.0, azimuth + 180.0))), elevation
    )


def _rise(aim: _Aim, to: Place) -> list[Action]:
    """Raise or lower the sun so that the arc's knob is nearest to a place on screen."""
    azimuth, elevation = aim.angles

    def seen(degrees: float) -> Float64Array | None:
        return _first(aim.on_screen(_ARC * np.array(direction_of(azimuth, degrees))))

    # A degree short of straight up the azimuth is still known.
    return aim.turned_to(azimuth, _snapped(aim, value_at(seen, elevation, to, 0.5, 20.0, (-89.9, 89.9))))


def _point(aim: _Aim, to: Place) -> list[Action]:
    """Point the arrow so that its end is under a place on screen: where a ray from there meets the sphere about the
    pivot, on the side of the camera where it was on that; beside the sphere at its rim."""
    camera, placed = aim.context.camera, aim.placed
    size = max(round(placed.width), 1), max(round(placed.height), 1)
    ray = pixel_directions(camera, size, to[0] - placed.x, to[1] - placed.y).astype(np.float64)
    from_pivot = np.array(camera.position) - aim.pivot
    # |o + t d| = r:  t = -o·d ∓ sqrt((o·d)² - |o|² + r²)
    along = float(from_pivot @ ray)
    square = along**2 - float(from_pivot @ from_pivot) + aim.arm**2
    is_near = aim.towards @ from_pivot > 0.0
    way = -along + (-1.0 if is_near else 1.0) * math.sqrt(max(square, 0.0))
    return _aimed(aim.context, aim.sun, from_pivot + way * ray)


def _snapped(aim: _Aim, degrees: float) -> float:
    return round(degrees / SNAP_DEGREES) * SNAP_DEGREES if snaps_to_steps(aim.context) else degrees


def _first(places: list[Place] | None) -> Float64Array | None:
    return None if places is None else np.array(places[0])
