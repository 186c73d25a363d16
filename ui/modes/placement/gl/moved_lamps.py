"""Lamps that a hand has elsewhere than the picture: each is drawn where it is, until the view is traced anew.

A rectangle, a disc or a ball is met by a formula at each pixel (`shaders/placement/lamp.frag.glsl`), and covers what is
farther away there. Pixels that show a lamp where it was take the nearest pixels that do not, as their surfaces are not
known: what the lamp hid shows as it goes on beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame, camera_plane, project
from engine.scene.description import Camera, Primitive
from engine.scene.picture_frame import PictureFrame
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Box, Passes

Float64Array = NDArray[np.float64]
_NO_BOX: Box = (0, 0, 0, 0)
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_LEAST_DEPTH = 1e-3  # of a lamp's distance: what is nearer may be anywhere in the picture


@dataclass(frozen=True)
class ShownLamp:
    """A lamp where it is now: its object, by index, its shape, the matrix (4, 4) in rows that takes this to the world,
    its radiance, and the row of its cone (`engine.light.cones`)."""

    i_object: int
    primitive: Primitive
    matrix: tuple[float, ...]
    radiance: tuple[float, float, float]
    cone: tuple[float, ...]

    @property
    def corners(self) -> Float64Array:
        """The corners (8, 3) of a box around it; of what is flat, each is there twice."""
        matrix = np.reshape(self.matrix, (4, 4))
        own = _CORNERS if self.primitive == "sphere" else _CORNERS * (1.0, 1.0, 0.0)
        return np.asarray(own @ matrix[:3, :3].T + matrix[:3, 3])

    def box(self, camera: Camera, size: tuple[int, int]) -> Box:
        """The pixels that it may cover in a picture (width, height)."""
        towards = self.corners - camera.position
        depth = towards @ camera_frame(camera)[2]
        if (depth <= 0.0).all():
            return _NO_BOX
        if (depth < _LEAST_DEPTH * np.linalg.norm(towards, axis=1)).any():
            return 0, 0, *size
        places = project(camera, size, towards)
        low = np.clip(np.floor(places.min(axis=0)), 0, size).astype(int)
        high = np.clip(np.ceil(places.max(axis=0)), 0, size).astype(int)
        return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


class MovedLamps:
    """Some objects that are lamps over the picture of a frame, drawn where `place` has them. filled, sources: pixels
    that show them where they were, and the pixel that each takes the place of."""

    def __init__(
        self, passes: Passes, memory: TextureMemory, frame: PictureFrame, camera: Camera, objects: tuple[int, ...]
    ) -> None:
        self.objects, self._camera = objects, camera
        self._passes, self._memory, self._size = passes, memory, (frame.width, frame.height)
        self._plane, self._eye = camera_plane(camera, self._size), np.array(camera.position, np.float64)
        distance = centre_distances(frame)
        self.filled, self.sources = filled_pixels(frame, objects)
        distance.ravel()[self.filled] = distance.ravel()[self.sources]
        self._distances = memory.texture(self._size, 1, "f4", distance)
        self._lamps: tuple[ShownLamp, ...] = ()
        self._drawn: list[tuple[ShownLamp, Box]] = []

    @property
    def filled_box(self) -> Box:
        """The box around what shows them where they were."""
        return box_of_pixels(self.filled, self._size[0])

    @property
    def boxes(self) -> list[Box]:
        """What shows them where they are."""
        return [box for _, box in self._drawn]

    def place(self, lamps: tuple[ShownLamp, ...]) -> list[Box]:
        """Set where they are; returns the boxes that change."""
        if lamps == self._lamps:
            return []
        before, self._lamps = self.boxes, lamps
        farthest_first = sorted(lamps, key=lambda lamp: -float(np.linalg.norm(lamp.corners.mean(axis=0) - self._eye)))
        boxes = ((lamp, lamp.box(self._camera, self._size)) for lamp in farthest_first)
        self._drawn = [(lamp, box) for lamp, box in boxes if box[2] and box[3]]
        return before + self.boxes

    def draw(self, target: moderngl.Framebuffer, box: Box) -> None:
        """Draw them over the part of the picture in `box`."""
        for lamp, own in self._drawn:
            part = _overlap(own, box)
            if not part[2] or not part[3]:
                continue
            matrix = np.reshape(lamp.matrix, (4, 4))
            back = np.linalg.inv(matrix[:3, :3])
            program = self._passes.full_screen(
                "placement/lamp.frag.glsl", BALL=int(lamp.primitive == "sphere"), DISC=int(lamp.primitive == "disc")
            )
            self._passes.draw(
                program, target, part, {"distances": self._distances}, over=True,
                eye=tuple((back @ (self._eye - matrix[:3, 3])).tolist()),
                plane=tuple((self._plane @ back.T).ravel().tolist()), world_plane=tuple(self._plane.ravel().tolist()),
                emission=lamp.radiance, cone=lamp.cone,
            )  # fmt: skip

    def release(self) -> None:
        self._memory.release(self._distances)


def centre_distances(frame: PictureFrame) -> NDArray[np.float32]:
    """How far away the surfaces at the pixels' centres are (H, W), infinite where there is none or a lamp."""
    found = np.full(frame.height * frame.width, np.inf, np.float32)
    counts = frame.object_ranges[:, 1] - frame.object_ranges[:, 0]
    at_centre = np.repeat(np.arange(frame.n_objects), counts) == frame.object_image.ravel()[frame.pixel]
    rows = np.flatnonzero(at_centre)[::-1]  # a pixel's centre is its first point
    if len(frame.distance):
        found[frame.pixel[rows]] = frame.distance[rows]
    return found.reshape(frame.height, frame.width)


def filled_pixels(frame: PictureFrame, objects: Sequence[int]) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """The pixels that show some of these objects, also in a part, and for each the nearest one in its row or column
    that does not."""
    shown = np.isin(frame.object_image, objects)
    for axis in (0, 1):  # edges that show a part of one
        padded = np.pad(shown, [(int(axis == k),) * 2 for k in (0, 1)])
        shown = np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 3, axis=axis).any(axis=2))
    shown.ravel()[frame.lamps.pixel[np.isin(frame.lamps.object, objects)]] = True
    pixels = np.flatnonzero(shown)
    x, y, width, height = box_of_pixels(pixels, frame.width)
    left, top = max(x - 1, 0), max(y - 1, 0)
    part = shown[top : y + height + 1, left : x + width + 1]
    away, row, column = _nearest_others(part)
    found = part & (away < part.size)
    own = np.flatnonzero(found)
    inside = (own // max(part.shape[1], 1) + top) * frame.width + own % max(part.shape[1], 1) + left
    return inside, (row[found] + top) * frame.width + column[found] + left


def _nearest_others(shown: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """For each pixel (H, W) how far the nearest in its row or column is that is not shown, and where that is: its row
    and column; a distance of at least H W where there is none."""
    row, column = (np.asarray(each) for each in np.indices(shown.shape))
    best, rows, columns = np.full(shown.shape, shown.size), row.copy(), column.copy()
    for axis, along in ((0, row), (1, column)):
        size = shown.shape[axis]
        before = np.maximum.accumulate(np.where(shown, -shown.size, along), axis=axis)
        after = np.flip(np.minimum.accumulate(np.flip(np.where(shown, size + shown.size, along), axis), axis), axis)
        for found in (before, after):
            away = np.abs(found - along)
            nearer = away < best
            best[nearer] = away[nearer]
            rows[nearer] = (found if axis == 0 else row)[nearer]
            columns[nearer] = (found if axis == 1 else column)[nearer]
    return best, rows, columns


def box_of_pixels(pixels: NDArray[np.integer], width: int) -> Box:
    """The box around pixels of a picture."""
    if not len(pixels):
        return _NO_BOX
    y, x = np.divmod(pixels, width)
    left, top = int(x.min()), int(y.min())
    return left, top, int(x.max()) - left + 1, int(y.max()) - top + 1


def _overlap(a: Box, b: Box) -> Box:
    left, top = max(a[0], b[0]), max(a[1], b[1])
    right, bottom = min(a[0] + a[2], b[0] + b[2]), min(a[1] + a[3], b[1] + b[3])
    return left, top, max(right - left, 0), max(bottom - top, 0)
