"""The pixels that show an object, where more is to be known of them than what lies between its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.deform.points import BendingPoints
from engine.deform.raster import Drawn
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections
from engine.scene.surface_uvs import uvs_at

Indices = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Pixels:
    """N pixels: rows and columns (N,); triangle (N,) that each shows, and the shares (N, 3) of its corners; whether its
    front is seen (N,); points (N, 3) at the corners on that side, -1 for none; at: where on the scene's meshes."""

    rows: Indices
    columns: Indices
    triangle: Indices
    weights: NDArray[np.float32]
    is_front: NDArray[np.bool_]
    points: Indices
    at: Intersections

    def uvs(self, scene: Scene) -> NDArray[np.float64]:
        """Texture coordinates (N, 2)."""
        return uvs_at(scene, self.at.triangle, self.at.u, self.at.v)


def pixels_of(i_object: int, drawn: Drawn, points: BendingPoints) -> Pixels | None:
    """Those that show an object; None where none does."""
    surface, sees = points.surface, drawn.found >= 0
    rows, columns = np.nonzero(sees & (surface.i_object[np.where(sees, drawn.found, 0)] == i_object))
    if not len(rows):
        return None
    triangle, weights = drawn.found[rows, columns], drawn.weights(rows, columns)
    is_front = drawn.front[triangle] > 0.0
    sides = surface.sides[triangle, np.where(is_front, 0, 1)]
    u, v = np.einsum("nk,nki->in", weights, points.within[triangle])
    at = Intersections(points.source[triangle], u, v, np.zeros(len(u), np.float32))
    return Pixels(rows, columns, triangle, weights, is_front, sides, at)
