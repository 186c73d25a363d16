"""Figures: how samples combine, how limits compare, what stands in the file."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from benchmarks.figures import SPECS, Figure, not_measured, summary_lines, write_figures

BENCHMARKS = (Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md").read_text(encoding="utf-8")


def test_the_page_of_benchmarks_promises_what_figures_are_held_against() -> None:
    rows = [line.strip("| ").split(" | ") for line in BENCHMARKS.splitlines() if line.startswith("| ")]
    named = 0
    for what, _, aim in (row for row in rows if len(row) == 3):
        aims = {float(number) / (100 if unit else 1) for number, unit in re.findall(r"≤ ([\d.]+)( %)?", aim)}
        for pattern in re.findall(r"`([a-z]\w*\*?)`", what):
            name_of = re.compile(pattern.replace("*", "[a-z]+"))
            limits = [SPECS[name].limit for name in SPECS if name_of.fullmatch(name)]
            assert limits and set(limits) <= aims, what
            named += len(limits)
    assert named >= 16


def test_a_typical_figure_is_the_median_and_one_that_holds_always_the_worst() -> None:
    assert Figure("edit_ms_30", (10.0, 50.0, 12.0), "").value == 12.0
    assert Figure("window_s", (1.0, 1.6, 1.1), "").value == 1.6


@pytest.mark.parametrize(
    ("samples", "met"),
    [
        ((33.0,), True),  # at most the limit: the limit itself is met
        ((33.1,), False),
        ((1.0, 33.0, 90.0), True),  # the median counts
        ((), None),  # nothing was measured
    ],
)
def test_limits_are_compared_with_the_value(samples: tuple[float, ...], met: bool | None) -> None:
    assert Figure("edit_ms_30", samples, "").met is met


def test_a_figure_without_a_promise_is_neither_met_nor_missed() -> None:
    assert SPECS["brute_force_s"].limit is None
    assert Figure("brute_force_s", (3.0,), "").met is None


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(number: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        Figure("edit_ms_30", (number,), "")


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(ValueError, match="edit_ms_31"):
        Figure("edit_ms_31", (1.0,), "")


def test_the_file_holds_value_limit_verdict_spread_unit_and_how(tmp_path: Path) -> None:
    figures = [Figure("exact_ms", (200.0, 400.0, 310.0), "by hand", {"n": 3}), not_measured("window_s", "no display")]
    write_figures(tmp_path / "figures.json", figures, {"machine": {"cores": 2}})
    content = json.loads((tmp_path / "figures.json").read_text())
    # The median of 200, 310 and 400 is 310, above the limit of 300.
    assert content["exact_ms"] == {
        "value": 310.0,
        "limit": 300.0,
        "met": False,
        "unit": "ms",
        "spread": {"min": 200.0, "median": 310.0, "max": 400.0},
        "repetitions": 3,
        "how": "by hand",
        "parts": {"n": 3},
    }
    assert content["window_s"]["value"] is None and content["window_s"]["met"] is None
    assert "no display" in content["window_s"]["how"]
    assert content["machine"] == {"cores": 2}


def test_the_summary_says_which_limits_are_kept() -> None:
    lines = summary_lines(
        [Figure("exact_ms", (400.0,), ""), Figure("edit_ms_30", (9.0,), ""), not_measured("window_s", "no display")]
    )
    assert "NOT met" in lines[0]
    assert lines[1].endswith(" met") and "NOT" not in lines[1]
    assert "no display" in lines[2]
