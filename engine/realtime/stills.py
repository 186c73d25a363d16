"""Stills by Orbit's and Deform's methods, and a path-traced picture of a pose to compare with."""

from __future__ import annotations

from collections.abc import Collection, Generator

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.core.terms import LayersOf
from engine.realtime.triple_product.orbit_engine import MOST_BYTES, MOST_SLICE_BYTES, N_COEFFICIENTS, N_POINTS, Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.still import render_paths
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]

_DRAWING = 0.97  # progress when drawing begins
N_PASSES, N_SAMPLES = 32, 4  # passes of so many paths a pixel each
_MISSING = 0.2  # brightness of the own picture where no paths have arrived yet


def render_orbit(
    placement: Placement,
    layers_of: LayersOf,
    sky: SkyState,
    n_patches: int,
    n_points: int = N_POINTS,
    n_coefficients: int = N_COEFFICIENTS,
    n_bounces: int = 1,
    most_bytes: int = MOST_BYTES,
    most_slice_bytes: int = MOST_SLICE_BYTES,
    transparent: bool = False,
    apart: Collection[int] = (),
) -> Generator[StillProgress, None, Float32Array]:
    """Render radiance (H, W, 3) after up to n_bounces reflections, as Orbit shows it at rest; yield the progress.

    layers_of: the layers of each object, by its index; most_bytes and most_slice_bytes: limits for the points' data and
    for the slices, see `Orbit`; transparent: without the sky, and with alpha (H, W, 4); apart: see `Orbit.draw`.
    """
    orbit = Orbit(placement.scene, placement.caster, n_points, n_coefficients, n_patches, most_bytes, most_slice_bytes)
    orbit.set_light(sky)
    orbit.set_layers(layers_of)
    orbit.set_bounces(n_bounces)
    camera, resolution = placement.scene.description.camera, placement.hits.resolution
    for step in orbit.work():
        yield StillProgress(_DRAWING * step.fraction, step.text)
    picture = orbit.draw(camera, resolution, "still", transparent=transparent, apart=apart)
    if not orbit.is_done:  # the picture shows the backs of some objects
        for step in orbit.work():
            yield StillProgress(_DRAWING * step.fraction, step.text)
        picture = orbit.draw(camera, resolution, "still", transparent=transparent, apart=apart)
    return picture


def render_deform(
    deform: Deform, resolution: tuple[int, int], transparent: bool = False, apart: Collection[int] = ()
) -> Generator[StillProgress, None, Float32Array]:
    """Render radiance (H, W, 3) of a scene as Deform shows it at rest; yields the progress. transparent: without the
    sky, and with alpha (H, W, 4); apart: see `Deform.draw`."""
    yield from deform.work()
    camera = deform.scene.description.camera
    return deform.draw(camera, resolution, (), "rest", transparent=transparent, apart=apart)


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
