"""One attempt of the solver: its parts are restored where they were stored, else traced."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.core.stored_arrays import Arrays
from engine.light.environment import constant_environment
from engine.precompute.direct.pipeline import SkyState, lattice_rows
from engine.precompute.indirect import attempt as attempt_module
from engine.precompute.indirect.attempt import Attempt
from engine.precompute.indirect.cell_size import CellSizeSearch
from engine.precompute.indirect.checkpoints import Checkpoints
from engine.precompute.indirect.progress import FIRST_PASS, Progress, Span, Stopwatch
from engine.precompute.indirect.solver import _sampled_scene
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, placement_of

SCENE = _sampled_scene(
    placement_of(CORNER, **CORNER_VIEW), {1: ["rough_conductor"]}, SkyState(constant_environment((1.0, 0.8, 0.6))), 3,
    QUICK, True, False,
)  # fmt: skip
ROWS = lattice_rows(SCENE.placement.hits, 8)


class Memory(dict[int, Arrays]):
    """Parts by index."""

    def load(self, index: int) -> Arrays | None:
        return self.get(index)

    def store(self, index: int, arrays: Arrays) -> None:
        self[index] = {name: np.array(array) for name, array in arrays.items()}


def begun(memory: Memory | None = None) -> Attempt:
    search = CellSizeSearch(0.2, lambda: float(len(ROWS)))
    return Attempt(SCENE, search, QUICK, Checkpoints(memory), Stopwatch())


def test_sample_sets_add_up_by_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempt_module, "PART_POINTS", 16)
    attempt, steps = begun(), list[Progress]()
    for rows in (ROWS[::2], ROWS[1::2]):
        run_to_end(attempt.trace(rows, None, FIRST_PASS), steps.append)
    np.testing.assert_array_equal(attempt.samples.points, ROWS)
    run_to_end(attempt.trace(ROWS[:3], np.ones(3, np.uint8), Span(0.75, 0.8), len(attempt.cache)))
    np.testing.assert_array_equal(attempt.samples.nth[:6], [0, 1] * 3)
    assert attempt.n_rays_traced == (len(ROWS) + 3) * QUICK.n_rays
    fractions = [fraction for fraction, _ in steps]
    assert max(fractions) == FIRST_PASS.end and min(fractions) > 0.0
    assert len(attempt.points.samples.rows) == len(ROWS) + 3


def test_the_newest_points_are_those_that_were_traced_last() -> None:
    attempt = begun()
    attempt.emit_photons()
    run_to_end(attempt.trace(ROWS[::2], None, FIRST_PASS))
    assert attempt.newest_points is attempt.points  # not searched for photons twice
    run_to_end(attempt.trace(ROWS[1::2], None, FIRST_PASS))
    newest, every = attempt.newest_points, attempt.points
    np.testing.assert_array_equal(newest.samples.rows, ROWS[1::2])
    np.testing.assert_array_equal(newest.samples.records, every.samples.records[1::2])
    # The same photons are near them as in the search around all points.
    near = [np.split(each.landed.photon, each.landed.start[1:-1]) for each in (newest, every)]
    assert sum(map(len, near[0]))
    for a, b in zip(near[0], near[1][1::2], strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_was_stored_is_not_traced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    memory = Memory()
    one = begun(memory)
    run_to_end(one.trace(ROWS, None, FIRST_PASS))
    light = run_to_end(one.light(QUICK, Span(0.1, 0.3), "records"))

    def fails(*_: object, **__: object) -> None:
        pytest.fail("traced again")

    for name in ("gather", "connect", "direct_irradiance"):
        monkeypatch.setattr(attempt_module, name, fails)
    two = begun(memory)
    run_to_end(two.trace(ROWS, None, FIRST_PASS))
    again = run_to_end(two.light(QUICK, Span(0.1, 0.3), "records"))
    np.testing.assert_array_equal(two.samples.records, one.samples.records)
    np.testing.assert_array_equal(again.direct, light.direct)
    np.testing.assert_array_equal(again.records_hit, light.records_hit)
    assert len(two.cache) == len(one.cache) > 0


def test_sample_sets_begin_anew_with_more_rays_on_the_same_records() -> None:
    attempt = begun()
    run_to_end(attempt.trace(ROWS, None, FIRST_PASS))
    n_records = len(attempt.cache)
    attempt.begin_anew(QUICK.with_rays(2 * QUICK.n_rays))
    assert not len(attempt.samples.rows) and len(attempt.cache) == n_records
    run_to_end(attempt.trace(ROWS, None, FIRST_PASS))
    assert attempt.samples.records.shape == (len(ROWS), 2 * QUICK.n_rays) and len(attempt.cache) >= n_records
