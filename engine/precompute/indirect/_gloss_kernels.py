"""Compiled: the glossy layers of a scene, and what they reflect from one direction into another."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect._reflection_kernels import HALF_PI, ONE, ZERO, _node


class GlossyLayers(NamedTuple):
    """The glossy layers of all objects: object o has the layers first[o] to first[o + 1]. models, kinds_a, kinds_b
    (L,), q (L, 8); the values of their curves concatenated (V, 3), the first curve from begin_a (L,), of length n_a
    (L,), the second likewise; gains (L, 3); views (L, N, 3), f_o at even angles. lobe_axes (M,); axes (M, 3, 3): see
    `engine.scene.tangents.tangent_axes`. image (L,): the layer's index into texels (K, C, 3), the factors at the
    records relative to those in the gains; −1 for none."""

    first: np.ndarray
    models: np.ndarray
    kinds_a: np.ndarray
    kinds_b: np.ndarray
    q: np.ndarray
    values: np.ndarray
    begin_a: np.ndarray
    n_a: np.ndarray
    begin_b: np.ndarray
    n_b: np.ndarray
    gains: np.ndarray
    views: np.ndarray
    lobe_axes: np.ndarray
    axes: np.ndarray
    image: np.ndarray
    texels: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _at_layer(g, layer, x, y, z, ox, oy, oz):
    """ρ_q cos θ_i of a glossy layer, 0 where it reflects nothing; node and fraction on f_A, f_B, f_o, see `_node`."""
    q = g.q[layer]
    j, t, k, u = 0, ZERO, 0, ZERO
    weight = np.float32(quotient_cosine(g.models[layer], q, x, y, z, ox, oy, oz))
    # Positions on the curves f_A(γ_A) and f_B(γ_B); beyond π/2 both are 0.
    angle = gamma(g.kinds_a[layer], q, x, y, z, ox, oy, oz)
    if angle > HALF_PI:
        weight = ZERO
    else:
        j, t = _node(angle, g.n_a[layer])
    if g.kinds_b[layer] >= 0:
        angle = gamma(g.kinds_b[layer], q, x, y, z, ox, oy, oz)
        if angle > HALF_PI:
            weight = ZERO
        else:
            k, u = _node(angle, g.n_b[layer])
    # Position on f_o(θ_o).
    position = np.float32(math.acos(min(oz, ONE))) / HALF_PI * np.float32(g.views.shape[1] - 1)
    v = min(np.int64(position), g.views.shape[1] - 2)
    return weight, j, t, k, u, v, position - np.float32(v)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _curve_value(g, begin, n, j, t, c):
    """A curve of n values from `begin` on, between nodes j and j + 1."""
    return (ONE - t) * g.values[begin + j, c] + t * g.values[begin + min(j + 1, n - 1), c]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _view_value(g, layer, record, v, s, c):
    """f_o between its samples v and v + 1, times the texture and weight map at a record, −1 for their mean."""
    value = (ONE - s) * g.views[layer, v, c] + s * g.views[layer, v + 1, c]
    if record >= 0 and g.image[layer] >= 0:
        value *= g.texels[g.image[layer], record, c]
    return value


@nb.njit(cache=True, nogil=True, error_model="numpy")
def add_gloss(g, o, record, x, y, z, ox, oy, oz, factor, out):
    """Adds factor · Σ f_q f_o ρ_q f_A f_B cos θ_i over the glossy layers of object o to out (3,) [BenArtzi07, eq. 3.1],
    with texture and weight maps at a record; −1 for their means."""
    for layer in range(g.first[o], g.first[o + 1]):
        weight, j, t, k, u, v, s = _at_layer(g, layer, x, y, z, ox, oy, oz)
        weight *= factor
        if weight <= ZERO:
            continue
        for c in range(3):
            value = _curve_value(g, g.begin_a[layer], g.n_a[layer], j, t, c)
            if g.kinds_b[layer] >= 0:
                value *= _curve_value(g, g.begin_b[layer], g.n_b[layer], k, u, c)
            out[c] += weight * g.gains[layer, c] * value * _view_value(g, layer, record, v, s, c)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def gloss_without_curve(g, layer, of_a, record, x, y, z, ox, oy, oz, factor, out):
    """As `add_gloss` for one layer, without f_q and without one of its curves, f_A if of_a, else f_B: writes out (3,)
    and returns the position on that curve in bands."""
    weight, j, t, k, u, v, s = _at_layer(g, layer, x, y, z, ox, oy, oz)
    for c in range(3):
        value = factor * weight * _view_value(g, layer, record, v, s, c)
        if g.kinds_b[layer] >= 0:
            if of_a:
                value *= _curve_value(g, g.begin_b[layer], g.n_b[layer], k, u, c)
            else:
                value *= _curve_value(g, g.begin_a[layer], g.n_a[layer], j, t, c)
        out[c] = value
    return np.float32(j) + t if of_a else np.float32(k) + u
