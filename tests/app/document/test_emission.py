"""Objects that emit and reflect: their light is the sum of both, in every mode, against closed forms."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from app.project.project import open_project
from app.stills.stills import render_project
from engine.precompute.indirect.sampling_settings import BounceSeries
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, material, placed

GLOW, ALBEDO, SKY = np.array([0.3, 0.1, 0.0]), np.array([0.5, 0.5, 0.8]), 0.7
BALL = (
    camera((0, 0, 4), resolution=(24, 18))
    + environment((SKY, SKY, SKY))
    + placed("ball", "ball.ply", more=material(f'model = "lambert", albedo = {ALBEDO.tolist()}'))
    + f"emission = {GLOW.tolist()}\n"
)
HOLLOW = (
    camera((0, 0, 0.2), 60, (8, 6), (0.3, 0.1, -1))
    + placed("shell", "shell.ply", more=material('model = "lambert", albedo = [0.5, 0.5, 0.5]'))
    + "smooth = false\nemission = [1.0, 0.5, 2.0]\n"
)
QUICK = {"orbit": {"n_points": 0}, "deform": {"n_rays": 256}}


@pytest.mark.parametrize(
    ("mode", "reference"), [("placement", False), ("placement", True), ("orbit", False), ("deform", False)]
)
def test_a_glowing_ball_under_an_even_sky_shows_its_glow_and_what_it_reflects(
    tmp_path: Path, mode: str, reference: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_few_points(monkeypatch)
    # It is convex and sees nothing but the sky: L = Le + albedo · sky, everywhere.
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.ply")
    (tmp_path / "scene.toml").write_text(BALL)
    project = open_project(str(tmp_path / "scene.toml"))
    n_samples, settings = 1024 if reference else None, QUICK.get(mode, {})
    series, report = BounceSeries(1), lambda _: None
    still = render_project(
        project, report, mode=mode, reference=reference, series=series, n_samples=n_samples, **settings
    )
    picture = still.picture
    inside = (slice(6, 12), slice(9, 15))  # away from the silhouette's facets
    np.testing.assert_allclose(picture[inside], np.broadcast_to(GLOW + ALBEDO * SKY, (6, 6, 3)), rtol=0.02)


@pytest.mark.parametrize("reference", [False, True])
@pytest.mark.parametrize("n_bounces", [1, 4])
def test_within_a_glowing_shell_each_bounce_adds_its_albedos_share(
    tmp_path: Path, n_bounces: int, reference: bool
) -> None:
    # Every place sees the same radiance all around: L = Le · (1 + ρ + ρ² + ...), the furnace of a closed sphere.
    shell = trimesh.creation.icosphere(subdivisions=2)
    shell.invert()  # it emits by its front, inwards
    shell.export(tmp_path / "shell.ply")
    (tmp_path / "scene.toml").write_text(HOLLOW)
    project = open_project(str(tmp_path / "scene.toml"))
    series, n_samples, report = BounceSeries(n_bounces), 256 if reference else None, lambda _: None
    still = render_project(project, report, reference=reference, series=series, n_samples=n_samples)
    expected = np.array([1.0, 0.5, 2.0]) * sum(0.5**n for n in range(n_bounces + 1))
    picture = still.picture
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), expected, rtol=0.01)
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), rtol=0.05)
