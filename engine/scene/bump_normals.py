"""The normals that a scene's normal and bump maps turn, wherever points of its surfaces are made.

Of heights the gradient over the surface is taken from the triangle's own plane, so that an image may be stretched; a
normal map lies in the frame that bakers take [Mikkelsen08]: the direction in which u grows, averaged over the triangles
that share a corner and its texture coordinates, and a bitangent on the side to which v grows, mirrored images included;
where a file brings tangents, it is theirs. Where texture coordinates say nothing (all three the same) a surface is
flat.

What the eye cannot see, no material answers for. So a normal is turned no further than until the mirror direction of
the eye grazes the surface (as Cycles's *ensure valid reflection* has it): neither a normal that faces away from the eye
nor a highlight that would come from inside is left, and no black rims. Light counts that is above both the turned
normal's horizon and the surface's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.scene import _bump_kernels as kernels
from engine.scene.surface_uvs import corner_uvs, uvs_at
from engine.texture.pyramid import MOST_PROBES, Pyramid

if TYPE_CHECKING:
    from engine.material.bumps import Bumps
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
Footprints = tuple[Float64Array, Float64Array, Float64Array]
# Of the mirror direction to the surface, where `wo` is as high.
MIN_REFLECTED_COSINE = 0.01
_TINY = 1e-30


@dataclass(frozen=True, eq=False)
class _ObjectBumps:
    """One object's bumps: their slopes, its triangles, and for a normal map tangents at corners (t, 3, 3) and on
    which side the bitangents are (t,)."""

    bumps: Bumps
    slopes: Pyramid
    first: int
    n_triangles: int
    tangents: Float64Array
    handedness: Float64Array
    scene: Scene

    @cached_property
    def gradients(self) -> Float64Array:
        """Of u and v over each of its triangles (t, 2, 3)."""
        return gradients(self.scene, np.arange(self.first, self.first + self.n_triangles))


class BumpNormals:
    """A scene's bumps. Safe to use from several threads.

    flaws: what is wrong with the images of objects, by name; these objects are flat.
    """

    def __init__(self, scene: Scene) -> None:
        """Reads the images."""
        self._scene = scene
        self._covers: dict[int, _ObjectBumps] = {}
        self.flaws: dict[str, LoadError] = {}
        for i, described in enumerate(scene.description.objects):
            try:
                slopes = (
                    None if described.is_lamp or described.bumps.is_flat else scene.textures.slopes(described.bumps)
                )
            except LoadError as error:
                # A new one: where it was raised, which it remembers, the scene was at hand.
                self.flaws[described.name] = LoadError(error.file, error.what, error.value, error.expected)
                continue
            if slopes is not None and slopes.levels[0].any():
                tangents, hands = np.zeros((0, 3, 3)), np.zeros(0)
                if described.bumps.normal_map:
                    tangents, hands = corner_tangents(scene, i)
                begin, end = map(int, scene.triangle_ranges[i])
                self._covers[i] = _ObjectBumps(described.bumps, slopes, begin, end - begin, tangents, hands, scene)

    def check_images(self) -> None:
        """Raises the LoadError of the first image that cannot be used."""
        for error in self.flaws.values():
            raise error

    @property
    def objects(self) -> tuple[int, ...]:
        """Those that are not flat."""
        return tuple(self._covers)

    def offset_axes(self, i_object: int) -> Float64Array:
        """What leans run along, at corners of the triangles of one of `objects`, (t, 3, 6): the gradients of u and of
        v, or of a normal map the tangent, 1 or, mirrored, −1, and zeros."""
        cover = self._covers[i_object]
        if not cover.bumps.normal_map:
            return np.repeat(cover.gradients.reshape(-1, 1, 6), 3, axis=1)
        hands = np.zeros((cover.n_triangles, 3, 3))
        hands[..., 0] = cover.handedness[:, None]
        return np.concatenate([cover.tangents, hands], axis=2)

    def perturb(
        self, triangle: NDArray[np.integer], u: NDArray, v: NDArray, normals: Float64Array, wo: NDArray[np.floating],
        footprints: Footprints | None = None,
    ) -> Float64Array:  # fmt: skip
        """Normals (P, 3) at points of triangles (P,), unit and on the side of wo (P, 3), turned by the bumps.

        footprints: coordinates of all points on their images and how these change over a pixel; None to look images up
        between texels.
        """
        out, objects = normals, self._scene.object_of_triangle[triangle]
        for i in self._covers:
            rows = np.flatnonzero(objects == i)
            if not len(rows):
                continue
            out = out.copy() if out is normals else out
            own = triangle[rows], u[rows], v[rows]
            lean = self.normal_offsets(i, *own, normals[rows], wo[rows], footprints and _of(footprints, rows))
            out[rows] = offset_normals(normals[rows], lean, wo[rows])
        return out

    def normal_offsets(
        self, i_object: int, triangle: NDArray[np.integer], u: NDArray, v: NDArray, normals: Float64Array,
        wo: NDArray[np.floating], footprints: Footprints | None, most_probes: int = MOST_PROBES,
        is_quick: bool = False,
    ) -> Float64Array:  # fmt: skip
        """What is added to unit normals (p, 3) of one of `objects`, within the surface, before they are unit again."""
        cover = self._covers[i_object]
        scene, repeats = self._scene, np.array(cover.bumps.bump_repeats)
        if footprints is None:
            slopes = cover.slopes.at(uvs_at(scene, triangle, u, v) * repeats)
        else:
            slopes = cover.slopes.over(*footprints, most_probes, cover.bumps.bump_repeats, is_quick)
        own = np.asarray(triangle - cover.first, np.int64)
        faces = scene.geometric_normals[cover.first : cover.first + cover.n_triangles]
        lean = np.empty((len(own), 3))
        gradients = np.zeros((0, 2, 3)) if cover.bumps.normal_map else cover.gradients
        kernels.fill_normal_offsets(
            own, np.asarray(u, np.float64), np.asarray(v, np.float64), slopes, gradients, cover.tangents,
            cover.handedness,
            cover.bumps.slope_scale, repeats, faces, np.asarray(wo, np.float64), np.asarray(normals, np.float64), lean,
        )  # fmt: skip
        return lean


def offset_normals(normals: Float64Array, lean: Float64Array, wo: NDArray[np.floating]) -> Float64Array:
    """normalize(n + lean) for unit normals (p, 3) and leans (p, 3) across them, as far as wo (p, 3) allows it.

    At an angle a from n, in the plane of n and the lean, in which wo = r (sin φ, cos φ), the mirror direction of wo is
    r cos(2 a − φ) above the surface: a is at most (φ + acos(least / r)) / 2. Where nothing leans n comes back as it is.
    """
    slope = np.linalg.norm(lean, axis=1)
    across = lean / np.maximum(slope, _TINY)[:, None]
    high, beside = np.einsum("pk,pk->p", normals, wo), np.einsum("pk,pk->p", across, wo)
    radius = np.maximum(np.hypot(high, beside), _TINY)
    least = np.minimum(MIN_REFLECTED_COSINE, 0.9 * high)
    most = 0.5 * (np.arctan2(beside, high) + np.arccos(np.clip(least / radius, -1.0, 1.0)))
    angle = np.minimum(np.arctan(slope), np.maximum(most, 0.0))[:, None]
    turned = np.cos(angle) * normals + np.sin(angle) * across
    return np.where(slope[:, None] > 0.0, turned / np.linalg.norm(turned, axis=1, keepdims=True), normals)


def gradients(scene: Scene, triangle: NDArray[np.integer]) -> Float64Array:
    """The gradients of u and v over triangles (p,), (p, 2, 3) in 1/m."""
    corners = scene.vertices[scene.triangles[triangle]].astype(np.float64)
    uvs = corner_uvs(scene, triangle)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    squared = np.maximum(np.einsum("pk,pk->p", normal, normal), _TINY)[:, None]
    # Of the shares of the second and the third corner.
    of_shares = np.stack([np.cross(second, normal), np.cross(normal, first)], axis=1) / squared[:, None]
    return np.einsum("pca,pck->pak", uvs[:, 1:] - uvs[:, :1], of_shares)


def corner_tangents(scene: Scene, i_object: int) -> tuple[Float64Array, Float64Array]:
    """The direction in which u grows at the corners of an object's triangles, (t, 3, 3), zero where nothing says, and
    whether v grows to the left of it, seen from outside, (t,): 1 or, mirrored, −1. As the file says, where it does."""
    tangents, hands = _derived_tangents(scene, i_object)
    if scene.tangents is not None:
        own = scene.tangents[slice(*scene.triangle_ranges[i_object])].astype(np.float64)
        said = own[:, 0, 3] != 0.0
        tangents[said], hands[said] = own[said, :, :3], own[said, 0, 3]
    return tangents, hands


def _derived_tangents(scene: Scene, i_object: int) -> tuple[Float64Array, Float64Array]:
    """The same by the texture coordinates [Mikkelsen08]."""
    begin, end = scene.triangle_ranges[i_object]
    triangle = np.arange(begin, end)
    uvs, corners = corner_uvs(scene, triangle), scene.vertices[scene.triangles[begin:end]].astype(np.float64)
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    area = steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0]
    hands = np.where(area < 0.0, -1.0, 1.0)
    along_u = steps[:, 1, 1, None] * edges[:, 0] - steps[:, 0, 1, None] * edges[:, 1]
    along_u *= np.where(area == 0.0, 0.0, hands)[:, None]
    along_u /= np.maximum(np.linalg.norm(along_u, axis=1, keepdims=True), _TINY)
    weights = _corner_angles(corners)
    keys = np.concatenate([
        scene.triangles[begin:end].reshape(-1, 1).astype(np.float64), uvs.reshape(-1, 2), np.repeat(hands, 3)[:, None],
    ], axis=1)  # fmt: skip
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    each = (weights[..., None] * along_u[:, None]).reshape(-1, 3)
    sums = [np.bincount(group, each[:, k]).astype(np.float64) for k in range(3)]
    total: Float64Array = np.stack(sums, axis=1)[group]
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), _TINY)
    return total.reshape(-1, 3, 3), hands


def _corner_angles(corners: Float64Array) -> Float64Array:
    """The angles (t, 3) of triangles (t, 3, 3)."""
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("tki,tki->tk", after, before)
    return np.arctan2(np.linalg.norm(np.cross(after, before), axis=2), cosine)


def _of(footprints: Footprints, rows: NDArray[np.integer]) -> Footprints:
    uv, across, down = footprints
    return uv[rows], across[rows], down[rows]
