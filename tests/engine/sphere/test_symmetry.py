import numpy as np
import pytest

from engine.sphere import haar
from engine.sphere.geodesic import geodesic, locate
from engine.sphere.symmetry import (
    N_SYMMETRIES,
    SECTOR,
    images_of_triangles,
    images_of_wavelets,
    symmetry,
)


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
