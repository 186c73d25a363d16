"""Detail that lies on an object's texture coordinates, pixel by pixel: patches of heights, and wrinkles [Sloan05, 6].

Its lobes are in axes along u and v, which are found of the mesh as it is bent. It shades itself alone: what the rest of
the object does to it is left out.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.deform.heights import PATTERNS, of_image
from engine.deform.patches import Patch, patch, simulate_patch, uv_frames
from engine.deform.points import BendingPoints
from engine.deform.pose import orthonormal
from engine.deform.shading import BandLight, Lobes, lobes, shade
from engine.deform.wrinkle import SIDE, wrinkles
from engine.deform.wrinkle import Wrinkles as WrinkleMap
from engine.deform.zonal import Zonal, fit
from engine.material.maps import Images
from engine.scene.load import Scene
from engine.scene.surface_kinds import DeformSurface
from engine.scene.surface_kinds import Detail as PatchSays
from engine.scene.surface_kinds import Wrinkles as WrinklesSay
from engine.scene.surface_uvs import uvs_at
from engine.steps import told_as

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


class Detail(Protocol):
    """Lobes by texture coordinates."""

    def at(self, uvs: Floats) -> Lobes:
        """At (P, 2), in axes along u, along v, outwards."""


class Patched(Detail):
    """A patch that repeats."""

    def __init__(self, found: Patch, repeats: tuple[float, float]) -> None:
        self._patch, self._repeats = found, repeats

    def at(self, uvs: Floats) -> Lobes:
        return self._patch.at(uvs * self._repeats)


class Wrinkled(Detail):
    """Grooves across u or v."""

    def __init__(self, found: WrinkleMap, says: WrinklesSay) -> None:
        self._map, self._says = found, says

    def at(self, uvs: Floats) -> Lobes:
        places = uvs[:, 0 if self._says.across == "u" else 1] * self._says.repeats
        found = self._map.at(places, np.full(len(uvs), self._says.depth))
        if self._says.across == "v":  # the groove's own axes are across it, along it, outwards: v, -u
            found = found.turned(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
        return lobes(found)


def heights(scene: Scene, says: PatchSays) -> Floats:
    """(H, W), in sides of the patch."""
    if says.kind is not None:
        return PATTERNS[says.kind]() * says.height
    image = scene.textures.weight(Images(weight=says.file or ""))
    assert image is not None
    return of_image(image.levels[0][..., 0]) * says.height


def simulated(scene: Scene, says: DeformSurface, n: int, n_lobes: int, n_rays: int) -> Generator[float, None, Zonal]:
    """The lobes of a patch's texels or of a map of wrinkles, row by row. Yields the share that is done."""
    if says.wrinkles is not None:
        found = yield from wrinkles(n)
        low, axes, coefficients = (
            each.reshape(-1, *each.shape[2:]) for each in (found.low, found.axes, found.coefficients)
        )
        return Zonal(low, axes, coefficients, np.full(SIDE * SIDE, found.error))
    assert says.patch is not None
    tracing = simulate_patch(heights(scene, says.patch), n, n_rays=n_rays)
    vectors = yield from told_as(tracing, lambda share: 0.9 * share)
    return (yield from told_as(fit(vectors, n_lobes), lambda share: 0.9 + 0.1 * share))


def detail(scene: Scene, says: DeformSurface, zonal: Zonal) -> Detail:
    """Of what `simulated` found."""
    if says.wrinkles is not None:
        low, axes, coefficients = (
            each.reshape(SIDE, SIDE, *each.shape[1:]).astype(np.float64)
            for each in (zonal.low, zonal.axes, zonal.coefficients)
        )
        return Wrinkled(WrinkleMap(low, axes, coefficients, float(zonal.errors[0])), says.wrinkles)
    assert says.patch is not None
    height, width = heights(scene, says.patch).shape
    return Patched(patch(zonal, (height, width)), says.patch.repeats)


def surface_axes(scene: Scene, points: BendingPoints, i: int) -> Singles:
    """Axes now at the corners of all triangles (T, 3, 3, 3): along u, along v, outwards; those of object i alone are
    filled."""
    surface = points.surface
    mine = np.flatnonzero(surface.i_object == i)
    own, corners = np.unique(surface.corners[mine], return_inverse=True)
    uvs = np.stack([uvs_at(scene, points.source[mine], *points.within[mine, k].T) for k in range(3)], axis=1)
    found = np.zeros((len(surface.corners), 3, 3, 3), np.float32)
    found[mine] = uv_frames(points.places[own], corners.reshape(-1, 3).astype(np.int32), uvs, points.frames[own])
    return found


def shaded(
    found: Detail, uvs: Floats, axes: Singles, weights: Singles, is_front: NDArray[np.bool_], light: BandLight
) -> Singles:
    """What white matt pixels (N, 3) send; axes (N, 3, 3, 3) of the corners of their triangles and shares (N, 3) of
    these; of backs the detail is turned inside out."""
    mean = np.einsum("nk,nkab->nab", weights, axes)
    handed = np.sign(np.linalg.det(mean))[:, None]
    frames = orthonormal(mean.astype(np.float64), axes[:, 0].astype(np.float64))
    frames[:, 1] *= np.where(handed < 0.0, -1.0, 1.0)
    frames[:, 2] *= np.where(is_front, 1.0, -1.0)[:, None]
    return np.maximum(shade(found.at(uvs), frames, light), np.float32(0.0))
