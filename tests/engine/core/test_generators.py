"""Driving generators: to the end, a step at a time, and in other words."""

from collections.abc import Generator

import pytest

from engine.core.generators import StepRunner, map_steps, run_to_end


def _sum_of(numbers: list[int]) -> Generator[float, None, int]:
    """The sum; before each number yields the share that is done."""
    total = 0
    for place, number in enumerate(numbers):
        yield place / len(numbers)
        total += number
    return total


def test_a_computation_is_driven_to_its_end() -> None:
    told: list[float] = []
    assert run_to_end(_sum_of([3, 4]), told.append) == 7
    assert told == [0.0, 0.5]


def test_a_computation_is_advanced_step_by_step() -> None:
    steps = StepRunner(_sum_of([3, 4]))
    assert [steps.advance() for _ in range(3)] == [False, False, True]  # two shares, then the end
    assert steps.result == 7


def test_steps_are_renamed() -> None:
    told = map_steps(_sum_of([3, 4]), lambda share: f"{share:.0%}")
    assert [next(told), next(told)] == ["0%", "50%"]
    with pytest.raises(StopIteration) as end:
        next(told)
    assert end.value.value == 7
