"""The BRDF in GLSL against the one in Python: every model, over random pairs, with and without edited curves.

The measure is |GLSL - Python| / max(1, Python), 1/sr, at most 1e-4 over 1e5 pairs: half of them uniform over both
hemispheres, half near each other's mirror direction, where highlights are. Shaders get the directions in single
precision, and so does Python. Edited curves are held to the same over a tenth of the pairs; their falloffs are 0.35 rad
wide and more: at the foot of a steep one, where the curve has a thousandth of its height, samples of it are joined by
straight lines that are 1e-3 off in value at cosines under 0.05.
"""

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from app.document.document import all_factors
from engine.curve.operators import Operator
from engine.material import MODELS, kinds, make_layer
from engine.material._kernels import gamma
from engine.material.layer import Layer
from tests.engine.material.test_kernels import all_gammas, all_quotients, hemisphere
from ui.gl.brdf_stack import BrdfStack
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes

pytestmark = pytest.mark.gl

LARGEST_DIFFERENCE = 1e-4
N_PAIRS = 100_000


@pytest.fixture(scope="module")
def stack(shared_context: moderngl.Context) -> Iterator[BrdfStack]:
    passes, memory = Passes(shared_context), TextureMemory(shared_context)
    made = BrdfStack(passes, memory)
    yield made
    made.release()
    passes.release()
    assert memory.bytes_in_use == 0


@pytest.fixture(scope="module")
def pairs() -> tuple[np.ndarray, np.ndarray]:
    """wi, wo (N, 3), half of them independent, half within about 0.3 of each other's mirror direction."""
    half = N_PAIRS // 2
    wo = hemisphere(N_PAIRS, seed=1)
    near = hemisphere(half, 3, near=wo[half:] * [-1, -1, 1], spread=0.3)
    wi = np.concatenate([hemisphere(half, seed=2), near])
    return tuple(single / np.linalg.norm(single, axis=1, keepdims=True) for single in (rounded(wi), rounded(wo)))


def rounded(directions: np.ndarray) -> np.ndarray:
    return directions.astype(np.float32).astype(np.float64)


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest, as the head of this file measures it."""
    return float((np.abs(found - expected) / np.maximum(1.0, expected)).max())


def by_curves(layer: Layer, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """f_q rho_q f_o f_A f_B with the final curves, by the worker's kernels."""
    model, q = layer.model, layer.quotient_parameters()
    product = layer.scale() * (all_quotients(model.number, q, wi, wo) / wi[:, 2])[:, None]
    for factor in (*model.factors, *((model.view_factor,) if model.view_factor else ())):
        angle = all_gammas(factor.gamma, q, wi, wo)
        product = product * layer.curve(factor.name)(np.minimum(angle, math.pi / 2)) * (angle <= math.pi / 2)[:, None]
    return product


def edited(layer: Layer) -> Layer:
    """The layer with a bump and a raised end on every curve, in two channels of three, that no parameter could make."""
    bump = Operator("amplify", "y", 0.05, 0.4, 0.6, 1.2, magnitude=0.7, channels=(True, True, False))
    lift = Operator("translate", "y", 0.3, 0.8, math.pi / 2, math.pi / 2, magnitude=0.05, channels=(False, True, True))
    for factor in all_factors(layer.model):
        layer = layer.with_operators(factor.name, [bump, lift])
    return layer


@pytest.mark.parametrize("name", MODELS)
def test_parity_with_the_formula(stack: BrdfStack, pairs: tuple[np.ndarray, np.ndarray], name: str) -> None:
    layer = make_layer(MODELS[name])
    stack.set_layers((layer,))
    assert difference(stack.evaluate(*pairs), layer.brdf(*pairs)) <= LARGEST_DIFFERENCE


@pytest.mark.parametrize("name", MODELS)
def test_parity_of_edited_curves(stack: BrdfStack, pairs: tuple[np.ndarray, np.ndarray], name: str) -> None:
    layer, (wi, wo) = edited(make_layer(MODELS[name])), (each[::10] for each in pairs)
    stack.set_layers((layer,))
    expected = by_curves(layer, wi, wo)
    assert difference(expected, layer.brdf(wi, wo)) > 0.01  # the edit is there
    assert difference(stack.evaluate(wi, wo), expected) <= LARGEST_DIFFERENCE


def test_parity_of_two_terms(stack: BrdfStack, pairs: tuple[np.ndarray, np.ndarray]) -> None:
    # A coloured Fresnel factor, of which the second term has (1 - cos theta_d)^5 in its quotient, above a matt base.
    plain = make_layer(MODELS["ashikhmin_shirley"]).with_fresnel((0.9, 0.5, 0.1))
    layers = (make_layer(MODELS["lambert"]), plain, plain.replace(rises=True))
    wi, wo = (each[::10] for each in pairs)
    stack.set_layers(layers)
    assert difference(stack.evaluate(wi, wo), sum(each.brdf(wi, wo) for each in layers)) <= LARGEST_DIFFERENCE


@pytest.mark.parametrize("name", MODELS)
def test_every_parameter_at_its_ends_gives_numbers(stack: BrdfStack, name: str) -> None:
    # Grazing, opposite, mirrored and random pairs, mirrors and roughest surfaces: finite, at least 0, 0 from below.
    ends = [[math.sqrt(1 - c * c) * s, 0.0, c] for c in (0.0, 1e-8, -1e-8, -1.0, 1.0, 0.5) for s in (1, -1)]
    wi, wo = np.repeat(ends, len(ends), axis=0), np.tile(ends, (len(ends), 1))
    random = hemisphere(200, seed=4)
    wi, wo = np.concatenate([wi, random, random]), np.concatenate([wo, random * [-1, -1, 1], hemisphere(200, seed=5)])
    below = (wi[:, 2] <= 0.0) | (wo[:, 2] <= 0.0)
    for parameter in (each for each in MODELS[name].parameters if each.kind != "file"):
        for end in parameter.choices or (parameter.minimum, parameter.maximum):
            stack.set_layers((make_layer(MODELS[name], {parameter.name: end}),))
            found = stack.evaluate(wi, wo)
            assert np.isfinite(found).all() and (found >= 0.0).all() and (found[below] == 0.0).all()


def test_a_curve_follows_without_another_program(stack: BrdfStack) -> None:
    layer = make_layer(MODELS["rough_conductor"])
    assert stack.set_layers((layer,)) and not stack.set_layers((layer,))
    up = np.array([[0.0, 0.0, 1.0]])
    before = stack.evaluate(up, up)
    lifted = Operator("translate", "y", 0.0, 0.0, 0.1, 0.2, magnitude=1.0)
    assert stack.set_layers((layer.with_operators("theta_h", [lifted]),))
    expected = by_curves(layer.with_operators("theta_h", [lifted]), up, up)
    assert stack.evaluate(up, up) == pytest.approx(expected, rel=1e-5) and (expected > 1.05 * before).all()


def test_gamma_is_the_same_angle_in_both(stack: BrdfStack) -> None:
    # A curve that is 0 beyond 0.5 tells which angle it is looked up at: the kernel's own, for the mirror angle.
    cut = Operator("amplify", "y", 0.5, 0.5, math.pi / 2, math.pi / 2, magnitude=-1.0)
    layer = make_layer(MODELS["phong"], {"exponent": 1.0}).with_operators("theta_r", [cut])
    stack.set_layers((layer,))
    wi, wo = (rounded(hemisphere(2000, seed)) for seed in (6, 7))
    angle = np.array([gamma(kinds.THETA_R, np.zeros(8), *i, *o) for i, o in zip(wi, wo, strict=True)])
    clear = np.abs(angle - 0.5) > 0.002  # a step is a ramp of 2 thousandths of a radian at most
    assert ((stack.evaluate(wi, wo)[:, 0] > 0.0) == (angle < 0.5))[clear].all()


def test_parity_under_a_coat(stack: BrdfStack, pairs: tuple[np.ndarray, np.ndarray]) -> None:
    # A layer without a view factor of its own, and one with it, under a coat: the shader has what the coat leaves.
    coat = make_layer(MODELS["clearcoat"], {"scale": 0.8})
    beneath = (make_layer(MODELS["microfacet"]), make_layer(MODELS["lambert"]))
    layers = (*(layer.replace(under=coat.name, covers=(coat,)) for layer in beneath), coat)
    wi, wo = (each[::10] for each in pairs)
    stack.set_layers(layers)
    expected = sum(each.brdf(wi, wo) for each in layers)
    assert difference(expected, sum(each.brdf(wi, wo) for each in (*beneath, coat))) > 0.01  # the coat takes something
    assert difference(stack.evaluate(wi, wo), expected) <= LARGEST_DIFFERENCE
