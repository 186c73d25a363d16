"""Plans the number of bounces that a picture requires, by a pilot of a few thousand paths before any work.

Each path begins at a random point of the picture and continues in cosine-distributed directions; its weight is
multiplied by the equivalent albedo of each surface. If all surfaces were lit alike, the weights at the Nth surface
would be the share of the light that reaches the camera after N reflections; the series ends where one more bounce would
carry less than the tolerance. Uneven light can need one bounce more or fewer: the plan ignores the light, and so holds
for any. It does not depend on the number of bands either, so that plan, still and editor agree.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.planner import usual_bands
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.scene.map_sampler import mean_factor
from engine.scene.primary_hits import object_ids
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import shading_frames

TOLERANCE = 0.005
MOST_PLANNED = 4
# A warning is given if more than this share of the light is missing.
MUCH = 0.25
_ENDLESS = 0.999  # a bounce carries this share of the one before: within the accuracy of 4096 paths, all of it
_N_PATHS = 4096


@dataclass(frozen=True)
class BouncePlan:
    """The number of bounces, and the reason. missing: estimated share of all reflected light that comes after them, 1
    if the series does not end; most_missing: upper bound of it, 1 if no albedo bounds it."""

    n_bounces: int
    reason: str
    missing: float
    most_missing: float

    @property
    def warning(self) -> str:
        """A warning if much light is missing, else ""."""
        if self.missing >= 1.0:
            return f"the scene absorbs too little light: no number of bounces is enough, {self.n_bounces} are shown"
        if self.missing > MUCH:
            text = f"{self.n_bounces} bounces carry {1.0 - self.missing:.0%} of the light, the rest is missing"
            return text.replace("1 bounces carry", "1 bounce carries")
        return ""


def carried_light(
    placement: Placement, albedos: NDArray[np.float64], n_bounces: int, seed: int = 1
) -> NDArray[np.float64]:
    """Estimate the light that one reflection, two, … carry, (n_bounces, 3), in a common unit; 0 where it is dark, or no
    object is in the picture.

    albedos (M, 3): of each object, 0 for emitters.
    """
    hits, scene, caster = placement.hits, placement.scene, placement.caster
    generator = np.random.default_rng(seed)
    if not len(hits.pixel):
        return np.zeros((n_bounces, 3))
    rows = generator.integers(0, len(hits.pixel), _N_PATHS)
    objects = np.searchsorted(hits.object_ranges[:, 1], rows, "right")
    origins, normals = hits.offset_position[rows], hits.normal[rows]
    weights = albedos[objects]
    carried = np.zeros((n_bounces, 3))
    for bounce in range(n_bounces):
        carried[bounce] = weights.sum(axis=0)
        directions = _by_cosine(normals, generator)
        found = caster.intersect(origins, directions)
        ids = object_ids(scene, found)
        met = np.flatnonzero((ids >= 0) & (weights.max(axis=1) > 0.0))
        if not len(met):
            break
        weights = weights[met] * albedos[ids[met]]
        frames = shading_frames(scene, caster, found, ids, met, -directions[met])
        origins, normals = frames["offset_position"], frames["normal"]
    return carried


def shares_of(carried: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (N,) of the total light of these bounces that each carries, over all colours."""
    each, total = carried.sum(axis=1), carried.sum()
    return np.asarray(each / total if total > 0.0 else each)


def missing_light(carried: NDArray[np.float64], largest_albedo: float) -> tuple[float, float]:
    """Share of all reflected light that comes after the last but one of these bounces, (N + 1, 3): an extrapolation,
    and an upper bound.

    Each bounce carries at most the largest albedo ρ of what the one before carried, so that the light after N bounces
    is at most that of bounce N + 1 times 1 / (1 − ρ). The extrapolation uses the ratio r of the last bounce to the one
    before, by colour: in a closed scene of one albedo r = ρ, and both are ρ^N.
    """
    last, next_one = carried[-2], carried[-1]
    ratio = np.divide(next_one, last, out=np.zeros(3), where=last > 0.0)
    before = carried[:-1].sum()
    if not next_one.any():
        return 0.0, 0.0
    if (ratio >= _ENDLESS).any():
        return 1.0, 1.0
    after = float((next_one / (1.0 - ratio)).sum())
    most = float(next_one.sum()) / (1.0 - largest_albedo) if largest_albedo < 1.0 else np.inf
    return after / (before + after), 1.0 if np.isinf(most) else max(most, after) / (before + max(most, after))


def required_bounces(shares: NDArray[np.float64], tolerance: float = TOLERANCE) -> int:
    """Least number of bounces after which another adds less than the tolerance to the total."""
    for n in range(1, len(shares)):
        if shares[n] <= tolerance * shares[: n + 1].sum():
            return n
    return len(shares) - 1


def planned_bounces(
    placement: Placement, layers: Iterable[tuple[int, Layer]], n_bounces: int | None = None
) -> BouncePlan:
    """Plan the number of bounces for these visible layers of the scene's objects (by index), or evaluate
    `n_bounces`."""
    albedos = object_albedos(placement.scene, layers)
    carried = carried_light(placement, albedos, (n_bounces or MOST_PLANNED) + 1)
    reason = ""
    if n_bounces is None:
        shares = shares_of(carried)
        n_bounces = required_bounces(shares)
        reason = _reason(shares, n_bounces)
    return BouncePlan(n_bounces, reason, *missing_light(carried[: n_bounces + 1], float(albedos.max(initial=0.0))))


def object_albedos(scene: Scene, layers: Iterable[tuple[int, Layer]]) -> NDArray[np.float64]:
    """Equivalent albedo (M, 3) of every object: the sum over its layers, with images by their means over the
    surface."""
    albedos = np.zeros((len(scene.triangle_ranges), 3))
    for i_object, layer in layers:
        bands = tuple(usual_bands(layer.model).values())
        albedos[i_object] += mean_factor(scene, i_object, layer.maps) * equivalent_albedo(layer, bands)
    return albedos


def _reason(shares: NDArray[np.float64], n_bounces: int) -> str:
    """The reason for a plan's number, in words."""
    last, dropped = (100.0 * shares[n] for n in (n_bounces - 1, n_bounces))
    if n_bounces == 1:
        return f"a second would carry {dropped:.1f} % of the light"
    end = "the most a plan takes" if n_bounces == MOST_PLANNED else f"another {dropped:.1f} %"
    return f"the last carries {last:.1f} % of the light, {end}"


def _by_cosine(normals: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """A cosine-distributed direction (R, 3) about each normal: to a random point of the unit sphere that touches the
    surface."""
    points = generator.normal(size=normals.shape)
    points /= np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-12)
    directions = normals + points
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-4, directions / np.maximum(lengths, 1e-4), normals), np.float32)
