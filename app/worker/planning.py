"""What the worker plans: how many bands layers need (`app.modes.placement.band_plans`), and how many lights and patches
the pictures of the open view.

The latter is tried once, and stored as long as edits leave its inputs as they are, in a file too: a scene that is
opened again then finds the cached transport. Its inputs are the view, the emitters, which layers can be edited and
their models; not curves and parameters, which change during a drag, nor the rotation of a sky: another number of lights
would be another transport for all of the picture. So it is tried with the layers and under the sky of the scene's file,
and with the initial parameters of layers that are not in it, whatever was edited by then: the same document has as many
lights in every window.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from app.document.described import document_from_description
from app.document.scene_state import LayerState
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import BandsPlanned, ComputeTransport, PlanBands
from app.worker.cache import content_key
from app.worker.layer_data import shape_of
from app.worker.tasks import WorkerContext
from engine.core.stored_arrays import ArrayReader, Arrays
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.parameters import FRESNEL
from engine.planner import band_counts
from engine.precompute.direct.pipeline import SkyState
from engine.render.light_pilot import LEAST, NOT_FOUND, LightBudget, find_light_budget, is_worthwhile
from engine.render.still import StillLayer

LINES = tuple(LEAST)


class LightBudgets:
    """The light budgets of the open view."""

    def __init__(self, context: WorkerContext) -> None:
        self._context = context
        self._budgets: dict[str, LightBudget] = {}

    def cached_budget(self, request: ComputeTransport, sky: SkyState) -> LightBudget | None:
        """The budget that the picture of a request needs, None where that was not tried yet."""
        settings = request.settings
        if not is_worthwhile(self._context.open_placement) or settings.overridden >= set(LINES):
            return LightBudget(settings.n_lights, settings.n_patches)
        key = self._key(request, sky)
        need = self._budgets.get(key) or self._context.store.get(key, budget_from)
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
            self._context.store.put(key, budget_arrays(need))
        return need

    def _unedited(self, request: ComputeTransport) -> list[Layer]:
        """The visible layers of a request as the scene's file has them, or with their models' initial parameters."""
        scene = self._context.open_placement.scene
        there = dict(document_from_description(str(scene.file), scene.description).layers())
        return [_of_file(each, there.get(each.key)) for each in request.scene.visible]

    def _unturned(self, sky: SkyState) -> SkyState:
        """The sky with the rotation of the scene's file."""
        described = self._context.open_placement.scene.description.environment
        return replace(sky, rotation=0.0 if described is None else described.rotation)

    def _key(self, request: ComputeTransport, sky: SkyState) -> str:
        settings, environment = request.settings, "" if sky.environment is None else sky.environment.digest
        layers = tuple(
            (each.key, each.model, each.bands, each.fixed, repr(layer.parameters))
            for each, layer in zip(request.scene.visible, self._unedited(request), strict=True)
        )
        emitting = tuple(name for name, emission in request.scene.emission if any(emission))
        return content_key(
            "light budget, unedited", self._context.view_key, environment, sky.scale, self._unturned(sky).rotation,
            emitting, layers, settings.n_lights, settings.n_patches, settings.keeps_sphere,
            tuple(sorted(settings.overridden)),
        )  # fmt: skip


def _of_file(state: LayerState, there: Layer | None) -> Layer:
    """A layer as the file has it, where it has one of the same kind; else with the initial parameters of its model, but
    its own measurement."""
    layer = state.layer
    if there is not None and (there.model, there.rises) == (layer.model, layer.rises):
        return there
    begins = layer.model.defaults() | {FRESNEL.name: FRESNEL.default}
    values = tuple((name, value if isinstance(value, str) else begins[name]) for name, value in layer.parameters)
    return layer.replace(parameters=values, edits=(), maps=LayerMaps())


_ABSENT, _MEASURED, _NOT_FOUND = range(3)  # of a line's errors


def budget_arrays(need: LightBudget) -> dict[str, np.ndarray]:
    """A budget as arrays; stored numbers are finite, so whether a line has errors stands beside them."""
    off = {line: (plain, sharper) for line, plain, sharper in need.errors}
    states = [_ABSENT if line not in off else _NOT_FOUND if NOT_FOUND in off[line] else _MEASURED for line in LINES]
    errors = [off[line] if states[k] == _MEASURED else (0.0, 0.0) for k, line in enumerate(LINES)]
    return {
        "numbers": np.array([need.lights, need.patches], np.int64),
        "states": np.array(states, np.int64),
        "off": np.array(errors, np.float64),
    }


def budget_from(arrays: Arrays) -> LightBudget:
    """The budget of stored arrays. Raises UnsoundArrays where they are not one's."""
    reader = ArrayReader(arrays)
    lights, patches = map(int, reader.take("numbers", np.int64, 2))
    states, off = reader.take("states", np.int64, 2).tolist(), reader.take("off", np.float64, 2, 2).tolist()
    errors = [
        (line, *((NOT_FOUND, NOT_FOUND) if state == _NOT_FOUND else pair))
        for line, state, pair in zip(LINES, states, off, strict=True)
        if state != _ABSENT
    ]
    return LightBudget(lights, patches, tuple(errors))


def plan_bands(request: PlanBands) -> Iterator[Response | None]:
    """Plan one layer a step: some 10 to 40 ms each."""
    bands = []
    for layer in request.layers:
        bands.append(band_counts(layer))
        yield None
    yield BandsPlanned(tuple(bands))
