"""Finds the sides of objects that light can reach.

Winding alone does not tell which sides light can reach. A room may be wound outwards, a floor downwards, and half of a
shell against the other half; and the inside of a solid, which the winding faces away from as well, is no side that
anybody sees. So a few thousand random walks start at all emitters and from far away, whether or not there is light now,
and continue from surface to surface as light does [Veach97, ch. 8]; sides that they rarely meet count as dark. The
result depends on geometry alone. So does the second result: which backs pass light on to other surfaces. The walls of a
room that is wound outwards do; the underside of a floor does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]

_PATHS = 8192  # random walks from far away, and as many from emitters
_N_SURFACES = 5  # surfaces that a walk meets
# Walks that pass through a crack between two triangles are fewer than this share of those that meet the object.
_LEAST_SHARE, _LEAST_HITS = 0.005, 8
_RELAYED = 0.02  # share of all light between surfaces that a back must pass on


class Sides(NamedTuple):
    """reached (M, 2): whether light can reach objects on the side that their winding faces, and on the other; the first
    side alone if it reaches neither. relays (M,): whether an object's back passes much of it on to other surfaces."""

    reached: NDArray[np.bool_]
    relays: NDArray[np.bool_]


def lit_sides(scene: Scene, caster: RayCaster) -> Sides:
    """Find the lit sides of a scene; caster: intersects its triangles."""
    if not len(scene.triangles):
        return Sides(np.zeros((0, 2), bool), np.zeros(0, bool))
    chance = np.random.default_rng(3)
    counts, sent = np.zeros((2, len(scene.smooth), 2), np.int64)
    last: NDArray[np.intp] | None = None
    origins, directions = _from_afar(scene, chance)
    if scene.emitters.any():
        more = _from_emitters(scene, caster, chance)
        origins, directions = np.concatenate([origins, more[0]]), np.concatenate([directions, more[1]])
    for _ in range(_N_SURFACES):
        found = caster.intersect(origins.astype(np.float32), directions.astype(np.float32))
        hit = found.triangle >= 0
        if last is not None:
            np.add.at(sent, tuple(last[hit].T), 1)
        triangle, towards = found.triangle[hit], directions[hit]
        normals = scene.geometric_normals[triangle].astype(np.float64)
        is_back = np.einsum("nk,nk->n", normals, towards) > 0.0
        last = np.stack([scene.object_of_triangle[triangle], is_back], axis=1).astype(np.intp)
        np.add.at(counts, tuple(last.T), 1)
        normals[is_back] *= -1.0
        place = origins[hit] + found.distance[hit, None] * towards
        origins, directions = caster.offset_origins(place, normals).astype(np.float64), _diffusely(normals, chance)
    reached = (counts >= _LEAST_HITS) & (counts >= _LEAST_SHARE * counts.sum(axis=1, keepdims=True))
    reached[~reached.any(axis=1), 0] = True
    return Sides(reached, reached[:, 1] & (sent[:, 1] >= _LEAST_HITS) & (sent[:, 1] >= _RELAYED * sent.sum()))


def _from_afar(scene: Scene, chance: np.random.Generator) -> tuple[Float64Array, Float64Array]:
    """Start rays in every direction, spread over the disc of the scene's bounding sphere."""
    corners = scene.vertices[scene.triangles].reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre, radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0
    towards = _unit(chance.normal(size=(_PATHS, 3)))
    across = _unit(np.cross(towards, _unit(chance.normal(size=(_PATHS, 3)))))  # uniform around the direction
    away = radius * np.sqrt(chance.random((_PATHS, 1)))
    return centre - 1.01 * radius * towards + away * across, towards


def _from_emitters(scene: Scene, caster: RayCaster, chance: np.random.Generator) -> tuple[Float64Array, Float64Array]:
    """Start rays on the fronts of all potential emitters, uniformly by area."""
    mine = np.flatnonzero(scene.emitters[scene.object_of_triangle])
    corners = scene.vertices[scene.triangles[mine]].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not area.sum() > 0.0:  # all of them are hidden
        return np.zeros((0, 3)), np.zeros((0, 3))
    which = chance.choice(len(mine), _PATHS, p=area / area.sum())
    place = np.einsum("nk,nki->ni", chance.dirichlet((1.0, 1.0, 1.0), _PATHS), corners[which])
    normals = scene.geometric_normals[mine[which]].astype(np.float64)
    return caster.offset_origins(place, normals).astype(np.float64), _diffusely(normals, chance)


def _diffusely(normals: Float64Array, chance: np.random.Generator) -> Float64Array:
    """Cosine-distributed directions (N, 3) about normals (N, 3): a point on a unit sphere that touches the surface."""
    return _unit(normals + 0.999 * _unit(chance.normal(size=normals.shape)))


def _unit(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
