"""Lobe, slice and albedo on the GPU against the formulas in Python and fine sums."""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from tests.engine.material.test_models import albedo_by_half_vectors
from ui.gl import brdf_views
from ui.gl.brdf_stack import BrdfStack
from ui.gl.passes import Passes
from ui.gl.textures import TextureMemory

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
