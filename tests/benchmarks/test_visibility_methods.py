"""The visibility study: one row a method, size and scene, and files that read back."""

import csv
from pathlib import Path

import pytest

from benchmarks.visibility_methods import (
    FILE,
    METHODS,
    PLOT,
    TABLES,
    Size,
    VisibilityEffort,
    VisibilityRow,
    visibility_rows,
    visibility_tables,
    write_visibility,
)


@pytest.fixture(scope="module")
def rows() -> list[VisibilityRow]:
    effort = VisibilityEffort((Size(33, 50, 2), Size(9, 1280)), {"shapes": "shapes"})
    return visibility_rows(effort, lambda _: None)


def test_every_method_is_measured_in_every_size(rows: list[VisibilityRow]) -> None:
    assert [(row.directions, row.method) for row in rows] == [(n, method) for n in (50, 1280) for method in METHODS]
    for row in rows:
        assert row.wrong <= 0.05 and row.rays <= 1.0 and row.least <= row.seconds <= row.most
        assert 0.0 < row.ray_seconds and row.n_rays > 0
    for truth in (rows[0], rows[len(METHODS)]):
        assert (truth.method, truth.rays, truth.wrong) == ("TRUE", 1.0, 0.0)
    assert min(row.rays for row in rows if row.method == "ours") < 0.6


def test_the_files_read_back(rows: list[VisibilityRow], tmp_path: Path) -> None:
    write_visibility(tmp_path, rows)
    with open(tmp_path / FILE, newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["method"] for line in lines] == [row.method for row in rows]
    assert [float(line["rays"]) for line in lines] == pytest.approx([row.rays for row in rows], rel=1e-5)
    assert (tmp_path / PLOT).read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / TABLES).read_text(encoding="utf-8") == visibility_tables(rows)


def test_tables_have_a_line_a_method_and_the_thesis_beside_ours() -> None:
    scenes = ("shapes", "bunny", "plant", "dominoes")
    rows = [VisibilityRow(s, 513, 398, m, 0.25, 0.0, 2.0, 2.0, 2.0, 1.0, 10) for s in scenes for m in METHODS]
    text = visibility_tables(rows)
    assert "| OPT | 25.0 (4.3) | 25.0 (3.9) | 25.0 (20.2) | 25.0 (8.8) |" in text
    assert "| GNU | 2.00 s, 1.0 × (6.7) |" in text
    assert text.count("| OPT | 25.0 / 0 |") == len(scenes)
