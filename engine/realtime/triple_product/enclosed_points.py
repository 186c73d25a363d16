"""Finds shading points inside something solid: of a floor beneath walls, of a wall behind a skirting board."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.realtime.triple_product.shading_points import ShadingPoints
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

_RAYS, _AT_ONCE = 8, 4096
_MOST = 0.5  # share of a point's rays


def find_enclosed(
    scene: Scene, caster: RayCaster, points: ShadingPoints, first: int = 0
) -> Generator[None, None, NDArray[np.bool_]]:
    """Find which of the points from `first` on (S - first,) see sides that light cannot reach with more than `_MOST` of
    their rays, in pieces.

    caster: intersects the scene's triangles. `ShadingPoints.sides` tells which sides are dark: a point that sees the
    inside of a solid, which no light reaches, is inside it.
    """
    found, tables = np.zeros(len(points) - first, bool), cosine_tables(_RAYS)
    frames = points.frames[:, [0, 2, 1]]  # the tables' third axis is the normal
    for start in range(first, len(points), _AT_ONCE):
        some = np.arange(start, min(start + _AT_ONCE, len(points)))
        ways = np.einsum("nrk,nki->nri", tables[some % len(tables)], frames[some]).reshape(-1, 3)
        met = caster.intersect(np.repeat(points.lifted[some], _RAYS, axis=0), np.ascontiguousarray(ways)).triangle
        side = (np.einsum("rk,rk->r", scene.geometric_normals[met], ways) > 0.0).astype(np.intp)
        is_dark = (met >= 0) & ~points.sides[scene.object_of_triangle[met], side]
        found[some - first] = is_dark.reshape(-1, _RAYS).mean(axis=1) > _MOST
        yield
    return found
