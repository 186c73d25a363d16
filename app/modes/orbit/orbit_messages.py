"""Orbit's requests to the worker and their responses (see `app.messages.worker_messages`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import OpenScene, Request, Response, SetCamera

if TYPE_CHECKING:
    from app.document.scene_state import SceneState
    from app.document.shadow_catchers import CatchersAlone
    from engine.realtime.core.gpu_parts import OrbitPart
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.render.picture_error import ErrorEstimate
    from engine.scene.description import Camera

AnimationOffsets = tuple[tuple[str, tuple[float, float, float]], ...]
Quality = Literal["moving", "rest"]


@dataclass(frozen=True)
class PrepareOrbit(Request):
    """Draw this scene, of visible layers, from now on; precompute all that pictures are drawn of, coarse first.
    Answered by `OrbitProgress` whenever it changes pictures. n_bounces: reflections between light and camera; 0: as
    many as the engine takes. listener: the number of a window that draws moving pictures itself, to which all parts are
    exported before that by `OrbitPartExported`; a new number has received nothing; 0: nobody. most_bytes: of any one
    array. n_points: beside the meshes' own; n_coefficients: of light stored at each. poses: of objects; where these are
    not those of the traced view, but differ by transforms alone, what is ready follows them coarsely. catchers: shadow
    catchers, of which pictures show only the shadows on them as soon as these are drawn alone as well.

    Another camera cancels it, because tracing a camera goes before anything slow; what is ready stays.
    """

    built_on = (SetCamera,)

    scene: SceneState
    n_bounces: int = 0
    listener: int = 0
    most_bytes: int = 0
    n_points: int = 40_000
    n_coefficients: int = 320
    poses: Poses = ()
    catchers: CatchersAlone | None = None


@dataclass(frozen=True)
class PrioritizeView(Request):
    """Make ready first what this camera sees, though no picture is requested. Answered by `OrbitProgress` where it sees
    parts that are not ready, such as back faces."""

    built_on = (OpenScene,)
    priority = 1
    answered_once = True
    is_stopped_by_user = False

    camera: Camera


@dataclass(frozen=True)
class DrawOrbit(Request):
    """Draw the scene from a camera, in a resolution (width, height), of what is ready, while something moves with so
    many coefficients of light per point; transparent: without the environment, and with alpha. Answered by
    `OrbitPictureDrawn` or `OrbitNotReady`. It needs only the open scene: a camera is drawn long before its view is
    traced."""

    built_on = (OpenScene,)
    priority = 0
    answered_once = True
    served_anytime = True
    is_stopped_by_user = False

    camera: Camera
    resolution: tuple[int, int]
    quality: Quality
    n_coefficients: int = 64
    transparent: bool = False


@dataclass(frozen=True)
class DrawHeadlight(Request):
    """Draw the scene from a camera, in a resolution (width, height), in poses (None: as it is open), of nothing that is
    precomputed: its objects lit from the camera; transparent: see `DrawOrbit`. Answered by `OrbitPictureDrawn` of
    version 0, or `OrbitNotReady` where no scene is open yet. It needs no traced view, as `DrawOrbit`."""

    built_on = (OpenScene,)
    priority = 0
    answered_once = True
    served_anytime = True
    is_stopped_by_user = False

    camera: Camera
    resolution: tuple[int, int]
    scene: SceneState
    poses: Poses | None = None
    transparent: bool = False


@dataclass(frozen=True)
class EstimateDrawn(Request):
    """Estimate the error of two pictures of the open view: as drawn when idle, and while something moves. scene,
    n_bounces: what they show, see `PrepareOrbit`; has_map: with an error map of the former. Answered by
    `DrawnErrorEstimated`. Each mode that draws in the worker has its own subclass."""

    built_on = (SetCamera,)
    priority = 8
    answered_once = True
    is_stopped_by_user = False
    is_foreground = False

    scene: SceneState
    n_bounces: int
    at_rest: Request
    moving: Request
    has_map: bool = False


@dataclass(frozen=True)
class EstimateOrbit(EstimateDrawn):
    """Estimate the error of pictures that `DrawOrbit` requests."""


@dataclass(frozen=True, eq=False)
class DrawnErrorEstimated(Response):
    """The error of the idle picture, and of those while something moves; colours: see `ErrorEstimated`."""

    at_rest: ErrorEstimate
    moving: ErrorEstimate
    colours: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class OrbitProgress(Response):
    """Pictures drawn now differ from those of a lower `version`; is_done: no further version follows; n_bytes: memory
    held for them; follows_move: see `OrbitPictureDrawn`."""

    version: int
    is_done: bool
    n_bytes: int = 0
    follows_move: bool = False


@dataclass(frozen=True, eq=False)
class OrbitPartExported(Response):
    """A part of what moving pictures are drawn of, see `engine.realtime.core.gpu_parts`."""

    part: OrbitPart


@dataclass(frozen=True)
class OrbitNotReady(Response):
    """Nothing can be drawn: what was ready is lost with another worker, or with a scene opened anew."""


@dataclass(frozen=True, eq=False)
class OrbitPictureDrawn(Response):
    """Linear radiance (H, W, 3), or with alpha (H, W, 4), without the light's intensity, and the seconds that drawing
    took; `prepared` is the number of the last `PrepareOrbit`, version and is_done are as in `OrbitProgress`;
    animation_offsets: how far animations have moved whole objects in it, by name: x, y, z; follows_move: whether
    objects were moved since it was prepared what pictures are drawn of, which follows coarsely and is not exported;
    are_caught: whether shadows are shown in place of their catchers."""

    radiance: NDArray[np.float32]
    prepared: int
    version: int
    is_done: bool
    seconds: float
    animation_offsets: AnimationOffsets = ()
    follows_move: bool = False
    are_caught: bool = False
