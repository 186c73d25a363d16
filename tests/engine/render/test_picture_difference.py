"""relRMSE and false colours of differences, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.render.display import LEAST_ERROR, MOST_ERROR
from engine.render.picture_difference import check_same_size, difference_colours, errors, signed_colours


def test_errors_in_closed_form() -> None:
    truth = np.full((10, 3), 2.0)
    # Half of the values 10 % too dark: rms difference 0.2·sqrt(½) over a mean of 2, means differ by 5 %.
    ours = truth.copy()
    ours[:5] *= 0.9
    found = errors(ours, truth)
    assert found.rmse == pytest.approx(0.1 * np.sqrt(0.5))
    assert found.mean == pytest.approx(-0.05)


def test_the_brightest_are_clamped_at_the_truths_percentile() -> None:
    truth = np.ones((2000, 3))
    ours = truth.copy()
    ours[0] = 1e6  # a firefly: clamped at 1, the 99.9 percentile of the truth
    assert errors(ours, truth).rmse == 0.0


def test_signs_have_colours_of_their_own_and_equal_pixels_are_dark() -> None:
    reference = np.ones((1, 4, 3))
    ours = reference * np.array([1.0, 1.0 + 1e-5, 1.01, 0.99])[None, :, None]
    same, nearly, brighter, darker = difference_colours(ours, reference, "signed")[0].astype(int)
    assert (same == nearly).all() and same.max() < 30
    assert brighter[0] > brighter[2] + 50 and darker[2] > darker[0] + 50


def test_sizes_are_on_a_logarithmic_scale_that_ends() -> None:
    shares = np.array([LEAST_ERROR, np.sqrt(LEAST_ERROR * MOST_ERROR), MOST_ERROR, 1e6])
    least, middle, most, more = signed_colours(shares)
    np.testing.assert_allclose(middle, (0.78, 0.24, 0.12), atol=1e-9)
    assert least.max() <= 0.1 and (most == more).all() and most.sum() > middle.sum()
    np.testing.assert_array_equal(signed_colours(-shares)[:, 2] > signed_colours(-shares)[:, 0], True)


def test_absolute_differences_have_the_shade_of_their_share_of_the_mean() -> None:
    reference = np.full((1, 3, 3), 4.0)
    ours = reference + np.array([0.0, 0.04, 0.4])[None, :, None]  # 0, 1 % and 10 % of the mean
    colours = difference_colours(ours, reference, "absolute")
    twice = difference_colours(2.0 * ours, 2.0 * reference, "absolute")
    np.testing.assert_array_equal(colours, twice)
    luma = colours[0] @ (0.2126, 0.7152, 0.0722)
    assert luma[0] < luma[1] < luma[2]


def test_a_black_reference_counts_differences_as_they_are() -> None:
    black, ours = np.zeros((2, 2, 3)), np.ones((2, 2, 3))
    assert errors(ours, black).rmse == 1.0 and errors(black, black).rmse == 0.0
    assert difference_colours(ours, black, "signed").shape == (2, 2, 3)


def test_another_size_is_one_line() -> None:
    with pytest.raises(InsituError, match=r"^old\.exr: 5 x 2 pixels, expected 4 x 3 as the picture"):
        check_same_size(np.zeros((3, 4, 3)), np.zeros((2, 5, 3)), "old.exr")
