"""The table of what the plan saves: both ways are drawn, and held against the same truth."""

from pathlib import Path

import pytest

from benchmarks import plan_savings
from benchmarks.plan_savings import SavingRow, measure_savings, table
from engine.render import light_pilot
from tests.quick_indirect import QUICK
from tests.scene_text import ground


def test_a_scene_is_drawn_in_both_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_pilot, "PAYS_FROM", 1)
    monkeypatch.setattr(plan_savings, "FINE", QUICK)
    monkeypatch.setattr(plan_savings, "KERNEL_PIXELS", 48)
    monkeypatch.setattr(plan_savings, "N_POINTS", 256)
    monkeypatch.setattr(plan_savings, "N_PATHS", 1 << 14)
    (tmp_path / "even.toml").write_text(ground((48, 36)))
    told: list[str] = []
    (row,) = measure_savings([str(tmp_path / "even.toml")], tmp_path, told.append)
    assert row.points >= 48 * 36 // 2 and row.lights < 4000 and row.patches == 0 and not row.keeps_sphere
    # A floor alone lights nothing else: nothing is found of further bounces but with everything on.
    assert (row.bounces, row.n_rays, row.planned_indirect) == (1, 0, 0.0) and row.everything_indirect > 0.0
    assert 0.0 < row.everything_error < 0.02 and 0.0 < row.planned_error < row.everything_error + 0.005
    written = (tmp_path / "savings.csv").read_text().splitlines()
    assert written[0].startswith("scene,points") and written[1].startswith("even,") and len(told) == 1
    *_, line = table([row])
    assert "*even*" in line and "the lights' alone" in line


def test_the_share_of_the_time_is_told() -> None:
    row = SavingRow("a", 1, 500, 0, False, 16, 2, 128, 8.0, 2.0, 12.0, 3.0, 0.01, 0.012)
    assert row.saved == pytest.approx(0.75)  # 5 of 20 s
