import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layers, make_layer
from engine.realtime.core.shading_points import shading_points
from engine.realtime.core.terms import spherical, to_shading_frame
from engine.realtime.core.view_samples import PointMesh, interpolate
from engine.realtime.triple_product import _incident_kernels as kernels
from engine.realtime.triple_product import _slice_kernels as slice_kernels
from engine.realtime.triple_product.incident import (
    MAP_SIDE,
    SceneEmitters,
    empty_incident,
    hemisphere,
    kernel_lights,
    kernel_places,
    light_points,
    make_sky,
    texel_directions,
    with_glossy_points,
)
from engine.realtime.triple_product.pixel_reflection import (
    NO_PATCHES,
    empty_shades,
    mirror_directions,
    peak_lights_of,
    reflect_at_corners,
    reflect_at_pixels,
    shade_points,
)
from engine.realtime.triple_product.slices import Slices, slice_steps
from engine.realtime.triple_product.visibility import trace_hemispheres, trace_patches, upper_triangles
from engine.scene.description import parse_description
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import build_scene
from engine.sphere import haar
from engine.sphere.geodesic import geodesic
from tests.engine.precompute.direct.by_hand import square
from tests.engine.realtime.conftest import with_ball

FLOOR = 0


def lit(ball, sky, n: int = 5120, lamps=None, is_coarse: bool = False):
    points, _, bits = ball
    incident = empty_incident(np.ones(len(points), bool), n)
    light_points(points, bits, sky, incident, lamps, is_coarse=is_coarse)
    return incident


def visible_powers(points, p: int, bits, sky) -> np.ndarray:
    """Radiance × solid angle of each triangle (5120, 3) of point p's frame, as it is seen there; without suns."""
    powers = np.empty((5120, 3), np.float32)
    at = kernel_places(points, bits, np.full(len(points), -1, np.int32), None)
    kernels.add_sky(p, at, hemisphere(), kernel_lights(sky, None), powers, np.zeros((3, 3), np.float32))
    return powers


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
    assert len(sky.peak_power) == 0
    np.testing.assert_allclose(sky.map[..., :3], np.broadcast_to([2.0, 1.0, 0.5], (MAP_SIDE, MAP_SIDE, 3)), rtol=1e-5)
    assert not make_sky(None, 0.0).map.any()


def test_one_bright_texel_is_a_sun_that_keeps_its_power(ball) -> None:
    points, _, bits = ball
    image = np.zeros((64, 128, 3), np.float32)
    image[20, 40] = 1e4
    environment = Environment(image, "test")
    sky = make_sky(environment, 0.0)
    direction = (sky.peak_direction * sky.peak_power[:, :1]).sum(axis=0)
    direction /= np.linalg.norm(direction)
    solid_angle = 2 * np.pi / 128 * (np.cos(20 * np.pi / 64) - np.cos(21 * np.pi / 64))
    assert sky.peak_power.sum() == pytest.approx(3 * 1e4 * solid_angle, rel=1e-3)
    incident = lit(ball, sky)
    # What sees it gets its power times the cosine of the triangle that holds it; the ball's shadow gets nothing.
    floor = points.i_object == FLOOR
    open_floor = floor & (np.linalg.norm(points.position[:, [0, 2]], axis=1) > 2.2)
    expected = 1e4 * solid_angle * direction[1]
    np.testing.assert_allclose(incident.irradiance[open_floor], expected, rtol=2e-3)
    across = np.cross(points.position - [0.0, 0.5, 0.0], direction)
    shaded = floor & (np.linalg.norm(across, axis=1) < 0.42)
    assert shaded.sum() > 20 and incident.irradiance[shaded].max() < 1e-4 * expected
    lower = np.delete(np.arange(5120), upper_triangles())
    assert not visible_powers(points, 0, bits, sky)[lower].any()


def test_turning_the_environment_turns_what_is_looked_up(ball) -> None:
    columns = np.arange(128) / 128 * 2 * np.pi
    image = np.broadcast_to(
        (1.0 + np.stack([np.sin(columns), np.cos(columns), 0 * columns], axis=1))[None], (64, 128, 3)
    )
    smooth = Environment(np.ascontiguousarray(image, np.float32), "test")
    directions = texel_directions(MAP_SIDE)
    flat = np.abs(directions[:, 1]) < 0.8  # towards the poles the image itself is sharp
    turned = make_sky(smooth, 37.0)
    assert turned.map is make_sky(smooth, 0.0).map  # nothing is summed anew
    np.testing.assert_allclose(turned.map.reshape(-1, 4)[flat, :3], smooth.evaluate(directions[flat]), atol=0.02)
    points, _, bits = ball
    p = np.flatnonzero(points.i_object == FLOOR)[0]
    seen = upper_triangles()[np.unpackbits(bits[p], bitorder="little").reshape(-1, 4).all(axis=1)]
    powers = visible_powers(points, p, bits, turned)[seen] / geodesic(4).solid_angles[seen, None]
    ways = geodesic(4).centres[seen] @ points.frames[p]
    low = np.abs(ways[:, 1]) < 0.8
    np.testing.assert_allclose(powers[low], smooth.evaluate(ways[low], 37.0), atol=0.03)


def test_suns_turn_with_the_environment_and_are_as_bright_in_sum() -> None:
    image = np.zeros((64, 128, 3), np.float32)
    image[20, 40] = 1e4
    environment = Environment(image, "test")
    there, here = make_sky(environment, 90.0), make_sky(environment, 0.0)
    found = (here.peak_direction * here.peak_power[:, :1]).sum(axis=0) / here.peak_power[:, 0].sum()
    assert environment.evaluate(found[None])[0, 0] > 5e3
    found = (there.peak_direction * there.peak_power[:, :1]).sum(axis=0) / there.peak_power[:, 0].sum()
    assert environment.evaluate(found[None], 90.0)[0, 0] > 5e3
    np.testing.assert_allclose(make_sky(environment, 90.0, 2.0).peak_power, 2.0 * here.peak_power)


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
        powers = visible_powers(points, p, bits, sky)
        expected = haar.forward(powers.astype(np.float64))
        dense = np.zeros((5120, 3))
        np.add.at(dense, *whole.coefficients(p))
        np.testing.assert_allclose(dense, expected, rtol=2**-8, atol=1e-6 * np.abs(expected).max())
        sunlit = 0.0 if not len(sky.peak_power) else suns_irradiance(points, p, whole, sky)
        assert whole.irradiance[p] == pytest.approx(
            (powers[upper_triangles()] * hemisphere().cosine[:, None]).sum(axis=0) + sunlit, rel=1e-4
        )
        number, value = few.coefficients(p)
        best = np.flatnonzero(haar.select_coefficients(expected, 100))
        # By counting in bins an eighth of an octave wide, and without means that are 0: most are among the best.
        assert np.isin(number[value.any(axis=1)], best).mean() > 0.8
        means = np.flatnonzero(expected[:20].any(axis=1))
        assert set(number[: len(means)]) == set(means)
        assert (few.coefficients(p)[0][:50] == whole.coefficients(p)[0][:50]).all()


def suns_irradiance(points, p, incident, sky) -> np.ndarray:
    seen = np.unpackbits(incident.stored.peak_bits[p], count=len(sky.peak_power), bitorder="little")
    cosine = np.maximum(sky.peak_direction @ points.normal[p], 0.0)
    return (sky.peak_power * (seen * cosine)[:, None]).sum(axis=0)


def test_coarse_light_is_about_as_bright(ball, uneven) -> None:
    sky = make_sky(uneven, 10.0)
    coarse, fine = lit(ball, sky, 100, is_coarse=True), lit(ball, sky, 100)
    np.testing.assert_allclose(coarse.irradiance, fine.irradiance, rtol=0.1, atol=0.02 * fine.irradiance.max())
    assert coarse.stored.number.max() < 320


def test_diffuse_points_keep_irradiance_alone_until_they_gloss(ball, uneven) -> None:
    points, _, bits = ball
    sky, floor = make_sky(uneven, 0.0), points.i_object == FLOOR
    glossy, some = lit(ball, sky, 80), empty_incident(~floor, 80)
    light_points(points, bits, sky, some)
    np.testing.assert_array_equal(some.irradiance, glossy.irradiance)
    assert some.n_bytes < glossy.n_bytes and (some.slot[floor] == -1).all()
    grown = with_glossy_points(some, floor)
    light_points(points, bits, sky, grown, which=np.flatnonzero(floor))
    for p in (0, len(points) - 1):
        for mine, theirs in zip(grown.coefficients(p), glossy.coefficients(p), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_lamp_lights_a_floor_as_the_closed_form_says(ball) -> None:
    from engine.light.emitters import emitter_patches

    points, caster, _ = ball
    lamp = emitter_patches(square((2.0, 1.0, 2.0), (1, 0, 0), (0, 0, 1)), np.ones((2, 3)), 512)
    seen = np.empty((len(points), (len(lamp) + 7) // 8), np.uint8)
    trace_patches(points, caster, lamp, np.arange(len(points)), seen)
    incident = lit(ball, make_sky(None, 0.0), 5120, SceneEmitters(lamp, seen))
    floor = (points.i_object == FLOOR) & (np.linalg.norm(points.position[:, [0, 2]] - [2, 2], axis=1) < 0.4)
    towards = lamp.centre[None] - points.position[floor][:, None]
    squared = (towards**2).sum(axis=2)
    exact = (lamp.area * towards[..., 1] ** 2 / squared**2).sum(axis=1)
    np.testing.assert_allclose(incident.irradiance[floor][:, 0], exact, rtol=5e-3)


# --------------------------------------------------------------------------------------------------------- reflection


GOLD = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
BRUSHED = make_layer(MODELS["ward_anisotropic"])


def test_a_look_is_kept_until_what_it_shows_changes(ball_scene, ball) -> None:
    points, camera = ball[0], ball_scene.description.camera
    mesh = PointMesh(ball_scene, points)
    seen = mesh.sample_view(camera, (24, 18))
    assert mesh.sample_view(camera, (24, 18)) is seen and mesh.sample_view(camera, (25, 18)) is not seen
    again = mesh.sample_view(camera, (24, 18))
    soft = mesh.sample_view(camera, (24, 18), 4)
    assert soft is not again and mesh.sample_view(camera, (24, 18), 4) is soft
    mesh.set_emission(ball_scene)  # what it emits is in it
    assert mesh.sample_view(camera, (24, 18), 4) is not soft


@cache
def slices_of(layer: Layer, finer: int = 0) -> Slices:
    return run_to_end(slice_steps(layer, finer))


@cache
def tables_of(layer: Layer) -> slice_kernels.Tables:
    return slices_of(layer).make_tables()


def along(slices, ball, incident, p: int, wo: np.ndarray) -> np.ndarray:
    """What point p sends along directions (N, 3) of its frame, each looked up as a sample of its own."""
    points, _, _ = ball
    world = (wo * [-1.0, 1.0, -1.0] @ points.frames[p]).astype(np.float32)  # in the mirror
    found = np.empty((3 * len(wo), 3), np.float32)
    members = np.arange(3 * len(wo))
    slice_kernels.shade_corners(
        0, 1, np.array([p]), np.array([0, len(members)]), members, world, 5120, points.frames, incident.slot,
        incident.stored, peak_lights_of(make_sky(None, 0.0), incident, 0.0), NO_PATCHES, slices.make_tables(), found,
        np.zeros((0, 2), np.uint64), np.zeros(0, bool),
    )  # fmt: skip
    return found[::3]


@pytest.mark.parametrize("layers", [[GOLD], [BRUSHED], [BRUSHED, GOLD]], ids=["isotropic", "brushed", "both"])
def test_slices_reflect_as_the_sum_over_triangles_does(ball, uneven, layers) -> None:
    # With all coefficients, and an outgoing direction on the grid, it is the same sum in another basis.
    points, _, bits = ball
    sky = make_sky(uneven, 0.0)
    incident, slices = lit(ball, sky), slices_of(layers[0])
    for layer in layers[1:]:
        slices = slices + slices_of(layer)
    assert slices.is_isotropic == (BRUSHED not in layers)
    sphere, above = geodesic(4), upper_triangles()
    steps = np.arange(0, 360, 9.0)[::7]
    for p, angle in ((len(points) // 4, 2), (len(points) // 2, 9), (len(points) - 1, 20)):
        powers = visible_powers(points, p, bits, sky).astype(np.float64)
        wo = spherical(np.full(len(steps), np.radians(89.0) / 23 * angle), np.radians(steps))
        exact = np.stack([
            (evaluate_layers(layers, to_shading_frame(sphere.centres[above]), np.tile(to_shading_frame(d[None]), (2560,
            1)))
             * powers[above]).sum(axis=0)
            for d in wo
        ])  # fmt: skip
        np.testing.assert_allclose(along(slices, ball, incident, p, wo), exact, rtol=4e-3, atol=2e-3 * exact.max())


def test_what_moves_shows_the_colours_of_rest_interpolated(ball_scene, ball, uneven) -> None:
    points, _, _ = ball
    sky = make_sky(uneven, 0.0)
    incident = lit(ball, sky, 320)
    seen = PointMesh(ball_scene, points).sample_view(ball_scene.description.camera, (48, 36))
    tables, which = tables_of(GOLD), seen.of(1)
    resting = reflect_at_pixels(seen, which, incident, sky, [GOLD], tables, 0.005)
    colours, moving = np.zeros((len(points), 3), np.float32), np.zeros((48 * 36, 3), np.float32)
    shade_points(seen, np.flatnonzero(seen.visible_points()), incident, tables, 320, empty_shades(incident), colours)
    interpolate(seen, which, colours, np.ones((1, 3), np.float32), moving)
    assert np.sqrt(((moving[which] - resting) ** 2).mean()) < 0.05 * resting.mean()


def test_a_sun_is_reflected_in_its_own_direction(ball_scene, ball) -> None:
    # A mirror-like ball shows its highlight where the half vector is the normal, narrower than a triangle.
    points, _, _ = ball
    image = np.zeros((256, 512, 3), np.float32)
    image[60, 300] = 1e5
    sky = make_sky(Environment(image, "test"), 0.0)
    sharp = make_layer(MODELS["rough_conductor"], {"alpha": 0.05})
    seen = PointMesh(ball_scene, points).sample_view(ball_scene.description.camera, (240, 180))
    on_ball = seen.of(1)
    tables = run_to_end(slice_steps(sharp, 0)).make_tables()
    found = reflect_at_pixels(seen, on_ball, lit(ball, sky, 20), sky, [sharp], tables, 0.01)
    normal = np.einsum("pk,pki->pi", seen.samples.weights[on_ball], points.normal[seen.samples.corners[on_ball]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    half = sky.peak_direction.mean(axis=0) / np.linalg.norm(sky.peak_direction.mean(axis=0)) + seen.samples.wo[on_ball]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    assert (normal * half).sum(axis=1)[found[:, 0].argmax()] > np.cos(np.radians(2.0))


def test_a_highlight_stands_where_the_surface_shows_it_also_where_points_are_far_apart(tmp_path) -> None:
    # Normals of neighbours are 36 degrees apart: seen by each point as it stands, there would be three highlights.
    text = with_ball(tmp_path, 1)
    scene = build_scene(parse_description(tomllib.loads(text), "ball"), tmp_path / "ball.toml", (48, 36))
    caster = RayCaster(scene.vertices, scene.triangles)
    points = shading_points(scene, caster, 0)
    bits = np.empty((len(points), 1280), np.uint8)
    trace_hemispheres(points, caster, np.arange(len(points)), bits)
    rows, columns = np.mgrid[0:64, 0:128]
    panel = 0.1 + 20.0 * np.exp(-((rows - 16.0) ** 2 + (columns - 70.0) ** 2) / 8.0)
    sky = make_sky(Environment(np.repeat(panel[..., None], 3, axis=2).astype(np.float32), "test"), 0.0)
    sky = replace(sky, peak_power=sky.peak_power[:0], peak_direction=sky.peak_direction[:0])
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.12})
    seen = PointMesh(scene, points).sample_view(scene.description.camera, (48, 36))
    which = seen.of(1)[::5]
    incident = lit((points, caster, bits), sky)
    tables = run_to_end(slice_steps(layer)).make_tables()
    found = reflect_at_pixels(seen, which, incident, sky, [layer], tables, 0.01)
    quickly = reflect_at_pixels(seen, which, incident, sky, [layer], tables, np.inf, 96)
    above, exact = upper_triangles(), np.zeros((len(which), 3))
    for n, (j, normal) in enumerate(zip(which, seen.normals(which), strict=True)):
        tangent = np.cross([0.0, 1.0, 0.0], normal)
        tangent /= np.linalg.norm(tangent)
        frame = np.stack([tangent, normal, np.cross(tangent, normal)])
        wo = to_shading_frame((seen.samples.wo[j] @ frame.T)[None])
        for p, weight in zip(seen.samples.corners[j], seen.samples.weights[j], strict=True):
            wi = to_shading_frame(geodesic(4).centres[above] @ points.frames[p] @ frame.T)
            values = evaluate_layers([layer], wi, np.repeat(wo, len(wi), axis=0))
            exact[n] += weight * (values * visible_powers(points, p, bits, sky)[above]).sum(axis=0)
    assert np.sqrt(((found - exact) ** 2).mean()) < 0.1 * exact.mean()
    assert np.sqrt(((quickly - exact) ** 2).mean()) < 0.2 * exact.mean()


def test_all_suns_that_are_asked_are_the_sum_over_them(ball_scene, ball, uneven) -> None:
    points, _, bits = ball
    image = uneven.radiance.copy()
    image[8:11, 40:44] *= 300.0
    sky = make_sky(Environment(image, "test"), 30.0)
    assert len(sky.peak_power) > 5
    incident = lit(ball, sky, 20)
    seen = PointMesh(ball_scene, points).sample_view(ball_scene.description.camera, (48, 36))
    which, tables = seen.of(1)[::7], tables_of(GOLD)
    incident.stored.value[:] = 0  # suns alone
    found = reflect_at_pixels(seen, which, incident, sky, [GOLD], tables, -1.0)
    for j, row in zip(which, found, strict=True):
        corners, weights = seen.samples.corners[j], seen.samples.weights[j].astype(np.float64)
        frame = np.einsum("k,kij->ij", weights, points.frames[corners])
        normal = frame[1] / np.linalg.norm(frame[1])
        tangent = frame[0] - (frame[0] @ normal) * normal
        tangent /= np.linalg.norm(tangent)
        frame = np.stack([tangent, normal, np.cross(tangent, normal)])
        seen_by = np.unpackbits(incident.stored.peak_bits[corners], axis=1, bitorder="little")[:, : len(sky.peak_power)]
        wi, wo = sky.peak_direction @ frame.T, seen.samples.wo[j] @ frame.T
        values = evaluate_layers([GOLD], to_shading_frame(wi), np.tile(to_shading_frame(wo[None]), (len(wi), 1)))
        exact = ((weights @ seen_by * (wi[:, 1] > 0.0))[:, None] * sky.peak_power * values).sum(axis=0)
        np.testing.assert_allclose(row, exact, rtol=0.02, atol=1e-3 * found.max())


def test_suns_that_differ_little_are_looked_up_as_they_stand(ball_scene, ball, uneven) -> None:
    # What is matt enough differs by nothing among slices: none is asked, and all are the sum over them.
    image = uneven.radiance.copy()
    image[8:11, 40:44] *= 300.0
    sky = make_sky(Environment(image, "test"), 30.0)
    points, _, _ = ball
    incident = lit(ball, sky, 20)
    seen = PointMesh(ball_scene, points).sample_view(ball_scene.description.camera, (48, 36))
    which, tables = seen.of(1), run_to_end(slice_steps(GOLD)).make_tables()
    sharp = np.zeros((3 * len(which), 2), np.uint64)
    ways = mirror_directions(seen.samples.wo[which], seen.normals(which))
    found = reflect_at_corners(seen, which, ways, incident, peak_lights_of(sky, incident, 1e9), tables, sharp)
    assert not sharp.any()
    exact = reflect_at_pixels(seen, which, incident, sky, [GOLD], tables, -1.0)
    assert np.sqrt(((found - exact) ** 2).mean()) < 0.1 * exact.mean()
