"""How far the solver is, and what its kinds of work cost."""

import time
from collections.abc import Generator
from itertools import pairwise

import pytest

from engine.core.generators import run_to_end
from engine.precompute.indirect import progress
from engine.precompute.indirect.progress import Progress, Span, Stopwatch, at_fraction, extra_sets_span


def test_phases_follow_each_other_from_nothing_to_almost_all() -> None:
    phases = [progress.FIRST_PASS, progress.ROUGH_LIGHT, *progress.REFINEMENTS, extra_sets_span(0.5)]
    assert phases[0].begin == 0.0 and all(one.end == two.begin for one, two in pairwise(phases))
    assert phases[-1].end < progress.LIGHT_DONE < progress.PHOTONS_DONE < 1.0


def test_a_span_is_entered_and_left_at_its_ends() -> None:
    assert [Span(0.25, 0.75).at(fraction) for fraction in (0.0, 0.5, 1.0)] == [0.25, 0.5, 0.75]


def test_more_extra_sets_take_more_of_what_is_left_and_never_all() -> None:
    ends = [extra_sets_span(times).end for times in (0.0, 0.1, 1.0, 3.0, 1e6)]
    assert ends == sorted(ends) and ends[0] == progress.REFINED and ends[-1] < progress.LIGHT_DONE
    # As many extra sets as first ones take as long as all passes, 0.5 of the whole, beside 0.18 that are left.
    assert extra_sets_span(1.0).end == pytest.approx(0.75 + 0.18 * 0.5 / (0.5 + 0.18))


def test_steps_of_a_part_stand_at_its_fraction() -> None:
    def steps() -> Generator[None, None, str]:
        yield None
        yield None
        return "done"

    seen = list[Progress]()
    assert run_to_end(at_fraction(steps(), 0.4, "working"), seen.append) == "done"
    assert seen == [(0.4, "working")] * 2


def test_a_stopwatch_counts_its_own_work_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(time, "process_time", lambda: clock[0])

    def work(seconds: float) -> str:
        clock[0] += seconds
        return "done"

    def steps() -> Generator[Progress, None, str]:
        for _ in range(3):
            work(1.0)
            yield 0.0, ""
        work(0.5)
        return "done"

    watch = Stopwatch()
    assert watch.time("rays", work, 2.0) == "done"
    assert run_to_end(watch.steps("light", steps()), lambda step: work(10.0)) == "done"
    watch.time("rays", work, 1.0)
    assert watch.seconds == {"rays": 3.0, "light": 3.5}


def test_a_stopwatch_counts_what_failed() -> None:
    def fails() -> Generator[Progress, None, None]:
        yield 0.0, ""
        raise KeyError

    watch = Stopwatch()
    with pytest.raises(KeyError):
        run_to_end(watch.steps("light", fails()))
    assert set(watch.seconds) == {"light"}
