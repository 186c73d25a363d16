"""The cost of rotating harmonics: counted as in the paper, of a rotation that is one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.rotation_cost import PAPERS, multiplications, nanoseconds, of_lobes, quarter_turns, report, rotate_all
from engine.sphere.harmonics import rotate


@pytest.mark.parametrize("n", PAPERS)
def test_it_takes_as_many_multiplications_as_the_paper_says(n: int) -> None:
    assert multiplications(n) == PAPERS[n] > of_lobes(4)
    # Of the quarter turns no more numbers than that differ from 0: 1 in band 0, and the swap of two in band 1.
    assert 1 + 3 < len(quarter_turns(n)[2]) <= sum(l * l + l + 1 for l in range(n))  # noqa: E741


def test_what_is_timed_rotates() -> None:
    vectors = np.random.default_rng(1).normal(size=(6, 36))
    rotations = Rotation.random(6, rng=2).as_matrix()
    expected = [rotate(vector, rotation) for vector, rotation in zip(vectors, rotations, strict=True)]
    assert rotate_all(vectors, rotations) == pytest.approx(np.array(expected), abs=1e-10)


def test_the_table_has_a_line_for_each_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.rotation_cost.nanoseconds", lambda n: nanoseconds(n, 50, 1))
    lines = report().splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:]] == [str(n) for n in PAPERS]
