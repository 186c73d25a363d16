"""A layer's curves in the form that compiled sums over rays use, and the axis of its lobe."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from engine.material import MODELS, kinds
from engine.material.model import Model
from engine.precompute.indirect import _ray_kernels as rays
from engine.precompute.indirect import _reflection_kernels as kernels


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """A layer for reflection at gather points: model, quotient parameters (8,), values at the nodes of its one or two
    curves, (J, 3) and (K, 3); tint (3,): a factor on the sums, see `albedo`."""

    model: Model
    quotient_parameters: NDArray[np.float64]
    curves: tuple[NDArray[np.float64], ...]
    tint: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))

    @property
    def is_tinted(self) -> bool:
        return bool((self.tint != 1.0).any())

    @property
    def bound_parameters(self) -> NDArray[np.float64]:
        """The quotient parameters with handles that are valid in this process."""
        return self.model.bind_parameters(np.asarray(self.quotient_parameters, np.float64))

    def optics(self, folded: bool = False) -> kernels.ReflectingLayer:
        """The layer for the kernels; folded: mark a single constant curve, whose angle is then not required."""
        first, *second = (np.ascontiguousarray(curve, np.float32) for curve in self.curves)
        factors = self.model.factors
        kind_b = factors[1].gamma if len(factors) > 1 else -1
        other = second[0] if second else np.ones((1, 3), np.float32)
        q = self.bound_parameters
        kind_a = kernels.CONSTANT if folded and kind_b < 0 and bool((first == first[0]).all()) else factors[0].gamma
        return kernels.ReflectingLayer(self.model.number, q, kind_a, kind_b, first, other)


def any_glossy(model_names: Iterable[str]) -> bool:
    """Whether the reflection of an object with layers of these models depends on the outgoing direction."""
    return not all(MODELS[name].is_diffuse for name in model_names)


def lobe_axis_of(model_names: Iterable[str]) -> int:
    """The axis about which hemisphere samples of an object with layers of these models are dense."""
    gammas = {factor.gamma for name in model_names for factor in MODELS[name].factors}
    if gammas.intersection(kinds.HALF_ANGLES):
        return rays.HALF
    return rays.MIRROR if kinds.THETA_R in gammas else rays.NORMAL
