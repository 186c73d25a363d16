"""Drives long computations, which are generators: each step yields the progress, and the end returns the result."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Generic, TypeVar

Step = TypeVar("Step")
StepValue = TypeVar("StepValue")
Result = TypeVar("Result")


@dataclass(frozen=True)
class StillProgress:
    """Progress of a picture, in [0, 1], and the current step; noise: its relative RMS error, if known."""

    fraction: float
    text: str
    noise: float | None = None


def run_to_end(steps: Generator[Step, None, Result], report: Callable[[Step], object] = lambda step: None) -> Result:
    """Drives a computation to its end, passing every step to `report`; returns its result."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        report(step)


class StepRunner(Generic[Result]):
    """Advances a computation one step at a time, between other work; `result` exists once `advance` returns True."""

    result: Result

    def __init__(self, steps: Generator[object, None, Result]) -> None:
        self._steps = steps

    def advance(self) -> bool:
        """Runs one step; returns whether the computation has ended."""
        try:
            next(self._steps)
        except StopIteration as end:
            self.result = end.value
            return True
        return False


def map_steps(
    steps: Generator[Step, None, Result], word: Callable[[Step], StepValue]
) -> Generator[StepValue, None, Result]:
    """The same computation with each of its steps mapped by the caller."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        yield word(step)
