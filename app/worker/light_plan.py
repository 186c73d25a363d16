"""How many lights and patches the pictures of the view that is open need: tried once, and kept as long as edits leave
what the answer hangs on, in a file too, so that whoever opens the scene again looks for the transport that there is.

It hangs on the view, on what shines, on which layers can be edited and on their models; not on curves and parameters,
which change under a hand, nor on where a sky has been turned to: another number of lights would be another transport
for all of the picture. So it is tried with the layers and under the sky as the scene's file has them, layers that are
not there as their models begin, whatever was edited by then: the same document has as many lights in every window.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from app.document.document import document_from_description
from app.document.scene_state import LayerState
from app.modes.placement.placement_messages import ComputeTransport
from app.worker.cache import content_key
from app.worker.layer_data import shape_of
from app.worker.worker_context import WorkerContext
from engine.core.stored_arrays import ArrayReader, Arrays
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.parameters import FRESNEL
from engine.precompute.direct.pipeline import SkyState
from engine.render.light_pilot import LEAST, LightBudget, find_light_budget, is_worthwhile
from engine.render.still import StillLayer

LINES = tuple(LEAST)


class LightBudgets:
    """What is known of the view that is open on the bench."""

    def __init__(self, context: WorkerContext) -> None:
        self._context = context
        self._budgets: dict[str, LightBudget] = {}

    def cached_budget(self, request: ComputeTransport, sky: SkyState) -> LightBudget | None:
        """What the picture of a request needs, None where that was not tried yet."""
        settings = request.settings
        if not is_worthwhile(self._context.open_placement) or settings.overridden >= set(LINES):
            return LightBudget(settings.n_lights, settings.n_patches)
        key = self._key(request, sky)
        need = self._budgets.get(key) or self._context.store.get(key, _budget_of)
        if need is not None:
            self._budgets[key] = need
        return need

    def find_budget(self, request: ComputeTransport, sky: SkyState) -> Generator[None, None, LightBudget]:
        """The same; tried where it is not known."""
        need = self.cached_budget(request, sky)
        if need is None:
            placement = self._context.open_placement
            layers = [
                StillLayer(placement.scene.object_index(each.object), layer, shape_of(each).bands, not each.fixed)
                for each, layer in zip(request.scene.visible, self._unedited(request), strict=True)
            ]
            need = yield from find_light_budget(placement, layers, self._unturned(sky), request.settings)
            key = self._key(request, sky)
            self._budgets[key] = need
            self._context.store.put(key, _arrays_of(need))
        return need

    def _unedited(self, request: ComputeTransport) -> list[Layer]:
        """The visible layers of a request as the scene's file has them, or as their models begin."""
        scene = self._context.open_placement.scene
        there = dict(document_from_description(str(scene.file), scene.description).layers())
        return [_of_file(each, there.get(each.key)) for each in request.scene.visible]

    def _unturned(self, sky: SkyState) -> SkyState:
        """The sky where the scene's file has turned it."""
        described = self._context.open_placement.scene.description.environment
        return replace(sky, rotation=0.0 if described is None else described.rotation)

    def _key(self, request: ComputeTransport, sky: SkyState) -> str:
        settings, radiance = request.settings, None if sky.environment is None else sky.environment.radiance
        layers = tuple(
            (each.key, each.model, each.bands, each.fixed, repr(layer.parameters))
            for each, layer in zip(request.scene.visible, self._unedited(request), strict=True)
        )
        shining = tuple(name for name, emission in request.scene.emission if any(emission))
        return content_key(
            "light need, unedited", self._context.view_key, radiance, sky.scale, self._unturned(sky).rotation, shining,
            layers, settings.n_lights, settings.n_patches, settings.keeps_sphere,
            tuple(sorted(settings.overridden)),
        )  # fmt: skip


def _of_file(state: LayerState, there: Layer | None) -> Layer:
    """A layer as the file has it, where one of its kind stands there; else with the parameters that its model begins
    with, but for the measurement that it is of."""
    layer = state.layer
    if there is not None and (there.model, there.rises) == (layer.model, layer.rises):
        return there
    begins = layer.model.defaults() | {FRESNEL.name: FRESNEL.default}
    values = tuple((name, value if isinstance(value, str) else begins[name]) for name, value in layer.parameters)
    return layer.replace(parameters=values, edits=(), maps=LayerMaps())


def _arrays_of(need: LightBudget) -> dict[str, np.ndarray]:
    off = {line: (plain, sharper) for line, plain, sharper in need.errors}
    return {
        "numbers": np.array([need.lights, need.patches], np.int64),
        "off": np.array([off.get(line, (-1.0, -1.0)) for line in LINES], np.float64),
    }


def _budget_of(arrays: Arrays) -> LightBudget:
    reader = ArrayReader(arrays)
    lights, patches = map(int, reader.take("numbers", np.int64, 2))
    off = zip(LINES, reader.take("off", np.float64, 2, 2).tolist(), strict=True)
    return LightBudget(lights, patches, tuple((line, plain, sharper) for line, (plain, sharper) in off if plain >= 0.0))
