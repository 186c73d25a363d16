"""How long the precomputation takes, against what brute-force shadow rays alone would take.

The yardstick is measured in the same run, on the same scene: the raw Embree rate r (rays a second, all cores, rays
prepared beforehand, the scene's own points and directions), before and after what it is held against. Brute force at
5,120 directions would need, for P points with normals n_p,

    seconds = #{(p, d): n_p · d > 0} / r.

A ratio of two times of one run says the same on a slow and on a fast machine. Kernels are compiled before any timing.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.measure.subject import Precomputed, Subject, precompute, visibility_seconds
from engine.precompute.direct.pipeline import Placement, Quality
from engine.scene.primary_hits import PrimaryHits
from engine.visibility.point_visibility import VISIBILITY_LEVEL, brute_force_visibility, sphere_targets

RAW_RAYS = 2_000_000
POINTS_AT_ONCE = 1024


@dataclass(frozen=True)
class Ratio:
    """A time held against brute force: `seconds`, `brute_force` seconds, and the rate behind it (rays a second)."""

    seconds: float
    brute_force: float
    rate: float

    @property
    def value(self) -> float:
        return self.seconds / self.brute_force


# ------------------------------------------------------------------------------------------------------ the yardstick


def hemisphere_directions(hits: PrimaryHits) -> int:
    """How many pairs of a point and a level-4 direction have the direction above the point's horizon."""
    directions = sphere_targets(VISIBILITY_LEVEL).positions
    return sum(
        int(np.count_nonzero(hits.normal[i : i + POINTS_AT_ONCE] @ directions.T > 0.0))
        for i in range(0, len(hits.normal), POINTS_AT_ONCE)
    )


def shadow_rays(hits: PrimaryHits, n_rays: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """At least `n_rays` origins and directions (R, 3) float32: random points, each with all it has above the horizon.

    The points come in the picture's order, as brute force would take them.
    """
    targets = sphere_targets(VISIBILITY_LEVEL).positions
    n_points = -(-2 * n_rays // len(targets)) + 8
    rng = np.random.default_rng(seed)
    origins: list[np.ndarray] = []
    directions: list[np.ndarray] = []
    while sum(map(len, origins)) < n_rays:
        for row in np.sort(rng.integers(0, len(hits.pixel), n_points)):
            above = targets[targets @ hits.normal[row] > 0.0]
            directions.append(above)
            origins.append(np.broadcast_to(hits.offset_position[row], above.shape))
    return (
        np.ascontiguousarray(np.concatenate(origins), np.float32),
        np.ascontiguousarray(np.concatenate(directions), np.float32),
    )


class RawRate:
    """Measures rays a second of one scene, again and again with the same rays."""

    def __init__(self, placement: Placement, n_rays: int = RAW_RAYS) -> None:
        self._caster = placement.caster
        self._rays = shadow_rays(placement.hits, n_rays)
        self._caster.occluded(*(array[:100_000] for array in self._rays))

    @property
    def n_rays(self) -> int:
        return len(self._rays[0])

    def measure(self) -> float:
        """Rays a second of one batch on all cores."""
        started = time.perf_counter()
        self._caster.occluded(*self._rays)
        return self.n_rays / (time.perf_counter() - started)


# ----------------------------------------------------------------------------------------------------- what is timed


def wrong_answers(placement: Placement, n_points: int = 3000, seed: int = 2) -> float:
    """Share of the sphere's answers above the horizon that differ from brute force, at random points.

    The placement's sphere must be done.
    """
    rng = np.random.default_rng(seed)
    n_points = min(n_points, len(placement.hits.pixel))
    rows = np.sort(rng.choice(len(placement.hits.pixel), n_points, replace=False))
    truth = brute_force_visibility(placement.hits, placement.caster, placement.sphere.targets, rows)
    differing = np.bitwise_count(truth.bits[rows] ^ placement.sphere.bits[rows]).sum(dtype=np.int64)
    return float(differing) / max(1, truth.rays.possible)


# ------------------------------------------------------------------------------------------------------- repetitions


def precompute_ratios(
    subject: Subject, quality: Quality, repetitions: int, n_rays: int = RAW_RAYS
) -> Iterator[tuple[Ratio, Precomputed]]:
    """A stage held against brute force, once a repetition."""
    placement = Placement(subject.scene)
    raw, n_brute = RawRate(placement, n_rays), hemisphere_directions(placement.hits)
    for _ in range(repetitions):
        before = raw.measure()
        done = precompute(subject, quality)
        rate = (before + raw.measure()) / 2
        yield Ratio(done.seconds, n_brute / rate, rate), done


def visibility_ratios(placement: Placement, repetitions: int, n_rays: int = RAW_RAYS) -> list[Ratio]:
    """Coherent visibility held against brute force; leaves the placement's sphere done."""
    raw, n_brute = RawRate(placement, n_rays), hemisphere_directions(placement.hits)
    ratios = []
    for _ in range(repetitions):
        before = raw.measure()
        seconds = visibility_seconds(placement)
        rate = (before + raw.measure()) / 2
        ratios.append(Ratio(seconds, n_brute / rate, rate))
    return ratios
