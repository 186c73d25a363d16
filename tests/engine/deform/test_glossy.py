"""Glossy reflection as functions of the light and weights of the view: closed forms, and sums over directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.deform import _shading_kernels
from engine.deform.glossy import (
    SIDE,
    Gloss,
    gloss,
    hemisphere_directions,
    lost_by_order,
    reflection,
    shade_glossy,
    simulate_glossy,
    view_directions,
)
from engine.deform.shading import band_light, lobes
from engine.deform.transfer import TransferPoints
from engine.deform.zonal import fit
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.render.integrator import evaluate_layers
from engine.scene.raycaster import RayCaster
from engine.scene.surface_points import surface_points
from engine.sphere.harmonics import basis, clamped_cosine, quadrature
from engine.steps import finish

MATT = [make_layer(MODELS["lambert"], {"albedo": (0.5, 0.25, 0.125)})]
SHINY = [make_layer(MODELS["rough_conductor"], {"alpha": 0.3})]


@pytest.fixture(scope="module")
def shiny() -> Gloss:
    return gloss(SHINY, 4, 16)


def test_a_matt_layer_is_one_function_and_loses_what_its_cosine_does() -> None:
    """Of a cosine's energy, 2 pi / 3, bands below n hold the sum of (2l + 1) A_l^2 / 4 pi."""
    matt = gloss(MATT, 4, 1)
    held = ((2 * np.arange(4) + 1) / (4 * math.pi) * clamped_cosine(4) ** 2).sum()
    assert matt.lost_by_order == pytest.approx(1.0 - held / (2.0 * math.pi / 3.0), abs=1e-4)
    assert matt.lost_by_rows < 1e-6
    # u F is the albedo's cosine for every view, each colour by its own weight
    sent = matt.views[5, 7].T.astype(float) @ matt.functions[:, :16]
    about_z = basis([0.0, 0.0, 1.0], 4) * clamped_cosine(4)[np.repeat(np.arange(4), 2 * np.arange(4) + 1)] / math.pi
    assert sent == pytest.approx(np.outer([0.5, 0.25, 0.125], about_z), abs=2e-4)


def test_sharper_highlights_lose_more_and_higher_orders_less() -> None:
    of_alpha = [lost_by_order([make_layer(MODELS["rough_conductor"], {"alpha": a})], 4) for a in (1.0, 0.3, 0.02)]
    of_order = [lost_by_order(SHINY, n) for n in (2, 6, 10)]
    assert 0.0 < of_alpha[0] < of_alpha[1] < of_alpha[2] < 1.0
    assert 1.0 > of_order[0] > of_alpha[1] > of_order[1] > of_order[2] > 0.0


def test_nothing_reflects_nothing_and_loses_nothing() -> None:
    black = gloss([make_layer(MODELS["lambert"], {"albedo": (0.0, 0.0, 0.0)})])
    assert (black.functions == 0.0).all() and black.lost_by_order == black.lost_by_rows == 0.0
    assert np.isfinite(black.views).all()
    with pytest.raises(ValueError, match="17 rows, expected 1 to 16"):
        gloss(MATT, 4, 17)


@pytest.mark.parametrize(
    "layer", [SHINY[0], make_layer(MODELS["ward"], {}), make_layer(MODELS["phong"], {"exponent": 30.0})]
)
def test_reflection_is_what_a_sum_over_directions_says(layer: Layer) -> None:
    """By Gauss's points over the upper half of the sphere, for some views away from its rim."""
    z, of_z = np.polynomial.legendre.leggauss(64)
    azimuth = (np.arange(128) + 0.5) * (math.pi / 64)
    z, of_z = (z + 1.0) / 2.0, of_z / 2.0 * (math.pi / 64)
    sine = np.sqrt(1.0 - z**2)[:, None]
    wi = np.stack(np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), z[:, None]), -1).reshape(-1, 3)
    harmonics = reflection([layer])[0]
    for row, column in ((16, 16), (20, 9), (11, 27)):
        view = view_directions()[row, column]
        values = evaluate_layers([layer], wi, np.tile(view, (len(wi), 1))) * np.repeat(of_z, 128)[:, None]
        expected = basis(wi, 10).T @ values
        assert harmonics[row * SIDE + column] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_the_map_of_views_finds_each_direction_where_it_was_put() -> None:
    views = np.zeros((SIDE, SIDE, 2, 3), np.float32)
    views[:, :, 0], views[:, :, 1] = np.arange(SIDE)[:, None, None], np.arange(SIDE)[None, :, None]
    eyes = view_directions().reshape(-1, 3).astype(np.float32)
    found = []
    for k in range(2):
        rows = np.zeros((len(eyes), 2, 3), np.float32)
        rows[:, k] = 1.0
        radiance = np.empty((len(eyes), 3), np.float32)
        frames = np.tile(np.eye(3, dtype=np.float32), (len(eyes), 1, 1))
        _shading_kernels.weigh_range(rows, views, frames, eyes, 0, len(eyes), radiance)
        found.append(radiance[:, 0].reshape(SIDE, SIDE))
    assert found[0] == pytest.approx(np.arange(SIDE)[:, None] + np.zeros((SIDE, SIDE)), abs=1e-3)
    assert found[1] == pytest.approx(np.arange(SIDE)[None] + np.zeros((SIDE, SIDE)), abs=1e-3)


def test_views_share_the_hemisphere_evenly() -> None:
    upper = view_directions().reshape(-1, 3)
    assert np.linalg.norm(upper, axis=1) == pytest.approx(1.0)
    assert upper[:, 2].mean() == pytest.approx(0.5, abs=1e-3) and (upper[:, 2] ** 2).mean() == pytest.approx(
        1 / 3, abs=1e-3
    )


def beside_a_wall() -> tuple[TransferPoints, RayCaster]:
    """Two points of the ground z = 0, on either side of a wall that takes half of the sky from each."""
    wall = np.array([[-0.01, -1e4, -1e4], [-0.01, 1e4, -1e4], [-0.01, 0.0, 1e5]])
    caster = RayCaster(wall, np.array([[0, 1, 2]], np.int32))
    places = np.array([[-0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    normals = np.tile([0.0, 0.0, 1.0], (2, 1))
    points = surface_points(caster, places, normals)
    return TransferPoints(points, np.stack([np.eye(3)] * 2), np.full((1, 3), -1, np.int32)), caster


def test_shadows_take_their_part_of_each_function(shiny: Gloss) -> None:
    mesh, caster = beside_a_wall()
    rows = finish(simulate_glossy(mesh, caster, shiny, 4000))
    directions, values = hemisphere_directions(20000)
    of_functions = values @ shiny.functions.T * (2.0 * math.pi / 20000)
    for point, sees in enumerate((directions[:, 0] < 0.0, directions[:, 0] > 0.0)):
        expected = (of_functions * sees[:, None]).T @ values[:, :16]
        assert np.linalg.norm(rows[point] - expected) < 0.02 * np.linalg.norm(expected)


def test_without_shadows_all_that_is_left_is_the_reflection_itself(shiny: Gloss) -> None:
    far = RayCaster(np.array([[0, 0, -9.0], [1, 0, -9.0], [0, 1, -9.0]]), np.array([[0, 1, 2]], np.int32))
    points = surface_points(far, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    mesh = TransferPoints(points, np.eye(3)[None], np.full((1, 3), -1, np.int32))
    rows = finish(simulate_glossy(mesh, far, shiny, 500))
    assert rows[0] == pytest.approx(shiny.functions[:, :16], abs=1e-9 * np.abs(shiny.functions).max())


def test_shading_is_light_times_reflection_however_the_surface_is_turned(shiny: Gloss) -> None:
    """At the map's own views, where nothing lies between; all 16 functions, so that nothing but the fit is lost."""
    light = np.random.default_rng(3).normal(size=(16, 3))
    places = [(16, 12), (25, 20), (9, 3)]
    fitted = lobes(finish(fit(np.tile(shiny.functions[:, :16], (len(places), 1)), 6)))
    turns = Rotation.random(len(places), random_state=2)
    frames = turns.as_matrix().transpose(0, 2, 1)
    harmonics = reflection(SHINY)[0]
    eyes = np.stack([frame.T @ view_directions()[place] for frame, place in zip(frames, places, strict=True)])
    found = shade_glossy(fitted, shiny, frames, eyes, band_light(light))
    around, weights = quadrature(5)
    for i, (row, column) in enumerate(places):
        # the light as the surface's own axes see it
        own = (basis(around, 4) * weights[:, None]).T @ (basis(around @ frames[i], 4) @ light)
        expected = (harmonics[row * SIDE + column, :16] * own).sum(axis=0)
        scale = np.linalg.norm(harmonics[row * SIDE + column, :16]) * np.linalg.norm(own)
        assert np.abs(found[i] - expected).max() < 0.01 * scale
    below = shade_glossy(fitted, shiny, frames, -frames[:, 2], band_light(light))
    assert (below == 0.0).all()
