"""The difference of an object's pictures: independent of noise, and as large as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.inverse.placed_error import error_of_halves, placed_error
from engine.light.environment import constant_environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.reference.path_tracer import trace_paths
from engine.render.picture_difference import errors
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, facing_up, placed, scaled


def halves(truth: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """Two independent estimates of a picture (p, 3)."""
    return truth + noise * np.random.default_rng(seed).standard_normal((2, *truth.shape))


PICTURE = np.full((4000, 3), 2.0)


def test_a_picture_differs_from_itself_by_nothing_though_both_are_noisy():
    # Root mean square of the noise's difference is 0.28 of the mean: it must not count. What is left is that of 12,000
    # products, 0.08 / sqrt(12,000) = 7e-4, of which the root is 0.027.
    assert error_of_halves(halves(PICTURE, 0.4, 0), halves(PICTURE, 0.4, 1)) < 0.06


def test_a_difference_is_relative_to_the_mean_of_the_original():
    # 10 % brighter everywhere; darker values are not clamped.
    assert error_of_halves(halves(PICTURE, 0.0, 0), halves(0.9 * PICTURE, 0.0, 1)) == pytest.approx(0.1)
    assert error_of_halves(halves(PICTURE, 0.4, 0), halves(0.5 * PICTURE, 0.4, 1)) == pytest.approx(0.5, rel=0.1)


def test_a_black_original_has_no_relative_error():
    assert error_of_halves(np.zeros((2, 5, 3)), np.ones((2, 5, 3))) is None


VIEW = camera((0, 0.4, 3), 40, (32, 24))
# Facets: of smooth normals some are inclined behind their face, and see less of the sky.
FACETED = placed("ball", "sphere", more="smooth = false\n")
UNSEEN = placed("behind", "sphere", scaled(0.2, (0, 0, 9)))
SKY = SkyState(constant_environment((1.0, 1.0, 1.0)))


def place(folder: Path, *objects: str) -> Placement:
    (folder / "scene.toml").write_text(VIEW + "".join(objects))
    return Placement(load_scene(folder / "scene.toml"))


def diffuse(*albedo: float) -> tuple[Layer]:
    return (make_layer(MODELS["lambert"], {"albedo": albedo}),)


def error_of(
    placement: Placement, layers_of: dict[int, tuple[Layer, ...]], i_object: int, matched: tuple[Layer, ...],
    n_bounces: int = 1, n_samples: int = 64,
) -> float | None:  # fmt: skip
    steps = placed_error(placement, layers_of, i_object, layers_of[i_object], matched, SKY, n_bounces, 200, n_samples)
    shares: list[float] = []
    found = run_to_end(steps, shares.append)
    assert shares == sorted(shares)
    return found


def test_a_diffuse_ball_that_is_darker_by_a_share_has_that_error(tmp_path: Path) -> None:
    """Alone under an even sky a convex diffuse surface has the radiance of its albedo everywhere. Of one that
    is so even the clamp cuts the noise: 4 % of the error at 64 samples, less than 1 % at 1,024."""
    placement, alone = place(tmp_path, FACETED), {0: diffuse(0.5, 0.5, 0.5)}
    for share in (0.02, 0.1, 0.6):
        darker = diffuse(*(0.5 * (1.0 - share),) * 3)
        assert error_of(placement, alone, 0, darker, n_samples=1024) == pytest.approx(share, rel=0.01)
    # A material that is itself has no error at all: both pictures have the same random numbers.
    assert error_of(placement, alone, 0, alone[0]) == 0.0


def test_an_object_that_no_pixel_sees_has_no_error(tmp_path: Path) -> None:
    white = diffuse(1.0, 1.0, 1.0)
    assert error_of(place(tmp_path, FACETED, UNSEEN), {0: white, 1: white}, 1, diffuse(0.5, 0.5, 0.5)) is None


@pytest.mark.parametrize("i_object", [0, 1])
def test_among_other_objects_it_is_that_of_two_pictures_without_noise(tmp_path: Path, i_object: int) -> None:
    """Light that was reflected by the other object counts, and no pixel of the other object does."""
    placement = place(tmp_path, FACETED, placed("ground", "quad", facing_up(2, (0, -0.6, 0))), UNSEEN)
    layers_of = {0: diffuse(0.9, 0.4, 0.2), 1: diffuse(0.1, 0.6, 0.8), 2: diffuse(0.2, 0.2, 0.2)}
    matched = diffuse(0.5, 0.5, 0.5)

    def picture(layers: tuple[Layer, ...]) -> np.ndarray:
        rows, there = placement.rows_of(i_object), {**layers_of, i_object: layers}
        return run_to_end(trace_paths(placement, there, SKY, 3, 1024, 1, rows), lambda step: None).radiance

    expected = errors(picture(matched), picture(layers_of[i_object])).rmse
    assert expected > 0.2
    assert error_of(placement, layers_of, i_object, matched, 3) == pytest.approx(expected, rel=0.03)
