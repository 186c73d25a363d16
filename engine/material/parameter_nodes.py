"""A layer with a parameter that varies over its surface, as a sum of a few layers with curves: its nodes.

    ρ(x, ωi, ωo; v(x))  ≈  Σ_k w_k(v(x)) ρ(ωi, ωo; v_k),    Σ_k w_k = 1.

Transport is precomputed for curves, and a curve belongs to a layer, not to a texel. So 2 to 6 values v_k of the
parameter become layers of their own, whose weights are textures (`engine.material.layer_maps.ChannelWeight`). Edits
apply to all nodes; they are linear in the generated curve up to a constant, and the weights' sum of 1 makes the
blend of edited nodes the edited blend.

*Weights*. At each value the nodes are weighted so that the squared error of reflected light is least; the weights are
tabulated, and linear in between. Hats, that is linear interpolation between two neighbours, need many more nodes.
relRMSE in percent for GGX with alpha from 0.05 to 0.8, all equally frequent, on a ball under a lamp of radius 5, 20 and
60 degrees, each with the best of several spacings of nodes:

    nodes                                3               4               5               6
    hats in alpha                    76 43 19        36 21  9        21 12  5        13  8  4
    hats in alpha^-1/2               43 25 15        22 13  8        13  7  5         8  5  3
    two neighbours, least squares    39 24 17        20 12  8        12  7  5         8  5  3
    all nodes, least squares         30 19 13        10  7  5         3  3  2         1  1  1

These weights go down to -0.5. Where light is reflected further, albedos must not be negative, and a few percent of a
lobe's shape are not seen: there hats count.

*Values*. Nodes start at equal distances between the ends of the map's histogram and move on a grid as long as that
lowers the mean eighth power of the error over the histogram. A highlight may show one value alone, so that the greatest
error counts. For the same maps and six nodes, the mean and the greatest error of all values in percent:

    power of the error                   2               4               8
    nodes at both ends             0.94 3.35       0.96 2.56       1.03 1.89
    all nodes are free                             0.80 1.87       0.87 1.52

The error is that of a pilot: a ball of the model, its other parameters at their defaults, under lamps of three sizes.
So nodes stay where they are while other parameters are edited. The planner takes the least number with an error of at
most 1 %.

A parameter that only scales a layer needs no more than its two ends, one where they differ in brightness alone, and its
blend is exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage, ChannelWeight
from engine.material.model import Model, find_parameter
from engine.material.parameter_maps import ChannelStatistics, ParameterMap
from engine.material.parameters import Value

Float64Array = NDArray[np.float64]

FEWEST_NODES, MOST_NODES = 2, 6
# Nodes of all maps of one layer together: each has its own transport.
MOST_LAYERS = 8
NODE_TOLERANCE = 0.01
# Of the normal equations, relative to their trace: weights stay within −0.45 and 1.1 for a twentieth more error.
_RIDGE = 1e-6
_N_GRID = 48
_STEPS = (1, -1, 3, -3)
_MOST_SWEEPS = 24
# The pilot: rings of points on a ball, points of half a ring, samples of each lamp; the lamps' radii, and their angle
# from the view, degrees.
_N_RINGS, _N_AZIMUTHS, _N_SAMPLES = 20, 4, 16
_LAMP_RADII, _LAMP_ANGLE = (4.0, 12.0, 40.0), 35.0
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True)
class ParameterNodes:
    """The nodes of one map: values of its parameter, ascending with the channel, and the weight of each, None where it
    is 1 everywhere. error: relRMSE by the pilot."""

    parameter: str
    values: tuple[Value, ...]
    weights: tuple[ChannelWeight | None, ...]
    error: float = 0.0


def plan_nodes(
    layer: Layer, statistics: Sequence[ChannelStatistics], n_nodes: int | None = None, most: int = MOST_NODES
) -> list[Layer]:
    """The layers that stand for a layer with parameter maps; the first replaces it. Arguments: see `nodes_of_maps`."""
    nodes = nodes_of_maps(layer, statistics, n_nodes, most)
    found = [layer.replace(parameter_maps=(), node_of=layer.name)]
    for each in nodes:
        found = [
            _node(before, each.parameter, value, weight)
            for before in found
            for value, weight in zip(each.values, each.weights, strict=True)
        ]
    return found


def nodes_of_maps(
    layer: Layer, statistics: Sequence[ChannelStatistics], n_nodes: int | None = None, most: int = MOST_NODES
) -> list[ParameterNodes]:
    """The nodes of each of a layer's maps, whose products are its layers. statistics: of each map's channel; n_nodes:
    of each map, None for as many as are planned, at most `most`."""
    maps = layer.parameter_maps
    nodes = [find_nodes(layer, *each, n_nodes, most) for each in zip(maps, statistics, strict=True)]
    fewer = [i for i, each in enumerate(nodes) if each.error > 0.0 or not _only_scales(layer.model, each.parameter)]
    while math.prod(len(each.values) for each in nodes) > MOST_LAYERS:
        i = max(fewer, key=lambda i: len(nodes[i].values))
        nodes[i] = find_nodes(layer, maps[i], statistics[i], len(nodes[i].values) - 1)
    return nodes


def _only_scales(model: Model, parameter: str) -> bool:
    """Whether a parameter is the strength of a layer, and the blend of its ends exact."""
    return find_parameter(model.name, model.parameters, parameter).drives == ("scale",)


def _node(layer: Layer, parameter: str, value: Value, weight: ChannelWeight | None) -> Layer:
    layer = layer.with_parameter(parameter, value)
    if weight is None:
        return layer
    return layer.replace(maps=layer.maps.with_node_weight(weight))


def find_nodes(
    layer: Layer, parameter_map: ParameterMap, statistics: ChannelStatistics, n_nodes: int | None = None,
    most: int = MOST_NODES,
) -> ParameterNodes:  # fmt: skip
    """The nodes of one of a layer's maps; n_nodes: how many, None for as many as are planned, at most `most`."""
    key = _key_of(layer, parameter_map, statistics, n_nodes)
    found = _recall(key)
    return _recall(key._replace(n_nodes=most)) if n_nodes is None and len(found.values) > most else found


# ----------------------------------------------------------------------------------------- nodes that are known already


class NodesKey(NamedTuple):
    """What the nodes of a map follow from: choices are the model's parameters that are no numbers."""

    model: Model
    choices: tuple[tuple[str, Value], ...]
    parameter_map: ParameterMap
    statistics: ChannelStatistics
    n_nodes: int | None


KnownNodes = Mapping[NodesKey, ParameterNodes]
_MOST_REMEMBERED = 1024
_remembered: dict[NodesKey, ParameterNodes] = {}


def are_nodes_known(layer: Layer, parameter_map: ParameterMap, statistics: ChannelStatistics) -> bool:
    """Whether the nodes of a map are known: it takes a twentieth of a second to find them."""
    key = _key_of(layer, parameter_map, statistics, None)
    return any(key._replace(n_nodes=n) in _remembered for n in (None, *range(1, MOST_NODES + 1)))


def known_nodes(statistics: Mapping[ChannelImage, ChannelStatistics]) -> KnownNodes:
    """All nodes that are known of maps of images with these statistics, for another process to remember."""
    return {
        key: found for key, found in _remembered.items() if statistics.get(key.parameter_map.image) == key.statistics
    }


def remember_nodes(found: KnownNodes) -> None:
    """Remember nodes that another process has found."""
    _remembered.update(found)
    for key in [*_remembered][: max(len(_remembered) - _MOST_REMEMBERED, 0)]:
        del _remembered[key]


def _key_of(layer: Layer, parameter_map: ParameterMap, statistics: ChannelStatistics, n_nodes: int | None) -> NodesKey:
    choices = tuple((p.name, layer.values[p.name]) for p in layer.model.parameters if p.kind == "choice")
    return NodesKey(layer.model, choices, parameter_map, statistics, n_nodes)


def _recall(key: NodesKey) -> ParameterNodes:
    if key not in _remembered:
        remember_nodes({key: _place_nodes_of_map(*key)})
    return _remembered[key]


def _place_nodes_of_map(
    model: Model, choices: tuple[tuple[str, Value], ...], parameter_map: ParameterMap, statistics: ChannelStatistics,
    n_nodes: int | None,
) -> ParameterNodes:  # fmt: skip
    name = parameter_map.parameter
    ends = np.array([statistics.low, statistics.high])
    low, high = parameter_map.values(ends)
    if np.array_equal(low, high):
        return ParameterNodes(name, (parameter_map.value_at(statistics.low),), (None,))
    if _only_scales(model, name):
        exact = _nodes_of_scale(parameter_map)
        if exact is not None:
            return exact
    grid = _channel_grid(model, parameter_map, statistics)
    edges = np.concatenate([[-1.0], 0.5 * (grid[1:] + grid[:-1]), [2.0]])
    frequency = np.diff(statistics.cumulated(edges))
    products = _inner_products(model, choices, parameter_map, tuple(grid.tolist()), tuple(frequency.tolist()))
    if n_nodes == 1:
        return _single_node(parameter_map, products, frequency, grid)
    numbers = range(FEWEST_NODES, MOST_NODES + 1) if n_nodes is None else (min(n_nodes, _N_GRID),)
    for n in numbers:
        nodes, error = _place_nodes(products, frequency, n)
        if error <= NODE_TOLERANCE:
            break
    weights, _ = _least_squares_weights(products, nodes)
    values = tuple(parameter_map.value_at(grid[i]) for i in nodes)
    knots, hats = tuple(grid.tolist()), _hats(nodes, len(grid))
    curves = [
        ChannelWeight(parameter_map.image, knots, tuple(weights[:, k].tolist()), tuple(hats[:, k].tolist()))
        for k in range(len(nodes))
    ]
    return ParameterNodes(name, values, tuple(curves), error)


def _single_node(
    parameter_map: ParameterMap, products: Float64Array, frequency: Float64Array, grid: Float64Array
) -> ParameterNodes:
    """The one value that is the nearest to all, where maps of other parameters take all layers; arguments: as in
    `_place_nodes`."""
    squared = np.maximum(np.diag(products)[:, None] - 2.0 * products + np.diag(products), 0.0)
    i = int(np.argmin(frequency @ squared**2))
    error = math.sqrt(float(frequency @ squared[:, i]))
    return ParameterNodes(parameter_map.parameter, (parameter_map.value_at(grid[i]),), (None,), error)


def _nodes_of_scale(parameter_map: ParameterMap) -> ParameterNodes | None:
    """The ends of a map of a factor; of ends that differ in brightness alone, the brighter one; None for colours whose
    roots follow the channel, which are no sum of both ends."""
    is_linear = parameter_map.response == "linear"
    knots = np.linspace(0.0, 1.0, 2 if is_linear else _N_GRID)
    values = parameter_map.values(knots)
    low, high = values[0], values[-1]
    if np.allclose(low * high.sum(), high * low.sum(), rtol=1e-9, atol=0.0):
        brightest = int(np.argmax(values.sum(axis=1)))
        ends = [(float(knots[brightest]), values.sum(axis=1) / values[brightest].sum())]
    elif is_linear:
        ends = [(0.0, 1.0 - knots), (1.0, knots)]
    else:
        return None
    return ParameterNodes(
        parameter_map.parameter,
        tuple(parameter_map.value_at(channel) for channel, _ in ends),
        tuple(
            ChannelWeight(parameter_map.image, tuple(knots.tolist()), tuple(w.tolist()), tuple(w.tolist()))
            for _, w in ends
        ),
    )


def _channel_grid(model: Model, parameter_map: ParameterMap, statistics: ChannelStatistics) -> Float64Array:
    """Channel values (N,) from the least to the greatest, ascending, at which the parameter has equal ratios, or equal
    differences where it is not perceived by ratio."""
    low, high = statistics.low, statistics.high
    fine = np.linspace(low, high, 64 * _N_GRID)
    values = parameter_map.values(fine)
    scalar = find_parameter(model.name, model.parameters, parameter_map.parameter)
    if values.shape[1] > 1 or not (scalar.logarithmic and values.min() > 0.0):
        return np.linspace(low, high, _N_GRID)
    position = np.log(values[:, 0])
    position = (position - position[0]) / (position[-1] - position[0])
    grid = np.interp(np.linspace(0.0, 1.0, _N_GRID), position, fine)
    grid[0], grid[-1] = low, high
    return grid


@lru_cache(maxsize=16)
def _inner_products(
    model: Model, choices: tuple[tuple[str, Value], ...], parameter_map: ParameterMap, grid: tuple[float, ...],
    frequency: tuple[float, ...],
) -> Float64Array:  # fmt: skip
    """Inner products (N, N) of the pilot's pictures at channel values (N,), whose mean, weighted by their frequency
    (N,), is 1 under each of the lamps."""
    values = parameter_map.values(np.array(grid))
    found = np.zeros((len(grid), len(grid)))
    for radius in _LAMP_RADII:
        wi, wo, area = _ball_directions(radius)
        pictures = np.empty((len(grid), len(area), 3))
        for i, value in enumerate(values.tolist()):
            own = {**model.defaults(), **dict(choices), parameter_map.parameter: _value(value)}
            reflected = model.brdf(own, wi, wo) * np.maximum(wi[:, 2:], 0.0)
            pictures[i] = reflected.reshape(len(area), _N_SAMPLES, 3).mean(axis=1)
        mean = float(np.array(frequency) @ (pictures.mean(axis=2) @ area))
        rows = (pictures * np.sqrt(area / 3.0)[:, None]).reshape(len(grid), -1) / (mean if mean > 0.0 else 1.0)
        found += rows @ rows.T / len(_LAMP_RADII)
    return found


def _value(numbers: list[float]) -> Value:
    return numbers[0] if len(numbers) == 1 else cast(Value, tuple(numbers))


@lru_cache(maxsize=len(_LAMP_RADII))
def _ball_directions(radius: float) -> tuple[Float64Array, Float64Array, Float64Array]:
    """wi, wo (P · S, 3) in local frames, at points of a ball that is seen from far away, towards samples of a lamp with
    this radius in degrees; and the share (P,) of the ball's picture that each point stands for. Points are dense around
    the middle of the highlight, so that a narrow one is seen by as many as a wide one."""
    # Rings of normals about the half vector between view (+z) and lamp; half of each, because the other half is alike.
    edges = np.radians(np.concatenate([[0.0], np.geomspace(0.5, 90.0, _N_RINGS)]))
    theta, phi = 0.5 * (edges[1:] + edges[:-1]), math.pi * (np.arange(_N_AZIMUTHS) + 0.5) / _N_AZIMUTHS
    theta, width, phi = (each.ravel() for each in np.broadcast_arrays(theta[:, None], np.diff(edges)[:, None], phi))
    normal = _spherical(theta, phi) @ _rotation(0.5 * _LAMP_ANGLE).T
    area = np.maximum(normal[:, 2], 0.0) * np.sin(theta) * width
    normal, area = normal[area > 0.0], area[area > 0.0] / area.sum()
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    # Samples of the lamp: a spiral in which each has the same solid angle.
    i = np.arange(_N_SAMPLES, dtype=np.float64) + 0.5
    angle = np.arccos(1.0 - (1.0 - math.cos(math.radians(radius))) * i / _N_SAMPLES)
    lamp = _spherical(angle, _GOLDEN_ANGLE * i) @ _rotation(_LAMP_ANGLE).T
    wi = np.einsum("pij,sj->psi", frame, lamp).reshape(-1, 3)
    return wi, np.repeat(frame[:, :, 2], _N_SAMPLES, axis=0), area


def _spherical(theta: Float64Array, phi: Float64Array) -> Float64Array:
    """Unit vectors (N, 3) at angles from +z."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)


def _rotation(degrees: float) -> Float64Array:
    """The matrix that tilts +z towards +x."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def _place_nodes(products: Float64Array, frequency: Float64Array, n: int) -> tuple[tuple[int, ...], float]:
    """The positions of n nodes on the grid for which the mean eighth power of the errors is least, and the error:
    relRMSE over the histogram."""

    def cost(nodes: tuple[int, ...]) -> float:
        return float(frequency @ _least_squares_weights(products, nodes)[1] ** 4)

    nodes = tuple(np.round(np.linspace(0, len(products) - 1, n)).astype(int).tolist())
    least = cost(nodes)
    for _ in range(_MOST_SWEEPS):
        before = nodes
        for k in range(n):
            low, high = (nodes[k - 1] if k else -1), (nodes[k + 1] if k + 1 < n else len(products))
            for step in _STEPS:
                moved = (*nodes[:k], nodes[k] + step, *nodes[k + 1 :])
                if low < moved[k] < high and (found := cost(moved)) < least:
                    nodes, least = moved, found
        if nodes == before:
            break
    return nodes, math.sqrt(float(frequency @ _least_squares_weights(products, nodes)[1]))


def _least_squares_weights(products: Float64Array, nodes: tuple[int, ...]) -> tuple[Float64Array, Float64Array]:
    """Weights (N, K) of the nodes at all positions of the grid, whose sum is 1, and the squared errors (N,).

    With a_j = f_j − f_0 of the nodes' pictures, the weights x of all but the first minimize |f − f_0 − Σ x_j a_j|².
    """
    at = np.array(nodes)
    among, to_own = products[np.ix_(at, at)], products[:, at]
    normal = among[1:, 1:] - among[1:, :1] - among[:1, 1:] + among[:1, :1]
    right = to_own[:, 1:] - to_own[:, :1] - among[0, 1:] + among[0, 0]
    x = np.linalg.solve(normal + (_RIDGE * np.trace(normal) + 1e-300) * np.eye(len(normal)), right.T).T
    weights = np.concatenate([1.0 - x.sum(axis=1, keepdims=True), x], axis=1)
    weights[at] = np.eye(len(at))  # exactly, so that a texel at a node is that node
    squared = np.diag(products) - 2.0 * np.einsum("nk,nk->n", weights, to_own)
    squared += np.einsum("nk,kl,nl->n", weights, among, weights)
    return weights, np.maximum(squared, 0.0)


def _hats(nodes: tuple[int, ...], n: int) -> Float64Array:
    """Linear interpolation between two neighbours on the grid, (N, K), constant beyond the first and the last."""
    position = np.arange(n)
    return np.stack([np.interp(position, nodes, each) for each in np.eye(len(nodes))], axis=1)
