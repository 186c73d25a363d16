"""Diagonal edits among the operators of a curve: a Y- and an X-operator that are created and moved together.

The Y-operator carries the mark (`Operator.joined`), and the X-operator is right above it. Two operators that merely
have equal parameters are no pair. An *edit* is one entry of the user's list: such a pair, or any other single operator.
"""

from __future__ import annotations

from collections.abc import Sequence

from engine.curve.operators import Edit, Operator


def is_pair(operators: Sequence[Edit], index: int) -> bool:
    """Whether the operators at `index` and above it are Y and X of one diagonal edit."""
    if not 0 <= index < len(operators) - 1:
        return False
    low, high = operators[index], operators[index + 1]
    if not isinstance(low, Operator) or not isinstance(high, Operator) or not low.joined:
        return False
    alike = (low.kind, low.regions, low.channels) == (high.kind, high.regions, high.channels)
    return alike and (low.axis, high.axis) == ("y", "x")


def edits_of(operators: Sequence[Edit]) -> list[range]:
    """The index range of each edit, from the lowest up."""
    spans: list[range] = []
    while (start := spans[-1].stop if spans else 0) < len(operators):
        spans.append(range(start, start + (2 if is_pair(operators, start) else 1)))
    return spans


def edit_at(operators: Sequence[Edit], index: int) -> range:
    """The index range of the edit that the operator at `index` belongs to; raises IndexError if there is none."""
    return next(span for span in edits_of(operators) if range(len(operators))[index] in span)


def move_edit(operators: Sequence[Edit], index: int, to: int) -> tuple[Edit, ...]:
    """The operators with the edit at `index` moved to the place of the edit at `to`; pairs remain adjacent."""
    edits = [tuple(operators[k] for k in span) for span in edits_of(operators)]
    places = edits_of(operators)
    target = places.index(edit_at(operators, to))
    edits.insert(target, edits.pop(places.index(edit_at(operators, index))))
    return tuple(operator for edit in edits for operator in edit)
