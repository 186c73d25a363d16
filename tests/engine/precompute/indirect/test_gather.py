"""Fans of rays and equivalent albedos against integrals that are known."""

import numpy as np
import pytest

from engine.curve.operators import Operator
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.indirect import _ray_kernels as kernels
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.direction_patterns import N_PATTERNS, cosine_tables, lobe_tables

EYES = [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.3, 0.86, 0.41), (0.99, 0.0, 0.141)]


def fan(pole: int, eye: tuple[float, float, float], pattern: int, n: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """Directions (R, 3) above the horizon of one fan and their densities (R,)."""
    tables, sizes = (cosine_tables(n)[pattern], lobe_tables(n)[pattern]), np.float32(n)
    o = [np.float32(x) for x in np.asarray(eye) / np.linalg.norm(eye)]
    found = [
        kernels.sample_direction(table, k, is_cosine, np.float32(0.8), np.float32(0.6), pole, *o)
        for table, is_cosine in zip(tables, (True, False), strict=True)
        for k in range(n)
    ]
    directions = np.array([d for d in found if d[2] > kernels.HORIZON], np.float32)
    return directions, np.array([kernels.direction_pdf(sizes, sizes, pole, *d, *o) for d in directions])


@pytest.mark.parametrize("pole", [kernels.NORMAL, kernels.MIRROR, kernels.HALF])
@pytest.mark.parametrize("eye", EYES)
def test_hemisphere_samples_integrate_what_is_known(pole, eye):
    # Over the hemisphere: cos θ gives π, cos² θ gives 2π/3; each ray counts one over the density there.
    sums = []
    for pattern in range(4):
        directions, density = fan(pole, eye, pattern)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-5)
        sums.append([(directions[:, 2] / density).sum(), (directions[:, 2] ** 2 / density).sum()])
    assert np.mean(sums, axis=0) == pytest.approx([np.pi, 2 * np.pi / 3], rel=0.01)


@pytest.mark.parametrize("pole", [kernels.MIRROR, kernels.HALF])
def test_hemisphere_samples_find_a_narrow_highlight(pole):
    # One degree about the pole holds 2π (1 - cos 1°) of directions, or of half vectors: 4 cos θ_d times as much.
    eye = np.array([0.6, 0.0, 0.8])
    found, rays = [], []
    for pattern in range(16):
        directions, density = fan(pole, tuple(eye), pattern)
        half = directions + eye
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        cosine = directions @ (eye * [-1, -1, 1]) if pole == kernels.MIRROR else half[:, 2]
        inside = cosine > np.cos(np.radians(1.0))
        found.append((1.0 / density[inside]).sum())
        rays.append(inside.sum())
    expected = 2 * np.pi * (1 - np.cos(np.radians(1.0))) * (1.0 if pole == kernels.MIRROR else 4 * eye[2])
    assert np.mean(found) == pytest.approx(expected, rel=0.03)
    assert min(rays) >= 5


@pytest.mark.parametrize("pole", [kernels.NORMAL, kernels.MIRROR, kernels.HALF])
def test_rays_are_sharp_in_the_middle_of_a_highlight_alone(pole):
    # More than 1 of the 1 / (2π ln(1 + 1/ε)) / (1 - cos t + ε) rays a steradian are where 1 - cos t < 0.0228, 12.3°;
    # half vectors stand for 4 cos θ_d = 4 times as much of the sphere: 1 - cos t < 0.0047, t < 5.5°, 11.1° of the ray.
    normal, eye = np.array([[0.0, 0, 1]], np.float32), np.array([[0.0, 0, 1]], np.float32)
    surface = ViewedPoints(np.zeros((1, 3), np.float32), np.array([[1.0, 0, 0]], np.float32), normal, eye)
    away = np.radians(np.arange(0.5, 80.0))
    directions = np.stack([np.sin(away), 0 * away, np.cos(away)], axis=1).astype(np.float32)
    marks = np.full(len(away), 9, np.uint8)
    kernels.mark_glossy_rays(np.zeros(1, np.int32), np.array([pole]), surface, directions, marks)
    sharp, rest = (
        (0, kernels.DIFFUSE) if pole == kernels.NORMAL else (12 if pole == kernels.MIRROR else 11, kernels.GLOSSY)
    )
    assert marks.tolist() == [kernels.SHARP] * sharp + [rest] * (len(away) - sharp)


def test_patterns_are_unit_and_differ():
    tables = cosine_tables(64)
    assert tables.shape == (N_PATTERNS, 64, 3)
    assert tables[..., 2].mean() == pytest.approx(2 / 3, abs=2e-3)
    assert not np.allclose(tables[0], tables[1])
    assert lobe_tables(0).shape == (N_PATTERNS, 0, 3)


def test_further_samples_go_on_where_the_first_ended():
    # Two fans of 64 are one of 128: together as even as one, which two patterns of their own are not.
    for tables in (cosine_tables, lobe_tables):
        two = tables(64, 2).reshape(2, N_PATTERNS, 64, 3)
        np.testing.assert_array_equal(two[0], tables(64))
        np.testing.assert_array_equal(np.concatenate(list(two), axis=1), tables(128))
    assert kernels.pattern_of(np.uint64(3 + 64 * 9), 2) == 3 + 2 * N_PATTERNS


def test_albedo_of_a_diffuse_surface_is_its_albedo():
    layer = make_layer(MODELS["lambert"], {"albedo": [0.2, 0.5, 1.0]})
    for n_bands in (1, 16, 512):
        assert equivalent_albedo(layer, (n_bands,)) == pytest.approx([0.2, 0.5, 1.0], rel=2e-3)


@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("rough_conductor", {"alpha": 0.3}),
        ("ashikhmin_shirley", {}),
        ("cook_torrance", {}),
        ("phong", {}),
        ("oren_nayar", {}),
        ("schlick", {"roughness": 0.09}),
        ("ward", {"alpha": 0.3}),
        ("homomorphic", {}),
        ("ward_anisotropic", {"alpha_u": 0.5, "alpha_v": 0.3}),
        ("ashikhmin_hybrid", {}),
    ],
)
def test_albedo_against_the_formula(model, parameters):
    # A plain sum over a million pairs of directions, evenly spread over the two hemispheres.
    layer = make_layer(MODELS[model], parameters)
    generator = np.random.default_rng(3)
    pairs = generator.uniform(size=(2, 1_000_000, 2))
    z = pairs[..., 0]
    radius = np.sqrt(1 - z * z)
    turn = 2 * np.pi * pairs[..., 1]
    directions = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=2)
    values = layer.model.brdf(layer.values, directions[0], directions[1]) * z[0][:, None] * z[1][:, None]
    expected = values.mean(axis=0) * (2 * np.pi) ** 2 / np.pi
    found = equivalent_albedo(layer, (128, 64)[: len(layer.model.factors)])
    assert found == pytest.approx(expected, rel=0.03)


def test_albedo_follows_edits():
    # Twice the curve is twice the albedo; a view curve counts as well.
    layer = make_layer(MODELS["rough_conductor"])
    double = layer.with_operators("theta_h", [Operator("amplify", "y", 0.0, 0.0, 1.57, 1.57, magnitude=2.0)])
    assert equivalent_albedo(double, (64, 16)) == pytest.approx(2.0 * equivalent_albedo(layer, (64, 16)), rel=0.02)
