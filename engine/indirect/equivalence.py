"""Equivalent albedos from curves, each frame: light enough for the window.

d = f_q Σ_o f_o(θ_o) Σ_jk c_j c_k e_ojk        with e from `albedo.albedo_bands` [BenArtzi07, sect. 5.3]
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

N_VIEWS = 32


def view_angles() -> NDArray[np.float64]:
    """θ_o in the middle of 32 rings of equal cos θ_o dω_o."""
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
