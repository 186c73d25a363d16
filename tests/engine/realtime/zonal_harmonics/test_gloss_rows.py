"""Glossy transfer by rows: closed forms of a diffuse and of a Phong lobe, and a slow twin in random poses."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layer, make_layer
from engine.realtime.zonal_harmonics._gloss_row_kernels import square_place
from engine.realtime.zonal_harmonics.gloss_rows import (
    MOST_ROWS,
    SIDE,
    GlossBasis,
    add_gloss_rows,
    basis_of_functions,
    gloss_basis,
    reflection,
    simulate_gloss_rows,
    view_directions,
    window,
)
from engine.realtime.zonal_harmonics.shading import band_light, lobes
from engine.realtime.zonal_harmonics.transfer import TransferPoints
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.raycaster import RayCaster, surface_points
from engine.sphere.harmonics import bands, basis, clamped_cosine
from tests.naive.gloss import gloss

N = 6
MATT = make_layer(MODELS["lambert"], {"albedo": (0.5, 0.25, 0.125)})
SHINY = make_layer(MODELS["rough_conductor"], {"alpha": 0.45})
BRUSHED = make_layer(MODELS["ward"], {})


@cache
def whole_basis() -> GlossBasis:
    """Nothing is lost to the number of functions."""
    return gloss_basis(SHINY, N, N * N)


def test_a_diffuse_layer_is_one_function_and_loses_what_its_cosine_does() -> None:
    """Of a cosine's energy, 2 pi / 3, bands below n hold the sum of (2l + 1) A_l^2 / 4 pi."""
    found = gloss_basis(MATT, 4, 1)
    held = ((2 * np.arange(4) + 1) / (4 * math.pi) * clamped_cosine(4) ** 2).sum()
    assert found.lost_by_order == pytest.approx(1.0 - held / (2.0 * math.pi / 3.0), abs=1e-4)
    assert found.lost_by_rows < 1e-6
    # the product of weight and function is the albedo's cosine for every wo, each channel by its own weight
    sent = found.views[5, 7].T.astype(float) @ found.functions[:, :16]
    about_z = basis([0.0, 0.0, 1.0], 4) * clamped_cosine(4)[np.repeat(np.arange(4), 2 * np.arange(4) + 1)] / math.pi
    assert sent == pytest.approx(np.outer([0.5, 0.25, 0.125], about_z), abs=2e-4)


@pytest.mark.parametrize("exponent", [2.0, 8.0, 20.0])
def test_a_phong_lobe_seen_from_above_is_its_closed_form(exponent: float) -> None:
    """For wo = n, b s_z = (e + 2) / 2 pi c^(e + 1): under light y_l0 an unshadowed point sends (e + 2) sqrt((2l + 1) /
    4 pi) times the integral of c^(e + 1) P_l(c) over [0, 1]. The square has no entry at n, so four around it are
    interpolated."""
    phong = make_layer(MODELS["phong"], {"exponent": exponent, "scale": (1.0, 1.0, 1.0)})
    found = gloss_basis(phong, N, N * N)
    c, weight = np.polynomial.legendre.leggauss(64)
    c, weight = (c + 1.0) / 2.0, weight / 2.0
    legendre = np.stack([np.polynomial.legendre.legval(c, row) for row in np.eye(N)])
    root = np.sqrt((2 * np.arange(N) + 1) / (4 * math.pi))
    of_bands = (exponent + 2.0) * root * (legendre @ (weight * c ** (exponent + 1.0)))
    for band in range(N):
        light = np.zeros((N * N, 3))
        light[0], light[band * band + band] = 2.0, 1.0  # positive, whatever the band sends
        expected = of_bands[band] + (2.0 * of_bands[0] if band else 0.0)
        sent = shaded(found, np.eye(3)[None], np.array([[0.0, 0.0, 1.0]]), light, found.functions[None, :, : N * N])
        assert sent[0] == pytest.approx([expected] * 3, abs=0.02)


def test_sharper_highlights_lose_more_to_the_order_and_fewer_functions_lose_more() -> None:
    of_alpha = [
        gloss_basis(make_layer(MODELS["rough_conductor"], {"alpha": a}), N, 3).lost_by_order for a in (1.0, 0.3, 0.02)
    ]
    assert 0.0 < of_alpha[0] < of_alpha[1] < of_alpha[2] < 1.0
    of_rows = [gloss_basis(SHINY, N, k).lost_by_rows for k in (1, 3, 9, MOST_ROWS)]
    assert 1.0 > of_rows[0] > of_rows[1] > of_rows[2] > of_rows[3] > 0.0
    assert whole_basis().lost_by_rows < 1e-12


def test_nothing_reflects_nothing() -> None:
    black = gloss_basis(make_layer(MODELS["lambert"], {"albedo": (0.0, 0.0, 0.0)}), N, 3)
    assert (black.functions == 0.0).all() and black.lost_by_order == black.lost_by_rows == 0.0
    assert np.isfinite(black.views).all()
    with pytest.raises(ValueError, match="17 rows, expected 1 to 16"):
        gloss_basis(MATT, 4, 17)


def test_functions_hold_their_layer_at_any_brightness_and_one_that_is_far_from_it_less() -> None:
    found = gloss_basis(SHINY, N, 9)
    same = basis_of_functions(found.functions, SHINY, N)
    assert np.abs(same.views - found.views).max() < 1e-5 * np.abs(found.views).max()
    half = basis_of_functions(found.functions, make_layer(MODELS["rough_conductor"], {"alpha": 0.45, "scale": 0.5}), N)
    assert np.abs(half.views - 0.5 * found.views).max() < 1e-5 * np.abs(found.views).max()
    sharp = make_layer(MODELS["rough_conductor"], {"alpha": 0.2})
    assert basis_of_functions(found.functions, sharp, N).lost_by_rows > gloss_basis(sharp, N, 9).lost_by_rows


@pytest.mark.parametrize("layer", [SHINY, BRUSHED, make_layer(MODELS["phong"], {"exponent": 30.0})])
def test_reflection_is_what_a_sum_over_directions_says(layer: Layer) -> None:
    """By Gauss's points over the upper half of the sphere, for some wo away from its rim."""
    z, of_z = np.polynomial.legendre.leggauss(64)
    azimuth = (np.arange(128) + 0.5) * (math.pi / 64)
    z, of_z = (z + 1.0) / 2.0, of_z / 2.0 * (math.pi / 64)
    sine = np.sqrt(1.0 - z**2)[:, None]
    wi = np.stack(np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), z[:, None]), -1).reshape(-1, 3)
    harmonics = reflection(layer)[0]
    for row, column in ((16, 16), (20, 9), (11, 27)):
        wo = view_directions()[row, column]
        values = evaluate_layer(layer, wi, np.tile(wo, (len(wi), 1))) * np.repeat(of_z, 128)[:, None]
        expected = values.T @ basis(wi, 10)
        assert harmonics[row * SIDE + column] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_the_square_finds_each_direction_where_it_was_put() -> None:
    middles = np.linspace(-1.0, 1.0, 2 * SIDE + 1)[1::2]
    for row, column in np.random.default_rng(1).integers(0, SIDE, (50, 2)):
        assert square_place(*view_directions()[row, column]) == pytest.approx((middles[row], middles[column]))
    assert square_place(0.0, 0.0, 1.0) == (0.0, 0.0)


def test_directions_share_the_hemisphere_evenly() -> None:
    """Means over the hemisphere: 1 / 2 of z, 1 / 3 of its square."""
    upper = view_directions().reshape(-1, 3)
    assert np.linalg.norm(upper, axis=1) == pytest.approx(1.0)
    assert upper[:, 2].mean() == pytest.approx(0.5, abs=1e-3)
    assert (upper[:, 2] ** 2).mean() == pytest.approx(1 / 3, abs=1e-3)


def beside_a_wall() -> tuple[TransferPoints, RayCaster]:
    """Two points of the ground z = 0, on either side of a wall that takes half of the sky from each."""
    wall = np.array([[-0.01, -1e4, -1e4], [-0.01, 1e4, -1e4], [-0.01, 0.0, 1e5]])
    caster = RayCaster(wall, np.array([[0, 1, 2]], np.int32))
    points = surface_points(caster, np.array([[-0.02, 0.0, 0.0], [0.0, 0.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1)))
    return TransferPoints(points, np.stack([np.eye(3)] * 2), np.full((1, 3), -1, np.int32)), caster


def shaded(found, frames, wo, light, rows):  # type: ignore[no-untyped-def]
    """What points with rows (P, K, n^2) send along wo (P, 3), in world axes."""
    fitted = lobes(run_to_end(fit(rows.reshape(-1, N * N), 6)))
    sent = np.zeros((len(wo), 3), np.float32)
    which, reached = np.arange(len(wo)), np.ones(len(wo), np.float32)
    places = (-wo).astype(np.float32)
    add_gloss_rows(fitted, found.views, which, frames, places, (0.0, 0.0, 0.0), band_light(light), reached, sent)
    return sent


def some_light() -> np.ndarray:
    """Light (n^2, 3) that falls off over the bands and is positive all over."""
    light = np.random.default_rng(3).normal(size=(N * N, 3)) / (2.0 + bands(N)[:, None]) ** 2
    light[0] = 3.0
    return light


@pytest.mark.parametrize("seed", range(4))
def test_a_shadowed_point_in_any_pose_sends_what_its_slow_twin_does(seed: int) -> None:
    """Either point beside the wall, turned at random with its transfer under fixed light; wo among the square's own.
    Within 2 %: 4,000 rays of the transfer, six lobes, and what of the reflection is beyond order 10."""
    mesh, caster = beside_a_wall()
    rows = run_to_end(simulate_gloss_rows(mesh, caster, whole_basis(), 4000))
    random = np.random.default_rng(seed)
    frames = Rotation.random(2, random_state=seed).as_matrix()
    wo = view_directions()[tuple(random.integers(3, SIDE - 3, (2, 2)))]
    sent = shaded(whole_basis(), frames, np.einsum("pa,pai->pi", wo, frames), some_light(), rows)
    attenuated = some_light() * window(N)[bands(N), None]  # the light instead of the rows
    for k, sees in enumerate((lambda wi: wi[0] < 0.0, lambda wi: wi[0] > 0.0)):
        assert sent[k] == pytest.approx(gloss(SHINY, wo[k], frames[k], sees, attenuated), rel=0.02)


def test_without_shadows_all_that_is_left_is_the_reflection_itself() -> None:
    far = RayCaster(np.array([[0, 0, -9.0], [1, 0, -9.0], [0, 1, -9.0]]), np.array([[0, 1, 2]], np.int32))
    points = surface_points(far, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    mesh = TransferPoints(points, np.eye(3)[None], np.full((1, 3), -1, np.int32))
    rows = run_to_end(simulate_gloss_rows(mesh, far, whole_basis(), 500))
    expected = whole_basis().functions[:, :36] * window(N)[bands(N)]
    assert rows[0] == pytest.approx(expected, abs=1e-9 * np.abs(rows).max())


def test_blocked_directions_reflect_what_the_diffuse_transfer_has_beyond_direct_light() -> None:
    """A white wall under even light is as bright as the sky that it hides: the point is then shaded as if it were not
    there, 2 sqrt(pi) by the first harmonic. By half as bright a wall, in between."""
    mesh, caster = beside_a_wall()
    open_ = whole_basis().functions[:, 0]
    black = run_to_end(simulate_gloss_rows(mesh, caster, whole_basis(), 4000))[:, :, 0]
    for brightness in (1.0, 0.5):
        # of a white point, the first harmonic: half of the sky, and half of the wall
        diffuse = np.zeros((2, N * N))
        diffuse[:, 0] = (0.5 + 0.5 * brightness) * basis([0.0, 0.0, 1.0], 1)[0]
        rows = run_to_end(simulate_gloss_rows(mesh, caster, whole_basis(), 4000, diffuse))[:, :, 0]
        expected = black + brightness * (open_ - black)
        assert rows == pytest.approx(expected, abs=0.01 * np.abs(open_).max())


def test_seen_from_below_it_sends_nothing() -> None:
    wo = np.array([[0.0, 0.0, -1.0], [0.3, 0.4, -math.sqrt(0.75)]])
    rows = np.repeat(whole_basis().functions[None, :, : N * N], 2, axis=0)
    assert (shaded(whole_basis(), np.stack([np.eye(3)] * 2), wo, some_light(), rows) == 0.0).all()
