"""Which pixels a brush touches, and what they are to become."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from engine.core.errors import InsituError
from engine.inverse.highlight_brush import EFFECTS, HighlightBrush, StrokeShares, evenly, wanted_radiance
from engine.light.environment import LUMINANCE
from engine.scene.picture_frame import PictureFrame

WIDTH, HEIGHT = 40, 30


def frame(edge_share=1.0):
    """An object in the left half of the picture, another in the right; the last column of the left one is an edge."""
    image = np.zeros((HEIGHT, WIDTH), int)
    image[:, WIDTH // 2 :] = 1
    left, right = (np.flatnonzero(image.ravel() == i) for i in (0, 1))
    pixel = np.concatenate([left, right])
    share = np.where(pixel % WIDTH == WIDTH // 2 - 1, edge_share, 1.0).astype(np.float32)
    ranges = np.array([[0, len(left)], [len(left), len(pixel)]])
    zeros = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    return PictureFrame(pixel, ranges, image, zeros, zeros, np.zeros(len(pixel)), share=share)


def shares_of(some, i_object, places, brush, radiance=1.0):
    begin, end = some.object_ranges[i_object]
    stroke = StrokeShares(some, i_object, brush, np.full((end - begin, 3), radiance))
    stroke.add(places)
    return stroke.shares


def shares_image(some, i_object, places, brush):
    image = np.zeros(WIDTH * HEIGHT)
    begin, end = some.object_ranges[i_object]
    image[some.pixel[begin:end]] = shares_of(some, i_object, places, brush)
    return image.reshape(HEIGHT, WIDTH)


def test_a_dab_is_a_disc_of_one_object():
    brush = HighlightBrush(radius=6.0, hardness=0.5)
    image = shares_image(frame(), 0, [(18.0, 15.0)], brush)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    distance = np.hypot(x - 18.0, y - 15.0)
    own = x < WIDTH // 2
    assert (image[own & (distance <= 3.0)] == 1.0).all() and (image[(distance >= 6.0) | ~own] == 0.0).all()
    between = own & (distance > 3.0) & (distance < 6.0)
    assert ((image[between] > 0.0) & (image[between] < 1.0)).all()
    # Half way between: a half.
    assert np.interp(4.5, [0, 1], [0, 1]) and stroke_half(brush) == pytest.approx(0.5)


def stroke_half(brush):
    one = PictureFrame(
        np.array([0]), np.array([[0, 1]]), np.zeros((1, 1), int), np.zeros((1, 1, 3)), np.zeros((1, 1, 3)), np.zeros(1)
    )  # fmt: skip
    return shares_of(one, 0, [(0.5 + 4.5, 0.5)], brush)[0]


def test_a_line_has_no_gaps_and_its_ends_are_round():
    image = shares_image(frame(), 0, [(4.0, 4.0), (4.0, 26.0)], HighlightBrush(radius=3.0, hardness=1.0))
    assert (image[5:25, 3:5] == 1.0).all() and image[29, 4] == 0.0 and image[:, 8:].max() == 0.0


@settings(deadline=None, max_examples=60)
@example([(5.0, 5.0), (5.0 + 1e-15, 5.0)], 8.0, 0.5)
@example([(0.0, 5.0), (1e-40, 5.0)], 8.0, 0.5)
@given(st.lists(st.tuples(st.floats(-9.0, 49.0), st.floats(-9.0, 39.0)), min_size=1, max_size=5),
       st.floats(1.0, 60.0), st.floats(0.0, 1.0))  # fmt: skip
def test_a_stroke_in_parts_touches_what_is_near_its_line(places, radius, hardness):
    """The slow twin: every pixel's distance to every segment."""
    some, brush = frame(), HighlightBrush(radius=radius, hardness=hardness)
    stroke = StrokeShares(some, 0, brush, np.ones((some.object_ranges[0, 1], 3)))
    stroke.add(places[:1])
    for start, stop in itertools.pairwise(places):
        stroke.add([start, stop])
    row, column = np.divmod(some.pixel[: some.object_ranges[0, 1]], WIDTH)
    distance = np.full(len(row), np.inf)
    for start, stop in zip(places, places[1:] or places, strict=False):
        at, along = np.stack([column + 0.5 - start[0], row + 0.5 - start[1]], axis=1), np.subtract(stop, start)
        t = np.clip(at @ along / max(along @ along, 1e-30), 0.0, 1.0)
        distance = np.minimum(distance, np.linalg.norm(at - t[:, None] * along, axis=1))
    t = np.clip((radius - distance) / max(radius - hardness * radius, 1e-6), 0.0, 1.0)
    is_clear = (np.abs(distance - radius) > 1e-3) | (hardness < 0.99)
    assert stroke.shares[is_clear] == pytest.approx((t * t * (3.0 - 2.0 * t))[is_clear], abs=2e-2)


def test_what_is_not_finite_is_not_touched():
    assert not shares_of(frame(), 0, [(10.0, 10.0)], HighlightBrush(radius=5.0), np.nan).any()


def test_few_of_many_points_decide():
    some = evenly(np.arange(1000), 40)
    assert 20 <= len(some) <= 40 and np.ptp(np.diff(some)) == 0 and some[-1] > 900
    assert evenly(np.arange(3), 40).tolist() == [0, 1, 2] and not evenly(np.arange(0), 40).size


def test_a_stroke_does_not_add_to_itself():
    brush = HighlightBrush(radius=5.0)
    once = shares_image(frame(), 0, [(10.0, 10.0), (12.0, 10.0)], brush)
    again = shares_image(frame(), 0, [(10.0, 10.0), (12.0, 10.0), (10.0, 10.0)], brush)
    assert (once == again).all()


def test_pixels_that_see_more_than_the_object_are_left_out():
    brush = HighlightBrush(radius=6.0)
    image = shares_image(frame(edge_share=0.6), 0, [(19.0, 15.0)], brush)
    assert image[:, WIDTH // 2 - 1].max() == 0.0 and image.max() > 0.5


def test_brighter_and_darker_are_stops():
    seen, shares = np.array([[1.0, 2.0, 4.0]] * 3), np.array([0.0, 0.5, 1.0])
    assert wanted_radiance(HighlightBrush("brighter", stops=2.0), seen, shares) == pytest.approx(
        seen * np.array([[1.0], [2.0], [4.0]])
    )
    assert wanted_radiance(HighlightBrush("darker", stops=1.0), seen, shares)[2] == pytest.approx([0.5, 1.0, 2.0])


def test_a_tint_keeps_the_luminance_and_as_there_is_what_is_there():
    seen, shares = np.array([[1.0, 2.0, 4.0], [0.5, 0.5, 0.5]]), np.ones(2)
    red = wanted_radiance(HighlightBrush("tint", colour=(9.0, 0.9, 0.9)), seen, shares)
    assert red @ LUMINANCE == pytest.approx(seen @ LUMINANCE) and red[:, 0] / red[:, 1] == pytest.approx([10.0, 10.0])
    there = wanted_radiance(HighlightBrush("as_there", colour=(3.0, 2.0, 1.0)), seen, np.array([1.0, 0.5]))
    assert there[0] == pytest.approx([3.0, 2.0, 1.0]) and there[1] == pytest.approx([1.75, 1.25, 0.75])


@pytest.mark.parametrize("effect", EFFECTS)
def test_extremes_are_finite_and_not_negative(effect):
    seen = np.array([[0.0, 1e30, np.nan], [np.inf, -1.0, 1e-30]])
    found = wanted_radiance(HighlightBrush(effect, 10.0, colour=(0.0, 0.0, 0.0)), seen, np.ones(2))
    assert np.isfinite(found).all() and (found >= 0.0).all()


@pytest.mark.parametrize(
    "values", [{"effect": "louder"}, {"stops": -1.0}, {"stops": np.nan}, {"radius": 0.0}, {"radius": 1e4},
               {"hardness": 1.1}, {"colour": (-1.0, 0.0, 0.0)}]
)  # fmt: skip
def test_bad_brushes_are_refused_in_one_line(values):
    with pytest.raises(InsituError) as error:
        HighlightBrush(**values)
    assert next(iter(values)) in str(error.value) and "\n" not in str(error.value)
