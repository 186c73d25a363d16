"""The part of a document that requests of all modes contain: its light and its layers, in one form.

It is made quickly, of values that the document has anyway; curves, quotients and means of images follow from it on
either side. It has no pixels and no camera: those are of the view that the worker has open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.light_mix import emission_of, mixed_light
from app.document.light_state import RGB, LightState
from engine.material.layer import Layer, object_of
from engine.material.layer_maps import MapMeans
from engine.realtime.zonal_harmonics.pose import Poses, without_identity

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class LayerState:
    """A layer that reflects: its key, the layer itself with its images, and how many bands each curve of its transport
    has, in the order of its model's `factors`; none where no transport is needed.

    visible: whether it takes part in the picture. fixed: its object is not edited, so that its picture under these
    curves is enough. means: those of its images over the surface, None while unknown.
    """

    key: str
    layer: Layer
    bands: tuple[int, ...] = ()
    visible: bool = True
    fixed: bool = False
    means: MapMeans | None = None

    @property
    def object(self) -> str:
        """The name of its object."""
        return object_of(self.key)

    @property
    def model(self) -> str:
        """The name of its model."""
        return self.layer.model.name

    @cached_property
    def quotient_parameters(self) -> tuple[float, ...]:
        """The eight numbers that its quotient's kernel needs."""
        return tuple(self.layer.quotient_parameters().tolist())

    @property
    def quotient(self) -> tuple[str, tuple[float, ...]]:
        """The model and parameters of the fixed part of its reflection."""
        return self.model, self.quotient_parameters

    @property
    def factors(self) -> tuple[str, ...]:
        """The names of its transport's curves."""
        return tuple(factor.name for factor in self.layer.model.factors[: len(self.bands)])

    @cached_property
    def coefficients(self) -> tuple[Float64Array, ...]:
        """Band values of these curves, (J, 3) each."""
        return tuple(self.layer.coefficients(name, n) for name, n in zip(self.factors, self.bands, strict=True))

    @property
    def mean_factor(self) -> Float64Array:
        """The mean factor of its images, (3,); 1 while unknown."""
        return np.ones(3) if self.means is None else self.means.factor(self.layer.maps)


@dataclass(frozen=True)
class SceneState:
    """A scene's light, mixed (`mixed_light`) and at intensity 1, the radiance of its emitters by name, and the layers
    of all other objects. lamps: the poses of those that a hand has moved from where the view has them."""

    light: LightState
    layers: tuple[LayerState, ...]
    emission: tuple[tuple[str, RGB], ...] = ()
    lamps: Poses = ()

    @property
    def visible(self) -> tuple[LayerState, ...]:
        """The layers that take part in the picture."""
        return tuple(state for state in self.layers if state.visible)


def layer_state(document: Document, key: str, bands: tuple[int, ...] = (), means: MapMeans | None = None) -> LayerState:
    """One of a document's layers, by its key."""
    fixed = not document.object(object_of(key)).editable
    return LayerState(key, document.layer(key), bands, document.is_visible(key), fixed, means)


def scene_state(document: Document, layer: Callable[[Document, str], LayerState] = layer_state) -> SceneState:
    """The state of a document for the worker. layer: makes that of one of the layers, by key."""
    layers = tuple(layer(document, key) for key, _ in document.layers())
    return SceneState(replace(mixed_light(document), intensity=1.0), layers, emission_of(document))


def moved_objects(document: Document) -> tuple[tuple[str, ...], Poses]:
    """The names of the shown objects that were moved by hand, lamps apart, and what moves emitters, for Deform."""
    names = tuple(state.name for state in document.shown if state.placement and not state.is_light)
    lamps = [(state.name, state.motion_stack) for state in document.shown if state.emits]
    return names, without_identity(lamps)
