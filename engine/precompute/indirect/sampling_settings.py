"""Settings of indirect light: how finely it is sampled, and the bounces with their bands.

A series has the number of bands at each bounce, counted from the camera [BenArtzi07, sect. 5.2]. 64,1,1,1 is a curve of
64 bands, then three equivalent albedos. 64,8,1 retains eight bands at the second bounce, so that glossy surfaces
reflect light directionally, and 64,8,8,1 at the third as well, for light that three glossy surfaces reflect in turn.
The first number holds for direct light as well; direct+16,8,1 leaves direct light whole.

Bounces after the third use the equivalent albedo, and so does the third where the second surface is diffuse: their
light is found between irradiance records, whose few rays know no direction of what they meet. With directions each of
24,000 records, as many as there are gather points, would need stored rays and shadow rays of its own, summed anew at
each freezing. In the built-in scenes little is lost (`benchmarks.series`); where caustics are seen in a mirror, they
have the light of an albedo. Photons that are counted by record would find those.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from engine.core.errors import InsituError

MOST_BOUNCES = 16
MOST_BANDS = 512
N_CURVED = 3  # bounces that may have bands
_WHOLE_DIRECT = "direct+"
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
    """n_bounces ≥ 1 in all; first, second, third: the largest number of bands of a curve there, None for its own
    number, or at the third for that of the second; 1 for the equivalent albedo at the second and third. whole_direct:
    direct light has all bands, and a first number of 1 is an equivalent albedo, too."""

    n_bounces: int
    first: int | None = None
    second: int | None = None
    third: int | None = None
    whole_direct: bool = False

    def __str__(self) -> str:
        bands = [str(n or "J") for n in (self.first, self.second, self.third or self.second)] + ["1"] * self.n_bounces
        return ("direct+" if self.whole_direct else "") + ",".join(bands[: self.n_bounces])


def parse_series(text: str) -> BounceSeries:
    """The series of a text such as "64,8,1" or "direct+1,1,1". Direct light by an equivalent albedo would be without
    shape, so that a first number of 1 leaves it whole, with or without "direct+" [BenArtzi07, fig. 5.6]. Raises
    InsituError with the expected form."""
    try:
        numbers = [int(part) for part in text.removeprefix(_WHOLE_DIRECT).split(",")]
    except ValueError:
        raise _refused(text, "numbers with commas between them, such as 64,8,1 or direct+1,1,1") from None
    curves = numbers[:N_CURVED]
    if len(numbers) > MOST_BOUNCES:
        raise _refused(text, f"at most {MOST_BOUNCES} bounces")
    if any(not 1 <= number <= MOST_BANDS or number & (number - 1) for number in curves):
        raise _refused(text, f"powers of two up to {MOST_BANDS} at the first three bounces")
    if any(number != 1 for number in numbers[N_CURVED:]):
        raise _refused(text, "1 at every bounce after the third, where light goes by equivalent albedos")
    if curves != sorted(curves, reverse=True):
        raise _refused(text, "no more bands at a bounce than at the one before")
    whole_direct = text.startswith(_WHOLE_DIRECT) or numbers[0] == 1
    first, second, third = (*curves, None, None)[:N_CURVED]
    return BounceSeries(len(numbers), first, second, third, whole_direct)


def _refused(text: str, expected: str) -> InsituError:
    return InsituError(f"--series {text}: expected {expected}")
