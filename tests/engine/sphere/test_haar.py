"""Spherical Haar wavelets, and the symmetries of the geodesic sphere."""

import numpy as np
import pytest

from engine.sphere import haar
from engine.sphere.geodesic import geodesic, locate
from engine.sphere.haar import (
    N_SYMMETRIES,
    SECTOR,
    images_of_triangles,
    images_of_wavelets,
    symmetry,
)
from tests.naive.haar import place_of, tripling_coefficient


def truncated(values: np.ndarray, n: int, rule: haar.Rule = "size") -> np.ndarray:
    """Values (20·4^L, ...) rebuilt from the n coefficients that are kept."""
    coefficients = haar.forward(values)
    coefficients[~haar.select_coefficients(coefficients, n, rule)] = 0.0
    return haar.inverse(coefficients)


def basis(level: int) -> np.ndarray:
    """(C, T): every basis function's value on the triangles of a level."""
    return haar.inverse(np.eye(20 * 4**level)).T


@pytest.mark.parametrize("level", range(5))
def test_forward_and_inverse_undo_each_other(level: int) -> None:
    values = np.random.default_rng(level).normal(size=(20 * 4**level, 3))
    np.testing.assert_allclose(haar.inverse(haar.forward(values)), values, atol=1e-14)
    np.testing.assert_allclose(haar.forward(haar.inverse(values)), values, atol=1e-14)
    assert haar.forward(values.astype(np.float32)).dtype == np.float32


def test_the_basis_is_orthogonal_with_the_measure_of_its_triangles() -> None:
    functions = basis(2)
    inner = functions @ functions.T / 4.0**2
    np.testing.assert_allclose(inner, np.diag(4.0 ** -haar.levels_of_coefficients(2)), atol=1e-14)


def test_every_triple_to_level_two_equals_the_brute_force_integral() -> None:
    # All triples of the 320 functions, by the closed form where it is not 0 and by its count where it is.
    functions, numbers = basis(2), np.arange(320)
    nonzero = 0
    for i in numbers:
        there = functions[i] != 0.0
        integrals = (functions[i, there] * functions[:, there]) @ functions[:, there].T / 16.0
        nonzero += np.count_nonzero(integrals)
        looked_at = (integrals != 0.0) | ((i + numbers[:, None] + numbers) % 389 == 0)
        for j, k in np.argwhere(np.triu(looked_at)):
            if j >= i:
                assert abs(tripling_coefficient(int(i), int(j), int(k)) - integrals[j, k]) < 1e-15
    # 20 means; six orders of the three wavelets of each of 100 triangles; three orders of each of 300 wavelets twice
    # with the mean above it, and of the 240 finer ones with three coarser wavelets.
    assert nonzero == 20 + 6 * 100 + 3 * (300 + 240 * 3)


def test_random_triples_at_level_four() -> None:
    random = np.random.default_rng(1)
    unit = np.zeros(5120)

    def function(number: int) -> np.ndarray:
        unit[:] = 0.0
        unit[number] = 1.0
        return haar.inverse(unit)

    nonzero = 0
    for _ in range(300):
        i = int(random.integers(20, 5120))
        level, triangle, _ = place_of(i)
        ancestor = int(random.integers(0, level + 1))
        above = 20 * 4**ancestor + 3 * (triangle >> 2 * (level - ancestor)) + int(random.integers(0, 3))
        j = i if random.random() < 0.7 else int(random.integers(0, 5120))
        brute = float((function(i) * function(j) * function(above)).sum()) / 4.0**4
        assert tripling_coefficient(i, j, above) == pytest.approx(brute, abs=1e-15)
        nonzero += brute != 0.0
    assert nonzero > 100


def test_constant_light_is_exact_however_few_coefficients_are_kept() -> None:
    # Powers L ΔΩ against constants: every mean is kept, so the solid angles sum to 4π.
    powers = geodesic(4).solid_angles
    for rule in ("size", "energy", "top"):
        for n in (1, 20, 80, 5120):
            assert truncated(powers, n, rule).sum() == pytest.approx(4.0 * np.pi, rel=1e-12)


def test_what_is_kept_is_the_largest_by_the_rule() -> None:
    random = np.random.default_rng(3)
    coefficients = random.normal(size=(320, 3)).astype(np.float32)
    size = np.abs(coefficients).max(axis=1)
    area = 4.0 ** -haar.levels_of_coefficients(2)
    for rule, weight in (("size", size * area), ("energy", size**2 * area)):
        keep = haar.select_coefficients(coefficients, 60, rule)
        assert keep.sum() == 60 and keep[:20].all()
        assert weight[keep][20:].min() >= weight[~keep].max()
    np.testing.assert_array_equal(np.flatnonzero(haar.select_coefficients(coefficients, 60, "top")), np.arange(60))
    assert (
        haar.select_coefficients(coefficients, 10_000).all() and haar.select_coefficients(coefficients, 1).sum() == 20
    )
    np.testing.assert_allclose(truncated(coefficients, 320), coefficients, atol=2e-6)


def test_other_counts_are_refused() -> None:
    with pytest.raises(ValueError, match="81 values"):
        haar.forward(np.zeros(81))


def test_there_are_ten_and_they_leave_the_vertical_axis() -> None:
    matrices = np.stack([symmetry(number) for number in range(N_SYMMETRIES)])
    np.testing.assert_allclose(np.linalg.det(matrices), [1] * 5 + [-1] * 5, atol=1e-14)
    np.testing.assert_allclose(matrices @ [0, 1, 0], np.tile([0, 1, 0], (10, 1)), atol=1e-15)
    products = np.einsum("aij,bjk->abik", matrices, matrices).reshape(100, 1, 9)
    distance = np.abs(products - matrices.reshape(1, 10, 9)).max(axis=2)
    assert distance.min(axis=1).max() < 1e-14
    np.testing.assert_array_equal(np.bincount(distance.argmin(axis=1)), 10)


def test_every_azimuth_is_reached_from_one_sector() -> None:
    azimuth = np.linspace(0.0, SECTOR, 50)
    sector = np.stack([np.sin(azimuth), np.zeros(50), np.cos(azimuth)], axis=1)
    reached = np.concatenate([sector @ symmetry(number).T for number in range(N_SYMMETRIES)])
    found = np.sort(np.mod(np.arctan2(reached[:, 0], reached[:, 2]), 2 * np.pi))
    assert np.diff(np.append(found, found[0] + 2 * np.pi)).max() < 1.01 * SECTOR / 49


@pytest.mark.parametrize("level", range(5))
def test_symmetries_carry_triangles_onto_triangles(level: int) -> None:
    sphere = geodesic(level)
    for number, image in enumerate(images_of_triangles(level)):
        np.testing.assert_array_equal(np.sort(image), np.arange(sphere.n_triangles))
        moments = sphere.vertices[sphere.triangles].sum(axis=1) @ symmetry(number).T
        np.testing.assert_allclose(moments, sphere.vertices[sphere.triangles[image]].sum(axis=1), atol=1e-12)
        np.testing.assert_allclose(sphere.solid_angles[image], sphere.solid_angles, rtol=1e-12)
        if level:
            # Children go with their parents, the middle one to the middle one.
            np.testing.assert_array_equal(image // 4, np.repeat(images_of_triangles(level - 1)[number], 4))
            np.testing.assert_array_equal(image[3::4] % 4, 3)


def test_a_function_moved_by_a_symmetry_has_the_same_coefficients_in_another_order() -> None:
    values = np.random.default_rng(5).normal(size=20 * 4**3)
    for number in range(N_SYMMETRIES):
        moved, coefficients = np.empty_like(values), np.empty_like(values)
        moved[images_of_triangles(3)[number]] = values
        coefficients[images_of_wavelets(3)[number]] = haar.forward(values)
        np.testing.assert_allclose(haar.forward(moved), coefficients, atol=1e-14)


def test_images_agree_with_where_directions_fall() -> None:
    directions = np.random.default_rng(2).normal(size=(500, 3))
    for number in range(N_SYMMETRIES):
        image = images_of_triangles(4)[number]
        np.testing.assert_array_equal(locate(directions @ symmetry(number).T, 4), image[locate(directions, 4)])
