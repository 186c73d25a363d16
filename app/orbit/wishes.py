"""What Orbit wants of the worker, and what it has: the values that `talk` compares."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.document import Document
from app.orbit.messages import Quality
from app.scene_state import LayerState, SceneState, scene_state
from app.solo import is_seen
from app.view_state import Viewpoint, ViewState
from engine.deform.pose import Poses

# Seconds that a picture may take while something moves; fewer pixels are drawn where it takes longer.
MOVING_SECONDS = 0.04
# Shares of the picture's sides.
SCALES = (1.0, 0.75, 0.5, 0.375, 0.25)
_TOO_LONG, _SHORT_ENOUGH = 1.3, 0.8


@dataclass(frozen=True)
class OrbitWish:
    """All that pictures are drawn of, but for the camera: equal wishes have equal pictures. The scene has the layers
    that are seen alone."""

    scene: SceneState
    n_bounces: int

    @classmethod
    def of(cls, document: Document, view: ViewState) -> OrbitWish:
        scene = scene_state(document)
        seen = (each for each in scene.layers if is_seen(document, view, each.key))
        layers = tuple(LayerState(each.key, each.layer.replace(visible=True)) for each in seen)
        return cls(replace(scene, layers=layers), view.n_bounces)


@dataclass(frozen=True)
class Known:
    """How far the worker has made ready what the request `prepared` asked for: see `OrbitAdvanced`."""

    prepared: int = 0
    version: int = 0
    is_done: bool = False


@dataclass(frozen=True)
class Drawing:
    """A picture that was asked for, or has come: from where, in how many pixels (width, height), how well, of what, and
    in which poses."""

    look: Viewpoint
    resolution: tuple[int, int]
    quality: Quality
    made_of: Known = Known()
    poses: Poses = ()

    def is_as_good_as(self, other: Drawing) -> bool:
        """Whether it shows the same, in as many pixels and as well."""
        if (self.look, self.made_of, self.poses) != (other.look, other.made_of, other.poses):
            return False
        return self.resolution >= other.resolution and (self.quality == "rest" or other.quality == "moving")


class Pace:
    """How many pixels a moving picture has: as many as are drawn in time."""

    def __init__(self) -> None:
        self._i_scale = SCALES.index(0.5)

    def resolution(self, whole: tuple[int, int]) -> tuple[int, int]:
        """Of a picture whose whole resolution (width, height) is given."""
        scale = SCALES[self._i_scale]
        return max(round(scale * whole[0]), 1), max(round(scale * whole[1]), 1)

    def took(self, seconds: float) -> None:
        """A moving picture took so long."""
        if seconds > _TOO_LONG * MOVING_SECONDS:
            self._i_scale = min(self._i_scale + 1, len(SCALES) - 1)
        elif self._i_scale > 0:
            larger = (SCALES[self._i_scale - 1] / SCALES[self._i_scale]) ** 2
            self._i_scale -= seconds * larger < _SHORT_ENOUGH * MOVING_SECONDS
