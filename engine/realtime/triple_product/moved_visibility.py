"""What shading points see while objects are moved by hand: coarse, and only what changes.

The bits of a point are what the rest of the scene leaves free, less what the moved objects cover now:

    visible(ω) = rest(ω) · ¬moved(ω) .

A point finds the first factor once, when a movement concerns it for the first time: only triangles that are blocked
towards the objects are asked, of the rest of the scene. For each step of the movement one ray goes through the middle
of each triangle of level 3 that may meet an object, of level 4 once there is time, and asks these objects alone.
Emitters' patches likewise, by the rays to their places; those of lamps that move are few, and each stands for the
others around it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.light.emitters import EmitterPatches
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.triple_product import _move_kernels as kernels
from engine.realtime.triple_product.lit_points import LitPoints
from engine.realtime.triple_product.visibility import N_UPPER, SHORT, Bits, upper_directions
from engine.scene.moved_caster import MovedCaster

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Rows = NDArray[np.int64]
_Query = Callable[[Float32Array, Float32Array], NDArray[np.bool_]]

FEW_PATCHES = 8  # of a lamp that moves, to which rays go
_POINTS_AT_ONCE = 32


class MovedVisibility:
    """Visibility of points where some objects stand apart from the rest; see the module."""

    def __init__(self, lit: LitPoints, caster: MovedCaster) -> None:
        """lit: whose bits are changed; caster: with the objects where these have them."""
        self._lit, self._separated = lit, caster
        self._rest, self._rest_patches = np.empty_like(lit.bits), np.empty_like(lit.patch_bits)
        self._is_known = np.zeros(len(lit.bits), bool)

    def follow(self) -> None:
        """Follow points that were added, after all others."""
        n = len(self._lit.bits) - len(self._rest)
        if n:
            self._rest, self._rest_patches = (
                np.concatenate([each, np.empty((n, each.shape[1]), np.uint8)])
                for each in (self._rest, self._rest_patches)
            )
            self._is_known = np.concatenate([self._is_known, np.zeros(n, bool)])

    def update(
        self, caster: MovedCaster, patches: EmitterPatches | None, stays: NDArray[np.bool_], which: Rows,
        is_coarse: bool,
    ) -> NDArray[np.bool_]:  # fmt: skip
        """See the objects at points (N,) where they are now, by this caster, and patches of lamps that stay (L,) where
        they are; returns whether the points see something else than before (N,). is_coarse: by triangles of level 3."""
        lit, spheres = self._lit, caster.spheres
        self._separate(patches, stays, which[~self._is_known[which]])
        before, before_patches = lit.bits[which], lit.patch_bits[which]
        lit.bits[which] = self._rest[which]
        _ask(lit.points, which, spheres, 4 if is_coarse else 1, lit.bits, True, caster.parts_block)
        if patches is not None:
            keep = np.packbits(stays, bitorder="little")
            lit.patch_bits[which] = self._rest_patches[which] & keep | before_patches & ~keep
            _ask_patches(lit.points, which, spheres, patches, stays, lit.patch_bits, True, caster.parts_block)
        changed = (lit.bits[which] != before).any(axis=1)
        return np.asarray(changed | (lit.patch_bits[which] != before_patches).any(axis=1))

    def _separate(self, patches: EmitterPatches | None, stays: NDArray[np.bool_], which: Rows) -> None:
        """Find what the rest of the scene leaves free at points (N,)."""
        lit, caster = self._lit, self._separated
        self._rest[which], self._rest_patches[which] = lit.bits[which], lit.patch_bits[which]
        _ask(lit.points, which, caster.spheres, 1, self._rest, False, caster.rest.occluded)
        if patches is not None:
            rest = self._rest_patches
            _ask_patches(lit.points, which, caster.spheres, patches, stays, rest, False, caster.rest.occluded)
        self._is_known[which] = True


def see_lamp(
    points: ShadingPoints, caster: MovedCaster, patches: EmitterPatches, mine: NDArray[np.bool_], lamp: int,
    which: Rows, patch_bits: Bits,
) -> None:  # fmt: skip
    """Write which patches of a lamp that moves, mine (L,), points (N,) see: by rays to a few, each of which stands for
    the others around it. lamp: its index; it does not hide itself."""
    own = np.flatnonzero(mine)
    few, nearest = _representatives(patches.centre[own].astype(np.float64), patches.normal[own].astype(np.float64))
    samples = patches.samples[own[few]]
    origins = np.repeat(points.lifted[which], len(few), axis=0)
    directions = np.tile(samples, (len(which), 1)) - origins
    limit = np.full(len(directions), 1.0 - SHORT, np.float32)
    blocked = caster.rest.occluded(origins, directions, limit)
    rows = np.flatnonzero(~blocked)
    blocked[rows] = caster.parts_block(origins[rows], directions[rows], limit[rows], except_part=lamp)
    free = ~blocked.reshape(-1, len(few))[:, nearest]
    flags = np.unpackbits(patch_bits[which], axis=1, count=len(mine), bitorder="little").astype(bool)
    flags[:, own] = free
    patch_bits[which] = np.packbits(flags, axis=1, bitorder="little")


def _representatives(centres: Float64Array, normals: Float64Array) -> tuple[Rows, Rows]:
    """A few of some patches, far from one another and turned apart, and for each of all the number of the nearest among
    these."""
    size = float(np.linalg.norm(np.ptp(centres, axis=0))) or 1.0
    places = np.concatenate([centres / size, 0.5 * normals], axis=1)
    few = [int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmin())]
    apart = np.linalg.norm(places - places[few[0]], axis=1)
    while len(few) < min(FEW_PATCHES, len(places)):
        few.append(int(apart.argmax()))
        apart = np.minimum(apart, np.linalg.norm(places - places[few[-1]], axis=1))
    distance = np.linalg.norm(places[:, None] - places[few][None], axis=2)
    return np.array(few, np.int64), distance.argmin(axis=1)


def _ask(
    points: ShadingPoints, which: Rows, spheres: Float64Array, n_together: int, bits: Bits, asks_free: bool,
    occluded: _Query,
) -> None:  # fmt: skip
    """Ask triangles, so many by one ray, towards spheres; those whose rays are blocked become so if asks_free, else the
    others free."""
    if not len(spheres):
        return
    around, directions, parents = spheres.astype(np.float32), *_tables()
    step = max(_POINTS_AT_ONCE * n_together // len(spheres), 1)

    def part(start: int) -> None:
        some = which[start : start + step]
        most = len(some) * N_UPPER // n_together * len(spheres)
        row, triangle, rays = np.empty(most, np.int32), np.empty(most, np.int32), np.empty((2, most, 3), np.float32)
        n = kernels.rays_to_spheres(
            some, around, points.lifted, points.frames, directions, parents, n_together, bits, asks_free, row, triangle,
            *rays,
        )  # fmt: skip
        if n:
            blocked = occluded(rays[0, :n], rays[1, :n])
            found = blocked if asks_free else ~blocked
            kernels.set_triangles(some, row[:n], triangle[:n], n_together, found, not asks_free, bits)

    on_threads(part, range(0, len(which), step))


def _ask_patches(
    points: ShadingPoints, which: Rows, spheres: Float64Array, patches: EmitterPatches, stays: NDArray[np.bool_],
    bits: Bits, asks_free: bool, occluded: Callable[[Float32Array, Float32Array, Float32Array], NDArray[np.bool_]],
) -> None:  # fmt: skip
    """As `_ask`, of patches that stay where they are."""
    if not len(spheres) or not stays.any():
        return
    around, samples = spheres.astype(np.float32), patches.samples
    step = 16 * _POINTS_AT_ONCE

    def part(start: int) -> None:
        some = which[start : start + step]
        most = len(some) * len(samples)
        row, patch, rays = np.empty(most, np.int32), np.empty(most, np.int32), np.empty((2, most, 3), np.float32)
        n = kernels.rays_to_patches(some, around, points.lifted, samples, stays, bits, asks_free, row, patch, *rays)
        if not n:
            return
        blocked = occluded(rays[0, :n], rays[1, :n], np.full(n, 1.0 - SHORT, np.float32))
        changed = np.flatnonzero(blocked if asks_free else ~blocked)
        at, mask = (some[row[changed]], patch[changed] >> 3), np.uint8(1) << (patch[changed] & 7).astype(np.uint8)
        if asks_free:
            np.bitwise_and.at(bits, at, ~mask)
        else:
            np.bitwise_or.at(bits, at, mask)

    on_threads(part, range(0, len(which), step))


@lru_cache(maxsize=1)
def _tables() -> tuple[Float32Array, Float32Array]:
    """Directions of the upper triangles (2560, 3), and cones around those of each sixteen."""
    return upper_directions(), cones_around(upper_directions())


def cones_around(directions: Float32Array) -> Float32Array:
    """Cones (U / 16, 4) around each sixteen consecutive directions (U, 3): axis, and sine of the radius."""
    groups = directions.reshape(-1, kernels.PARENTS, 3).astype(np.float64)
    axes = groups.mean(axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    cosine = np.einsum("tjk,tk->tj", groups, axes).min(axis=1)
    sine = np.sqrt(1.0 - cosine**2) + 1e-3
    return np.concatenate([axes, sine[:, None]], axis=1).astype(np.float32)
