"""Lamps that a hand has elsewhere than the picture: each is drawn where it is, until the view is traced anew.

A rectangle, a disc or a ball is met by a formula at each pixel (`shaders/placement/lamp.frag.glsl`), and covers what is
farther away there. Pixels that show a lamp where it was take the nearest pixels that do not, as their surfaces are not
known: what the lamp hid shows as it goes on beside it.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame, camera_plane, project
from engine.scene.description import Camera, Primitive
from engine.scene.picture_frame import PictureFrame
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
    that show them where they were, and the pixel that each takes the place of, see `filled_pixels`."""

    def __init__(
        self, passes: Passes, frame: PictureFrame, pointless: ObjectPixels, camera: Camera, objects: tuple[int, ...]
    ) -> None:
        self.objects, self._camera = objects, camera
        self._passes, self._size = passes, (frame.width, frame.height)
        self._plane, self._eye = camera_plane(camera, self._size), np.array(camera.position, np.float64)
        self.filled, self.sources = filled_pixels(frame, pointless, objects)
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

    def draw(self, target: moderngl.Framebuffer, box: Box, distances: moderngl.Texture) -> None:
        """Draw them over the part of the picture in `box`. distances: see `centre_distances`."""
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
                program, target, part, {"distances": distances}, over=True,
                eye=tuple((back @ (self._eye - matrix[:3, 3])).tolist()),
                plane=tuple((self._plane @ back.T).ravel().tolist()), world_plane=tuple(self._plane.ravel().tolist()),
                emission=lamp.radiance, cone=lamp.cone,
            )  # fmt: skip


class ObjectPixels(NamedTuple):
    """Row-major indices (n,) of pixels, and the object that is at the centre of each (n,)."""

    pixel: NDArray[np.integer]
    object: NDArray[np.integer]


def pointless_pixels(frame: PictureFrame) -> ObjectPixels:
    """The pixels at whose centres objects are that reflect nothing, as lamps are."""
    has_none = np.append(frame.object_ranges[:, 1] == frame.object_ranges[:, 0], False)  # the last is the background
    pixel = np.flatnonzero(has_none[frame.object_image])
    return ObjectPixels(pixel, frame.object_image.ravel()[pixel])


def centre_distances(frame: PictureFrame) -> Generator[None, None, NDArray[np.float32]]:
    """How far away the surfaces at the pixels' centres are (H, W), infinite where there is none or a lamp; an object in
    each step."""
    found, shown = np.full(frame.height * frame.width, np.inf, np.float32), frame.object_image.ravel()
    for i, (start, stop) in enumerate(frame.object_ranges if len(frame.distance) else ()):
        pixel = frame.pixel[start:stop]
        at_centre = np.flatnonzero(shown[pixel] == i)[::-1]  # a pixel's centre is its first point
        found[pixel[at_centre]] = frame.distance[start:stop][at_centre]
        yield
    return found.reshape(frame.height, frame.width)


def filled_pixels(
    frame: PictureFrame, pointless: ObjectPixels, objects: Sequence[int]
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """The pixels that show some of these objects, also in a part, and for each the nearest one in its row or column
    that does not. pointless: see `pointless_pixels`."""
    width, height = frame.width, frame.height
    seen = [frame.lamps.pixel[np.isin(frame.lamps.object, objects)]]
    at_centre = [pointless.pixel[np.isin(pointless.object, objects)]]
    at_centre += [frame.pixel[slice(*frame.object_ranges[i])] for i in objects]
    # All in a box around them, with a pixel for edges on each side and one for what takes their place.
    x, y, across, down = box_of_pixels(np.concatenate([*seen, *at_centre]), width)
    left, top = max(x - 2, 0), max(y - 2, 0)
    shape = min(y + down + 2, height) - top, min(x + across + 2, width) - left
    shown = np.zeros(shape, bool)
    for pixel in at_centre:
        shown[pixel // width - top, pixel % width - left] = True
    for axis in (0, 1):  # edges that show a part of one
        rows = shown if axis == 0 else shown.T
        shown_before = rows.copy()
        rows[1:] |= shown_before[:-1]
        rows[:-1] |= shown_before[1:]
    for pixel in seen:
        shown[pixel // width - top, pixel % width - left] = True
    own, others = _nearest_others(shown)
    in_picture = (top * width + left, width)
    return _in_picture(own, shape[1], *in_picture), _in_picture(others, shape[1], *in_picture)


def _in_picture(pixel: NDArray[np.integer], width: int, first: int, picture_width: int) -> NDArray[np.integer]:
    """Indices of pixels of a box of a width, by those of a picture, in which its first one is `first`."""
    return first + pixel // max(width, 1) * picture_width + pixel % max(width, 1)


def _nearest_others(shown: NDArray[np.bool_]) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """The shown pixels (H, W) that have one in their row or column that is not, and the nearest of these; row-major
    indices (n,)."""
    height, width = shown.shape
    own = np.flatnonzero(shown)
    row, column = np.divmod(own.astype(np.int32), np.int32(max(width, 1)))
    best, others = np.full(len(own), height + width, np.int32), own.copy()
    for lines, line, place, strides in ((shown, row, column, (width, 1)), (shown.T, column, row, (1, width))):
        length = max(lines.shape[1], 1)
        free = np.flatnonzero(~lines).astype(np.int32)
        if not free.size:
            continue
        n_before = np.cumsum(~lines, dtype=np.int32)[line * length + place]
        for n in n_before - 1, n_before:  # the free ones before and after each, which may be in other lines
            found_line, found = np.divmod(free[np.clip(n, 0, len(free) - 1)], np.int32(length))
            away = np.abs(found - place)
            nearer = np.flatnonzero((found_line == line) & (away < best))
            best[nearer] = away[nearer]
            others[nearer] = line[nearer] * strides[0] + found[nearer] * strides[1]
    there = best < height + width
    return own[there], others[there]


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
