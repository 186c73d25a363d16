"""How far off a picture is, as `error_estimate` finds it, and what of that a person is told."""

from __future__ import annotations

import math
from dataclasses import dataclass

# An error that can be seen in places, and is worth a word.
POOR = 0.05
# One that nobody sees: a step of eight bits is four times as large.
NONE = 1e-3


@dataclass(frozen=True)
class ErrorEstimate:
    """Relative RMS errors of a picture: root of the mean square over its mean, linear, over what reflects.

    direct: of light that was reflected once, None where a picture's parts are not known; indirect: of light that was
    reflected before, None where the picture is to have none; whole: of both together, what is left of chance included,
    None where direct light is all. Each is an estimate, within about a factor of two. mostly: the object that has more
    than half of it, "" where none has or the parts are told.
    """

    direct: float | None
    indirect: float | None = None
    whole: float | None = None
    worst_object: str = ""

    @property
    def overall(self) -> float:
        """Of all the light."""
        return math.hypot(self.direct or 0.0, self.indirect or 0.0) if self.whole is None else self.whole

    @property
    def is_large(self) -> bool:
        """Whether a person should hear of it."""
        return self.overall > POOR

    @property
    def is_negligible(self) -> bool:
        """Whether nothing is left that could be told from the truth."""
        return self.overall <= NONE

    @property
    def short(self) -> str:
        """In a line beside others, such as "about 7.0 % off, mostly on teapot"."""
        return f"about {percent(self.overall)} off{self._place}"

    @property
    def text(self) -> str:
        """In words, such as "error about 1.8 % (direct 0.6 %, indirect 1.7 %)"."""
        about = f"error about {percent(self.overall)}"
        if self.direct is None or self.indirect is None:
            return about + self._place
        return f"{about} (direct {percent(self.direct)}, indirect {percent(self.indirect)})"

    @property
    def _place(self) -> str:
        return f", mostly on {self.worst_object}" if self.is_large and self.worst_object else ""

    @property
    def advice(self) -> str:
        """What helps where it is poor, in one line; else ""."""
        if not self.is_large or self.direct is None:
            return ""
        if self.indirect is not None and self.indirect > self.direct:
            return "most of the error is in light between surfaces: more pixels, or bands at the second bounce, help"
        return "most of the error is in direct light: more lights, patches or bands help"


def percent(error: float) -> str:
    """A relative error as a person reads it: "1.8 %"."""
    return f"{100.0 * error:.1f} %"
