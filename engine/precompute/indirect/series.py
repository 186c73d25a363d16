"""The number of bands at each bounce, counted from the camera [BenArtzi07, sect. 5.2].

64,1,1,1 is a curve of 64 bands, then three equivalent albedos. 64,8,1 retains eight bands at the second bounce, so that
glossy surfaces reflect light directionally. Bounces after the second use the equivalent albedo.
"""

from __future__ import annotations

from dataclasses import dataclass

from engine.core.errors import InsituError

MOST_BOUNCES = 16
MOST_BANDS = 512


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
