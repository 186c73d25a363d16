"""Sharper gloss than any of the scenes has, and brushed one, under a lamp close by: against paths."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from app.stills.stills import render_project
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.picture_difference import errors
from engine.render.picture_error import POOR
from tests.scene_text import LEANING_LAMP, camera, material, placed


def scene(layer: str) -> str:
    """A ball of this layer, and the lamp that it mirrors."""
    ball = placed("ball", "sphere", more=material(layer))
    return camera((0.0, 0.3, 3.0), 26, (24, 24)) + ball + LEANING_LAMP


@pytest.mark.parametrize(
    ("layer", "limit", "n_paths"),
    [
        ('model = "rough_conductor", alpha = 0.02', 0.03, 2048),  # paths alone are 1.5 % off
        # A streak narrower than the bands across it: its light is there, smeared.
        ('model = "ward_anisotropic", alpha_u = 0.3, alpha_v = 0.04', 0.5, 512),
    ],
)
def test_a_lamp_is_mirrored_as_paths_find_it_or_it_is_said(
    tmp_path: Path, layer: str, limit: float, n_paths: int
) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(scene(layer))
    project, series = open_project(str(file)), BounceSeries(1)
    still = render_project(project, lambda _: None, series=series, estimates_error=True)
    truth = render_project(project, lambda _: None, reference=True, series=series, n_samples=n_paths).picture
    seen = Placement(project.scene).hits.pixel
    found = errors(*(picture.reshape(-1, 3)[seen] for picture in (still.picture, truth)))
    assert np.isfinite(still.picture).all() and found.rmse < limit and abs(found.mean) < 0.08, found
    assert still.error is not None and still.error.is_large == (found.rmse > POOR)
