"""Curve operators: regions, order, monotone maps, steps, and a sweep over everything a drag can produce."""

from __future__ import annotations

import dataclasses
import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from engine.curve.operators import (
    STEEPEST,
    VALUE_LIMIT,
    Edit,
    Operator,
    OperatorError,
    TabulatedCurve,
    apply_operators,
    collapse,
    combine,
    diagonal,
    edit_at,
    edits_of,
    falloff_extremes,
    helper_function,
    is_pair,
    largest_monotone_magnitude,
    move_edit,
    shift,
    smooth_step,
    strength,
    unique_sorted,
)
from engine.material.microfacet import ggx

HALF_PI = math.pi / 2
GAMMA = np.linspace(0.0, HALF_PI, 1001)
REGIONS = (0.3, 0.5, 0.8, 1.2)
INSIDE = (GAMMA >= 0.5) & (GAMMA <= 0.8)
OUTSIDE = (GAMMA < 0.3) | (GAMMA > 1.2)


def ramp(gamma):
    """x, 2x, 3x."""
    return gamma[:, None] * np.array([1.0, 2.0, 3.0])


def spike(gamma):
    return np.repeat(ggx(np.cos(gamma), np.sin(gamma) ** 2, 1e-4)[:, None], 3, axis=1)


def test_strength():
    # 1 on [b, c], exactly 0 outside [a, d], 1/2 in the middle of each falloff [eq. 9.2].
    operator = Operator("translate", "y", *REGIONS, magnitude=1.0)
    weight = strength(operator, GAMMA)
    assert (weight[INSIDE] == 1.0).all()
    assert (weight[OUTSIDE] == 0.0).all()
    assert strength(operator, np.array([0.3, 0.4, 1.0, 1.2])) == pytest.approx([0.0, 0.5, 0.5, 0.0], abs=1e-12)


def test_translate_y():
    # Adds the magnitude [eq. 9.1].
    after = apply_operators([Operator("translate", "y", *REGIONS, magnitude=-0.25)], ramp)(GAMMA)
    assert after[INSIDE] == pytest.approx(ramp(GAMMA)[INSIDE] - 0.25)
    assert (after[OUTSIDE] == ramp(GAMMA)[OUTSIDE]).all()


def test_amplify_y():
    # Multiplies the distance from the baseline [eq. 9.4]: values at the baseline stay.
    after = apply_operators([Operator("amplify", "y", *REGIONS, magnitude=3.0, baseline=0.6)], ramp)(GAMMA)
    assert after[INSIDE] == pytest.approx(0.6 + 3.0 * (ramp(GAMMA)[INSIDE] - 0.6))
    assert (after[OUTSIDE] == ramp(GAMMA)[OUTSIDE]).all()


def test_translate_x():
    # A positive magnitude moves the curve to the right: the value at x is the old one at x - m [eq. 9.3].
    after = apply_operators([Operator("translate", "x", *REGIONS, magnitude=0.05)], ramp)(GAMMA)
    assert after[INSIDE] == pytest.approx(ramp(GAMMA - 0.05)[INSIDE])
    assert (after[OUTSIDE] == ramp(GAMMA)[OUTSIDE]).all()


def test_amplify_x():
    # Widens about the baseline: the value at x is the old one at base + (x - base) / m [eq. 9.5].
    operator = Operator("amplify", "x", *REGIONS, magnitude=1.1, baseline=0.6)
    after = apply_operators([operator], ramp)(GAMMA)
    assert after[INSIDE] == pytest.approx(ramp(0.6 + (GAMMA - 0.6) / 1.1)[INSIDE])
    assert (after[OUTSIDE] == ramp(GAMMA)[OUTSIDE]).all()


def test_y_before_x_in_a_diagonal_drag():
    # The curve is raised where it was and then moved: at x it is the old value at x - 0.05, plus the rise there.
    after = apply_operators(diagonal(REGIONS, dx=0.05, dy=2.0), ramp)(GAMMA)
    where = (GAMMA >= 0.55) & (GAMMA <= 0.8)
    assert after[where] == pytest.approx(ramp(GAMMA - 0.05)[where] + 2.0)
    # Just right of b the value comes from x - 0.05, left of b, where the rise has not reached its full height.
    assert after[INSIDE][0, 0] < 0.5 - 0.05 + 2.0 - 1e-3


def test_order_matters_as_documented():
    # First in the tuple is lowest: (ramp + 1) * 2 and not ramp * 2 + 1.
    add = Operator("translate", "y", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=1.0)
    double = Operator("amplify", "y", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=2.0)
    assert apply_operators([add, double], ramp)(GAMMA) == pytest.approx((ramp(GAMMA) + 1.0) * 2.0)
    assert apply_operators([double, add], ramp)(GAMMA) == pytest.approx(ramp(GAMMA) * 2.0 + 1.0)


def test_inverse_edit_restores():
    there = Operator("translate", "y", *REGIONS, magnitude=123.456)
    back = dataclasses.replace(there, magnitude=-123.456)
    assert apply_operators([there, back], ramp)(GAMMA) == pytest.approx(ramp(GAMMA), abs=1e-12)


def test_muted_and_neutral_operators_change_nothing():
    muted = Operator("translate", "y", *REGIONS, magnitude=5.0, muted=True)
    neutral = [Operator(kind, axis, *REGIONS, magnitude=0.0 if kind == "translate" else 1.0, baseline=0.5)
               for kind in ("translate", "amplify") for axis in ("x", "y")]  # fmt: skip
    assert (apply_operators([muted], ramp)(GAMMA) == ramp(GAMMA)).all()
    assert apply_operators(neutral, ramp)(GAMMA) == pytest.approx(ramp(GAMMA), abs=1e-15)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_channels_are_spared(axis):
    # Only green moves; a later operator on all channels still sees each channel's own place.
    green = Operator("translate", axis, *REGIONS, magnitude=0.05, channels=(False, True, False))
    everything = Operator("translate", "x", *REGIONS, magnitude=0.02)
    after = apply_operators([green], ramp)(GAMMA)
    assert (after[:, [0, 2]] == ramp(GAMMA)[:, [0, 2]]).all()
    assert (after[INSIDE, 1] != ramp(GAMMA)[INSIDE, 1]).all()
    both = apply_operators([green, everything], ramp)(GAMMA)
    alone = apply_operators([everything], ramp)(GAMMA)
    assert both[:, [0, 2]] == pytest.approx(alone[:, [0, 2]])
    assert (np.abs(both[INSIDE, 1] - alone[INSIDE, 1]) > 1e-4).all()


def test_zero_width_regions_are_steps():
    # a = b and c = d: full strength on the closed interval, untouched outside, no division by zero.
    operator = Operator("translate", "y", 0.5, 0.5, 0.8, 0.8, magnitude=1.0)
    x = np.array([0.5 - 1e-9, 0.5, 0.8, 0.8 + 1e-9])
    assert strength(operator, x).tolist() == [0.0, 1.0, 1.0, 0.0]
    point = Operator("amplify", "y", 0.5, 0.5, 0.5, 0.5, magnitude=9.0)
    assert strength(point, x).tolist() == [0.0, 1.0, 0.0, 0.0]


def test_translation_limit_closed_form():
    # The falloff's steepest slope is 2 / width, so the map stays monotone up to half the width it runs into.
    operator = Operator("translate", "x", *REGIONS, magnitude=1.0)
    assert largest_monotone_magnitude(operator) == pytest.approx(0.5 * (0.5 - 0.3))
    assert largest_monotone_magnitude(dataclasses.replace(operator, magnitude=-1.0)) == pytest.approx(
        -0.5 * (1.2 - 0.8)
    )
    assert largest_monotone_magnitude(dataclasses.replace(operator, axis="y")) == math.inf


def test_a_step_in_x_only_jumps_forwards():
    # To the right: the left edge would have to jump back, so nothing moves; the right edge may jump.
    blocked = Operator("translate", "x", 0.5, 0.5, 0.8, 1.2, magnitude=0.1)
    assert largest_monotone_magnitude(blocked) == 0.0
    allowed = Operator("translate", "x", 0.3, 0.5, 0.8, 0.8, magnitude=0.1)
    assert largest_monotone_magnitude(allowed) == pytest.approx(0.1)
    squeezed = Operator("amplify", "x", 0.5, 0.5, 0.8, 1.2, magnitude=2.0)
    assert largest_monotone_magnitude(squeezed) == 1.0


def test_the_ends_of_the_domain_do_not_limit():
    # The whole curve may move: there is nothing left of 0 to collide with.
    whole = Operator("translate", "x", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=0.4)
    assert largest_monotone_magnitude(whole) == HALF_PI
    assert shift(whole, GAMMA) == pytest.approx(np.clip(GAMMA - 0.4, 0.0, HALF_PI))
    stretched = Operator("amplify", "x", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=100.0)
    assert shift(stretched, GAMMA) == pytest.approx(GAMMA / 100.0)


def test_clamped_at_the_limit_is_monotone_and_beyond_is_not():
    # Just beyond the limit the unclamped map does fall, so the limit is not merely safe.
    operator = Operator("amplify", "x", *REGIONS, magnitude=50.0, baseline=0.1)
    limit = largest_monotone_magnitude(operator)
    assert 1.0 < limit < 50.0
    x = np.linspace(0.0, HALF_PI, 200_001)
    weight = strength(operator, x)
    bold = 0.1 + (x - 0.1) * (1.0 + (1.0 / (1.01 * limit) - 1.0) * weight)
    assert (np.diff(shift(operator, x)) >= -1e-15).all()
    assert (np.diff(bold) < 0.0).any()


def test_dragging_a_handle_past_others_takes_them_along():
    operator = Operator("translate", "y", *REGIONS, magnitude=1.0)
    assert operator.with_regions(b=1.0).regions == (0.3, 1.0, 1.0, 1.2)
    assert operator.with_regions(c=0.1).regions == (0.1, 0.1, 0.1, 1.2)
    assert operator.with_regions(a=2.0).regions == (2.0, 2.0, 2.0, 2.0)
    assert operator.with_regions(a=0.1, d=1.5).regions == (0.1, 0.5, 0.8, 1.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"a": 0.6}, "a <= b <= c <= d"),
        ({"magnitude": math.nan}, "finite"),
        ({"d": math.inf}, "finite"),
        ({"magnitude": 1e13}, "within 1e\\+12"),
        ({"axis": "z"}, "x.y"),
        ({"kind": "amplify", "axis": "x", "magnitude": 0.0}, "more than 0"),
    ],
)
def test_bad_operators_are_refused(change, message):
    with pytest.raises(OperatorError, match=message):
        dataclasses.replace(Operator("translate", "y", *REGIONS, magnitude=1.0), **change)


@pytest.mark.parametrize(
    ("gammas", "values"),
    [((), ()), ((0.0,), ((1.0, 2.0),)), ((0.0, 1.0), ((1.0, 1.0, 1.0),)), ((1.0, 0.0), ((1.0,) * 3,) * 2),
     ((0.0,), ((math.nan,) * 3,)), ((math.inf,), ((1.0,) * 3,))],
)  # fmt: skip
def test_bad_tables_are_refused(gammas, values):
    with pytest.raises(OperatorError):
        TabulatedCurve(gammas, values)


def test_a_table_replaces_what_is_below():
    # Linear between samples, constant beyond; operators after it still apply.
    table = TabulatedCurve((0.5, 1.0), ((1.0, 10.0, 0.0), (2.0, 20.0, 0.0)))
    raise_all = Operator("translate", "y", 0.0, 0.0, HALF_PI, HALF_PI, magnitude=0.5)
    after = apply_operators([raise_all, table, raise_all], spike)(np.array([0.0, 0.75, 1.5]))
    assert after == pytest.approx(np.array([[1.5, 10.5, 0.5], [2.0, 15.5, 0.5], [2.5, 20.5, 0.5]]))
    muted = dataclasses.replace(table, muted=True)
    assert apply_operators([muted], ramp)(GAMMA) == pytest.approx(ramp(GAMMA))


@pytest.mark.parametrize("curve", [ramp, spike])
def test_collapse_keeps_the_curve(curve):
    # A table instead of spike and operators: within 1e-3 of the local value, step included.
    stack = [
        Operator("amplify", "y", 0.2, 0.4, 0.4, 0.9, magnitude=5.0),
        Operator("translate", "y", 0.7, 0.7, 0.9, 0.9, magnitude=3.0),
        Operator("translate", "x", 0.1, 0.3, 1.0, 1.3, magnitude=0.05, channels=(True, False, True)),
    ]
    edited = apply_operators(stack, curve)
    table = collapse(stack, curve)
    x = np.concatenate([GAMMA, np.geomspace(1e-6, 1.0, 997)])
    assert len(table.gammas) < 4096
    largest = np.abs(edited(x)).max()
    assert table(x) == pytest.approx(edited(x), rel=1e-3, abs=1e-5 * largest)


angles = st.floats(-0.5, 2.0) | st.sampled_from([0.0, 1e-300, 1e-13, 0.5, HALF_PI])
magnitudes = st.floats(-1e12, 1e12) | st.sampled_from([0.0, 1.0, -1.0, 1e-300])


@st.composite
def operators(draw):
    kind, axis = draw(st.sampled_from(["translate", "amplify"])), draw(st.sampled_from("xy"))
    magnitude = draw(magnitudes)
    if kind == "amplify" and axis == "x":
        magnitude = max(abs(magnitude), 1e-300)
    flags = tuple(draw(st.tuples(st.booleans(), st.booleans(), st.booleans())))
    regions = sorted(draw(st.tuples(angles, angles, angles, angles)))
    return Operator(kind, axis, *regions, magnitude=magnitude, baseline=draw(st.floats(-10.0, 10.0)), channels=flags)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(operator=operators())
def test_any_operator_is_monotone_in_x_and_silent_outside(operator):
    x = np.unique(np.concatenate([np.linspace(0.0, HALF_PI, 501), np.clip(operator.regions, 0.0, HALF_PI)]))
    outside = (x < operator.a) | (x > operator.d)
    if operator.axis == "x":
        moved = shift(operator, x)
        assert (np.diff(moved) >= -1e-12).all()
        assert (moved[outside] == x[outside]).all()
        assert (moved >= 0.0).all() and (moved <= HALF_PI).all()
    else:
        values = combine(operator, x, spike(x))
        assert (values[outside] == spike(x)[outside]).all()
        assert np.isfinite(values).all()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(stack=st.lists(operators(), max_size=6), curve=st.sampled_from([ramp, spike]))
def test_any_stack_stays_finite(stack, curve):
    edited = apply_operators(stack, curve)
    values = edited(np.concatenate([GAMMA[::10], [1e-300, 1e-8]]))
    assert np.isfinite(values).all()
    assert np.abs(values).max() <= VALUE_LIMIT
    assert all(0.0 < place < HALF_PI for place in edited.features)


def test_is_the_textbook_quotient():
    # e(t) / (e(t) + e(1 - t)) with e(t) = exp(-1/t).
    t = np.linspace(0.05, 0.95, 37)
    rising, falling = np.exp(-1.0 / t), np.exp(-1.0 / (1.0 - t))
    assert smooth_step(t) == pytest.approx(rising / (rising + falling), rel=1e-12)


def test_ends_are_exact():
    # Exactly 0 and 1 at and beyond the ends, 1/2 in the middle.
    t = np.array([-math.inf, -1.0, 0.0, 1e-300, 0.5, 1.0, 2.0, math.inf])
    assert smooth_step(t).tolist() == [0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0]


def test_rises_and_mirrors():
    t = np.linspace(0.0, 1.0, 2001)
    step = smooth_step(t)
    assert (np.diff(step) >= 0.0).all()
    assert step + step[::-1] == pytest.approx(np.ones_like(t), abs=1e-15)


def test_steepest_slope():
    # s' = s (1 - s) (1/t^2 + 1/(1-t)^2) = 1/4 * 8 in the middle, and nowhere more.
    t = np.linspace(0.0, 1.0, 100_001)
    slope = np.diff(smooth_step(t)) / np.diff(t)
    assert slope.max() == pytest.approx(STEEPEST, rel=1e-6)
    assert t[slope.argmax()] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_vanish_at_the_ends(order):
    # Finite differences of any order near 0 are below any power of the distance: here below h^6 for h = 1/50.
    t = np.linspace(0.0, 0.02, 21)
    assert np.abs(np.diff(smooth_step(t), order)).max() < 0.02**6


def test_falloff_extremes_bound_the_bracket():
    # w + (x - base) w' on the fade from 1 to 0.2, by differences of (x - base) w.
    x = np.linspace(1.0, 0.2, 50_001)
    product = (x - 0.4) * smooth_step((x - 1.0) / (0.2 - 1.0))
    bracket = np.diff(product) / np.diff(x)
    low, high = falloff_extremes(1.0, 0.2, 0.4)
    assert low <= bracket.min() <= low + 1e-2
    assert high - 1e-2 <= bracket.max() <= high


def test_each_value_once_least_first() -> None:
    assert_array_equal(unique_sorted(np.array([3.0, -1.0, 3.0, 0.0, -1.0])), [-1.0, 0.0, 3.0])
    assert_array_equal(unique_sorted(np.array([])), [])


def test_as_numpy_has_it() -> None:
    values = np.random.default_rng(3).integers(0, 50, 200) / 7.0
    assert_array_equal(unique_sorted(values), np.unique(values))


PAIR_REGIONS = (0.1, 0.2, 0.3, 0.4)
PAIR = diagonal(PAIR_REGIONS, 0.02, 0.5)
LIKE_PAIR = (dataclasses.replace(PAIR[0], joined=False, magnitude=0.6), dataclasses.replace(PAIR[1], magnitude=0.01))
TABLE = TabulatedCurve((0.0, 1.0), ((1.0, 1.0, 1.0),) * 2)


def test_operators_that_are_alike_by_chance_are_no_pair() -> None:
    assert is_pair(PAIR, 0)
    assert not is_pair(LIKE_PAIR, 0)
    assert not is_pair(PAIR, 1) and not is_pair(PAIR, -1) and not is_pair((), 0)
    # A Y-operator whose partner is not above it stands alone.
    assert edits_of((PAIR[0], TABLE, PAIR[1])) == [range(0, 1), range(1, 2), range(2, 3)]


def test_an_edit_is_named_by_either_of_its_operators() -> None:
    operators = (TABLE, *PAIR, *LIKE_PAIR)
    assert edits_of(operators) == [range(0, 1), range(1, 3), range(3, 4), range(4, 5)]
    assert edit_at(operators, 1) == edit_at(operators, 2) == range(1, 3)
    with pytest.raises(IndexError):
        edit_at(operators, 5)


@pytest.mark.parametrize("order", list(permutations(((TABLE,), PAIR, LIKE_PAIR[:1], LIKE_PAIR[1:]))))
def test_no_move_parts_a_pair_or_makes_one(order: tuple[tuple[Edit, ...], ...]) -> None:
    operators = tuple(operator for edit in order for operator in edit)
    for index in range(len(operators)):
        for to in range(len(operators)):
            after = move_edit(operators, index, to)
            spans = [after[span.start : span.stop] for span in edits_of(after)]
            assert sorted(map(repr, spans)) == sorted(map(repr, order))
            # What was moved stands where the other edit stood, counted in edits.
            there = [operators[span.start : span.stop] for span in edits_of(operators)]
            target = edits_of(operators).index(edit_at(operators, to))
            span = edit_at(operators, index)
            assert spans[target] == there[edits_of(operators).index(span)]


def test_an_x_operator_knows_its_limit() -> None:
    slack = Operator("translate", "x", *PAIR_REGIONS, magnitude=0.049)
    # Monotone up to half the width of the falloff, 0.05 [BenArtzi07, eq. 9.3].
    assert not slack.at_limit
    assert dataclasses.replace(slack, magnitude=0.3).clamp_magnitude().at_limit
    assert not Operator("translate", "y", *PAIR_REGIONS, magnitude=1e6).at_limit


@pytest.mark.parametrize("kind", ["translate", "amplify"])
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("magnitude", [0.3, 1.4])
def test_the_helper_function_is_the_operator(kind, axis, magnitude):
    # [BenArtzi07, 9.1]: adding, multiplying by or composing with the helper function is the edit.
    operator = Operator(kind, axis, *REGIONS, magnitude=magnitude, baseline=0.4)
    helper, base = helper_function(operator, GAMMA)
    edited = apply_operators([operator], ramp)(GAMMA)
    if axis == "x":
        expected = ramp(helper)
    elif kind == "translate":
        expected = ramp(GAMMA) + helper[:, None]
    else:
        expected = 0.4 + (ramp(GAMMA) - 0.4) * helper[:, None]
    assert edited == pytest.approx(expected)
    assert (helper[OUTSIDE] == base[OUTSIDE]).all()
    assert base == pytest.approx(GAMMA if axis == "x" else np.full_like(GAMMA, kind == "amplify"))
    # And it is what the operator makes of its base function, its baseline aside.
    made = apply_operators(
        [dataclasses.replace(operator, baseline=0.4 if axis == "x" else 0.0)],
        lambda x: np.repeat((x if axis == "x" else np.full_like(x, kind == "amplify"))[:, None], 3, 1),
    )
    assert made(GAMMA)[:, 0] == pytest.approx(helper)
