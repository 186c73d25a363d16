"""The scene as the window knows it in any mode: what each pixel of the picture sees, the sky behind it, and which
points of a surface lie on the path of a brush.

It depends only on the primary hits that came with the scene, and its camera, on no mode's picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.messages.picture_events import SceneFrame
from engine.light.environment import Environment, tone_mapped_thumbnail
from engine.material.strokes import Stroke, pack_dabs
from engine.scene.description import SceneDescription
from engine.scene.picture_frame import PictureFrame
from engine.scene.surface_spot import SurfaceSpot, spot_in
from ui.gl.gpu_memory import small_texture
from ui.surface_lobe import SurfacePoint

THUMBNAIL_WIDTH = 512


class SceneView:
    """One scene after another; columns and rows are those of the picture, row 0 at the top."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="thumbnail")
        self._thumbnail_due: Future[NDArray[np.uint8]] | None = None
        self._thumbnail: moderngl.Texture | None = None
        self._description: SceneDescription | None = None
        self._names: list[str] = []
        self._frame: PictureFrame | None = None

    def take_scene(self, event: SceneFrame) -> None:
        """Take another scene, or the same from another camera."""
        self._description = event.description
        self._names = [described.name for described in event.description.objects]
        self._frame = event.frame

    @property
    def frame(self) -> PictureFrame | None:
        """What each pixel sees; None before there is a scene."""
        return self._frame

    def take_sky(self, radiance: NDArray[np.floating]) -> None:
        """Take another sky: a thread makes the panel's picture of it; of no light at all there is none."""
        self._thumbnail_due = self._threads.submit(_thumbnail, radiance) if np.any(radiance) else None
        if self._thumbnail_due is None and self._thumbnail is not None:
            self._thumbnail.release()
            self._thumbnail = None

    def follow(self) -> bool:
        """Show the sky's picture once it is made; returns whether it is new."""
        if self._thumbnail_due is None or not self.thumbnail_is_ready:
            return False
        if self._thumbnail is not None:
            self._thumbnail.release()
        self._thumbnail = small_texture(self._context, self._thumbnail_due.result())
        self._thumbnail_due = None
        return True

    def close(self) -> None:
        """Free GL objects and let the thread end."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        if self._thumbnail is not None:
            self._thumbnail.release()

    @property
    def is_there(self) -> bool:
        """Whether a scene has come."""
        return self._description is not None

    @property
    def environment(self) -> moderngl.Texture | None:
        """The environment's thumbnail, row 0 at the top."""
        return self._thumbnail

    @property
    def has_environment(self) -> bool:
        """Whether the scene's own file has an environment."""
        return self._description is not None and self._description.environment is not None

    @property
    def thumbnail_is_ready(self) -> bool:
        """Whether a new thumbnail only has to be shown."""
        return self._thumbnail_due is not None and self._thumbnail_due.done()

    @property
    def heading(self) -> float:
        """The camera's direction, degrees clockwise from -Z seen from above."""
        if self._description is None:
            return 0.0
        camera = self._description.camera
        x, _, z = (t - p for t, p in zip(camera.target, camera.position, strict=True))
        return math.degrees(math.atan2(x, -z))

    def object_at(self, column: int, row: int) -> str | None:
        """The name of the object that a pixel of the picture sees."""
        index = -1 if self._frame is None else self._frame.object_at(column, row)
        return self._names[index] if 0 <= index < len(self._names) else None

    def objects_in(self, left: float, top: float, right: float, bottom: float) -> tuple[str, ...]:
        """The names of the objects that are seen in a rectangle, pixels of the picture."""
        found = [] if self._frame is None else self._frame.objects_in(left, top, right, bottom).tolist()
        return tuple(self._names[index] for index in found if 0 <= index < len(self._names))

    def surface_at(self, column: int, row: int) -> SurfacePoint | None:
        """The surface that a pixel of the picture sees; None for emitters and the background."""
        frame, description = self._frame, self._description
        place = None if frame is None else frame.sample_at(column, row)
        if frame is None or description is None or place is None:
            return None
        normal, tangent = (array[place].astype(np.float64) for array in (frame.normal, frame.tangent))
        normal /= np.linalg.norm(normal)
        across = np.cross(normal, tangent)
        across /= np.linalg.norm(across)
        axes = np.stack([np.cross(across, normal), across, normal])
        ray = frame.ray_directions[row, column].astype(np.float64)
        return SurfacePoint(column, row, axes, ray, description.camera, (frame.width, frame.height))

    def spot_at(self, column: int, row: int) -> SurfaceSpot | None:
        """The point that a pixel of the picture sees; None for emitters and the background."""
        frame, description = self._frame, self._description
        if frame is None or description is None:
            return None
        return spot_in(frame, description.camera, column, row)


def _thumbnail(radiance: NDArray[np.floating]) -> NDArray[np.uint8]:
    """The environment as a panel shows it, (h,w,3) sRGB."""
    return tone_mapped_thumbnail(Environment(np.asarray(radiance, np.float32), "thumbnail"), THUMBNAIL_WIDTH)


# Dabs are this share of the radius apart: between them the edge of a stroke recedes by a hundredth of it.
SPACING = 0.3
MOST_DABS = 400  # in one frame
_NEAR = 1024.0

Point = tuple[float, float]
SpotAt = Callable[[int, int], SurfaceSpot | None]


def sample_path(points: Sequence[Point], radius: float) -> list[Point]:
    """Points on the path through these, pixels, close enough together for dabs; without the first one."""
    found: list[Point] = []
    step = max(SPACING * radius, 0.5)
    for (x, y), (to_x, to_y) in zip(points, points[1:], strict=False):
        n = min(max(math.ceil(math.hypot(to_x - x, to_y - y) / step), 1), MOST_DABS)
        found += [(x + (to_x - x) * i / n, y + (to_y - y) * i / n) for i in range(1, n + 1)]
    return found


def spots_at(spot_at: SpotAt, places: Sequence[Point]) -> list[SurfaceSpot]:
    """The spots at places of the picture that see the surface."""
    found = (spot_at(math.floor(x), math.floor(y)) for x, y in places)
    return [spot for spot in found if spot is not None]


def stroke_at(spots: Sequence[SurfaceSpot], metres: float, value: float, strength: float, hardness: float) -> Stroke:
    """A stroke over these spots, at least one, with a brush of so many metres; see `Stroke`."""
    # About a near place, and the same one for most strokes: 500 m away single precision resolves 0.03 mm.
    x, y, z = (np.round(spots[0].place / _NEAR) * _NEAR + 0.0).tolist()
    dabs = pack_dabs([spot.place - (x, y, z) for spot in spots], [spot.normal for spot in spots])
    return Stroke(metres, value, strength, hardness, dabs, (x, y, z))
