"""The page's text from made-up measurements."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.peers import page as page_module
from benchmarks.peers.measurement import CYCLES, MITSUBA, Found, Program
from benchmarks.peers.page import losses, page, short, still
from benchmarks.peers.scenes import CASES
from benchmarks.peers.timelines import Watched

N = len(CASES[0].script.edits)
# 20 % of wrong picture for 0.01 s, then 2 %; 20 % for 0.2 s, then 8 %, and 1 % from 2 s on.
OURS = Watched(0.2, (0.02,), (0.02,), (0.01,), 0.0)
THEIRS = Watched(0.2, (0.08, 0.01), (0.4, 4.0), (0.2, 2.0), 0.03, (0.05, 1.5))
EXACT = Watched(0.2, (0.001, 0.001), (0.02, 0.03), (0.01, 0.02), 0.02, (0.04, 1.0))


def joined(text: str) -> str:
    """Without the ends of lines, which fall anywhere."""
    return " ".join(text.split())


def found(theirs: Watched = THEIRS, cycles: Program | str = "no interpreter named") -> Found:
    ours = Program("a renderer", [OURS] * N, [0.0] * 7, opening=(12.0, 9.0), selecting=(0.2, 0.5))
    peers = {MITSUBA: Program("a tracer", [theirs] * N, [0.03] * 7), CYCLES: cycles}
    return Found(CASES[0], 4, ours, peers)


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_module, "machine", lambda: "a machine")


def rows(text: str, head: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if head in line]


def test_a_page_counts_edits_with_a_lower_area() -> None:
    text = page([found()])
    assert max(len(line) for line in text.splitlines() if not line.startswith("|")) <= 120
    assert "against Mitsuba + OIDN in 25 of 25 edits by processor time (25 by seconds)." in joined(text)
    assert "short of the aim" not in text and "None: after every edit" in text
    assert rows(text, "| drag | 12 |") == [["cornell", "drag", "12", "12 (12)", "not measured"]]
    assert "Cycles + OIDN in *cornell* is **not measured**: no interpreter named." in joined(text)
    assert "350 ms (200 to 500) of processor time" in joined(text) and "0.7 s for selecting" in joined(text)
    assert text.count("not measured: ") == 0 and "9 s of processor time in *cornell*" in joined(text)


def test_flicker_is_nothing_only_where_it_is() -> None:
    ours, theirs = (
        cells for cells in rows(page([found()]), "| 20 ms") + rows(page([found()]), "| 400 ms") if len(cells) > 9
    )
    assert ours[1] == "Insitu" and ours[-2:] == ["0", "0"]
    assert theirs[1] == MITSUBA and theirs[-2:] == ["3 % (3 to 3)"] * 2
    assert still([0.0, 1e-9]) != "0"


def test_a_peer_that_ends_nearer_is_told() -> None:
    # 1 % after 2 s of processor time, ours stays at 2 %.
    assert "so often: Mitsuba + OIDN after 13 of 13 in *cornell*." in joined(page([found()]))
    worse = replace(THEIRS, errors=(0.08, 0.03))
    assert "Mitsuba + OIDN after 0 of 13" in joined(page([found(worse)]))


def test_losses_stand_there_with_reasons() -> None:
    lost = losses([found(EXACT)])
    assert len(lost) == 25 and all(loss.peer == MITSUBA for loss in lost)
    text = page([found(EXACT)])
    assert "in 0 of 25 edits by processor time, short of the aim of 90 %" in joined(text)
    assert len(rows(text, "an error of 2.0 % at the end, theirs 0.1 %")) == 25
    later = Watched(0.2, (0.02,), (0.03,), (0.02,), 0.0)
    ours = Program("a renderer", [later] * N, [0.0] * 7, opening=(1.0, 1.0))
    late = Found(CASES[0], 4, ours, {MITSUBA: Program("a tracer", [OURS] * N, [0.0] * 7), CYCLES: "-"})
    assert {loss.reason for loss in losses([late])} == {"our pictures come later"}
    still_as_before = Watched(0.2, (0.195, 0.02), (0.02, 3.0), (0.01, 1.2), 0.0)
    held = replace(late, ours=replace(ours, edits=[still_as_before] * N))
    assert {loss.reason for loss in losses([held])} == {"our picture stays as it was for 1.2 s, theirs for 10 ms"}


def test_without_a_denoiser_time_goes_by_the_square_of_the_error() -> None:
    # 5 % after 1.5 s: 2 % after 1.5 * 6.25 = 9.4 s, against our 10 ms.
    first, last = rows(page([found()]), "| 10 ms | 9.4 s |")
    assert first[0] == "cornell" and first[2] == "first" and last[2] == "last" and first[-1] == last[-1] == "938"


def test_differences_of_models_are_told() -> None:
    cycles = Program("another", [THEIRS] * N, [0.03] * 7, model_error=0.012)
    text = page([found(cycles=cycles)])
    text = joined(text)
    assert "1.2 % in *cornell*" in text and "**not measured**" not in text and "Cycles: another" in text


@pytest.mark.parametrize(("value", "text"), [(0.123, "0.12"), (9.6, "9.6"), (1234.5, "1,234")])
def test_two_figures(value: float, text: str) -> None:
    assert short(value) == text
