"""What Deform asks of the worker; it is answered as Orbit is (see `app.modes.orbit.orbit_messages`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from app.messages.worker_messages import OpenScene, Request, Response, SetCamera
from app.modes.orbit.orbit_messages import EstimateDrawn, OrbitPictureDrawn, Quality

if TYPE_CHECKING:
    from app.document.scene_state import SceneState
    from engine.realtime.zonal_harmonics.gpu_parts import Numbers, PictureExport
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.scene.description import Camera
    from engine.scene.surface_kinds import SurfacesByObject


class PathPreview(NamedTuple):
    """What paths are to show: from where, in how many pixels (width, height), in which poses."""

    camera: Camera
    resolution: tuple[int, int]
    poses: Poses = ()


@dataclass(frozen=True)
class PrepareDeform(Request):
    """From now on draw this scene, whose layers are those that are seen; and make ready the transfer of all objects,
    coarse first. Answered by `OrbitProgress` as often as pictures change by it, by `DeformLoss`, and where
    paths are traced by `PathsTraced`.

    posed: the objects that bend, by name, which have shadows of their own alone. surfaces: what is said of objects'
    surfaces in the place of what the scene's file says. traced: what is to be traced by paths
    after that, as long as nothing else is asked for; each pass of it makes the pictures' version another. n_rays: from
    each point; n_lobes: that stand for what these find.
    """

    built_on = (SetCamera,)

    scene: SceneState
    n_bounces: int = 0
    posed: tuple[str, ...] = ()
    surfaces: SurfacesByObject = ()
    traced: PathPreview | None = None
    n_rays: int = 1000
    n_lobes: int = 4


@dataclass(frozen=True)
class DrawDeform(Request):
    """Draw the scene from a camera, in so many pixels (width, height), in poses, of what is ready; answered by
    `OrbitPictureDrawn` or `OrbitNotReady`. split, fit_error: see `ViewState`. known: where the window draws it itself,
    the numbers of the parts that it has (`engine.realtime.zonal_harmonics.gpu_parts`); then answered by
    `PoseExported`."""

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


@dataclass(frozen=True, eq=False)
class PoseExported(OrbitPictureDrawn):
    """What the window draws a picture of; radiance is empty."""

    export: PictureExport = field(kw_only=True)


@dataclass(frozen=True)
class EstimateDeform(EstimateDrawn):
    """How far off pictures are that `DrawDeform` asks for."""


@dataclass(frozen=True)
class DeformLoss(Response):
    """lost: the share, 0 to 1, of the reflection of objects' sharpest layers that is too sharp for low frequencies, by
    name; of objects that are not matt alone."""

    lost: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class PathsTraced(Response):
    """So many passes of paths are in pictures, of so many that are to be."""

    n_passes: int
    of: int
