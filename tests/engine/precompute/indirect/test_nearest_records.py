"""Hits without a record in a cache that takes no more: the nearest one of their object."""

from __future__ import annotations

import numpy as np
import pytest

from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect.gather import gather
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import Rays
from engine.scene.surface_uvs import positions_at
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve


@pytest.fixture(scope="module")
def placement() -> Placement:
    return placement_of(CORNER, **CORNER_VIEW, n=32)


@pytest.fixture(scope="module")
def found(placement: Placement) -> IndirectLight:
    return solve(placement, [matt(i, 0.5) for i in range(3)], 2, QUICK)


def random_rays(placement: Placement, n: int = 400) -> Rays:
    random = np.random.default_rng(3)
    rows = random.choice(len(placement.hits.pixel), n)
    directions = random.normal(size=(n, 3)).astype(np.float32)
    directions *= np.sign(np.einsum("ni,ni->n", directions, placement.hits.normal[rows]))[:, None]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return Rays(placement.hits.offset_position[rows], directions, np.ones(n, bool))


def test_a_hit_takes_a_record_of_its_object_near_by_and_none_is_added(
    placement: Placement, found: IndirectLight
) -> None:
    scene, table = placement.scene, [array.copy() for array in found.cache.table()]
    records, hits = found.cache.closed().records_and_hits(random_rays(placement))
    reflects = np.flatnonzero(hits.triangle >= 0)
    np.testing.assert_array_equal(np.flatnonzero(records != NO_RECORD), reflects)
    triangle, own = hits.triangle[reflects], records[reflects]
    np.testing.assert_array_equal(found.cache.objects[own], scene.object_of_triangle[triangle])
    ends = positions_at(scene, triangle, hits.u[reflects], hits.v[reflects])
    first = found.cache.table()
    places = positions_at(scene, first.triangle[own, 0], first.u[own, 0], first.v[own, 0])
    # By chance, places on these walls of 2 m lie a metre apart.
    assert len(reflects) > 50 and np.median(np.linalg.norm(ends - places, axis=1)) < 0.2
    for one, two in zip(table, found.cache.table(), strict=True):
        np.testing.assert_array_equal(one, two)


def test_hits_with_a_record_keep_it(placement: Placement, found: IndirectLight) -> None:
    points, cache = found.points, found.cache.closed()
    rows = points.samples.rows
    for nth in (0, 1):  # the sets that were traced, and others
        sets = gather(placement.hits, cache, rows, np.full(len(rows), nth, np.uint8), points.lobe_axes, points.sizes[0])
        records = np.concatenate([part.records for part in sets])
        same = np.mean(records == points.samples.records)
        assert same == 1.0 if nth == 0 else same < 0.9
