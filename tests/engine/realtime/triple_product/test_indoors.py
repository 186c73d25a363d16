"""What walls hide from the points of a floor, and what gloss shows of the light that they reflect."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import evaluate_layers, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.terms import to_shading_frame
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.triple_product.view_radiance import Quality, mirrored_light
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene
from engine.sphere.geodesic import geodesic
from tests.engine.realtime.conftest import BLOCK
from tests.scene_text import camera, facing_up, placed, scaled

WHITE = make_layer(MODELS["lambert"], {"albedo": [1.0, 1.0, 1.0]})
FLOOR = placed("floor", "quad", facing_up(6))
WALL = placed("wall", "cube", scaled((0.2, 2, 8), (0, 1, 0)))  # across the floor, at x = 0


def made(text: str, n_points: int, light: SkyState | None = None) -> Orbit:
    scene = build_scene(parse_description(tomllib.loads(text), "scene"), Path("scene.toml"), (32, 24))
    orbit = Orbit(scene, n_points=n_points, n_coefficients=64)
    orbit.set_light(light or SkyState(constant_environment((1.0, 1.0, 1.0))))
    orbit.set_layers(dict.fromkeys(range(len(scene.smooth)), [WHITE]))
    for _ in orbit.work():
        pass
    return orbit


@pytest.fixture(scope="module")
def block() -> Orbit:
    return made(BLOCK, 1000)


def test_what_is_beneath_a_block_is_buried_and_nothing_else(block) -> None:
    points = block.lit.points
    beneath = np.abs(points.position[:, [0, 2]]).max(axis=1)
    floor = (points.i_object == 0) & (points.normal[:, 1] > 0.0)
    np.testing.assert_array_equal(points.buried[floor & (beneath < 0.499)], True)
    np.testing.assert_array_equal(points.buried[floor & (beneath > 0.501)], False)
    assert (floor & points.buried).sum() > 20 and not points.buried[
        (points.i_object == 1) & (points.position[:, 1] > 0.1)
    ].any()


def test_pictures_are_drawn_of_no_buried_point_beside_others(block) -> None:
    points = block.lit.points
    shown, hidden = points.shown[:, 0], points.buried[points.triangles[:, 0]]
    some = hidden.any(axis=1) & ~hidden.all(axis=1)
    assert some.sum() > 10 and not points.buried[shown[some]].any()
    np.testing.assert_array_equal(shown[~hidden], points.triangles[:, 0][~hidden])
    # So no dark line is drawn along the block: the floor beside it sees half of the sky.
    light = block.lit.incident.irradiance[shown[some]].max(axis=2)
    assert light.min() > 0.3 * np.pi


def test_a_place_asks_the_corners_on_its_own_side_of_a_wall() -> None:
    orbit = made(camera((2.0, 3.0, 2.0), 60, (32, 24), (0.5, 0.0, 0.0)) + FLOOR + WALL, 0)
    mesh, points = orbit.lit.mesh, orbit.lit.points
    x, z = np.meshgrid([-2.0, -0.5, 0.5, 2.0], np.linspace(-1.5, 1.4, 8))
    origins = np.stack([x.ravel(), np.full(x.size, 0.5), z.ravel()], axis=1).astype(np.float32)
    met, _ = mesh.trace(origins, np.tile(np.float32([0.0, -1.0, 0.0]), (x.size, 1)))
    np.testing.assert_allclose(met.weights.sum(axis=1), 1.0, rtol=1e-5)
    beyond = points.position[met.corners][..., 0] * x.ravel()[:, None] < 0.0
    assert not met.weights[beyond].any() and beyond.any()


@pytest.mark.parametrize("quality", ["rest", "still"])
def test_shadows_of_the_sun_are_found_between_points(quality: Quality) -> None:
    # A floor of two triangles under a slat: whatever its four points know, pixels know the shadow's edges.
    image = np.zeros((512, 1024, 3), np.float32)
    image[128, 512] = 1e5
    light = SkyState(Environment(image, "sun"))
    slat = placed("slat", "cube", scaled((3, 0.02, 0.3), (0, 1, 0)))
    orbit = made(camera((0.0, 6.0, 0.6), 45, (32, 24)) + FLOOR + slat, 0, light)
    eye = orbit.scene.description.camera
    picture = orbit.draw(eye, (96, 72), quality).max(axis=2)
    seen = orbit.lit.mesh.sample_view(eye, (96, 72), 16)
    whole = seen.order[(seen.share[seen.order] == 1.0) & (seen.samples.i_object[seen.order] == 0)]
    places, toward = seen.places(whole), orbit.sky_map.peak_direction[0]
    above = places + (1.0 - places[:, 1:2]) / toward[1] * toward
    inside = np.maximum(np.abs(above[:, 0]) / 1.5, np.abs(above[:, 2]) / 0.15)
    value = picture.ravel()[seen.pixel[whole]]
    assert (inside < 0.6).sum() > 30
    assert value[inside < 0.6].max() < 0.02 * value[inside > 1.5].min()


def test_sunlight_through_a_gap_is_found_between_points() -> None:
    # Two plates shade the floor's four points; through 30 cm between them the sun shines on its middle.
    image = np.zeros((512, 1024, 3), np.float32)
    image[128, 512] = 1e5
    plates = "".join(placed(f"plate {z:g}", "cube", scaled((20, 0.02, 9.7), (0, 1, z))) for z in (-5.0, 5.0))
    orbit = made(camera((0.0, 0.9, 3.0), 60, (32, 24), (0, 0, 1)) + FLOOR + plates, 0, SkyState(Environment(image, "")))
    eye = orbit.scene.description.camera
    picture, seen = orbit.draw(eye, (96, 72)).max(axis=2), orbit.lit.mesh.sample_view(eye, (96, 72))
    floor, toward = seen.of(0), orbit.sky_map.peak_direction[0]
    places = seen.places(floor)
    across = np.abs(places[:, 2] + (1.0 - places[:, 1]) / toward[1] * toward[2])  # of the gap's middle, at 1 m height
    value = picture.ravel()[floor]
    assert (across < 0.1).sum() > 100 and (across > 0.2).sum() > 100
    assert value[across > 0.2].max() < 0.02 * value[across < 0.1].min()


def whole_floor(orbit: Orbit, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) of pixels that the floor fills, and what a still shows there (N,)."""
    eye = orbit.scene.description.camera
    picture = orbit.draw(eye, size, "still").mean(axis=2)
    seen = orbit.lit.mesh.sample_view(eye, size, 16, True)
    whole = seen.order[(seen.share[seen.order] == 1.0) & (seen.samples.i_object[seen.order] == 0)]
    return seen.places(whole).astype(np.float64), picture.ravel()[seen.pixel[whole]]


def passes_slat(places: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Whether rays (N, K, 3) from places on the floor pass the slat, 3 m by 30 cm in 1 m height."""
    crossed = places[:, None] + towards / towards[..., 1:2]
    return (np.abs(crossed[..., 0]) > 1.5) | (np.abs(crossed[..., 2]) > 0.15)


ONCE = "bounces = 1\n"
SLAT = placed("slat", "cube", scaled((3, 0.002, 0.3), (0, 1, 0)))


def test_a_shadow_is_as_blurred_as_its_sun_is_wide() -> None:
    # A sun of one texel, interpolated, over a floor whose four points know nothing of the slat's shadow.
    image = np.zeros((256, 512, 3), np.float32)
    image[64, 256] = 1e4
    above = camera((0.0, 6.0, 1.3), 8, (32, 24), (0.0, 0.0, 1.0), ONCE)
    orbit = made(above + FLOOR + SLAT, 0, SkyState(Environment(image, "sun")))
    places, found = whole_floor(orbit, (48, 36))
    row, column = (axis.ravel() for axis in np.meshgrid(np.arange(62.5, 65.5, 0.05), np.arange(254.5, 257.5, 0.05)))
    theta, phi = np.pi * (row + 0.5) / 256, 2.0 * np.pi * ((column + 0.5) / 512 - 0.5)
    towards = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
    weight = orbit.light.environment.evaluate(towards)[:, 0] * np.sin(theta) * towards[:, 1]
    share = np.concatenate([passes_slat(some, towards[None]) @ weight for some in np.array_split(places, 16)])
    share, found = share / weight.sum(), found / found.max()
    assert ((share > 0.1) & (share < 0.9)).sum() > 100
    assert np.sqrt(((found - share) ** 2).mean()) < 0.03


def test_shadows_of_a_lamp_are_found_between_points() -> None:
    # By points alone it is 3.7 % off.
    lamp = "0.6,0,0,0, 0,0,-1,2, 0,0.6,0,-2, 0,0,0,1"  # looks down
    panel = placed("lamp", "quad", lamp, "emission = [10.0, 10.0, 10.0]\n")
    scene = camera((0.0, 4.0, 2.5), 45, (32, 24), (0.0, 0.0, 1.6), ONCE) + FLOOR + SLAT + panel
    orbit = made(scene, 500, SkyState(None))
    places, found = whole_floor(orbit, (48, 36))
    x, z = (axis.ravel() for axis in np.meshgrid(*2 * [(np.arange(24) + 0.5) / 24 * 0.6 - 0.3]))
    towards = np.stack([x, np.full(len(x), 2.0), z - 2.0], axis=1) - places[:, None]
    squared = (towards**2).sum(axis=2)
    sent = 10.0 * 0.6**2 / len(x) * towards[..., 1] ** 2 / squared**2 / np.pi  # white, of one bounce's light
    sent, passes = sent.sum(axis=1), (sent * passes_slat(places, towards)).sum(axis=1)
    assert (passes < 0.5 * sent).sum() > 50
    assert np.sqrt(((found - passes) ** 2).mean()) < 0.02 * passes.mean()


def test_points_know_the_suns_that_they_see() -> None:
    # Not to the 1.4 degrees of a triangle: as a ray to each sun has it.
    image = np.zeros((256, 512, 3), np.float32)
    image[64, 256] = 1e5
    slat = placed("slat", "cube", scaled((3, 0.02, 0.3), (0, 1, 0)))
    orbit = made(camera((0.0, 6.0, 0.6), 45, (32, 24)) + FLOOR + slat, 600, SkyState(Environment(image, "sun")))
    lit, sky = orbit.lit, orbit.sky_map
    floor = np.flatnonzero((lit.points.i_object == 0) & (lit.points.normal[:, 1] > 0.0) & ~lit.points.buried)
    assert 0 < len(sky.peak_power) <= 8
    bits = np.unpackbits(lit.incident.stored.peak_bits[floor], axis=1, bitorder="little")
    for s, direction in enumerate(sky.peak_direction):
        free = ~lit.caster.occluded(lit.points.lifted[floor], np.tile(direction, (len(floor), 1)))
        np.testing.assert_array_equal(bits[:, s], free)
        assert 0.01 < (~free).mean() < 0.5


@pytest.mark.parametrize("quality", ["rest", "still"])
def test_gloss_shows_what_stands_around_it(quality: str) -> None:
    # Where every surface sends 1, a layer sends its directional albedo: the integral of its BRDF times the cosine.
    shell = placed("shell", "cube", scaled(6))
    tile = placed("tile", "quad", facing_up(2, (0, -1, 0)))
    orbit = made(camera((0.0, 1.4, 2.0), 30, (32, 24), (0.0, -1.0, 0.0)) + shell + tile, 200)
    lit, layers = orbit.lit, [make_layer(MODELS["rough_conductor"], {"alpha": 0.2})]
    seen = lit.mesh.sample_view(orbit.scene.description.camera, (32, 24), 4)
    which = seen.of(1)
    lit.sent_on[:] = 1.0
    found = mirrored_light(seen, which, lit, orbit.scene, 1, layers, quality)
    centres, solid = geodesic(5).centres, geodesic(5).solid_angles
    up = centres[:, 1] > 0.0
    wo = to_shading_frame(seen.samples.wo[which])  # the tile's normal is +Y, as the sphere's
    rows = np.linspace(0, len(which) - 1, 12).astype(int)
    expected = [
        solid[up] @ evaluate_layers(layers, to_shading_frame(centres[up]), np.tile(wo[r], (up.sum(), 1))) for r in rows
    ]
    np.testing.assert_allclose(found.mean(axis=0), np.mean(expected, axis=0), rtol=0.04 if quality == "rest" else 0.02)


def test_bounces_give_back_what_others_show_of_them(block) -> None:
    # One bounce less than the eye sees: of two, what the lights alone send.
    block.set_bounces(2)
    for _ in block.work():
        pass
    lit = block.lit
    np.testing.assert_allclose(lit.sent_on, lit.incident.irradiance / np.pi, rtol=1e-4, atol=1e-6)
    block.set_bounces(4)
