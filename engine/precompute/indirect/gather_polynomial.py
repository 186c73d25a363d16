"""Freezes indirect light for the edits of an object: contracts it into the polynomials that an edit needs.

With n the power of the edited object's albedo [BenArtzi07, eq. 6.7, 6.8] they are Σ_n d^n V_n for every layer, and for
the selected one Σ_n d^n Σ_j c_j F_jn. What an edited curve sends on at the second bounce is frozen by its change, see
`edited_gloss`.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.edited_gloss import (
    EditedGloss,
    EditedReceiver,
    KnotReceiver,
    PairReceiver,
    PowerReceiver,
    Receiver,
    choose_knots,
    choose_modes,
    edited_gloss,
    knot_table,
)
from engine.precompute.indirect.frozen_light import FrozenCurve, FrozenGloss, FrozenLight, SelectedCurve
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of, is_glossy
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import NO_OBJECT
from engine.precompute.indirect.reflection import HemisphereSamples, OutgoingRadiance

# Light of an edited curve at the second bounce that is stored, relative to all that other layers reflect.
LEAST_EFFECT = 1e-4


def _mean_light(layers: Sequence[IndirectLayer], reflected: Mapping[int, NDArray[np.float32]]) -> float:
    """The light that layers reflect, times their f_q, summed over all points; as if the edited object were black."""
    return sum(float(part[:, 0].sum(axis=1, dtype=np.float64) @ layers[i].gain) for i, part in reflected.items())


def _frozen_curve(values: NDArray[np.float64], bands: NDArray[np.float32]) -> FrozenCurve:
    """A curve (J, 3) at the first bounce and modes of its changes, by the light of its bands (3, J, D, p)."""
    met = np.abs(bands[:, :, 0]).sum(axis=(0, 2), dtype=np.float64)
    return FrozenCurve(values, choose_modes(met, values))


Freezing = Generator[FrozenLight | None, None, FrozenLight]


class Representation(Protocol):
    """A representation of indirect light for edits."""

    @property
    def n_bytes(self) -> int:
        """Memory in addition to the traced rays."""

    def freeze(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, curves: Sequence[SelectedCurve] = ()
    ) -> Freezing:
        """The light under these layers as a polynomial in the albedo of the object `edited`, and by band of these
        curves of it, one of a layer. A generator of steps; one of them yields the light in which what the edited curves
        send on to other surfaces stays as it is, where that is known earlier."""


class GatherPolynomial:
    """The default: the records that the gather points' rays hit, times a polynomial at the records, which all points
    share.

    Measured against the thesis' tensor (`dense`) with the same 512 rays of 951 gather points, a Cornell box divided
    into M objects with one curve of 64 bands each, N bounces (`make measure`, indirect_representations.csv; seconds
    of one processor, both pictures within 3e-7 of the plain sum):

         M  N    MB: this, dense    s to make after tracing    s to freeze
         2  4       4.2     6.6            0.05  0.09          0.026  0.003
         4  4       4.2    24.8            0.04  0.22          0.031  0.005
         7  4       4.2    86.9            0.04  0.57          0.023  0.054
        12  4       4.2   331.6            0.05  2.82          0.022  0.241
         7  2       3.9     5.1            0.04  0.06          0.020  0.001
         7  3       4.2    25.6            0.04  0.14          0.019  0.005
         7  5       4.2   240.3            0.05  2.05          0.030  0.212

    A small tensor freezes faster. But it grows with C(M + N - 1, N - 1), to 1.5 GB at the 16,300 gather points of the
    built-in Cornell box (the thesis stored 1,461 MB). It must be rebuilt for another light or roughness, and a second
    curve or bands at the second bounce would multiply it again.
    """

    def __init__(self, light: IndirectLight, keeps: bool = True) -> None:
        """keeps: store what does not depend on curves, for the next freezing."""
        self._light, self._keeps = light, keeps
        self._samples: dict[int, HemisphereSamples] = {}

    def reflect(
        self, layers: Sequence[IndirectLayer], light: OutgoingRadiance
    ) -> Generator[None, None, list[NDArray[np.float32]]]:
        """What each layer reflects of a light at its points towards the camera, (p, D, 3), without f_q and f_o. A
        generator of steps."""
        reflected: dict[int, NDArray[np.float32]] = {}
        for samples, own in self._all_samples(layers):
            reflected |= zip(own, (yield from samples.reflect([layers[i].curves for i in own], light)), strict=True)
        return [reflected[i] for i in range(len(layers))]

    def with_light(self, light: IndirectLight) -> GatherPolynomial:
        """The same for another light; reuses the ray weights if rays, photons and filter are the same."""
        other, (before, now) = GatherPolynomial(light, self._keeps), (self._light.points, light.points)
        if all(getattr(before, name) is getattr(now, name) for name in ("samples", "landed", "smoothing")):
            other._samples = self._samples
        return other

    @property
    def n_bytes(self) -> int:
        return sum(samples.n_bytes for samples in self._samples.values())

    def freeze(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, curves: Sequence[SelectedCurve] = ()
    ) -> Freezing:
        light = self._light.outgoing_radiance(layers, edited, curves)
        yield None
        reflected: dict[int, NDArray[np.float32]] = {}
        bands: dict[int, NDArray[np.float32]] = {}
        factors = {curve.layer: curve.factor for curve in curves}
        for samples, own in self._all_samples(layers):
            samples.forget_all_but([layers[i].curves for i in own])
            whole = [i for i in own if i not in factors]
            found = yield from samples.reflect([layers[i].curves for i in whole], light)
            reflected |= zip(whole, (np.ascontiguousarray(each.T) for each in found), strict=True)
            for i in own:
                if i in factors:
                    bands[i] = yield from samples.by_band(layers[i].curves, factors[i], light)
        gloss, least = [], LEAST_EFFECT * _mean_light(layers, reflected)
        of_curves = self._edited_gloss(layers, edited, curves, light)
        if of_curves:
            yield FrozenLight(reflected, bands, {}, ())
        at_receivers = factors if of_curves else {}
        frozen = {i: _frozen_curve(layers[i].curves.curves[factor], bands[i]) for i, factor in at_receivers.items()}
        for each in of_curves:
            gloss.append((yield from self._frozen_gloss(layers, factors, light, each, frozen, least)))
        return FrozenLight(reflected, bands, frozen, tuple(gloss))

    def n_steps(self, layers: Sequence[IndirectLayer], curves: Sequence[SelectedCurve]) -> int:
        """About how many steps `freeze` takes: a pass over the rays of each object, one more for each edited curve, and
        one for what edited curves send on."""
        edited = {curve.layer for curve in curves}
        sends_on = any(is_glossy(layers[i]) for i in edited) and self._light.points.glossy
        return sum(
            samples.n_steps * (1 + sends_on + len(edited.intersection(own)))
            for samples, own in self._all_samples(layers)
        )

    def noise(self, layers: Sequence[IndirectLayer]) -> Generator[None, None, tuple[float, float]]:
        """See `IndirectLight.noise`; by the stored weights of the last freezing where they fit."""
        return (yield from self._light.noise(layers, self._samples_of))

    def _edited_gloss(
        self, layers: Sequence[IndirectLayer], edited: int, curves: Sequence[SelectedCurve], light: OutgoingRadiance
    ) -> list[EditedGloss]:
        """The curves among these that reflect light at the second bounce, with the light that reaches them."""
        points = self._light.points
        if light.glossy is None or not curves:
            return []
        albedo = albedos_of(layers, len(points.lobe_axes))[edited]
        found = [edited_gloss(layers, curve, light.glossy, albedo, points.photons) for curve in curves]
        return [each for each in found if each is not None]

    def _frozen_gloss(
        self, layers: Sequence[IndirectLayer], factors: Mapping[int, int], light: OutgoingRadiance, gloss: EditedGloss,
        curves: Mapping[int, FrozenCurve], least: float,
    ) -> Generator[None, None, FrozenGloss]:  # fmt: skip
        """What an edited curve changes at the second bounce, for each layer that its light reaches. factors: which
        curves of edited layers are edited, `curves` at the first bounce; least: the light of that curve, summed over
        all points, for which anything is stored."""
        found = [(samples, own, *samples.receives(gloss, light)) for samples, own in self._all_samples(layers)]
        reached = [(samples, own, twice) for samples, own, once, twice in found if once]
        effect = np.zeros((gloss.n_bands, 3))
        for samples, own, _ in reached:
            gains = [layers[i].gain for i in own]
            effect += samples.effect_by_band([layers[i].curves for i in own], gains, light, gloss)
            yield
        total = effect.sum(axis=1)
        knots, modes = choose_knots(total, gloss.frozen), choose_modes(total, gloss.frozen)
        n_points = max(len(self._light.points.samples.points), 1)
        frozen = FrozenGloss(gloss.curve, gloss.tint, gloss.frozen, knots, effect / n_points, modes, gloss.albedo)
        if float(np.sum(np.abs(gloss.tint * gloss.frozen) * effect)) < least:
            return frozen
        table, later = knot_table(knots, gloss.n_bands), np.ascontiguousarray(gloss.radiosity[:, 1:])
        for samples, own, twice in reached:
            receivers: list[tuple[dict[int, NDArray[np.float32]], int, Receiver]] = []
            for i in own:
                layer = layers[i].curves
                receivers.append((frozen.by_layer, i, KnotReceiver(layer, table)))
                if twice:
                    receivers.append((frozen.pairs, i, PairReceiver(layer, modes.shapes)))
                if later.any():
                    receivers.append((frozen.by_power, i, PowerReceiver(layer, later, modes.shapes)))
                if i in curves:
                    edited = EditedReceiver(layer, factors[i], curves[i].modes.shapes, modes.shapes)
                    receivers.append((frozen.products, i, edited))
            sums = yield from samples.of_edited([receiver for _, _, receiver in receivers], light, gloss)
            for (part, i, _), each in zip(receivers, sums, strict=True):
                part[i] = each
        return frozen

    def _all_samples(self, layers: Sequence[IndirectLayer]) -> list[tuple[HemisphereSamples, list[int]]]:
        """The samples of each object with layers, and the numbers of these."""
        objects = sorted({layer.i_object for layer in layers})
        return [(self._samples_of(o), [i for i, layer in enumerate(layers) if layer.i_object == o]) for o in objects]

    def _samples_of(self, i_object: int) -> HemisphereSamples:
        if i_object not in self._samples:
            self._samples[i_object] = self._light.points.hemisphere_samples(i_object, keeps=self._keeps)
        return self._samples[i_object]
