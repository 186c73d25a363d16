"""Long computations are generators: each step yields how far it is, the end returns the result. How they are driven."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Generic, TypeVar

Step = TypeVar("Step")
StepValue = TypeVar("StepValue")
Result = TypeVar("Result")


def run_to_end(steps: Generator[Step, None, Result], report: Callable[[Step], object] = lambda step: None) -> Result:
    """Drive a computation to its end, telling `report` of every step; what it returns."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        report(step)


class StepRunner(Generic[Result]):
    """A computation advanced a step at a time, between other work; `result` once `advance` says that it ended."""

    result: Result

    def __init__(self, steps: Generator[object, None, Result]) -> None:
        self._steps = steps

    def advance(self) -> bool:
        """One step; whether that was the end."""
        try:
            next(self._steps)
        except StopIteration as end:
            self.result = end.value
            return True
        return False


def map_steps(
    steps: Generator[Step, None, Result], word: Callable[[Step], StepValue]
) -> Generator[StepValue, None, Result]:
    """The same computation, each of its steps told in the caller's words."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        yield word(step)
