"""The emitters of a scene as lamps of few parts, where a pose has them, and their light by rays."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.triangles import quarters
from engine.light.cones import cone_shares
from engine.light.emitters import Emitted, EmitterTree, emitter_tree, emitting_triangles, merge_triangles
from engine.light.environment import LUMINANCE
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.pose import Motion, Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.emission_textures import emitting_triangles_of
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.sphere.harmonics import basis

Float64Array = NDArray[np.float64]

N_LAMP_SAMPLES = 64  # on each lamp: a ball is then 1 % off (`engine.light.emitters`)
N_TEXTURED_SAMPLES = 128  # on a lamp with a texture
N_MOVING_SAMPLES = 32  # on a wide lamp that moving gloss mirrors
_LEAST_WIDE = 0.03  # of the scene's extent: a lamp that hides a part of the sky
SHORTENED = 1.0 - 1e-3  # of rays to lamps, which must not meet these themselves


class LampSample(NamedTuple):
    """A part of an emitter: the centre of its light (3,) with its normal (3,) and area, the cone (4,) that it sends its
    light into, and by what its texture multiplies the emission there (3,); target (3,): where on it rays go, so that no
    straight edge of a shadow passes many at once."""

    place: Float64Array
    normal: Float64Array
    area: float
    cone: NDArray[np.float32]
    tint: Float64Array
    target: Float64Array


@dataclass(frozen=True, eq=False)
class Lamp:
    """An emitter: its parts, fewer for moving pictures, and its radiance (3,)."""

    samples: Sequence[LampSample]
    few: Sequence[LampSample]
    emission: Float64Array

    @cached_property
    def rows(self) -> Float64Array:
        """Its parts (N, 14): place, normal, area, cone, tint."""
        return np.array([np.hstack([*each[:5]]) for each in self.samples]).reshape(-1, 14)


def _compact_order(places: Float64Array) -> NDArray[np.intp]:
    """An order of places (N, 3) whose halves, quarters and so on are each on one side of a plane."""
    order = np.arange(len(places))
    if len(places) < 2 or not np.ptp(places, axis=0).any():
        return order
    order = np.argsort(places[:, np.argmax(np.ptp(places, axis=0))], kind="stable")
    halves = order[: len(order) // 2], order[len(order) // 2 :]
    return np.concatenate([half[_compact_order(places[half])] for half in halves])


class PosedLamps:
    """The emitters of a scene in poses, by few parts each."""

    def __init__(self) -> None:
        self._scene: tuple[Scene, Poses, Scene] | None = None
        self._vertices: NDArray[np.float32] | None = None
        self._samples: dict[int, tuple[Motion, list[LampSample], list[LampSample]]] = {}

    def scene(self, scene: Scene, placements: Poses) -> Scene:
        """A scene at rest with its emitters where they shine; the same one as long as both are."""
        if self._scene is None or self._scene[0] is not scene or self._scene[1] != placements:
            self._scene = scene, placements, pose_scene(scene, placements)
        return self._scene[2]

    def lamps(self, scene: Scene, placements: Poses) -> dict[int, Lamp]:
        """The lamps of a scene, by the indices of the objects that emit."""
        if self._vertices is not scene.vertices:  # they are one array whatever the scene emits
            self._vertices, self._samples = scene.vertices, {}
        found, rows = dict[int, Lamp](), dict(placements)
        for i in emitters_of(scene):
            row = rows.get(scene.object_names[i], ())
            if i not in self._samples or self._samples[i][0] != row:
                posed = self.scene(scene, placements)
                self._samples[i] = row, lamp_samples(posed, i), lamp_samples(posed, i, N_MOVING_SAMPLES)
            found[i] = Lamp(*self._samples[i][1:], scene.emission[i].astype(np.float64))
        return found


def emitters_of(scene: Scene) -> list[int]:
    """The objects that emit and are shown."""
    return [i for i in np.flatnonzero(scene.emitters).tolist() if np.ptp(scene.triangle_ranges[i])]


def hiding_lamps(scene: Scene) -> list[int]:
    """The lamps that are wide enough to hide a part of the sky."""
    if not len(scene.vertices):
        return []
    least = _LEAST_WIDE * float(np.linalg.norm(np.ptp(scene.vertices, axis=0)))
    lamps = [i for i in emitters_of(scene) if scene.lights[i]]
    return [i for i in lamps if np.linalg.norm(np.ptp(scene.vertices[slice(*scene.vertex_ranges[i])], axis=0)) > least]


def lamp_placements(scene: Scene, poses: Poses) -> Poses:
    """What poses say of where the emitters of a scene shine."""
    names = {scene.object_names[i] for i in emitters_of(scene)}
    return tuple((name, row) for name, row in poses if name in names and row)


def lamp_samples(scene: Scene, i: int, n: int = 0) -> list[LampSample]:
    """About n parts of an emitter, of equal area, or of equal power of one with a texture; n = 0: `N_LAMP_SAMPLES`, or
    `N_TEXTURED_SAMPLES` with a texture. Each block of them is close together."""
    emitting = emitting_triangles_of(replace(scene, emission=np.ones_like(scene.emission)))
    mine = scene.object_of_triangle[emitting.triangle] == i
    emitting = emitting.of(mine & emitting_triangles(emitting.corners, emitting.radiance))
    is_textured = i in scene.emission_textures.objects
    n = n or (N_TEXTURED_SAMPLES if is_textured else N_LAMP_SAMPLES)
    one_kind = np.zeros(len(emitting.corners), np.intp)
    merged = merge_triangles(emitting.corners, emitting.radiance, n // 2 if is_textured else n, one_kind)
    varying = emitting.radiance_of_parts(merged)
    tree = emitter_tree(merged.corners, merged.radiance, n, _power if is_textured else None, varying=varying)
    places, of = _bright_centres(tree, varying), tree.leaves
    numbers = (each.astype(np.float64) for each in (places, of.normal, of.area, of.radiance, of.samples))
    found = [
        LampSample(place, normal, area, scene.cones[i], tint, target)
        for place, normal, area, tint, target in zip(*numbers, strict=True)
    ]
    return [found[k] for k in _compact_order(np.array([sample.place for sample in found]).reshape(-1, 3))]


def _bright_centres(tree: EmitterTree, varying: Emitted | None) -> NDArray[np.floating]:
    """The centres (N, 3) of the leaves' light, which is even unless it varies: of sixteen parts by their power. Places
    at random in each leaf are twice as far off."""
    if varying is None:
        return tree.leaves.centre
    leaf = np.flatnonzero(tree.child < 0)
    root = leaf[np.argsort(tree.first[leaf])]
    while (above := tree.parent[root]).max() >= 0:
        root = np.where(above >= 0, above, root)
    parts = tree.leaves.corners.astype(np.float64)
    for _ in range(2):
        parts = quarters(parts).reshape(-1, 3, 3)
    power = varying(parts, np.repeat(root, 16)).reshape(-1, 16, 3) @ LUMINANCE + 1e-30
    return np.einsum("ns,nsk->nk", power, parts.mean(axis=1).reshape(-1, 16, 3)) / power.sum(axis=1, keepdims=True)


def _power(corners: Float64Array, roots: NDArray[np.intp], radiance: Float64Array) -> Float64Array:
    """The power (K,) of triangles (K, 3, 3) with radiance (K, 3), twice."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(across, axis=1) * (radiance @ LUMINANCE))


def light_by_rays(
    points: BendingPoints, i: int, lamp: Sequence[LampSample], casters: tuple[int, ...]
) -> Generator[float, None, tuple[Float64Array, Float64Array]]:
    """Radiance (P, 3) of an object's white diffuse points at rest by a lamp of emission 1, past casters; the share (P,)
    of its light that arrives. Yields the share that is done."""
    mesh = points.mesh(i, ())
    places, normals = mesh.points.offset_position.astype(np.float64), mesh.frames[:, 2]
    found, unblocked = np.zeros((len(places), 3)), np.zeros(len(places))
    for k, sample in enumerate(lamp):
        directions, factor = towards_lamp(places, sample)
        factor *= np.maximum(np.einsum("pc,pc->p", directions, normals), 0.0) / np.pi
        lit = np.flatnonzero(factor > 0.0)
        arrives = factor[lit] * ~is_blocked(points.caster(casters), places[lit], sample.target)
        found[lit] += arrives[:, None] * sample.tint
        unblocked += factor * sample.tint.sum()
        yield k / len(lamp)
    return found, found.sum(axis=1) / np.maximum(unblocked, 1e-30)


def light_around(
    points: BendingPoints, place: Float64Array, lamp: Sequence[LampSample], casters: tuple[int, ...], order: int
) -> tuple[Float64Array, float]:
    """Harmonics (n^2, 3) of a lamp of emission 1 at a place (3,) past casters at rest, and the share of its light that
    arrives there."""
    seen = [towards_lamp(place[None], sample) for sample in lamp]
    towards, angles = (np.concatenate(each) for each in zip(*seen, strict=True))
    powers = angles[:, None] * np.array([sample.tint for sample in lamp])
    arrives = powers.copy()
    if casters:
        targets = np.array([sample.target for sample in lamp])
        arrives[is_blocked(points.caster(casters), np.tile(place, (len(lamp), 1)), targets)] = 0.0
    share = arrives.sum() / max(powers.sum(), 1e-30)
    return basis(towards, order).T @ arrives, float(share)


def towards_lamp(places: Float64Array, sample: LampSample) -> tuple[Float64Array, Float64Array]:
    """Directions (P, 3) from places (P, 3) to a part of a lamp, and the solid angle of its front there (P,) times the
    share of its light that its cone sends there."""
    to = sample.place - places
    distance = np.maximum(np.linalg.norm(to, axis=1), 1e-12)
    directions = to / distance[:, None]
    facing = np.maximum(-(directions @ sample.normal), 0.0) * sample.area
    # As of a disc, at most half of all directions.
    angle = 2.0 * np.pi * facing / (2.0 * np.pi * distance**2 + facing)
    return directions, angle * cone_shares(sample.cone, directions)


def is_blocked(caster: RayCaster, places: Float64Array, targets: Float64Array) -> NDArray[np.bool_]:
    """Whether something lies between places (P, 3) and those of a lamp (P, 3), or one (3,)."""
    to = (targets - places).astype(np.float32)
    return caster.occluded(places.astype(np.float32), to, np.full(len(to), SHORTENED, np.float32))
