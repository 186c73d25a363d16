"""Lights a scene anew at once: rows over a lighting basis for each layer, made when there is nothing else to do, and
shadows of the sky's peaks, traced at each angle.

Rows hold for the layers' materials as they are: when one changes, that layer's are made again, and until then a dragged
light gets the quick picture. The basis was chosen for the sky at the time; another sky makes them anew in the end.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import Response
from app.modes.placement.accepted_light import source
from app.modes.placement.desired_state import brightening_factors
from app.system.memory import available_memory
from app.worker.layer_data import LayerData, LightingState, reflects_alike
from engine.core.generators import map_steps
from engine.light.environment import Environment, constant_environment
from engine.precompute.direct._relight_kernels import Reflection
from engine.precompute.direct.linking import reaching_skies
from engine.precompute.direct.moves import lattice_stride
from engine.precompute.direct.peaks import PeakLight, split_peaks, trace_peaks
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.precompute.direct.relight import (
    MOST_ROW_BYTES,
    LightRows,
    RowMaker,
    is_same_sky,
    joined_rows,
    layer_reflection,
    light_coefficients,
    sky_likeness,
    turning_effects,
)

Steps = Iterator[Response | None]
# Of the lattice of pixels at which shadows of peaks are traced: every second one of 512 x 512, all of a small picture.
MOST_POINTS = 80_000
# Of the free memory.
SHARE_OF_MEMORY = 0.25


@dataclass(frozen=True, eq=False)
class _DistantLight:
    """A sky as layers are relit by it: coefficients of all but its peaks in the rows' basis, its peaks, and how far
    (3,) it is still like the sky that the exact pictures were made under, see `sky_likeness`."""

    coefficients: NDArray[np.float32]
    peaks: PeakLight
    likeness: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _LayerRows:
    """A layer's rows, for its material then, and what its exact picture (p, 3) adds to them under a light. i_object:
    the object that it covers; points: the rows of `hits` of that."""

    work: LayerState
    i_object: int
    maker: RowMaker
    points: NDArray[np.integer]
    rows: LightRows
    reflection: Reflection
    rest: NDArray[np.float32] | None = None
    lit_by: LightingState | None = None

    def is_of(self, work: LayerState) -> bool:
        """Whether the work reflects the same."""
        return reflects_alike(self.work, work)

    def lit(self, light: _DistantLight, placement: Placement) -> NDArray[np.float32]:
        """The layer's radiance (p, 3), without f_q and f_o, under a sky alone. Highlights and bumps are narrower than
        the lattice that shadows were traced at; other light of a peak is not."""
        stride, is_bumpy = light.peaks.stride, self.i_object in placement.scene.bump_normals.objects
        if stride > 1 and self.work.layer.model.is_diffuse and not is_bumpy:
            points = placement.rows_of(self.i_object, stride)
            samples = light.peaks.reflected(self.maker.hits, self.reflection, points)
            peaks = placement.interpolated(samples, self.i_object, stride)
        else:
            peaks = light.peaks.reflected(self.maker.hits, self.reflection, self.points)
        return np.asarray(self.rows.lit(light.coefficients) + peaks, np.float32)


class Relighting:
    """The rows of the open picture."""

    def __init__(self) -> None:
        self._ready: dict[str, _LayerRows] = {}
        self._maker: RowMaker | None = None
        self._made_under: tuple[Environment, float] | None = None
        self._compared_under: SkyState | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of the rows and what is stored with them."""
        rests = (0 if each.rest is None else each.rest.nbytes for each in self._ready.values())
        return sum(each.rows.n_bytes for each in self._ready.values()) + sum(rests)

    # -------------------------------------------------------------------------------------------------------- preparing

    def prepare(
        self, placement: Placement, scene: SceneState, sky: SkyState, current: Mapping[str, LayerData]
    ) -> Steps:
        """Make the rows that the layers lack, and compare them with their final pictures."""
        pictures = {key: data for key, data in current.items() if data.stage == FINAL.name}
        works = [work for work in scene.layers if work.key in pictures]
        if sky.environment is None or not placement.sphere.done.all() or not works:
            return
        i_objects = {work.key: placement.scene.object_index(work.object) for work in works}
        rows_of = {key: placement.rows_of(i_object) for key, i_object in i_objects.items()}
        maker = yield from self._maker_for(placement, sky.environment, sky.scale, works, rows_of)
        self._ready = {work.key: self._ready[work.key] for work in works if work.key in self._ready}
        self._compared_under = sky
        lights = yield from self.lights_of(placement, sky)
        for work in works:
            ready = self._ready.get(work.key)
            if ready is None or ready.maker is not maker or not ready.is_of(work):
                self._ready.pop(work.key, None)  # memory for one at a time
                tiles = []
                points, reflection = rows_of[work.key], layer_reflection(work.layer)
                for tile in maker.rows(work.layer, points):
                    tiles.append(tile)
                    yield None
                ready = _LayerRows(work, i_objects[work.key], maker, points, joined_rows(tiles), reflection)
            data = pictures[work.key]
            data = data.with_curves(work) if data.fits_curves(work) else data
            is_same = data.lit_by.light == scene.light
            rest = data.radiance - ready.lit(lights[ready.i_object], placement) if is_same else None
            self._ready[work.key] = replace(ready, rest=rest, lit_by=data.lit_by)
            yield None

    def _maker_for(
        self, placement: Placement, environment: Environment, scale: float, works: list[LayerState],
        rows_of: Mapping[str, NDArray[np.integer]],
    ) -> Generator[None, None, RowMaker]:  # fmt: skip
        """The row maker for this sky."""
        if self._maker is None or self._made_under != (environment, scale):
            effects = yield from turning_effects(split_peaks(environment)[1], scale)
            all_of_it = RowMaker(placement.hits, placement.sphere, effects)
            room = min(MOST_ROW_BYTES, SHARE_OF_MEMORY * available_memory())
            self._maker = all_of_it.rows_within([(work.layer, rows_of[work.key]) for work in works], room)
            self._made_under = environment, scale
        return self._maker

    # ------------------------------------------------------------------------------------------------------- relighting

    def takes(self, work: LayerState, lit_by: LightingState) -> bool:
        """Whether a layer can be relit: its material is that of its rows, lights reach the objects that they reached,
        and emitters are as they were, or all of them brighter by one factor."""
        ready = self._ready.get(work.key)
        if ready is None or not ready.is_of(work) or ready.rest is None or ready.lit_by is None:
            return False
        is_linked_alike = lit_by.light.exclusions == ready.lit_by.light.exclusions
        return is_linked_alike and _emitter_factors(lit_by, ready.lit_by) is not None

    def lights_of(self, placement: Placement, sky: SkyState) -> Generator[None, None, list[_DistantLight]]:
        """What reaches each object of a sky, to relight its layers by. A generator of steps."""
        n_objects = len(placement.scene.object_names)
        found = list[tuple[SkyState, SkyState, _DistantLight]]()
        by_object = list[_DistantLight]()
        before = reaching_skies(self._compared_under or sky, n_objects)
        for reaching, compared in zip(reaching_skies(sky, n_objects), before, strict=True):
            pairs = (light for one, two, light in found if is_same_sky(one, reaching) and is_same_sky(two, compared))
            light = next(pairs, None)
            if light is None:
                light = yield from self._light_of(placement, reaching, compared)
                found.append((reaching, compared, light))
            by_object.append(light)
        return by_object

    def _light_of(
        self, placement: Placement, sky: SkyState, compared: SkyState
    ) -> Generator[None, None, _DistantLight]:
        """A sky that reaches all objects, beside the one that the exact pictures were made under."""
        peaks, rest = split_peaks(sky.environment or constant_environment(0.0))
        stride = lattice_stride(len(placement.hits.pixel), MOST_POINTS)
        tracing = trace_peaks(placement, peaks, sky.rotation, sky.scale, stride)
        peak_light = yield from map_steps(tracing, lambda fraction: None)
        coefficients = light_coefficients(rest, sky.rotation, sky.scale)
        return _DistantLight(coefficients, peak_light, sky_likeness(sky, compared))

    def picture(
        self, placement: Placement, work: LayerState, lit_by: LightingState, lights: Sequence[_DistantLight]
    ) -> NDArray[np.float32]:
        """The radiance (p, 3) of a relit layer, under a sky from `lights_of`.

        It adds to the sky's radiance what the exact picture had more under the light before: of emitters, in proportion
        to their radiance; without emitters what is finer than the basis, as far as the sky is still like that one, for
        under another sky it is the ghost of a sun that has moved on.
        """
        ready = self._ready[work.key]
        light = lights[ready.i_object]
        radiance = ready.lit(light, placement)
        assert ready.rest is not None and ready.lit_by is not None
        if lit_by.emission or source(lit_by.light) == source(ready.lit_by.light):
            factors = _emitter_factors(lit_by, ready.lit_by) if lit_by.emission else light.likeness
            assert factors is not None
            radiance += ready.rest * factors.astype(np.float32)
        return np.maximum(radiance, 0.0)


def _emitter_factors(now: LightingState, then: LightingState) -> NDArray[np.float64] | None:
    """The factors (3,) by which all emitters are brighter; None where they are not the same for all."""
    return np.ones(3) if now.emission == then.emission else brightening_factors(now.emission, then.emission)
