"""What Deform asks of the worker; it is answered as Orbit is (see `app.orbit.messages`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from app.messages import LookFrom, OpenScene, Request, Response
from app.orbit.messages import Quality

if TYPE_CHECKING:
    from app.scene_state import SceneState
    from engine.deform.pose import Poses
    from engine.scene.description import Camera


class Traced(NamedTuple):
    """What paths are to show: from where, in how many pixels (width, height), in which poses."""

    camera: Camera
    resolution: tuple[int, int]
    poses: Poses = ()


@dataclass(frozen=True)
class PrepareDeform(Request):
    """From now on draw this scene, whose layers are those that are seen; and make ready the transfer of all objects,
    coarse first. Answered by `OrbitAdvanced` as often as pictures change by it, and by `DeformKnown`.

    posed: the objects that bend, by name, which have shadows of their own alone. traced: what is to be traced by paths
    after that, as long as nothing else is asked for; each pass of it makes the pictures' version another.
    """

    built_on = (LookFrom,)

    scene: SceneState
    n_bounces: int = 0
    posed: tuple[str, ...] = ()
    traced: Traced | None = None


@dataclass(frozen=True)
class DrawDeform(Request):
    """Draw the scene from a camera, in so many pixels (width, height), in poses, of what is ready; answered by
    `OrbitDrawn` or `OrbitUnknown`. split: see `ViewState`."""

    built_on = (OpenScene,)
    quick = 0
    once = True
    stops = False

    camera: Camera
    resolution: tuple[int, int]
    quality: Quality
    poses: Poses = ()
    split: tuple[float, float] | None = None


@dataclass(frozen=True)
class DeformKnown(Response):
    """lost: the share, 0 to 1, of the reflection of objects' sharpest layers that is too sharp for low frequencies, by
    name; of objects that are not matt alone."""

    lost: tuple[tuple[str, float], ...]
