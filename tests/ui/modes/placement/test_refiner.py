"""The books of incremental rendering, as arithmetic."""

import numpy as np
import pytest

from ui.modes.placement.gl.refiner import TIDY_ABOVE, CoefficientState


def _state(norms: list[float], shown: list[float], wanted: list[float]) -> CoefficientState:
    state = CoefficientState(np.repeat(np.array(norms)[:, None], 3, axis=1))
    state.record_rebuild(np.repeat(np.array(shown)[:, None], 3, axis=1))
    state.wanted = np.repeat(np.array(wanted)[:, None], 3, axis=1).astype(float)
    return state


def test_terms_are_picked_by_their_effect_on_the_image() -> None:
    # Effects |Δc|·‖T‖ are 1·1, 2·10, 5·0.1 and 0: the second term counts most although the third changed more.
    state = _state([1, 10, 0.1, 7], [1, 1, 1, 1], [2, 3, 6, 1])
    np.testing.assert_array_equal(state.pending(), [1, 0, 2])
    step = state.next_step(limit=2)
    assert step.kind == "increment"
    np.testing.assert_array_equal(step.indices, [1, 0])
    np.testing.assert_allclose(step.deltas, [[2, 2, 2], [1, 1, 1]])


def test_what_is_left_is_the_energy_of_the_terms_left_out() -> None:
    # Parseval: kept terms leave sqrt of the others' energies, channel by channel: sqrt(3)·5 at first, then sqrt(3)·3.
    state = _state([1, 1, 1], [0, 0, 1], [3, 4, 1])
    assert state.remaining_effect() == pytest.approx(np.sqrt(3) * 5)
    state.record_increment(np.array([1]), np.full((1, 3), 4.0))
    assert state.remaining_effect() == pytest.approx(np.sqrt(3) * 3)


def test_a_step_as_long_as_the_whole_sum_is_a_rebuild() -> None:
    state = _state([1, 1, 1, 1], [1, 1, 0, 0], [2, 3, 0, 0])
    assert state.next_step().kind == "rebuild"
    assert state.next_step(limit=1).kind == "increment"


def test_unknown_pictures_are_rebuilt_and_foreign_ones_are_not() -> None:
    state = CoefficientState(np.ones((4, 3)))
    state.wanted = np.ones((4, 3))
    assert state.next_step(limit=1).kind == "rebuild"
    state.start_from(None)
    assert state.next_step().kind == "nothing"
    state.start_from(np.zeros((4, 3)))
    # Four terms are as many as the sum has, but the old transport must not replace the new picture.
    assert state.next_step().kind == "increment"


def test_a_cancelled_large_edit_is_rebuilt() -> None:
    # +1e4 and back leaves 2^-24·1e4 = 6e-4 of rounding in a picture of size 1: far above what increments may leave.
    state = _state([1, 1, 1], [1, 1, 1], [1e4, 1, 1])
    state.record_increment(np.array([0]), np.full((1, 3), 1e4 - 1))
    state.wanted[:] = 1.0
    assert state.next_step(limit=1).kind == "rebuild"


def test_drift_grows_with_edits_and_an_idle_state_tidies() -> None:
    state = _state([1, 1, 1], [1, 1, 1], [1, 1, 1])
    assert state.next_step().kind == "nothing" and state.drift() == 0.0
    for _ in range(2000):
        state.record_increment(np.array([0]), np.full((1, 3), 1e-3))
    state.wanted[0] = state.shown[0]
    # 2000 additions of up to 2^-24 of the picture: sqrt(2000)·2^-24 = 2.7e-6 if its size stood still; it grew from
    # sqrt(9) to sqrt(33), so the early roundings count for less.
    assert TIDY_ABOVE < state.drift() < 2.7e-6
    assert state.next_step().kind == "tidy"


def test_a_black_picture_has_no_drift_and_nothing_to_do() -> None:
    state = _state([1, 1], [0, 0], [0, 0])
    assert state.next_step().kind == "nothing" and state.drift() == 0.0
