"""The pixels of a rasterized picture that show an object: where on its triangles they are, what images give them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import LayerMaps
from engine.realtime.core.raster import RasterResult
from engine.realtime.core.terms import map_factor
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.scene.map_sampler import mean_over_pixels
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene
from engine.texture.pyramid import Pyramid

Float32Array = NDArray[np.float32]
IntegerArray = NDArray[np.integer]
Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pixels:
    """N pixels: rows and columns (N,); the triangle (N,) that each shows, and barycentric weights (N, 3); is_front
    (N,); points (N, 3) at the corners on the visible side, -1 for none."""

    rows: IntegerArray
    columns: IntegerArray
    triangle: IntegerArray
    weights: Float32Array
    is_front: NDArray[np.bool_]
    points: IntegerArray
    _drawn: RasterResult
    _all: BendingPoints

    def find_hits(self) -> Intersections:
        """Positions on the scene's meshes."""
        u, v = np.einsum("nk,nki->in", self.weights, self._all.within[self.triangle])
        return Intersections(self._all.source[self.triangle], u, v, np.zeros(len(u), np.float32))

    def places(self) -> Float32Array:
        """Positions in the current pose (N, 3)."""
        corners = self._all.places[self._all.surface.corners[self.triangle]]
        return np.asarray(np.einsum("nk,nki->ni", self.weights, corners), np.float32)

    def uvs(self, scene: Scene) -> Float64Array:
        """Texture coordinates (N, 2) in the first set, on which detail lies."""
        return np.einsum("nk,nki->ni", self.weights, self._corner_uvs(scene)[..., :2])

    def factor(self, scene: Scene, maps: LayerMaps, is_quick: bool) -> Float32Array:
        """Factor of images and strokes for a layer (N, 3): the mean over the pixel that Placement has, or is_quick by
        fewer look-ups."""
        if maps.is_plain:
            return np.ones((1, 3), np.float32)
        corners = self._corner_uvs(scene)
        uv, right, below = (
            np.einsum("nk,nki->ni", self._drawn.weights(self.rows, self.columns, *beside), corners)
            for beside in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
        )
        footprints = uv, right - uv, below - uv

        def sample(image: Pyramid, repeats: tuple[float, float]) -> Float32Array:
            return mean_over_pixels(image, footprints, repeats, is_quick)

        return np.asarray(map_factor(scene, maps, len(uv), sample, self.find_hits), np.float32)

    def _corner_uvs(self, scene: Scene) -> Float64Array:
        """Texture coordinates of the visible triangles' corners (N, 3, 2 K)."""
        return self._all.corner_uvs(scene, self.triangle)


def pixels_of(i_object: int, drawn: RasterResult, points: BendingPoints) -> Pixels | None:
    """The pixels that show an object; None if there are none."""
    surface, sees = points.surface, drawn.found >= 0
    rows, columns = np.nonzero(sees & (surface.i_object[np.where(sees, drawn.found, 0)] == i_object))
    if not len(rows):
        return None
    triangle, is_front = drawn.found[rows, columns], drawn.front[drawn.found[rows, columns]] > 0.0
    sides = surface.sides[triangle, np.where(is_front, 0, 1)]
    return Pixels(rows, columns, triangle, drawn.weights(rows, columns), is_front, sides, drawn, points)
