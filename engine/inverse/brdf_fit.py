"""Brings a layer as near to another BRDF as its model can come, by a change of its curves, and by parameters that no
curve has.

The BRDF of a layer is f_q rho_q f_o f_A f_B [BenArtzi07, eq. 3.1], as linear in a curve as a picture is, so that the
same problem is solved (`layer_fit`), with samples over the half and difference angles [Rusinkiewicz98] in place of
pixels. What is in the quotient, such as the roughness in Smith's term, is searched for: for each value the curves are
solved for, and the least error decides.

Errors are relative to the sample and to the mean, as those of pixels: a highlight and what surrounds it count alike.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from engine.core.errors import InsituError
from engine.curve.tables import HALF_PI, Float64Array
from engine.inverse.change_operator import change_operator
from engine.inverse.curve_fit import RELATIVE_ERROR, SCALE, radiance_weights
from engine.inverse.layer_fit import Curves, Rows, fit_layers
from engine.inverse.parameter_search import N_SCANNED, N_SECTIONS, search_parameter
from engine.material.layer import Layer, curve_angles, evaluate_layer, quotient_cosines
from engine.measured.measurement import directions_at

Reflectance = Callable[[Float64Array, Float64Array], Float64Array]
# Samples over theta_h, denser towards 0 as highlights are, theta_d and phi_d.
N_HALF, N_DIFFERENCE, N_AZIMUTHS = 96, 24, 12
N_BANDS = 64
# A BRDF says as much of a curve as a whole picture does.
SMOOTHNESS = 1e-6
# Below this angle to the surface a sample does not count: pictures see little of it, and models differ most.
_GRAZING = np.cos(np.radians(85.0))
_GOLDEN = (1.0 + 5.0**0.5) / 2.0
# How often each parameter that is searched for has its turn.
N_SWEEPS = 2
# One sample of so many decides where a parameter is searched for.
THINNED = 5
# Larger values are this one: their squares and weights stay finite.
_MOST = 1e30


@dataclass(frozen=True, eq=False)
class MatchedLayer:
    """layer: with its parameters and one operator a curve; error: of its BRDF times cos theta_i, by root mean square
    relative to that of the target, both weighted as in the fit; before: that of the layer as it was."""

    layer: Layer
    error: float
    before: float


@dataclass(frozen=True, eq=False)
class LayerSamples:
    """A layer at n pairs of directions wi, wo (n, 3) in its frame; curves: band values (J, 3) by name."""

    layer: Layer
    wi: Float64Array
    wo: Float64Array
    curves: Curves

    def n_bands(self, name: str) -> int:
        """J of a curve, 0 where it has none of this name."""
        return 1 if name == SCALE else len(self.curves.get(name, ()))

    def rows(self, name: str, changed: Curves) -> Rows:
        """The BRDF times cos theta_i (J, n, 3) for a 1 in each band of a curve, with the others as in `changed`."""
        now = {**self.curves, **changed}
        value = self._fixed if name == SCALE else self._fixed * now.get(SCALE, 1.0)
        for other, hats in self._hats.items():
            if other != name:
                value = value * (hats.T @ now[other])
        return value[None] if name == SCALE else self._hats[name][:, :, None] * value

    @cached_property
    def _fixed(self) -> Float64Array:
        """f_q rho_q f_o cos theta_i (n, 3)."""
        theta_o = np.arccos(np.clip(self.wo[:, 2], -1.0, 1.0))
        return self.layer.scale() * quotient_cosines(self.layer, self.wi, self.wo) * self.layer.view_curve(theta_o)

    @cached_property
    def _hats(self) -> dict[str, Float64Array]:
        """The weight (J, n) of each band of each curve at each sample."""
        return {
            name: _hat_weights(curve_angles(self.layer, name, self.wi, self.wo), len(values))
            for name, values in self.curves.items()
        }


def _hat_weights(gamma: Float64Array, n_bands: int) -> Float64Array:
    """The weight (J, n) of each node at angles (n,): linear between nodes, constant beyond the ends."""
    position = np.clip(gamma * (n_bands / HALF_PI) - 0.5, 0.0, n_bands - 1.0)
    below = np.minimum(position.astype(np.intp), max(n_bands - 2, 0))
    weights, at = np.zeros((n_bands, len(gamma))), np.arange(len(gamma))
    weights[below, at] = 1.0 - (position - below)
    weights[np.minimum(below + 1, n_bands - 1), at] += position - below
    return weights


def match_layer(
    target: Reflectance, layer: Layer, names: Sequence[str], searched: Sequence[str] = (), n_bands: int = N_BANDS
) -> Generator[float, None, MatchedLayer]:
    """The layer that is nearest to a BRDF; a generator of the share that is done.

    target: the BRDF times cos theta_i, (n, 3), of directions wi, wo (n, 3) in the local frame; names: the curves that
    change, of the layer as generated; searched: scalar parameters that are searched for within their ranges, by some of
    the samples. Raises InsituError for a model two of whose angles have one curve, and for a BRDF that is not finite.
    """
    check_curves(layer)
    yield 0.0
    samples = _sample(target)
    names = [factor.name for factor in layer.model.factors if factor.name in names]
    before = _relative(samples.wanted - evaluate_layer(layer, samples.wi, samples.wo), samples)
    start = layer.replace(edits=())
    best = _fit(start, samples, names, n_bands)
    # The parameters, one after the other; one alone is found in its first turn.
    few, nearest = samples.thinned(), start
    n_sweeps = N_SWEEPS if len(searched) > 1 else 1
    n_done, n_trials = 0, n_sweeps * len(searched) * (N_SCANNED + N_SECTIONS)
    for _ in range(n_sweeps):
        for name in searched:
            for nearer in _search(lambda each: _fit(each, few, names, n_bands).error, nearest, name):
                nearest, n_done = nearer, n_done + 1
                yield n_done / (n_trials + 1)
    if nearest != start:
        best = min(best, _fit(nearest, samples, names, n_bands), key=lambda each: each.error)
    return MatchedLayer(best.layer, best.error, before)


@dataclass(frozen=True, eq=False)
class _Target:
    """The wanted BRDF times cos theta_i (n, 3) at pairs of directions (n, 3), and the weights (n, 3) of its errors."""

    wi: Float64Array
    wo: Float64Array
    wanted: Float64Array
    weights: Float64Array

    def thinned(self) -> _Target:
        """Some of the samples. Their number is prime to those of angles, so that all angles stay."""
        return _Target(*(each[::THINNED] for each in (self.wi, self.wo, self.wanted, self.weights)))


def _sample(target: Reflectance) -> _Target:
    wi, wo, measure = sample_directions()
    wanted = np.asarray(target(wi, wo), np.float64)
    if not np.isfinite(wanted).all():
        raise InsituError("the BRDF to match has values that are not finite numbers")
    wanted = np.minimum(wanted, _MOST)
    return _Target(wi, wo, wanted, radiance_weights(wanted, RELATIVE_ERROR) * measure[:, None])


def check_curves(layer: Layer) -> None:
    """Raises InsituError for a model two of whose angles have one curve: its product with itself is not linear."""
    if layer.model.shared:
        raise InsituError(f"{layer.model.label} has one curve for two angles and cannot be matched")


def _fit(layer: Layer, of: _Target, names: Sequence[str], n_bands: int) -> MatchedLayer:
    """The layer with the curves that fit best under its parameters."""
    samples = _samples(layer, of.wi, of.wo, n_bands)
    missing = of.wanted - _value(samples)
    found = fit_layers([samples], names, missing, of.weights, smoothness=SMOOTHNESS)
    for name, fit in found.fits.items():
        operator = change_operator(fit.change, samples.curves[name])
        layer = layer if operator is None else layer.with_operators(name, (operator,))
    return MatchedLayer(layer, _relative(found.left, of), 0.0)


def _search(error_of: Callable[[Layer], float], layer: Layer, name: str) -> Iterator[Layer]:
    """The layer of the least error so far, at each trial of a scalar parameter: over all of its range, then by golden
    section about the best of these."""
    parameter = next(each for each in layer.parameter_table if each.name == name)
    trials = search_parameter(parameter, lambda value: error_of(layer.with_parameter(name, value)))
    return (layer.with_parameter(name, value) for _, value in trials)


@lru_cache(maxsize=1)
def sample_directions() -> tuple[Float64Array, Float64Array, Float64Array]:
    """wi, wo (n, 3) above the surface, over half and difference angles, each half vector turned to another azimuth, and
    the weight (n,) of each: the smaller cosine, which is how much of a picture sees it."""
    theta_h = HALF_PI * ((np.arange(N_HALF) + 0.5) / N_HALF) ** 2
    theta_d = HALF_PI * (np.arange(N_DIFFERENCE) + 0.5) / N_DIFFERENCE
    phi_d = np.pi * (np.arange(N_AZIMUTHS) + 0.5) / N_AZIMUTHS
    wi, wo = (each.reshape(-1, 3) for each in directions_at(theta_h[:, None, None], theta_d[:, None], phi_d))
    turn = np.asarray(2.0 * np.pi * ((_GOLDEN * np.arange(len(wi))) % 1.0), np.float64)
    wi, wo = (_turned(each, turn) for each in (wi, wo))
    measure = np.minimum(wi[:, 2], wo[:, 2])
    kept = measure > _GRAZING
    return wi[kept], wo[kept], measure[kept]


def _turned(directions: Float64Array, angle: Float64Array) -> Float64Array:
    """Directions (n, 3) turned about the normal by angles (n,)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = cosine * directions[:, 0] - sine * directions[:, 1], sine * directions[:, 0] + cosine * directions[:, 1]
    return np.stack([x, y, directions[:, 2]], axis=1)


def _samples(layer: Layer, wi: Float64Array, wo: Float64Array, n_bands: int) -> LayerSamples:
    """The layer with its curves in so many bands."""
    curves = {factor.name: layer.coefficients(factor.name, n_bands) for factor in layer.model.factors}
    return LayerSamples(layer, wi, wo, curves)


def _value(samples: LayerSamples) -> Float64Array:
    """The BRDF times cos theta_i (n, 3), by bands."""
    return np.asarray(samples.rows(SCALE, {})[0], np.float64)


def _relative(left: Rows, of: _Target) -> float:
    """What is left (n, 3), relative to what is wanted, in the sense of the weights."""
    size = float(np.sum(of.weights * of.wanted**2))
    return float(np.sqrt(np.sum(of.weights * np.square(left)) / size)) if size > 0.0 else 0.0
