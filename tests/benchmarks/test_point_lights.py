from pathlib import Path

import numpy as np

from app.project.project import open_project
from app.stills.stills import layers_by_object
from benchmarks.point_lights import CSV, as_points, figure, measure, write_rows
from engine.light.environment import triangle_integrals
from engine.precompute.direct.pipeline import Placement
from engine.reference.integrator import integrate_direct
from engine.sphere.geodesic import geodesic
from tests.engine.realtime.conftest import SCENE


def test_as_many_points_as_there_are_directions_are_the_reference(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(SCENE)
    project = open_project(str(tmp_path / "ball.toml"), (16, 12))
    placement, layers, sky = Placement(project.scene), layers_by_object(project), project.sky
    assert sky.environment is not None
    rows = np.arange(0, len(placement.hits.pixel), 11)
    # A cut into all triangles of level 2, of which the reference has the true centres.
    found = as_points(placement, rows, layers, sky, 320)
    level = 2
    expected = integrate_direct(
        placement.hits, rows, placement.caster, lambda i: layers.get(i, ()), sky.environment, sky.rotation, None, level
    )
    assert len(triangle_integrals(sky.environment, sky.rotation, level)) == 320 == len(geodesic(level).centres)
    assert np.sqrt(np.mean((found - sky.scale * expected) ** 2)) < 0.3 * expected.mean()


def test_few_triangles_beat_as_many_points_and_both_converge(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(SCENE)
    rows = list(measure({"ball": ()}, 24, 60, (80, 2000), 5, str(tmp_path / "ball.toml")))
    found = {(each.lights, each.n): each.rmse for each in rows}
    assert found["triangles", 80] < found["points", 80]
    assert found["points", 2000] < 0.5 * found["points", 80] and found["triangles", 2000] < 0.03
    write_rows(tmp_path / CSV, rows)
    assert (tmp_path / CSV).read_text().splitlines()[0] == "scene,lights as,lights,relRMSE"


def test_the_figure_has_points_above_triangles(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(SCENE)
    sheet = np.asarray(figure(16, (20, 80), str(tmp_path / "ball.toml")))
    assert sheet.shape == (58, 38, 3)
    assert np.abs(sheet[20:36, :16].astype(int) - sheet[42:58, :16]).max() > 0
