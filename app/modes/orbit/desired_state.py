"""The state that Orbit desires of the worker, and the state that is ready: the values that its controllers compare."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from app.document.document import Document
from app.document.scene_state import LayerState, SceneState, scene_state
from app.document.selection import is_layer_visible
from app.document.shadow_catchers import CatchersAlone, moving_catchers
from app.document.view_state import Viewpoint, ViewState
from app.modes.orbit.orbit_messages import Quality
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import Camera, CameraDescription

if TYPE_CHECKING:
    from app.modes.orbit.orbit_drawing import OrbitDrawing

# The pointer is idle after so long without input.
IDLE_SECONDS = 0.2
# Seconds that a picture may take while something moves; a slower one is drawn in a lower resolution.
MOVING_SECONDS = 0.04
# From the best to the quickest: the share of the picture's sides, and coefficients of light per point.
STEPS = ((1.0, 96), (1.0, 64), (0.75, 64), (0.5, 64), (0.5, 40), (0.375, 40), (0.375, 24), (0.25, 24))
# The same limit where the window draws on a graphics card.
WINDOW_SECONDS = 0.012
WINDOW_STEPS = ((1.0, 320), (1.0, 160), (1.0, 80), (0.75, 80), (0.5, 64), (0.5, 40), (0.375, 24), (0.25, 24))
_TOO_LONG, _SHORT_ENOUGH = 1.3, 0.8
_MOST_PATIENCE = 64


@dataclass(frozen=True)
class DesiredOrbit:
    """All that pictures are drawn of, except the camera: equal values have equal pictures. The scene has only visible
    layers. poses: of its objects, where what is prepared depends on them; catchers: of which only the shadows on them
    are shown, alone."""

    scene: SceneState
    n_bounces: int
    n_points: int = 40_000
    n_coefficients: int = 320
    poses: Poses = ()
    catchers: CatchersAlone | None = None

    @classmethod
    def of(cls, document: Document, view: ViewState) -> DesiredOrbit:
        scene = scene_state(document)
        seen = (each for each in scene.layers if is_layer_visible(document, view, each.key))
        layers = tuple(LayerState(each.key, each.layer.replace(visible=True)) for each in seen)
        settings = view.settings
        return cls(
            replace(scene, layers=layers), settings.n_bounces, settings.n_points, settings.n_coefficients,
            catchers=moving_catchers(document, view),
        )  # fmt: skip


class PictureContent(NamedTuple):
    """What a picture shows, except its `DesiredOrbit`: the view, the poses (none where objects are as the worker
    has traced them), what it shows besides light alone (`ViewState.split`, `fit_error`), and whether the environment is
    left out behind it, so that it has alpha."""

    viewpoint: Viewpoint
    poses: Poses = ()
    split: tuple[float, float] | None = None
    fit_error: bool = False
    transparent: bool = False


class ShownPicture(NamedTuple):
    """The content of a shown picture, whose error may be estimated."""

    desired: DesiredOrbit
    viewpoint: Viewpoint
    poses: Poses
    has_map: bool = False


@dataclass(frozen=True)
class ReadyState:
    """How much the worker has ready of the request `prepared`: see `OrbitProgress` and `OrbitPictureDrawn`."""

    prepared: int = 0
    version: int = 0
    is_done: bool = False
    follows_move: bool = False


@dataclass(frozen=True)
class PictureRequest:
    """A picture that was requested or has come: camera, resolution (width, height), quality, content, poses, and what
    it shows besides light alone (`ViewState.split`, `fit_error`). transparent: see `PictureContent`. is_headlight:
    objects lit from the camera, which needs nothing precomputed."""

    viewpoint: Viewpoint
    resolution: tuple[int, int]
    quality: Quality
    made_of: ReadyState = ReadyState()
    poses: Poses = ()
    split: tuple[float, float] | None = None
    fit_error: bool = False
    transparent: bool = False
    is_headlight: bool = False

    def is_as_good_as(self, other: PictureRequest) -> bool:
        """Whether it shows the same, in as many pixels and as well."""
        same = replace(self, resolution=other.resolution, quality=other.quality)
        if same != other:
            return False
        return self.resolution >= other.resolution and (self.quality == "rest" or other.quality == "moving")


class DesiredDrawing:
    """What document and view desire to be drawn, and since when it stays.

    desired: all but the camera, content: the rest; None before the first update.
    """

    def __init__(self, drawing: OrbitDrawing) -> None:
        self._drawing = drawing
        self.scene_opened(None)

    def scene_opened(self, camera: CameraDescription | None) -> None:
        """Another scene is open, seen by its own camera."""
        self._own_camera = camera
        self.desired: DesiredOrbit | None = None
        self.content: PictureContent | None = None
        self._scene: DesiredOrbit | None = None  # the desired state without what is added once the view rests
        self._inputs: tuple[object, ...] = ()
        self._moved_at = -math.inf

    def update(self, now: float, document: Document, view: ViewState) -> bool:
        """Note what is desired; returns whether it is another scene than before, and not only another view."""
        inputs, scene, before = self._drawing.desired_inputs(document, view), self._scene, self.content
        if scene is None or inputs != self._inputs:
            scene, self._inputs = self._drawing.desired_state(document, view), inputs
        self.content = content = self._drawing.content(document, view)
        is_other = scene != self._scene
        if is_other or before is None or (before.viewpoint, before.poses) != (content.viewpoint, content.poses):
            self._moved_at = -math.inf if self._scene is None else now
        self._scene = scene
        camera = self.camera(content.viewpoint)
        self.desired = self._drawing.idle_state(scene, content, camera, self.full_resolution, self.rests(now))
        return is_other

    def skip_idle(self) -> None:
        """A drag ended: the view rests at once."""
        self._moved_at = -math.inf

    def rests(self, now: float) -> bool:
        """Whether nothing has changed for a while."""
        return now - self._moved_at >= IDLE_SECONDS

    def has_followed(self, document: Document, view: ViewState) -> bool:
        """Whether document and view are as they were at the last update."""
        is_same = self.content is not None and view.viewpoint == self.content.viewpoint
        return is_same and self._drawing.desired_inputs(document, view) == self._inputs

    def camera(self, viewpoint: Viewpoint) -> Camera:
        """The camera of a view."""
        assert self._own_camera is not None
        return viewpoint.camera or self._own_camera

    @property
    def full_resolution(self) -> tuple[int, int]:
        """The resolution (width, height) of an idle picture."""
        own = (1, 1) if self._own_camera is None else self._own_camera.resolution
        return (self.content and self.content.viewpoint.resolution) or own


class QualityPacer:
    """Chooses how well a moving picture is drawn: as well as its time allows.

    How much longer the next better step takes is not known in advance: some pictures cost most at the points, others at
    the pixels. So it is tried, and after a failed try not again for twice as many pictures as the time before.
    """

    def __init__(
        self, seconds: float = MOVING_SECONDS, steps: tuple[tuple[float, int], ...] = STEPS, first: int = 3
    ) -> None:
        """seconds: that a picture may take; first: the step to begin with."""
        self._seconds, self._steps = seconds, steps
        self._i_step = first
        self._patience, self._waited, self._tries = 1, 0, False

    @property
    def n_coefficients(self) -> int:
        """Coefficients of light per point."""
        return self._steps[self._i_step][1]

    def resolution(self, whole: tuple[int, int]) -> tuple[int, int]:
        """The resolution of a picture whose full resolution (width, height) is given."""
        scale, _ = self._steps[self._i_step]
        return max(round(scale * whole[0]), 1), max(round(scale * whole[1]), 1)

    def record_seconds(self, seconds: float) -> None:
        """Note that a moving picture took this long."""
        self._waited += 1
        if seconds > _TOO_LONG * self._seconds:
            self._patience = min(2 * self._patience, _MOST_PATIENCE) if self._tries else 1
            # A step saves up to half: what takes many times too long skips some.
            n_steps = max(int(math.log2(min(seconds / self._seconds, 1e6))), 1)
            self._i_step, self._waited, self._tries = min(self._i_step + n_steps, len(self._steps) - 1), 0, False
        elif seconds < _SHORT_ENOUGH * self._seconds and self._i_step > 0 and self._waited >= self._patience:
            self._i_step, self._waited, self._tries = self._i_step - 1, 0, True
        elif self._tries:
            self._patience, self._tries = 1, False
