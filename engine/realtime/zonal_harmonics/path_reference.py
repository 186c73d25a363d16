"""A pose as paths show it, pass by pass; and that beside Deform's own picture and transfer that does not turn, as three
parts of one [Sloan05, figure 6]."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.zonal_harmonics.deform_engine import LayersOf
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.path_tracer import render_paths
from engine.render.still import StillProgress
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]

N_PASSES, N_SAMPLES = 32, 4  # of so many paths a pixel each
_MISSING = 0.2  # how bright the own picture stands where paths have not come yet


class PathReference:
    """What paths have shown by now: picture (H, W, 3), None before the first pass."""

    def __init__(self, scene: Scene, poses: Poses) -> None:
        """scene: at rest, seen as it is to be traced."""
        self._placement = Placement(pose_scene(scene, poses))
        self.n_passes = 0
        self.picture: Float32Array | None = None

    def trace(self, layers_of: LayersOf, sky: SkyState, n_bounces: int) -> Generator[StillProgress, None, None]:
        """One pass more."""
        found = yield from render_paths(self._placement, layers_of, sky, n_bounces, N_SAMPLES, seed=self.n_passes)
        self.n_passes += 1
        before = np.zeros_like(found) if self.picture is None else self.picture
        self.picture = before + (found - before) / np.float32(self.n_passes)


def compose_split(
    traced: Float32Array | None, stays: Float32Array, own: Float32Array, split: tuple[float, float]
) -> Float32Array:
    """One picture (H, W, 3) of three: up to the first share of its width what paths show, up to the second transfer
    that does not turn, then the own. traced may have other pixels; None: not there yet, so that the own stands dark."""
    height, width = own.shape[:2]
    first, second = (round(share * width) for share in split)
    left = own * np.float32(_MISSING)
    if traced is not None:
        rows, columns = (np.arange(n) * m // n for n, m in zip((height, width), traced.shape, strict=False))
        left = traced[rows[:, None], columns]
    return np.concatenate([left[:, :first], stays[:, first:second], own[:, second:]], axis=1)
