import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.light.environment import Environment, constant_environment, texel_solid_angles, triangle_integrals
from engine.sphere.geodesic import geodesic, locate, triangle_first_moments
from tests.naive.sphere import directions_of_texels, integral_by_descendants

SIZES = [(1, 1), (1, 7), (9, 1), (3, 5), (17, 31), (64, 128), (128, 256)]


def noise(height: int, width: int, seed: int = 2) -> Environment:
    return Environment(np.random.default_rng(seed).random((height, width, 3)), "noise")


def total_power(environment: Environment) -> np.ndarray:
    height, width, _ = environment.radiance.shape
    return np.einsum("hwc,h->c", environment.radiance.astype(np.float64), texel_solid_angles(height, width))


def one_texel(height: int, width: int, row: int, column: int) -> Environment:
    image = np.zeros((height, width, 3), np.float32)
    image[row, column] = [1e5, 2e5, 4e5]
    return Environment(image, "sun")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("level", [0, 1, 4])
def test_constant_sky_gives_solid_angles(size: tuple[int, int], level: int) -> None:
    sky = Environment(np.full((*size, 3), 3.0), "sky")
    # L times the triangle's own solid angle, whatever the texels.
    expected = 3.0 * geodesic(level).solid_angles
    for rotation in (0.0, 17.3):
        found = triangle_integrals(sky, rotation, level)
        np.testing.assert_allclose(found, np.tile(expected[:, None], 3), rtol=1e-11)


def test_constant_sky_at_the_finest_level() -> None:
    found = triangle_integrals(Environment(np.ones((256, 512, 3)), "sky"), 0.0, 7)
    np.testing.assert_allclose(found[:, 1], geodesic(7).solid_angles, rtol=1e-9)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("level", [0, 2, 5])
def test_no_light_is_lost(size: tuple[int, int], level: int) -> None:
    environment = noise(*size)
    for rotation in (0.0, 90.0, -123.456):
        found = triangle_integrals(environment, rotation, level)
        # The triangles tile the sphere: together they hold what the texels hold.
        np.testing.assert_allclose(found.sum(axis=0), total_power(environment), rtol=1e-12)


@pytest.mark.parametrize(("row", "column"), [(0, 0), (0, 100), (127, 255), (64, 255), (64, 0), (63, 128), (40, 77)])
@pytest.mark.parametrize("level", [0, 4, 7])
def test_a_sun_of_one_texel_keeps_its_light_and_place(row: int, column: int, level: int) -> None:
    sun = one_texel(128, 256, row, column)
    found = triangle_integrals(sun, 0.0, level)
    # L Omega of that texel, at the poles and on the seam too ...
    expected = np.array([1e5, 2e5, 4e5]) * texel_solid_angles(128, 256)[row]
    np.testing.assert_allclose(found.sum(axis=0), expected, rtol=1e-9)
    # ... in the triangles it touches, none farther from it than its own half diagonal.
    lit = np.flatnonzero(found[:, 0] > 1e-9 * expected[0])
    corner = np.pi / 128.0
    centre = directions_of_texels(128, 256)[row, column]
    edge = np.arctan(2.0) / 2**level
    angles = np.arccos(np.clip(geodesic(level).centres[lit] @ centre, -1.0, 1.0))
    assert angles.max() < corner + edge


def test_against_the_sum_over_many_descendants() -> None:
    environment = noise(6, 11)
    found = triangle_integrals(environment, 0.0, 1)
    slow = integral_by_descendants(environment, 1, 6)
    # 64 rows of points in each triangle of 0.16 sr: where a row lies along a texel's edge it may fall to the wrong
    # side, 1/64 of the light at most; elsewhere errors are far smaller.
    np.testing.assert_allclose(found, slow, rtol=0, atol=0.16 / 64)
    assert np.sqrt(np.mean((found - slow) ** 2)) < 2e-4


def test_children_add_up_to_their_parent() -> None:
    environment = noise(20, 33)
    fine, coarse = triangle_integrals(environment, 30.0, 4), triangle_integrals(environment, 30.0, 3)
    np.testing.assert_allclose(fine.reshape(-1, 4, 3).sum(axis=1), coarse, rtol=1e-11)


def test_a_linear_field_gives_first_moments() -> None:
    height, width = 400, 800
    image = 1.0 + directions_of_texels(height, width)
    found = triangle_integrals(Environment(image, "linear"), 0.0, 2)
    corners = geodesic(2).vertices[geodesic(2).triangles]
    expected = geodesic(2).solid_angles[:, None] + triangle_first_moments(corners)
    # The integral of 1 + d over a triangle; texels of 0.008 radians err to second order inside and at the edges.
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_rotation_by_a_symmetry_of_the_sphere_permutes_triangles() -> None:
    environment = noise(15, 40)
    level = 3
    sphere = geodesic(level)
    # The icosahedron stands on a vertex: a fifth of a turn about Y maps the hierarchy onto itself.
    for fifths in (1, 2, 4):
        r = np.radians(72.0 * fifths)
        turn = np.array([[np.cos(r), 0.0, np.sin(r)], [0.0, 1.0, 0.0], [-np.sin(r), 0.0, np.cos(r)]])
        image_of = locate(sphere.centres @ turn.T, level)
        rotated = triangle_integrals(environment, 72.0 * fifths, level)
        np.testing.assert_allclose(rotated[image_of], triangle_integrals(environment, 0.0, level), rtol=1e-10)


def test_rotation_agrees_with_a_shifted_map() -> None:
    environment = noise(10, 36)
    # Counter-clockwise from above moves what is seen in the centre column to the left: 10 degrees are one column of 36.
    shifted = Environment(np.roll(environment.radiance, -3, axis=1), "shifted")
    np.testing.assert_allclose(
        triangle_integrals(environment, 30.0, 3), triangle_integrals(shifted, 0.0, 3), rtol=0, atol=1e-14
    )


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1e5, 1e8])
def test_linear_in_radiance(scale: float) -> None:
    base, other = noise(31, 64, 1), noise(31, 64, 5)
    scaled = Environment(base.radiance.astype(np.float64) * scale, "scaled")
    found, reference = triangle_integrals(scaled, 5.0, 4), triangle_integrals(base, 5.0, 4)
    np.testing.assert_allclose(found, reference * scale, rtol=1e-6)
    both = Environment(base.radiance + other.radiance, "sum")
    np.testing.assert_allclose(
        triangle_integrals(both, 5.0, 4), reference + triangle_integrals(other, 5.0, 4), rtol=1e-6
    )


def test_a_faint_sky_beside_a_bright_sun() -> None:
    image = np.ones((64, 128, 3), np.float32)
    image[20, 30] = 1e8
    found = triangle_integrals(Environment(image, "day"), 0.0, 6)
    lit = triangle_integrals(one_texel(64, 128, 20, 30), 0.0, 6)[:, 0] > 0.0
    # Away from the sun every triangle still has the sky's share, though a sun 1e8 times as bright is in its column.
    far = ~lit & (np.abs(geodesic(6).centres @ directions_of_texels(64, 128)[20, 30]) < 0.99)
    np.testing.assert_allclose(found[far, 0], geodesic(6).solid_angles[far], rtol=1e-4)


def test_black_is_exactly_black() -> None:
    assert not triangle_integrals(constant_environment(0.0), 12.0, 4).any()


def test_half_black_never_goes_negative() -> None:
    image = np.zeros((50, 100, 3), np.float32)
    image[:25] = 1e6
    found = triangle_integrals(Environment(image, "dome"), 3.0, 5)
    below = (geodesic(5).vertices[geodesic(5).triangles][..., 1] < 1e-12).all(axis=1)
    assert found.min() >= 0.0
    # No triangle straddles the horizon: below it there is nothing but rounding of 1e6.
    assert found[below].max() < 1e-8 < 1.0 < found[~below].min()


def test_huge_maps_are_averaged_first() -> None:
    environment = one_texel(2200, 5, 1100, 2)
    np.testing.assert_allclose(triangle_integrals(environment, 0.0, 2).sum(axis=0), total_power(environment), rtol=1e-6)


def test_irradiance_under_a_constant_sky_is_pi_times_radiance() -> None:
    integrals = triangle_integrals(constant_environment(2.0), 0.0, 6)
    normals = np.random.default_rng(9).normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosines = np.maximum(normals @ geodesic(6).centres.T, 0.0)
    # E = pi L; the midpoint rule over 81,920 triangles errs by the square of their size.
    np.testing.assert_allclose(cosines @ integrals, np.full((20, 3), 2.0 * np.pi), rtol=1e-4)


@settings(max_examples=30, deadline=None)
@given(
    height=st.integers(1, 20),
    width=st.integers(1, 20),
    rotation=st.floats(-1000.0, 1000.0),
    level=st.integers(0, 3),
    seed=st.integers(0, 99),
)
def test_any_map_any_rotation(height: int, width: int, rotation: float, level: int, seed: int) -> None:
    environment = noise(height, width, seed)
    found = triangle_integrals(environment, rotation, level)
    bounds = environment.radiance.min(axis=(0, 1)), environment.radiance.max(axis=(0, 1))
    omega = geodesic(level).solid_angles[:, None]
    # Finite, complete, and in each triangle a mean of the map's values.
    np.testing.assert_allclose(found.sum(axis=0), total_power(environment), rtol=1e-11)
    assert (found >= bounds[0] * omega * (1.0 - 1e-9)).all() and (found <= bounds[1] * omega * (1.0 + 1e-9)).all()
