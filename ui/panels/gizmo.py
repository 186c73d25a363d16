"""The gizmo: handles over the picture that move, rotate or scale the selected object, and the outline of its box.

They are handles like those of deformers: clicks beside them select, camera drags stay camera drags, a drag is one step,
Esc takes it back, and scripts drag them by name (`gizmo.x`). Rejected: ImGuizmo, which comes with imgui: it takes the
mouse itself, before all of that.

Ctrl held during a drag snaps: to 0.1 m, 15 degrees, and factors of 0.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands.poses import SetTransform
from engine.core.camera import camera_frame, pixel_directions
from engine.scene.transform import LEAST_SCALE, MOST_METRES, MOST_SCALE, Transform, Triple, rotation_matrix
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.picture_handles import PictureHandle, Place, on_screen, value_at
from ui.panels.picture_overlays import CORNERS, EDGES
from ui.panels.viewport_layout import PictureRect

Float64Array = NDArray[np.float64]

TOOLS = ("move", "rotate", "scale")
AXES = "xyz"
ARM = 0.14  # of the picture's height: the length of an arm, and the radius of a ring
SNAP_METRES, SNAP_DEGREES, SNAP_SCALE = 0.1, 15.0, 0.1
HOW = "drag it; Ctrl snaps."
_N_RING = 48
_BESIDE = 1.15  # of half a box: how far from its middle the handles that scale it are, between these shares of an arm
_NEAR, _FAR = 0.6, 2.0
_LEVEL = 0.02  # height of a direction that meets the ground too far away


@dataclass(frozen=True)
class _Subject:
    """The selected object as it stands: its box (2, 3) in the scene's file, its transform, the present place of its
    pivot (3,), and the length of an arm, metres."""

    context: PanelContext
    placed: PictureRect
    name: str
    box: Float64Array
    transform: Transform
    pivot: Float64Array
    arm: float

    def on_screen(self, *points: Float64Array) -> list[Place] | None:
        """Places of points (3,) on screen; None where one is not in front of the camera."""
        found = on_screen(self.context, self.placed, np.array(points))
        return None if found is None else [(float(x), float(y)) for x, y in found]

    def set_part(self, part: str, values: Float64Array) -> list[Action]:
        """Set one of the transform's three triples, where it is another than before."""
        x, y, z = values.tolist()
        return [] if (x, y, z) == getattr(self.transform, part) else [SetTransform(self.name, **{part: (x, y, z)})]


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The handles of the chosen tool, and the outline of what they move; none where the selected object is not in front
    of the camera."""
    subject = _subject(context, placed)
    if subject is None:
        return []
    _draw_outline(subject)
    return list({"move": _moving, "rotate": _rotating, "scale": _scaling}[context.state.gizmo](subject))


def _subject(context: PanelContext, placed: PictureRect) -> _Subject | None:
    selected = context.view.selected
    box = None if selected is None or not context.state.gizmo else context.resting_box_of(selected.object)
    if selected is None or box is None:
        return None
    transform = context.document.object(selected.object).transform
    pivot = box.mean(axis=0) + transform.translation
    depth = float((pivot - np.array(context.camera.position)) @ camera_frame(context.camera)[2])
    arm = ARM * 2.0 * np.tan(np.radians(context.camera.fov_y) / 2.0) * depth
    return _Subject(context, placed, selected.object, box, transform, pivot, arm) if depth > 0.0 else None


def _draw_outline(subject: _Subject) -> None:
    """The object's box where it is to be, while the picture still shows it elsewhere."""
    context = subject.context
    if not context.status.is_away and context.state.grip is None:
        return
    matrix = subject.transform.matrix(subject.box.mean(axis=0))
    corners = np.where(CORNERS, subject.box[1], subject.box[0]) @ matrix[:3, :3].T + matrix[:3, 3]
    places = subject.on_screen(*corners)
    if places is None:
        return
    for start, end in EDGES:
        line = ImVec2(*places[start]), ImVec2(*places[end])
        imgui.get_window_draw_list().add_line(*line, look.pack(look.with_alpha(look.ACCENT, 0.8)), context.px(1.2))


def snaps() -> bool:
    """Whether drags go in steps."""
    return bool(imgui.get_io().key_ctrl)


def _rounded(values: Float64Array, which: NDArray[np.bool_], step: float) -> Float64Array:
    """These of the values rounded to multiples of a step, where snapping is on."""
    return np.where(which, np.round(np.round(values / step) * step, 6), values) if snaps() else values


# --------------------------------------------------------------------------------------------------------------- moving


def _moving(subject: _Subject) -> Iterator[PictureHandle]:
    """An arm along each axis of the world, and a handle at the pivot that goes over the ground."""
    for k, axis in enumerate(np.eye(3)):
        if (line := subject.on_screen(subject.pivot, subject.pivot + subject.arm * axis)) is not None:
            hint = f"Along {AXES[k].upper()}, {subject.transform.translation[k]:.3f} m: {HOW}"
            drag = partial(_move_along, subject, k)
            yield PictureHandle(f"gizmo.{AXES[k]}", line[1], line, _label(subject), hint, drag, ink=look.CHANNELS[k])
    if (line := subject.on_screen(subject.pivot)) is not None:
        hint = f"Over the ground: {HOW}"
        yield PictureHandle("gizmo.ground", line[0], line, _label(subject), hint, partial(_move_over_ground, subject))


def _label(subject: _Subject) -> str:
    return f"{subject.context.state.gizmo} {subject.name}"


def _move_along(subject: _Subject, k: int, to: Place) -> list[Action]:
    """Move so that the end of an arm is nearest to a place on screen."""
    axis, arm = np.eye(3)[k], subject.arm

    def seen(by: float) -> Float64Array | None:
        return _first(subject.on_screen(subject.pivot + (arm + by) * axis))

    by = value_at(seen, 0.0, to, 0.01 * arm, 2.0 * arm, (-MOST_METRES, MOST_METRES))
    moved = np.array(subject.transform.translation) + by * axis
    return subject.set_part("translation", _rounded(moved, axis > 0.0, SNAP_METRES))


def _move_over_ground(subject: _Subject, to: Place) -> list[Action]:
    """Move the pivot in its level plane to a place on screen."""
    placed, camera = subject.placed, subject.context.camera
    size = max(round(placed.width), 1), max(round(placed.height), 1)
    towards = pixel_directions(camera, size, to[0] - placed.x, to[1] - placed.y).astype(np.float64)
    rise = subject.pivot[1] - camera.position[1]
    if abs(towards[1]) < _LEVEL or rise / towards[1] <= 0.0:  # the plane's horizon
        return []
    met = np.array(camera.position) + towards * (rise / towards[1])
    by = np.array([met[0] - subject.pivot[0], 0.0, met[2] - subject.pivot[2]])
    moved = np.array(subject.transform.translation) + by
    return subject.set_part("translation", _rounded(moved, np.array([True, False, True]), SNAP_METRES))


def _first(places: list[Place] | None) -> Float64Array | None:
    return None if places is None else np.array(places[0])


# ------------------------------------------------------------------------------------------------------------- rotating


def _rotating(subject: _Subject) -> Iterator[PictureHandle]:
    """A ring about each axis of the world, with a knob that turns along with the object."""
    for k, knob in enumerate(_knobs(subject)):
        turns = [_about(k, degrees) for degrees in np.linspace(0.0, 360.0, _N_RING + 1)]
        if (line := subject.on_screen(*(subject.pivot + subject.arm * turn @ knob for turn in turns))) is not None:
            hint = f"About {AXES[k].upper()}, {subject.transform.rotation[k]:.1f}°: {HOW}"
            drag = partial(_rotate_about, subject, k, knob)
            yield PictureHandle(f"gizmo.{AXES[k]}", line[0], line, _label(subject), hint, drag, ink=look.CHANNELS[k])


def _knobs(subject: _Subject) -> Iterator[Float64Array]:
    """For each axis the direction (3,) of its knob: that of another axis of the object, across the ring's."""
    own = rotation_matrix(subject.transform.rotation)
    for k in range(3):
        across = [own[:, i] * (np.arange(3) != k) for i in ((k + 1) % 3, (k + 2) % 3)]
        longer = max(across, key=lambda each: float(np.linalg.norm(each)) > 0.5)
        yield longer / np.linalg.norm(longer)


def _about(k: int, degrees: float) -> Float64Array:
    """The rotation (3, 3) about one of the world's axes."""
    return rotation_matrix(np.where(np.arange(3) == k, degrees, 0.0).tolist())


def _rotate_about(subject: _Subject, k: int, knob: Float64Array, to: Place) -> list[Action]:
    """Rotate so that a ring's knob is nearest to a place on screen."""

    def seen(degrees: float) -> Float64Array | None:
        return _first(subject.on_screen(subject.pivot + subject.arm * _about(k, degrees) @ knob))

    degrees = value_at(seen, 0.0, to, 0.5, 30.0, (-180.0, 180.0))
    if snaps():
        degrees = round(degrees / SNAP_DEGREES) * SNAP_DEGREES
    by: Triple = (degrees * (k == 0), degrees * (k == 1), degrees * (k == 2))
    return subject.set_part("rotation", np.array(subject.transform.rotated(by).rotation)) if degrees else []


# -------------------------------------------------------------------------------------------------------------- scaling


def _scaling(subject: _Subject) -> Iterator[PictureHandle]:
    """A handle beside the box along each of the object's axes, and one that scales all three."""
    own, half = rotation_matrix(subject.transform.rotation), 0.5 * np.ptp(subject.box, axis=0)
    reach = np.clip(_BESIDE * half, _NEAR * subject.arm, _FAR * subject.arm)
    right, up, _ = camera_frame(subject.context.camera)
    aside = subject.arm * (right + up) / np.sqrt(2.0)
    scale = np.array(subject.transform.scale)
    ways = [(AXES[k], reach[k] * own[:, k], np.arange(3) == k) for k in range(3)]
    for name, way, which in (*ways, ("all", aside, np.full(3, True))):
        now = float(np.exp(np.log(scale[which]).mean()))
        if (line := subject.on_screen(subject.pivot, subject.pivot + now * way)) is None:
            continue
        ink = look.CHANNELS[AXES.index(name)] if name in AXES else look.grey(240)
        hint = f"{'All sides' if name == 'all' else name.upper()} × {now:.3f}: {HOW}"
        drag = partial(_scale_along, subject, way, which, now)
        yield PictureHandle(f"gizmo.{name}", line[1], line, _label(subject), hint, drag, ink=ink)


def _scale_along(subject: _Subject, way: Float64Array, which: NDArray[np.bool_], now: float, to: Place) -> list[Action]:
    """Scale so that a handle is nearest to a place on screen; which (3,): the axes that follow; now: their factor."""

    def seen(factor: float) -> Float64Array | None:
        return _first(subject.on_screen(subject.pivot + factor * way))

    scale = np.array(subject.transform.scale)
    factor = value_at(seen, now, to, 0.005 * now, now, (LEAST_SCALE, MOST_SCALE))
    found = _rounded(np.where(which, scale * (factor / now), scale), which, SNAP_SCALE)
    return subject.set_part("scale", np.clip(found, SNAP_SCALE if snaps() else LEAST_SCALE, MOST_SCALE))
