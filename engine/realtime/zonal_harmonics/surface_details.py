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
    normals_of,
    patch,
    simulate_patch,
)
from engine.realtime.zonal_harmonics.shading import Lobes, lobes
from engine.realtime.zonal_harmonics.transfer import Medium
from engine.realtime.zonal_harmonics.wrinkle import DEEPEST, SIDE, between_nodes, node_normals, wrinkles
from engine.realtime.zonal_harmonics.wrinkle import Wrinkles as WrinkleMap
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.scene_loader import Scene
from engine.scene.surface_kinds import DeformSurface
from engine.scene.surface_kinds import Detail as PatchSays
from engine.scene.surface_kinds import Wrinkles as WrinklesSay
from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LobeMap:
    """Lobes and normals for look-ups by shaders (H, W, ...), v upwards, in axes along u, along v, outwards.

    repeats: along u and v. is_smooth: lobes are interpolated between entries and their axes normalized; otherwise the
    nearest entry's are taken. In a smooth map the sum of u and v times repeats runs along its rows, first to last, and
    the depth along its columns: one for all, or an image's, by texture coordinates.
    """

    lobes: Lobes
    normals: Float32Array
    repeats: tuple[float, float]
    is_smooth: bool
    depth: float = 0.0
    depth_image: Pyramid | None = None


class Detail(Protocol):
    """Lobes by texture coordinates."""

    def at(self, uvs: Float64Array) -> Lobes:
        """Lobes at (P, 2), in axes along u, along v, outwards."""

    def normals_at(self, uvs: Float64Array) -> Float64Array:
        """Normals (P, 3) at (P, 2), in the same axes."""

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

    def normals_at(self, uvs: Float64Array) -> Float64Array:
        return self._patch.normals_at(uvs * self._repeats)

    def errors_at(self, uvs: Float64Array) -> Float64Array:
        return self._patch.errors_at(uvs * self._repeats)

    def map(self) -> LobeMap:
        found = self._patch
        all_lobes = Lobes(found.low, found.axes, found.coefficients)
        return LobeMap(all_lobes, found.normals.astype(np.float32), self._repeats, False)


class WrinkleDetail(Detail):
    """Grooves across u or v, as deep as one number or an image says."""

    def __init__(self, found: WrinkleMap, surface: WrinklesSay, depth_image: Pyramid | None = None) -> None:
        self._map, self._surface, self._depth_image = found, surface, depth_image
        self._normals = node_normals(*found.errors.shape)
        if surface.across == "v":  # across and along it are v and -u
            turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            self._map, self._normals = found.rotate(turn), self._normals @ turn.T

    def at(self, uvs: Float64Array) -> Lobes:
        return lobes(self._map.at(*self._places(uvs)))

    def normals_at(self, uvs: Float64Array) -> Float64Array:
        mean = between_nodes(self._normals, *self._places(uvs))
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))

    def errors_at(self, uvs: Float64Array) -> Float64Array:
        return self._map.at(*self._places(uvs)).relative_errors

    def map(self) -> LobeMap:
        found, surface = self._map, self._surface
        all_lobes = Lobes(*(np.asarray(each, np.float32) for each in (found.low, found.axes, found.coefficients)))
        repeats = (surface.repeats, 0.0) if surface.across == "u" else (0.0, surface.repeats)
        depth = 0.0 if isinstance(surface.depth, str) else surface.depth / DEEPEST
        return LobeMap(all_lobes, self._normals.astype(np.float32), repeats, True, depth, self._depth_image)

    def _places(self, uvs: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Positions (P,) in grooves and their depths (P,)."""
        position = uvs[:, 0 if self._surface.across == "u" else 1] * self._surface.repeats
        if isinstance(self._surface.depth, str):
            assert self._depth_image is not None
            return position, self._depth_image.at(uvs)[:, 0].astype(np.float64)
        return position, np.full(len(uvs), self._surface.depth)


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


def detail_normals(scene: Scene, surface: DeformSurface) -> Float64Array:
    """Normals (P, 3) of `n_texels`, in the axes of their lobes."""
    found = node_normals(SIDE, SIDE) if surface.patch is None else normals_of(heights(scene, surface.patch))
    return found.reshape(-1, 3)


def detail(scene: Scene, surface: DeformSurface, zonal: Zonal) -> Detail:
    """Make the detail from lobes of `n_texels`."""
    if surface.wrinkles is not None:
        maps = (zonal.low, zonal.axes, zonal.coefficients, zonal.errors)
        of_nodes = (each.reshape(SIDE, SIDE, *each.shape[1:]).astype(np.float64) for each in maps)
        depth = surface.wrinkles.depth
        image = scene.textures.weight(Images(weight=depth)) if isinstance(depth, str) else None
        return WrinkleDetail(WrinkleMap(*of_nodes), surface.wrinkles, image)
    assert surface.patch is not None
    return PatchDetail(patch(zonal, heights(scene, surface.patch)), surface.patch.repeats)


def detail_frames(axes: Float32Array, weights: Float32Array, is_front: NDArray[np.bool_]) -> Float64Array:
    """Rows (N, 3, 3) along u, along v, outwards of pixels; axes (N, 3, 3, 3) at the corners of their triangles, and
    weights (N, 3); on backs the detail is turned inside out."""
    mean = np.einsum("nk,nkab->nab", weights, axes)
    handed = np.sign(np.linalg.det(mean))[:, None]
    frames = orthonormal(mean.astype(np.float64), axes[:, 0].astype(np.float64))
    frames[:, 1] *= np.where(handed < 0.0, -1.0, 1.0)
    frames[:, 2] *= np.where(is_front, 1.0, -1.0)[:, None]
    return frames
