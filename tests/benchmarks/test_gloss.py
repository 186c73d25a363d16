"""What the storeroom's balls mirror, against paths: in direct light, and fresh ones with all of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.stills.stills import render_picture
from benchmarks.gloss import BALLS, NAMES, GlossEffort, ball_in_view, error_on_ball, gloss_figures
from engine.light.radiance_files import read_radiance_image
from engine.precompute.indirect.sampling_settings import BounceSeries

JUDGES = Path(__file__).resolve().parents[1] / "golden" / "rooms"
# Of the mean, to which a lamp's image is three hundred times as bright: that is off by less than a hundredth. The
# judges' noise, 0.01 and 0.02 of their pictures, is part of it.
LIMITS = {("mirror ball", 1): 0.04, ("mirror ball", 2): 0.04, ("gold ball", 1): 0.01, ("gold ball", 2): 0.055}


def test_a_quick_run_leaves_them_out() -> None:
    figures = gloss_figures(None, lambda line: None)
    assert [figure.name for figure in figures] == list(NAMES.values())
    assert all(figure.value is None for figure in figures)


@pytest.mark.parametrize("ball", BALLS)
@pytest.mark.parametrize("n_bounces", [1, pytest.param(2, marks=pytest.mark.sweep)])
def test_what_a_ball_mirrors_is_what_paths_find(ball: str, n_bounces: int) -> None:
    truth = read_radiance_image(JUDGES / f"{ball.replace(' ', '_')}_{n_bounces}.exr")
    project = ball_in_view(ball)
    ours = render_picture(project, lambda _: None, series=BounceSeries(n_bounces))
    found = error_on_ball(ball, project, ours, truth)
    assert found.rmse < LIMITS[ball, n_bounces] and abs(found.mean) < 0.01, found


@pytest.mark.sweep
def test_balls_against_fresh_paths() -> None:
    figures = gloss_figures(GlossEffort(), lambda line: None)
    assert all(figure.value is not None and figure.value < 0.09 for figure in figures), figures
