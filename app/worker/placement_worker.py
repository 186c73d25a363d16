"""Placement in the worker: transport, indirect light and images, the engine's generators turned into messages.

A transport runs through stages (`transport_stages`), coarse to fine. A sky that is rotated or exchanged over a scene
that was prepared for it lights it anew, at every pixel (`relighting`). Within a stage the selected layer comes first. A
stage's results replace those before, and what is there already in such quality is not made again (`layer_data`).
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from app.document.scene_state import LayerState, SceneState
from app.document.single_lights import Weights, light_weights
from app.messages.catcher_messages import FindCatcherLight
from app.messages.worker_messages import Response
from app.modes.mode import ModeWorker
from app.modes.placement.inverse_messages import FitCurves
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    EstimateError,
    FreezeIndirect,
    LightPlanned,
    LightsReady,
    PlanBands,
    PrepareRelighting,
    RelightingPrepared,
    SampleEdited,
    SampleMaps,
    StageDone,
    StageFootprint,
)
from app.worker.catcher_tasks import find_catcher_light
from app.worker.file_tasks import ensure_tables
from app.worker.kernels import COMPILING, ESTIMATE, FIRST_TIME, INDIRECT, PAINTING, RELIGHTING
from app.worker.layer_data import RELIT, STAGES, LayerData, LightingState
from app.worker.light_pictures import LightPictures
from app.worker.moves import Moves
from app.worker.planning import LightBudgets, plan_bands
from app.worker.relighting import Relighting
from app.worker.schedule import Handlers, Steps
from app.worker.tasks import WorkerContext
from app.worker.transport_stages import StageClock, TransportStages, lit_key, rows_of, stages_of
from engine.light.environment import downsample
from engine.material.layer import Layer
from engine.planner import band_counts
from engine.precompute.direct.bandstore import FixedPicture
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.pipeline import COARSE, DRAG, FINAL, Placement, Quality, SkyState, final_quality
from engine.precompute.direct.simple_lighting import simple_lighting
from engine.render.light_pilot import LightBudget
from engine.settings import Precision, RenderSettings

if TYPE_CHECKING:
    from app.worker.curve_fits import CurveFits
    from app.worker.indirect_tasks import IndirectTasks
    from app.worker.map_tasks import MapTasks

DRAG_ENVIRONMENT_HEIGHT = 128
KERNEL_SECONDS = 0.05


class PlacementWorker(ModeWorker):
    """The newest transport of the open view."""

    def __init__(self, context: WorkerContext) -> None:
        self._context, self._cache = context, context.store
        self._stages = TransportStages(context)
        self._layers: dict[str, LayerData] = {}
        self._indirect: IndirectTasks | None = None
        self._contracted: dict[str, LayerState] = {}
        self._selected: dict[str, str] = {}
        self._precision: Precision = "half"
        self._current: dict[str, LayerData] = {}
        self._sent: set[str] = set()
        self._maps: MapTasks | None = None
        self._fits: CurveFits | None = None
        self._relighting, self._lights = Relighting(), LightPictures()
        self._light_plans = LightBudgets(context)
        self._moves = Moves(context)

    @property
    def handlers(self) -> Handlers:
        return {
            PlanBands: plan_bands,
            SampleMaps: self._sample_maps,
            ComputeTransport: self._compute,
            ContractTransport: self._contract,
            FreezeIndirect: lambda request: self._indirect_tasks().freeze(request),
            SampleEdited: self._sample_edited,
            EstimateError: self._estimate_error,
            PrepareRelighting: self._prepare_relighting,
            FindCatcherLight: self._find_catcher_light,
            FitCurves: self._fit_curves,
        }

    def view_traced(self) -> None:
        moved, known = self._moves.view_traced(self._layers, self._indirect)
        self._layers, self._current = {}, {}
        self._indirect, self._maps, self._fits = None, None, None
        if moved is not None and known is not None:
            self._indirect_tasks().carry_over(known, moved)
        self._relighting, self._lights = Relighting(), LightPictures()
        self._light_plans = LightBudgets(self._context)
        self._selected = {}
        self._stages = TransportStages(self._context)
        self._stages.recall_visibility(self._context.open_placement)

    def plan(self, layers: Iterable[Layer]) -> tuple[tuple[Layer, dict[str, int]], ...]:
        return tuple((layer, band_counts(layer)) for layer in layers)

    # --------------------------------------------------------------------------------------------------- quick requests

    def _contract(self, request: ContractTransport) -> Steps:
        """One layer's picture, and its transport along one curve ("curve switching", [BenArtzi07, eq. 4.16]).

        While a transport is under way that is not far enough yet, the request is noted, and answered later.
        """
        if request.factor is not None:
            others = self._selected if request.beside else {}
            self._selected, self._precision = {**others, request.layer.key: request.factor}, request.precision
        self._contracted[request.layer.key] = request.layer
        data = self._current.get(request.layer.key)
        if data is not None and data.fits_curves(request.layer):
            yield from self._answers(self._hold(data), request.factor, request.precision, request.picture)

    def _fit_curves(self, request: FitCurves) -> Steps:
        if self._fits is None:
            from app.worker.curve_fits import CurveFits

            self._fits = CurveFits(self._context.open_placement)
        yield from self._fits.fit(request, self._current, self._indirect)

    def _sample_maps(self, request: SampleMaps) -> Steps:
        if any(images.strokes for _, images in request.layers):
            yield from self._context.until_compiled(PAINTING)
        if self._maps is None:
            from app.worker.map_tasks import MapTasks

            self._maps = MapTasks(self._context.open_placement)
        yield from self._maps.answers(request)

    # ---------------------------------------------------------------------------------------- when nothing else is left

    def _sample_edited(self, request: SampleEdited) -> Steps:
        sampled = yield from self._indirect_tasks().sample_edited(request)
        yield replace(sampled, transport_bytes=self._n_bytes)

    def _estimate_error(self, request: EstimateError) -> Steps:
        yield from self._context.until_compiled(ESTIMATE)
        from app.worker.error_tasks import estimate_error

        found = None if self._indirect is None else self._indirect.light
        yield from estimate_error(request, self._context, self._current, found)

    def _find_catcher_light(self, request: FindCatcherLight) -> Steps:
        quality = None
        if self._current:  # by the lights of the whole picture
            lit_by = next(iter(self._current.values())).lit_by
            quality = final_quality(lit_by.planned_settings or lit_by.settings)
        yield from find_catcher_light(request, self._context, quality)

    def _prepare_relighting(self, request: PrepareRelighting) -> Steps:
        yield from self._context.until_compiled(RELIGHTING)
        context, scene = self._context, request.scene
        placement, weights = context.open_placement, _weights_of(scene)
        # Lights first, coarsely and between surfaces by albedo: the rest takes many times as long.
        yield from self._lights.prepare(placement, scene, context.sky, self._current, is_quick=True)
        if self._indirect is not None:
            yield from self._indirect.reflect_lights(scene.visible, weights, context.sky, is_quick=True)
        yield LightsReady(self._n_bytes, self._lights.n_lights)
        yield from self._relighting.prepare(placement, scene, context.sky(scene.light), self._current)
        if self._indirect is not None:
            yield from self._indirect.prepare_relighting(scene.visible)
            yield from self._indirect.reflect_lights(scene.visible, weights, context.sky)
        yield from self._lights.prepare(placement, scene, context.sky, self._current)
        yield RelightingPrepared(self._n_bytes, self._lights.n_lights)

    # -------------------------------------------------------------------------------------------------------- transport

    def _compute(self, request: ComputeTransport) -> Steps:
        placement, scene, settings = self._context.open_placement, request.scene, request.settings
        yield from ensure_tables((work.layer for work in scene.layers), self._cache)
        self._begin(request)
        placement.set_emission(dict(scene.emission))
        sky = self._context.sky(scene.light)
        if self._indirect is not None:
            self._indirect.transport_requested(lit_key(sky, placement.scene), settings.n_bounces)
        if (image := self._context.sky_image(sky)) is not None:
            yield image
        lit_by = LightingState(scene.light, request.lit, scene.emission)
        if scene.lamps:
            yield from self._send_dragged(request)
            return
        yield from self._send_held(placement, request, lit_by)
        yield from self._kernels_ready()
        is_simple = settings.lighting != "scene"
        placement, sky = simple_lighting(placement, sky, settings.lighting)
        need = None if is_simple else self._light_plans.cached_budget(request, sky)
        if is_simple:
            yield from self._send_cached(placement, request, sky, replace(lit_by, planned_settings=settings))
        elif need is not None:
            yield from _light_plan_message(need, settings)
            yield from self._send_cached(
                placement, request, sky, replace(lit_by, planned_settings=need.limit_settings(settings))
            )
        if not is_simple:
            yield from self._send_relit(placement, request, sky, lit_by)
            yield from self._send_moved(request, sky, lit_by)
        n_bounces, bounces_reported, bounces_found = settings.n_bounces, settings.n_bounces == 1, False
        begun = time.process_time()
        is_moved = self._moves.has_first(scene.layers, lit_by)
        for quality, exact in self._stages_due(request, is_moved):
            started = time.monotonic()
            works = self._selected_first(request) if quality is not RELIT else []
            lacks_bands = exact or is_moved
            due = [work for work in works if not self._is_needless(work, lit_by, quality.name, lacks_bands)]
            if due and quality.name == FINAL.name:
                if need is None and not is_simple:
                    need = yield from self._light_plans.find_budget(request, sky)
                    yield from _light_plan_message(need, settings)
                needed = settings if need is None else need.limit_settings(settings)
                lit_by, quality = replace(lit_by, planned_settings=needed), final_quality(needed)
            if due:
                yield from self._stage(placement, due, sky, lit_by, quality)
            if not bounces_reported and quality is not DRAG:
                planned = self._indirect_tasks().plan_bounces(scene.visible, n_bounces)
                n_bounces, bounces_reported = planned.n_bounces, True
                yield planned
            # Coarsely as soon as it is compiled: until then the direct light goes first.
            is_rough = not (exact or bounces_found) and self._context.is_compiled(INDIRECT)
            if n_bounces > 1 and quality is not DRAG and (exact or is_rough):
                bounces_found = True
                yield from self._context.until_compiled(INDIRECT, "indirect light")
                tasks = self._indirect_tasks()
                yield from tasks.find(
                    scene.visible, sky, lit_key(sky, placement.scene), n_bounces, exact, settings.n_hemisphere_rays,
                    _weights_of(scene),
                )  # fmt: skip
            if quality is DRAG and self._indirect is not None and n_bounces != 1:
                yield from self._indirect.relight(scene.visible, sky, n_bounces, _weights_of(scene))
            # A cached picture waits for the first indirect light, and for nothing else.
            if due or exact or quality.name in (COARSE.name, RELIT.name) and n_bounces > 1:
                spent = time.process_time() - begun
                yield StageDone(quality.name, exact, time.monotonic() - started, self._n_bytes, spent)
            if exact and quality is not DRAG:
                self._moves.forget_before()
            yield from self._context.new_warnings()
        yield from self._lights.compare(scene, self._current)

    def _stages_due(self, request: ComputeTransport, is_moved: bool) -> list[tuple[Quality, bool]]:
        """The stages of a request. is_moved: whether the picture is that of the view before, in which objects were
        moved: it is at every pixel, so that the last stage follows the coarse one, which has bands."""
        stages = stages_of(request)[-1 if self._context.fills else 0 :]
        if not is_moved or request.is_drag:
            return stages
        return [(RELIT, False), *(each for each in stages if each[1] or each[0].name == COARSE.name)]

    def _begin(self, request: ComputeTransport) -> None:
        """Note what is requested; of layers that are no longer there nothing is held."""
        self._contracted, self._current, self._sent = {}, {}, set()
        self._layers = {work.key: self._layers[work.key] for work in request.scene.layers if work.key in self._layers}
        if request.selected and request.factor:
            self._selected = dict.fromkeys((request.selected, *request.followers), request.factor)
        self._precision = request.precision

    @property
    def _n_bytes(self) -> int:
        """Memory of all that was computed."""
        n_bytes = sum(data.store.n_bytes for data in self._layers.values()) + sum(self._stages.dropped_bytes.values())
        n_bytes += self._relighting.n_bytes + self._lights.n_bytes
        return n_bytes + (0 if self._indirect is None else self._indirect.n_bytes)

    def _indirect_tasks(self) -> IndirectTasks:
        """The indirect light's tasks, made and their kernels loaded when a scene first needs more than direct light."""
        if self._indirect is None:
            from app.worker.indirect_tasks import IndirectTasks

            context = self._context
            self._indirect = IndirectTasks(
                context.open_placement, self._cache, context.view_key, context.view_id, context.executor.find_indirect
            )
        return self._indirect

    def _selected_first(self, request: ComputeTransport) -> list[LayerState]:
        return sorted(request.scene.layers, key=lambda work: self._selected_factor(work.key) is None)

    def _send_held(self, placement: Placement, request: ComputeTransport, lit_by: LightingState) -> Steps:
        """Answer with what is held already, as far as the window does not have it."""
        for work in self._selected_first(request):
            data = self._layers.get(work.key)
            if data is not None and data.is_picture_of(work, lit_by):
                data, factor = self._hold(data.taken_over_by(work)), self._selected_factor(work.key)
                is_reported = work.key in request.held_layers
                if not is_reported or factor is not None and work.key not in request.held_curves:
                    yield from self._answers(data, factor, self._precision, picture=not is_reported)

    def _send_cached(
        self, placement: Placement, request: ComputeTransport, sky: SkyState, lit_by: LightingState
    ) -> Steps:
        """Answer with what is cached of the last stage: a view that was computed before is there at once."""
        quality, _ = stages_of(request)[-1]
        if quality.name == FINAL.name and lit_by.planned_settings is not None:
            quality = final_quality(lit_by.planned_settings)
        if quality.name != FINAL.name or self._context.fills:
            return
        groups = light_groups(placement, sky)
        keys = [self._stages.light_key(group.sky, group.placement, quality) for group in groups]
        units = {key: self._stages.cached_unit(key) for key in keys}
        for work in self._selected_first(request):
            i_object = placement.scene.object_index(work.object)
            light_key = next(key for group, key in zip(groups, keys, strict=True) if group.objects[i_object])
            unit = units[light_key]
            if unit is None or self._is_needless(work, lit_by, quality.name, True):
                continue
            kept = self._stages.cached_store(light_key, work, len(rows_of(placement, work, quality)))
            if kept is not None:
                data = self._hold(LayerData(work, lit_by, quality.name, kept, unit))
                yield from self._answers(data, self._selected_factor(work.key), self._precision)

    def _send_relit(
        self, placement: Placement, request: ComputeTransport, sky: SkyState, lit_by: LightingState
    ) -> Steps:
        """Answer with mixed or relit pictures, where nothing better is there."""
        lights, weights = None, _weights_of(request.scene)
        for work in self._selected_first(request):
            if self._is_needless(work, lit_by, RELIT.name, False):
                continue
            if self._lights.takes(work, weights):
                mixed = FixedPicture(self._lights.picture(work, weights))
                yield from self._answers(self._hold(LayerData(work, lit_by, RELIT.name, mixed, 1.0)), None, "half")
                continue
            if not self._relighting.takes(work, lit_by):
                continue
            if lights is None:
                lights = yield from self._relighting.lights_of(placement, sky)
            picture = FixedPicture(self._relighting.picture(placement, work, lit_by, lights))
            yield from self._answers(self._hold(LayerData(work, lit_by, RELIT.name, picture, 1.0)), None, "half")

    def _send_dragged(self, request: ComputeTransport) -> Steps:
        """Answer with the pictures at rest, in which lamps are elsewhere: direct light first, then that between
        surfaces."""
        started, scene, n_bounces = time.monotonic(), request.scene, request.settings.n_bounces
        there = self._moves.scene_with(scene)
        works = self._selected_first(request)
        for data in self._moves.dragged_pictures(works, scene, there, self._layers, self._lights):
            yield from (None,) if data is None else data.responses(None, "half")
        yield StageDone(DRAG.name, True, time.monotonic() - started, self._n_bytes)
        if self._indirect is not None and self._moves.dragged is not None and n_bounces != 1:
            yield from self._indirect.relight_moved(scene.visible, there, self._moves.dragged.objects, n_bounces)

    def _send_moved(self, request: ComputeTransport, sky: SkyState, lit_by: LightingState) -> Steps:
        """Answer with pictures of the view before, where objects were moved since, as far as nothing is there."""
        if request.is_drag or not self._context.is_compiled(RELIGHTING):
            return
        works = [work for work in self._selected_first(request) if work.key not in self._layers]
        for data in self._moves.first_pictures(works, lit_by, sky):
            yield from (None,) if data is None else self._answers(self._hold(data), None, "half")

    def _is_needless(self, work: LayerState, lit_by: LightingState, stage: str, is_last: bool) -> bool:
        data = self._layers.get(work.key)
        if stage == DRAG.name and data is not None and data.stage == RELIT.name:
            is_last = False  # no bands are needed while the light is being dragged
        return data is not None and data.is_picture_of(work, lit_by) and data.makes_needless(work, stage, is_last)

    def _kernels_ready(self) -> Steps:
        """Wait for the kernels; the first time on a machine with a message."""
        kernels = self._context.kernels
        if kernels is None:
            return
        clock = StageClock(COMPILING)
        while not kernels.wait(KERNEL_SECONDS):
            yield clock.progress(kernels.fraction, FIRST_TIME) if kernels.first_time else None

    def _stage(
        self, placement: Placement, works: list[LayerState], sky: SkyState, lit_by: LightingState, quality: Quality
    ) -> Steps:
        clock = StageClock(quality.name)
        sky = _downsampled(sky) if quality is DRAG else sky
        groups, is_final = light_groups(placement, sky), quality.name == FINAL.name
        keys = [self._stages.light_key(each.sky, each.placement, quality) if is_final else "" for each in groups]
        self._stages.keep_lights(keys)
        i_object = {work.key: placement.scene.object_index(work.object) for work in works}
        total = sum(len(rows_of(placement, work, quality)) for work in works) or 1
        done = 0
        # The group of the selected layer first.
        first = i_object[works[0].key]
        for group, key in sorted(zip(groups, keys, strict=True), key=lambda pair: not pair[0].objects[first]):
            own = [work for work in works if group.objects[i_object[work.key]]]
            if not own:
                continue
            light = yield from self._stages.final_light(group, quality, key, clock)
            for work in own:
                rows = rows_of(placement, work, quality)
                store = yield from self._stages.project(placement, rows, work, light, key, clock, done, total)
                done += len(rows)
                data = LayerData(work, lit_by, quality.name, store, light.lighting.unit)
                if self._context.fills:
                    self._current[work.key] = data
                    continue
                data = self._hold(data)
                yield from self._answers(data, self._selected_factor(work.key), self._precision)

    def _selected_factor(self, key: str) -> str | None:
        """The curve of a layer that was selected last."""
        return self._selected.get(key)

    def _hold(self, data: LayerData) -> LayerData:
        """Store it as what the newest request is answered from, with the coefficients requested last, and return it.

        A contraction may have been requested since.
        """
        given = self._contracted.get(data.work.key)
        if given is not None and data.fits_curves(given):
            data = data.with_curves(given)
        self._layers[data.work.key] = self._current[data.work.key] = data
        return data

    def _answers(
        self, data: LayerData, factor: str | None, precision: Precision, picture: bool = True
    ) -> Iterator[Response]:
        """The responses for a layer; before the first one of a coarse stage, the footprint of its samples."""
        stride = STAGES[data.stage].stride
        if stride > 1 and data.stage not in self._sent:
            self._sent.add(data.stage)
            yield StageFootprint(*self._context.open_placement.footprint(stride), data.stage, id=self._context.view_id)
        # The selected curve may belong to the model that the layer had before.
        yield from data.responses(factor if factor in data.work.factors else None, precision, picture)


def _weights_of(scene: SceneState) -> Weights:
    """The weights of a scene's lights."""
    return light_weights(scene.light, scene.emission)


def _downsampled(sky: SkyState) -> SkyState:
    """A sky of few pixels, for a light that is dragged."""
    links = tuple(link._replace(sky=_downsampled(link.sky)) for link in sky.links)
    environment = None if sky.environment is None else downsample(sky.environment, DRAG_ENVIRONMENT_HEIGHT)
    return replace(sky, environment=environment, links=links)


def _light_plan_message(need: LightBudget, most: RenderSettings) -> Iterator[LightPlanned]:
    if need.errors:
        yield LightPlanned(need.lights, need.patches, tuple(need.reasons(most).items()))
