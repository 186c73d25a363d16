"""The curve plot's arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ui.panels.plot_axes import (
    Axis,
    Scale,
    angle_ticks,
    nice_ceiling,
    value_label,
    value_range,
    value_ticks,
    zoomed,
)


@given(st.floats(1e-6, 1e6), st.floats(1.01, 1e6), st.sampled_from(["linear", "symlog", "log"]), st.floats(0.0, 1.0))
def test_pixels_and_values_are_inverse(low: float, ratio: float, scale: Scale, share: float) -> None:
    axis = Axis(low, low * ratio, 300.0, 20.0, scale)
    pixel = 300.0 - 280.0 * share
    assert axis.to_pixel(axis.to_value(pixel)) == pytest.approx(pixel, abs=1e-6)
    assert axis.to_pixels(np.array([axis.to_value(pixel)]))[0] == pytest.approx(pixel, abs=1e-6)


def test_height_is_even_up_to_1_and_doubles_evenly_above() -> None:
    top = 1.0 + math.log(100.0)
    axis = Axis(0.0, 100.0, 126.0, 0.0, "symlog")
    assert axis.to_pixel(0.5) == pytest.approx(126.0 * (1.0 - 0.5 / top))
    assert axis.to_pixel(4.0) - axis.to_pixel(8.0) == pytest.approx(axis.to_pixel(40.0) - axis.to_pixel(80.0))
    # A hand that goes 38 pixels up from nothing comes to 2, where the cube root made 6.6 of it and even axes 30.
    # A hand that goes 38 pixels up from nothing comes to 2; by the cube root it came to 6.6, on even axes to 30.


def test_a_logarithmic_axis_keeps_zero_on_its_floor() -> None:
    axis = Axis(1e-3, 10.0, 200.0, 0.0, "log")
    # log10 of 0 is not a number; the floor is where such values stand.
    assert axis.to_pixel(0.0) == axis.to_pixel(-5.0) == 200.0
    assert axis.to_pixels(np.array([0.0, -1.0, 10.0])).tolist() == [200.0, 200.0, 0.0]
    # One decade of four is a quarter of the height.
    assert axis.to_pixel(1.0) == pytest.approx(50.0)


def test_angles_are_labelled_in_whole_degrees() -> None:
    ticks = angle_ticks(Axis(0.0, math.pi / 2, 0.0, 440.0), 52.0)
    # 440 pixels for 90 degrees: 10 degrees are 49 pixels, too near; 15 are 73.
    assert [tick.label for tick in ticks] == ["0°", "15°", "30°", "45°", "60°", "75°", "90°"]
    near = angle_ticks(Axis(0.0, math.radians(1.0), 0.0, 440.0), 52.0)
    assert [tick.label for tick in near] == ["0°", "0.2°", "0.4°", "0.6°", "0.8°", "1°"]


@pytest.mark.parametrize("high", [1e-6, 0.3, 1.0, 7.0, 3.2e7])
def test_linear_ticks_keep_their_distance(high: float) -> None:
    ticks = value_ticks(Axis(0.0, high, 240.0, 0.0), 30.0)
    gaps = np.diff([tick.value for tick in ticks]) / high * 240.0
    assert len(ticks) >= 3
    assert (gaps >= 30.0 - 1e-6).all()
    assert ticks[0].label == "0"


def test_decades_are_thinned_when_crowded() -> None:
    ticks = value_ticks(Axis(1e-4, 1e4, 240.0, 0.0, "log"), 40.0)
    labels = [tick.label for tick in ticks if tick.label]
    # Eight decades on 240 pixels are 30 apart: every second one is labelled.
    assert labels == ["1e-4", "0.01", "1", "100", "10000"]


def test_labels_are_short() -> None:
    assert value_label(0.0, 0.2) == "0"
    assert value_label(0.6000000000000001, 0.2) == "0.6"
    assert value_label(3.183e7, 1e6) == "3.18e7"
    assert value_label(2e-5, 1e-5) == "2e-5"


@given(st.floats(1e-12, 1e12))
def test_nice_ceiling_is_near_and_not_below(value: float) -> None:
    assert value * (1 - 1e-9) <= nice_ceiling(value) <= 1.7 * value


def test_ranges_show_all_values() -> None:
    assert value_range(np.array([0.2, 0.9]), False) == (0.0, 1.0)
    assert value_range(np.zeros(3), False) == (0.0, 1.0)
    low, high = value_range(np.array([-0.3, 2.0]), False)
    assert low <= -0.3 and high >= 2.0
    assert value_range(np.array([0.02, 5.0]), True) == (0.01, 10.0)
    # A curve that falls to 1e-30 would press all that matters against the top: at most eight decades.
    assert value_range(np.array([1e-30, 1.0]), True)[0] == pytest.approx(1e-7)
    assert value_range(np.zeros(2), True) == (1e-3, 1.0)


@given(st.floats(0.0, 1.0), st.floats(0.05, 20.0))
def test_zoom_stays_inside_and_keeps_the_centre(share: float, factor: float) -> None:
    low, high = zoomed(0.2, 0.8, 0.2 + 0.6 * share, factor, (0.0, 1.0))
    assert 0.0 <= low < high <= 1.0 + 1e-12
    if factor <= 1.0:
        # Zooming in, the place under the mouse stays where it is.
        assert (0.2 + 0.6 * share - low) / (high - low) == pytest.approx(share, abs=1e-9)
