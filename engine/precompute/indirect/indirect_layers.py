"""The layers of a scene as indirect light uses them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from engine.material import MODELS
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.model import Model
from engine.precompute.indirect import _reflection_kernels as kernels
from engine.precompute.indirect.albedo import N_SLANTS, N_VIEW_SAMPLES, directional_albedo, equivalent_albedo, tint_of
from engine.scene.primary_hits import PrimaryHits


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """A layer for reflection at gather points: model, quotient parameters (8,), values at the nodes of its one or two
    curves, (J, 3) and (K, 3); tint (3,): a factor on the sums, see `albedo`."""

    model: Model
    quotient_parameters: NDArray[np.float64]
    curves: tuple[NDArray[np.float64], ...]
    tint: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))

    @property
    def is_tinted(self) -> bool:
        return bool((self.tint != 1.0).any())

    @property
    def bound_parameters(self) -> NDArray[np.float64]:
        """The quotient parameters with handles that are valid in this process."""
        return self.model.bind_parameters(np.asarray(self.quotient_parameters, np.float64))

    def optics(self, folded: bool = False) -> kernels.ReflectingLayer:
        """The layer for the kernels; folded: mark a single constant curve, whose angle is then not required."""
        first, *second = (np.ascontiguousarray(curve, np.float32) for curve in self.curves)
        factors = self.model.factors
        kind_b = factors[1].gamma if len(factors) > 1 else -1
        other = second[0] if second else np.ones((1, 3), np.float32)
        q = self.bound_parameters
        kind_a = kernels.CONSTANT if folded and kind_b < 0 and bool((first == first[0]).all()) else factors[0].gamma
        return kernels.ReflectingLayer(self.model.number, q, kind_a, kind_b, first, other)


def any_glossy(model_names: Iterable[str]) -> bool:
    """Whether the reflection of an object with layers of these models depends on the outgoing direction."""
    return not all(MODELS[name].is_diffuse for name in model_names)


@dataclass(frozen=True, eq=False)
class IndirectLayer:
    """A visible layer of one object. curves: towards the camera; second_curves: at the second bounce; gain: f_q (3,);
    view_curves: the factors (2, N, 3) of f_o, at even angles from 0 to π/2 to the normal of each frame; albedo (3,):
    equivalent albedo. f_q and albedo include the mean of texture and weight maps over the surface, share (3,); records
    have their own, see `record_maps`. slant (N_SLANTS, 3): relative directional albedo, see `albedo.slant_of`.
    third_curves: at the third bounce, None for those of the second."""

    i_object: int
    curves: LayerCurves
    second_curves: LayerCurves
    gain: NDArray[np.float64]
    view_curves: NDArray[np.float64]
    albedo: NDArray[np.float64]
    maps: LayerMaps = LayerMaps()
    share: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    slant: NDArray[np.float64] = field(default_factory=lambda: np.ones((N_SLANTS, 3)))
    third_curves: LayerCurves | None = None

    @property
    def view_curve(self) -> NDArray[np.float64]:
        """f_o (N, 3) where both normals are the same."""
        return np.asarray(self.view_curves[0] * self.view_curves[1])


def indirect_layer(
    i_object: int, layer: Layer, bands: tuple[int, ...], second: int | None = None, mean: object = None,
    third: int | None = None,
) -> IndirectLayer:  # fmt: skip
    """A layer with its current curves on this many bands; at the second bounce on at most `second`, at the third on at
    most `third`, None for as many as at the second.

    mean (3,): of its texture and weight map over the surface; None if unknown, in which case the maps are ignored.
    """
    share = np.broadcast_to(np.asarray(1.0 if mean is None else mean, np.float64), 3)
    seen = layer.view_curves(np.linspace(0.0, np.pi / 2, N_VIEW_SAMPLES))
    at_second = tuple(n if second is None else min(n, second) for n in bands)
    q = layer.quotient_parameters()
    towards_camera = _coefficients(layer, bands)
    tint = tint_of(layer.model.name, tuple(q.tolist()), towards_camera, seen[0] * seen[1])

    def curves(each: tuple[int, ...]) -> LayerCurves:
        return LayerCurves(layer.model, q, _coefficients(layer, each), tint)

    return IndirectLayer(
        i_object, curves(bands), curves(at_second), share * layer.scale(), seen,
        share * equivalent_albedo(layer, bands),
        LayerMaps() if mean is None else layer.maps, share, directional_albedo(layer, bands),
        None if third is None else curves(tuple(min(n, third) for n in at_second)),
    )  # fmt: skip


def _coefficients(layer: Layer, bands: tuple[int, ...]) -> tuple[NDArray[np.float64], ...]:
    return tuple(layer.coefficients(factor.name, n) for factor, n in zip(layer.model.factors, bands, strict=False))


def diffuse_slant(layer: IndirectLayer) -> IndirectLayer:
    """The same with a directional albedo that does not depend on the angle."""
    return replace(layer, slant=np.ones_like(layer.slant))


def is_glossy(layer: IndirectLayer) -> bool:
    """Whether its reflection depends on the outgoing direction."""
    return not layer.second_curves.model.is_diffuse


def albedos_of(layers: Sequence[IndirectLayer], n_objects: int) -> NDArray[np.float64]:
    """Equivalent albedo (M, 3) of every object: the sum over its layers."""
    albedos = np.zeros((n_objects, 3))
    for layer in layers:
        albedos[layer.i_object] += layer.albedo
    return albedos


def view_factors(hits: PrimaryHits, rows: NDArray[np.integer], layer: IndirectLayer) -> NDArray[np.float32]:
    """f_q f_o(θ_o), (p, 3)."""
    angles = np.linspace(0.0, np.pi / 2, layer.view_curves.shape[1])
    base, coat = (
        np.stack([np.interp(theta_o, angles, curve[:, c]) for c in range(3)], axis=1)
        for theta_o, curve in zip(hits.view_angles(rows), layer.view_curves, strict=True)
    )
    return np.asarray(layer.gain * base * coat, np.float32)
