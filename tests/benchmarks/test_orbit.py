import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

from app.project.project import open_project
from benchmarks import orbit as measuring
from benchmarks.figures import SPECS, Figure, not_measured
from benchmarks.orbit import NAMES, TABLE, OrbitEffort, errors_by_coefficients, gpu_figure, orbit_figures
from tests.engine.realtime.conftest import BLOCK

TINY = OrbitEffort(20, 3, (20, 320), (24, 18), 2, 100, 1000)


def test_more_frames_are_better() -> None:
    assert Figure("orbit_fps_moving", (20.0,), "").met is True
    assert Figure("orbit_fps_moving", (9.0,), "").met is False


def test_errors_fall_with_coefficients_and_without_folder_none_are_told(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "block.toml").write_text(BLOCK)
    found = {(n, drawn): rmse for n, drawn, rmse, _ in
             errors_by_coefficients(open_project(str(tmp_path / "block.toml"), (24, 18)), TINY)}  # fmt: skip
    assert found[320, "rest"] < 0.1 and found[320, "rest"] <= found[20, "rest"]
    monkeypatch.setattr(measuring, "reference_folder", lambda: None)
    monkeypatch.setattr(measuring, "SCENE", str(tmp_path / "block.toml"))
    monkeypatch.setattr(measuring, "gpu_figure", lambda effort: not_measured("orbit_fps_gpu", "no graphics card"))
    figures = {figure.name: figure for figure in orbit_figures(TINY, tmp_path, lambda line: None)}
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert figures["orbit_error_teatray_320"].value is None
    assert all(figures[name].value is not None and math.isfinite(figures[name].value) for name in measuring.SPEEDS)
    with open(tmp_path / TABLE, newline="", encoding="utf-8") as file:
        assert next(csv.reader(file)) == ["scene", "coefficients", "drawn", "relRMSE", "means"]


@pytest.mark.gl
def test_what_shaders_draw_is_told_where_they_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "block.toml").write_text(BLOCK)
    monkeypatch.setattr(measuring, "SCENE", str(tmp_path / "block.toml"))
    monkeypatch.setenv("INSITU_MOVING", "shader")
    found = gpu_figure(replace(TINY, gpu_resolution=(32, 24)))
    assert len(found.samples) == TINY.n_frames and found.value is not None and found.value > 0.0
    assert found.parts["fps_80"] > 0.0 and found.parts["mb"] > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_a_quick_run_leaves_them_out(tmp_path: Path, name: str) -> None:
    assert name in [figure.name for figure in orbit_figures(None, tmp_path, lambda line: None)]
