"""Light sampling for the path tracer: directions by brightness, with their densities.

The sky is sampled from a table over its image, emitters by their power and uniformly over their area. Densities are per
steradian and exact; light that a table misses by interpolation or averaging is only sampled less often, because light
found by BRDF sampling has the complementary weight [Veach97, sect. 9.2].
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.light.cones import cone_shares
from engine.light.environment import LUMINANCE, downsample
from engine.precompute.direct.linking import sky_numbers
from engine.precompute.direct.pipeline import SkyState
from engine.scene.emission_textures import emitting_parts
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import between

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]

# Rows of the sky's table: more than a coarse image has, because texels blend, and fewer than one with millions of them.
_FEWEST_ROWS, _MOST_ROWS = 64, 1024


@dataclass(frozen=True)
class LightSamples:
    """Samples (N,) of a light: direction (N, 3), distance (N,) or None for the sky, density per steradian, radiance.

    The density is 0 where a light faces away from the point; such samples do not count.
    """

    wi: Float64Array
    distance: Float64Array | None
    pdf: Float64Array
    radiance: Float64Array


class PathLight(Protocol):
    """A light that the path tracer can sample."""

    def sample(self, points: Float64Array, objects: Rows, u: Float64Array) -> LightSamples:
        """Draw one sample for each of the points (N, 3) on objects (N,), with random numbers u (N, 3) in [0, 1)."""


class SkyLight:
    """An environment sampled by luminance. Its radiance is that of `Environment.evaluate`."""

    def __init__(self, sky: SkyState) -> None:
        if sky.environment is None:
            raise ValueError("the sky has no environment")
        self._environment, self._rotation, self._scale = sky.environment, sky.rotation, sky.scale
        weights = _brightness(sky)
        self._shape = weights.shape
        self._row_tops = np.cos(math.pi * np.arange(len(weights) + 1) / len(weights))
        weights = weights * (self._row_tops[:-1] - self._row_tops[1:])[:, None]
        total = float(weights.sum())
        self._table = np.cumsum(weights.ravel()) / total if total > 0.0 else np.zeros(0)
        share = np.diff(self._table, prepend=0.0).reshape(-1, self._shape[1]) if total > 0.0 else weights
        solid_angle = (self._row_tops[:-1] - self._row_tops[1:]) * (2.0 * math.pi / self._shape[1])
        self._density = share / solid_angle[:, None]

    @property
    def emits(self) -> bool:
        """Whether it emits any light."""
        return len(self._table) > 0

    def sample(self, points: Float64Array, u: Float64Array) -> LightSamples:
        cell = np.minimum(np.searchsorted(self._table, u[:, 0], side="right"), self._table.size - 1)
        row, column = np.divmod(cell, self._shape[1])
        cosine = self._row_tops[row] + u[:, 1] * (self._row_tops[row + 1] - self._row_tops[row])
        phi = 2.0 * math.pi * ((column + u[:, 2]) / self._shape[1] - 0.5) - math.radians(self._rotation % 360.0)
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        wi = np.stack([sine * np.sin(phi), cosine, -sine * np.cos(phi)], axis=1)
        return LightSamples(wi, None, self._density[row, column], self.radiance(wi))

    def pdf(self, wi: Float64Array) -> Float64Array:
        """Density (N,) with which `sample` draws directions (N, 3)."""
        height, width = self._shape
        row = np.arctan2(np.hypot(wi[:, 0], wi[:, 2]), wi[:, 1]) * (height / math.pi)
        phi = np.arctan2(wi[:, 0], -wi[:, 2]) + math.radians(self._rotation % 360.0)
        column = np.floor((phi / (2.0 * math.pi) + 0.5) * width).astype(np.int64) % width
        return self._density[np.clip(row.astype(np.int64), 0, height - 1), column]

    def radiance(self, wi: Float64Array) -> Float64Array:
        """Radiance that arrives from directions (N, 3)."""
        return self._environment.evaluate(wi, self._rotation).astype(np.float64) * self._scale


class LinkedSky:
    """The distant light that reaches each object (M,): all of it, or that of the object's link."""

    def __init__(self, sky: SkyState, n_objects: int) -> None:
        skies = (sky, *(link.sky for link in sky.links))
        lights = [None if each.environment is None else SkyLight(each) for each in skies]
        self._lights = [light if light is not None and light.emits else None for light in lights]
        self._numbers = sky_numbers(sky, n_objects)

    @property
    def emits(self) -> bool:
        """Whether any light reaches any object."""
        return any(light is not None for light in self._lights)

    def sample(self, points: Float64Array, objects: Rows, u: Float64Array) -> LightSamples:
        """A direction for each of the points; density 0 where no light reaches the object."""
        n = len(points)
        wi, pdf, radiance = np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
        for light, rows in self._rows(objects):
            drawn = light.sample(points[rows], u[rows])
            wi[rows], pdf[rows], radiance[rows] = drawn.wi, drawn.pdf, drawn.radiance
        return LightSamples(wi, None, pdf, radiance)

    def pdf(self, objects: Rows, wi: Float64Array) -> Float64Array:
        """Density (N,) with which `sample` draws directions (N, 3) at objects (N,)."""
        density = np.zeros(len(wi))
        for light, rows in self._rows(objects):
            density[rows] = light.pdf(wi[rows])
        return density

    def radiance(self, objects: Rows, wi: Float64Array) -> Float64Array:
        """Radiance (N, 3) that reaches objects (N,) from directions (N, 3)."""
        found = np.zeros((len(wi), 3))
        for light, rows in self._rows(objects):
            found[rows] = light.radiance(wi[rows])
        return found

    def _rows(self, objects: Rows) -> Iterator[tuple[SkyLight, Rows]]:
        numbers = self._numbers[objects]
        for i, light in enumerate(self._lights):
            if light is not None and len(rows := np.flatnonzero(numbers == i)):
                yield light, rows


class EmitterLight:
    """All emitting triangles, in parts that are sampled by power and uniformly over their area; they radiate from their
    front, as their textures say at the very point. reach (M, M): which objects each lights, None for all."""

    def __init__(self, scene: Scene, reach: NDArray[np.bool_] | None = None) -> None:
        self._scene, self._parts, self._reach = scene, emitting_parts(scene), reach
        power = self._parts.power
        self._table = np.cumsum(power) / power.sum() if power.any() else np.zeros(0)
        self._by_area = np.diff(self._table, prepend=0.0) / self._parts.area if power.any() else np.zeros(0)

    @property
    def emits(self) -> bool:
        """Whether there is any emitter."""
        return len(self._table) > 0

    def sample(self, points: Float64Array, objects: Rows, u: Float64Array) -> LightSamples:
        scene, parts = self._scene, self._parts
        which = np.minimum(np.searchsorted(self._table, u[:, 0], side="right"), len(self._table) - 1)
        root = np.sqrt(u[:, 1])  # uniform over a triangle
        weights = np.stack([1.0 - root, root * (1.0 - u[:, 2]), root * u[:, 2]], axis=1)
        triangle, (along, across) = parts.triangle[which], np.einsum("nk,nki->in", weights, parts.corners[which])
        place = between(scene.vertices[scene.triangles[triangle]], along, across)
        towards = place - points
        distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-12)
        wi = towards / distance[:, None]
        facing = -np.einsum("ni,ni->n", wi, scene.geometric_normals[triangle].astype(np.float64))
        owner = scene.object_of_triangle[triangle]
        radiance = scene.emission[owner].astype(np.float64) * cone_shares(scene.cones[owner], wi)[:, None]
        radiance *= scene.emission_textures.at(triangle, along, across)
        if scene.cutouts.passable.any():  # rays end before the surface, whether it is there or not
            radiance *= scene.cutouts.opacity_at(triangle, along, across)[:, None]
        if self._reach is not None:
            radiance[~self._reach[owner, objects]] = 0.0
        return LightSamples(wi, distance, _by_solid_angle(self._by_area[which], distance, facing), radiance)

    def pdf(self, found: Intersections, wi: Float64Array) -> Float64Array:
        """Density (N,) with which `sample` draws wi (N, 3), whose rays hit triangles of the scene."""
        part = self._parts.find(found.triangle, found.u, found.v)
        by_area = np.where(part >= 0, self._by_area[part], 0.0) if self.emits else np.zeros(len(part))
        facing = -np.einsum("ni,ni->n", wi, self._scene.geometric_normals[found.triangle].astype(np.float64))
        return _by_solid_angle(by_area, found.distance.astype(np.float64), facing)


def _by_solid_angle(by_area: Float64Array, distance: Float64Array, facing: Float64Array) -> Float64Array:
    """Convert a density per square metre to one per steradian; 0 from behind."""
    return np.where(facing > 1e-9, by_area * distance * distance / np.maximum(facing, 1e-9), 0.0)


def _brightness(sky: SkyState) -> Float64Array:
    """Luminance on a regular (H, W) lat-long grid, blurred by one cell, because interpolation extends beyond texels."""
    assert sky.environment is not None
    small = downsample(sky.environment, _MOST_ROWS)
    repeat = -(-_FEWEST_ROWS // len(small.radiance))
    across = max(repeat, -(-2 * _FEWEST_ROWS // small.radiance.shape[1]))
    height, width = len(small.radiance) * repeat, small.radiance.shape[1] * across
    theta, phi = np.meshgrid(
        math.pi * (np.arange(height) + 0.5) / height, 2.0 * math.pi * ((np.arange(width) + 0.5) / width - 0.5),
        indexing="ij",
    )  # fmt: skip
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=2)
    luminance = (small.evaluate(d.reshape(-1, 3)).astype(np.float64) @ LUMINANCE).reshape(height, width)
    rows = np.pad(luminance, ((1, 1), (0, 0)), mode="edge")
    blurred = (rows[:-2] + rows[1:-1] + rows[2:]) / 3.0
    blurred = (np.roll(blurred, 1, axis=1) + blurred + np.roll(blurred, -1, axis=1)) / 3.0
    return 0.5 * (luminance + blurred)
