"""How many bounces a picture requires, found by a pilot of a few thousand paths before any work.

Each path begins at a random point of the picture and goes on by the cosine, its weight multiplied by the equivalent
albedo of each surface it meets. Were all surfaces lit alike, the weights left at the Nth surface would be the share of
the light that takes N reflections to the eye; the series ends where one more would carry less than the tolerance. What
is lit unevenly can need one bounce more or fewer: nothing of the light is asked, so that the answer holds for any.
"""

import numpy as np
from numpy.typing import NDArray

from engine.scene.hits import object_ids, shading_frames
from engine.transport.pipeline import Placement

TOLERANCE = 0.01
MOST_PLANNED = 4
_N_PATHS = 4096


def bounce_shares(placement: Placement, albedos: NDArray[np.float64], seed: int = 1) -> NDArray[np.float64]:
    """Shares (MOST_PLANNED + 1,) of all these bounces' light that one reflection, two, … carry; 0 where it is dark.

    albedos (M, 3): of each object, 0 for emitters.
    """
    hits, scene, caster = placement.hits, placement.scene, placement.caster
    generator = np.random.default_rng(seed)
    rows = generator.integers(0, len(hits.pixel), _N_PATHS)
    objects = np.searchsorted(hits.object_ranges[:, 1], rows, "right")
    origins, normals = hits.offset_position[rows], hits.normal[rows]
    weights = albedos[objects]
    carried = np.zeros(MOST_PLANNED + 1)
    for bounce in range(len(carried)):
        carried[bounce] = weights.mean(axis=1).sum()
        directions = _by_cosine(normals, generator)
        found = caster.intersect(origins, directions)
        ids = object_ids(scene, found)
        met = np.flatnonzero((ids >= 0) & (weights.max(axis=1) > 0.0))
        if not len(met):
            break
        weights = weights[met] * albedos[ids[met]]
        frames = shading_frames(scene, caster, found, ids, met, -directions[met])
        origins, normals = frames["offset_position"], frames["normal"]
    total = carried.sum()
    return carried / total if total > 0.0 else carried


def required_bounces(shares: NDArray[np.float64], tolerance: float = TOLERANCE) -> int:
    """The least number of bounces after which another adds less than the tolerance to what there is."""
    for n in range(1, len(shares)):
        if shares[n] <= tolerance * shares[: n + 1].sum():
            return n
    return len(shares) - 1


def planned_bounces(placement: Placement, albedos: NDArray[np.float64]) -> tuple[int, str]:
    """How many, and why. albedos (M, 3) as for `bounce_shares`."""
    shares = bounce_shares(placement, albedos)
    n_bounces = required_bounces(shares)
    return n_bounces, _reason(shares, n_bounces)


def _reason(shares: NDArray[np.float64], n_bounces: int) -> str:
    """Why a plan has so many, in words."""
    last, dropped = (100.0 * shares[n] for n in (n_bounces - 1, n_bounces))
    if n_bounces == 1:
        return f"a second would carry {dropped:.1f} % of the light"
    end = "the most a plan takes" if n_bounces == MOST_PLANNED else f"another {dropped:.1f} %"
    return f"the last carries {last:.1f} % of the light, {end}"


def _by_cosine(normals: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """A direction (R, 3) about each normal: to a random point of the unit sphere that rests on the surface there."""
    points = generator.normal(size=normals.shape)
    points /= np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-12)
    directions = normals + points
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-4, directions / np.maximum(lengths, 1e-4), normals), np.float32)
