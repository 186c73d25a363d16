"""What Orbit asks of the worker, and what it is answered (see `app.messages.worker_messages`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import OpenScene, Request, Response, SetCamera

if TYPE_CHECKING:
    from app.document.scene_state import SceneState
    from engine.realtime.triple_product.gpu_parts import Part
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.render.picture_error import ErrorEstimate
    from engine.scene.description import Camera

AnimationOffsets = tuple[tuple[str, tuple[float, float, float]], ...]
Quality = Literal["moving", "rest"]


@dataclass(frozen=True)
class PrepareOrbit(Request):
    """From now on draw this scene, whose layers are those that are seen; and make ready all that pictures are drawn of,
    coarse first. Answered by `OrbitProgress` as often as pictures change by it. n_bounces: reflections between light
    and eye; 0: as many as the engine takes. listener: who draws moving pictures itself, and is told all that they are
    drawn of by `OrbitPartExported` before that; another number has been told nothing; 0: nobody. most_bytes: of any one
    array. n_points: beside the meshes' own; n_coefficients: of light that each keeps.

    Another camera cancels it, for a camera is traced before anything slow goes on; what it has made ready stays.
    """

    built_on = (SetCamera,)

    scene: SceneState
    n_bounces: int = 0
    listener: int = 0
    most_bytes: int = 0
    n_points: int = 40_000
    n_coefficients: int = 320


@dataclass(frozen=True)
class PrioritizeView(Request):
    """What this camera sees is to be made ready first, though no picture is asked for. Answered by `OrbitProgress`
    where it sees what nothing was made ready for, such as backs."""

    built_on = (OpenScene,)
    priority = 1
    answered_once = True
    is_stopped_by_user = False

    camera: Camera


@dataclass(frozen=True)
class DrawOrbit(Request):
    """Draw the scene from a camera, in so many pixels (width, height), of what is ready, while something moves by so
    many coefficients of light a point; answered by `OrbitPictureDrawn` or `OrbitNotReady`. Built on the scene alone: a
    camera is drawn long before what it sees has been traced."""

    built_on = (OpenScene,)
    priority = 0
    answered_once = True
    served_anytime = True
    is_stopped_by_user = False

    camera: Camera
    resolution: tuple[int, int]
    quality: Quality
    n_coefficients: int = 64


@dataclass(frozen=True)
class DrawHeadlight(Request):
    """Draw the scene from a camera, in so many pixels (width, height), in poses, None: as it is open, of nothing that
    has to be made ready: its objects in light from the eye. Answered by `OrbitPictureDrawn` of version 0, or
    `OrbitNotReady` where no scene is open yet. Not built on what was traced, as `DrawOrbit`."""

    built_on = (OpenScene,)
    priority = 0
    answered_once = True
    served_anytime = True
    is_stopped_by_user = False

    camera: Camera
    resolution: tuple[int, int]
    scene: SceneState
    poses: Poses | None = None


@dataclass(frozen=True)
class EstimateDrawn(Request):
    """Say how far off two pictures of the view that is open are: as they are drawn at rest, and while something moves.
    scene, n_bounces: what they show, see `PrepareOrbit`; has_map: with where the former is off. Answered by
    `DrawnErrorEstimated`. Each mode that draws in the worker has a kind of its own."""

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
    """Of pictures that `DrawOrbit` asks for."""


@dataclass(frozen=True, eq=False)
class DrawnErrorEstimated(Response):
    """How far off the picture at rest is, and those while something moves; colours: see `ErrorEstimated`."""

    at_rest: ErrorEstimate
    moving: ErrorEstimate
    colours: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class OrbitProgress(Response):
    """Pictures drawn now are others than under a lower `version`; is_done: they are the last; n_bytes: what is
    kept for them."""

    version: int
    is_done: bool
    n_bytes: int = 0


@dataclass(frozen=True, eq=False)
class OrbitPartExported(Response):
    """A part of what moving pictures are drawn of, see `engine.realtime.triple_product.gpu_parts`."""

    part: Part


@dataclass(frozen=True)
class OrbitNotReady(Response):
    """There is nothing to draw of: what was made ready has gone with another worker, or with a scene opened anew."""


@dataclass(frozen=True, eq=False)
class OrbitPictureDrawn(Response):
    """Linear radiance (H, W, 3) without the light's intensity, drawn in so many seconds of what was ready; `prepared`
    is the number of the `PrepareOrbit` that was heard last, version and is_done are as in `OrbitProgress`; carried: how
    far animations have carried objects as wholes in it, by name: x, y, z."""

    radiance: NDArray[np.float32]
    prepared: int
    version: int
    is_done: bool
    seconds: float
    animation_offsets: AnimationOffsets = ()
