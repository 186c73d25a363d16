"""How many bands each bounce has, counted from the eye: 64,1,1,1 is a curve of 64 bands, then three equivalent albedos.

[BenArtzi07, sect. 5.2]. Further bounces of more bands than one are not there yet.
"""

from __future__ import annotations

from dataclasses import dataclass

from engine.errors import InsituError

MOST_BOUNCES = 16
MOST_FIRST = 512


@dataclass(frozen=True)
class BounceSeries:
    """first: the most bands of a curve at the first bounce, None for as many as it needs; n_bounces ≥ 1 in all."""

    n_bounces: int
    first: int | None = None

    def __str__(self) -> str:
        return ", ".join([str(self.first or "J"), *"1" * (self.n_bounces - 1)])


def parse_series(text: str) -> BounceSeries:
    """The series of a text such as "64,1,1,1". Raises InsituError that says what was expected."""
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise _refused(text, "numbers with commas between them, such as 64,1,1,1") from None
    if len(numbers) > MOST_BOUNCES:
        raise _refused(text, f"at most {MOST_BOUNCES} bounces")
    if not 1 <= numbers[0] <= MOST_FIRST or numbers[0] & (numbers[0] - 1):
        raise _refused(text, f"a power of two up to {MOST_FIRST} at the first bounce")
    if any(number != 1 for number in numbers[1:]):
        raise _refused(text, "1 at every bounce but the first")
    return BounceSeries(len(numbers), numbers[0])


def _refused(text: str, expected: str) -> InsituError:
    return InsituError(f"--series {text}: expected {expected}")
