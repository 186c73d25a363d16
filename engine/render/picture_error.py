"""The error of a picture, as `error_estimate` finds it, and the part of it that the user sees."""

from __future__ import annotations

import math
from dataclasses import dataclass

# An error that is visible in places, and is reported.
POOR = 0.05
# An invisible error: a step of eight bits is four times as large.
NONE = 1e-3


@dataclass(frozen=True)
class ErrorEstimate:
    """Relative RMS errors of a picture: root of the mean square over the mean, in linear light, over reflecting
    objects.

    direct: of direct light, None if a picture's parts are not known; indirect: of indirect light, None if the picture
    has none; whole: of both together, remaining noise included, None if there is only direct light. Each is an
    estimate, within about a factor of two. worst_object: the one with more than half of it, "" if none has or the
    parts are known.
    """

    direct: float | None
    indirect: float | None = None
    whole: float | None = None
    worst_object: str = ""

    @property
    def overall(self) -> float:
        """The error of all light."""
        return math.hypot(self.direct or 0.0, self.indirect or 0.0) if self.whole is None else self.whole

    @property
    def is_large(self) -> bool:
        """Whether the user should be warned."""
        return self.overall > POOR

    @property
    def is_negligible(self) -> bool:
        """Whether the error is too small to distinguish the picture from the truth."""
        return self.overall <= NONE

    @property
    def short(self) -> str:
        """A short form such as "error about 7.0 %, mostly on teapot"."""
        return f"error about {percent(self.overall)}{self._place}"

    @property
    def text(self) -> str:
        """A long form such as "error about 1.8 % (direct 0.6 %, indirect 1.7 %)"."""
        about = f"error about {percent(self.overall)}"
        if self.direct is None or self.indirect is None:
            return about + self._place
        return f"{about} (direct {percent(self.direct)}, indirect {percent(self.indirect)})"

    @property
    def _place(self) -> str:
        return f", mostly on {self.worst_object}" if self.is_large and self.worst_object else ""

    @property
    def advice(self) -> str:
        """A line of advice if the error is large; else ""."""
        if not self.is_large or self.direct is None:
            return ""
        if self.indirect is not None and self.indirect > self.direct:
            return "most of the error is in light between surfaces: more pixels, or bands at the second bounce, help"
        return "most of the error is in direct light: more lights, patches or bands help"


def percent(error: float) -> str:
    """A relative error as text: "1.8 %"."""
    return f"{100.0 * error:.1f} %"
