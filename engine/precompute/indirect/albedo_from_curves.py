"""Equivalent albedos from curves, fast enough for every frame.

d = f_q Σ_o f_o(θ_o) Σ_jk c_j c_k e_ojk        with e from `albedo.albedo_bands` [BenArtzi07, 5.2.4]
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

N_VIEWS, N_SLANTS = 32, 6


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
