"""The lobe at a point of the picture: the share of light from each direction that a surface reflects to the camera, as
a shape in space.

Its radius towards wi is brdf(wi, wo) cos theta_i, with wo to the camera, at most 1. Directions lie on rings of half
vectors about the normal, denser near the normal, so that a narrow highlight has as much of the shape as a wide one. The
shape is centred on the point and has a fixed size on screen: its distance along the ray to the camera does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import project
from engine.scene.description import Camera
from ui.gl.brdf_stack import BrdfStack

Float64Array = NDArray[np.float64]

N_AZIMUTHS = 36
RINGS = np.concatenate([[1e-4], np.geomspace(4e-3, 0.12, 8), np.linspace(0.17, 1.5, 15)])
DECADES = 4.0


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """The surface that the camera sees at a pixel: the frame (t, b, n) as rows (3, 3), and the ray from the camera
    (3,), in the world."""

    column: int
    row: int
    frame: Float64Array
    ray: Float64Array
    camera: Camera
    resolution: tuple[int, int]


@dataclass(frozen=True, eq=False)
class SurfaceLobe:
    """The shape: unit directions (R, A, 3) in the world, their radii (R, A) of at most 1, and colours (R, A, 3)."""

    point: SurfacePoint
    directions: Float64Array
    radii: Float64Array
    colours: Float64Array

    def pixels(self, size: float) -> Float64Array:
        """Its points in the picture, (R, A, 2) in pixels, its longest radius at most `size` pixels long."""
        point = self.point
        _, height = point.resolution
        unit = size * 2.0 * np.tan(np.radians(point.camera.fov_y) / 2.0) / height
        return project(point.camera, point.resolution, point.ray + unit * self.radii[..., None] * self.directions)

    @cached_property
    def order(self) -> NDArray[np.int64]:
        """The faces between rings and azimuths (R-1, A), flattened, farthest from the camera first."""
        depth = self.radii * (self.directions @ self.point.ray)
        return np.argsort(-_of_faces(depth).ravel(), kind="stable")

    @cached_property
    def shades(self) -> Float64Array:
        """Colours of the faces (R-1, A, 3): brightest where they face the camera."""
        place = self.radii[..., None] * self.directions
        one = np.roll(place[1:], -1, axis=1) - place[:-1]
        two = place[1:] - np.roll(place[:-1], -1, axis=1)
        normal = np.cross(one, two)
        length = np.linalg.norm(normal, axis=2)
        facing = np.abs(normal @ self.point.ray) / np.maximum(length, 1e-12)
        return _of_faces(self.colours) * (0.35 + 0.65 * facing)[..., None]


def _of_faces(values: Float64Array) -> Float64Array:
    """Means over the corners of the faces."""
    beside = np.roll(values, -1, axis=1)
    return np.asarray(0.25 * (values[:-1] + values[1:] + beside[:-1] + beside[1:]))


def surface_lobe(stack: BrdfStack, point: SurfacePoint, logarithmic: bool) -> SurfaceLobe:
    """The shape for the layers of a stack; logarithmic radii span four decades. Waits for the GPU."""
    wo = -(point.frame @ point.ray)
    phi = np.arange(N_AZIMUTHS) * (2.0 * np.pi / N_AZIMUTHS)
    sine, cosine = np.sin(RINGS)[:, None], np.cos(RINGS)[:, None]
    half = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(cosine, (len(RINGS), N_AZIMUTHS))], -1)
    wi = 2.0 * (half @ wo)[..., None] * half - wo
    flat = wi.reshape(-1, 3)
    values = stack.evaluate(flat, np.broadcast_to(wo, flat.shape)) * np.maximum(flat[:, 2:], 0.0)
    values = values.reshape(wi.shape)
    strength = values.max(axis=2)
    largest = max(float(strength.max()), 1e-30)
    share = strength / largest
    if logarithmic:
        share = np.maximum(1.0 + np.log10(np.maximum(share, 1e-12)) / DECADES, 0.0)
    colours = values / np.maximum(strength, 1e-30)[..., None]
    return SurfaceLobe(point, wi @ point.frame, share, colours)
