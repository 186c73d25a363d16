"""Emission that varies over a surface: a texture and colours of vertices that multiply an object's emission, and its
opacity.

What is seen is looked up at the point, or filtered over a pixel. Light is computed from means over parts of triangles,
as fine as the light is divided anyway: `emitter_tree` for direct light, patches for the rest. Where an emitter has
holes or covers a share alone, its means are times the opacity, because rays to it end before its surface.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.triangles import quarters
from engine.light.emitters import Emitted, MergedTriangles
from engine.light.environment import LUMINANCE
from engine.material.layer_maps import Images
from engine.scene.surface_uvs import between, colours_at, corner_uvs, corner_uvs_of_set, pixel_footprints, uvs_at

if TYPE_CHECKING:
    from engine.scene.raycaster import Intersections
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
Rows = NDArray[np.integer]
# Samples of the means over all parts together, in powers of four for each part: at least 4, at most 256.
_N_SAMPLES, _MOST_HALVINGS = 1 << 19, 4
# Parts along an edge of a textured triangle that is sampled by power, and of all triangles together.
_MOST_ALONG, _MOST_PARTS = 64, 1 << 16


@dataclass(frozen=True, eq=False)
class EmissionTextures:
    """The textures of one scene's emitters; objects: those whose emission varies."""

    scene: Scene
    objects: tuple[int, ...]

    @property
    def tinted(self) -> tuple[int, ...]:
        """Those whose emission is seen to vary; that of others is less where they are not there."""
        return tuple(i for i in self.objects if self.scene.description.objects[i].emission_texture.is_tinted)

    @cached_property
    def digest(self) -> str:
        """Identifies the emission but for its factor; empty where none varies."""
        if not self.objects:
            return ""
        found = hashlib.blake2b(self.scene.cutouts.digest.encode(), digest_size=16)
        for i in self.objects:
            images = self._images(i)
            found.update(repr((i, images)).encode())
            image = self.scene.textures.texture(images)
            found.update(b"" if image is None else image.levels[0].tobytes())
        for values in (self.scene.uvs, self.scene.colours):
            found.update(b"" if values is None else values.tobytes())
        return found.hexdigest()

    def at(self, triangle: Rows, u: NDArray, v: NDArray) -> Float64Array:
        """By what emission is multiplied (N, 3) at points of triangles (N,), between texels; without opacity."""
        scene, found = self.scene, np.ones((len(triangle), 3))
        for i, rows in self._rows(triangle):
            own, images = (triangle[rows], u[rows], v[rows]), self._images(i)
            texture = scene.textures.texture(images)
            if texture is not None:
                found[rows] = texture.at(uvs_at(scene, *own), repeats=images.texture_scale)
            if images.vertex_colours:
                found[rows] *= colours_at(scene, *own)[:, :3]
        return found

    def over_pixels(self, hits: Intersections, places: Float64Array, resolution: tuple[int, int]) -> Float64Array:
        """The same at hits (N,) of rays through a picture at places (N, 2), see `pixel_footprints`, filtered over the
        pixel."""
        found = np.ones((len(hits.triangle), 3))
        for i, rows in self._rows(hits.triangle):
            own = hits.of(rows)
            found[rows] = self.over(i, own, pixel_footprints(self.scene, own, places[rows], resolution))
        return found

    def over(self, i: int, hits: Intersections, footprints: tuple[Float64Array, ...]) -> Float64Array:
        """The same of one object, from footprints (N, 2) of the hits (N,): their middles in texture coordinates and
        both sides."""
        images, found = self._images(i), np.ones((len(hits.triangle), 3))
        texture = self.scene.textures.texture(images)
        if texture is not None:
            middle, across, down = footprints
            found[:] = texture.over(middle, across, down, repeats=images.texture_scale)
        if images.vertex_colours:
            found *= colours_at(self.scene, hits.triangle, hits.u, hits.v)[:, :3]
        return found

    def means(self, triangle: Rows, corners: Float64Array) -> Float64Array:
        """Means (N, 3) of the factor times the opacity over parts of triangles (N,): corners (N, 3, 2), their u and
        v."""
        found = np.ones((len(triangle), 3))
        for i, rows in self._rows(triangle):
            halvings = int(np.clip(np.log2(_N_SAMPLES / len(rows)) // 2, 1, _MOST_HALVINGS))
            at_once = _N_SAMPLES >> 2 * halvings
            for start in range(0, len(rows), at_once):
                some = rows[start : start + at_once]
                found[some] = self._means(i, triangle[some], corners[some], _centres(halvings))
        return found

    def _means(self, i: int, triangle: Rows, corners: Float64Array, within: Float64Array) -> Float64Array:
        scene, images, n = self.scene, self._images(i), len(within)
        places = np.einsum("sk,nki->nsi", within, corners).reshape(-1, 2)
        owner, (u, v) = np.repeat(triangle, n), places.T
        colours = np.ones((len(owner), 3))
        texture = scene.textures.texture(images)
        if texture is not None:
            uvs, scale = corner_uvs_of_set(scene, triangle, texture.transform.uv_set), np.array(images.texture_scale)
            one, two = (uvs[:, 1:] - uvs[:, :1]).swapaxes(0, 1)
            stretch = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) * abs(scale.prod())
            share = 0.5 * stretch * _areas(corners) / n  # of the image, for each sample
            places = between(np.repeat(corner_uvs(scene, triangle), n, axis=0), u, v)
            colours *= texture.at(places, np.repeat(texture.level_of(share), n), images.texture_scale)
        if images.vertex_colours:
            colours *= colours_at(scene, owner, u, v)[:, :3]
        if scene.cutouts.passable[triangle[0]]:
            colours *= scene.cutouts.opacity_at(owner, u, v)[:, None]
        return np.asarray(colours.reshape(-1, n, 3).mean(axis=1))

    def _rows(self, triangle: Rows) -> list[tuple[int, Rows]]:
        """The objects whose emission varies, and which of the triangles (N,) are theirs."""
        if not self.objects:
            return []
        owners = self.scene.object_of_triangle[triangle]
        found = ((i, np.flatnonzero(owners == i)) for i in self.objects)
        return [(i, rows) for i, rows in found if len(rows)]

    def _images(self, i: int) -> Images:
        return self.scene.description.objects[i].emission_texture.images


def emission_textures(scene: Scene) -> EmissionTextures:
    """The textures of a scene's emitters."""
    described = enumerate(scene.description.objects)
    varies = [i for i, own in described if own.emits and (own.emission_texture.is_tinted or own.opacity.lets_pass)]
    return EmissionTextures(scene, tuple(varies))


# ---------------------------------------------------------------------------------------------------- for lighting


@dataclass(frozen=True, eq=False)
class EmittingTriangles:
    """Triangles that light the scene: triangle (T,) of the scene, corners (T, 3, 3), and radiance (T, 3), the mean over
    each."""

    scene: Scene
    triangle: Rows
    corners: Float64Array
    radiance: Float64Array

    def of(self, rows: Rows | NDArray[np.bool_]) -> EmittingTriangles:
        """Some of them."""
        return EmittingTriangles(self.scene, self.triangle[rows], self.corners[rows], self.radiance[rows])

    @property
    def cones(self) -> NDArray[np.float32]:
        """The cones (T, 4) into which they shine."""
        return self.scene.cones[self.scene.object_of_triangle[self.triangle]]

    @property
    def kinds(self) -> Rows:
        """Which triangles (T,) may be merged: textured ones of one object, whatever their radiance, and others of equal
        radiance and cone."""
        owners = self.scene.object_of_triangle[self.triangle]
        emission = np.concatenate([self.radiance, self.cones], axis=1)
        alike = np.unique(emission, axis=0, return_inverse=True)[1].ravel()
        return np.where(np.isin(owners, self.scene.emission_textures.objects), -1 - owners, alike)

    def radiance_of_parts(self, merged: MergedTriangles) -> Emitted | None:
        """The radiance of parts of triangles into which these are merged, for `emitter_tree`; None where it is the same
        all over each."""
        owners = self.scene.object_of_triangle[self.triangle[merged.source]]
        varies = merged.is_part & np.isin(owners, self.scene.emission_textures.objects)
        if not varies.any():
            return None

        def emitted(parts: Float64Array, roots: Rows) -> Float64Array:
            found, rows = merged.radiance[roots].copy(), np.flatnonzero(varies[roots])
            source = merged.source[roots[rows]]
            triangle = self.triangle[source]
            factor = self.scene.emission_textures.means(triangle, barycentrics(self.corners[source], parts[rows]))
            found[rows] = self.scene.emission[self.scene.object_of_triangle[triangle]] * factor
            return found

        return emitted


def emitting_triangles_of(scene: Scene) -> EmittingTriangles:
    """All triangles of emitters, dark ones as well, with their mean radiance."""
    triangle = np.flatnonzero(scene.emitters[scene.object_of_triangle])
    corners = scene.vertices[scene.triangles[triangle]].astype(np.float64)
    whole = np.broadcast_to(_WHOLE, (len(triangle), 3, 2))
    radiance = scene.emission[scene.object_of_triangle[triangle]] * scene.emission_textures.means(triangle, whole)
    return EmittingTriangles(scene, triangle, corners, radiance.astype(np.float64))


def mean_emission(scene: Scene, i_object: int) -> Float64Array:
    """The mean radiance (3,) of an emitter over its area."""
    emitting = emitting_triangles_of(scene)
    emitting = emitting.of(scene.object_of_triangle[emitting.triangle] == i_object)
    edges = emitting.corners[:, 1:] - emitting.corners[:, :1]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return np.asarray(np.average(emitting.radiance, axis=0, weights=areas))


@dataclass(frozen=True, eq=False)
class EmittingParts:
    """Parts of emitting triangles by a grid, each of which is sampled by its power: triangle (K,) of the scene, corners
    (K, 3, 2), their u and v, radiance (K, 3), area (K,). Of all triangles of the scene: first (T,), the number of a
    triangle's first part, −1 for none, and along (T,), the parts along its edges."""

    triangle: Rows
    corners: Float64Array
    radiance: Float64Array
    area: Float64Array
    first: NDArray[np.int64]
    along: NDArray[np.int64]

    @property
    def power(self) -> Float64Array:
        """Luminance times area (K,)."""
        return np.asarray(self.area * (self.radiance @ LUMINANCE))

    def find(self, triangle: Rows, u: NDArray, v: NDArray) -> Rows:
        """The part (N,) at points of triangles (N,), −1 where a triangle emits nothing."""
        n = self.along[triangle]
        column, row = (np.minimum((each * n).astype(np.int64), n - 1) for each in (u, v))
        row = np.minimum(row, n - 1 - column)
        is_upper = (u * n - column) + (v * n - row) > 1.0
        is_upper &= column + row < n - 1  # the last of a diagonal has no other half
        part = self.first[triangle] + row * (2 * n - row) + 2 * column + is_upper
        return np.where(self.first[triangle] >= 0, part, -1)


def emitting_parts(scene: Scene) -> EmittingParts:
    """The parts of all triangles that light the scene: of textured ones many, of others one."""
    emitting = emitting_triangles_of(scene)
    areas = np.linalg.norm(np.cross(*(emitting.corners[:, 1:] - emitting.corners[:, :1]).swapaxes(0, 1)), axis=1) / 2.0
    keep = (areas > 0.0) & emitting.radiance.any(axis=1)
    emitting, areas = emitting.of(keep), areas[keep]
    textured = np.isin(scene.object_of_triangle[emitting.triangle], scene.emission_textures.objects)
    n_along = int(np.clip((_MOST_PARTS / max(int(textured.sum()), 1)) ** 0.5, 1, _MOST_ALONG))
    along = np.zeros(len(scene.triangles), np.int64)
    along[emitting.triangle] = np.where(textured, n_along, 1)
    counts = along[emitting.triangle] ** 2
    first = np.full(len(scene.triangles), -1, np.int64)
    first[emitting.triangle] = np.cumsum(counts) - counts
    own = np.repeat(np.arange(len(counts)), counts)
    triangle, corners = emitting.triangle[own], np.broadcast_to(_WHOLE, (len(own), 3, 2)).copy()
    radiance, area = emitting.radiance[own], areas[own] / counts[own]
    if textured.any():
        rows = np.flatnonzero(textured[own])
        corners[rows] = np.tile(_grid(n_along), (int(textured.sum()), 1, 1))
        factor = scene.emission_textures.means(triangle[rows], corners[rows])
        radiance[rows] = scene.emission[scene.object_of_triangle[triangle[rows]]] * factor
    return EmittingParts(triangle, corners, radiance, area, first, along)


_WHOLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


@lru_cache(maxsize=4)
def _grid(n: int) -> Float64Array:
    """The n² equal parts (n², 3, 2) of a triangle, row by row: each cell's lower half, then its upper one."""
    found = []
    for row in range(n):
        for column in range(n - row):
            place = np.array([column, row])
            found.append((_WHOLE + place) / n)
            if column + row < n - 1:
                found.append((place + 1 - _WHOLE) / n)
    return np.array(found)


@lru_cache(maxsize=_MOST_HALVINGS)
def _centres(halvings: int) -> Float64Array:
    """The centres (4^n, 3) of the equal parts of a triangle whose edges are halved n times, barycentric."""
    parts = np.eye(3)[None]
    for _ in range(halvings):
        parts = quarters(parts).reshape(-1, 3, 3)
    return np.asarray(parts.mean(axis=1))


def barycentrics(triangles: Float64Array, places: Float64Array) -> Float64Array:
    """u and v (N, K, 2) in triangles (N, 3, 3) of places (N, K, 3) in their planes."""
    one, two = (triangles[:, 1:] - triangles[:, :1]).swapaxes(0, 1)
    away = places - triangles[:, :1]
    a, b, c = (np.einsum("ni,ni->n", x, y) for x, y in ((one, one), (one, two), (two, two)))
    along, across = np.einsum("nki,ni->nk", away, one), np.einsum("nki,ni->nk", away, two)
    whole = np.maximum(a * c - b * b, 1e-300)[:, None]
    u = (c[:, None] * along - b[:, None] * across) / whole
    v = (a[:, None] * across - b[:, None] * along) / whole
    return np.stack([u, v], axis=2)


def _areas(corners: Float64Array) -> Float64Array:
    """The shares (N,) of a triangle that parts with corners (N, 3, 2) in u and v have."""
    one, two = (corners[:, 1:] - corners[:, :1]).swapaxes(0, 1)
    return np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
