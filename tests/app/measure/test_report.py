"""Ticks of logarithmic axes: few, round, told apart, in words without exponents."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import pyplot as plt

from app.measure.report import MOST_TICKS, log_name, log_places, read_well


@pytest.mark.parametrize(
    ("low", "high", "names"),
    [
        (1.0, 100.0, ["1", "3", "10", "30", "100"]),
        (0.5, 12.0, ["0.5", "1", "2", "5", "10"]),
        (0.0001, 0.01, ["0.0001", "0.0003", "0.001", "0.003", "0.01"]),
        (90.0, 250.0, ["100", "150", "200"]),
        (0.3602, 0.3614, ["0.3604", "0.3607", "0.361", "0.3613"]),  # no two of them are 0.36
        (1e-4, 1e6, ["0.0001", "0.01", "1", "100", "10000", "1000000"]),
    ],
)
def test_axes_have_the_ticks_that_one_would_choose(low: float, high: float, names: list[str]) -> None:
    assert [log_name(place) for place in log_places(low, high)] == names


@given(st.floats(1e-5, 1e5), st.floats(1.001, 1e6))
def test_ticks_are_few_and_told_apart(low: float, ratio: float) -> None:
    places = log_places(low, low * ratio)
    names = [log_name(place) for place in places]
    assert 2 <= len(places) <= max(MOST_TICKS, 7) and len(set(names)) == len(names)
    assert all(low <= place <= low * ratio and "e" not in name for place, name in zip(places, names, strict=True))
    assert [float(name) for name in names] == pytest.approx(places, rel=1e-5)


def test_an_axis_shows_them() -> None:
    figure, axes = plt.subplots()
    axes.set_xscale("log")
    read_well(axes.xaxis)
    axes.set_xlim(90.0, 250.0)
    figure.canvas.draw()
    assert [label.get_text() for label in axes.get_xticklabels()] == ["100", "150", "200"]
    assert math.isclose(axes.get_xticks()[0], 100.0)
    plt.close(figure)
