"""The table of what the plan saves: both ways are drawn, and what they differ by is that of the pictures."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.measure import savings
from app.measure.savings import SavingRow, difference, measure_savings, table
from engine.indirect.series import BounceSeries
from engine.render import light_pilot
from engine.transport.pipeline import Placement
from tests.scene_text import ground


def test_a_scene_is_drawn_in_both_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_pilot, "PAYS_FROM", 1)
    asked: list[int] = []

    def nothing(placement: Placement, layers: object, sky: object, series: BounceSeries, fineness: object) -> Any:
        asked.append(series.n_bounces)
        return np.zeros((len(placement.hits.pixel), 3))
        yield

    monkeypatch.setattr(savings, "indirect_radiance", nothing)
    (tmp_path / "even.toml").write_text(ground((48, 36)))
    told: list[str] = []
    (row,) = measure_savings([str(tmp_path / "even.toml")], tmp_path, told.append)
    assert row.points >= 48 * 36 // 2 and row.lights < 4000 and row.patches == 0 and not row.keeps_sphere
    assert 0.0 < row.difference < 0.005 and row.planned_seconds > 0.0
    # A floor alone lights nothing else: four bounces are found with everything on, and where kernels are read.
    assert row.bounces == 1 and row.planned_indirect == 0.0 and asked == [4, 4]
    written = (tmp_path / "savings.csv").read_text().splitlines()
    assert written[0].startswith("scene,points") and written[1].startswith("even,") and len(told) == 1
    *_, line = table([row])
    assert "*even*" in line and "the lights' alone" in line


def test_a_difference_is_of_the_clamped_pictures() -> None:
    truth = np.ones((100, 100, 3))
    picture = truth + 0.1
    picture[0, 0] = truth[0, 0] = 1e6  # one in ten thousand: beyond the percentile in both
    assert difference(picture, truth) == pytest.approx(0.0)  # above the truth's brightest is as bright as that
    assert difference(truth - 0.1, truth) == pytest.approx(0.1, rel=1e-3)


def test_the_share_of_the_time_is_told() -> None:
    row = SavingRow("a", 1, 500, 0, False, 16, 2, 8.0, 2.0, 12.0, 3.0, 0.001)
    assert row.saved == pytest.approx(0.75)  # 5 of 20 s
