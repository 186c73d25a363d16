"""The lit sphere: what it shows against a plain sum over directions, what is around it, that it follows a curve."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from ui.gl.brdf_stack import BrdfStack
from ui.gl.lit_sphere import N_STEPS, LitSphere, sphere_picture
from ui.gl.passes import Passes
from ui.gl.textures import TextureMemory, read_texture

pytestmark = pytest.mark.gl

SIDE = 24
# The lights of shaders/brdf/sphere.frag.glsl: direction, k, irradiance when faced.
LIGHTS = (
    ((-0.4915, 0.5695, 0.6590), 70.0, (2.5, 2.45, 2.35)),
    ((0.7913, 0.4352, -0.4292), 40.0, (1.3, 1.4, 1.6)),
)


@pytest.fixture(scope="module")
def passes(shared_context: moderngl.Context) -> Iterator[Passes]:
    made = Passes(shared_context)
    yield made
    made.release()


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
