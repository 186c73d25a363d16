"""Measured layers in GLSL against the measurement itself: parts, sums, edits; and tables uploaded in pieces.

The measure is |GLSL - Python| / max(1, Python), 1/sr, over pairs as in `test_brdf`; tables are single floats, so it is
held to what other models are.
"""

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.measured.measurement import Measurement, evaluate_table
from engine.measured.tables import read_measurement, table_of
from tests.engine.material.test_kernels import hemisphere
from tests.ui.gl.test_brdf_stack import LARGEST_DIFFERENCE, difference, rounded
from ui.gl import brdf_views, measured_tables
from ui.gl.brdf_stack import BrdfStack
from ui.gl.gpu_memory import TextureMemory
from ui.gl.measured_tables import MeasuredTables
from ui.gl.program import Passes

pytestmark = pytest.mark.gl

N_PAIRS = 20_000
PARTS = ("measured_diffuse", "measured")


@pytest.fixture(scope="module")
def measurement(merl_file: Path) -> Measurement:
    return run_to_end(read_measurement(merl_file))


@pytest.fixture(scope="module")
def memory(shared_context: moderngl.Context) -> TextureMemory:
    return TextureMemory(shared_context)


@pytest.fixture(scope="module")
def stack(measurement: Measurement, memory: TextureMemory) -> Iterator[BrdfStack]:
    passes, tables = Passes(memory.context), MeasuredTables(memory)
    uploaded(tables, measurement)
    made = BrdfStack(passes, memory, tables)
    yield made
    for thing in (made, tables, passes):
        thing.release()
    assert memory.bytes_in_use == 0


@pytest.fixture(scope="module")
def pairs() -> tuple[np.ndarray, np.ndarray]:
    """wi, wo (N, 3), half of them independent, half near each other's mirror direction."""
    half, wo = N_PAIRS // 2, hemisphere(N_PAIRS, seed=1)
    near = hemisphere(half, 3, near=wo[half:] * [-1, -1, 1], spread=0.3)
    wi = np.concatenate([hemisphere(half, seed=2), near])
    return tuple(single / np.linalg.norm(single, axis=1, keepdims=True) for single in (rounded(wi), rounded(wo)))


def uploaded(tables: MeasuredTables, measurement: Measurement) -> None:
    tables.begin(measurement.number, table_of(measurement.number).samples)
    while not tables.step(1.0):
        pass


def layers_of(measurement: Measurement, **parameters: object) -> tuple[Layer, ...]:
    return tuple(make_layer(MODELS[name], {"file": measurement, **parameters}) for name in PARTS)


@pytest.mark.parametrize("name", [*PARTS, "measured_cloth", "measured_around", "measured_twist", "measured_brushed"])
@pytest.mark.parametrize("smoothing", [0.0, 0.3])
def test_parity_of_each_part(
    stack: BrdfStack, measurement: Measurement, pairs: tuple[np.ndarray, np.ndarray], name: str, smoothing: float
) -> None:
    layer = make_layer(MODELS[name], {"file": measurement, "smoothing": smoothing, "scale": (1.0, 0.5, 2.0)})
    stack.set_layers((layer,))
    assert difference(stack.evaluate(*pairs), layer.brdf(*pairs)) <= LARGEST_DIFFERENCE


def test_an_unedited_import_is_the_measurement(
    stack: BrdfStack, measurement: Measurement, pairs: tuple[np.ndarray, np.ndarray]
) -> None:
    # Both layers share one table; beside them another model, and one that was measured and not read.
    samples = table_of(measurement.number).samples
    measured = evaluate_table(samples, *pairs)
    stack.set_layers(layers_of(measurement))
    assert difference(stack.evaluate(*pairs), measured) <= LARGEST_DIFFERENCE
    others = (make_layer(MODELS["lambert"]), make_layer(MODELS["measured_diffuse"]))
    stack.set_layers((others[0], *layers_of(measurement), others[1]))
    beside = sum(layer.brdf(*pairs) for layer in others)
    assert difference(stack.evaluate(*pairs), measured + beside) <= LARGEST_DIFFERENCE
    assert difference(measured, np.zeros_like(measured)) > 1.0  # there is a highlight


def test_edits_bend_the_measurement(
    stack: BrdfStack, measurement: Measurement, pairs: tuple[np.ndarray, np.ndarray]
) -> None:
    # What a curve is multiplied by, the layer is.
    lift = Operator("amplify", "y", 0.1, 0.5, 1.0, 1.5, magnitude=1.5, channels=(True, False, True))
    for layer, factor in zip(layers_of(measurement), ("theta_i", "theta_h"), strict=True):
        wi, wo = (each[::10] for each in pairs)
        bent = layer.with_operators(factor, [lift])
        half = wi + wo
        cosine = wi[:, 2] if factor == "theta_i" else half[:, 2] / np.linalg.norm(half, axis=1)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        gain = bent.curve(factor)(angle) / layer.curve(factor)(angle)
        stack.set_layers((bent,))
        expected = layer.brdf(wi, wo) * gain
        assert difference(stack.evaluate(wi, wo), expected) <= LARGEST_DIFFERENCE
        assert difference(expected, layer.brdf(wi, wo)) > 0.01


def test_albedo_is_that_of_the_measurement(stack: BrdfStack, memory: TextureMemory, measurement: Measurement) -> None:
    # Over 200,000 directions about the cosine; curves alone are off by more.
    samples, rng = table_of(measurement.number).samples, np.random.default_rng(5)
    stack.set_layers(layers_of(measurement))
    found = brdf_views.albedo(stack, memory)
    u, v = rng.random((2, 200_000))
    wi = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)], axis=1)
    for place in (4, 16, 25):
        theta = found.angles[place]
        wo = np.broadcast_to([np.sin(theta), 0.0, np.cos(theta)], wi.shape)
        expected = np.pi * evaluate_table(samples, wi, wo).mean(axis=0)
        assert found.values[place] == pytest.approx(expected, rel=0.01)
    parts = brdf_views.AlbedoShares(memory)
    assert parts.step(stack, 20) is None and parts.is_begun
    whole = parts.step(stack, 20)
    assert whole is not None and np.array_equal(whole.values, found.values) and not parts.is_begun
    parts.release()


def test_a_table_is_used_once_it_is_whole(
    memory: TextureMemory, measurement: Measurement, pairs: tuple[np.ndarray, np.ndarray]
) -> None:
    passes, tables = Passes(memory.context), MeasuredTables(memory)
    before = memory.bytes_in_use
    stack, layers = BrdfStack(passes, memory, tables), layers_of(measurement)
    wi, wo = (each[::100] for each in pairs)
    stack.set_layers(layers)
    curves = stack.evaluate(wi, wo)
    tables.begin(measurement.number, table_of(measurement.number).samples)
    n_steps = 0
    while True:  # each for as short as can be
        n_steps += 1
        if tables.step(0.0):
            break
        assert measurement.number not in tables and np.array_equal(stack.evaluate(wi, wo), curves)
    assert n_steps == 90 / measured_tables.LAYERS_AT_ONCE and not tables.is_uploading
    expected = evaluate_table(table_of(measurement.number).samples, wi, wo)
    assert difference(stack.evaluate(wi, wo), expected) <= LARGEST_DIFFERENCE < difference(curves, expected)
    for thing in (stack, tables, passes):
        thing.release()
    assert memory.bytes_in_use == before


def test_tables_used_last_stay(memory: TextureMemory) -> None:
    tables, before = MeasuredTables(memory), memory.bytes_in_use
    for number in range(1, 9):
        tables.begin(number, np.zeros((5, 2, 2, 3), np.float32))
        assert tables.step(1.0)
    tables.texture(2)
    tables.forget_but([1])
    assert [number for number in range(1, 9) if number in tables] == [1, 2, 6, 7, 8]
    tables.release()
    assert memory.bytes_in_use == before
