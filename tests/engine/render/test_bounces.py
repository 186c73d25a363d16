"""How many bounces a plan takes: closed forms of a hollow ball, a thing alone, and two walls."""

from pathlib import Path

import numpy as np
import pytest

from engine.render.bounces import MOST_PLANNED, bounce_shares, planned_bounces, required_bounces
from engine.scene.load import load_scene
from engine.transport.pipeline import Placement

INSIDE = 'primitive = "sphere"\ntransform = [9, 0, 0, 0, 0, 9, 0, 0, 0, 0, 9, 0, 0, 0, 0, 1]'
OUTSIDE = 'primitive = "sphere"'


def place(folder: Path, ball: str) -> Placement:
    scene = folder / "scene.toml"
    scene.write_text(f"""
version = 1
[camera]
position = [0, 0, 3]
target = [0, 0, 0]
fov_y = 40
resolution = [24, 24]
[environment]
radiance = 1
[[object]]
name = "ball"
{ball}
layer = [{{ model = "lambert" }}]
""")
    return Placement(load_scene(scene))


@pytest.mark.parametrize("albedo", [0.05, 0.5, 1.0])
def test_in_a_hollow_ball_each_bounce_carries_the_albedos_part_of_the_last(tmp_path: Path, albedo: float) -> None:
    shares = bounce_shares(place(tmp_path, INSIDE), np.full((1, 3), albedo))
    powers = albedo ** np.arange(MOST_PLANNED + 1)
    np.testing.assert_allclose(shares, powers / powers.sum(), rtol=1e-6)


def test_a_convex_thing_alone_needs_one(tmp_path: Path) -> None:
    n_bounces, reason = planned_bounces(place(tmp_path, OUTSIDE), np.full((1, 3), 0.9))
    assert n_bounces == 1 and reason == "a second would carry 0.0 % of the light"


def test_a_black_scene_needs_one(tmp_path: Path) -> None:
    assert planned_bounces(place(tmp_path, INSIDE), np.zeros((1, 3)))[0] == 1


# With albedo d the bounce after the nth adds d^n (1 - d) / (1 - d^(n + 1)) to what there is.
@pytest.mark.parametrize(("albedo", "expected"), [(0.005, 1), (0.05, 2), (0.2, 3), (0.6, 4), (1.5, 4)])
def test_the_series_ends_where_a_bounce_adds_less_than_a_hundredth(albedo: float, expected: int) -> None:
    powers = albedo ** np.arange(MOST_PLANNED + 1)
    assert required_bounces(powers / powers.sum()) == expected
