"""Deform's requests to the worker and their responses; see `app.modes.orbit.orbit_messages` for those it shares."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from app.messages.worker_messages import OpenScene, Request, Response, SetCamera
from app.modes.orbit.orbit_messages import EstimateDrawn, OrbitPictureDrawn, Quality

if TYPE_CHECKING:
    from app.document.scene_state import SceneState
    from app.document.shadow_catchers import CatchersAlone
    from engine.realtime.core.gpu_parts import Numbers, PictureExport
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.scene.description import Camera
    from engine.scene.surface_kinds import SurfacesByObject


class PathPreview(NamedTuple):
    """The path-traced preview: the camera, the resolution (width, height) and the poses."""

    camera: Camera
    resolution: tuple[int, int]
    poses: Poses = ()


@dataclass(frozen=True)
class PrepareDeform(Request):
    """Draw this scene, of visible layers, from now on; precompute the transfer of all objects, coarse first. Answered
    by `OrbitProgress` whenever it changes pictures, by `DeformLoss`, and by `PathsTraced` where paths are traced.

    posed: names of the objects that deform or have moved, which have only shadows of their own; moved: those that have
    moved; lamps: what moves emitters, by name. surfaces: what replaces the scene
    file's settings of objects' surfaces. traced: what is path-traced after that, until another request comes; each pass
    raises the pictures' version. n_rays: from each point; n_lobes: zonal lobes fitted to what these rays find;
    n_gloss_rows: of glossy layers, None for as many as a pilot finds, which `GlossDecided` tells. catchers: see
    `PrepareOrbit`.
    """

    built_on = (SetCamera,)

    scene: SceneState
    n_bounces: int = 0
    posed: tuple[str, ...] = ()
    surfaces: SurfacesByObject = ()
    traced: PathPreview | None = None
    n_rays: int = 1000
    n_lobes: int = 4
    n_gloss_rows: int | None = None
    moved: tuple[str, ...] = ()
    lamps: Poses = ()
    catchers: CatchersAlone | None = None


@dataclass(frozen=True)
class DrawDeform(Request):
    """Draw the scene from a camera, in a resolution (width, height), in poses, of what is ready; answered by
    `OrbitPictureDrawn` or `OrbitNotReady`. split, fit_error: see `ViewState`. sent_parts: where the window draws it
    itself, the numbers of the parts that it has (`engine.realtime.core.gpu_parts`); then answered by
    `PoseExported`. transparent: without the environment, and with alpha."""

    built_on = (OpenScene,)
    priority = 0
    answered_once = True
    is_stopped_by_user = False

    camera: Camera
    resolution: tuple[int, int]
    quality: Quality
    poses: Poses = ()
    split: tuple[float, float] | None = None
    fit_error: bool = False
    sent_parts: Numbers | None = None
    transparent: bool = False


@dataclass(frozen=True, eq=False)
class PoseExported(OrbitPictureDrawn):
    """The parts that the window draws a picture of; radiance is empty."""

    export: PictureExport = field(kw_only=True)


@dataclass(frozen=True)
class EstimateDeform(EstimateDrawn):
    """Estimate the error of pictures that `DrawDeform` requests."""


@dataclass(frozen=True)
class DeformLoss(Response):
    """lost: for each object, by name, the share, 0 to 1, of the reflection of its sharpest layer that is too sharp for
    low frequencies; for objects that are not diffuse only."""

    lost: tuple[tuple[str, float], ...]


class GlossPlan(NamedTuple):
    """How a glossy layer, by its key, is drawn, and why; n_bytes: of its transfer."""

    key: str
    value: str
    reason: str
    n_bytes: int


@dataclass(frozen=True)
class GlossDecided(Response):
    """How the glossy layers are drawn that may be drawn by rows."""

    plans: tuple[GlossPlan, ...]


@dataclass(frozen=True)
class PathsTraced(Response):
    """How many path-tracing passes the pictures have, of how many."""

    n_passes: int
    of: int
