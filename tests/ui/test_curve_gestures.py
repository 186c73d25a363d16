"""What drags make of operators, without a window."""

from __future__ import annotations

import dataclasses
import math
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.document.view_state import Tool, ViewState
from engine.curve.operators import Operator, apply_operators, diagonal, is_pair
from engine.curve.tables import TABLE_KINDS, TableKind, TabulatedCurve
from ui.panels.curve_gestures import (
    HALF_PI,
    OperatorGroup,
    Pull,
    core,
    drag_knob,
    drag_region,
    knob_of,
    new_operators,
    operators_in_use,
    regions_around,
    tool_of,
    with_regions,
)
from ui.panels.window_state import CurveGrip, Travel

REGIONS = (0.2, 0.4, 0.6, 0.9)
ALONG_AXES = [tool for tool in get_args(Tool) if "_" in tool]


def lobe(gamma: np.ndarray) -> np.ndarray:
    """A highlight, brightest in red."""
    return np.exp(-4.0 * gamma[:, None]) * np.array([2.0, 1.0, 0.5])


def grip(operators: tuple[Operator, ...] = (), index: int | None = None, **changes: object) -> CurveGrip:
    start = CurveGrip("magnitude", (0.0, 0.0), operators, index, False, REGIONS, (0.0, HALF_PI), (0.0, 2.0))
    return dataclasses.replace(start, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("tool", get_args(Tool))
def test_each_tool_makes_neutral_operators_and_is_recognised(tool: str) -> None:
    made = new_operators(tool, REGIONS, (True, True, True))  # type: ignore[arg-type]
    gamma = np.linspace(0.0, HALF_PI, 200)
    np.testing.assert_allclose(apply_operators(made, lobe)(gamma), lobe(gamma), rtol=1e-12)
    assert tool_of(OperatorGroup(made, None)) == tool
    assert is_pair(made, 0) == tool.endswith("xy")


def test_a_diagonal_drag_is_the_engines_diagonal() -> None:
    hand = OperatorGroup(new_operators("translate_xy", REGIONS, (True, True, True)), None)
    x = core(REGIONS)
    y = float(lobe(np.array([x]))[0, 0])
    made = drag_knob(grip(), hand, lobe, Pull((x + 0.05, y + 0.3), (1.5, 1.5)))
    expected = diagonal(REGIONS, 0.05, 0.3)
    assert [o.axis for o in made if isinstance(o, Operator)] == [o.axis for o in expected]
    for operator, wanted in zip(made, expected, strict=True):
        assert isinstance(operator, Operator)
        assert operator.magnitude == pytest.approx(wanted.magnitude)


PULLED = st.floats(0.1, 2.0) | st.floats(-2.0, -0.1)


@given(st.sampled_from(ALONG_AXES), st.floats(0.35, 0.65), st.floats(0.1, 1.5), PULLED)
def test_the_ring_stands_where_it_was_dragged_and_amplifies_evenly(tool: str, x: float, y: float, power: float) -> None:
    hand = OperatorGroup(new_operators(tool, REGIONS, (True, True, True)), None)  # type: ignore[arg-type]
    made = drag_knob(grip(), hand, lobe, Pull((x, y), (2.0**power, 2.0**power)))
    members = tuple(o for o in made if isinstance(o, Operator))
    knob = knob_of(OperatorGroup(members, 0), lobe)
    if tool in ("translate_y", "translate_xy"):
        assert knob.y == pytest.approx(y, rel=1e-9)
    for operator in members:
        # X stops where the curve would fold over; short of that it follows the mouse.
        if operator.axis == "x":
            assert operator == operator.clamp_magnitude()
        if (operator.kind, operator.axis) == ("translate", "x"):
            assert abs(knob.x - core(REGIONS)) <= abs(x - core(REGIONS)) + 1e-9
        if (operator.kind, operator.axis) == ("amplify", "y"):
            assert operator.magnitude == pytest.approx(2.0**power)


@given(st.sampled_from(TABLE_KINDS), st.floats(0.1, 3.0))
def test_the_ring_of_a_table_stands_on_the_curve(kind: TableKind, magnitude: float) -> None:
    gammas, values = (0.3, 0.5, 0.7), ((0.5, 0.2, 0.1), (0.8, 0.3, 0.2), (0.4, 0.2, 0.1))
    table = TabulatedCurve(gammas, values, kind=kind, regions=REGIONS, magnitude=magnitude)
    x = np.array([core(REGIONS)])
    knob = knob_of(OperatorGroup((table,), 0), lobe)
    assert knob.y == pytest.approx(apply_operators((table,), lobe)(x).max())
    assert knob.anchor[1] == pytest.approx(0.8 if table.replaces else lobe(x).max())


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=6), st.floats(0.1, 3.0))
def test_amplifying_back_and_forth_is_the_sum(powers: list[float], start: float) -> None:
    """However a way is cut into drags, it ends at the same factor: a pixel multiplies by as much everywhere."""
    (operator,) = new_operators("amplify_y", REGIONS, (True, True, True))
    made: tuple[object, ...] = (dataclasses.replace(operator, magnitude=start),)
    for power in powers:
        held = grip(made, 0)  # type: ignore[arg-type]
        made = drag_knob(held, OperatorGroup(made, 0), lobe, Pull((0.5, 1.0), (1.0, 2.0**power)))  # type: ignore[arg-type]
    (last,) = made
    expected = start * 2.0 ** sum(powers)
    if all(0.01 < start * 2.0 ** sum(powers[:n]) for n in range(len(powers))):
        assert isinstance(last, Operator) and last.magnitude == pytest.approx(expected)


@given(st.sampled_from(["translate_xy", "amplify_xy"]), st.floats(0.2, 0.8), st.floats(0.0, 1.0), PULLED)
def test_a_straight_pull_of_a_diagonal_changes_one_of_the_pair(tool: str, x: float, y: float, power: float) -> None:
    """Pixels to angle and back leave 1e-16; the panel said "X -3.18e-15°"."""
    pair = new_operators(tool, REGIONS, (True, True, True))  # type: ignore[arg-type]
    for factors in ((1.0, 2.0**power), (2.0**power, 1.0)):
        made = drag_knob(grip(), OperatorGroup(pair, None), lobe, Pull((x, y), factors))
        for old, new in zip(pair, made, strict=True):
            assert (new == old) or factors["xy".index(old.axis)] != 1.0


def test_dragging_an_operator_below_others_keeps_those() -> None:
    others = new_operators("amplify_y", (1.0, 1.1, 1.2, 1.3), (True, True, True))
    operators = (*new_operators("translate_y", REGIONS, (True, True, True)), *others)
    hand = OperatorGroup(operators[:1], 0)
    made = drag_knob(grip(operators, 0), hand, lobe, Pull((0.5, 1.0), (1.0, 1.0)))
    assert made[1:] == others
    assert len(made) == 2


@given(st.sampled_from("abcd"), st.floats(-1.0, 3.0))
def test_region_ends_stay_ordered_and_in_range(name: str, to: float) -> None:
    regions = drag_region(grip(handle=name), to)
    assert list(regions) == sorted(regions)
    assert 0.0 <= regions[0] and regions[3] <= HALF_PI
    assert regions["abcd".index(name)] == pytest.approx(min(max(to, 0.0), HALF_PI))


@given(st.floats(-2.0, 2.0))
def test_the_region_moves_as_a_whole(shift: float) -> None:
    regions = drag_region(grip(handle="region"), shift)
    np.testing.assert_allclose(np.diff(regions), np.diff(REGIONS), atol=1e-12)
    assert 0.0 <= regions[0] and regions[3] <= HALF_PI + 1e-12


def test_new_regions_clamp_a_horizontal_magnitude() -> None:
    (operator,) = new_operators("translate_x", REGIONS, (True, True, True))
    strong = dataclasses.replace(operator, magnitude=0.1)
    (changed,) = with_regions(grip((strong,), 0), (0.39, 0.4, 0.6, 0.9))
    assert isinstance(changed, Operator)
    # A falloff of 0.01 lets the curve move by half of that before it folds over.
    assert changed.magnitude == pytest.approx(0.005)


@pytest.mark.parametrize("x", [0.0, 0.3, HALF_PI])
def test_regions_around_a_place_hold_it(x: float) -> None:
    a, b, c, d = regions_around(x, HALF_PI)
    assert 0.0 <= a <= b <= x <= c <= d <= HALF_PI


def test_a_selected_operator_is_in_hand() -> None:
    pair = new_operators("amplify_xy", REGIONS, (True, False, False))
    single = new_operators("translate_x", (0.0, 0.0, 0.1, 0.2), (True, True, True))
    operators = (*single, *pair)
    assert operators_in_use(operators, ViewState(operator=0)).operators == single
    assert operators_in_use(operators, ViewState(operator=1)) == OperatorGroup(pair, 1)
    # Whichever of a pair is named, both are in hand.
    assert operators_in_use(operators, ViewState(operator=2)) == OperatorGroup(pair, 1)
    assert operators_in_use(operators, ViewState(operator=7)).index is None
    assert operators_in_use((), ViewState(active_tool="translate_xy")).pair


def test_amplifying_reaches_what_is_next_to_nothing_no_faster() -> None:
    (operator,) = new_operators("amplify_y", REGIONS, (True, True, True))
    for height in (0.0, 1e-9, 1.0):
        hand = OperatorGroup((operator,), None)
        pull = Pull((0.5, 1.0), (1.0, 2.0))
        (made,) = drag_knob(grip(), hand, lambda gamma, h=height: np.full((len(gamma), 3), h), pull)  # type: ignore[misc]
        assert isinstance(made, Operator) and made.magnitude == 2.0
    (off,) = drag_knob(
        grip((dataclasses.replace(operator, magnitude=0.0),), 0),
        OperatorGroup((operator,), 0),
        lobe,
        Pull((0.5, 1.0), (1.0, 2.0)),
    )
    assert isinstance(off, Operator) and off.magnitude == 0.02  # out of nothing by hundredths
    (flat,) = new_operators("amplify_x", (0.0, 0.0, 0.02, 0.2), (True, True, True))
    (wide,) = drag_knob(grip(regions=flat.regions), OperatorGroup((flat,), None), lobe, Pull((0.1, 1.0), (2.0, 1.0)))
    assert isinstance(wide, Operator) and math.isfinite(wide.magnitude) and wide.magnitude >= 1.0


def test_a_hand_travels_by_tenths_with_shift_and_never_jumps() -> None:
    travel = Travel((100.0, 50.0))
    assert travel.distance_to((130.0, 40.0)) == (30.0, -10.0)
    fine = travel.with_fine((130.0, 40.0), True)
    assert fine.distance_to((130.0, 40.0)) == (30.0, -10.0)
    assert fine.distance_to((140.0, 40.0)) == pytest.approx((31.0, -10.0))
    again = fine.with_fine((140.0, 40.0), False)
    assert again.distance_to((140.0, 40.0)) == pytest.approx((31.0, -10.0))
    assert again.distance_to((109.0, 50.0)) == pytest.approx((0.0, 0.0))
    assert travel.with_fine((7.0, 7.0), False) is travel
