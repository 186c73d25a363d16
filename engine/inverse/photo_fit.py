"""Finds the material of an object that a photograph shows, in alternating steps.

With P the photograph at the pixels of the object, e its exposure and L what the layers reflect, P / e = L is solved for

    the exposure     by the rest of the picture, whose materials are known
    parameters       that are in a quotient, such as a roughness: by trial, with the scales that fit each best
    curves, scales   all layers at once by least squares, each curve relative to the one that its parameters generate
                     (`curve_fit`), which is what remains where the picture says nothing

and again, in the light between surfaces that the found material makes. A quarter of the pixels is held back: these
judge trials, and decide which round was the best. Pixels that no material explains, such as the photographer's
reflection, lose their weight in proportion to how far they are off [Huber64].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress
from engine.inverse.change_operator import change_operator
from engine.inverse.curve_fit import SCALE, CurveFit, fit_change, normal_equations, radiance_weights
from engine.inverse.parameter_search import search_parameter
from engine.inverse.photo_targets import Target, scale_parameter
from engine.inverse.photo_view import PhotoView
from engine.material.layer import Layer
from engine.material.parameters import Parameter
from engine.render.still import StillLayer

Float64Array = NDArray[np.float64]
Layers = tuple[Layer, ...]
# Rows (J, n, 3) of light between surfaces, by the number of a layer of the scene and the name of its curve.
Between = dict[int, dict[str, NDArray[np.floating]]]
# The layers of an object with another in place of that of this number: those that share its curves follow.
Relink = Callable[[Layers, int, Layer], Layers]

# One pixel of so many is held back.
HELD_BACK = 4
# Rounds at most, and by how much one must improve the error of the pixels that are held back to be followed by another.
MOST_ROUNDS, LEAST_GAIN = 6, 0.005
# How often the curves of a layer with two are solved in turn.
N_TURNS = 3
# How much stiffer curves may be than one that changes by about its own size: the pixels that were held back decide.
STIFFNESSES = (1.0, 10.0, 100.0, 1e3, 1e4, 1e6)
# Multiples of the usual error from which on a pixel loses weight, and how often weights are found.
_OUTLYING, N_REWEIGHTED = 3.0, 3
_MEDIAN_TO_DEVIATION = 1.4826
# The least error of pixels, relative to that of their weights.
_LEAST_NOISE = 0.1
# Values of the rest of the picture, of all channels, that say what the exposure is.
_LEAST_KNOWN = 48
# A scale below this share of its range is measured against that.
_LEAST_SCALE = 0.05
# Standard deviations by which a trial must be better: the best of a dozen is by chance this good.
_CHANCE = 2.5


@dataclass(frozen=True, eq=False)
class PhotoPixels:
    """A photograph where it is compared. seen, error (P, 3): at the points of the view, in its own unit, and the
    standard deviation of its error; beside (m, 3): of pixels that show light as it comes from a known source, and known
    (m, 3) what that is."""

    seen: Float64Array
    error: Float64Array
    beside: Float64Array = field(default_factory=lambda: np.zeros((0, 3)))
    known: Float64Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class PhotoMatch:
    """layers: of the object; exposure: the factor from radiance to the photograph; error: relRMSE of the pixels that
    were held back, and before: the same of the material as it was; deviations (J, 3): the standard deviation of each
    curve, by layer and name, its size where the picture says nothing; n_pixels: how many were compared, those that were
    held back among them."""

    layers: Layers
    exposure: float
    error: float
    before: float
    deviations: dict[Target, Float64Array]
    n_pixels: int


@dataclass(frozen=True, eq=False)
class _State:
    """starts: the layers with the parameters that were found, below the change of their curves; layers: with it;
    indirect (P, 3): light between surfaces as the layers `lit` make it."""

    starts: Layers
    layers: Layers
    exposure: float
    indirect: Float64Array
    lit: Layers
    deviations: dict[Target, Float64Array] = field(default_factory=dict)


class PhotoFit:
    """The search for one object's material. still: all layers of the scene, those of the object among them in their
    order; places: the number of each among `layers`, which are all of the object; pixels: the photograph at the view's
    points; targets: what is to be found, the rest stays; exposure: from radiance to the photograph, None to find it."""

    def __init__(
        self, view: PhotoView, still: Sequence[StillLayer], i_object: int, layers: Layers, places: Sequence[int],
        pixels: PhotoPixels, targets: Sequence[Target], relink: Relink, exposure: float | None = None,
    ) -> None:  # fmt: skip
        self._view, self._still, self._object, self._relink = view, tuple(still), i_object, relink
        own = [i for i, each in enumerate(still) if each.i_object == i_object]
        self._own = dict(zip(places, own, strict=True))  # the place of each of its layers among all
        self._rows = view.rows_of(i_object)
        self._others = np.setdiff1d(np.arange(len(pixels.seen)), self._rows)
        self._pixels, self._exposure = pixels, exposure
        self._solved = [each for each in targets if self._is_linear(layers, each)]
        self._searched = [each for each in targets if not self._is_linear(layers, each)]
        self._first = layers
        self._held_back = np.arange(len(self._rows)) % HELD_BACK == 0
        of_others = [each for each in still if each.i_object != i_object]
        self._others_direct = view.direct(of_others)[self._others]
        self.knows_exposure = True  # the user, or the rest of the picture, says what it is

    @staticmethod
    def _is_linear(layers: Layers, target: Target) -> bool:
        return target.name == SCALE or target.name in layers[target.layer].model.curve_names

    def run(self) -> Generator[StillProgress, None, PhotoMatch]:
        """Find the material; a generator of progress."""
        state = self._with_light(_State(self._first, self._first, 1.0, np.zeros((0, 3)), self._first))
        before = best_error = self._error(state)
        best, n_trials = state, max(len(self._searched), 1)
        for round_ in range(MOST_ROUNDS):
            share = round_ / MOST_ROUNDS
            for number, target in enumerate(self._searched):
                for done, found in self._search(state, target, is_first=round_ == 0):
                    state = found
                    yield StillProgress(share + (number + done) / n_trials / MOST_ROUNDS, f"trying {target.name}")
            state = self._with_curves(self._with_scales(state))
            yield StillProgress(share + 1.0 / MOST_ROUNDS, "light between surfaces")
            state = self._with_light(state)
            error = self._error(state)
            if not error < (1.0 - LEAST_GAIN) * best_error:
                best, best_error = (state, error) if error < best_error else (best, best_error)
                if round_:
                    break
            else:
                best, best_error = state, error
        return PhotoMatch(best.layers, best.exposure, best_error, before, best.deviations, len(self._rows))

    # ------------------------------------------------------------------------------------------------- light and error

    def _with_light(self, state: _State) -> _State:
        """A state with the light between surfaces that its layers make, and the exposure in it."""
        indirect = self._view.indirect(self._stills(state.layers))
        return replace(state, indirect=indirect, lit=state.layers, exposure=self._found_exposure(indirect))

    def _found_exposure(self, indirect: Float64Array) -> float:
        """The exposure that the rest of the picture shows; 1 where there is none."""
        if self._exposure is not None:
            return self._exposure
        light = np.concatenate([self._others_direct + indirect[self._others], self._pixels.known]).ravel()
        seen = np.concatenate([self._pixels.seen[self._others], self._pixels.beside]).ravel()
        counts = (light > 1e-3 * light.mean()) & (seen > 0.0) if light.size else np.zeros(0, bool)
        self.knows_exposure = int(counts.sum()) >= _LEAST_KNOWN
        if not self.knows_exposure:
            return 1.0
        # By ratio: the median is not moved by what has another material than the scene says.
        return float(np.exp(np.median(np.log(seen[counts] / light[counts]))))

    def _wanted(self, state: _State) -> tuple[Float64Array, Float64Array]:
        """The radiance (n, 3) that the object's pixels are to have, and their weights (n, 3)."""
        wanted = self._pixels.seen[self._rows] / state.exposure
        variance = 1.0 / radiance_weights(wanted) + np.square(self._pixels.error[self._rows] / state.exposure)
        return wanted, 1.0 / variance

    def _missing(self, state: _State) -> Float64Array:
        """What is missing at the object's pixels, (n, 3)."""
        own = [each for each in self._stills(state.layers) if each.i_object == self._object]
        shown = sum(self._view.reflected(each) for each in own) + state.indirect[self._rows]
        return np.asarray(self._wanted(state)[0] - shown)

    def _error(self, state: _State) -> float:
        """relRMSE of the pixels that are held back."""
        wanted, missing = self._wanted(state)[0][self._held_back], self._missing(state)[self._held_back]
        size = float(np.sum(wanted**2))
        return math.sqrt(float(np.sum(missing**2)) / size) if size > 0.0 else 0.0

    def _stills(self, layers: Layers) -> tuple[StillLayer, ...]:
        """All layers of the scene, with these of the object."""
        still = list(self._still)
        for place, at in self._own.items():
            still[at] = replace(still[at], layer=layers[place])
        return tuple(still)

    # -------------------------------------------------------------------------------------------- parameters and scales

    def _search(self, state: _State, target: Target, is_first: bool) -> Iterator[tuple[float, _State]]:
        """The best state so far, at each trial of a parameter, and the share of the trials that is done: at first over
        its whole range, with scales alone where the layer's is to be found."""
        with_curves = not is_first or Target(target.layer, SCALE) not in self._solved

        def fitted(trial: _State) -> _State:
            scaled = self._with_scales(trial)
            return self._with_curves(scaled, is_trial=True) if with_curves else scaled

        layer = state.starts[target.layer]
        parameter = next(p for p in layer.parameter_table if p.name == target.name)
        first, known = fitted(state), dict[float, _State]()

        def error(value: float) -> float:
            known[value] = fitted(replace(state, starts=self._changed(state.starts, target.layer, target.name, value)))
            return self._error(known[value])

        now = layer.values[target.name]
        assert isinstance(now, float)
        for done, value in search_parameter(parameter, error, None if is_first else now):
            yield done, known[value] if self._is_better(known[value], first) else first

    def _is_better(self, one: _State, other: _State) -> bool:
        """Whether a state is nearer to the pixels that are held back, by more than chance."""
        gain = self._squares(other) - self._squares(one)
        return float(gain.mean()) > _CHANCE * float(gain.std()) / math.sqrt(len(gain))

    def _squares(self, state: _State) -> Float64Array:
        """The squared errors (n,) of the pixels that are held back, in the sense of the weights."""
        weighted = self._wanted(state)[1] * np.square(self._missing(state))
        return np.asarray(np.sum(weighted[self._held_back], axis=1))

    def _with_scales(self, state: _State) -> _State:
        """A state of the starts alone, those scaled to fit best whose scale is to be found."""
        state = replace(state, layers=state.starts)
        starts = self._scaled(state, [each for each in self._solved if each.name == SCALE])
        return replace(state, starts=starts, layers=starts)

    def _scaled(self, state: _State, chosen: Sequence[Target]) -> Layers:
        """The starts with the scales of these layers that fit best, each within the range of its parameter."""
        from scipy.optimize import lsq_linear

        if not chosen:
            return state.starts
        blocks = [self._block(state, target, {}) for target in chosen]
        root = np.sqrt(self._wanted(state)[1] * ~self._held_back[:, None])
        missing = self._missing(state) + sum(np.einsum("jnc,jc->nc", rows, now) for rows, now, _ in blocks)
        parameters = [self._scale_parameter(state.starts[target.layer]) for target in chosen]
        # A coloured scale is three numbers, each of one channel; a scalar one number of all.
        columns, owners = [], []
        for number, ((rows, _, _), parameter) in enumerate(zip(blocks, parameters, strict=True)):
            parts = np.eye(3) if parameter.kind == "rgb" else np.ones((1, 3))
            columns += [(rows[0] * part * root).ravel() for part in parts]
            owners += [number] * len(parts)
        matrix, vector = np.stack(columns, axis=1), (missing * root).ravel()
        unit = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)  # scales of strong and weak layers alike
        least, most = (np.array([getattr(parameters[i], end) for i in owners]) for end in ("minimum", "maximum"))
        found = lsq_linear(matrix / unit, vector, (least * unit, np.maximum(most, least + 1e-9) * unit)).x / unit
        starts = state.starts
        for number, (target, parameter) in enumerate(zip(chosen, parameters, strict=True)):
            values = [float(x) for x, owner in zip(found, owners, strict=True) if owner == number]
            starts = self._changed(
                starts, target.layer, parameter.name, tuple(values) if len(values) > 1 else values[0]
            )
        return starts

    @staticmethod
    def _scale_parameter(layer: Layer) -> Parameter:
        parameter = scale_parameter(layer)
        assert parameter is not None  # or it would be no target
        return parameter

    def _changed(self, layers: Layers, i: int, name: str, value: object) -> Layers:
        return self._relink(layers, i, layers[i].with_parameter(name, value))

    # ----------------------------------------------------------------------------------------------------------- curves

    def _with_curves(self, state: _State, is_trial: bool = False) -> _State:
        """A state with the curves that fit best, each as a change of the one that its parameters generate; in a trial
        light between surfaces stays as it is."""
        curves: dict[int, list[Target]] = {}
        for target in self._solved:
            if target.name != SCALE:
                curves.setdefault(target.layer, []).append(target)
        scaled = [each for each in self._solved if each.name == SCALE and each.layer not in curves]
        if not curves:
            starts = self._scaled(state, scaled)
            return replace(state, starts=starts, layers=starts)
        most = max(map(len, curves.values()))
        for turn in range(N_TURNS * most if most > 1 else 1):
            chosen = [own[turn % len(own)] for own in curves.values()]
            change, deviations = self._solve(state, chosen, scaled, is_trial)
            layers = self._with_changes(state, change)
            state = replace(state, layers=layers, deviations={**state.deviations, **deviations})
            starts = self._scaled(state, scaled)
            state = replace(state, starts=starts)
            state = replace(state, layers=self._with_changes(state, {}))
        return state

    def _with_changes(self, state: _State, change: dict[Target, Float64Array]) -> Layers:
        """The starts with these changes of curves, and those that other curves have."""
        layers = state.starts
        for i in dict.fromkeys(target.layer for target in self._solved):
            layer, start = layers[i], state.starts[i]
            for name in (target.name for target in self._solved if target.layer == i and target.name != SCALE):
                found = change.get(Target(i, name))
                if found is None:
                    layer = layer.with_operators(name, state.layers[i].operators(name))
                    continue
                operator = change_operator(found, start.coefficients(name, len(found)))
                kept = start.operators(name)
                layer = layer.with_operators(name, kept if operator is None else (*kept, operator))
            layers = self._relink(layers, i, layer)
        return layers

    def _rows_between(self, state: _State, chosen: Sequence[Target]) -> Between:
        """The rows of the light between surfaces that there is, of these targets' layers."""
        still, wanted = self._stills(state.lit), {}
        for target in chosen:
            for place in self._sharing(state.lit, target):
                layer = state.lit[place]
                wanted[self._own[place]] = layer.model.factors[0].name if target.name == SCALE else target.name
        return self._view.rows_between(still, wanted)

    def _solve(
        self, state: _State, chosen: Sequence[Target], scaled: Sequence[Target], is_trial: bool
    ) -> tuple[dict[Target, Float64Array], dict[Target, Float64Array]]:
        """The changes (J, 3) of these curves from the starts, and their standard deviations; all layers at once, those
        that are scaled alone as well."""
        targets, wanted = [*chosen, *scaled], self._missing(state)
        between = {} if is_trial else self._rows_between(state, targets)
        blocks = [self._block(state, target, between) for target in targets]
        for rows, now, before in blocks:
            # What each is to add to what it was at the start.
            wanted = wanted + np.einsum("jnc,jc->nc", rows, now - before)
        # The light between surfaces has its last reflection by the curves that it was made with, and is to have it by
        # those that are solved for.
        wanted = wanted + self._reflected_last(state.lit, between) - self._reflected_last(state.layers, between)
        rows = np.concatenate([rows for rows, _, _ in blocks])
        changes = self._least_squares(rows, wanted, self._wanted(state)[1], [before for _, _, before in blocks])
        found = dict(zip(targets, changes, strict=True))
        return {t: found[t][0] for t in chosen}, {t: found[t][1] for t in chosen}

    def _reflected_last(self, layers: Layers, between: Between) -> Float64Array | float:
        """The light between surfaces (n, 3) that these curves reflect last, by its rows."""
        still, light = self._stills(layers), 0.0
        for at, rows in between.items():
            pixels = self._view.pixels(still[at], rows, is_scaled=True)
            light += sum(np.einsum("jnc,jc->nc", each, pixels.curves[name]) for name, each in pixels.indirect.items())
        return light

    def _block(
        self, state: _State, target: Target, between: Between
    ) -> tuple[NDArray[np.floating], Float64Array, Float64Array]:
        """The rows (J, n, 3) of a curve, its values (J, 3) as they are and at the start; of a scale, whose value is
        that of its parameter, the same with J = 1."""
        layers, is_scale = state.layers, target.name == SCALE
        layer = layers[target.layer]
        if is_scale:
            parameter = self._scale_parameter(layer)
            unit = (1.0, 1.0, 1.0) if parameter.kind == "rgb" else 1.0
            layers = self._changed(layers, target.layer, parameter.name, unit)
        still = self._stills(layers)
        own = [
            self._view.pixels(still[self._own[i]], between.get(self._own[i], {}), is_scaled=True)
            for i in self._sharing(layers, target)
        ]
        if is_scale:
            now = np.broadcast_to(np.asarray(layer.values[parameter.name], np.float64), 3)[None]
            before = np.maximum(now, _LEAST_SCALE * parameter.maximum)
        else:
            now = own[0].curves[target.name]
            before = state.starts[target.layer].coefficients(target.name, len(now))
        alike = [each for each in own if each.n_bands(target.name) == len(now)]
        return np.asarray(sum(each.rows(target.name, {}) for each in alike)), now, before

    def _least_squares(
        self, rows: NDArray[np.floating], wanted: Float64Array, weights: Float64Array, before: Sequence[Float64Array]
    ) -> list[tuple[Float64Array, Float64Array]]:
        """The changes and deviations of curves whose rows (J, n, 3) lie behind each other."""
        start, counts = np.concatenate(before), tuple(map(len, before))
        decides, robust, noise = ~self._held_back, np.ones(len(wanted)), 1.0

        def fitted(stiffness: float) -> tuple[CurveFit, Float64Array]:
            fit = fit_change(equations, start, counts=counts, prior=stiffness, noise=noise)
            return fit, wanted - np.einsum("jnc,jc->nc", rows, fit.change)

        for _ in range(N_REWEIGHTED):
            equations = normal_equations(rows, wanted, weights * (robust * decides)[:, None])
            _, left = fitted(1.0)
            off = np.sqrt(np.mean(weights * np.square(left), axis=1))
            # Weights say how precise pixels could be, and what is left how precise the model is.
            noise = max(_MEDIAN_TO_DEVIATION * float(np.median(off)), _LEAST_NOISE)
            robust = np.minimum(1.0, _OUTLYING * noise / np.maximum(off, 1e-300))
        tried = [fitted(stiffness) for stiffness in STIFFNESSES]
        held = self._held_back
        squares = [np.sum((weights * robust[:, None] * left**2)[held], axis=1) for _, left in tried]
        fit, deviation = tried[_stiffest(squares)][0], tried[0][0].deviation
        ends = np.cumsum(counts)[:-1]
        return list(zip(np.split(fit.change, ends), np.split(deviation, ends), strict=True))

    def _sharing(self, layers: Layers, target: Target) -> list[int]:
        """The visible layers that a target changes: its own first, and those that follow it and have the curve."""
        leader = layers[target.layer]
        follows = [
            i for i, layer in enumerate(layers) if layer.follows and layer.follows in (leader.name, leader.follows)
            and i in self._own and (layer.rises if target.name == SCALE else target.name in layer.model.curve_names)
        ]  # fmt: skip
        return [target.layer, *(i for i in follows if i != target.layer)]


def _stiffest(squares: Sequence[Float64Array]) -> int:
    """The last of several fits, by their squared errors (n,) at the same pixels, that is worse than the best by no more
    than chance."""
    best = min(range(len(squares)), key=lambda i: float(squares[i].sum()))

    def is_as_good(i: int) -> bool:
        more = squares[i] - squares[best]
        return float(more.mean()) <= float(more.std()) / math.sqrt(max(len(more), 1))

    return max(i for i in range(len(squares)) if is_as_good(i))
