"""A mix of lights beside LuxCore's light groups: our part, and what LuxCore would get."""

from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from benchmarks.figures import NotMeasured
from benchmarks.light_groups import CSV, LIGHTS, VARIABLE, measure_luxcore, measure_ours, scene_arrays, write_rows
from benchmarks.light_mix import N_LAMPS, scene_text


@pytest.mark.gl
def test_each_light_has_a_row(tmp_path: Path) -> None:
    rows = measure_ours(tmp_path, (24, 18), 200)
    assert [row.light for row in rows] == list(LIGHTS) and all(0.0 < row.error < 0.05 for row in rows)
    write_rows(tmp_path / CSV, rows)
    lines = (tmp_path / CSV).read_text().splitlines()
    assert lines[0] == "program,light,ready_s,change_ms,error" and len(lines) == 1 + len(LIGHTS)


def test_luxcore_is_left_out_where_it_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(NotMeasured, match=VARIABLE):
        measure_luxcore(tmp_path, 1.0)
    monkeypatch.setenv(VARIABLE, str(tmp_path / "python"))
    with pytest.raises(NotMeasured, match="No such file"):
        measure_luxcore(tmp_path, 1.0, (8, 6))


def test_it_gets_the_scene(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(scene_text())
    arrays = scene_arrays(open_project(str(tmp_path / "scene.toml"), (8, 6)))
    n_objects = 3 + N_LAMPS
    assert sum(arrays[f"emission_{i}"].any() for i in range(n_objects)) == N_LAMPS
    assert f"vertices_{n_objects}" not in arrays and arrays["camera"].shape == (3, 3)
    # Table, diffuse ball, and one of metal: in red (0.7996² + 3.9129²) / (1.2004² + 3.9129²) = 0.952 straight on.
    np.testing.assert_allclose([arrays["albedo_0"], arrays["albedo_1"]], 0.5)
    np.testing.assert_allclose(arrays["albedo_2"], (0.952, 0.620, 0.511), atol=1e-3)
    assert [float(arrays[f"alpha_{i}"]) for i in range(3)] == [0.0, 0.0, 0.2]
    for i in range(n_objects):
        assert arrays[f"triangles_{i}"].max() == len(arrays[f"vertices_{i}"]) - 1
    # The ball about (-0.5, 0.4, 0), of diameter 0.8.
    np.testing.assert_allclose(np.linalg.norm(arrays["vertices_1"] - (-0.5, 0.4, 0.0), axis=1), 0.4, rtol=1e-3)
