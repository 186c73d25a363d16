"""Diagonal edits among a curve's operators."""

from __future__ import annotations

import dataclasses
from itertools import permutations

import pytest

from engine.curve.operators import Edit, Operator, TabulatedCurve, diagonal
from engine.curve.pairs import edit_at, edits_of, is_pair, move_edit

REGIONS = (0.1, 0.2, 0.3, 0.4)
PAIR = diagonal(REGIONS, 0.02, 0.5)
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
    slack = Operator("translate", "x", *REGIONS, magnitude=0.049)
    # Monotone up to half the width of the falloff, 0.05 [BenArtzi07, eq. 9.3].
    assert not slack.at_limit
    assert dataclasses.replace(slack, magnitude=0.3).clamp_magnitude().at_limit
    assert not Operator("translate", "y", *REGIONS, magnitude=1e6).at_limit
