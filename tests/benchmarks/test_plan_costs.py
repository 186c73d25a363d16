"""What scenes were planned to cost, and what they did."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.cli.precompute import ActualCost
from benchmarks import plan_costs
from tests.scene_text import ground


def test_the_table_of_plans_says_what_was_planned_and_what_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_costs, "carry_out", lambda words: ActualCost(4.0, 400.0, 0.5, 40.0))
    (tmp_path / "scene.toml").write_text(ground((40, 30)))
    told: list[str] = []
    effort = plan_costs.PlanEffort((str(tmp_path / "scene.toml"),), ((200, (24, 16), 1),))
    rows = plan_costs.measure_plans(effort, tmp_path, told.append)
    written = (tmp_path / "planning.csv").read_text().splitlines()
    assert [row.triangles for row in rows] == [2, 200 + 16_128] and len(written) == 3 and len(told) == 2
    first = rows[0]
    assert first.errors[1] == pytest.approx(first.planned_memory_mib / 400.0 - 1.0)
