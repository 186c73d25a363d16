"""Each extreme is held by tests that are there, or stands in `extremes.toml` with a sentence why not."""

import ast
import functools
import re
import tomllib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT.parent / "shared" / "EXTREMES.md"
ROWS: dict[str, dict[str, list[str] | str]] = tomllib.loads((ROOT / "tests" / "extremes.toml").read_text("utf-8"))
OF_ALL = ".all"  # what a section says of its rows is no row itself


@functools.cache
def names_in(file: str) -> frozenset[str]:
    """The tests in a file."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef))


def rows_of(text: str) -> list[str]:
    """The rows of a list in Markdown as section, heading and number: numbered lines, bullets, and tables' rows."""
    rows: list[str] = []
    section, heading, number = "", "", 0
    for line in text.splitlines():
        if found := re.match(r"## (\d+)\.", line):
            section, heading, number = found[1], "", 0
        elif found := re.match(r"\*\*([^*]+)\*\*$", line):
            heading, number = f"{found[1]}.", 0
        elif line.startswith("|--"):
            number = 0  # the line before named the columns
            rows.pop()
        elif section and re.match(r"\d+\. |- |\| ", line):
            number += 1
            rows.append(f"{section}.{heading}{number}")
    return rows


@pytest.mark.parametrize("row", ROWS)
def test_each_claim_has_tests_that_are_there_or_says_why_not(row: str) -> None:
    assert ROWS[row], "a row without a claim"
    for claim, held_by in ROWS[row].items():
        if isinstance(held_by, str):
            assert re.fullmatch(r"[A-Z].{20,}\.", held_by), f"{claim}: expected a sentence"
            continue
        assert held_by, claim
        for test in held_by:
            file, _, name = test.partition("::")
            assert name.startswith("test_") and name in names_in(file), f"{claim}: there is no {test}"


def test_rows_are_told_apart() -> None:
    text = (
        "## 0. A\n1. x\n   more\n2. y\n## 1. B\n**C d**\n- x\n**E**\n- x\n- y\n## 2. F\n| a | b |\n|--|--|\n| x | y |\n"
    )
    assert rows_of(text) == ["0.1", "0.2", "1.C d.1", "1.E.1", "1.E.2", "2.1"]


def test_no_row_of_the_list_is_missing() -> None:
    if not LIST.is_file():
        pytest.skip(f"{LIST} is not there: the list that these rows are of")
    expected = rows_of(LIST.read_text(encoding="utf-8"))
    assert Counter(row for row in ROWS if not row.endswith(OF_ALL)) == Counter(expected)
