"""The second bounce off an object whose curve is edited: what is frozen of it (`frozen_light.FrozenGloss`).

The change of the curve is interpolated linearly between a few knots among its bands. They lie where rays and photons
meet the curve, and densely where edits bend it most. Nothing is stored for receivers that the light does not reach.
Where the receiving curve is edited as well, or a path meets the edited curve twice, the products of both changes, which
are of second order, are summed by a few modes of either: ten modes are as near as 32 × 32 knots were, in a tenth of the
memory. Products of three changes are left out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import clamp_radiance
from engine.core.threads import even_parts, on_threads
from engine.precompute.indirect import _edited_gloss_kernels as kernels
from engine.precompute.indirect._photon_kernels import ReflectedPhotons
from engine.precompute.indirect._reflection_kernels import ReflectingLayer, SampleArrays, WeightArrays
from engine.precompute.indirect.frozen_light import Modes, SelectedCurve
from engine.precompute.indirect.indirect_layers import IndirectLayer, LayerCurves, is_glossy
from engine.precompute.indirect.photons import NearbyPhotons, Photons, slice_photons
from engine.precompute.indirect.second_bounce import SecondBounceLight, glossy_order

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

MOST_KNOTS, MOST_MODES = 24, 10
# Edits that knots and modes are chosen for stretch the curve's angle by these factors, or draw a shoulder.
_STRETCHES = (0.3, 0.45, 0.65, 0.8, 1.0, 1.25, 1.5, 2.2, 3.3)
_N_SHOULDERS, _SHOULDER = 8, 0.2


@dataclass(frozen=True, eq=False)
class EditedGloss:
    """An edited curve of a glossy layer. curve: which; i_object, its object; i_glossy: its number among the glossy
    layers; frozen (J, 3): f_q⁰ f_e⁰, without the layer's tint (3,); albedo (3,): d⁰ of the object; radiosity (C, N,
    3) of the records that reaches it, by powers of d, and bright (C, 3), its sum; positions (n,) and light (n, 3): of
    photons, see `photon_light`."""

    curve: SelectedCurve
    i_object: int
    i_glossy: int
    frozen: Float64Array
    tint: Float64Array
    albedo: Float64Array
    radiosity: Float32Array
    bright: Float32Array
    positions: Float32Array
    light: Float32Array

    @property
    def n_bands(self) -> int:
        return len(self.frozen)


@dataclass(frozen=True, eq=False)
class Receiver(ABC):
    """A layer that reflects light of an edited curve at its p gather points: sums (3, *shape, p)."""

    layer: LayerCurves

    @cached_property
    def optics(self) -> ReflectingLayer:
        """The layer for the kernels."""
        return self.layer.optics(folded=True)

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """The number of sums for each channel and point, along each axis."""

    @abstractmethod
    def reflect(
        self, samples: SampleArrays, begin: int, end: int, weights: WeightArrays, edited: kernels.EditedLight,
        out: Float32Array,
    ) -> None:  # fmt: skip
        """Adds what points [begin, end) reflect along their rays to out (3, *shape, end - begin)."""

    def reflect_photons(  # noqa: B027 — photons carry none of it unless a subclass adds it
        self, begin: int, end: int, nearby: NearbyPhotons, reflected: ReflectedPhotons, gloss: EditedGloss,
        out: Float32Array,
    ) -> None:  # fmt: skip
        """Adds what they reflect of photons."""


@dataclass(frozen=True, eq=False)
class KnotReceiver(Receiver):
    """The light by K knots of the curve's change: (3, K, p)."""

    knots: kernels.Knots

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.knots.at) - 1,)

    def reflect(
        self, samples: SampleArrays, begin: int, end: int, weights: WeightArrays, edited: kernels.EditedLight,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_by_knot(samples, begin, end, self.optics, weights, edited, self.knots, out)

    def reflect_photons(
        self, begin: int, end: int, nearby: NearbyPhotons, reflected: ReflectedPhotons, gloss: EditedGloss,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_photons_by_knot(
            begin, end, self.optics, nearby, reflected, gloss.positions, gloss.light, self.knots, out
        )


@dataclass(frozen=True, eq=False)
class PairReceiver(Receiver):
    """Light that met the curve twice, by K modes (J, K) of its change: (3, K, K, p). Photons meet it once."""

    modes: Float32Array

    @property
    def shape(self) -> tuple[int, ...]:
        return self.modes.shape[1], self.modes.shape[1]

    def reflect(
        self, samples: SampleArrays, begin: int, end: int, weights: WeightArrays, edited: kernels.EditedLight,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_by_mode(
            samples, begin, end, self.optics, kernels.NO_CURVE, weights, edited, self.modes, self.modes, out
        )


@dataclass(frozen=True, eq=False)
class PowerReceiver(Receiver):
    """Radiosity (C, N, 3) that the curve sends on, by power and by K modes (J, K) of its change: (3, N, K, p). Photons
    carry none of it."""

    radiosity: Float32Array
    modes: Float32Array

    @property
    def shape(self) -> tuple[int, ...]:
        return self.radiosity.shape[1], self.modes.shape[1]

    def reflect(
        self, samples: SampleArrays, begin: int, end: int, weights: WeightArrays, edited: kernels.EditedLight,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_by_power(samples, begin, end, self.optics, weights, edited, self.radiosity, self.modes, out)


@dataclass(frozen=True, eq=False)
class EditedReceiver(Receiver):
    """The light at a layer whose own curve, its first or second by `which`, is edited as well, by modes of both, own
    (J', R) and other (J, K): (3, R, K, p)."""

    which: int
    own: Float32Array
    other: Float32Array

    @cached_property
    def optics(self) -> ReflectingLayer:
        """The layer for the kernels, with ones in place of its edited curve."""
        optics = self.layer.optics()
        ones = np.ones_like(optics.curve_b if self.which else optics.curve_a)
        return optics._replace(curve_b=ones) if self.which else optics._replace(curve_a=ones)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.own.shape[1], self.other.shape[1]

    def reflect(
        self, samples: SampleArrays, begin: int, end: int, weights: WeightArrays, edited: kernels.EditedLight,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_by_mode(
            samples, begin, end, self.optics, self.which, weights, edited, self.own, self.other, out
        )

    def reflect_photons(
        self, begin: int, end: int, nearby: NearbyPhotons, reflected: ReflectedPhotons, gloss: EditedGloss,
        out: Float32Array,
    ) -> None:  # fmt: skip
        kernels.reflect_photons_by_mode(
            begin, end, self.optics, self.which, nearby, reflected, gloss.positions, gloss.light, self.own, self.other,
            out,
        )  # fmt: skip


def edited_gloss(
    layers: Sequence[IndirectLayer], curve: SelectedCurve, second: SecondBounceLight, albedo: Float64Array,
    photons: Photons,
) -> EditedGloss | None:  # fmt: skip
    """What an edit of this curve changes at the second bounce; None for a diffuse layer. second: the light there under
    the curves as they are; albedo (3,): of the edited object."""
    layer = layers[curve.layer]
    if not is_glossy(layer):
        return None
    i_glossy = glossy_order(layers).index(curve.layer)
    positions, light = np.empty(len(photons.sources), np.float32), np.empty((len(photons.sources), 3), np.float32)

    def find(begin: int, end: int) -> None:
        some = slice_photons(photons, begin, end)
        kernels.photon_light(
            some, second.layers, layer.i_object, i_glossy, curve.factor == 0, positions[begin:end], light[begin:end]
        )

    on_threads(find, *even_parts(len(light)))
    beyond = np.ascontiguousarray(second.radiosity[0, ..., :3])
    bright = clamp_radiance(np.einsum("cnk,nk->ck", beyond, albedo ** np.arange(beyond.shape[1])[:, None]))
    tint = np.asarray(layer.second_curves.tint, np.float64)
    return EditedGloss(
        curve, layer.i_object, i_glossy, layer.gain * layer.second_curves.curves[curve.factor], tint, albedo, beyond,
        bright, positions, light,
    )  # fmt: skip


def all_knots(n_bands: int) -> NDArray[np.intp]:
    """Every band as a knot."""
    return np.arange(n_bands)


def knot_table(knots: NDArray[np.intp], n_bands: int) -> kernels.Knots:
    """Knots, ascending from 0, for the kernels."""
    below = np.searchsorted(knots, np.arange(n_bands), "right") - 1
    return kernels.Knots(np.append(knots, knots[-1] + 1).astype(np.float32), below)


def _probes(curve: NDArray[np.floating]) -> Float64Array:
    """Curves (n, J) that edits make of each channel of a curve (J, 3): stretched in angle."""
    bands = np.arange(len(curve))
    found = [np.interp(bands * stretch, bands, channel) for stretch in _STRETCHES for channel in curve.T]
    return np.array(found)


def choose_modes(effect: NDArray[np.floating], curve: NDArray[np.floating], most: int = MOST_MODES) -> Modes:
    """At most `most` modes of the changes that edits make of a curve (J, 3): the principal components of its stretched
    forms and of hat functions as wide as a freely drawn shoulder, where `effect` (J,) says how much light meets each
    band."""
    n = len(curve)
    share = np.sqrt(effect / max(float(effect.sum()), 1e-30) + 1e-3 / n)
    probes = _probes(curve)
    sizes = np.maximum(np.linalg.norm(probes * share, axis=1), 1e-30)
    shoulders = np.maximum(
        1.0 - np.abs(np.arange(n) - np.linspace(0, n, _N_SHOULDERS)[:, None]) * _N_SHOULDERS / n, 0.0
    )
    widths = np.maximum(np.linalg.norm(shoulders * share, axis=1), 1e-30)
    changes = np.concatenate([probes / sizes[:, None], _SHOULDER * shoulders / widths[:, None]])
    _, _, rows = np.linalg.svd(changes * share, full_matrices=False)
    rows = rows[:most]
    return Modes((rows / share).T.astype(np.float32), rows * share)


def choose_knots(effect: NDArray[np.floating], curve: NDArray[np.floating], most: int = MOST_KNOTS) -> NDArray[np.intp]:
    """At most `most` of a curve's J bands (J, 3) as knots: those between which edits of it are interpolated best, where
    `effect` (J,) says how much light meets each band.

    The edits stretch the curve's angle. From all bands, the one that would be missed least is removed until few enough
    are left; the first and the last stay.
    """
    n, probes = len(curve), _probes(curve)
    bands = np.arange(n)
    # Relative to each probe's light; an even share keeps bands that no probe bends.
    whole = max(float(effect.sum()), 1e-30)
    weight = effect / whole + 1e-3 / n
    scaled = probes * (whole / np.maximum(np.abs(probes) @ effect, 1e-30))[:, None]

    def missed(left: int, right: int) -> float:
        """The error where all bands between two knots are interpolated."""
        inner = bands[left + 1 : right]
        t = (inner - left) / (right - left)
        found = scaled[:, left, None] * (1.0 - t) + scaled[:, right, None] * t
        return float(np.sum(np.abs(found - scaled[:, inner]) @ weight[inner]))

    knots = bands.tolist()
    costs = [np.inf, *(missed(i - 1, i + 1) for i in range(1, n - 1)), np.inf][:n]
    while len(knots) > most:
        i = int(np.argmin(costs))
        del knots[i], costs[i]
        for k in (i - 1, i):
            if 0 < k < len(knots) - 1:
                left, right = knots[k - 1], knots[k + 1]
                costs[k] = missed(left, right) - missed(left, knots[k]) - missed(knots[k], right)
    return np.array(knots, np.intp)
