"""The freezing of indirect light that is desired: the values that `indirect_controller` compares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document, Selection
from app.document.scene_state import LayerState, SceneState
from app.modes.placement.curves import Curves, Float64Array
from app.modes.placement.edited_curves import edited_layers
from engine.material.layer import object_of


@dataclass(frozen=True, eq=False)
class LayerReflectance:
    """The reflectance of a visible layer, to be compared: its curves, f_q (3,) and the factors of f_o (2,N,3), as
    `Curves` stores them."""

    layer: LayerState
    coefficients: tuple[Float64Array, ...]
    gain: Float64Array
    view_curves: Float64Array

    @property
    def key(self) -> str:
        return self.layer.key

    @property
    def shape(self) -> tuple[object, ...]:
        """What its sums depend on beside the values of its curves."""
        return self.key, self.layer.quotient, tuple(len(curve) for curve in self.coefficients)


def layer_reflectances(scene: SceneState, document: Document, curves: Curves) -> tuple[LayerReflectance, ...]:
    """The reflectance of all visible layers of a document, as the worker gets it."""
    return tuple(
        LayerReflectance(
            layer, tuple(curves.coefficients(document, layer.key).values()),
            curves.outgoing_gain(document, layer.key), curves.view_curves(document, layer.key),
        )
        for layer in scene.visible
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class DesiredFreezing:
    """The scene that indirect light is frozen for; two serve the same if what they hold fixed is the same.

    edited: for layers that share the selected curve, which of their curves it is.
    """

    scene: SceneState
    reflectances: tuple[LayerReflectance, ...]
    key: str | None
    factor: int | None
    second: int | None
    edited: Mapping[str, int] = field(default_factory=dict)

    def serves(self, other: DesiredFreezing) -> bool:
        """Whether the response to one is a response to the other as well."""
        return self is other or _serves(self, other)

    def same(self, other: DesiredFreezing) -> bool:
        """Whether it was also made with the other's curves of the edited object: the light that these send on follows
        them as far as a few of their bands tell, and the noise depends on all of them."""
        return self is other or _same(self, other)

    def has_layers_of(self, other: DesiredFreezing) -> bool:
        """Whether the response to one can be drawn for the other's layers, though the curves that it holds fixed may be
        others."""
        one, two = ((each.key, each.factor, [look.shape for look in each.reflectances]) for each in (self, other))
        return one == two

    def alike(self, mine: LayerReflectance, theirs: LayerReflectance) -> bool:
        """Whether what is held fixed of a layer is the same."""
        if mine.key != theirs.key or mine.layer.model != theirs.layer.model:
            return False
        edited = self.factor if mine.key == self.key else self.edited.get(mine.key)
        if edited is None and mine.layer.quotient != theirs.layer.quotient:
            return False
        # The bands of an edited curve are those that it was frozen with, whatever it needs now; so is its shadowing.
        for i, (one, two) in enumerate(zip(mine.coefficients, theirs.coefficients, strict=True)):
            if i != edited and not (one is two or _close(one, two)):
                return False
        if self.key is not None and object_of(mine.key) == object_of(self.key):
            return True  # its albedo is a variable
        return np.array_equal(mine.gain, theirs.gain) and np.array_equal(mine.view_curves, theirs.view_curves)


def desired_freezing(
    document: Document, selected: Selection | None, second: int | None, curves: Curves
) -> DesiredFreezing:
    """The freezing that a document and a selection desire. second: the most bands of the second bounce, None for as
    many as a curve has."""
    key = factor = None
    edited: dict[str, int] = {}
    # An object that the user froze is not edited: it takes no part in the polynomial, and costs no bands.
    if selected is not None and not (document.object(selected.object).is_lamp or document.is_frozen(selected.key)):
        key = selected.key
        names = list(curves.coefficients(document, key))
        if selected.factor in names and document.object(selected.object).editable:
            factor = names.index(selected.factor)
            # Other objects that share the curve are no variables: their light follows once nothing changes any more.
            own = [each for each in edited_layers(document, selected)[1:] if object_of(each) == selected.object]
            for other in own:
                theirs = list(curves.coefficients(document, other))
                edited |= {other: theirs.index(selected.factor)} if selected.factor in theirs else {}
    scene = curves.scene_state(document)
    return DesiredFreezing(scene, layer_reflectances(scene, document, curves), key, factor, second, edited)


# One frame asks several times about the same pairs, which never change.
@lru_cache(maxsize=16)
def _serves(one: DesiredFreezing, other: DesiredFreezing) -> bool:
    mine, theirs = ((each.key, each.factor, each.second, len(each.reflectances)) for each in (one, other))
    return mine == theirs and all(one.alike(*pair) for pair in zip(one.reflectances, other.reflectances, strict=True))


@lru_cache(maxsize=16)
def _same(one: DesiredFreezing, other: DesiredFreezing) -> bool:
    pairs = zip(one.reflectances, other.reflectances, strict=False)
    return len(one.reflectances) == len(other.reflectances) and all(_equal(*pair) for pair in pairs)


def _equal(one: LayerReflectance, two: LayerReflectance) -> bool:
    """Whether two reflectances of one layer are equal."""
    if one.layer.quotient != two.layer.quotient:
        return False
    mine, theirs = ((*look.coefficients, look.gain, look.view_curves) for look in (one, two))
    return all(a is b or _close(a, b) for a, b in zip(mine, theirs, strict=True))


def _close(one: NDArray[np.floating], two: NDArray[np.floating]) -> bool:
    return one.shape == two.shape and bool(np.allclose(one, two, rtol=1e-6, atol=0.0))
