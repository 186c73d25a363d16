"""Parameters of models: one table defines sliders, the validation of files and the command line.

A range is both that of a slider and that of files.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from engine.core.errors import InsituError
from engine.measured.measurement import Measurement

Value = float | tuple[float, float, float] | str | Measurement
Drive = Literal["A", "B", "o", "scale", "quotient"]


class ParameterError(InsituError, ValueError):
    """A value that a parameter does not accept; `expected` says what it accepts."""

    def __init__(self, what: str, value: object, expected: str) -> None:
        self.what, self.value, self.expected = what, value, expected
        super().__init__(f"{what} = {value!r}, expected {expected}")

    def __reduce__(self) -> tuple[type[ParameterError], tuple[str, object, str]]:
        return ParameterError, (self.what, self.value, self.expected)


@dataclass(frozen=True)
class Parameter:
    """A user-controlled variable. `drives` names the parts of eq. 3.1 that change with it.

    A parameter that drives "quotient" changes the curve at once and the transport when the user is idle. `power` is the
    exponent with which a visible size, such as the width of a highlight, depends on it: -1/2 for an exponent.
    """

    name: str
    kind: Literal["scalar", "rgb", "choice", "file"]
    default: Value
    label: str
    tooltip: str
    drives: tuple[Drive, ...]
    minimum: float = 0.0
    maximum: float = 1.0
    unit: str = ""
    logarithmic: bool = False
    power: float = 1.0
    choices: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """What the parameter accepts, in words."""
        if self.kind == "file":
            return "the name of a file with a measured BRDF"
        if self.kind == "choice":
            return " or ".join(f'"{choice}"' for choice in self.choices)
        numbers = "a number" if self.kind == "scalar" else "a number or three"
        return f"{numbers} from {self.minimum:g} to {self.maximum:g}"

    def accept(self, value: object) -> Value:
        """The value in its plain form: float, triple of floats (one number is used for three), choice or measurement
        (from a name: one that has not been read).

        Raises ParameterError for anything else, anything out of range, and anything not finite.
        """
        if self.kind == "file":
            if not isinstance(value, (str, Measurement)) or not value:
                raise ParameterError(self.name, value, self.expected)
            return Measurement(value) if isinstance(value, str) else value
        if self.kind == "choice":
            if value not in self.choices:
                raise ParameterError(self.name, value, self.expected)
            return str(value)
        numbers = value if self.kind == "rgb" and isinstance(value, (list, tuple, np.ndarray)) else [value]
        if len(numbers) not in (1, 3) or not all(map(self._in_range, numbers)):
            raise ParameterError(self.name, value, self.expected)
        plain = [float(cast(float, number)) for number in numbers]
        return plain[0] if self.kind == "scalar" else (plain[0], plain[len(plain) // 2], plain[-1])

    def _in_range(self, number: object) -> bool:
        if not isinstance(number, (int, float, np.integer, np.floating)) or isinstance(number, bool):
            return False
        return bool(self.minimum <= number <= self.maximum)  # false for NaN too


ETA = Parameter(
    "eta",
    "rgb",
    (0.2004, 0.924, 1.1022),
    "Index η",
    "Real part of the index of refraction, per channel: with k it makes the tint and how it pales at grazing angles.",
    ("B",),
    minimum=0.01,
    maximum=20.0,
    logarithmic=True,
)
EXTINCTION = Parameter(
    "k",
    "rgb",
    (3.9129, 2.4528, 2.1421),
    "Extinction k",
    "Imaginary part of the index, per channel: high is bright metal, 0 is glass or lacquer.",
    ("B",),
    maximum=20.0,
)
SCALE = Parameter(
    "scale",
    "scalar",
    1.0,
    "Scale",
    "Strength of the whole reflection; 1 is physical, more adds light from nowhere.",
    ("scale",),
    maximum=4.0,
)
TINT = Parameter(
    "scale",
    "rgb",
    (0.5, 0.5, 0.5),
    "Scale",
    "Strength and colour of the highlight; more than 1 adds light from nowhere.",
    ("scale",),
    maximum=4.0,
)
FRESNEL = Parameter(
    "fresnel",
    "rgb",
    (0.5, 0.5, 0.5),
    "Fresnel R",
    "Share of each colour reflected head-on, rising to all of it at grazing angles: the layer reflects R of it, its "
    "Fresnel term the rest.",
    ("scale",),
)
FACING = Parameter(
    "reflectance",
    "scalar",
    1.0,
    "Facing reflectance",
    "Share of light reflected head-on, rising to all of it at grazing angles: 0.04 is varnish, 1 has no rise.",
    ("quotient",),
)
