"""The coefficients that frames show of a light or a curve that changes, where each frame may change n of them.

Three strategies: *anew*, the n that count most; *incremented*, the n whose changes count most, added to the frame
before [BenArtzi07, eq. 7.4]; *by bands*, where each level of the wavelets is given up and begun anew in the frames in
which it is farther from what it should be than zeros are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

Strategy = Literal["anew", "incremented", "by bands"]
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)


def frame_coefficients(
    weight: NDArray[np.floating], levels: NDArray[np.integer], desired: Sequence[NDArray[np.floating]], n_terms: int,
    strategy: Strategy,
) -> list[NDArray[np.floating]]:  # fmt: skip
    """The coefficients (T, 3) shown in each frame by those desired in it (T, 3), of which the first are shown whole.

    weight (T,): by which a coefficient counts; levels (T,): on which it is; n_terms: how many change in a frame.
    """
    held, frames = desired[0].copy(), []
    for light in desired:
        if strategy == "anew":
            held = np.zeros_like(light)
        if strategy == "by bands":
            stale, missing = (np.bincount(levels, weight**2 * (each**2).sum(axis=1)) for each in (light - held, light))
            held[(missing < stale)[levels]] = 0.0
        change = weight * np.abs(light - held).max(axis=1)
        chosen = np.argsort(-change, kind="stable")[:n_terms]
        held[chosen] = light[chosen]
        frames.append(held.copy())
    return frames
