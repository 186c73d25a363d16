"""Area under the error on screen against closed forms, errors without the truth's noise, changes at rest."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.peers.edits import Parameter, script_of
from benchmarks.peers.timelines import (
    Watched,
    area,
    difference,
    difference_of_halves,
    differences_again,
    watched,
)

MASK = np.ones((16, 16), bool)
ALPHA, OTHER = Parameter("ball", 0, "alpha", 0.1), Parameter("wall", 0, "alpha", 0.2)
SCRIPT = script_of(ALPHA, 0.3, [(OTHER, 0.3), (OTHER, 0.4), (ALPHA, 0.5)])


def test_area_of_a_step_function() -> None:
    # 0.5 for 1 s, 0.2 for 2 s, 0.1 for the last 1 s.
    assert area((0.0, 1.0, 3.0), (0.5, 0.2, 0.1), 4.0) == pytest.approx(0.5 + 0.4 + 0.1)
    # Nothing after the horizon counts, and half a step does.
    assert area((0.0, 1.0, 3.0), (0.5, 0.2, 0.1), 2.0) == pytest.approx(0.5 + 0.2)
    assert area((0.0,), (0.5,), 3.0) == pytest.approx(1.5)


def test_area_of_many_steps_nears_the_integral() -> None:
    # Noise e / sqrt(t) after each of many samples: the integral from 1 to 4 is 2 e.
    times = np.linspace(1.0, 4.0, 5001)
    assert area(times.tolist(), (0.3 / np.sqrt(times)).tolist(), 4.0) == pytest.approx(0.6, rel=1e-3)


def test_both_clocks_count_from_the_edit() -> None:
    watch = Watched(0.4, (0.2, 0.1), (1.0, 3.0), (0.5, 1.0), 0.0)
    assert watch.area(4.0, cpu=False) == pytest.approx(0.4 + 0.4 + 0.1)
    assert watch.area(4.0, cpu=True) == pytest.approx(0.2 + 0.1 + 0.3)
    assert watch.first == 0.2 and watch.last(2.0, cpu=False) == 0.2 and watch.last(2.0, cpu=True) == 0.1
    late = Watched(0.4, (), (), (), 0.0)
    assert late.first == late.last(1.0, cpu=True) == 0.4 and late.area(2.0, cpu=True) == pytest.approx(0.8)


def answer(pictures: list[list[float]]) -> dict[str, np.ndarray]:
    """Of a program that shows even pictures of these radiances after each edit, half a second apart."""
    rows = [(index, 0.5 * (i + 1), value) for index, values in enumerate(pictures) for i, value in enumerate(values)]
    edit, seconds, values = (np.array(column) for column in zip(*rows, strict=True))
    shown = np.broadcast_to(values[:, None, None, None], (len(rows), *MASK.shape, 3))
    return {
        "edit": edit, "seconds": seconds, "cpu_seconds": seconds / 2, "pictures": shown, "opened": shown[0],
    }  # fmt: skip


def test_errors_are_against_the_truth_of_the_state_without_its_noise() -> None:
    rng = np.random.default_rng(1)
    n_states = len(SCRIPT.states)
    truths = np.arange(1.0, n_states + 1)[:, None, None, None, None] + 0.2 * rng.standard_normal(
        (n_states, 2, 256, 1, 3)
    )
    truths = truths.reshape(n_states, 2, *MASK.shape, 3)
    # The right picture at once but after the first edit, where it comes second, after one that is 10 % too dark.
    right = [[float(edit.state + 1)] for edit in SCRIPT.edits]
    found = watched(SCRIPT.edits, answer([[1.8, 2.0], *right[1:]]), truths, MASK)
    assert found[0].errors == pytest.approx((0.1, 0.0), abs=0.01)
    assert found[0].before == pytest.approx(0.1, abs=0.01) and found[0].cpu_seconds == (0.25, 0.5)
    assert found[0].change == pytest.approx(0.2 / 1.8)
    assert [each.errors[-1] for each in found[1:]] == pytest.approx([0.0] * 24, abs=0.02)
    # Before the second edit its state's picture is not there yet: 2 in place of 3.
    assert found[1].before == pytest.approx(1 / 3, abs=0.01)


def test_an_edit_without_a_new_picture_shows_the_one_before() -> None:
    truths = np.ones((len(SCRIPT.states), 2, *MASK.shape, 3))
    found = watched(SCRIPT.edits, answer([[0.9], [], *([1.0] for _ in SCRIPT.edits[2:])]), truths, MASK)
    assert found[1].errors == () and found[1].first == pytest.approx(0.1) and found[1].change == 0.0


def test_a_state_that_comes_again_is_compared_with_itself_alone() -> None:
    steady = answer([[float(edit.state + 1)] for edit in SCRIPT.edits])
    assert differences_again(SCRIPT.edits, steady, MASK) == [0.0] * 8
    flickering = answer([[float(edit.state + 1) + 0.01 * i] for i, edit in enumerate(SCRIPT.edits)])
    assert max(differences_again(SCRIPT.edits, flickering, MASK)) > 0.03


def test_differences() -> None:
    assert difference(np.full(8, 2.2), np.full(8, 2.0)) == pytest.approx(0.1)
    rng = np.random.default_rng(2)
    halves = [mean + 0.3 * rng.standard_normal((2, 20000)) for mean in (1.05, 1.0)]
    assert difference_of_halves(*halves) == pytest.approx(0.05, abs=0.01)
