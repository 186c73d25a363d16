"""Perturbs shading normals by a scene's normal and bump maps.

The gradient of heights over the surface is computed in the triangle's own plane, so that an image may be stretched. A
normal map refers to the frame that bakers use [Mikkelsen08]: the direction in which u grows, averaged over the
triangles that share a corner and its texture coordinates, and a bitangent on the side on which v grows, also for
mirrored images; a file's own tangents take precedence. Where texture coordinates are degenerate (all three equal) a
surface is flat.

A material is not defined for directions below the surface. So a normal is perturbed only until the camera's mirror
direction grazes the surface (as in Cycles' *ensure valid reflection*): no normal faces away from the camera, no
highlight comes from inside, and there are no black rims. Light counts if it is above both the perturbed normal's
horizon and the surface's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.scene import _hit_kernels as kernels
from engine.scene.surface_uvs import Footprints, corner_uvs_of_set, uvs_at
from engine.texture.pyramid import MOST_PROBES, Pyramid

if TYPE_CHECKING:
    from engine.material.bumps import Bumps
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
# Least cosine of the mirror direction to the surface, unless `wo` itself is lower.
MIN_REFLECTED_COSINE = 0.01
_TINY = 1e-30


@dataclass(frozen=True, eq=False)
class _ObjectBumps:
    """One object's bumps: their slopes, its triangles, and for a normal map the tangents at corners (t, 3, 3) and the
    sides of the bitangents (t,)."""

    bumps: Bumps
    slopes: Pyramid
    first: int
    n_triangles: int
    tangents: Float64Array
    handedness: Float64Array
    scene: Scene

    @cached_property
    def gradients(self) -> Float64Array:
        """Gradients of u and v over each of its triangles (t, 2, 3)."""
        triangle = np.arange(self.first, self.first + self.n_triangles)
        return gradients(self.scene, triangle, self.bumps.bump_uv_set)


class BumpNormals:
    """A scene's bumps. Safe to use from several threads.

    flaws: errors in the images of objects, by name; these objects are flat.
    """

    def __init__(self, scene: Scene) -> None:
        """Reads the images."""
        self._scene = scene
        self._by_object: dict[int, _ObjectBumps] = {}
        self.flaws: dict[str, LoadError] = {}
        for i, described in enumerate(scene.description.objects):
            try:
                slopes = (
                    None if described.is_lamp or described.bumps.is_flat else scene.textures.slopes(described.bumps)
                )
            except LoadError as error:
                # A new error: a raised one refers to its traceback, which refers to the scene.
                self.flaws[described.name] = LoadError(error.file, error.what, error.value, error.expected)
                continue
            if slopes is not None and slopes.levels[0].any():
                tangents, handedness = np.zeros((0, 3, 3)), np.zeros(0)
                if described.bumps.normal_map:
                    tangents, handedness = corner_tangents(scene, i)
                begin, end = map(int, scene.triangle_ranges[i])
                self._by_object[i] = _ObjectBumps(
                    described.bumps, slopes, begin, end - begin, tangents, handedness, scene
                )

    @property
    def objects(self) -> tuple[int, ...]:
        """Indices of the objects with bumps."""
        return tuple(self._by_object)

    def offset_axes(self, i_object: int) -> Float64Array:
        """Axes of the offsets, at corners of the triangles of one of `objects`, (t, 3, 6): the gradients of u and of v,
        or of a normal map the tangent, 1 or, mirrored, −1, and zeros."""
        surface = self._by_object[i_object]
        if not surface.bumps.normal_map:
            return np.repeat(surface.gradients.reshape(-1, 1, 6), 3, axis=1)
        handedness = np.zeros((surface.n_triangles, 3, 3))
        handedness[..., 0] = surface.handedness[:, None]
        return np.concatenate([surface.tangents, handedness], axis=2)

    def perturb(
        self, triangle: NDArray[np.integer], u: NDArray, v: NDArray, normals: Float64Array, wo: NDArray[np.floating],
        footprints: Footprints | None = None,
    ) -> Float64Array:  # fmt: skip
        """Normals (P, 3) at points of triangles (P,), unit, on the side of wo (P, 3), perturbed by the bumps.

        footprints: texture coordinates of all points and their change over a pixel; None to interpolate images between
        texels.
        """
        out, objects = normals, self._scene.object_of_triangle[triangle]
        for i in self._by_object:
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
        """Offsets of unit normals (p, 3) of one of `objects`, tangential, to be added before normalization."""
        surface = self._by_object[i_object]
        scene, repeats = self._scene, surface.bumps.bump_repeats
        if footprints is None:
            slopes = surface.slopes.at(uvs_at(scene, triangle, u, v), repeats=repeats)
        else:
            slopes = surface.slopes.over(*footprints, most_probes, repeats, is_quick)
        own = np.asarray(triangle - surface.first, np.int64)
        faces = scene.geometric_normals[surface.first : surface.first + surface.n_triangles]
        lean = np.empty((len(own), 3))
        gradients = np.zeros((0, 2, 3)) if surface.bumps.normal_map else surface.gradients
        kernels.fill_normal_offsets(
            own, np.asarray(u, np.float64), np.asarray(v, np.float64), slopes, gradients, surface.tangents,
            surface.handedness, surface.bumps.slope_scale, np.array(repeats), faces, np.asarray(wo, np.float64),
            np.asarray(normals, np.float64), lean,
        )  # fmt: skip
        return lean


def offset_normals(normals: Float64Array, lean: Float64Array, wo: NDArray[np.floating]) -> Float64Array:
    """normalize(n + lean) for unit normals (p, 3) and offsets lean (p, 3) perpendicular to them, as far as wo (p, 3)
    allows.

    At an angle a from n, in the plane of n and the offset, in which wo = r (sin φ, cos φ), the mirror direction of wo
    is r cos(2 a − φ) above the surface: a is at most (φ + acos(least / r)) / 2. Without an offset n is returned
    unchanged.
    """
    out = np.empty((len(normals), 3))
    own, leaning, towards = (np.require(each, np.float64, ["C", "W"]) for each in (normals, lean, wo))
    kernels.fill_offset_normals(own, leaning, towards, MIN_REFLECTED_COSINE, out)
    return out


def gradients(scene: Scene, triangle: NDArray[np.integer], uv_set: int = 0) -> Float64Array:
    """Gradients of u and v of a set over triangles (p,), (p, 2, 3) in 1/m."""
    corners = scene.vertices[scene.triangles[triangle]].astype(np.float64)
    uvs = corner_uvs_of_set(scene, triangle, uv_set)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    squared = np.maximum(np.einsum("pk,pk->p", normal, normal), _TINY)[:, None]
    # Gradients of the barycentric coordinates of the second and the third corner.
    of_shares = np.stack([np.cross(second, normal), np.cross(normal, first)], axis=1) / squared[:, None]
    return np.einsum("pca,pck->pak", uvs[:, 1:] - uvs[:, :1], of_shares)


def corner_tangents(scene: Scene, i_object: int) -> tuple[Float64Array, Float64Array]:
    """The direction in which u grows at the corners of an object's triangles, (t, 3, 3), zero where undefined, and the
    handedness (t,): 1 if v grows to its left, seen from outside, or, mirrored, −1. From the file if it has tangents."""
    tangents, handedness = _derived_tangents(scene, i_object)
    if scene.tangents is not None:
        own = scene.tangents[slice(*scene.triangle_ranges[i_object])].astype(np.float64)
        given = own[:, 0, 3] != 0.0
        tangents[given], handedness[given] = own[given, :, :3], own[given, 0, 3]
    return tangents, handedness


def _derived_tangents(scene: Scene, i_object: int) -> tuple[Float64Array, Float64Array]:
    """Derive the tangents from the texture coordinates [Mikkelsen08]."""
    begin, end = scene.triangle_ranges[i_object]
    triangle = np.arange(begin, end)
    uvs = corner_uvs_of_set(scene, triangle, scene.description.objects[i_object].bumps.bump_uv_set)
    corners = scene.vertices[scene.triangles[begin:end]].astype(np.float64)
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    area = steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0]
    handedness = np.where(area < 0.0, -1.0, 1.0)
    along_u = steps[:, 1, 1, None] * edges[:, 0] - steps[:, 0, 1, None] * edges[:, 1]
    along_u *= np.where(area == 0.0, 0.0, handedness)[:, None]
    along_u /= np.maximum(np.linalg.norm(along_u, axis=1, keepdims=True), _TINY)
    weights = _corner_angles(corners)
    keys = np.concatenate([
        scene.triangles[begin:end].reshape(-1, 1).astype(np.float64), uvs.reshape(-1, 2),
        np.repeat(handedness, 3)[:, None],
    ], axis=1)  # fmt: skip
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    each = (weights[..., None] * along_u[:, None]).reshape(-1, 3)
    sums = [np.bincount(group, each[:, k]).astype(np.float64) for k in range(3)]
    total: Float64Array = np.stack(sums, axis=1)[group]
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), _TINY)
    return total.reshape(-1, 3, 3), handedness


def _corner_angles(corners: Float64Array) -> Float64Array:
    """Angles (t, 3) of triangles (t, 3, 3)."""
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("tki,tki->tk", after, before)
    return np.arctan2(np.linalg.norm(np.cross(after, before), axis=2), cosine)


def _of(footprints: Footprints, rows: NDArray[np.integer]) -> Footprints:
    uv, across, down = footprints
    return uv[rows], across[rows], down[rows]
