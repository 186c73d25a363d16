"""Handles over the picture that size the selected lamp: the sides and a corner of a rectangle, the rim of a disc or a
ball, and the rims of a spot's cone.

They are there for one selected lamp, as long as no other handles but the one to aim are. The outline can be grabbed
anywhere: its grip is the point of it that is nearest to the mouse. A drag sets what the rows of the Light panel show.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands.lamps import INNER, OUTER, SetCone
from app.document.document import ObjectState
from engine.core.camera import camera_frame
from engine.light.cones import LEAST_OUTER, MOST_ANGLE, Cone
from engine.scene.arrangement import PlacedObject
from engine.scene.lamp_shape import HEIGHT, RADIUS, WIDTH, LampShape
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.arranging import SNAP_METRES, Arranged, arranged
from ui.panels.context import PanelContext
from ui.panels.picture_handles import REACH, PictureHandle, Place, nearest_on_line, value_at
from ui.panels.surface_snap import target_of
from ui.panels.viewport_layout import PictureRect

Float64Array = NDArray[np.float64]
INK = (1.0, 0.85, 0.35, 1.0)
SNAP_ANGLE = 5.0
HOW = "drag it; Ctrl snaps."
_N_RIM, _N_SPOKES = 64, 4
_SHORTEST, _LONGEST = 1.0, 3.0  # of an arm of the gizmo: how long a cone is drawn
_SAME = 1e-6  # of a size: the rounding of a pointer that has returned
_OPENS = 5.0  # degrees: an angle at which the rim has a direction for each of its points


@dataclass(frozen=True)
class _Lamp:
    """A lamp in the picture, as it stands and as it stood when the hand took it."""

    arranged: Arranged
    state: ObjectState
    shape: LampShape

    @property
    def now(self) -> PlacedObject:
        return self.arranged.active

    @property
    def centre(self) -> Float64Array:
        """Of its shape (3,)."""
        return self.shape.pivot + self.now.transform.translation

    @property
    def sides(self) -> Float64Array:
        """Half of each of its sides, the columns of (3, 3)."""
        return 0.5 * self.now.transform.linear @ self.shape.linear

    def resized(self, sizes: dict[str, float]) -> list[Action]:
        """Set sizes, in metres, as far as the range goes; those at the start give its transform, to the bit."""
        light = self.arranged.start[-1]
        transform = light.transform
        if all(abs(metres / self.shape.size(name, transform) - 1.0) < _SAME for name, metres in sizes.items()):
            return self.arranged.to(self.arranged.start, "size")
        for name, metres in sizes.items():
            low, high = self.shape.range_of(name, transform)
            transform = self.shape.resized(name, min(max(metres, low), high), transform)
        return self.arranged.to((*self.arranged.start[:-1], replace(light, transform=transform)), "size")


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The handles of the selected lamp; none where several objects are, or where it is not in front of the camera."""
    if context.state.gizmo not in ("", "aim") or len(context.view.selected_objects) != 1:
        return []
    state = context.document.object(context.view.selected_objects[0])
    if state.lamp is None or not state.visible or (found := arranged(context, placed)) is None:
        return []
    lamp = _Lamp(found, state, state.lamp)
    if found.arm_at(lamp.centre) == 0.0:
        return []
    of_size = _rectangle(lamp) if lamp.shape.primitive == "quad" else _round(lamp)
    return [*of_size, *(_cone(lamp) if state.cone is not None else ())]


def _handle(
    lamp: _Lamp, name: str, place: Place, line: Sequence[Place], hint: str, drag: Callable[[Place], list[Action]]
) -> PictureHandle:
    label = f"size {lamp.state.name}" if name not in (INNER, OUTER) else f"cone of {lamp.state.name}"
    return PictureHandle(
        f"light.{name}", place, line, label, f"{hint}: {HOW}", drag, ink=INK, start=lamp.arranged.objects
    )


def _grip(context: PanelContext, name: str, line: Sequence[Place], first: Place) -> Place:
    """Where an outline is grabbed: its point nearest to the mouse where that is upon it, else the first one."""
    mouse, grip = imgui.get_mouse_pos(), context.state.grip
    at = complex(mouse.x, mouse.y)
    if grip is not None and grip.handle != f"light.{name}":
        return first
    if grip is not None:
        at -= complex(*grip.offset)
    near = min((nearest_on_line(at, complex(*a), complex(*b)) for a, b in zip(line, line[1:], strict=False)),
               key=lambda spot: abs(spot - at), default=complex(*first))  # fmt: skip
    return (near.real, near.imag) if grip is not None or abs(near - at) <= context.px(0.5 * REACH) else first


def _is_under_mouse(context: PanelContext, place: Place) -> bool:
    """Whether a grip is within reach, which an outline through it then leaves alone."""
    mouse = imgui.get_mouse_pos()
    return context.state.grip is None and bool(np.hypot(place[0] - mouse.x, place[1] - mouse.y) <= context.px(REACH))


# ---------------------------------------------------------------------------------------------------------------- sizes


def _rectangle(lamp: _Lamp) -> Iterator[PictureHandle]:
    """Two sides and a corner; the middle stays."""
    found, shape, names = lamp.arranged, lamp.shape, lamp.shape.sizes
    if not names:
        return
    (u, v), centre = lamp.sides[:, :2].T, lamp.centre
    corners = found.on_screen(*(centre + a * u + b * v for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))))
    if corners is None:
        return
    outline: list[ImVec2 | tuple[float, float] | list[float]] = [ImVec2(*corner) for corner in corners]
    faint = look.pack(look.with_alpha(INK, 0.45))
    imgui.get_window_draw_list().add_polyline(outline, faint, found.context.px(1.2), imgui.ImDrawFlags_.closed)
    width, height = (shape.size(name, lamp.now.transform) for name in (WIDTH, HEIGHT))
    at_corner = _is_under_mouse(found.context, corners[1])
    for name, size, first, sides in (
        (WIDTH, width, 0, ((0, 1), (2, 3))), (HEIGHT, height, 1, ((1, 2), (3, 0)))
    ):  # fmt: skip
        middles = [_between(corners[a], corners[b]) for a, b in sides]
        nearer = min(sides, key=lambda side: _away(found.context, corners[side[0]], corners[side[1]]))
        line = [corners[i] for i in nearer]
        place = middles[0] if at_corner else _grip(found.context, name, line, middles[0])
        yield _handle(lamp, name, place, line, f"{name.capitalize()} {size:.4g} m", partial(_drag_side, lamp, first))
    corner = corners[1]
    hint = f"{width:.4g} × {height:.4g} m"
    yield _handle(lamp, "size", corner, (), hint, partial(_drag_corner, lamp))


def _between(a: Place, b: Place) -> Place:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])


def _away(context: PanelContext, a: Place, b: Place) -> float:
    """How far a side is from the mouse, or from the grip that the mouse has."""
    mouse = imgui.get_mouse_pos()
    at = complex(mouse.x, mouse.y)
    return abs(nearest_on_line(at, complex(*a), complex(*b)) - at)


def _in_plane(lamp: _Lamp, to: Place) -> Float64Array | None:
    """A place on screen in the lamp's plane, from its centre (3,); None where that is seen from its edge."""
    normal = np.cross(lamp.sides[:, 0], lamp.sides[:, 1])
    met = lamp.arranged.on_plane(to, lamp.centre, normal / np.linalg.norm(normal))
    return None if met is None else met - lamp.centre


def _drag_side(lamp: _Lamp, k: int, to: Place) -> list[Action]:
    met = _in_plane(lamp, to)
    if met is None:
        return []
    side = lamp.sides[:, k] / np.linalg.norm(lamp.sides[:, k])
    return lamp.resized({(WIDTH, HEIGHT)[k]: lamp.arranged.in_steps(2.0 * abs(float(met @ side)), SNAP_METRES)})


def _drag_corner(lamp: _Lamp, to: Place) -> list[Action]:
    """Both sides, in the proportion that they had at the start: the corner is as far from the middle as the pointer."""
    met = _in_plane(lamp, to)
    if met is None:
        return []
    diagonal = lamp.sides[:, 0] + lamp.sides[:, 1]
    grown = abs(float(met @ diagonal)) / float(diagonal @ diagonal)
    height = lamp.arranged.in_steps(grown * lamp.shape.size(HEIGHT, lamp.now.transform), SNAP_METRES)
    width, before = (lamp.shape.size(name, lamp.arranged.start[-1].transform) for name in (WIDTH, HEIGHT))
    return lamp.resized({WIDTH: height * width / max(before, 1e-30), HEIGHT: height})


def _round(lamp: _Lamp) -> Iterator[PictureHandle]:
    """The rim of a disc, or of a ball as the camera sees it."""
    found, radius = lamp.arranged, lamp.shape.size(RADIUS, lamp.now.transform)
    if lamp.shape.primitive == "disc":
        u, v = lamp.sides[:, :2].T
    else:
        right, up, _ = camera_frame(found.context.camera)
        u, v = radius * right, radius * up
    turn = np.linspace(0.0, 2.0 * np.pi, _N_RIM + 1)
    line = found.on_screen(*(lamp.centre + np.cos(t) * u + np.sin(t) * v for t in turn))
    if line is not None:
        place = _grip(found.context, RADIUS, line, line[0])
        yield _handle(lamp, RADIUS, place, line, f"Radius {radius:.4g} m", partial(_drag_rim, lamp, line))


def _drag_rim(lamp: _Lamp, line: Sequence[Place], to: Place) -> list[Action]:
    """The rim goes through the pointer: it grows from where it is seen in the pointer's direction from the middle."""
    radius = lamp.shape.size(RADIUS, lamp.now.transform)
    if (middle := lamp.arranged.place_of(lamp.centre)) is None:
        return []
    towards = complex(*to) - complex(*middle)
    rim = [complex(*each) - complex(*middle) for each in line]
    sides = [(each * towards.conjugate()).imag for each in rim]  # of the pointer's direction, left or right
    met = [
        a + (b - a) * (left / (left - right))
        for a, b, left, right in zip(rim, rim[1:], sides, sides[1:], strict=False)
        if left * right <= 0.0 and left != right
    ]
    best = max(met, key=lambda each: (each * towards.conjugate()).real, default=0j)
    if abs(best) < 1.0:  # it is seen from its edge, or far away
        grown = 1.0 + (abs(towards) - abs(best)) / lamp.arranged.context.px(REACH)
    else:
        grown = (towards * best.conjugate()).real / abs(best) ** 2
    return lamp.resized({RADIUS: lamp.arranged.in_steps(max(grown, 0.0) * radius, SNAP_METRES)})


# ---------------------------------------------------------------------------------------------------------------- cones


def _cone(lamp: _Lamp) -> Iterator[PictureHandle]:
    """The rims of both angles, drawn at a distance from the lamp, and lines to the outer one."""
    found, cone, axis = lamp.arranged, lamp.state.cone, lamp.shape.axis(lamp.now.transform)
    target = target_of(found.context, lamp.now)
    if cone is None or axis is None or target is None:
        return
    arm = found.arm_at(lamp.centre)
    length = float(np.clip(np.linalg.norm(target - lamp.centre), _SHORTEST * arm, _LONGEST * arm))
    across = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis], axis=1)

    def rim(angle: float) -> list[Place] | None:
        turns = np.linspace(0.0, 2.0 * np.pi, _N_RIM + 1)
        return found.on_screen(*(_on_cone(lamp, frame, length, angle, t) for t in turns))

    outer, inner = rim(cone.outer), rim(cone.inner)
    if outer is None or inner is None:
        return
    _draw_spokes(lamp, outer)
    second = _N_RIM // 2  # the grips are opposite each other
    place = outer[0] if _is_under_mouse(found.context, inner[second]) else _grip(found.context, OUTER, outer, outer[0])
    for name, angle, at, line in ((OUTER, cone.outer, place, outer), (INNER, cone.inner, inner[second], inner)):
        words = "beyond it the spot is dark" if name == OUTER else "within it the spot has all of its radiance"
        hint = f"{'Outer' if name == OUTER else 'Inner'} angle {angle:.1f}°, {words}"
        yield _handle(lamp, name, at, line, hint, partial(_drag_angle, lamp, frame, length, name))


def _on_cone(lamp: _Lamp, frame: Float64Array, length: float, angle: float, turn: float) -> Float64Array:
    """A point (3,) at an angle from the axis, degrees, and so far around it, radians."""
    angle = np.radians(angle)
    local = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    return np.asarray(lamp.centre + length * (frame @ local))


def _draw_spokes(lamp: _Lamp, outer: Sequence[Place]) -> None:
    """Lines from the lamp to its cone's rim."""
    context, places = lamp.arranged.context, lamp.arranged.on_screen(lamp.centre)
    for i in range(0, _N_RIM, _N_RIM // _N_SPOKES):
        if places is not None:
            line = ImVec2(*places[0]), ImVec2(*outer[i])
            imgui.get_window_draw_list().add_line(*line, look.pack(look.with_alpha(INK, 0.45)), context.px(1.2))


def _drag_angle(lamp: _Lamp, frame: Float64Array, length: float, name: str, to: Place) -> list[Action]:
    """The angle whose rim goes through the pointer, at the turn around the axis that is nearest to it. The outer angle
    keeps the inner one's share of it."""
    cone, found = lamp.state.cone, lamp.arranged
    assert cone is not None
    now = cone.outer if name == OUTER else cone.inner
    wide = max(now, _OPENS)
    rim = found.on_screen(*(_on_cone(lamp, frame, length, wide, t) for t in (0.0, 0.5 * np.pi, np.pi)))
    if rim is None:
        return []
    # The rim is seen as an ellipse: m + cos(t) u + sin(t) v.
    start, side, end = np.array(rim)
    middle = 0.5 * (start + end)
    across, up = np.linalg.pinv(np.stack([start - middle, side - middle], axis=1), rcond=1e-3) @ (to - middle)
    turn = float(np.arctan2(up, across))

    def seen(angle: float) -> Float64Array | None:
        return found.place_of(_on_cone(lamp, frame, length, angle, turn))

    limits = (LEAST_OUTER, MOST_ANGLE) if name == OUTER else (0.0, cone.outer)
    angle = lamp.arranged.in_steps(value_at(seen, now, to, 0.2, 15.0, limits), SNAP_ANGLE)
    angle = min(max(angle, limits[0]), limits[1])
    changed = Cone(min(angle * cone.inner / cone.outer, angle), angle) if name == OUTER else Cone(angle, cone.outer)
    return [] if changed == cone else [SetCone(lamp.state.name, changed.inner, changed.outer)]
