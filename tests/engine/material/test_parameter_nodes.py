"""Nodes of parameters that vary over a surface: where they are, what they weigh, and how far the blend is from the
model's own formula."""

from __future__ import annotations

import numpy as np
import pytest

from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layer, make_layer
from engine.material.parameter_maps import (
    ChannelStatistics,
    ParameterMap,
    channel_statistics,
    maps_that_fit,
    parameter_map_from,
    parameter_map_table,
)
from engine.material.parameter_nodes import MOST_LAYERS, NODE_TOLERANCE, ParameterNodes, find_nodes, plan_nodes
from engine.material.parameters import ParameterError

# All values equally frequent, and a few more texels at the ends.
RAMP = channel_statistics(np.clip(np.linspace(-0.01, 1.01, 4096), 0.0, 1.0))


def mapped(model: str, name: str, **table: object) -> Layer:
    """A layer with one map."""
    layer = make_layer(MODELS[model])
    parameter = next(each for each in layer.model.parameters if each.name == name)
    return layer.with_parameter_map(parameter_map_from(parameter, {"map": "a.png", **table}), name)


def nodes_of(
    layer: Layer, n: int | None = None, statistics: ChannelStatistics = RAMP
) -> tuple[ParameterNodes, ParameterMap]:
    (own,) = layer.parameter_maps
    return find_nodes(layer, own, statistics, n), own


def test_a_constant_map_is_the_plain_parameter() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.1, 0.7])
    (node,) = plan_nodes(layer, [channel_statistics(np.full(100, 0.5))])
    plain = layer.replace(parameter_maps=()).with_parameter("alpha", 0.1 * 0.5 + 0.7 * 0.5)
    assert node.replace(node_of="") == plain  # bit for bit, and without a weight


@pytest.mark.parametrize(("model", "name", "ends"), [
    ("rough_conductor", "alpha", [0.05, 0.8]), ("phong", "exponent", [5.0, 500.0]), ("ward", "alpha", [0.1, 0.4]),
    ("cook_torrance", "eta", [[0.2, 0.9, 1.1], [1.5, 1.5, 1.5]]), ("oren_nayar", "sigma", [0.0, 1.0]),
])  # fmt: skip
def test_weights_sum_to_one_and_hats_are_shares(model: str, name: str, ends: list[object]) -> None:
    found, own = nodes_of(mapped(model, name, range=ends))
    weights = np.array([each.weights for each in found.weights])
    hats = np.array([each.hats for each in found.weights])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(hats.sum(axis=0), 1.0, atol=1e-12)
    assert hats.min() >= 0.0 and np.abs(weights).max() < 1.6
    # Where a texel has a node's value, that node counts alone.
    for k, value in enumerate(found.values):
        (at,) = np.flatnonzero([own.value_at(knot) == value for knot in found.weights[k].knots])
        np.testing.assert_array_equal(weights[:, at], np.eye(len(weights))[k])


def test_the_error_falls_with_the_number_of_nodes_and_the_planner_takes_the_least() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.2, 0.6])
    errors = [nodes_of(layer, n)[0].error for n in range(2, 7)]
    assert all(after < before for before, after in zip(errors, errors[1:], strict=False))
    planned = nodes_of(layer)[0]
    least = next(n for n, error in zip(range(2, 7), errors, strict=True) if error <= NODE_TOLERANCE)
    assert (len(planned.values), planned.error) == (least, errors[least - 2])


def test_many_nodes_are_the_formula_itself() -> None:
    """The slow twin: with a node at each value of the grid, a blend is the model between two close values."""
    layer = mapped("rough_conductor", "alpha", range=[0.1, 0.5])
    found, own = nodes_of(layer, 1000)
    assert len(found.values) == 48 and found.error == 0.0
    _assert_blend_is(layer, found, own, 0.01)


def test_six_nodes_blend_to_the_formula_under_a_lamp() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.1, 0.5])
    found, own = nodes_of(layer, 6)
    assert found.error < 0.003
    _assert_blend_is(layer, found, own, 0.05)  # of each direction; a lamp is wider


def _assert_blend_is(layer: Layer, found: ParameterNodes, own: ParameterMap, tolerance: float) -> None:
    random = np.random.default_rng(3)
    wi, wo = _directions(random, 200), _directions(random, 200)
    nodes = [layer.with_parameter("alpha", value) for value in found.values]
    for channel in random.random(20):
        weights = [np.interp(channel, each.knots, each.weights) for each in found.weights]
        blend = sum(w * evaluate_layer(node, wi, wo) for w, node in zip(weights, nodes, strict=True))
        truth = evaluate_layer(layer.with_parameter("alpha", own.value_at(channel)), wi, wo)
        assert np.sqrt(((blend - truth) ** 2).mean()) <= tolerance * np.sqrt((truth**2).mean()), channel


def _directions(random: np.random.Generator, n: int) -> np.ndarray:
    vectors = random.normal(size=(n, 3)) * [0.4, 0.4, 1.0]
    vectors[:, 2] = np.abs(vectors[:, 2])
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def test_edits_of_all_nodes_are_the_edited_blend() -> None:
    """Operators are linear up to a constant, and the weights' sum is 1: a raised curve is raised as much."""
    from engine.curve.operators import Operator

    layer = mapped("rough_conductor", "alpha", range=[0.2, 0.4])
    operator = Operator("amplify", "y", 0.0, 0.2, 0.5, 0.9, 3.0, 0.1)
    found, own = nodes_of(layer, 6)
    edited = layer.with_operators("theta_h", [operator])
    gamma, channel = np.linspace(0.0, 1.5, 50), 0.37
    weights = [np.interp(channel, each.knots, each.weights) for each in found.weights]
    curves = [edited.with_parameter("alpha", value).curve("theta_h")(gamma) for value in found.values]
    blend = sum(w * curve for w, curve in zip(weights, curves, strict=True))
    truth = edited.with_parameter("alpha", own.value_at(channel)).curve("theta_h")(gamma)
    np.testing.assert_allclose(blend, truth, atol=0.01 * truth.max())


def test_a_factor_needs_its_ends_alone() -> None:
    one, _ = nodes_of(mapped("rough_conductor", "scale", range=[0.5, 1.0]))
    assert one.values == (1.0,) and one.weights[0].weights == (0.5, 1.0) and one.error == 0.0
    two, _ = nodes_of(mapped("lambert", "albedo", range=[[0.5, 0.1, 0.1], [0.1, 0.1, 0.5]]))
    assert [each.weights for each in two.weights] == [(1.0, 0.0), (0.0, 1.0)]


def test_a_square_is_the_square_of_what_lies_between_the_roots() -> None:
    # As of glossiness: alpha = (1 - 0.8 c)² from 1 to 0.04.
    own = mapped("rough_conductor", "alpha", range=[1.0, 0.04], response="square").parameter_maps[0]
    channel = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(own.values(channel)[:, 0], (1.0 - 0.8 * channel) ** 2, rtol=1e-12)
    # Of colours that both count in a channel it is no sum of its ends: more nodes are.
    layer = mapped("lambert", "albedo", range=[[0.5, 0.1, 0.1], [0.1, 0.1, 0.5]], response="square")
    found, own = nodes_of(layer)
    assert found.error < 1e-4 and len(found.values) == 3
    blend = sum(np.outer(w.weights, value) for w, value in zip(found.weights, found.values, strict=True))
    np.testing.assert_allclose(blend, own.values(np.array(found.weights[0].knots)), atol=1e-4)


def test_no_value_is_far_off_where_all_are_equally_frequent() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.05, 0.8])
    assert nodes_of(layer, 6)[0].error < 0.01
    # Two values alone are their own nodes.
    found, _ = nodes_of(layer, None, channel_statistics(np.repeat([0.1, 0.7], 500)))
    assert found.error == 0.0 and found.values == (pytest.approx(0.125), pytest.approx(0.575))


def test_two_maps_make_few_layers() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.05, 0.8])
    eta = next(each for each in layer.model.parameters if each.name == "eta")
    layer = layer.with_parameter_map(parameter_map_from(eta, {"map": "b.png", "range": [0.2, 3.0]}), "eta")
    layer = layer.with_parameter_map(
        parameter_map_from(layer.model.parameters[-1], {"map": "c.png", "range": [0.0, 1.0]}), "scale"
    )
    found = plan_nodes(layer, [RAMP] * 3)
    assert 4 <= len(found) <= MOST_LAYERS and not any(each.parameter_maps for each in found)
    assert all(len(each.maps.node_weights) == 3 for each in found)
    # The products of weights sum to 1 wherever the factor is 1.
    at = {"a.png": 0.3, "b.png": 0.8, "c.png": 1.0}
    products = [
        np.prod([np.interp(at[w.image.file], w.knots, w.weights) for w in each.maps.node_weights]) for each in found
    ]
    assert sum(products) == pytest.approx(1.0)


def test_nodes_follow_the_histogram() -> None:
    """Where most texels are, nodes are dense."""
    random = np.random.default_rng(1)
    layer = mapped("rough_conductor", "alpha", range=[0.05, 0.8])
    smooth = channel_statistics(np.append(random.normal(0.1, 0.03, 10_000), [0.0] * 50 + [1.0] * 50))
    (dense, _), (even, _) = nodes_of(layer, 4, smooth), nodes_of(layer, 4)
    assert dense.values[1] < even.values[1] and dense.values[2] < even.values[2]


def test_nodes_stay_while_other_parameters_are_edited() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.05, 0.8])
    other = layer.with_parameter("eta", (1.0, 2.0, 3.0)).with_parameter("scale", 2.0)
    assert nodes_of(layer)[0] is nodes_of(other)[0]


def test_a_map_and_its_table_are_inverses() -> None:
    table = {
        "map": "a.glb#3", "channel": "g", "range": (0.0, 0.8), "response": "square", "least": 0.01,
        "repeats": (2.0, 3.0), "rotation": 90.0, "offset": (0.5, 0.25), "wrap": ("mirror", "clamp"),
    }  # fmt: skip
    alpha = MODELS["rough_conductor"].parameters[1]
    own = parameter_map_from(alpha, table)
    assert parameter_map_table(own) == table
    assert own.value_at(0.0) == 0.01 and own.value_at(1.0) == 0.8 and own.value_at(0.5) == pytest.approx(0.2)


@pytest.mark.parametrize(("table", "said"), [
    ({"map": "a.png", "chanel": "g"}, "map"), ({"channel": "g"}, "map"), ({"map": "a.png", "channel": "x"}, "grey"),
    ({"map": "a.png", "range": [0.1]}, "two values"), ({"map": "a.png", "range": [0.1, 7.0]}, "from 0 to 1"),
    ({"map": "a.png", "range": [0.1, float("nan")]}, "from 0 to 1"), ({"map": "a.png", "response": 2}, "square"),
    ({"map": "a.png", "repeats": 0}, "none 0"), ({"map": "a.png", "wrap": "tile"}, "clamp"),
    ({"map": 3}, "PNG"), (7, "map"),
])  # fmt: skip
def test_a_table_that_is_wrong_is_refused_in_one_line(table: object, said: str) -> None:
    with pytest.raises(ParameterError, match=said) as caught:
        parameter_map_from(MODELS["rough_conductor"].parameters[1], table)
    assert "\n" not in str(caught.value)


def test_only_numbers_and_colours_vary() -> None:
    with pytest.raises(ParameterError, match="neither"):
        parameter_map_from(MODELS["rough_conductor"].parameters[0], "a.png")


def test_another_model_keeps_the_maps_that_fit() -> None:
    maps = mapped("rough_conductor", "alpha", range=[0.05, 0.8]).parameter_maps
    assert maps_that_fit(maps, MODELS["rough_conductor"].parameters) == maps
    assert maps_that_fit(maps, MODELS["phong"].parameters) == ()


def test_many_maps_of_one_layer_have_so_few_nodes_that_it_ends() -> None:
    """The first of them by name needs its two ends, whatever the others get: these end with one node each."""
    layer = make_layer(MODELS["thin_film_base"])
    for name, ends in (
        ("albedo", [[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]]), ("f0", [0.02, 0.3]), ("f90", [0.2, 1.0]),
        ("film_ior", [1.1, 1.8]), ("thickness", [100.0, 900.0]),
    ):  # fmt: skip
        parameter = next(each for each in layer.model.parameters if each.name == name)
        own = parameter_map_from(parameter, {"map": "a.png", "range": ends})
        layer = layer.with_parameter_map(own, name)
    nodes = plan_nodes(layer, [RAMP] * 5)
    assert 2 <= len(nodes) <= MOST_LAYERS
    for node in nodes:
        for weight in node.maps.node_weights:
            assert len(weight.knots) == len(weight.weights) == len(weight.hats)


def test_a_single_node_is_the_value_nearest_to_all() -> None:
    layer = mapped("rough_conductor", "alpha", range=[0.2, 0.6])
    found, _ = nodes_of(layer, 1)
    two, _ = nodes_of(layer, 2)
    assert found.weights == (None,) and 0.2 < float(str(found.values[0])) < 0.5 and found.error > two.error
