"""Plots of a BRDF, and the lit sphere, against what the engine computes."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from tests.engine.material.test_models import albedo_by_half_vectors
from ui.gl import brdf_views
from ui.gl.brdf_stack import BrdfStack
from ui.gl.brdf_views import N_STEPS, LitSphere, sphere_picture
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def memory(shared_context: moderngl.Context) -> TextureMemory:
    return TextureMemory(shared_context)


@pytest.fixture(scope="module")
def passes(shared_context: moderngl.Context) -> Iterator[Passes]:
    made = Passes(shared_context)
    yield made
    made.release()


@pytest.fixture(scope="module")
def stack(passes: Passes, memory: TextureMemory) -> Iterator[BrdfStack]:
    made = BrdfStack(passes, memory)
    yield made
    made.release()
    assert memory.bytes_in_use == 0


def test_lobe_is_the_brdf_in_its_plane(stack: BrdfStack) -> None:
    layer = make_layer(MODELS["ashikhmin_shirley"])
    stack.set_layers((layer,))
    for azimuth in (0.0, math.pi / 2):
        found = brdf_views.lobe(stack, 0.6, azimuth)
        along = np.array([math.cos(azimuth), math.sin(azimuth)])
        wo = np.concatenate([np.sin(found.angles)[:, None] * along, np.cos(found.angles)[:, None]], axis=1)
        wi = np.broadcast_to([*(-math.sin(0.6) * along), math.cos(0.6)], wo.shape)
        np.testing.assert_allclose(found.values, layer.brdf(wi, wo), rtol=1e-3, atol=1e-4)
        # Brightest near the mirror direction, which is among the angles.
        assert 0.6 in found.angles and (np.diff(found.angles) > 0.0).all()
        assert found.angles[found.values[:, 0].argmax()] == pytest.approx(0.6, abs=0.1)


def test_slice_has_the_angles_of_measured_brdfs(stack: BrdfStack, passes: Passes, memory: TextureMemory) -> None:
    # theta_h = 20 and theta_d = 30 degrees, phi_d = 90: built here by turning d about y by theta_h.
    layer = make_layer(MODELS["cook_torrance"])
    stack.set_layers((layer,))
    shown = brdf_views.Slice(passes, memory)
    shown.draw(stack)
    texel = 0.5 * math.pi / brdf_views.SLICE_SIDE
    h, d = ((math.floor(math.radians(degrees) / texel) + 0.5) * texel for degrees in (20.0, 30.0))
    half = np.array([math.sin(h), 0.0, math.cos(h)])
    wi, wo = (math.cos(d) * half + [0.0, sign * math.sin(d), 0.0] for sign in (1.0, -1.0))
    expected = layer.brdf(wi[None], wo[None])[0]
    assert shown.value(h, d) == pytest.approx(tuple(expected), rel=1e-4)
    # Towards the upper right, both angles large, a direction is below the horizon. Diffuse 0.5 / pi is grey.
    assert shown.value(1.4, 1.4) == (0.0, 0.0, 0.0)
    stack.set_layers((make_layer(MODELS["lambert"]),))
    shown.draw(stack)
    assert shown.value(0.1, 0.1) == pytest.approx((0.5 / math.pi,) * 3, rel=1e-5)
    pixels = np.frombuffer(shown.texture.read(), np.uint8).reshape(brdf_views.SLICE_SIDE, -1, 4)
    assert pixels[-5, 5, 0] == pytest.approx(255 * (1.055 * (0.5 / math.pi) ** (1 / 2.4) - 0.055), abs=1)
    shown.release()


def test_albedo_of_lambert_is_its_albedo(stack: BrdfStack, memory: TextureMemory) -> None:
    stack.set_layers((make_layer(MODELS["lambert"], {"albedo": (0.7, 0.3, 0.0)}),))
    found = brdf_views.albedo(stack, memory)
    assert found.values == pytest.approx(np.broadcast_to([0.7, 0.3, 0.0], found.values.shape), rel=2e-3)
    assert found.equivalent == pytest.approx([0.7, 0.3, 0.0], rel=2e-3)


CASES = [
    ("rough_conductor", {"alpha": 0.02}, 0.01), ("rough_conductor", {"alpha": 0.6}, 0.005),
    ("blinn_phong", {"exponent": 0.0, "scale": 1.0}, 0.005), ("homomorphic", {}, 0.005),
    ("ashikhmin_shirley", {}, 0.03), ("ward_anisotropic", {}, 0.03),
]  # fmt: skip


@pytest.mark.parametrize(("name", "parameters", "slack"), CASES)
def test_directional_albedo_against_a_fine_sum(
    stack: BrdfStack, memory: TextureMemory, name: str, parameters: dict[str, float], slack: float
) -> None:
    layer = make_layer(MODELS[name], parameters)
    stack.set_layers((layer,))
    found = brdf_views.albedo(stack, memory)
    azimuths = (np.arange(8) + 0.5) * (math.pi / 4)
    for place in (1, 12, 24):
        expected = np.mean([albedo_by_half_vectors(layer, found.angles[place], phi) for phi in azimuths], axis=0)
        assert found.values[place] == pytest.approx(expected, rel=slack)
    # [BenArtzi07, 5.2.4] finds 0.56 for Blinn's exponent 0, a finer quadrature 0.552.
    if name == "blinn_phong":
        assert found.equivalent == pytest.approx([0.552] * 3, abs=0.003)


def test_albedo_tells_light_from_nowhere(stack: BrdfStack, memory: TextureMemory) -> None:
    # A white surface reflects 1; lifted by an edit to 1.5 over all angles, 1.5.
    layer = make_layer(MODELS["lambert"], {"albedo": 1.0})
    stack.set_layers((layer,))
    assert brdf_views.albedo(stack, memory).largest == pytest.approx([1.0] * 3, abs=3e-3)
    lifted = Operator("translate", "y", 0.0, 0.0, math.pi / 2, math.pi / 2, magnitude=0.5)
    stack.set_layers((layer.with_operators("theta_i", [lifted]),))
    assert brdf_views.albedo(stack, memory).largest == pytest.approx([1.5] * 3, rel=3e-3)


SIDE = 24
# The lights of shaders/brdf/sphere.frag.glsl: direction, k, irradiance when faced.
LIGHTS = (
    ((-0.4915, 0.5695, 0.6590), 70.0, (2.5, 2.45, 2.35)),
    ((0.7913, 0.4352, -0.4292), 40.0, (1.3, 1.4, 1.6)),
)


def drawn(passes: Passes, *layers: Layer) -> np.ndarray:
    """Radiance (side, side, 3) after all steps."""
    memory = TextureMemory(passes.context)
    stack, sphere = BrdfStack(passes, memory), LitSphere(passes, memory, SIDE)
    stack.set_layers(layers)
    assert [sphere.step(stack) for _ in range(N_STEPS)] == [True] * (N_STEPS - 1) + [False]
    sums = read_texture(sphere._sum, np.float32).astype(np.float64)
    assert (sums[..., 3] == N_STEPS).all()
    sphere.release()
    stack.release()
    assert memory.bytes_in_use == 0
    return sums[..., :3] / N_STEPS


def light(directions: np.ndarray) -> np.ndarray:
    """Radiance from world directions (N, 3)."""
    up = directions[:, 1]
    share = np.clip((up + 0.25) / 0.5, 0.0, 1.0)[:, None]
    share = share * share * (3.0 - 2.0 * share)
    above = np.array([0.42, 0.43, 0.45]) + np.clip(up, 0.0, 1.0)[:, None] * [0.20, 0.23, 0.27]
    total = np.array([0.10, 0.095, 0.09]) * (1.0 - share) + above * share
    for middle, k, power in LIGHTS:
        total = total + (k / (2 * math.pi) * np.exp(k * (directions @ middle - 1.0)))[:, None] * power
    return total


def summed(layer: Layer, column: int, row: int) -> np.ndarray:
    """What a texel shows, by a sum over 120,000 directions."""
    x, y = (np.array([column, row]) + 0.5) / SIDE * 2.04 - 1.02
    n = np.array([x, -y, math.sqrt(1.0 - x * x - y * y)])
    t = np.array([n[2], 0.0, -n[0]]) / math.hypot(n[0], n[2])
    frame = np.stack([t, np.cross(n, t), n])
    cosine = np.sqrt((np.arange(245) + 0.5) / 245)
    phi = (np.arange(490) + 0.5) * (math.pi / 245)
    sine = np.sqrt(1.0 - cosine**2)[:, None]
    shape = (245, 490)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(cosine[:, None], shape)], -1).reshape(-1, 3)
    wo = np.broadcast_to(frame @ [0.0, 0.0, 1.0], wi.shape)
    return (layer.brdf(wi, wo) * light(wi @ frame)).sum(axis=0) * math.pi / len(wi)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("lambert", {}), ("rough_conductor", {"alpha": 0.3}), ("ward_anisotropic", {"alpha_v": 0.2})],
)
def test_shows_what_a_plain_sum_finds(passes: Passes, name: str, parameters: dict[str, float]) -> None:
    # Within 5 % in single texels and 2 % on average: 8 steps are 288 directions.
    layer = make_layer(MODELS[name], parameters)
    picture, texels = drawn(passes, layer), [(12, 12), (8, 7), (5, 14), (17, 18), (13, 4)]
    found = np.array([picture[row, column] for column, row in texels])
    expected = np.array([summed(layer, *texel) for texel in texels])
    np.testing.assert_allclose(found, expected, rtol=0.05)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_rows_at_a_time_make_the_same_picture(passes: Passes) -> None:
    memory = TextureMemory(passes.context)
    stack = BrdfStack(passes, memory)
    stack.set_layers((make_layer(MODELS["ward"]),))
    whole, parts = (LitSphere(passes, memory, SIDE, n_steps=2) for _ in range(2))
    while whole.step(stack):
        pass
    within = []
    while parts.step(stack, rows=9):
        within.append(parts.is_within_step)
    assert within == [True, True, False, True, True]  # 9, 18 and 24 of 24 rows, twice
    assert whole.texture.read() == parts.texture.read()
    for thing in (whole, parts, stack):
        thing.release()


def test_layers_are_added(passes: Passes) -> None:
    base, coat = make_layer(MODELS["lambert"]), make_layer(MODELS["ward"])
    both = drawn(passes, base, coat)
    assert both == pytest.approx(drawn(passes, base) + drawn(passes, coat), rel=1e-4, abs=1e-5)
    assert not drawn(passes).any()  # of no layers: black


def test_thumbnail_is_transparent_around_and_follows_the_curve(shared_context: moderngl.Context) -> None:
    layer = make_layer(MODELS["lambert"], {"albedo": (0.7, 0.1, 0.1)})
    picture = sphere_picture(shared_context, [layer, layer.replace(visible=False)], SIDE, steps=1)
    assert picture.shape == (SIDE, SIDE, 4)
    assert picture[0, 0, 3] == 0 and picture[SIDE // 2, SIDE // 2, 3] == 255
    red, green = (int(value) for value in picture[SIDE // 2, SIDE // 2, :2])
    assert red > 2 * green
    dark = Operator("amplify", "y", 0.0, 0.0, math.pi / 2, math.pi / 2, magnitude=-1.0)
    bent = layer.with_operators("theta_i", [dark])
    assert sphere_picture(shared_context, [bent], SIDE, steps=1)[SIDE // 2, SIDE // 2, 0] < 20
