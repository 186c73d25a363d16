"""The solver's phases as fractions of the processor time of the whole, and the processor time of each kind of work."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Generator
from typing import NamedTuple, TypeVar

from engine.core.generators import Result, map_steps

Value = TypeVar("Value")
Progress = tuple[float, str]


class Span(NamedTuple):
    """The fractions of the whole at which a phase begins and ends."""

    begin: float
    end: float

    def at(self, fraction: float) -> float:
        """The fraction of the whole when this fraction of the phase is done."""
        return self.begin + (self.end - self.begin) * fraction


# First pass; rough light between the records it found (only where refinement follows); refinement passes; final light
# between all records; caustics. The filter takes the rest.
FIRST_PASS, ROUGH_LIGHT = Span(0.0, 0.1), Span(0.1, 0.35)
REFINEMENTS = Span(0.35, 0.45), Span(0.45, 0.6), Span(0.6, 0.75)
REFINED = REFINEMENTS[-1].end
LIGHT_DONE, PHOTONS_DONE = 0.93, 0.96
# Extra sample sets share the span up to `LIGHT_DONE`; as many extra sets as first sets take as long as all passes.
_ALL_PASSES = FIRST_PASS.end + REFINED - REFINEMENTS[0].begin


def extra_sets_span(times: float) -> Span:
    """The span of extra sample sets, `times` as many as first sets."""
    work, left = times * _ALL_PASSES, LIGHT_DONE - REFINED
    return Span(REFINED, REFINED + left * work / (work + left))


def at_fraction(
    steps: Generator[object, None, Result], fraction: float, text: str
) -> Generator[Progress, None, Result]:
    """The same steps, each of which yields the fraction of the whole."""
    return map_steps(steps, lambda step: (fraction, text))


class Stopwatch:
    """Adds up the processor seconds of each kind of work; time between the steps of a generator does not count."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)

    def time(self, kind: str, work: Callable[..., Value], *arguments: object) -> Value:
        """The result of `work` with these arguments."""
        started = time.process_time()
        try:
            return work(*arguments)
        finally:
            self.seconds[kind] += time.process_time() - started

    def steps(self, kind: str, steps: Generator[Progress, None, Value]) -> Generator[Progress, None, Value]:
        """The same steps."""
        while True:
            started = time.process_time()
            try:
                step = next(steps)
            except StopIteration as end:
                return end.value
            finally:
                self.seconds[kind] += time.process_time() - started
            yield step
