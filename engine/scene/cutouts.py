"""Where rays pass through a scene's surfaces, by the opacity of its objects (`engine.material.opacity`).

Opacity is that of the point a ray meets, interpolated between the texels of the full image and not filtered: the edge
of a hole is as sharp as the image says, and several rays through a pixel make it smooth, as at the edge of a mesh.

Where a surface blends, each ray has a number in [0, 1), its chance, and the surface is there for it where the opacity
is higher (`engine.scene.raycaster`). The same ray always gives the same answer. The chances of the rays through one
pixel are spread evenly (`pixel_chances`), those of all other rays are hashes of their origins and directions."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.material.opacity import Opacity
from engine.scene.raycaster import LAST_CHANCE, RayCaster
from engine.scene.surface_uvs import colours_at, uvs_at
from engine.texture.pyramid import Pyramid

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


# (u, v) of the middles of 64 triangles into which one is divided evenly.
_PLACES = [((3 * i + 1) / 24, (3 * j + 1) / 24) for i in range(8) for j in range(8 - i)] + [
    ((3 * i + 2) / 24, (3 * j + 2) / 24) for i in range(7) for j in range(7 - i)
]


@dataclass(frozen=True, eq=False)
class Cutouts:
    """Which points of a scene's surfaces rays meet. Safe to use from several threads.

    passable (T,): triangles that rays may pass. source (T,) and within (T, 3, 2): where the triangles are parts of the
    scene's own, which of them, and u and v of the corners in it; None where they are the scene's own.
    """

    scene: Scene
    opacities: dict[int, Opacity]
    passable: NDArray[np.bool_]
    images: dict[int, Pyramid] = field(default_factory=dict)
    source: NDArray[np.integer] | None = None
    within: NDArray[np.floating] | None = None

    @property
    def blends(self) -> bool:
        """Whether chances count."""
        return any(each.opacity_mode == "blend" for each in self.opacities.values())

    @cached_property
    def digest(self) -> str:
        """Identifies what rays pass through; empty if they pass nowhere."""
        if not self.opacities:
            return ""
        found = hashlib.blake2b(repr(sorted(self.opacities.items())).encode(), digest_size=16)
        for i, image in sorted(self.images.items()):
            found.update(repr((i, image.shapes)).encode() + image.levels[0].tobytes())
        for values in (self.scene.uvs, self.scene.colours):
            found.update(b"" if values is None else values.tobytes())
        return found.hexdigest()

    def of_parts(self, source: NDArray[np.integer], within: NDArray[np.floating]) -> Cutouts:
        """The same for triangles that lie in the scene's own, see the class."""
        return Cutouts(self.scene, self.opacities, self.passable[source], self.images, source, within)

    def opacity_at(self, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> Float64Array:
        """The opacity (N,) at points of triangles (N,): of a masked surface 0 or 1."""
        if self.source is not None and self.within is not None:
            corners = self.within[triangle].astype(np.float64)
            shares = np.stack([1.0 - u - v, u, v], axis=1)
            u, v = np.einsum("nk,nki->in", shares, corners)
            triangle = self.source[triangle]
        opacity = np.ones(len(triangle))
        objects = self.scene.object_of_triangle[triangle]
        for i, own in self.opacities.items():
            rows = np.flatnonzero(objects == i)
            if len(rows):
                alpha = self._alpha(i, triangle[rows], u[rows], v[rows])
                opacity[rows] = alpha >= own.opacity_cutoff if own.opacity_mode == "mask" else alpha
        return opacity

    def mean_opacity(self, triangle: NDArray[np.integer]) -> Float64Array:
        """The opacity (N,) of triangles (N,), averaged over places of equal areas."""
        opacity = np.ones(len(triangle))
        rows = np.flatnonzero(self.passable[triangle])
        shares = np.tile(np.array(_PLACES, np.float64), (len(rows), 1))
        found = self.opacity_at(np.repeat(triangle[rows], len(_PLACES)), shares[:, 0], shares[:, 1])
        opacity[rows] = found.reshape(len(rows), len(_PLACES)).mean(axis=1)
        return opacity

    def _alpha(self, i_object: int, triangle: NDArray[np.integer], u: NDArray, v: NDArray) -> Float64Array:
        own, scene = self.opacities[i_object], self.scene
        alpha = np.full(len(triangle), own.opacity_factor)
        if (image := self.images.get(i_object)) is not None:
            alpha *= image.at(uvs_at(scene, triangle, u, v), repeats=own.opacity_repeats)[:, 0]
        if own.opacity_vertices:
            alpha *= colours_at(scene, triangle, u, v)[:, 3]
        return alpha


def scene_cutouts(scene: Scene) -> tuple[Cutouts, dict[str, LoadError]]:
    """The cutouts of a scene, and the errors in images of objects, by name; these objects are opaque."""
    opacities, images, flaws = dict[int, Opacity](), dict[int, Pyramid](), dict[str, LoadError]()
    for i, described in enumerate(scene.description.objects):
        if not described.opacity.lets_pass:
            continue
        try:
            image = scene.textures.opacity(described.opacity)
        except LoadError as error:
            # A new error: a raised one refers to its traceback, which refers to the scene.
            flaws[described.name] = LoadError(error.file, error.what, error.value, error.expected)
            continue
        opacities[i] = described.opacity
        if image is not None:
            images[i] = image
    passable = np.isin(scene.object_of_triangle, list(opacities))
    return Cutouts(scene, opacities, passable, images), flaws


def scene_caster(scene: Scene) -> RayCaster:
    """The ray caster of a scene."""
    return RayCaster(scene.vertices, scene.triangles, cutouts=scene.cutouts)


def pixel_chances(places: NDArray[np.floating], width: int) -> Float32Array:
    """Chances (N,) of rays through a picture of this width at places (N, 2): columns and rows, in pixels.

    The rays of a pixel have different columns (`engine.scene.edges.ray_offsets`): with n of them, one chance lies in
    each n-th of [0, 1), so that their coverage is exact to 1 / n. Pixels differ by a hash.
    """
    column, row = np.floor(places).astype(np.int64).T
    mixed = (row * width + column + 1).astype(np.uint32) * np.uint32(0x9E3779B1)
    mixed = (mixed ^ (mixed >> np.uint32(15))) * np.uint32(0x85EBCA6B)
    start = (mixed ^ (mixed >> np.uint32(13))).astype(np.float64) * 2.0**-32
    return ((start + places[:, 0] - column) % 1.0).astype(np.float32)


def covered_in_part(scene: Scene, caster: RayCaster, directions: Float32Array) -> NDArray[np.bool_]:
    """Which rays from the camera, along directions (N, 3), meet a blending surface: its coverage of a pixel takes
    several."""
    if not scene.cutouts.blends:
        return np.zeros(len(directions), bool)
    n, origins = len(directions), np.tile(scene.camera_position.astype(np.float32), (len(directions), 1))
    first, last = (caster.intersect(origins, directions, np.full(n, each)) for each in (0.0, LAST_CHANCE))
    return first.triangle != last.triangle
