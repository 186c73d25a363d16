"""The curves a picture is made with: the band values of a document's layers, and the samples of their other curves.

Shapes: J bands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.scene_state import LayerState, SceneState, layer_state, scene_state
from app.modes.placement.band_plans import BandPlans
from engine.curve.operators import HALF_PI
from engine.material import MODELS
from engine.material.layer import FRAMES, Layer, object_of
from engine.material.layer_maps import Images, MapMeans
from engine.material.measured import MeasuredModel
from engine.material.model import Model
from engine.planner import MOST_BANDS, bands_for_sharpest
from engine.settings import bands_of_lines

Float64Array = NDArray[np.float64]
Coefficients = Mapping[str, Float64Array]

N_VIEW_SAMPLES = 256
_VIEW = ""  # the key of f_o, which the model's own view factor is a part of


class Curves:
    """Band values and samples of a document's curves, computed once for each layer value.

    A layer is a value: as long as it is the same one, its curves are. Arrays are handed out read-only, and the same
    object each time, so that callers can compare by identity first.
    """

    def __init__(self, most_bands: int = MOST_BANDS, plans: BandPlans | None = None) -> None:
        """plans: those of a controller before, None for new ones that have at most so many bands."""
        self.plans = plans or BandPlans(most_bands)
        self.map_means: dict[tuple[str, Images], MapMeans] = {}
        self._cached: dict[tuple[str, str, int], tuple[Layer, Float64Array]] = {}

    def scene_opened(self, scene: object) -> None:
        """Take over an open scene: bands are planned anew for another one."""
        self._cached = {}
        self.plans.scene_opened(scene)

    def bands(self, document: Document, key: str) -> dict[str, int]:
        """J of each of a layer's transport factors: as planned, or as the user set it for the sharpest, or for each."""
        counts, lines = self.planned(document, key), dict(document.overrides)
        return bands_of_lines(key, counts, lines) if lines else counts

    def planned(self, document: Document, key: str) -> dict[str, int]:
        """The same without the plan's overrides."""
        return self._planned(document, key, document.layer(key))

    def all_planned(self, document: Document) -> tuple[tuple[str, dict[str, int]], ...]:
        """The same of all layers, by key."""
        return tuple((key, self._planned(document, key, layer)) for key, layer in document.layers())

    def _planned(self, document: Document, key: str, layer: Layer) -> dict[str, int]:
        counts, chosen = self.plans.of(key, layer), document.first_bands
        return counts if chosen is None else bands_for_sharpest(layer, counts, chosen)

    def coefficients(self, document: Document, key: str, most: int | None = None) -> dict[str, Float64Array]:
        """Band values of each transport factor of a layer, (J,3) by factor [BenArtzi07, eq. 4.17], of `most` bands."""
        layer = document.layer(key)
        counts = self.bands(document, key)
        return {name: self._band_values(key, layer, name, min(n, most or n)) for name, n in counts.items()}

    def band_values(self, document: Document, key: str, factor: int, n_bands: int) -> Float64Array:
        """Band values (J,3) of one of a layer's transport factors, by number, of so many bands."""
        layer = document.layer(key)
        return self._band_values(key, layer, layer.model.factors[factor].name, n_bands)

    def scene_state(self, document: Document) -> SceneState:
        """The state of a document for the worker."""
        return scene_state(document, self.layer_state)

    def layer_state(self, document: Document, key: str) -> LayerState:
        """The state of a layer for the worker: with its bands, and the means of its images as far as they are known."""
        layer = document.layer(key)
        bands = self.bands(document, key)
        return layer_state(document, key, tuple(bands.values()), self._means(key, layer))

    def view_curves(self, document: Document, key: str) -> Float64Array:
        """The factors of f_o at 256 angles from 0 to π/2 to the normals of both frames, (2,256,3); ones where there is
        none."""
        layer = document.layer(key)
        known = self._cached_curve(key, layer, _VIEW, len(FRAMES))
        return self._store_curve(key, layer, _VIEW, view_curves_of(layer) if known is None else known)

    def view_curve(self, document: Document, key: str) -> Float64Array:
        """f_o where both normals are the same, (256,3)."""
        return np.asarray(self.view_curves(document, key).prod(axis=0))

    def gain(self, document: Document, key: str) -> Float64Array:
        """f_q of a layer, (3,)."""
        return document.layer(key).scale()

    def outgoing_gain(self, document: Document, key: str) -> Float64Array:
        """f_q of a layer for all but the camera, (3,): with the mean of its texture and weight map, once that is
        known."""
        layer = document.layer(key)
        means = self._means(key, layer)
        return layer.scale() if means is None else layer.scale() * means.factor(layer.maps)

    def _means(self, key: str, layer: Layer) -> MapMeans | None:
        return None if layer.maps.is_plain else self.map_means.get((object_of(key), layer.maps.images))

    def _band_values(self, key: str, layer: Layer, factor: str, n_bands: int) -> Float64Array:
        known = self._cached_curve(key, layer, factor, n_bands)
        values = layer.coefficients(factor, n_bands) if known is None else known
        return self._store_curve(key, layer, factor, values)

    def _cached_curve(self, key: str, layer: Layer, factor: str, n: int) -> Float64Array | None:
        """The cached curve when it was made from this layer, or from one that does not differ in this curve."""
        before, values = self._cached.get((key, factor, n), (None, None))
        if before is None or values is None or not (before is layer or _same_curve(before, layer, factor)):
            return None
        return values

    def _store_curve(self, key: str, layer: Layer, factor: str, values: Float64Array) -> Float64Array:
        values.setflags(write=False)
        self._cached[key, factor, len(values)] = (layer, values)
        return values


def picture_identity(model: str, quotient_parameters: Sequence[float]) -> tuple[object, ...]:
    """The identity of a layer's picture, for its f_q and curves: its model, and of a measured one the measurement.

    Those of another model have another scale: with them the picture of the layer before would be far too bright or
    dark.
    """
    return (model, *quotient_parameters) if isinstance(MODELS[model], MeasuredModel) else (model,)


def view_curves_of(layer: Layer) -> Float64Array:
    """The factors of f_o at 256 angles from 0 to π/2, (2,256,3), see `Layer.view_curves`."""
    return layer.view_curves(np.linspace(0.0, HALF_PI, N_VIEW_SAMPLES))


def _same_curve(before: Layer, layer: Layer, factor: str) -> bool:
    """Whether two layers agree in all that makes this curve: model, operators, and the parameters that drive it; f_o
    also in what lies on them."""
    if before.model is not layer.model:
        return False
    if factor == _VIEW:
        view = layer.model.view_factor
        alike = (before.frame, before.covers) == (layer.frame, layer.covers)
        return alike and (view is None or _same_curve(before, layer, view.name))
    part = _part_of(layer.model, factor)
    driving = [parameter.name for parameter in layer.model.parameters if part in parameter.drives]
    old, new = before.values, layer.values
    return before.operators(factor) == layer.operators(factor) and all(old[name] == new[name] for name in driving)


def _part_of(model: Model, factor: str) -> str:
    """Which curve of [BenArtzi07, eq. 3.1] a factor is: "A", "B" or "o"."""
    names = [each.name for each in model.factors]
    return "AB"[names.index(factor)] if factor in names else "o"
