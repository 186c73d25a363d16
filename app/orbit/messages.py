"""What Orbit asks of the worker, and what it is answered (see `app.messages`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from app.messages import LookFrom, OpenScene, Request, Response

if TYPE_CHECKING:
    from app.scene_state import SceneState
    from engine.scene.description import Camera

Quality = Literal["moving", "rest"]


@dataclass(frozen=True)
class PrepareOrbit(Request):
    """From now on draw this scene, whose layers are those that are seen; and make ready all that pictures are drawn of,
    coarse first. Answered by `OrbitAdvanced` as often as pictures change by it. n_bounces: reflections between light
    and eye; 0: as many as the engine takes.

    Another camera cancels it, for a camera is traced before anything slow goes on; what it has made ready stays.
    """

    built_on = (LookFrom,)

    scene: SceneState
    n_bounces: int = 0


@dataclass(frozen=True)
class DrawOrbit(Request):
    """Draw the scene from a camera, in so many pixels (width, height), of what is ready, while something moves by so
    many coefficients of light a point; answered by `OrbitDrawn` or `OrbitUnknown`. Built on the scene alone: a camera
    is drawn long before what it sees has been traced."""

    built_on = (OpenScene,)
    quick = 0
    once = True
    stops = False

    camera: Camera
    resolution: tuple[int, int]
    quality: Quality
    n_coefficients: int = 64


@dataclass(frozen=True)
class OrbitAdvanced(Response):
    """Pictures drawn now are others than under a lower `version`; is_done: they are the last; n_bytes: what is
    kept for them."""

    version: int
    is_done: bool
    n_bytes: int = 0


@dataclass(frozen=True)
class OrbitUnknown(Response):
    """There is nothing to draw of: what was made ready has gone with another worker, or with a scene opened anew."""


@dataclass(frozen=True, eq=False)
class OrbitDrawn(Response):
    """Linear radiance (H, W, 3) without the light's intensity, drawn in so many seconds of what was ready; `prepared`
    is the number of the `PrepareOrbit` that was heard last, version and is_done are as in `OrbitAdvanced`."""

    radiance: NDArray[np.float32]
    prepared: int
    version: int
    is_done: bool
    seconds: float
