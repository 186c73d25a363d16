"""Parameters: one declaration of a number, colour or choice defines its control, its tooltip, and what files accept.

A parameter is declared once, beside what it sets: those of reflection models in their files, those of the document in
`app.document.commands`, those of the view in `app.document.view_state`. `ui.panels.rows` draws them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from engine.core.errors import InsituError
from engine.measured.measurement import Measurement

Value = float | tuple[float, float] | tuple[float, float, float] | str | Measurement
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
    """A user-controlled variable, of a model or of anything else that a panel edits.

    kind: "pair" are two numbers, along u and along v. label and tooltip: its name and effect, for the user. drives: the
    parts of eq. 3.1 that change with a model's parameter; one that drives "quotient" changes the curve at once and the
    transport when the user is idle. minimum, maximum: the accepted range; soft: that of its slider, where it is
    narrower; least: the least absolute value, where 0 makes no sense. unit: shown after the number. logarithmic:
    perceived by ratio. power: the exponent with which a visible size, such as the width of a highlight, depends on it:
    -1/2 for an exponent. choices: with `titles` in place of their names. step: change per pixel of a drag of a number,
    0 in proportion to the number; None for one with a slider. form: a printf format of the number with its unit, "" for
    one by its range.
    """

    name: str
    kind: Literal["scalar", "rgb", "pair", "choice", "file"]
    default: Value
    label: str
    tooltip: str
    drives: tuple[Drive, ...] = ()
    minimum: float = 0.0
    maximum: float = 1.0
    unit: str = ""
    logarithmic: bool = False
    power: float = 1.0
    choices: tuple[str, ...] = ()
    titles: tuple[str, ...] = ()
    soft: tuple[float, float] | None = None
    step: float | None = None
    least: float = 0.0
    form: str = ""

    @property
    def limits(self) -> tuple[float, float]:
        """The range of its control."""
        return self.soft or (self.minimum, self.maximum)

    @property
    def number_format(self) -> str:
        """A printf format with as many digits as the range requires, and the unit."""
        digits = "%.4g" if self.logarithmic or self.maximum > 10.0 else "%.3f"
        return self.form or f"{digits} {self.unit}".rstrip().replace(" °", "°")

    def title_of(self, choice: str) -> str:
        """A choice as it is shown; without a title, short ones are upper-case abbreviations."""
        if self.titles:
            return self.titles[self.choices.index(choice)]
        return choice.upper() if len(choice) <= 3 else choice.capitalize()

    @property
    def expected(self) -> str:
        """What the parameter accepts, in words."""
        if self.kind == "file":
            return "the name of a file with a measured BRDF"
        if self.kind == "choice":
            return " or ".join(f'"{choice}"' for choice in self.choices)
        numbers = {"scalar": "a number", "pair": "a number or two", "rgb": "a number or three"}[self.kind]
        return f"{numbers} from {self.minimum:g} to {self.maximum:g}{', none 0' if self.least else ''}"

    def accept(self, value: object) -> Value:
        """The value in its plain form: float, pair or triple of floats (one number is used for all), choice or
        measurement (from a name: one that has not been read).

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
        count = {"scalar": 1, "pair": 2, "rgb": 3}[self.kind]
        numbers = value if count > 1 and isinstance(value, (list, tuple, np.ndarray)) else [value]
        if len(numbers) not in (1, count) or not all(map(self._in_range, numbers)):
            raise ParameterError(self.name, value, self.expected)
        plain = [float(cast(float, number)) for number in numbers]
        if count == 1:
            return plain[0]
        return (plain[0], plain[-1]) if count == 2 else (plain[0], plain[len(plain) // 2], plain[-1])

    def _in_range(self, number: object) -> bool:
        if not isinstance(number, (int, float, np.integer, np.floating)) or isinstance(number, bool):
            return False
        plain = float(number)
        return self.minimum <= plain <= self.maximum and abs(plain) >= self.least  # false for NaN too


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

LARGEST_INDEX = 1000.0
# The index of refraction that a facing reflectance stands for, by the name of that parameter.
INDICES = {
    FRESNEL.name: Parameter(
        "fresnel_index",
        "rgb",
        (1.5, 1.5, 1.5),
        "Index n",
        "Fresnel R by the index of refraction, R = (n − 1)²/(n + 1)²: 1.33 is water, 1.5 glass, 2.4 diamond.",
        minimum=1.0,
        maximum=LARGEST_INDEX,
        step=0.005,
        form="%.3f",
    ),
    FACING.name: Parameter(
        "reflectance_index",
        "scalar",
        1.5,
        "Index n",
        "Facing reflectance by the index of refraction, R = (n − 1)²/(n + 1)²: 1.33 is water, 1.5 glass or varnish.",
        minimum=1.0,
        maximum=LARGEST_INDEX,
        logarithmic=True,
        form="%.3f",
    ),
}


def reflectance_of_index(n: Value) -> Value:
    """R = (n - 1)^2 / (n + 1)^2 of a dielectric in air [BenArtzi07, eq. 3.10], of a number or of each channel."""
    if isinstance(n, tuple):
        return cast(Value, tuple(((each - 1.0) / (each + 1.0)) ** 2 for each in n))
    assert isinstance(n, int | float)
    return ((n - 1.0) / (n + 1.0)) ** 2


def index_of_reflectance(reflectance: Value) -> Value:
    """The index n whose R it is, at most 1000: that of R = 1 is infinite."""
    if isinstance(reflectance, tuple):
        return cast(Value, tuple(index_of_reflectance(each) for each in reflectance))
    assert isinstance(reflectance, int | float)
    root = reflectance**0.5
    return min((1.0 + root) / (1.0 - root), LARGEST_INDEX) if root < 1.0 else LARGEST_INDEX
