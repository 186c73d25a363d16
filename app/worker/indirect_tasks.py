"""The worker's part of indirect light: computed once for scene and camera, lit anew, frozen for what is being edited.

It is computed coarsely after the first picture, and finely after the last stage of the direct light, so that the user
waits for neither. Where the rays of a fine one are still there, another light lights their records anew, at once; the
glossy second bounce then depends on albedo alone until the end. Fine light is cached on disk, where a scene that is
opened again, or a worker that follows one that died, finds it with the first picture; while it is being computed its
finished parts are cached, from which either continues.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from app.document.light_state import LightState
from app.document.scene_state import LayerState
from app.document.single_lights import BLACK, SingleLight, Weights
from app.messages.worker_messages import Progress, Response
from app.modes.placement.placement_messages import (
    BouncesPlanned,
    EditedSampled,
    FreezeIndirect,
    FreezingProgress,
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
    SampleEdited,
    SamplingProgress,
)
from app.worker.cache import ArrayCache, content_key
from app.worker.executor import IndirectSteps
from app.worker.found_light import MOST_PARTS, Checkpoints, FoundLight, layer_visibility, materials_of, relit_message
from app.worker.frozen_rows import FrozenRows, freezes_alike, frozen_rows
from app.worker.moved_pictures import MovedPictures
from engine.core.generators import map_steps
from engine.material.layer import Layer, object_of
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.albedo import albedo_bands
from engine.precompute.indirect.checkpoints import NAMES, arrays_of
from engine.precompute.indirect.edited_sampling import EditedSampling
from engine.precompute.indirect.frozen_light import FrozenLight, SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import NO_OBJECT
from engine.precompute.indirect.moved_light import CARRIED, moved_light
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.relighting import IndirectRelighting, SceneLight, SourceLighting
from engine.precompute.indirect.sampling_settings import FINE, ROUGH
from engine.precompute.indirect.solver import Solver, relit
from engine.render.bounce_plan import planned_bounces
from engine.render.still import direct_mean
from engine.scene.scene_loader import Scene

Steps = Iterator[Response | None]
RemoteSolve = Callable[[Sequence[LayerState], str, int, int], IndirectSteps | None]
# Raised when anything changes the numbers in what is cached on disk.
STORED_VERSION = 10
# The share of the work until indirect light is found; then surfaces reflect it, and its noise is estimated.
FOUND_AT = 0.9
# A freezing that takes longer than this tells how far it is.
QUIET_SECONDS = 0.5


class IndirectTasks:
    """Indirect light of the open scene, and the freezing that was requested last."""

    def __init__(
        self, placement: Placement, store: ArrayCache | None = None, scene_key: str = "", scene_id: int = 0,
        elsewhere: RemoteSolve | None = None,
    ) -> None:  # fmt: skip
        """store: where fine light is cached, under keys of the scene, None for nowhere; scene_id: the number of the
        request that opened it; elsewhere: what may compute fine light for this process, see `Executor`."""
        self._placement, self._store, self._scene_key, self._elsewhere = placement, store, scene_key, elsewhere
        self._found: FoundLight | None = None
        self._freeze_request: FreezeIndirect | None = None
        self._scene_id = scene_id
        self._requested: tuple[str, int] | None = None
        self._weights: dict[str, Weights] = {}  # of the lights that were found, by their keys
        self._sent = 0
        self._noise_found: tuple[int, FreezeIndirect, tuple[float, float]] | None = None
        self._representations: GatherPolynomial | None = None
        self._frozen_light: FoundLight | None = None
        self._frozen_bands: int | None = None  # of the second bounce
        self._answered: tuple[int, str | None, int | None] | None = None  # light, and what was edited of it
        self._frozen_rows: FrozenRows | None = None
        self._last_frozen: tuple[int, FreezeIndirect, FrozenLight] | None = None  # the light's number, and for what
        self._relighting: IndirectRelighting | None = None
        self._relit_for: tuple[int, int | None, tuple[LayerState, ...]] | None = None
        self._numbers = itertools.count(time.time_ns())  # none that a worker before this one used

    @property
    def n_bytes(self) -> int:
        """Memory of the light that was found, of stored freezings and the last one, and of what is prepared for other
        light."""
        kept = 0 if self._representations is None else self._representations.n_bytes
        kept += 0 if self._relighting is None else self._relighting.n_bytes
        kept += 0 if self._last_frozen is None else self._last_frozen[2].n_bytes
        return kept + (0 if self._found is None else self._found.light.n_bytes)

    @property
    def light(self) -> IndirectLight | None:
        """The light that was found for the transport requested last; None while there is none."""
        return self._found.light if self._found is not None and self._is_requested_light(self._found) else None

    def carry_over(self, known: IndirectTasks, moved: MovedPictures) -> None:
        """Begin with the light of the view before, where objects were moved since, until it is found anew. Where lights
        are among these, its records are lit anew."""
        found = known._found
        light = None if found is None else moved_light(found.light, moved.before.scene, self._placement, moved.same)
        if found is None or light is None:
            return
        settings = found.settings if found.settings is ROUGH else CARRIED
        lit_by = "" if moved.moves_emitters else found.lit_by
        self._found = replace(found, light=light, settings=settings, lit_by=lit_by, number=next(self._numbers))
        self._representations, last = known._representations, known._last_frozen
        if last is not None and last[0] == found.number:  # what gather points send moves with them
            self._last_frozen = (self._found.number, *last[1:])

    def transport_requested(self, lit_by: str, n_bounces: int) -> None:
        """Note that other transport was requested, under the light of that key: its freezing comes after it. No
        bounces: as many as will be planned."""
        self._freeze_request, self._requested, self._sent = None, (lit_by, n_bounces), 0

    def plan_bounces(self, layers: Sequence[LayerState], n_bounces: int = 0) -> BouncesPlanned:
        """How many bounces the scene requires with these layers; or how much of the light `n_bounces` leave out."""
        indexed = [(self._object(each), each.layer) for each in layers]
        plan = planned_bounces(self._placement, indexed, n_bounces or None)
        return BouncesPlanned(plan.n_bounces, plan.reason, plan.warning)

    def find(
        self, layers: Sequence[LayerState], sky: SkyState, lit_by: str, n_bounces: int, is_last: bool, n_rays: int = 0,
        weights: Weights | None = None,
    ) -> Steps:  # fmt: skip
        """Compute what a stage of the direct light calls for: `is_last` all light, else what is quick.

        lit_by: a key of the light; n_rays: hemisphere samples of fine light, 0 for as many as are needed; weights: of
        the lights in it, None where it is not to be mixed.
        """
        held = {each.lit_by for each in (self._found, self._frozen_light) if each is not None}
        self._weights = {key: each for key, each in self._weights.items() if key in held} | {lit_by: weights or {}}
        fine = FINE.with_rays(n_rays)
        self._requested = lit_by, n_bounces
        models = tuple((each.key, each.model) for each in layers)
        found = self._found
        same_rays = found is not None and found.models == models and found.depth >= n_bounces
        requested_so = found is not None and (found.settings, found.n_rays) == (fine, n_rays)
        finest = found is not None and requested_so and found.light.points.glossy
        if found is not None and same_rays and (finest or not is_last):
            if (found.lit_by, found.light.n_bounces) == (lit_by, n_bounces):
                yield self._found_message(found)
                return
            steps = relit(found.light, self._placement, sky, found.settings, n_bounces)
            light = yield from _as_progress(map_steps(steps, lambda share: (share, "light on surfaces")))
            yield from self._cache_light(replace(found, light=light, lit=self._scene_light(sky), lit_by=lit_by))
        else:
            yield from self._find_anew(layers, sky, lit_by, n_bounces, is_last, n_rays)

    def _find_anew(
        self, layers: Sequence[LayerState], sky: SkyState, lit_by: str, n_bounces: int, is_last: bool, n_rays: int
    ) -> Steps:
        """The same, without the rays of what was found before."""
        fine, models = FINE.with_rays(n_rays), tuple((each.key, each.model) for each in layers)
        by_object: dict[int, list[Layer]] = {}
        for each in layers:
            by_object.setdefault(self._object(each), []).append(each.layer)
        of_object = {i_object: [layer.model.name for layer in those] for i_object, those in by_object.items()}
        solver = partial(Solver, self._placement, of_object, sky, n_bounces)
        # The curves that decided where light is finest are not part of the key: within a session they do not count
        # either.
        key = content_key(
            "indirect", STORED_VERSION, NAMES, self._scene_key, models, lit_by, n_bounces, repr(fine), n_rays
        )
        # Light that takes the place of other fine light was changed by an edit.
        is_edited = self._found is not None and self._found.settings not in (ROUGH, CARRIED)
        as_requested = partial(
            FoundLight, lit=self._scene_light(sky), settings=fine, n_rays=n_rays, models=models, lit_by=lit_by,
            depth=n_bounces, sampled_for=None if is_edited else materials_of(layers),
        )  # fmt: skip
        kept = None if self._store is None else self._store.get(key, lambda arrays: solver(fine).restored(arrays))
        if kept is not None:
            yield from self._cache_light(as_requested(kept))
            return
        reflecting = [self._reflecting(each) for each in layers]
        if not is_last:
            light = yield from _as_progress(solver(ROUGH).solve(reflecting))
            yield from self._cache_light(replace(as_requested(light), settings=ROUGH))
            return
        finding = self._elsewhere(layers, lit_by, n_bounces, n_rays) if self._elsewhere else None
        if self._store is not None and finding is not None:
            arrays = yield from finding
            self._store.put(key, arrays)
            yield from self._cache_light(as_requested(solver(fine).restored(arrays)))
            return
        other_light = None
        if not n_rays:
            other_light = yield from map_steps(direct_mean(self._placement, by_object, sky), lambda step: None)
        finder = solver(fine, other_light=other_light)
        if self._store is None:
            yield from self._cache_light(as_requested((yield from _as_progress(finder.solve(reflecting)))))
            return
        with self._store.open_tiles(key, MOST_PARTS) as tiles:
            light = yield from _as_progress(finder.solve(reflecting, Checkpoints(tiles)))
            yield from self._cache_light(as_requested(light))
            if self._store.put(key, arrays_of(light)):
                tiles.finish()

    def freeze(self, request: FreezeIndirect) -> Steps:
        """The response, if there is light to freeze; it is repeated when there is finer light."""
        self._freeze_request = request
        if self._found is not None and self._is_requested_light(self._found):
            if self._found.number != self._sent:
                yield self._found_message(self._found)
            yield from self._answer(self._found, request)

    def sample_edited(self, request: SampleEdited) -> Generator[Response | None, None, EditedSampled]:
        """Trace rays where the materials of the request need them, round by round. Light with more rays replaces what
        was found once it is frozen: what is cancelled before leaves no trace. It is not cached on disk, where whoever
        opens the scene next would find what was tried in between."""
        materials, found = materials_of(request.scene.visible), self._found
        if found is None or not found.lacks_rays(materials):
            return EditedSampled()
        layers = [self._reflecting(each) for each in request.scene.visible]
        n_before = len(found.light.points.samples.rows)
        before, _ = yield from self._represented(found.light).noise(layers)
        noise, n_noisy, is_filtered = before, 0, found.filtered_for in (None, materials)
        sampling = EditedSampling(self._placement, layers, found.settings)
        for step in sampling.improved(found.light, is_filtered):
            n_noisy = step.n_noisy
            if step.is_last:
                found = replace(found, sampled_for=materials)
            if step.light is not None:
                found = replace(found, light=step.light, filtered_for=materials, number=next(self._numbers))
                noise = yield from self._exchange(found)
            yield SamplingProgress(step.fraction, id=self._scene_id)
        self._found, samples = found, found.light.points.samples
        n_sets = len(samples.rows)
        return EditedSampled(len(samples.points), n_sets, n_sets - n_before, n_noisy, before, noise)

    def _exchange(self, found: FoundLight) -> Generator[Response | None, None, float]:
        """Use light with more rays from now on, frozen as was requested last; returns its noise."""
        while True:
            desired = self._freeze_request
            assert desired is not None
            frozen: IndirectFrozen | None = None
            for answer in self._frozen(found, desired):
                if isinstance(answer, IndirectFrozen) and answer.is_last:
                    frozen = answer
                    break
                yield None
            noise = yield from self._noise(found, desired)
            if desired is self._freeze_request:  # else another was requested meanwhile
                break
        assert frozen is not None
        self._found = self._frozen_light = found
        self._answered = found.number, desired.key, desired.factor
        yield IndirectImproved(self._found_message(found), frozen, noise, id=self._scene_id)
        return noise.noise

    def relight(self, layers: Sequence[LayerState], sky: SkyState, n_bounces: int, weights: Weights) -> Steps:
        """The light that was frozen last, of these layers, under another sky and the emitters as they are: the answer
        to a light that is dragged. None where no such light was frozen. weights: of the lights in it."""
        relighting, found = self._relighting_of(layers), self._frozen_light
        if relighting is None or found is None or n_bounces not in (0, found.light.n_bounces):
            return
        resting = self._weights.get(found.lit_by)
        relit = relighting.mixed(weights, resting) if resting else None
        if relit is None:
            relit = yield from relighting.relit(self._scene_light(sky))
        yield relit_message(found, layers, relit)

    def relight_moved(
        self, layers: Sequence[LayerState], moved: Scene, lamps: NDArray[np.bool_], n_bounces: int
    ) -> Steps:
        """The same where some lamps (M,) are elsewhere, in a scene that has them there."""
        relighting, found = self._relighting_of(layers), self._frozen_light
        if relighting is None or found is None or n_bounces not in (0, found.light.n_bounces):
            return
        relit = yield from relighting.relit_moved(moved, lamps)
        yield relit_message(found, layers, relit)

    def prepare_relighting(self, layers: Sequence[LayerState]) -> Steps:
        """Do of `relight` what does not depend on the other light."""
        relighting = self._relighting_of(layers)
        if relighting is not None:
            yield from relighting.prepare()

    def reflect_lights(
        self, layers: Sequence[LayerState], lights: Iterable[SingleLight], sky_of: Callable[[LightState], SkyState],
        is_quick: bool = False,
    ) -> Steps:  # fmt: skip
        """Reflect each light that may be mixed. is_quick: by albedo alone, those that were not reflected yet."""
        relighting, scene, found = self._relighting_of(layers), self._placement.scene, self._frozen_light
        if relighting is None or found is None:
            return
        lights, resting = tuple(lights), {} if is_quick else self._weights.get(found.lit_by, {})
        relighting.forget_alone(but=lights)
        for light in lights:
            emission = scene.with_emission(light.emission(scene.object_names)).emission
            alone = SceneLight(sky_of(light.light), emission)
            yield from relighting.reflect_alone(light, alone, resting.get(light, BLACK))

    def curve_rows(self, layer: LayerState, name: str, rows: NDArray[np.integer]) -> NDArray[np.floating] | None:
        """What a curve reflects of the light that was frozen last, see `FrozenRows.of`; None where that is of another
        transport."""
        frozen = self._frozen_rows
        return None if frozen is None or not self._is_requested_light(frozen.found) else frozen.of(layer, name, rows)

    def _relighting_of(self, layers: Sequence[LayerState]) -> IndirectRelighting | None:
        """That of the light that was frozen last and these layers; None where it was not frozen for such."""
        found, models = self._frozen_light, tuple((each.key, each.model) for each in layers)
        if found is None or found.models != models:
            return None
        relit_for = found.number, self._frozen_bands, tuple(layers)
        if self._relit_for != relit_for:
            reflecting = [self._reflecting(each, self._frozen_bands) for each in layers]
            lighting = SourceLighting(found.light, self._placement.scene, found.lit.sky)
            reflect = partial(self._reflected, found.light, reflecting)
            before, self._relighting = self._relighting, IndirectRelighting(lighting, found.lit, reflecting, reflect)
            if before is not None and self._relit_for is not None and self._relit_for[1:] == relit_for[1:]:
                self._relighting.take_over(before)
            self._relit_for = relit_for
        return self._relighting

    def _reflected(
        self, found: IndirectLight, layers: list[IndirectLayer], outgoing: OutgoingRadiance
    ) -> Generator[None, None, list[np.ndarray]]:
        """What these layers reflect at the gather points of a light that was found, (p, D, 3) each."""
        return (yield from self._represented(found).reflect(layers, outgoing))

    def _represented(self, light: IndirectLight) -> GatherPolynomial:
        """A light as it is frozen; what is stored of the one before stays where the rays are the same."""
        known = self._representations
        self._representations = GatherPolynomial(light) if known is None else known.with_light(light)
        return self._representations

    def _scene_light(self, sky: SkyState) -> SceneLight:
        return SceneLight(sky, self._placement.scene.emission)

    def _is_requested_light(self, found: FoundLight) -> bool:
        """Whether it is the light of the transport requested last."""
        lit_by, n_bounces = self._requested or (found.lit_by, found.light.n_bounces)
        return found.lit_by == lit_by and n_bounces in (0, found.light.n_bounces)

    def _cache_light(self, found: FoundLight) -> Steps:
        self._represented(found.light)
        self._found = found = replace(found, number=next(self._numbers))
        yield self._found_message(found)
        if self._freeze_request is not None:
            yield Progress("indirect light", FOUND_AT, text="gathering towards the camera")
            yield from self._answer(found, self._freeze_request)

    def _found_message(self, found: FoundLight) -> IndirectFound:
        rows, weights = found.light.footprint_by_object()
        self._sent = found.number
        need = found.light.ray_budget
        rays_and_reason = (need.n_rays, need.reason) if need.noise is not None else (0, "")
        return IndirectFound(found.number, found.settings.name, rows, weights, *rays_and_reason, id=self._scene_id)

    def _answer(self, found: FoundLight, desired: FreezeIndirect) -> Steps:
        """A freezing and its noise, of which that of another view says nothing."""
        yield from self._frozen(found, desired)
        if found.settings is not CARRIED:
            yield (yield from self._noise(found, desired))

    def _frozen(self, found: FoundLight, desired: FreezeIndirect) -> Iterator[IndirectFrozen | FreezingProgress | None]:
        layers = {each.key: self._reflecting(each, desired.second_bands) for each in desired.scene.visible}
        edited = NO_OBJECT if desired.key is None else self._placement.scene.object_index(object_of(desired.key))
        seen = layer_visibility(found, desired)
        polynomial = self._represented(seen)
        keys = list(layers)
        curves = {key: factor for key, factor in desired.curves.items() if key in layers}
        selected = [SelectedCurve(keys.index(key), factor) for key, factor in curves.items()]
        albedos = {
            each.key: albedo_bands(*each.quotient, each.bands)
            for each in desired.scene.visible if self._object(each) == edited
        }  # fmt: skip

        def frozen(light: FrozenLight, is_last: bool) -> IndirectFrozen:
            unit, by_albedo = found.light.unit, not found.light.points.glossy
            return IndirectFrozen(
                found.number, desired.serial, tuple(keys), curves, light, albedos, unit, by_albedo, is_last
            )

        # What is drawn by now follows these edits already, or else does so sooner without the gloss that is sent on.
        answers, known = (found.number, desired.key, desired.factor), self._answered
        began, n_steps = time.monotonic(), polynomial.n_steps(list(layers.values()), selected)
        numbers = itertools.count(1)

        def response(early: FrozenLight | None) -> IndirectFrozen | FreezingProgress | None:
            n_done = next(numbers)
            if early is not None and known != answers:
                return frozen(early, False)
            if time.monotonic() - began < QUIET_SECONDS:
                return None
            return FreezingProgress(desired.serial, n_done / max(n_steps, n_done + 1))

        last = self._last_frozen
        is_same = last is not None and last[0] == found.number and freezes_alike(last[1], desired)
        if is_same and last is not None and found.settings is CARRIED:
            light = last[2]
        else:
            light = yield from map_steps(polynomial.freeze(list(layers.values()), edited, selected), response)
        self._last_frozen = found.number, desired, light
        answer = frozen(light, True)
        self._frozen_rows = frozen_rows(found, desired, answer)
        yield answer
        self._answered = answers
        self._frozen_light, self._frozen_bands = replace(found, light=seen), desired.second_bands

    def _noise(self, found: FoundLight, desired: FreezeIndirect) -> Generator[None, None, IndirectNoise]:
        """The noise of the light with its layers as they are: a curve that is raised may show what was hidden by the
        rest."""
        known, appearance = self._noise_found, (desired.second_bands, desired.scene.visible)
        if known is None or known[0] != found.number or (known[1].second_bands, known[1].scene.visible) != appearance:
            layers = [self._reflecting(each, desired.second_bands) for each in desired.scene.visible]
            noise = yield from self._represented(layer_visibility(found, desired)).noise(layers)
            self._noise_found = known = found.number, desired, noise
        is_sampled = desired.second_bands == 1 or not found.lacks_rays(materials_of(desired.scene.visible))
        return IndirectNoise(found.number, desired.serial, *known[2], is_sampled, id=self._scene_id)

    def _reflecting(self, state: LayerState, second: int | None = None) -> IndirectLayer:
        mean = None if state.means is None else state.mean_factor
        return indirect_layer(self._object(state), state.layer, state.bands, second, mean)

    def _object(self, state: LayerState) -> int:
        return self._placement.scene.object_index(state.object)


def _as_progress(
    steps: Generator[tuple[float, str], None, IndirectLight],
) -> Generator[Response | None, None, IndirectLight]:
    """The steps of a solver as progress, which continues where it resumes."""
    most = 0.0

    def progress(step: tuple[float, str]) -> Progress:
        nonlocal most
        most = max(most, FOUND_AT * step[0])
        return Progress("indirect light", most, text=step[1])

    return map_steps(steps, progress)
