"""Direct light by closed forms: a constant sky, a sphere above a plane, squares and their form factors."""

import numpy as np
import pytest

from engine.light.environment import constant_environment
from engine.scene.primitives import sphere
from tests.engine.precompute.direct.by_hand import irradiance, light_of, points_at, square

UP = np.array([[0.0, 1.0, 0.0]])
ORIGIN = np.zeros((1, 3))


@pytest.mark.parametrize("normal", [(0, 1, 0), (1, 2, 3), (1, 0, 0), (0.3, -1, 0.2)])
@pytest.mark.parametrize(("n_lights", "tolerance"), [(4000, 1e-3), (400, 4e-3)])
def test_a_constant_sky_gives_pi_times_its_radiance(normal, n_lights, tolerance) -> None:
    # E = π L. Over a triangle of 0.2 rad, as there are 400 of, the cosine at the centre is 0.3 % above the mean;
    # triangles that the horizon cuts are there by halves.
    hits = points_at(ORIGIN, np.array([normal]))
    light = light_of(hits, constant_environment(3.0), n_lights=n_lights)
    np.testing.assert_allclose(irradiance(hits, light)[0], 3.0 * np.pi, rtol=tolerance)


def test_a_coloured_sky_keeps_its_colour() -> None:
    # A channel that is a sixteenth of the largest keeps 16/512 of its own size: nine bits a channel, one exponent.
    hits = points_at(ORIGIN, UP)
    light = light_of(hits, constant_environment((16.0, 4.0, 1.0)))
    difference = irradiance(hits, light)[0] / np.pi - [16.0, 4.0, 1.0]
    assert np.abs(difference).max() < 16.0 / 512 + 16.0 * 5e-4


def test_a_sphere_above_a_plane_hides_its_share_of_the_sky() -> None:
    # The visible share of the irradiance is 1 − hR²/(h² + x²)^1.5 for a sphere of radius R ≤ h at height h.
    radius, height = 0.5, 1.0
    mesh = sphere()
    blocker = (mesh.vertices * (2 * radius) + [0.0, height, 0.0])[mesh.triangles]
    x = np.linspace(0.0, 2.0, 21)
    hits = points_at(np.stack([x, 0 * x, 0.3 * x], axis=1), UP)
    share = irradiance(hits, light_of(hits, constant_environment(1.0), blockers=blocker))[:, 0] / np.pi
    expected = 1 - height * radius**2 / (height**2 + 1.09 * x**2) ** 1.5
    # One bit a level-4 triangle: 400 of them hide behind the sphere, those on its outline by halves.
    np.testing.assert_allclose(share, expected, atol=0.01)
    assert share.mean() == pytest.approx(expected.mean(), abs=5e-4)


def test_a_square_light_at_height_one() -> None:
    # E = 0.752275 L below the middle of a unit square of light at height 1.
    lamp = square((0, 1, 0), (1, 0, 0), (0, 0, 1))
    hits = points_at(ORIGIN, UP)
    light = light_of(hits, emitters=lamp, blockers=lamp)
    np.testing.assert_allclose(irradiance(hits, light)[0], 0.752275, rtol=1e-3)


def test_a_light_shines_from_its_front_only() -> None:
    hits = points_at(ORIGIN, UP)
    turned_away = square((0, 1, 0), (0, 0, 1), (1, 0, 0))
    assert irradiance(hits, light_of(hits, emitters=turned_away)).max() == 0.0


def form_factor(lamp: np.ndarray, n_patches: int) -> float:
    """From the unit square [−½, ½]² of the plane y = 0 to the lamp, by 24 × 24 points."""
    place = (np.arange(24) + 0.5) / 24 - 0.5
    x, z = (values.ravel() for values in np.meshgrid(place, place))
    hits = points_at(np.stack([x, 0 * x, z], axis=1), UP)
    return float(irradiance(hits, light_of(hits, emitters=lamp, blockers=lamp, n_patches=n_patches)).mean() / np.pi)


def test_parallel_unit_squares() -> None:
    # The form factor of two parallel unit squares at distance 1 is 0.199825.
    assert form_factor(square((0, 1, 0), (1, 0, 0), (0, 0, 1)), 256) == pytest.approx(0.199825, rel=1e-3)


def test_perpendicular_unit_squares() -> None:
    # The form factor of two unit squares with a common edge is 0.200044. Beside that edge a leaf is as large as the
    # distance to it: cut there for each point, however few leaves there are (one cosine a patch was 4 % off with 256).
    wall = square((-0.5, 0.5, 0), (0, 1, 0), (0, 0, 1))
    for n_leaves in (2, 64, 1024):
        assert form_factor(wall, n_leaves) == pytest.approx(0.200044, rel=3e-3)
