"""The ray budget: the least number of rays per sample set that a picture requires.

It follows from the noise in the picture itself: a first pass uses the coarsest lattice and the
fewest rays, and the difference of its two halves measures their noise [Rousselle12]. A bowl under a uniform sky needs a
quarter of the rays of a copper pot beside a lamp. With fewer rays, the rays between records and their light samples are
halved: with a quarter of them, a storeroom with lamps of all sizes was 2 % too bright.

relRMSE of all light in %, and processor seconds, by two halves of 1,024 paths at 1,536 points of pictures of 60,000
pixels, four bounces:

                  shapes     vase   cornell  stairwell  storeroom    room     ajar
    512 rays        0.24     2.13     1.36      1.82       1.96      2.40     8.21
    as needed       0.37     2.27     1.68      1.82       2.01      2.54     8.21
      of            128      128      256       512        256       256      512
    seconds     12.1, 5.9  29, 16  7.0, 4.6   27, 28     13, 13    22, 15   16, 17

Noise falls with the power 0.63 of the number of rays (0.47 to 0.8 in six of these scenes). Interpolation and filter
leave 0.4 of it on surfaces with more diffuse than glossy albedo (a third to two thirds). On other surfaces the first
pass misses rare bright light, so the remaining noise is taken to be larger than the measured one: with caustics of
copper on copper, the error of the reference tea tray rose by 1.2 % with a quarter of the rays and by 0.7 % with half,
where the measured noise of 1.7 % predicts 1.0 and 0.4. Treating every partly glossy surface like this was rejected: the
Cornell box then took all rays, a third of its time, for 0.3 %. A pilot before the solver was rejected as well: it would
find records and photons of its own, and take half of what it saves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.gather import object_of_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.second_bounce import diffuse_share
from engine.scene.primary_hits import PrimaryHits

LEVELS = (4, 2, 1)
"""As many times fewer rays as there may be, the quickest first."""
_BY_RAYS, _NOISIEST = 0.63, 99.0
LEFT_OF_DIFFUSE, LEFT_OF_GLOSSY = 0.4, 1.8
TOLERANCE = 0.005
"""By how much more the picture may be off, relative RMS."""


@dataclass(frozen=True)
class RayBudget:
    """The number of rays per sample set, of at most max_rays. noise: of the picture with the fewest rays, relative to
    its mean; None if it was not measured."""

    n_rays: int
    max_rays: int
    noise: float | None = None

    @property
    def reason(self) -> str:
        """The reason for this number, in words."""
        if self.noise is None:
            return "the most there may be"
        if self.n_rays < self.max_rays:
            return f"within {100.0 * self.added(self.n_rays):.1f} % of what {self.max_rays:,} show"
        fewer = self.max_rays // 2
        return f"{fewer:,} would be {100.0 * self.added(fewer):.1f} % noisier"

    def added(self, n_rays: int) -> float:
        """The additional noise with n_rays instead of the most, relative RMS."""
        fewest = self.max_rays // LEVELS[0]
        noise, least = ((fewest / n) ** _BY_RAYS for n in (n_rays, self.max_rays))
        return (self.noise or 0.0) * (noise - least)


def required_rays(most: int, noise: float) -> RayBudget:
    """The number of rays per sample set, of at most `most`, by the noise that the fewest leave in the picture."""
    need = RayBudget(most, most, noise)
    fewer = (replace(need, n_rays=most // level) for level in LEVELS)
    return next((each for each in fewer if need.added(each.n_rays) <= TOLERANCE), need)


def noise_of(
    halves: NDArray[np.floating], left: NDArray[np.floating], weights: NDArray[np.floating], other_light: float
) -> float:
    """Relative RMS noise of a picture, from the light (2, p, 3) of each half of the rays at points with weights (p,).
    left (p,): the fraction of noise that remains after filtering; other_light: mean of the other light in the picture.
    0 where all is dark. The noisiest hundredth of points is clamped to the next noisiest: one point in thousands was
    six times as noisy as all others together."""
    first, second = np.asarray(halves, np.float64)
    total = max(float(weights.sum()), 1e-300)
    mean = other_light + float(weights @ (0.5 * (first + second)).mean(axis=1)) / total
    squares = left**2 * (0.25 * (first - second) ** 2).mean(axis=1)
    squares = np.minimum(squares, np.percentile(squares, _NOISIEST)) if len(squares) else squares
    square = float(weights @ squares) / total
    return square**0.5 / mean if mean > 0.0 else 0.0


def ray_budget_of(
    halves: NDArray[np.floating], layers: Sequence[IndirectLayer], hits: PrimaryHits, rows: NDArray[np.int32],
    other_light: float, most: int,
) -> RayBudget:  # fmt: skip
    """The ray budget by the radiance (2, p, 3) of each half of the fewest rays at gather points with these rows (p,).
    other_light: see `noise_of`; most: rays per sample set."""
    diffuse = diffuse_share(layers, len(hits.object_ranges)).mean(axis=1) > 0.5
    left = np.where(diffuse, LEFT_OF_DIFFUSE, LEFT_OF_GLOSSY)[object_of_rows(hits, rows)]
    return required_rays(most, noise_of(halves, left, hits.share[rows], other_light))
