"""Tangents of shading frames: the directions along which the streaks of anisotropic materials are measured.

Without rotation a tangent goes around the object's own Y axis, as a lathe or a brush does. An object's angle and its
map of angles (`engine.material.bumps`) rotate it about the normal, counter-clockwise as seen from the side that is
shown. An object's tangents may follow its texture coordinates instead, as those of glTF files do: each is then the
direction in which u grows, made perpendicular to the normal, and is rotated towards that in which v grows.

A map is filtered as (cos 2θ, sin 2θ): the mean of black and white, which mean the same direction where white is 180
degrees, is that direction and not the one across.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.scene import _hit_kernels as kernels
from engine.scene.bump_normals import corner_tangents
from engine.scene.raycaster import Intersections
from engine.scene.surface_uvs import Footprints, between, uvs_at

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene
    from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]
# Codes of a map's angles: 256 for half a turn, 0.7 degrees apart.
N_CODES = 256


def object_axes(scene: Scene) -> Float64Array:
    """Each object's axes in the world, unit, (M, 3, 3): rows X, Y, Z."""
    transforms = np.array([o.transform for o in scene.description.objects]).reshape(-1, 4, 4)
    axes = transforms[:, :3, :3].transpose(0, 2, 1)
    return axes / np.linalg.norm(axes, axis=2, keepdims=True)


def object_tangents(scene: Scene, ids: Rows, normals: Float64Array) -> Float64Array:
    """Tangents without rotation: normalize(Y × n) with the object's Y axis in the world; its X axis, made perpendicular
    to n, where Y ∥ n.

    ids (P,) of the objects, normals (P, 3) unit.
    """
    out = np.empty((len(normals), 3))
    kernels.fill_tangents(
        np.require(object_axes(scene), np.float64, ["C", "W"]), np.require(ids, np.int64, ["C", "W"]),
        np.require(normals, np.float64, ["C", "W"]), out,
    )  # fmt: skip
    return out


class TangentRotations:
    """The rotations of a scene's tangents. Safe to use from several threads.

    of_objects (M,): angles of the objects without their maps, radians; mapped: indices of the objects whose angles vary
    over them; flaws: errors in the images of objects, by name, whose maps do not count.
    """

    def __init__(self, scene: Scene) -> None:
        """Reads the images."""
        self._scene = scene
        self._maps: dict[int, Pyramid] = {}
        # Tangents (t, 3, 3) at the corners of triangles of objects that follow u, and the side (t,) on which v grows.
        self._along_u: dict[int, tuple[Float64Array, Float64Array]] = {}
        self.of_objects = np.zeros(len(scene.description.objects))
        self.flaws: dict[str, LoadError] = {}
        for i, described in enumerate(scene.description.objects):
            if described.is_lamp:
                continue
            if described.bumps.tangent_along_u:
                self._along_u[i] = corner_tangents(scene, i)
            else:
                self.of_objects[i] = np.radians(described.bumps.tangent_angle)
            try:
                found = scene.textures.directions(described.bumps)
            except LoadError as error:
                # A new error: a raised one refers to its traceback, which refers to the scene.
                self.flaws[described.name] = LoadError(error.file, error.what, error.value, error.expected)
                continue
            if found is not None:
                self._maps[i] = found

    @property
    def mapped(self) -> tuple[int, ...]:
        """Indices of the objects with maps, or whose tangents follow u."""
        return tuple(sorted(self._maps.keys() | self._along_u.keys()))

    @cached_property
    def digest(self) -> str:
        """Identifies the rotations; empty where nothing is rotated."""
        if not self._maps and not self._along_u and not self.of_objects.any():
            return ""
        found = hashlib.blake2b(self.of_objects.tobytes(), digest_size=16)
        for i, (tangents, sides) in self._along_u.items():
            angle = self._scene.description.objects[i].bumps.tangent_angle
            found.update(repr((i, angle)).encode() + tangents.tobytes() + sides.tobytes())
        for i, image in self._maps.items():
            found.update(repr((i, image.shapes)).encode() + image.texels.tobytes())
        return found.hexdigest()

    def image(self, i_object: int) -> NDArray[np.float32]:
        """(cos 2θ, sin 2θ) of the angles θ of an object, (H, W, 2), row 0 on top; of one texel without a map."""
        angle = 2.0 * self.of_objects[i_object]
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]], np.float32)
        own = self._maps.get(i_object)
        return turn[:1, None] if own is None else own.levels[0] @ turn

    def tangents(
        self, ids: Rows, normals: Float64Array, found: Intersections,
        footprints_of: Callable[[Rows], Footprints] | None = None,
    ) -> Float64Array:  # fmt: skip
        """Unit tangents (P, 3) at hits of objects ids (P,) with unit normals (P, 3), rotated.

        footprints_of: gives the footprints of some of the points, over which maps are averaged; None to interpolate
        maps between texels.
        """
        tangents = object_tangents(self._scene, ids, normals)
        angles = self.of_objects[ids]
        for i in self.mapped:
            rows = np.flatnonzero(ids == i)
            if not len(rows):
                continue
            own = found.of(rows)
            varying = self._map_angles(i, own, footprints_of and footprints_of(rows)) if i in self._maps else 0.0
            if i in self._along_u:
                varying = self._angles_from_u(i, own, normals[rows], tangents[rows], varying)
            angles[rows] += varying
        return rotated(tangents, normals, angles) if angles.any() else tangents

    def _angles_from_u(
        self, i: int, found: Intersections, normals: Float64Array, tangents: Float64Array, angles: Float64Array | float
    ) -> Float64Array:
        """Angles (p,) of an object's tangents that follow u and are rotated by its angle and further ones (p,), from
        tangents (p, 3) about normals (p, 3)."""
        corners, sides = self._along_u[i]
        own = found.triangle - self._scene.triangle_ranges[i][0]
        along = between(corners[own], found.u, found.v)
        base = np.arctan2(
            np.einsum("pk,pk->p", along, np.cross(normals, tangents)), np.einsum("pk,pk->p", along, tangents)
        )
        is_front = np.einsum("pk,pk->p", normals, self._scene.geometric_normals[found.triangle]) >= 0.0
        towards_v = sides[own] * np.where(is_front, 1.0, -1.0)
        turn = np.radians(self._scene.description.objects[i].bumps.tangent_angle) + angles
        return np.asarray(base + towards_v * turn)

    def codes(self, found: Intersections) -> NDArray[np.uint8]:
        """The angles that vary, at hits (P,) of fronts, in units of half a turn / `N_CODES`; 0 where none do."""
        out = np.zeros(len(found.triangle), np.uint8)
        if not self.mapped:
            return out
        scene = self._scene
        ids = np.where(found.triangle >= 0, scene.object_of_triangle[found.triangle], -1)
        for i in self.mapped:
            rows = np.flatnonzero(ids == i)
            own = found.of(rows)
            angles: Float64Array | float = self._map_angles(i, own, None) if i in self._maps else 0.0
            if i in self._along_u:
                normals = scene.geometric_normals[own.triangle].astype(np.float64)
                if scene.smooth[i]:
                    smooth = between(scene.normals[scene.triangles[own.triangle]], own.u, own.v)
                    length = np.linalg.norm(smooth, axis=1, keepdims=True)
                    normals = np.where(length > 1e-4, smooth / np.maximum(length, 1e-4), normals)
                tangents = object_tangents(scene, ids[rows], normals)
                angles = self._angles_from_u(i, own, normals, tangents, angles)
            out[rows] = np.rint(angles * (N_CODES / np.pi)).astype(np.int64) % N_CODES
        return out

    def _map_angles(self, i_object: int, found: Intersections, footprints: Footprints | None) -> Float64Array:
        """Angles (p,) of an object's map, radians."""
        image = self._maps[i_object]
        if footprints is None:
            twice = image.at(uvs_at(self._scene, found.triangle, found.u, found.v))
        else:
            twice = image.over(*footprints)
        return np.asarray(0.5 * np.arctan2(twice[:, 1], twice[:, 0]), np.float64)


def rotated(tangents: Float64Array, normals: Float64Array, angles: Float64Array) -> Float64Array:
    """Tangents (P, 3) rotated about unit normals (P, 3), to which they are perpendicular, by angles (P,), radians."""
    across = np.cross(normals, tangents)
    return np.cos(angles)[:, None] * tangents + np.sin(angles)[:, None] * across


def tangent_axes(scene: Scene) -> NDArray[np.float32]:
    """What kernels rotate tangents by, (M, 3, 3): each object's Y and X axes, and cosine and sine of its angle."""
    axes = object_axes(scene)[:, [1, 0, 0]]
    angles = scene.tangent_rotations.of_objects
    axes[:, 2] = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    return np.ascontiguousarray(axes, np.float32)
