"""Tangents of shading frames: the directions along which the streaks of anisotropic materials are measured.

Without rotation a tangent goes around the object's own Y axis, as a lathe or a brush does. An object's angle and its
map of angles (`engine.material.bumps`) rotate it about the normal, counter-clockwise as seen from the side that is
shown.

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
from engine.scene.raycaster import Intersections
from engine.scene.surface_uvs import uvs_at

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene
    from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]
# Texture coordinates of points (p, 2 K), and their change over a pixel to the right and downwards.
Footprints = tuple[Float64Array, Float64Array, Float64Array]
# Codes of a map's angles: 256 for half a turn, 0.7 degrees apart.
N_CODES = 256


def object_axes(scene: Scene) -> Float64Array:
    """Each object's axes in the world, unit, (M, 3, 3): rows X, Y, Z."""
    axes = np.array([np.reshape(o.transform, (4, 4))[:3, :3].T for o in scene.description.objects])
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

    of_objects (M,): angles of the objects without their maps, radians; mapped: indices of the objects with maps; flaws:
    errors in the images of objects, by name, whose maps do not count.
    """

    def __init__(self, scene: Scene) -> None:
        """Reads the images."""
        self._scene = scene
        self._maps: dict[int, Pyramid] = {}
        self.of_objects = np.zeros(len(scene.description.objects))
        self.flaws: dict[str, LoadError] = {}
        for i, described in enumerate(scene.description.objects):
            if described.is_lamp:
                continue
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
        """Indices of the objects with maps."""
        return tuple(self._maps)

    @cached_property
    def digest(self) -> str:
        """Identifies the rotations; empty where nothing is rotated."""
        if not self._maps and not self.of_objects.any():
            return ""
        found = hashlib.blake2b(self.of_objects.tobytes(), digest_size=16)
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
        for i in self._maps:
            rows = np.flatnonzero(ids == i)
            if len(rows):
                angles[rows] += self._map_angles(i, found.of(rows), footprints_of and footprints_of(rows))
        return rotated(tangents, normals, angles) if angles.any() else tangents

    def codes(self, found: Intersections) -> NDArray[np.uint8]:
        """The maps' angles at hits (P,), in units of half a turn / `N_CODES`; 0 without maps."""
        out = np.zeros(len(found.triangle), np.uint8)
        if self._maps:
            ids = np.where(found.triangle >= 0, self._scene.object_of_triangle[found.triangle], -1)
            for i in self._maps:
                rows = np.flatnonzero(ids == i)
                angles = self._map_angles(i, found.of(rows), None)
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
