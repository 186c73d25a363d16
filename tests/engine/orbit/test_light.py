import numpy as np
import pytest

from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.orbit import _incident_kernels as kernels
from engine.orbit.incident import LEVEL, Lamps, _tables, cosines, light, no_light
from engine.orbit.picture import look, reflected, sunlit
from engine.orbit.sky import MAP_SIDE, Sky, make_sky, texel_directions
from engine.orbit.slices import Slices, looks_isotropic, make_slices, spherical, to_shading
from engine.orbit.visibility import see_patches, upper
from engine.render.integrator import evaluate_layers
from engine.sphere import haar
from engine.sphere.geodesic import geodesic
from tests.engine.transport.by_hand import square

FLOOR = 0


def visible_powers(frame: np.ndarray, bits: np.ndarray, sky: Sky) -> np.ndarray:
    """Radiance × solid angle of each triangle (5120, 3) of a point's frame (3, 3), as its bits (1280,) see it."""
    powers = np.empty((5120, 3), np.float32)
    kernels.powers_at(frame, bits, *_tables(sky), LEVEL, powers)
    return powers


def lit(ball, sky, n: int = 5120, lamps=None):
    points, _, bits = ball
    incident = no_light(points, n)
    assert list(light(points, bits, sky, incident, lamps))[-1] == len(points)
    return incident


@pytest.fixture(scope="module")
def uneven() -> Environment:
    rows, columns = np.mgrid[0:32, 0:64]
    image = 0.2 + np.stack([rows / 32, np.sin(columns / 5) ** 2, (rows * columns) % 7 / 7], axis=2)
    return Environment(image.astype(np.float32), "test")


# ------------------------------------------------------------------------------------------------------------ the sky


def test_texels_of_the_octahedron_are_found_again() -> None:
    directions = texel_directions(16)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    # Spread over the sphere: no half of it has more than its part.
    assert np.abs((np.sign(directions)).mean(axis=0)).max() < 1e-12


def test_an_even_sky_is_even_and_has_no_sun() -> None:
    sky = make_sky(constant_environment((2.0, 1.0, 0.5)), 0.0)
    assert len(sky.sun_power) == 0
    np.testing.assert_allclose(sky.map[..., :3], np.broadcast_to([2.0, 1.0, 0.5], (MAP_SIDE, MAP_SIDE, 3)), rtol=1e-5)
    assert not make_sky(None, 0.0).map.any()


def test_one_bright_texel_is_a_sun_that_keeps_its_power(ball) -> None:
    points, _, bits = ball
    image = np.zeros((64, 128, 3), np.float32)
    image[20, 40] = 1e4
    environment = Environment(image, "test")
    sky = make_sky(environment, 0.0)
    direction = (sky.sun_direction * sky.sun_power[:, :1]).sum(axis=0)
    direction /= np.linalg.norm(direction)
    solid_angle = 2 * np.pi / 128 * (np.cos(20 * np.pi / 64) - np.cos(21 * np.pi / 64))
    assert sky.sun_power.sum() == pytest.approx(3 * 1e4 * solid_angle, rel=1e-3)
    incident = lit(ball, sky)
    # What sees it gets its power times the cosine of the triangle that holds it; the ball's shadow gets nothing.
    floor = points.i_object == FLOOR
    open_floor = floor & (np.linalg.norm(points.position[:, [0, 2]], axis=1) > 2.2)
    expected = 1e4 * solid_angle * direction[1]
    np.testing.assert_allclose(incident.irradiance[open_floor], expected, rtol=0.05)
    across = np.cross(points.position - [0.0, 0.5, 0.0], direction)
    shaded = floor & (np.linalg.norm(across, axis=1) < 0.42)
    assert shaded.sum() > 20 and incident.irradiance[shaded].max() < 1e-6 * expected
    lower = np.delete(np.arange(5120), upper())
    assert not visible_powers(points.frames[0], bits[0], sky)[lower].any()


def test_turning_the_environment_turns_what_is_looked_up() -> None:
    columns = np.arange(128) / 128 * 2 * np.pi
    image = np.broadcast_to(
        (1.0 + np.stack([np.sin(columns), np.cos(columns), 0 * columns], axis=1))[None], (64, 128, 3)
    )
    smooth = Environment(np.ascontiguousarray(image, np.float32), "test")
    directions = texel_directions(MAP_SIDE)
    looked_up = make_sky(smooth, 37.0).map.reshape(-1, 4)[:, :3]
    flat = np.abs(directions[:, 1]) < 0.8  # towards the poles the image itself is sharp
    np.testing.assert_allclose(looked_up[flat], smooth.evaluate(directions[flat], 37.0), atol=0.02)


# --------------------------------------------------------------------------------------------------- light at points


def test_an_even_sky_over_open_ground_is_pi_times_its_radiance(ball) -> None:
    points, _, _ = ball
    incident = lit(ball, make_sky(constant_environment((2.0, 1.0, 0.5)), 30.0), 20)
    corners = (points.i_object == FLOOR) & (np.abs(points.position[:, 0]) > 2.9) & (np.abs(points.position[:, 2]) > 2.9)
    hidden = (0.5 / np.linalg.norm([3.0, 0.5, 3.0])) ** 2 * 0.5 / np.linalg.norm([3.0, 0.5, 3.0])
    np.testing.assert_allclose(
        incident.irradiance[corners], np.tile(np.pi * (1 - hidden) * np.array([2.0, 1.0, 0.5]), (4, 1)), rtol=2e-3
    )


def test_all_coefficients_are_the_wavelets_of_the_powers_and_fewer_are_the_largest(ball, uneven) -> None:
    points, _, bits = ball
    sky = make_sky(uneven, 10.0)
    whole, few = lit(ball, sky), lit(ball, sky, 100)
    seeing = np.flatnonzero(whole.irradiance.any(axis=1))
    for p in seeing[:: len(seeing) // 7]:
        powers = visible_powers(points.frames[p], bits[p], sky)
        expected = haar.forward(powers.astype(np.float64))
        dense = np.zeros((5120, 3))
        np.add.at(dense, whole.number[p], whole.value[p])
        np.testing.assert_allclose(dense, expected, atol=2e-6 * np.abs(expected).max())
        assert whole.irradiance[p] == pytest.approx((powers * cosines()[:, None]).sum(axis=0), rel=1e-5)
        kept = few.number[p][few.value[p].any(axis=1)]
        best = np.flatnonzero(haar.kept(expected, 100))
        # By counting in bins: all of those kept are among the best, and few of the best are missing.
        assert np.isin(kept, best).all() and len(kept) >= 80
        assert set(range(20)) & set(best) >= set(kept[kept < 20])


def test_a_lamp_lights_a_floor_as_the_closed_form_says(ball) -> None:
    from engine.light.emitters import emitter_patches

    points, caster, _ = ball
    lamp = emitter_patches(square((2.0, 1.0, 2.0), (1, 0, 0), (0, 0, 1)), np.ones((2, 3)), 512)
    incident = lit(ball, make_sky(None, 0.0), 5120, Lamps(lamp, see_patches(points, caster, lamp)))
    floor = (points.i_object == FLOOR) & (np.linalg.norm(points.position[:, [0, 2]] - [2, 2], axis=1) < 0.4)
    towards = lamp.centre[None] - points.position[floor][:, None]
    squared = (towards**2).sum(axis=2)
    exact = (lamp.area * towards[..., 1] ** 2 / squared**2).sum(axis=1)
    np.testing.assert_allclose(incident.irradiance[floor][:, 0], exact, rtol=5e-3)


# --------------------------------------------------------------------------------------------------------- reflection


GOLD = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
MATT = make_layer(MODELS["lambert"], {"albedo": [0.5, 0.25, 1.0]})
BRUSHED = make_layer(MODELS["ward_anisotropic"])


def test_what_turns_with_its_grain_is_told_from_what_does_not() -> None:
    assert looks_isotropic([GOLD, MATT]) and looks_isotropic([make_layer(MODELS["oren_nayar"])])
    assert not looks_isotropic([GOLD, BRUSHED])


@pytest.mark.parametrize("layers", [[GOLD, MATT], [BRUSHED]], ids=["isotropic", "brushed"])
def test_slices_reflect_as_the_sum_over_triangles_does(ball, uneven, layers) -> None:
    # With all coefficients, and an outgoing direction on the grid, it is the same sum in another basis.
    points, _, bits = ball
    sky = make_sky(uneven, 0.0)
    incident, slices = lit(ball, sky), make_slices(layers, finer=0)
    assert slices.is_isotropic == (layers != [BRUSHED])
    sphere = geodesic(4)
    steps = np.arange(0, 360, 4.5 if slices.is_isotropic else 9.0)
    polar = np.radians(89.0) / 15 * np.array([2, 9, 13])
    for p in (len(points) // 3, len(points) // 2, len(points) - 1):
        powers = visible_powers(points.frames[p], bits[p], sky).astype(np.float64)
        above = upper()
        for angle in polar:
            wo = spherical(np.full(len(steps), angle), np.radians(steps))
            exact = np.stack([
                (evaluate_layers(layers, to_shading(sphere.centres[above]), np.tile(to_shading(d[None]), (2560, 1)))
                 * powers[above]).sum(axis=0)
                for d in wo[::7]
            ])  # fmt: skip
            found = slices.shade(incident, np.full(len(wo), p), wo.astype(np.float32))[::7]
            np.testing.assert_allclose(found, exact, rtol=2e-3, atol=1e-4 * exact.max())


def test_matt_slices_reflect_the_irradiance(ball, uneven) -> None:
    incident = lit(ball, make_sky(uneven, 0.0), 320)
    slices: Slices = make_slices([MATT])
    at = np.arange(0, len(incident.irradiance), 5)
    wo = np.tile(np.float32([0.3, 0.8, 0.5]), (len(at), 1))
    expected = incident.irradiance[at] * np.array([0.5, 0.25, 1.0]) / np.pi
    found = slices.shade(incident, at, wo)
    assert np.abs(found - expected).max() < 0.01 * expected.max()


def test_what_moves_shows_the_colours_of_rest_interpolated(ball_scene, ball, uneven) -> None:
    points, _, _ = ball
    incident = lit(ball, make_sky(uneven, 0.0), 320)
    seen = look(ball_scene, points, points.caster(), ball_scene.description.camera, (48, 36))
    slices = {0: make_slices([MATT]), 1: make_slices([GOLD])}
    resting, moving = (reflected(points, seen, incident, slices, at_rest) for at_rest in (True, False))
    matt = points.i_object[seen.corners[:, 0]] == 0
    np.testing.assert_allclose(moving[matt], resting[matt], rtol=0.02)
    assert np.sqrt(((moving - resting) ** 2).mean()) < 0.03 * resting.mean()


def test_a_sun_is_reflected_in_its_own_direction(ball_scene, ball) -> None:
    # A mirror-like ball shows its highlight where the half vector is the normal, narrower than a triangle.
    points, _, bits = ball
    image = np.zeros((256, 512, 3), np.float32)
    image[60, 300] = 1e5
    sky = make_sky(Environment(image, "test"), 0.0)
    sharp = make_layer(MODELS["rough_conductor"], {"alpha": 0.05})
    seen = look(ball_scene, points, points.caster(), ball_scene.description.camera, (240, 180))
    found = sunlit(points, bits, seen, sky, {1: [sharp]})
    on_ball = np.flatnonzero(points.i_object[seen.corners[:, 0]] == 1)
    normal = np.einsum("pk,pki->pi", seen.weights[on_ball], points.normal[seen.corners[on_ball]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    half = sky.sun_direction.mean(axis=0) / np.linalg.norm(sky.sun_direction.mean(axis=0)) + seen.wo[on_ball]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    assert (normal * half).sum(axis=1)[found[on_ball, 0].argmax()] > np.cos(np.radians(2.0))
    assert not found[points.i_object[seen.corners[:, 0]] == 0].any()
