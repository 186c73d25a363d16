"""`insitu render --mode orbit`: whole pictures against brute force."""

from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from app.stills import stills
from app.stills.stills import render_project
from engine.core.generators import run_to_end
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.stills import render_orbit
from tests.app.files.test_brdf_files import insitu
from tests.engine.realtime.conftest import SCENE
from tests.few_points import use_few_points
from tests.pictures import write_exr
from tests.scene_text import camera, environment, placed


def off(found: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """relRMSE and the difference of means, both of light clamped at the truth's 99.9 percentile."""
    top = np.percentile(truth, 99.9)
    a, b = np.minimum(found, top), np.minimum(truth, top)
    return float(np.sqrt(((a - b) ** 2).mean()) / b.mean()), float(a.mean() / b.mean() - 1)


def inner(placement: Placement) -> np.ndarray:
    """Pixels whose neighbours show the same object, and one that reflects."""
    ids = placement.hits.object_image
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (1, -1):
            same &= np.roll(ids, step, axis) == ids
    same.ravel()[np.setdiff1d(np.arange(ids.size), placement.hits.pixel)] = False
    return same


@pytest.mark.parametrize(("name", "points", "most"), [("cornell", 12_000, 0.06), ("ball", 1_000, 0.01)])
def test_a_still_of_orbit_is_the_brute_force_picture(
    name: str, points: int, most: float, tmp_path: Path, monkeypatch
) -> None:
    # A lamp near by over walls of two triangles, and a metal ball under a sky.
    if name == "ball":  # under an even sky, of which a quarter of the directions are enough
        monkeypatch.setattr(stills, "REFERENCE_LEVEL", stills.REFERENCE_LEVEL - 1)
        (tmp_path / "ball.toml").write_text(SCENE)
    project = open_project(str(tmp_path / "ball.toml") if name == "ball" else name, (24, 18))
    truth = render_project(project, lambda _: None, reference=True, series=BounceSeries(1)).picture
    layers_of: dict[int, list[Layer]] = {}
    for i_object, layer in project.indexed_layers:
        layers_of.setdefault(i_object, []).append(layer)
    placement = Placement(project.scene)
    found = run_to_end(render_orbit(placement, layers_of, project.sky, 256, n_points=points), lambda _: None)
    assert found.shape == (18, 24, 3) and np.isfinite(found).all()
    where = inner(placement)
    error, difference = off(found[where] * project.document.light.intensity, truth[where])
    assert error < most and abs(difference) < 0.015


def test_diffuse_objects_are_as_bright_as_in_placement(tmp_path: Path, monkeypatch) -> None:
    # On the mean of each object, by the same camera, under a sky that is dark on one side.
    use_few_points(monkeypatch, 2000)
    image = np.full((16, 32, 3), 0.1, np.float32)
    image[2:7, 5:12] = (8.0, 6.0, 4.0)
    write_exr(tmp_path / "sky.exr", image)
    diffuse = SCENE.replace('"rough_conductor", alpha = 0.3', '"lambert"')
    (tmp_path / "ball.toml").write_text(diffuse.replace(environment(), environment(file="sky.exr")))
    project = open_project(str(tmp_path / "ball.toml"), (48, 36))
    series, placement = BounceSeries(1), Placement(project.scene)
    orbit = render_project(project, lambda _: None, mode="orbit", series=series).picture
    still = render_project(project, lambda _: None, n_lights=1000, series=series).picture
    for i_object in range(2):
        where = inner(placement) & (placement.hits.object_image == i_object)
        assert where.sum() > 50
        np.testing.assert_allclose(orbit[where].mean(axis=0), still[where].mean(axis=0), rtol=0.01)


def test_the_command_writes_it(tmp_path, capsys, monkeypatch) -> None:
    use_few_points(monkeypatch, 500)
    out = tmp_path / "orbit.png"
    assert insitu("render", "cornell", "-o", out, "--mode", "orbit", "--resolution", 24, 24) == 0
    assert out.stat().st_size > 500
    capsys.readouterr()
    assert insitu("render", "cornell", "-o", out, "--mode", "orbit", "--reference") != 0
    assert "--mode orbit --reference" in capsys.readouterr().err


def test_lamps_alone_are_drawn(tmp_path: Path) -> None:
    """There is no point to be lit."""
    lamp = camera((0, 0, 3)) + placed("lamp", "quad", more="emission = [1, 2, 3]\n")
    (tmp_path / "lamp.toml").write_text(lamp)
    found = render_project(open_project(str(tmp_path / "lamp.toml"), (8, 6)), lambda _: None, mode="orbit").picture
    np.testing.assert_array_equal(found[3, 4], [1.0, 2.0, 3.0])
