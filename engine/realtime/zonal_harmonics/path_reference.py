"""A path-traced picture of a pose, pass by pass, and its comparison with Deform's own picture and with transfer that
does not rotate, as three parts of one picture [Sloan05, figure 6]."""

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

N_PASSES, N_SAMPLES = 32, 4  # passes of so many paths a pixel each
_MISSING = 0.2  # brightness of the own picture where no paths have arrived yet


class PathReference:
    """The accumulated path-traced picture (H, W, 3), None before the first pass."""

    def __init__(self, scene: Scene, poses: Poses) -> None:
        """scene: at rest, with the camera to trace from."""
        self._placement = Placement(pose_scene(scene, poses))
        self.n_passes = 0
        self.picture: Float32Array | None = None

    def trace(self, layers_of: LayersOf, sky: SkyState, n_bounces: int) -> Generator[StillProgress, None, None]:
        """Trace one more pass."""
        found = yield from render_paths(self._placement, layers_of, sky, n_bounces, N_SAMPLES, seed=self.n_passes)
        self.n_passes += 1
        before = np.zeros_like(found) if self.picture is None else self.picture
        self.picture = before + (found - before) / np.float32(self.n_passes)


def compose_split(
    traced: Float32Array | None, stays: Float32Array, own: Float32Array, split: tuple[float, float]
) -> Float32Array:
    """Compose one picture (H, W, 3) of three: up to the first share of its width the traced one, up to the second
    transfer that does not rotate, then the own. traced may have another resolution; None: not available yet, shown as a
    darkened own picture."""
    height, width = own.shape[:2]
    first, second = (round(share * width) for share in split)
    left = own * np.float32(_MISSING)
    if traced is not None:
        rows, columns = (np.arange(n) * m // n for n, m in zip((height, width), traced.shape, strict=False))
        left = traced[rows[:, None], columns]
    return np.concatenate([left[:, :first], stays[:, first:second], own[:, second:]], axis=1)
