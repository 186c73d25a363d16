"""Detail on an object's texture coordinates, shaded pixel by pixel: patches of height fields, and wrinkles [Sloan05,
6].

Its lobes are in axes along u and v, which are computed from the bent mesh. It shades only itself: shadows of the rest
of the object on it are ignored.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import orthonormal
from engine.material.layer_maps import Images
from engine.realtime.zonal_harmonics.patches import (
    N_TEXELS,
    PATTERNS,
    Patch,
    Slab,
    heights_of_image,
    patch,
    simulate_patch,
)
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes, lobes, shade
from engine.realtime.zonal_harmonics.transfer import Medium
from engine.realtime.zonal_harmonics.wrinkle import SIDE, wrinkles
from engine.realtime.zonal_harmonics.wrinkle import Wrinkles as WrinkleMap
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.scene_loader import Scene
from engine.scene.surface_kinds import DeformSurface
from engine.scene.surface_kinds import Detail as PatchSays
from engine.scene.surface_kinds import Wrinkles as WrinklesSay

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LobeMap:
    """Lobes for look-ups by shaders (H, W, ...), v upwards, in axes along u, along v, outwards.

    repeats: along u and v. is_smooth: lobes are interpolated between entries and their axes normalized; otherwise the
    nearest entry's are taken. A smooth map has one column, and the sum of u and v times repeats runs along its rows,
    first to last.
    """

    lobes: Lobes
    repeats: tuple[float, float]
    is_smooth: bool


class Detail(Protocol):
    """Lobes by texture coordinates."""

    def at(self, uvs: Float64Array) -> Lobes:
        """Lobes at (P, 2), in axes along u, along v, outwards."""

    def errors_at(self, uvs: Float64Array) -> Float64Array:
        """Errors (P,) relative to the vectors that they were fitted to."""

    def map(self) -> LobeMap:
        """All lobes."""


class PatchDetail(Detail):
    """A patch that repeats."""

    def __init__(self, found: Patch, repeats: tuple[float, float]) -> None:
        self._patch, self._repeats = found, repeats

    def at(self, uvs: Float64Array) -> Lobes:
        return self._patch.at(uvs * self._repeats)

    def errors_at(self, uvs: Float64Array) -> Float64Array:
        return self._patch.errors_at(uvs * self._repeats)

    def map(self) -> LobeMap:
        found = self._patch
        return LobeMap(Lobes(found.low, found.axes, found.coefficients), self._repeats, False)


class WrinkleDetail(Detail):
    """Grooves across u or v."""

    def __init__(self, found: WrinkleMap, surface: WrinklesSay) -> None:
        self._map, self._surface = found, surface

    def at(self, uvs: Float64Array) -> Lobes:
        return lobes(self._on_surface(self._lobes_at(uvs)))

    def errors_at(self, uvs: Float64Array) -> Float64Array:
        return self._lobes_at(uvs).relative_errors

    def map(self) -> LobeMap:
        one, surface = lobes(self._on_surface(self._map.of_depth(self._surface.depth))), self._surface
        column = Lobes(*(each[:, None] for each in (one.low, one.axes, one.coefficients)))
        return LobeMap(column, (surface.repeats, 0.0) if surface.across == "u" else (0.0, surface.repeats), True)

    def _on_surface(self, found: Zonal) -> Zonal:
        """Express lobes in axes along u, along v, outwards."""
        if self._surface.across == "u":
            return found
        return found.rotate([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # across and along it are v and -u

    def _lobes_at(self, uvs: Float64Array) -> Zonal:
        places = uvs[:, 0 if self._surface.across == "u" else 1] * self._surface.repeats
        return self._map.at(places, np.full(len(uvs), self._surface.depth))


def heights(scene: Scene, surface: PatchSays) -> Float64Array:
    """Height field (H, W), in units of the patch's side; an image is reduced to the largest allowed number of
    texels."""
    if surface.kind is not None:
        return PATTERNS[surface.kind]() * surface.height
    image = scene.textures.weight(Images(weight=surface.file or ""))
    assert image is not None
    coarse = next(each for each in image.levels if max(each.shape[:2]) <= N_TEXELS)[..., 0]
    whole = np.tile(coarse, [2 if n == 1 else 1 for n in coarse.shape])
    return heights_of_image(whole) * surface.height


def slab_of(surface: PatchSays) -> Slab | None:
    """The slab below a patch; None if it is opaque."""
    if not surface.thickness:
        return None
    return Slab(Medium(surface.scattering, surface.absorption, surface.ior), surface.thickness)


def patch_vectors(
    scene: Scene, surface: PatchSays, n: int, albedo: float, n_bounces: int, n_rays: int
) -> Generator[float, None, Float64Array]:
    """Vectors of a patch's texels, row by row, see `simulate_patch`. Yields the share that is done."""
    return (yield from simulate_patch(heights(scene, surface), n, albedo, n_bounces, slab_of(surface), n_rays))


def wrinkle_lobes(n: int, albedo: float, n_bounces: int) -> Generator[float, None, Zonal]:
    """Lobes of a map of wrinkles, row by row, see `wrinkles`. Yields the share that is done."""
    found = yield from wrinkles(n, albedo=albedo, n_bounces=n_bounces)
    maps = (found.low, found.axes, found.coefficients, found.errors)
    return Zonal(*(each.reshape(-1, *each.shape[2:]) for each in maps))


def n_texels(scene: Scene, surface: DeformSurface) -> int:
    """Number of a patch's texels, or of nodes of a map of wrinkles, that have lobes."""
    return SIDE * SIDE if surface.patch is None else heights(scene, surface.patch).size


def detail(scene: Scene, surface: DeformSurface, zonal: Zonal) -> Detail:
    """Make the detail from lobes of `n_texels`."""
    if surface.wrinkles is not None:
        maps = (zonal.low, zonal.axes, zonal.coefficients, zonal.errors)
        of_nodes = (each.reshape(SIDE, SIDE, *each.shape[1:]).astype(np.float64) for each in maps)
        return WrinkleDetail(WrinkleMap(*of_nodes), surface.wrinkles)
    assert surface.patch is not None
    height, width = heights(scene, surface.patch).shape
    return PatchDetail(patch(zonal, (height, width)), surface.patch.repeats)


def shade_pixels(
    found: Detail,
    uvs: Float64Array,
    axes: Float32Array,
    weights: Float32Array,
    is_front: NDArray[np.bool_],
    light: BandLight,
) -> Float32Array:
    """Radiance of white Lambertian pixels (N, 3); axes (N, 3, 3, 3) at the corners of their triangles, and weights
    (N, 3); on backs the detail is turned inside out."""
    mean = np.einsum("nk,nkab->nab", weights, axes)
    handed = np.sign(np.linalg.det(mean))[:, None]
    frames = orthonormal(mean.astype(np.float64), axes[:, 0].astype(np.float64))
    frames[:, 1] *= np.where(handed < 0.0, -1.0, 1.0)
    frames[:, 2] *= np.where(is_front, 1.0, -1.0)[:, None]
    return np.maximum(shade(found.at(uvs), frames, light), np.float32(0.0))
