"""The figures of a turned sky, of a small scene."""

import math
from pathlib import Path

import pytest

from benchmarks.figures import SPECS
from benchmarks.relighting import NAMES, RelightEffort, relight_figures
from tests.app.worker.test_relighting import SCENE, skylight
from tests.pictures import write_exr


def test_a_turned_sky_is_near_its_own_transport_at_every_angle(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", skylight())
    (tmp_path / "scene.toml").write_text(SCENE)
    effort = RelightEffort((32, 24), (5.0, 77.0), 2, 240)
    figures = {each.name: each for each in relight_figures(effort, lambda line: None, str(tmp_path / "scene.toml"))}
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert 0.0 < figures["turn_error"].parts["5"] < figures["turn_error"].parts["77"] < 0.1
    assert all(math.isfinite(each.value or math.nan) for each in figures.values())
    assert figures["relight_rows_s"].parts["mb"] > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_a_quick_run_leaves_them_out(name: str) -> None:
    assert name in [figure.name for figure in relight_figures(None, lambda line: None)]
