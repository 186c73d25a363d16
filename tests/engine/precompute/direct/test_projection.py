"""From light and visibility to bands: the dense twin, and every knob at its ends."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from engine.core.frames import local_frames
from engine.curve.bands import band_values
from engine.light.emitters import emitter_patches
from engine.light.environment import Environment, constant_environment, triangle_integrals
from engine.material import MODELS
from engine.material._kernels import gamma, quotient_cosine
from engine.material.kinds import (
    GAMMA_ALPHA,
    GAMMA_BETA,
    GAMMA_RATIO,
    GAMMA_WIDTH,
    PHI_D,
    PHI_H,
    SLOPE_U,
    SLOPE_V,
    THETA_D,
    THETA_H,
    THETA_I,
    THETA_O,
    THETA_R,
)
from engine.material.layer import evaluate_layers, make_layer
from engine.precompute.direct._angle_kernels import fill_gammas, weigh
from engine.precompute.direct._share_kernels import _add_row, make_spots, mean_and_spread, share_out
from engine.precompute.direct.projection import LayerShape, project_layer
from engine.sphere.geodesic import geodesic
from tests.engine.precompute.direct.by_hand import bands_of, irradiance, light_of, points_at, project, square
from tests.naive.curves import hats
from tests.naive.transport import dense_transport, visible_shares

UP = np.array([[0.0, 1.0, 0.0]])
ORIGIN = np.zeros((1, 3))
LEANING_EYE = np.array([[0.6, 0.8, 0.1]])
ANGLES = (
    THETA_I, THETA_R, THETA_H, THETA_D, GAMMA_ALPHA, GAMMA_BETA, GAMMA_RATIO, THETA_O, SLOPE_U, SLOPE_V, PHI_H,
    GAMMA_WIDTH, PHI_D,
)  # fmt: skip
# A model, parameters away from the defaults, and bands of one curve or two.
LAYERS = [
    ("lambert", {}, (16, 1)),
    ("phong", {}, (32, 1)),
    ("blinn_phong", {}, (64, 1)),
    ("rough_conductor", {"alpha": 0.2}, (32, 8)),
    ("rough_conductor", {"distribution": "beckmann", "alpha": 0.4}, (32, 8)),
    ("cook_torrance", {}, (32, 8)),
    ("ashikhmin_shirley", {}, (32, 32)),
    ("ashikhmin_shirley_ratio", {}, (32, 1)),
    ("ashikhmin_shirley_ratio", {"ratio": 0.1}, (32, 1)),
]
LAYERS += [
    (name, {}, (32, 8) if len(model.factors) > 1 else (32, 1))
    for name, model in MODELS.items() if name not in [layer[0] for layer in LAYERS]
]  # fmt: skip


@cache
def noise(seed: int = 0) -> Environment:
    return Environment(np.random.default_rng(seed).random((16, 32, 3)) ** 4, "noise")


def directions(n: int, seed: int) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


# ------------------------------------------------------------------------------------------------ shares of triangles


@pytest.mark.parametrize(("model", "parameters", "bands"), LAYERS)
def test_bands_agree_with_the_dense_twin(model, parameters, bands) -> None:
    layer = make_layer(MODELS[model], parameters)
    hits = points_at(ORIGIN, np.array([[0.2, 1.0, 0.1]]), LEANING_EYE)
    blocker = square((0.5, 0.5, 0), (0, 1, 0), (0, 0, 1))
    light = light_of(hits, noise(), blockers=blocker, n_lights=1500)
    found = bands_of(project(hits, light, layer, bands))[0]
    shape = LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), bands)
    expected = dense_transport(hits, 0, light, shape, n_samples=60)
    # All the light arrives: what differs is single precision and nine bits a channel, half of the last one at most.
    np.testing.assert_allclose(found.sum(axis=(0, 1)), expected.sum(axis=(0, 1)), rtol=2.0**-10)
    # And in its bands: up to a band's edge there is the same light to 2 % of all, the more so the finer the lights;
    # an angle is taken as linear over a light, and as seen from the light's centre of brightness.
    for axis in (1, 0):
        below, below_expected = (np.cumsum(u.sum(axis=axis), axis=0) for u in (found, expected))
        assert np.abs(below - below_expected).max() < 0.015 * expected.sum(axis=(0, 1)).max()
    assert np.abs(found - expected).sum() < 0.15 * expected.sum()


def test_finer_lights_bring_the_bands_closer_to_the_dense_twin() -> None:
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.2})
    shape = LayerShape("rough_conductor", tuple(layer.quotient_parameters().tolist()), (32, 1))
    hits = points_at(ORIGIN, UP, LEANING_EYE)

    def difference(n_lights: int) -> float:
        light = light_of(hits, noise(), n_lights=n_lights)
        expected = dense_transport(hits, 0, light, shape, n_samples=150)
        found = bands_of(project(hits, light, layer, (32, 1)))[0]
        return float(np.abs(found - expected).sum() / expected.sum())

    assert difference(1600) < 0.6 * difference(200)


@pytest.mark.parametrize(("model", "parameters", "bands"), LAYERS)
@pytest.mark.parametrize("n_bands", [1, 2, 256])
def test_shares_sum_to_one(model, parameters, bands, n_bands) -> None:
    # However many bands, the light in them is all the light: also of the coarse triangle around the pole of γ, which
    # every environment of 20 lights has. Among many bands that one is split, and each part has a quotient of its own:
    # there lights are so fine that it differs by less than a thousandth.
    layer = make_layer(MODELS[model], parameters)
    hits = points_at(ORIGIN, UP, LEANING_EYE)
    light = light_of(hits, noise(4), n_lights=5120 if n_bands > 2 else 20)
    sky, q = light.lighting.sky, layer.quotient_parameters()
    frame = np.stack([hits.tangent[0], np.cross(hits.normal[0], hits.tangent[0]), hits.normal[0]]).astype(float)
    seen = visible_shares(light, 0)
    weights = [quotient_cosine(layer.model.number, q, *(frame @ c), *(frame @ hits.wo[0])) for c in sky.centres.T]
    expected = (np.array(weights) * seen) @ sky.colours
    asked = (n_bands, 1) if bands[1] == 1 else (n_bands, min(n_bands, 64))
    found = bands_of(project(hits, light, layer, asked))[0].sum(axis=(0, 1))
    # An entry is off by 2⁻⁹ of its largest channel at most, and with one band there is but one entry.
    np.testing.assert_allclose(found, expected, atol=expected.max() * (2**-9 + 1e-5), rtol=0)


@pytest.mark.parametrize("exponent", [2, 10, 40, 200])
def test_light_around_the_pole(exponent) -> None:
    # θ_i runs from the normal: with f = cos^n θ_i, E = ∫ f cosθ dω = 2π / (n + 2). The twelve corners of the sphere are
    # where five triangles meet, and one of them is up.
    hits = points_at(ORIGIN, UP)
    light = light_of(hits, constant_environment(1.0), n_lights=1280, tolerance=0.1)
    bands = bands_of(project(hits, light, make_layer(MODELS["lambert"]), (32, 1)))[0, :, 0, 0] * light.lighting.unit
    lobe = lambda gamma: np.repeat(np.cos(gamma)[:, None] ** exponent, 3, axis=1)  # noqa: E731
    values = band_values(lobe, 32, by_solid_angle=True)
    assert np.pi * bands @ values[:, 0] == pytest.approx(2 * np.pi / (exponent + 2), rel=0.02)


@njit
def added(flat: np.ndarray, at: int, shares: np.ndarray, colour: np.ndarray) -> None:
    _add_row(flat, np.uint64(at), shares[0], shares[1], shares[2], colour[0], colour[1], colour[2])


def test_a_row_of_three_hats_gets_nine_sums_and_nothing_beside_them() -> None:
    # At any place of an array: the vector of eight numbers is not aligned.
    generator = np.random.default_rng(5)
    for at in range(12):
        flat = generator.random(21, np.float32)
        shares, colour = generator.random((2, 3), np.float32)
        expected = flat.copy()
        expected[at : at + 9] += np.outer(shares, colour).ravel()
        added(flat, at, shares, colour)
        np.testing.assert_allclose(flat[at : at + 9], expected[at : at + 9], rtol=2e-7)
        beside = np.delete(np.arange(21), np.arange(at, at + 9))
        np.testing.assert_array_equal(flat[beside], expected[beside])


@settings(deadline=None, max_examples=200, derandomize=True)
@given(corners=st.tuples(*[st.floats(0.0, 8.0, width=32)] * 3), n_bands=st.sampled_from([2, 4, 8]))
def test_a_triangle_is_shared_out_as_by_the_closed_form(corners, n_bands) -> None:
    # Against the hats' means over the triangle, by 2,500 points: all of the light, and each share to a quarter of it:
    # two points stand for a piece of half a band's spread.
    corners = np.array(corners) * (n_bands / 8.0)
    place = (np.arange(50) + 0.5) / 50
    u, v = (values.ravel() for values in np.meshgrid(1 - np.sqrt(place), place))
    v = v * (1 - u)
    inside = corners[0] * (1 - u - v) + corners[1] * u + corners[2] * v
    expected = hats(inside, n_bands, domain=n_bands).mean(axis=0)
    mean, spread = mean_and_spread(*corners.astype(np.float32))
    found, one, spots = np.zeros((n_bands + 2, 1, 3), np.float32), np.float32(1.0), make_spots(4)
    spots.light[0], spots.weight[0], spots.mean_a[0], spots.spread_a[0] = 0, one, mean, spread
    share_out(found, np.ones((1, 3), np.float32), 1, spots, one, one)
    assert found[:, 0, 0].sum() == pytest.approx(1.0, abs=1e-5)
    assert np.abs(found[:n_bands, 0, 0] - expected).max() < 0.25 and not found[n_bands:].any()


def test_a_narrow_lobe_mirrors_the_sky_finer_than_its_lights_are() -> None:
    # A lobe half as high 1.7° off the mirrored eye's half vector, under a sky of 3° texels cut into lights of 7°: the
    # parts they are split into where the lobe points have the sky's light, and the picture is that of brute force over
    # 81,920 directions. Where the parts of a light are all alike it is many times further off.
    sky = Environment(np.random.default_rng(5).random((60, 120, 3)) ** 3, "texels")
    eyes = directions(24, 8)
    eyes[:, 1] = np.abs(eyes[:, 1]) + 0.4
    hits = points_at(np.zeros((24, 3)), np.repeat(UP, 24, axis=0), eyes)
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.045})
    wi, power = geodesic(6).centres, triangle_integrals(sky, 0.0, 6)
    frames = local_frames(hits.tangent, hits.normal)
    expected = np.stack([
        (evaluate_layers([layer], wi @ frame.T, np.tile(frame @ wo, (len(wi), 1))) * power).sum(axis=0)
        for frame, wo in zip(frames, hits.wo.astype(float), strict=True)
    ])  # fmt: skip
    light = light_of(hits, sky, n_lights=1280)
    bare = light.lighting.sky._replace(tree=np.zeros((0, 6), np.float32))
    curves = [layer.coefficients(name, n) for name, n in (("theta_h", 128), ("theta_d", 16))]
    errors = []
    for each in (light, replace(light, lighting=replace(light.lighting, sky=bare))):
        picture = project(hits, each, layer, (128, 16)).radiance(*curves) * light.lighting.unit * layer.scale()
        errors.append(float(np.sqrt(((picture - expected) ** 2).mean()) / expected.mean()))
    assert errors[0] < 0.03 and errors[1] > 3 * errors[0]


@pytest.mark.parametrize("n_bands", [64, 128])
@pytest.mark.parametrize(("hides_from", "limit"), [(None, 0.004), (0.04, 0.035)])
def test_a_sharp_highlight_shows_a_lamp_with_its_edges(hides_from, limit, n_bands) -> None:
    # A mirror of roughness 0.05, tilted so that a lamp of 17° passes through its lobe, is lit as by 16,384 parts of the
    # lamp; also where a board hides what is beyond x = 0.04. With a cut for matt surfaces it was 0.6 % (64 bands) and
    # 1.1 % off (128), 7 % with the board.
    lamp, eye = square((0, 1, 0), (0.3, 0, 0), (0, 0, 0.3)), np.array([-0.5, 0.8, 0.1])
    board = None if hides_from is None else square((0.5 * hides_from + 1.0, 0.5, 0), (2, 0, 0), (0, 0, 2))
    half = np.array([0.0, 1.0, 0.0]) + eye / np.linalg.norm(eye)
    tilts = (np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) - 2.5) * 0.05
    normals = half / np.linalg.norm(half) + np.insert(tilts, 1, 0.0, axis=1)
    hits = points_at(np.zeros((36, 3)), normals, eye)
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.05})
    parts = emitter_patches(lamp, np.ones((2, 3)), 1 << 14)
    middles = parts.corners.mean(axis=1, dtype=np.float64)
    middles, area = middles[middles[:, 0] < (hides_from or 1.0)], float(parts.area[0])
    distance = np.linalg.norm(middles, axis=1, keepdims=True)
    wi, solid_angle = middles / distance, area * middles[:, 1] / distance[:, 0] ** 3
    expected = np.stack([
        (evaluate_layers([layer], wi @ frame.T, np.tile(frame @ wo, (len(wi), 1))) * solid_angle[:, None]).sum(axis=0)
        for frame, wo in zip(local_frames(hits.tangent, hits.normal), hits.wo.astype(float), strict=True)
    ])  # fmt: skip
    light = light_of(hits, emitters=lamp, blockers=lamp if board is None else np.concatenate([lamp, board]))
    curves = [layer.coefficients(name, n) for name, n in (("theta_h", n_bands), ("theta_d", 16))]
    picture = project(hits, light, layer, (n_bands, 16)).radiance(*curves) * light.lighting.unit * layer.scale()
    assert np.sqrt(((picture - expected) ** 2).mean()) < limit * expected.mean()
    assert picture.max() == pytest.approx(expected.max(), rel=0.02)


def test_a_sharp_highlight_amid_lamps_is_as_bright_as_its_albedo() -> None:
    # Where radiance 1 comes from everywhere, a surface sends on what it reflects in all: a white furnace of six lamps.
    # Where they were split as the sky's lights are, 8 % was missing at a slant.
    x, y, z = 2.0 * np.eye(3)
    sides = [(-x, y, z), (x, z, y), (-y, z, x), (y, x, z), (-z, x, y), (z, y, x)]
    lamps = np.concatenate([square(0.5 * middle, u, v) for middle, u, v in sides])
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.05})
    hits = points_at(
        np.repeat(ORIGIN, 3, axis=0), np.repeat(UP, 3, axis=0), np.array([[0.1, 1, 0], [1, 1, 0], [2, 1, 1]])
    )
    light = light_of(hits, emitters=lamps, blockers=lamps)
    curves = [layer.coefficients(name, n) for name, n in (("theta_h", 128), ("theta_d", 16))]
    picture = project(hits, light, layer, (128, 16)).radiance(*curves) * light.lighting.unit * layer.scale()
    sky = geodesic(6)
    expected = np.stack([
        (evaluate_layers([layer], sky.centres @ frame.T, np.tile(frame @ wo, (len(sky.centres), 1)))
         * sky.solid_angles[:, None]).sum(axis=0)
        for frame, wo in zip(local_frames(hits.tangent, hits.normal), hits.wo.astype(float), strict=True)
    ])  # fmt: skip
    np.testing.assert_allclose(picture, expected, rtol=0.02)


# --------------------------------------------------------------------------------------------------- parity of kernels


@pytest.mark.parametrize("kind", ANGLES)
def test_single_precision_angles_agree_with_the_models_own(kind) -> None:
    wi, wo = directions(400, 1), directions(12, 2)
    wi[:, 2], wo[:, 2] = np.abs(wi[:, 2]), np.abs(wo[:, 2]) + 0.02
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    q = np.array([0.04, 30.0, 0, 0, 0, 0, 0, 0.0])
    for o in wo:
        mirrored = o * [-1, -1, 1]
        near = np.concatenate([wi, mirrored + 1e-3 * directions(100, 3)])  # also where a lobe has its tip
        near[:, 2] = np.abs(near[:, 2])
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        x, y, z = np.ascontiguousarray(near.T, np.float32)
        found = np.empty(len(near), np.float32)
        fill_gammas(kind, q, x, y, z, *o.astype(np.float32), found)
        expected = np.minimum([gamma(kind, q, *i, *o) for i in near], np.pi / 2)
        # The narrowest of 512 bands is 3e-3 wide. γ_r loses digits where the half vector has no part across, φ_h where
        # it is all but the normal, φ_d where that is wi.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 if kind in (GAMMA_RATIO, PHI_H, PHI_D) else 3e-4)


@pytest.mark.parametrize("rises", [False, True])
@pytest.mark.parametrize(("model", "parameters", "bands"), LAYERS)
def test_single_precision_weights_agree_with_the_models_own(model, parameters, bands, rises) -> None:
    layer = make_layer(MODELS[model], parameters).replace(rises=rises)
    q, kind = layer.quotient_parameters(), layer.model.number
    wi, wo = directions(500, 5), directions(12, 6)
    wo[:, 2] = np.abs(wo[:, 2])
    for o in wo:
        x, y, z = np.ascontiguousarray(wi.T, np.float32)
        found = np.full(len(wi), 2.0, np.float32)
        weigh(kind, q, x, y, z, *o.astype(np.float32), found)
        expected = np.array([2 * quotient_cosine(kind, q, *i, *o) for i in wi])
        np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-4 * expected.max())
        assert (found[wi[:, 2] <= 0] == 0).all()


# -------------------------------------------------------------------------------------------------------- the extremes


@pytest.mark.parametrize("exponent", [-8, -4, 4, 8])
def test_transport_is_linear_in_the_lights_radiance(exponent) -> None:
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.2})
    hits = points_at(ORIGIN, UP, LEANING_EYE)
    ones_a, ones_b = np.ones((32, 3)), np.ones((8, 3))

    def picture(scale: float) -> np.ndarray:
        light = light_of(hits, Environment(noise().radiance * np.float32(scale), "scaled"), n_lights=400)
        return project(hits, light, layer, (32, 8)).radiance(ones_a, ones_b).astype(float) * light.lighting.unit

    np.testing.assert_allclose(picture(10.0**exponent), picture(1.0) * 10.0**exponent, rtol=1e-6)


def test_a_black_map_gives_exactly_nothing() -> None:
    hits = points_at(ORIGIN, UP, LEANING_EYE)
    light = light_of(hits, constant_environment(0.0), n_lights=400)
    for model, parameters, bands in LAYERS:
        store = project(hits, light, make_layer(MODELS[model], parameters), bands)
        assert not store.radiance(np.ones((bands[0], 3)), np.ones((bands[1], 3))).any()


def test_no_light_at_all() -> None:
    hits = points_at(ORIGIN, UP)
    assert not irradiance(hits, light_of(hits)).any()


def test_tiles_come_in_order_and_are_left_out_when_known() -> None:
    x = np.linspace(0.0, 1.0, 600)
    hits = points_at(np.stack([x, 0 * x, 0 * x], axis=1), UP)
    light = light_of(hits, constant_environment(1.0), n_lights=20)
    layer = LayerShape("lambert", (0.0,) * 8, (4, 1))
    rows = np.arange(50, 600)
    everything = list(project_layer(hits, rows, light, layer))
    assert [(tile.begin, len(tile.scale)) for tile in everything] == [(0, 256), (256, 256), (512, 38)]
    rest = list(project_layer(hits, rows, light, layer, skip=frozenset({1})))
    assert [tile.begin for tile in rest] == [0, 512]
    np.testing.assert_array_equal(rest[1].values, everything[2].values)


@cache
def one_texel(radiance: float) -> Environment:
    image = np.zeros((8, 16, 3), np.float32)
    image[2, 3] = radiance
    return Environment(image, "one texel")


@settings(deadline=None, max_examples=40, derandomize=True)
@given(
    model=st.sampled_from(sorted(MODELS)),
    roughness=st.floats(1e-4, 1.0),
    bands=st.tuples(st.sampled_from([1, 2, 16, 256]), st.sampled_from([1, 8, 128])),
    lean=st.one_of(st.sampled_from([0.0, 1e-8, np.pi / 2 - 1e-4, np.pi / 2, 2.0]), st.floats(0.0, np.pi)),
    turn=st.floats(0.0, 6.3),
    radiance=st.sampled_from([0.0, 1e-30, 1e-8, 1.0, 1e8, 1e12]),
    n_lights=st.sampled_from([20, 101, 400]),
    distance=st.sampled_from([1e-3, 1.0, 1e4]),
)
def test_no_number_is_ever_odd(model, roughness, bands, lean, turn, radiance, n_lights, distance) -> None:
    least = {parameter.name: parameter.minimum for parameter in MODELS[model].parameters}
    layer = make_layer(
        MODELS[model], {name: max(roughness, least[name]) for name in ("alpha", "sigma") if name in least}
    )
    if len(layer.model.factors) == 1:
        bands = (bands[0], 1)
    eye = np.array([[np.sin(lean) * np.cos(turn), np.cos(lean), np.sin(lean) * np.sin(turn)]])
    hits = points_at(ORIGIN, UP, eye)
    lamp = square((0, distance, 0), (1, 0, 0), (0, 0, 1))
    light = light_of(hits, one_texel(radiance), lamp, n_lights=n_lights, n_patches=8)
    store = project(hits, light, layer, bands)
    values = bands_of(store)
    assert np.isfinite(values).all() and (values >= 0).all()
    picture = store.radiance(np.full((bands[0], 3), 1e4), np.ones((bands[1], 3)))
    assert np.isfinite(picture).all() and (picture >= 0).all()


def test_patches_of_a_far_light_keep_their_power() -> None:
    # A square of side 1 at distance 1e4: E = L·A/d², although its corners differ in the fifth digit only.
    lamp = square((0, 1e4, 0), (1, 0, 0), (0, 0, 1))
    hits = points_at(ORIGIN, UP)
    assert len(emitter_patches(lamp, np.ones((2, 3)), 2).area) == 2
    np.testing.assert_allclose(irradiance(hits, light_of(hits, emitters=lamp, n_patches=2))[0], 1e-8, rtol=2e-2)
