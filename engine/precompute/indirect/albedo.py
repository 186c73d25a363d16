"""Equivalent albedo: the albedo of a diffuse surface that reflects as much light [BenArtzi07, 5.2.4].

    d = (1/π) ∫∫ ρ(ωi, ωo) cos θ_i cos θ_o dωi dωo

    d = f_q Σ_o f_o(θ_o) Σ_jk c_j c_k e_ojk

The part e that does not depend on curves is computed once per model and quotient (`albedo_bands`). Applying the curves
to it is fast enough for every frame (`albedo_of`); the window's process does so, which is why the compiler is imported
late. Narrow bands are integrated with the distributions of the hemisphere samples: partly by the cosine, partly about
the axis of the lobe.

Sums over rays use one quotient for all colour channels. Where a model has one per channel (measured materials), albedos
use each channel's own quotient, and the sums are multiplied by the ratio of these albedos to those of the common
quotient: the `tint`. The result has the right energy, with the directional distribution of the common quotient.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.core.array_cache import cache_recent_arrays
from engine.material import MODELS, kinds
from engine.material.layer import Layer

N_VIEWS, N_SLANTS = 32, 6
N_AZIMUTHS = 8
N_VIEW_SAMPLES = 256
_N_RAYS = 1024
_MOST_BYTES = 8 << 20  # limit of the cache: it holds the tables of all layers of a scene, rarely of two roughnesses
_GOLDEN = (1.0 + 5.0**0.5) / 2.0


def albedo_bands(
    model_name: str, quotient_parameters: tuple[float, ...], bands: tuple[int, ...]
) -> NDArray[np.float64]:
    """e (32, J, K) of a model by view angle, or (3, 32, J, K) if each channel has its own quotient; K = 1 for one
    curve. Sums over the views are means over cos θ_o dω_o."""
    if not _is_coloured(model_name, quotient_parameters):
        return _common_bands(model_name, quotient_parameters, bands)
    before, after = quotient_parameters[: kinds.CHANNEL], quotient_parameters[kinds.CHANNEL + 1 :]
    return np.stack([_common_bands(model_name, (*before, float(channel), *after), bands) for channel in range(3)])


def tint_of(
    model_name: str, quotient_parameters: tuple[float, ...], curves: Sequence[NDArray[np.floating]],
    view_curve: NDArray[np.floating],
) -> NDArray[np.float64]:  # fmt: skip
    """The ratio (3,) of the albedos of each channel's own quotient to those of the common one, under these curves as
    `albedo_of` takes them; 1 where both are black."""
    if not _is_coloured(model_name, quotient_parameters):
        return np.ones(3)
    bands = tuple(map(len, curves))
    own, common = (
        albedo_of(e(model_name, quotient_parameters, bands), curves, np.ones(3), view_curve)
        for e in (albedo_bands, _common_bands)
    )
    return np.divide(own, common, out=np.ones(3), where=common > 0.0)


def _is_coloured(model_name: str, quotient_parameters: tuple[float, ...]) -> bool:
    """Whether each channel has its own quotient, as measured materials with a file do."""
    return MODELS[model_name].is_coloured and bool(quotient_parameters[kinds.TABLE])


@cache_recent_arrays(_MOST_BYTES)
def _common_bands(
    model_name: str, quotient_parameters: tuple[float, ...], bands: tuple[int, ...]
) -> NDArray[np.float64]:
    """e (32, J, K) with the single quotient of these parameters."""
    from engine.precompute.indirect import _reflection_kernels as kernels
    from engine.precompute.indirect.direction_patterns import cosine_tables, lobe_axis_of, lobe_tables

    model = MODELS[model_name]
    n_a, n_b = (*bands, 1)[:2]
    kind_b = model.factors[1].gamma if len(model.factors) > 1 else -1
    wo = np.repeat(view_angles(), N_AZIMUTHS)
    turns = 2 * np.pi * _GOLDEN * np.arange(len(wo))
    wo = np.stack([np.sin(wo) * np.cos(turns), np.sin(wo) * np.sin(turns), np.cos(wo)], axis=1)
    found = np.zeros((len(wo), n_a, n_b))
    kernels.albedo_bands(
        model.number, model.bind_parameters(np.array(quotient_parameters)), model.factors[0].gamma, kind_b,
        lobe_axis_of([model_name]),
        wo.astype(np.float32), cosine_tables(_N_RAYS), lobe_tables(_N_RAYS), found,
    )  # fmt: skip
    return found.reshape(N_VIEWS, N_AZIMUTHS, n_a, n_b).mean(axis=1) / N_VIEWS


def equivalent_albedo(layer: Layer, bands: tuple[int, ...]) -> NDArray[np.float64]:
    """d (3,) ≥ 0 of a layer with its curves on this many bands; above 1 the surface creates energy."""
    e, curves = _bands_and_curves(layer, bands)
    seen = layer.view_curve(np.linspace(0.0, np.pi / 2, N_VIEW_SAMPLES if layer.has_view_curve else 2))
    return albedo_of(e, curves, layer.scale(), seen)


def directional_albedo(layer: Layer, bands: tuple[int, ...]) -> NDArray[np.float64]:
    """Albedo for light from one direction relative to the equivalent albedo, (N_SLANTS, 3); 1 for a diffuse layer."""
    return np.ones((N_SLANTS, 3)) if layer.model.is_diffuse else slant_of(*_bands_and_curves(layer, bands))


def _bands_and_curves(
    layer: Layer, bands: tuple[int, ...]
) -> tuple[NDArray[np.float64], tuple[NDArray[np.float64], ...]]:
    """e and the curves of a layer, in the form that `albedo_of` takes."""
    e = albedo_bands(layer.model.name, tuple(layer.quotient_parameters().tolist()), bands)
    return e, tuple(layer.coefficients(factor.name, n) for factor, n in zip(layer.model.factors, bands, strict=False))


def view_angles() -> NDArray[np.float64]:
    """θ_o at the centres of 32 rings of equal cos θ_o dω_o."""
    return np.arccos(np.sqrt(1.0 - (np.arange(N_VIEWS) + 0.5) / N_VIEWS))


def albedo_of(
    e: NDArray[np.floating], curves: Sequence[NDArray[np.floating]], gain: NDArray[np.floating],
    view_curve: NDArray[np.floating],
) -> NDArray[np.float64]:  # fmt: skip
    """d (3,) of a layer: e (32, J, K) or (3, 32, J, K), values of its one or two curves (J, 3), (K, 3), f_q (3,), f_o
    (N, 3) at even angles from 0 to π/2."""
    angles = np.linspace(0.0, np.pi / 2, len(view_curve))
    views = np.stack([np.interp(view_angles(), angles, view_curve[:, c]) for c in range(3)], axis=1)
    first, second = (*curves, np.ones((1, 3)))[:2]
    seen = np.einsum("oc,cojk->cjk", views, np.broadcast_to(e, (3, *e.shape[-3:])))
    return np.asarray(gain * np.einsum("cjk,jc,kc->c", seen, first, second))


def slant_of(e: NDArray[np.floating], curves: Sequence[NDArray[np.floating]]) -> NDArray[np.float64]:
    """The directional albedo relative to the equivalent albedo, (N_SLANTS, 3), at `slant_roots`, with constant f_o; e,
    curves: see `albedo_of`.

    By reciprocity it is the light that comes from all directions to a camera at that angle. 1 where the layer is black.
    Normalised so that uniform light is reflected by the equivalent albedo.
    """
    first, second = (*curves, np.ones((1, 3)))[:2]
    towards = np.einsum("cojk,jc,kc->oc", np.broadcast_to(e, (3, *e.shape[-3:])), first, second)
    mean = towards.mean(axis=0)
    relative = np.divide(towards, mean, out=np.ones_like(towards), where=mean > 0.0)
    roots = np.sqrt(np.cos(view_angles()))[::-1]
    nodes = slant_roots()
    slant = np.stack([np.interp(nodes, roots, relative[::-1, c]) for c in range(3)], axis=1)
    even = np.stack([np.interp(roots, nodes, slant[:, c]) for c in range(3)], axis=1)
    return np.asarray(slant / even.mean(axis=0))


def slant_roots() -> NDArray[np.float64]:
    """The square roots of the cosines of incidence between which records divide their direct irradiance: dense at
    grazing angles, where glossy reflection changes fast."""
    return np.linspace(0.0, 1.0, N_SLANTS)
