"""Pictures of each light alone, made when there is nothing else to do, so that a mix of lights is a weighted sum.

With fixed materials a layer's radiance is linear in the light, B = Σ_l w_l B_l [BenArtzi07, eq. 7.4]: B_l is its final
transport under light l alone, white and of strength 1, contracted with its curves at once. Single lights are divided at
least as finely as all of them together, so B_l is no less exact than the picture P at rest. A mix shows

    Σ_l w_l B_l + s (P − Σ_l w⁰_l B_l),    s = min(1, min_l w_l / w⁰_l) over the lights that were on:

it begins without a jump, and of a light that is switched off nothing is left. Rejected: the transport of all lights by
bands, which would be as many times as large as there are lights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.document.light_state import RGB, LightState
from app.document.scene_state import LayerState, SceneState
from app.document.single_lights import SingleLight, Weights, light_weights
from app.messages.worker_messages import Response
from app.system.memory import available_memory
from app.worker.layer_data import LayerData, both_curves, join_tile_contents, reflects_alike, shape_of, tile_content
from app.worker.weighted_sum import ChangingSum, weighted_sum
from engine.core.generators import map_steps
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState, final_quality
from engine.precompute.direct.projection import project_layer

Float32Array = NDArray[np.float32]
Steps = Iterator[Response | None]
# Of all pictures of single lights, and of the free memory.
MOST_BYTES = 512e6
SHARE_OF_MEMORY = 0.25


@dataclass(frozen=True, eq=False)
class _LayerPictures:
    """A layer's radiance (p, 3) under each light alone, None where that is black, for its material then; rest: what its
    exact picture has besides, under lights of the weights `at`, None before that is known."""

    work: LayerState
    alone: dict[SingleLight, Float32Array | None]
    rest: Float32Array | None = None
    at: Weights | None = None

    def is_of(self, work: LayerState) -> bool:
        """Whether the work reflects the same."""
        return reflects_alike(self.work, work)

    @cached_property
    def mix(self) -> ChangingSum[SingleLight | None]:
        """The weighted sum of the pictures and, as None, of the rest."""
        assert self.rest is not None
        return ChangingSum(lambda light: self.rest if light is None else self.alone[light], len(self.rest))

    @property
    def n_bytes(self) -> int:
        """Memory of the pictures; what the mix stores is as large as the rest."""
        pictures = (each for each in (*self.alone.values(), self.rest, self.rest) if each is not None)
        return sum(each.nbytes for each in pictures)


class LightPictures:
    """The pictures of single lights of the open view."""

    def __init__(self) -> None:
        self._ready: dict[str, _LayerPictures] = {}

    @property
    def n_lights(self) -> int:
        """The number of lights that may be mixed: those that light any layer, 0 where a layer is not ready."""
        if not all(each.alone for each in self._ready.values()):
            return 0
        found = (light for each in self._ready.values() for light, picture in each.alone.items() if picture is not None)
        return len(set(found))

    @property
    def n_bytes(self) -> int:
        """Memory of the pictures."""
        return sum(each.n_bytes for each in self._ready.values())

    # -------------------------------------------------------------------------------------------------------- preparing

    def prepare(
        self, placement: Placement, scene: SceneState, sky_of: Callable[[LightState], SkyState],
        current: Mapping[str, LayerData],
    ) -> Steps:  # fmt: skip
        """Make the pictures that the layers lack, light by light, and compare their sum with the final pictures. None
        are made where they would take too much memory."""
        pictures = {key: data for key, data in current.items() if data.stage == FINAL.name}
        works = [work for work in scene.layers if work.key in pictures]
        lights = list(light_weights(scene.light, scene.emission))
        n_points = sum(pictures[work.key].store.n_points for work in works)
        if 12 * n_points * (len(lights) + 2) > min(MOST_BYTES, SHARE_OF_MEMORY * available_memory() + self.n_bytes):
            self._ready = {}
            return
        self._ready = {work.key: self._kept(work, lights) for work in works}
        skies = {light: sky_of(light.light) for light in lights}
        shining = [light for light in lights if light.emitter or not _is_dark(skies[light])]
        for light in lights:
            for work in (work for work in works if light not in self._ready[work.key].alone):
                if light not in shining:
                    self._set_black(light, [work])
                elif len(shining) == 1:
                    self._add_only_light(light, work, pictures[work.key])
            due = [work for work in works if light not in self._ready[work.key].alone]
            if due:
                yield from self._add_light(placement, light, skies[light], due, pictures[due[0].key])
        for work in works:
            data, ready = pictures[work.key], self._ready[work.key]
            weights = light_weights(data.lit_by.light, data.lit_by.emission)
            if ready.at != weights and weights.keys() <= ready.alone.keys():
                data = data.with_curves(work) if data.fits_curves(work) else data
                rest = data.radiance - weighted_sum(ready.alone, weights, data.store.n_points)
                self._ready[work.key] = replace(ready, rest=rest, at=weights)
                yield None

    def _kept(self, work: LayerState, lights: list[SingleLight]) -> _LayerPictures:
        """What is known of a layer under these lights."""
        known = self._ready.get(work.key)
        if known is None or not known.is_of(work):
            return _LayerPictures(work, {})
        alone = {light: known.alone[light] for light in lights if light in known.alone}
        same = known.at is not None and known.at.keys() <= alone.keys()
        return replace(known, alone=alone) if same else _LayerPictures(work, alone)

    def _add_only_light(self, light: SingleLight, work: LayerState, data: LayerData) -> None:
        """Add the picture under a scene's only light, which its final picture is a multiple of; nothing where that
        lacks a colour."""
        weight = light_weights(data.lit_by.light, data.lit_by.emission).get(light, ())
        if weight and all(weight):
            data = data.with_curves(work) if data.fits_curves(work) else data
            self._ready[work.key].alone[light] = np.asarray(data.radiance / np.array(weight), np.float32)

    def _add_light(
        self, placement: Placement, light: SingleLight, sky: SkyState, due: list[LayerState], like: LayerData
    ) -> Steps:
        """Add the pictures under one light, with the settings of a layer's final picture."""
        scene = placement.scene
        whole = placement.with_emission(light.emission(scene.object_names))
        settings = like.lit_by.planned_settings or like.lit_by.settings
        i_object = {work.key: scene.object_index(work.object) for work in due}
        for _, objects, alone, reaching in light_groups(whole, sky):
            own = [work for work in due if objects[i_object[work.key]]]
            lit_by = SkyState(None) if _is_dark(reaching) else reaching
            if not own or lit_by.environment is None and not alone.scene.emission.any():
                self._set_black(light, own)
                continue
            visible = yield from map_steps(alone.light(lit_by, final_quality(settings)), lambda fraction: None)
            for work in own:
                fixed, rows = replace(work, fixed=True), alone.rows_of(i_object[work.key])
                parts = {}
                for tile in project_layer(alone.hits, rows, visible, shape_of(work)):
                    parts[tile.begin] = tile_content(fixed, tile)
                    yield None
                picture = join_tile_contents(fixed, parts).radiance(*both_curves(fixed)) * visible.lighting.unit
                self._ready[work.key].alone[light] = np.ascontiguousarray(picture, np.float32)

    def _set_black(self, light: SingleLight, works: list[LayerState]) -> None:
        """Note that a light does not reach these layers."""
        for work in works:
            self._ready[work.key].alone[light] = None

    # ----------------------------------------------------------------------------------------------------------- mixing

    def takes(self, work: LayerState, weights: Weights) -> bool:
        """Whether a layer can be shown in this mix: its material is that of its pictures, and all lights are known."""
        ready = self._ready.get(work.key)
        if ready is None or ready.rest is None or not ready.is_of(work):
            return False
        return all(light in ready.alone for light, weight in weights.items() if any(weight))

    def picture(self, work: LayerState, weights: Weights) -> Float32Array:
        """The radiance (p, 3) of a layer in a mix, without f_q and f_o."""
        ready = self._ready[work.key]
        assert ready.rest is not None and ready.at is not None
        terms: list[tuple[SingleLight | None, RGB]] = [*weights.items(), (None, _remaining(weights, ready.at))]
        total = ready.mix.at(dict(terms))
        return np.maximum(total, np.float32(0.0), out=total)


def _is_dark(sky: SkyState) -> bool:
    return sky.environment is None or not sky.scale or not sky.environment.radiance.any()


def _remaining(now: Weights, then: Weights) -> RGB:
    """s, see above."""
    black: RGB = (0.0, 0.0, 0.0)
    ratios = [
        np.divide(now.get(light, black), weight, out=np.ones(3), where=np.array(weight) > 0.0)
        for light, weight in then.items()
    ]
    red, green, blue = np.min([np.ones(3), *ratios], axis=0).tolist()
    return red, green, blue
