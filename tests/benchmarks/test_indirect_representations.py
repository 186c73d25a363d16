"""The editor's representation of indirect light against the dense tensor, measured on one room."""

from __future__ import annotations

from math import comb

import pytest

from app.measure.subject import open_subject
from benchmarks.indirect_memory import cut
from benchmarks.indirect_representations import N_BANDS, compare


@pytest.mark.slow
def test_the_tensor_grows_with_objects_and_bounces() -> None:
    room = open_subject("cornell", (24, 24)).scene
    memory = {}
    for n_objects, n_bounces in ((2, 3), (4, 4)):
        gather, dense = compare(cut(room, n_objects), n_objects, n_bounces)
        assert gather.points == dense.points > 0
        for row in (gather, dense):
            assert (row.objects, row.bounces) == (n_objects, n_bounces)
            assert row.error < 1e-5 and row.freeze_s > 0.0 and row.made_s > 0.0
        # A number for each band, channel and multiset that is not empty.
        n_sets = comb(n_objects + n_bounces - 1, n_bounces - 1) - 1
        assert dense.memory_mb == pytest.approx(dense.points * 3 * N_BANDS * n_sets * 4 / 1e6)
        memory[n_objects] = gather.memory_mb / gather.points
    assert memory[4] < 1.3 * memory[2]
