"""Settings of indirect light: how finely it is sampled, and the bounces with their bands.

A series has the number of bands at each bounce, counted from the camera [BenArtzi07, sect. 5.2]. 64,1,1,1 is a curve of
64 bands, then three equivalent albedos. 64,8,1 retains eight bands at the second bounce, so that glossy surfaces
reflect light directionally. Bounces after the second use the equivalent albedo.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from engine.core.errors import InsituError

MOST_BOUNCES = 16
MOST_BANDS = 512
# Photons of an editor. Fewer rays that are asked for leave as many.
LEAST_PHOTONS = 1 << 19


@dataclass(frozen=True)
class SamplingSettings:
    """How finely indirect light is sampled.

    n_rays: rays per sample set, of which at most n_glossy_hits are continued where they end on glossy surfaces;
    max_extra_sets: extra sample sets per gather point on average, where the first ones are noisy; n_photons from glossy
    surfaces; n_cache_records: the number to aim at; n_record_rays: rays between records, per record; n_samples: samples
    of each kind of light, per record; adaptive: refine the lattice of gather points, else every eighth pixel; close:
    refine down to single pixels beside edges and contacts, which doubles the memory and freezing time of an editor;
    gloss_noise: the noise for which points that see glossy surfaces get extra sample sets, relative to that of others.
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
    gloss_noise: float = 1.0

    def with_rays(self, n_rays: int, keeps_photons: bool = False) -> SamplingSettings:
        """The same with n_rays per sample set, a power of two; 0 for no change. With fewer rays, the rays between
        records and their light samples are halved, and photons are as many times fewer, down to LEAST_PHOTONS.
        keeps_photons: for a number of rays that was found by the noise of rays, which says nothing of photons."""
        n_rays = n_rays or self.n_rays
        if n_rays >= self.n_rays:
            return replace(self, n_rays=n_rays)
        fewer = max(self.n_photons * n_rays // self.n_rays, min(self.n_photons, LEAST_PHOTONS))
        return replace(
            self, n_rays=n_rays, n_record_rays=self.n_record_rays // 2, n_samples=self.n_samples // 2,
            n_photons=self.n_photons if keeps_photons else fewer,
        )  # fmt: skip


ROUGH = SamplingSettings("rough", 128, 0, 32, 1 << 15, 4000, 64, 64, False)
FINE = SamplingSettings("fine", 512, 1, 96, LEAST_PHOTONS, 24000, 64, 128, True)
STILL = SamplingSettings("still", 1024, 1, 1024, 1 << 22, 16000, 64, 128, True, True, 0.4)


@dataclass(frozen=True)
class BounceSeries:
    """n_bounces ≥ 1 in all; first, second: the largest number of bands of a curve there, None for its own number."""

    n_bounces: int
    first: int | None = None
    second: int | None = None

    def __str__(self) -> str:
        bands = [str(n or "J") for n in (self.first, self.second)] + ["1"] * self.n_bounces
        return ",".join(bands[: self.n_bounces])


def parse_series(text: str) -> BounceSeries:
    """The series of a text such as "64,8,1". Raises InsituError with the expected form."""
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise _refused(text, "numbers with commas between them, such as 64,8,1") from None
    if len(numbers) > MOST_BOUNCES:
        raise _refused(text, f"at most {MOST_BOUNCES} bounces")
    if any(not 1 <= number <= MOST_BANDS or number & (number - 1) for number in numbers[:2]):
        raise _refused(text, f"powers of two up to {MOST_BANDS} at the first and second bounce")
    if any(number != 1 for number in numbers[2:]):
        raise _refused(text, "1 at every bounce after the second")
    return BounceSeries(len(numbers), numbers[0], numbers[1] if len(numbers) > 1 else None)


def _refused(text: str, expected: str) -> InsituError:
    return InsituError(f"--series {text}: expected {expected}")
