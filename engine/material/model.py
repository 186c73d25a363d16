"""A reflection model: parameters that generate curves, and a fixed quotient, [BenArtzi07, eq. 3.1]

    rho(wi, wo) = f_q  rho_q(wi, wo)  f_o(theta_o)  f_A(gamma_A)  f_B(gamma_B).

A `Model` has a parameter table, the angles of its curves, functions that generate the curves and the scale f_q from
parameters, and the quotient's parameters. rho_q itself is compiled: from `quotient`, a plain function of `math` in the
model's file, or it is in `_kernels.quotient_cosine` if pictures need it to be fast. `brdf` states the whole formula
once more, directly, as the oracle of tests and of the brute-force integrator. Each family of models is in its own file,
which ends in `MODELS = ...`; all are found in `engine.material.MODELS`.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.material import kinds
from engine.material.parameters import Parameter, ParameterError, Value

Float64Array = NDArray[np.float64]
Parameters = Mapping[str, Value]


@dataclass(frozen=True)
class Factor:
    """One editable curve: `gamma` is the compiled angle over which it runs (engine.material.kinds)."""

    name: str
    gamma: int
    label: str
    tooltip: str

    @property
    def word(self) -> str:
        """Its label without the symbol: "half" for "half θₕ"."""
        return self.label.rpartition(" ")[0]


THETA_I = Factor("theta_i", kinds.THETA_I, "light θᵢ", "Brightness as the light falls in ever more slanted.")
THETA_O = Factor("theta_o", kinds.THETA_O, "view θₒ", "Brightness as the surface is seen ever more slanted.")
THETA_R = Factor("theta_r", kinds.THETA_R, "mirror θᵣ", "The highlight's profile, from its middle outwards.")
THETA_H = Factor("theta_h", kinds.THETA_H, "half θₕ", "The highlight's profile, from its middle outwards.")
THETA_D = Factor("theta_d", kinds.THETA_D, "difference θ_d", "Reflectance and tint, from head-on to grazing.")
GAMMA_ALPHA = Factor("gamma_alpha", kinds.GAMMA_ALPHA, "along γ_α", "The highlight's profile along the brushing.")
GAMMA_BETA = Factor("gamma_beta", kinds.GAMMA_BETA, "across γ_β", "The highlight's profile across the brushing.")
GAMMA_RATIO = Factor("gamma_ratio", kinds.GAMMA_RATIO, "ratio γᵣ", "How far the highlight reaches on its narrow side.")
GAMMA_WIDTH = Factor("gamma_width", kinds.GAMMA_WIDTH, "width γ_w", "The streak's profile, from its middle outwards.")
STREAK = Factor("streak", kinds.STREAK, "streak γ_s", "The streak's profile, from its middle outwards.")
SLOPE_U = Factor("theta_u", kinds.SLOPE_U, "along θ_u", "The highlight's profile along the brushing.")
SLOPE_V = Factor("theta_v", kinds.SLOPE_V, "across θ_v", "The highlight's profile across the brushing.")
PHI_H = Factor("phi_h", kinds.PHI_H, "azimuth φₕ", "The highlight's strength from along the threads, 0°, to across.")
PHI_D = Factor("phi_d", kinds.PHI_D, "twist φ_d", "The highlight's strength as wi turns about the half vector.")


class Model(ABC):
    """A reflection model. One instance each, compared by identity; pickled by name.

    quotient: rho_q cos_i as f(q, ix, iy, iz, ox, oy, oz) of the quotient parameters and two local directions above the
    horizon, finite and at least 0; a static method of assignments and conditions that calls only `math`, because it is
    compiled, and translated to GLSL; None if `kind` names one that is compiled already. quotient_names: the scalar
    parameters that are its first quotient parameters. is_diffuse: reflects about equally in all directions.
    highlight_in_quotient: a part of its distribution over the half vector is in the quotient and in no curve. shared:
    by name, the curve that a curve always equals. is_coloured: the quotient differs by colour, and q[CHANNEL] selects
    one, or MEAN for one number. needs_file: it is made by importing a file, and cannot be chosen. is_cover: a layer of
    it can lie on others, which it dims by its `coverage`. is_reciprocal: light and view can be exchanged.
    """

    name: ClassVar[str]
    label: ClassVar[str]
    tooltip: ClassVar[str]
    kind: ClassVar[int] = kinds.OWN
    quotient: ClassVar[Callable[..., float] | None] = None
    quotient_names: ClassVar[tuple[str, ...]] = ()
    is_diffuse: ClassVar[bool] = False
    highlight_in_quotient: ClassVar[bool] = False
    is_coloured: ClassVar[bool] = False
    needs_file: ClassVar[bool] = False
    is_cover: ClassVar[bool] = False
    is_reciprocal: ClassVar[bool] = True
    shared: ClassVar[Mapping[str, str]] = {}
    parameters: ClassVar[tuple[Parameter, ...]]
    factors: ClassVar[tuple[Factor, ...]]
    view_factor: ClassVar[Factor | None] = None

    @abstractmethod
    def generate(self, factor_name: str, params: Parameters, gamma: Float64Array) -> Float64Array:
        """The generated curve of a factor (or of the view factor) at angles (N,) in [0, pi/2]: (N, 3)."""

    def scale(self, params: Parameters) -> Float64Array:
        """f_q per channel, (3,)."""
        return channels(params, "scale")

    @abstractmethod
    def brdf(self, params: Parameters, wi: Float64Array, wo: Float64Array) -> Float64Array:
        """The whole formula, 1/sr, (N, 3), for unit directions (N, 3) in the local frame; 0 below the horizon."""

    def coverage(
        self, params: Parameters, curve: Callable[[str], Callable[[Float64Array], Float64Array]], theta_o: Float64Array
    ) -> Float64Array:
        """The directional albedo (N,) towards views at theta_o (N,), which is lost to what lies beneath; of its largest
        channel, so that what is beneath keeps its hue. curve: its curves by name, with the user's edits."""
        return np.zeros(len(theta_o))

    def quotient_parameters(self, params: Parameters) -> Float64Array:
        """The parameters of this model's compiled rho_q and angles, (8,)."""
        q = np.zeros(kinds.N_QUOTIENT_PARAMETERS)
        q[: len(self.quotient_names)] = [number(params, name) for name in self.quotient_names]
        return q

    def samples(self, factor_name: str, params: Parameters) -> tuple[Float64Array, Float64Array] | None:
        """The samples that a curve was fitted to, if they should be displayed: angles (N,) and values (N, 3)."""
        return None

    def bind_parameters(self, q: Float64Array) -> Float64Array:
        """Quotient parameters for the kernels of this process: addresses replace table numbers."""
        return q

    @property
    def number(self) -> int:
        """The number that identifies the quotient in kernels; for a model's own its address, compiled here on first
        use."""
        if self.quotient is None:
            return self.kind
        from engine.material._kernels import quotient_number

        return quotient_number(self.quotient)

    def colours_number(self, q: Float64Array) -> int:
        """The number that identifies the quotients of each colour in kernels, if these differ; else 0. q: the quotient
        parameters, bound or not."""
        return 0

    @property
    def curve_names(self) -> frozenset[str]:
        """Names of all curves, the view factor included; shared ones once."""
        there = self.factors + ((self.view_factor,) if self.view_factor else ())
        return frozenset(factor.name for factor in there if factor.name not in self.shared)

    @property
    def driving_parameters(self) -> frozenset[Parameter]:
        """The parameters that drive a curve, alike in two models whichever curve that is: they tell nothing of it."""
        driving = [each for each in self.parameters if {"A", "B", "o"}.intersection(each.drives)]
        return frozenset(dataclasses.replace(parameter, drives=()) for parameter in driving)

    def drivers(self, name: str) -> tuple[Parameter, ...]:
        """The parameters that drive a curve."""
        slots = {"o"} if self.view_factor is not None and name == self.view_factor.name else set[str]()
        slots |= {slot for slot, factor in zip("AB", self.factors, strict=False) if self.leader(factor.name) == name}
        return tuple(each for each in self.parameters if slots.intersection(each.drives))

    def leader(self, name: str) -> str:
        """The curve that stores a curve's operators: itself, unless it is shared. Raises ParameterError."""
        return self.shared.get(name, self.factor(name).name)

    def factor(self, name: str) -> Factor:
        """The factor (or view factor) of that name. Raises ParameterError naming the existing ones."""
        there = self.factors + ((self.view_factor,) if self.view_factor else ())
        for factor in there:
            if factor.name == name:
                return factor
        raise ParameterError(f"curve of {self.name}", name, "one of " + ", ".join(f.name for f in there))

    def defaults(self) -> dict[str, Value]:
        """Every parameter at its default."""
        return {parameter.name: parameter.default for parameter in self.parameters}

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return _model_named, (self.name,)

    def __repr__(self) -> str:
        return f"<model {self.name}>"


def _model_named(name: str) -> Model:
    from engine.material import MODELS

    return MODELS[name]


def find_parameter(model_name: str, table: tuple[Parameter, ...], name: str) -> Parameter:
    """The parameter of that name in a table. Raises ParameterError naming the existing ones."""
    for parameter in table:
        if parameter.name == name:
            return parameter
    raise ParameterError(f"parameter of {model_name}", name, "one of " + ", ".join(p.name for p in table))


def validate_parameters(model: Model, mapping: Mapping[str, object], where: str) -> dict[str, Value]:
    """All parameters of the model, from `mapping` and the defaults, in the order of the table.

    Raises LoadError for `where`, naming the key and what was expected, for an unknown key or an invalid value.
    """
    known = [parameter.name for parameter in model.parameters]
    for key, value in mapping.items():
        if key not in known:
            raise LoadError(where, f"{model.name}.{key}", value, f"only {', '.join(known)} in a {model.name} layer")
    try:
        return {p.name: p.accept(mapping.get(p.name, p.default)) for p in model.parameters}
    except ParameterError as error:
        raise LoadError(where, f"{model.name}.{error.what}", error.value, error.expected) from None


def channels(params: Parameters, name: str) -> Float64Array:
    """A parameter per channel, (3,)."""
    return np.broadcast_to(np.asarray(params[name], dtype=float), (3,))


def number(params: Parameters, name: str) -> float:
    """A scalar parameter."""
    value = params[name]
    if not isinstance(value, (int, float)):
        raise ParameterError(name, value, "a number")
    return float(value)


def grey(values: Float64Array) -> Float64Array:
    """The same curve (N,) for the three channels, (N, 3)."""
    return np.repeat(np.asarray(values, dtype=float)[:, None], 3, axis=1)


def ones(gamma: Float64Array) -> Float64Array:
    """The curve that is 1 everywhere, (N, 3)."""
    return np.ones((np.shape(gamma)[0], 3))
