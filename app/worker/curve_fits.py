"""The worker's part of painting a highlight: pixels and their wanted radiance to changes of curves.

Some pixels of a stroke and some of the rest of the object, which hold it, are taken out of the transport that is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState
from app.modes.placement.inverse_messages import CurvesFitted, FitCurves
from app.modes.placement.painted_curves import MOST_HELD, shares_scale
from app.worker.layer_data import LayerData, shape_of
from app.worker.schedule import Steps
from engine.core.errors import InsituError
from engine.inverse.curve_fit import radiance_weights
from engine.inverse.highlight_brush import evenly
from engine.inverse.layer_fit import HeldPixels, LayerPixels, fit_layers
from engine.material.layer_maps import LayerMaps
from engine.precompute.direct.bandstore import BandStore
from engine.precompute.direct.pipeline import Placement
from engine.render.still import StillLayer, view_factors, with_maps
from engine.scene.map_sampler import MapSamples

if TYPE_CHECKING:
    from app.worker.indirect_tasks import IndirectTasks


class CurveFits:
    """Fits curves to pixels of one view. Images that were sampled for one fit serve the next."""

    def __init__(self, placement: Placement) -> None:
        self._placement = placement
        self._images: dict[tuple[int, LayerMaps], MapSamples | None] = {}

    def fit(self, request: FitCurves, current: Mapping[str, LayerData], indirect: IndirectTasks | None) -> Steps:
        """Answer a request by the layers' present transport. Raises InsituError while that is coarse."""
        points, n_points = np.asarray(request.points), self._n_points(request.layers[0])
        others = np.setdiff1d(evenly(np.arange(n_points), MOST_HELD), request.touched)
        (first, *_), touched, held = request.layers, [], []
        for layer in request.layers:
            data = current.get(layer.key)
            if data is None or not data.fits_curves(layer) or data.store.n_points != n_points:
                raise InsituError(f"{layer.object}: its light is still coarse; paint once the picture is finer")
            data = data.with_curves(layer)
            is_scaled = shares_scale((layer.key, layer.layer), (first.key, first.layer))
            touched.append(self._pixels(layer, data, points, indirect, is_scaled))
            held.append(self._pixels(layer, data, others, indirect, is_scaled))
            yield None
        seen, wanted = np.asarray(request.seen), np.asarray(request.wanted)
        of_held = np.asarray(sum(pixels.radiance for pixels in held))
        found = fit_layers(
            touched, request.names, wanted - seen, radiance_weights(np.maximum(seen, wanted)),
            HeldPixels(held, radiance_weights(of_held)), request.smoothness, request.holding, request.in_grey,
        )  # fmt: skip
        yield CurvesFitted(found.fits, found.left)

    def _n_points(self, layer: LayerState) -> int:
        return len(self._placement.rows_of(self._object(layer)))

    def _object(self, layer: LayerState) -> int:
        return self._placement.scene.object_index(layer.object)

    def _pixels(
        self, layer: LayerState, data: LayerData, points: NDArray[np.integer], indirect: IndirectTasks | None,
        is_scaled: bool,
    ) -> LayerPixels:  # fmt: skip
        """Some points of a layer, by their numbers in its object."""
        assert isinstance(data.store, BandStore)
        i_object = self._object(layer)
        rows = self._placement.rows_of(i_object)[points]
        still = StillLayer(i_object, layer.layer, shape_of(layer).bands, editable=True)
        view = view_factors(self._placement.hits, rows, replace(still, maps=self._sampled(still)))
        between = {} if indirect is None else {
            name: view * found for name in layer.factors
            if (found := indirect.curve_rows(layer, name, rows)) is not None
        }  # fmt: skip
        curves = dict(zip(layer.factors, layer.coefficients, strict=True))
        return LayerPixels(data.store.take(points), view * data.unit, curves, between, is_scaled)

    def _sampled(self, still: StillLayer) -> MapSamples | None:
        """A layer's images at all points of its object."""
        key = still.i_object, still.layer.maps
        if key not in self._images:
            self._images[key] = with_maps(self._placement, [still])[0].maps
        return self._images[key]
