"""Planned bounces: closed forms for a hollow ball, a single object, and two walls."""

from pathlib import Path

import numpy as np
import pytest

from engine.material import MODELS, validate_parameters
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement
from engine.render.bounce_plan import (
    MOST_PLANNED,
    carried_light,
    missing_light,
    planned_bounces,
    required_bounces,
    shares_of,
)
from engine.scene.scene_loader import load_scene
from tests.scene_text import LAMBERT, camera, environment, placed, scaled

INSIDE, OUTSIDE = scaled(9), ""  # of a ball: where the camera is


def place(folder: Path, ball: str) -> Placement:
    scene = folder / "scene.toml"
    scene.write_text(camera((0, 0, 3), 40, (24, 24)) + environment(1) + placed("ball", "sphere", ball, LAMBERT))
    return Placement(load_scene(scene))


def matt(albedo: float) -> list[tuple[int, Layer]]:
    """The ball's layer: even, of any albedo, also one that no scene file may name."""
    parameters = validate_parameters(MODELS["lambert"], {"albedo": min(albedo, 1.0)}, "test")
    layer = Layer(MODELS["lambert"], "matt", tuple(parameters.items()))
    return [(0, layer)] * (2 if albedo > 1.0 else 1)


@pytest.mark.parametrize("albedo", [0.05, 0.5, 1.0])
def test_in_a_hollow_ball_each_bounce_carries_the_albedos_part_of_the_last(tmp_path: Path, albedo: float) -> None:
    shares = shares_of(carried_light(place(tmp_path, INSIDE), np.full((1, 3), albedo), MOST_PLANNED + 1))
    powers = albedo ** np.arange(MOST_PLANNED + 1)
    np.testing.assert_allclose(shares, powers / powers.sum(), rtol=1e-6)


@pytest.mark.parametrize("albedo", [0.05, 0.5, 0.9])
@pytest.mark.parametrize("n_bounces", [1, 3, 8])
def test_what_is_missing_in_a_hollow_ball_is_the_rest_of_the_series(
    tmp_path: Path, albedo: float, n_bounces: int
) -> None:
    plan = planned_bounces(place(tmp_path, INSIDE), matt(albedo), n_bounces)
    assert plan.n_bounces == n_bounces
    # 1 + d + d² + ... is 1 / (1 - d), of which d^N / (1 - d) comes after N bounces; the bound is reached.
    assert plan.missing == pytest.approx(albedo**n_bounces, rel=1e-3)
    assert plan.most_missing == pytest.approx(albedo**n_bounces, rel=1e-3)
    kept = f"{1.0 - albedo**n_bounces:.0%} of the light, the rest is missing"
    assert plan.warning.endswith(kept) if albedo**n_bounces > 0.26 else not plan.warning


@pytest.mark.parametrize("albedo", [1.0, 1.5])
def test_a_closed_scene_that_reflects_all_light_is_flagged(tmp_path: Path, albedo: float) -> None:
    plan = planned_bounces(place(tmp_path, INSIDE), matt(albedo))
    assert (plan.n_bounces, plan.missing, plan.most_missing) == (MOST_PLANNED, 1.0, 1.0)
    assert plan.warning == "the scene absorbs too little light: no number of bounces is enough, 4 are shown"


def test_white_things_under_a_sky_are_not(tmp_path: Path) -> None:
    plan = planned_bounces(place(tmp_path, OUTSIDE), matt(1.0))
    assert (plan.n_bounces, plan.missing, plan.warning) == (1, 0.0, "")


def test_what_is_missing_is_within_its_bound() -> None:
    # Of light that decays unevenly: two colours, one that lasts. Albedo 0.8 at most.
    carried = np.array([[1.0, 1.0, 0.0], [0.5, 0.7, 0.0], [0.2, 0.5, 0.0]])
    missing, most = missing_light(carried, 0.8)
    after = 0.2 / (1 - 0.2 / 0.5) + 0.5 / (1 - 0.5 / 0.7)
    assert missing == pytest.approx(after / (3.2 + after))
    assert most == pytest.approx(0.7 / 0.2 / (3.2 + 0.7 / 0.2)) and missing <= most
    assert missing_light(carried, 1.0)[1] == 1.0  # no albedo bounds it
    assert missing_light(np.zeros((3, 3)), 0.5) == (0.0, 0.0)


def test_a_convex_thing_alone_needs_one(tmp_path: Path) -> None:
    plan = planned_bounces(place(tmp_path, OUTSIDE), matt(0.9))
    assert plan.n_bounces == 1 and plan.reason == "a second would carry 0.0 % of the light"


def test_a_black_scene_needs_one(tmp_path: Path) -> None:
    assert planned_bounces(place(tmp_path, INSIDE), matt(0.0)).n_bounces == 1


# With albedo d the bounce after the nth adds d^n (1 - d) / (1 - d^(n + 1)) to what there is.
@pytest.mark.parametrize(("albedo", "expected"), [(0.004, 1), (0.05, 2), (0.15, 3), (0.6, 4), (1.5, 4)])
def test_the_series_ends_where_a_bounce_adds_less_than_half_a_hundredth(albedo: float, expected: int) -> None:
    powers = albedo ** np.arange(MOST_PLANNED + 1)
    assert required_bounces(powers / powers.sum()) == expected
