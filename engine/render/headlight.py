"""Shading before anything is computed: the objects' colours under a light at the camera, without shadows.

The first picture may take a while (a large scene, kernels to be compiled). This shading shows the objects, their places
and approximate colours at once, from the scene's data alone; when the camera moves, from its primary hits.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer

if TYPE_CHECKING:
    from engine.precompute.direct.pipeline import SkyState
    from engine.scene.raycaster import RayCaster
    from engine.scene.scene_loader import Scene

_SIDE = 24
_CAMERA_COSINE = 0.5  # angle in radians between normal and camera at which the colour is evaluated
_SHARPEST = 6.0  # decades over which the lobes' half vectors are sampled, in sin² of their angle
_UNREAD_ALBEDO = 0.5  # for layers whose file the window does not read
_FACING, _AROUND = 0.75, 0.25


def headlight_colour(layers: Iterable[Layer]) -> NDArray[np.float64]:
    """Share of uniform white light that the layers reflect, (3,), each channel at most 1: an approximation for
    display."""
    wi, weight = _directions()
    wo = np.broadcast_to([np.sin(_CAMERA_COSINE), 0.0, np.cos(_CAMERA_COSINE)], wi.shape)
    total = np.zeros(3)
    for layer in layers:
        total += _UNREAD_ALBEDO if layer.model.needs_file else weight @ layer.brdf(wi, wo)
    return np.clip(total, 0.0, 1.0)


def headlight_radiance(colour: NDArray[np.float64], theta_o: NDArray[np.floating]) -> NDArray[np.float32]:
    """Radiance (p, 3) where the normal is at these angles (p,), in radians, to the camera."""
    shade = _AROUND + _FACING * np.cos(theta_o)
    return np.asarray(shade[:, None] * colour, np.float32)


def _directions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors (N, 3) about +Z, and weights (N,) in units of cos θ dω.

    Half of them are uniform in cos θ dω; half are mirror directions about half vectors, uniform in the logarithm of
    sin² of their angle, without which the lobe of polished metal would be missed. Both are weighted by the balance
    heuristic [Veach97, eq. 9.8].
    """
    u, v = (np.arange(_SIDE) + 0.5) / _SIDE, 2 * np.pi * (np.arange(_SIDE) + 0.5) / _SIDE
    sine_squared, azimuth = (each.ravel() for each in np.meshgrid(u, v))
    even = _about_z(sine_squared, azimuth)
    wo = np.array([np.sin(_CAMERA_COSINE), 0.0, np.cos(_CAMERA_COSINE)])
    halfway = _about_z(10.0 ** (-_SHARPEST * (1.0 - sine_squared)), azimuth)
    mirrored = 2.0 * (halfway @ wo)[:, None] * halfway - wo
    wi = np.concatenate([even, mirrored[mirrored[:, 2] > 0.0]])
    # Densities per solid angle, of N² directions each: cos θ / π; and that of half vectors, p(sin² θ) cos θ / π,
    # divided by 4 (wo·h) for the reflected direction [Walter07, eq. 14].
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    s = np.maximum(1.0 - h[:, 2] ** 2, 1e-12)
    by_logarithm = np.where(s >= 10.0**-_SHARPEST, 1.0 / (s * _SHARPEST * np.log(10.0)), 0.0)
    density = wi[:, 2] / np.pi + by_logarithm * h[:, 2] / np.pi / (4.0 * (h @ wo))
    weight = wi[:, 2] / density
    return wi, weight * np.pi / weight.sum()  # ∫ cos θ dω is π


def _about_z(sine_squared: NDArray[np.float64], azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (N, 3) about +Z."""
    sine, cosine = np.sqrt(sine_squared), np.sqrt(1.0 - sine_squared)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)


def headlight_picture(
    scene: Scene, caster: RayCaster, layers: Mapping[int, Sequence[Layer]], sky: SkyState, resolution: tuple[int, int],
    transparent: bool = False,
) -> Generator[None, None, NDArray[np.float32]]:  # fmt: skip
    """Radiance (H, W, 3) of a scene as its camera sees it, in resolution (width, height): its objects with these
    layers, by index, under a light at the camera, its emitters and the sky. In steps. transparent: without the sky, and
    with alpha (H, W, 4)."""
    # Late: the window's process, which needs the colours alone, imports no compiler.
    from engine.render.still import with_alpha
    from engine.scene.picture_frame import picture_frame
    from engine.scene.primary_hits import trace_primary_steps

    hits = yield from trace_primary_steps(scene, caster, resolution)
    frame = picture_frame(hits, scene.camera_position)
    picture = np.array(frame.emission_image, np.float32)
    behind = frame.open_image > 0.0
    if sky.environment is not None and not transparent:
        picture[behind] = sky.scale * sky.environment.evaluate(frame.ray_directions[behind], sky.rotation)
    yield
    points = picture.reshape(-1, 3)
    for index, own in layers.items():
        rows = slice(*frame.object_ranges[index])
        points[frame.pixel[rows]] = headlight_radiance(headlight_colour(own), frame.theta_o[rows])
    return with_alpha(picture, 1.0 - frame.open_image) if transparent else picture
