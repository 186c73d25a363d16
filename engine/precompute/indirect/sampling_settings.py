"""How finely indirect light is found, and with how few rays it may be.

How many rays a fan needs is told by chance in the picture itself: a first look, the coarsest, is taken with the
fewest, and its two halves apart tell their noise [Rousselle12]. A bowl under an even sky makes do with a quarter of
what a copper pot by a lamp takes. Rays between cells, and the lights that these sample, are half as many then: a
storeroom with lamps of all sizes was 2 % too bright by a quarter of them.

relRMSE of all light, %, and processor seconds of its finding, by two halves of 1,024 paths at 1,536 points of pictures
of 60,000 pixels, four bounces:

                  shapes     vase   cornell  stairwell  storeroom    room     ajar
    512 rays        0.24     2.13     1.36      1.82       1.96      2.40     8.21
    as needed       0.37     2.27     1.68      1.82       2.01      2.54     8.21
      of            128      128      256       512        256       256      512
    seconds     12.1, 5.9  29, 16  7.0, 4.6   27, 28     13, 13    22, 15   16, 17

Noise falls with the 0.63th power of the rays (0.47 to 0.8 in six of these scenes). Interpolation and the filter leave
0.4 of it on surfaces that are matt by more than half of what they reflect (a third to two thirds). On others the first
look misses what is rare and bright, so that more is taken to be left than it shows: copper that throws light on
copper, the reference tea tray, was 1.2 % farther off by a quarter of the rays and 0.7 % by half, where its points'
noise of 1.7 % says 1.0 and 0.4. All that is glossy in part was counted so at first: the Cornell box then took all rays,
a third of its time, for 0.3 %. A pilot before the solver was rejected: it would find cells and photons of its own, and
take half of what it saves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

LEVELS = (4, 2, 1)
"""As many times fewer rays as there may be, the quickest first."""
_BY_RAYS, _NOISIEST = 0.63, 99.0
LEFT_OF_DIFFUSE, LEFT_OF_GLOSSY = 0.4, 1.8
TOLERANCE = 0.005
"""By how much more the picture may be off, relative RMS."""


@dataclass(frozen=True)
class SamplingSettings:
    """How finely indirect light is found.

    n_rays a fan, of which n_glossy_hits at most are followed where they end on glossy surfaces; max_extra_sets fans, a
    gather point on average, where the first ones are noisy; n_photons that glossy surfaces throw; n_cells to aim at;
    n_record_rays between cells, a cell; n_samples of each kind of light, a cell; adaptive: refine the lattice of gather
    points, else every eighth pixel; close: down to single pixels beside edges and contacts, which doubles what an
    editor would hold and freeze.
    """

    name: str
    n_rays: int
    max_extra_sets: float
    n_glossy_hits: int
    n_photons: int
    n_cache_records: int
    n_record_rays: int
    n_samples: int
    adaptive: bool
    close: bool = False

    def with_rays(self, n_rays: int) -> SamplingSettings:
        """The same with so many rays a fan, a power of two, 0 for as many as it has; rays between cells, and the lights
        that these sample, are half as many where these are fewer."""
        n_rays = n_rays or self.n_rays
        share = 2 if n_rays < self.n_rays else 1
        return replace(
            self, n_rays=n_rays, n_record_rays=self.n_record_rays // share, n_samples=self.n_samples // share
        )


ROUGH = SamplingSettings("rough", 128, 0, 32, 1 << 15, 4000, 64, 64, False)
FINE = SamplingSettings("fine", 512, 1, 96, 1 << 19, 24000, 64, 128, True)
STILL = SamplingSettings("still", 1024, 1, 1024, 1 << 20, 16000, 64, 128, True, True)


@dataclass(frozen=True)
class RayBudget:
    """How many rays a fan has, of so many that there may be; noise: of the picture by the fewest, relative to its mean,
    None where that was not asked."""

    n_rays: int
    max_rays: int
    noise: float | None = None

    @property
    def reason(self) -> str:
        """Why so many, in words."""
        if self.noise is None:
            return "as many as there may be"
        if self.n_rays < self.max_rays:
            return f"within {100.0 * self.added(self.n_rays):.1f} % of what {self.max_rays:,} show"
        fewer = self.max_rays // 2
        return f"{fewer:,} would be {100.0 * self.added(fewer):.1f} % noisier"

    def added(self, n_rays: int) -> float:
        """By how much more the picture would be off with so many than with the most."""
        fewest = self.max_rays // LEVELS[0]
        noise, least = ((fewest / n) ** _BY_RAYS for n in (n_rays, self.max_rays))
        return (self.noise or 0.0) * (noise - least)


def required_rays(most: int, noise: float) -> RayBudget:
    """How many rays a fan needs of `most`, by the noise that the fewest of them leave in the picture."""
    need = RayBudget(most, most, noise)
    fewer = (replace(need, n_rays=most // level) for level in LEVELS)
    return next((each for each in fewer if need.added(each.n_rays) <= TOLERANCE), need)


def noise_of(
    halves: NDArray[np.floating], left: NDArray[np.floating], weights: NDArray[np.floating], other_light: float
) -> float:
    """Relative RMS noise of a picture at points with weights (p,) by what each half of their rays brings, (2, p, 3), of
    whose noise so much is left (p,); other_light: the mean of what else it shows. 0 where all is dark. The noisiest
    hundredth of points counts no more than what comes next: one of thousands was six times as noisy as all others
    together."""
    first, second = np.asarray(halves, np.float64)
    total = max(float(weights.sum()), 1e-300)
    mean = other_light + float(weights @ (0.5 * (first + second)).mean(axis=1)) / total
    squares = left**2 * (0.25 * (first - second) ** 2).mean(axis=1)
    squares = np.minimum(squares, np.percentile(squares, _NOISIEST)) if len(squares) else squares
    square = float(weights @ squares) / total
    return square**0.5 / mean if mean > 0.0 else 0.0
