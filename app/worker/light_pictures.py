"""Pictures of each light alone, made when there is nothing else to do, so that a mix of lights is a weighted sum.

With fixed materials a layer's radiance is linear in the light, B = Σ_l w_l B_l [BenArtzi07, eq. 7.4]: B_l is its final
transport under light l alone, white and of strength 1, contracted with its curves at once. Single lights are divided at
least as finely as all of them together, so B_l is no less exact than the picture P at rest. A mix shows

    Σ_l w_l B_l + s (P − Σ_l w⁰_l B_l),    s = min(1, min_l w_l / w⁰_l) over the lights that were on:

it begins without a jump, and of a light that is switched off nothing is left. Of each light a picture of every fourth
pixel comes first, interpolated: a mix then has the details of P, and only its change is coarse. Rejected: the transport
of all lights by bands, which would be as many times as large as there are lights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.document.light_state import RGB, LightState
from app.document.scene_state import LayerState, SceneState
from app.document.single_lights import BLACK, SingleLight, Weights, light_weights
from app.messages.worker_messages import Response
from app.system.memory import available_memory
from app.worker.layer_data import LayerData, both_curves, join_tile_contents, reflects_alike, shape_of, tile_content
from engine.core.generators import map_steps
from engine.core.weighted_sum import ChangingSum, weighted_sum
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.pipeline import COARSE, FINAL, Placement, Quality, SkyState, final_quality
from engine.precompute.direct.projection import project_layer
from engine.render.editing_pilot import MOST_PICTURE_BYTES, light_picture_bytes

Float32Array = NDArray[np.float32]
Steps = Iterator[Response | None]
SHARE_OF_MEMORY = 0.25  # the free memory's, that they may take
# Of the pictures that come first: a sun's shadows are as sharp as in final ones.
QUICK = replace(COARSE, max_level=FINAL.max_level, sun_level=FINAL.sun_level)


@dataclass(frozen=True, eq=False)
class _LayerPictures:
    """A layer's radiance (p, 3) under each light alone, None where that is black, for its material then; coarse: the
    lights whose pictures are interpolated; rest: what its exact picture has besides, under lights of the weights `at`,
    None before that is known."""

    work: LayerState
    alone: Mapping[SingleLight, Float32Array | None]
    coarse: frozenset[SingleLight] = frozenset()
    rest: Float32Array | None = None
    at: Weights | None = None

    def is_of(self, work: LayerState) -> bool:
        """Whether the work reflects the same."""
        return reflects_alike(self.work, work)

    def lacks(self, light: SingleLight, is_quick: bool) -> bool:
        """Whether there is no picture under a light, or only a coarse one where that does not do."""
        return light not in self.alone or light in self.coarse and not is_quick

    def with_picture(self, light: SingleLight, picture: Float32Array | None, is_coarse: bool = False) -> _LayerPictures:
        """The same with this picture under a light; their sum at rest stays the exact picture."""
        coarse, rest = self.coarse - {light}, self.rest
        weight = (self.at or {}).get(light, BLACK)
        if rest is not None and any(weight):
            black = np.zeros_like(rest)
            before, now = (black if each is None else each for each in (self.alone[light], picture))
            rest = rest + np.array(weight, np.float32) * (before - now)
        alone = {**self.alone, light: picture}
        return replace(self, alone=alone, coarse=coarse | {light} if is_coarse else coarse, rest=rest)

    @cached_property
    def mix(self) -> ChangingSum[SingleLight | None]:
        """The weighted sum of the pictures and, as None, of the rest."""
        assert self.rest is not None
        return ChangingSum(lambda light: self.rest if light is None else self.alone[light], len(self.rest))

    @property
    def n_bytes(self) -> int:
        """Memory of the pictures; each of the two sums that the mix stores is as large as the rest."""
        pictures = (each for each in (*self.alone.values(), *3 * (self.rest,)) if each is not None)
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
        current: Mapping[str, LayerData], is_quick: bool = False,
    ) -> Steps:  # fmt: skip
        """Make the pictures that the layers lack, light by light, and compare their sum with the final pictures. None
        are made where they would take too much memory. is_quick: coarse ones do."""
        pictures = {key: data for key, data in current.items() if data.stage == FINAL.name}
        works = [work for work in scene.layers if work.key in pictures]
        lights = list(light_weights(scene.light, scene.emission))
        n_points = sum(pictures[work.key].store.n_points for work in works)
        room = min(MOST_PICTURE_BYTES, SHARE_OF_MEMORY * available_memory() + self.n_bytes)
        if light_picture_bytes(n_points, len(lights)) > room:
            self._ready = {}
            return
        self._ready = {work.key: self._kept(work, lights) for work in works}
        skies = {light: sky_of(light.light) for light in lights}
        shining = [light for light in lights if light.emitter or not _is_dark(skies[light])]
        for light in lights:
            for work in (work for work in works if self._ready[work.key].lacks(light, is_quick)):
                if light not in shining:
                    self._set_black(light, [work])
                elif len(shining) == 1:
                    self._add_only_light(light, work, pictures[work.key])
            due = [work for work in works if self._ready[work.key].lacks(light, is_quick)]
            if due:
                lit_by = pictures[due[0].key].lit_by
                quality = QUICK if is_quick else final_quality(lit_by.planned_settings or lit_by.settings)
                yield from self._add_light(placement, light, skies[light], due, quality)
        yield from self.compare(scene, current)

    def compare(self, scene: SceneState, current: Mapping[str, LayerData]) -> Steps:
        """Compare the sum of the pictures with the final pictures, from which a mix then begins."""
        for work in (work for work in scene.layers if work.key in current):
            data, ready = current[work.key], self._ready.get(work.key)
            if data.stage != FINAL.name or ready is None or not ready.is_of(work):
                continue
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
        coarse = known.coarse & alone.keys()
        same = known.at is not None and known.at.keys() <= alone.keys()
        return replace(known, alone=alone, coarse=coarse) if same else _LayerPictures(work, alone, coarse)

    def _add_only_light(self, light: SingleLight, work: LayerState, data: LayerData) -> None:
        """Add the picture under a scene's only light, which its final picture is a multiple of; nothing where that
        lacks a colour."""
        weight = light_weights(data.lit_by.light, data.lit_by.emission).get(light, ())
        if weight and all(weight):
            data = data.with_curves(work) if data.fits_curves(work) else data
            self._add(work, light, np.asarray(data.radiance / np.array(weight), np.float32))

    def _add_light(
        self, placement: Placement, light: SingleLight, sky: SkyState, due: list[LayerState], quality: Quality
    ) -> Steps:
        """Add the pictures under one light."""
        scene = placement.scene
        whole = placement.with_emission(light.emission(scene.object_names))
        i_object = {work.key: scene.object_index(work.object) for work in due}
        for _, objects, alone, reaching in light_groups(whole, sky):
            own = [work for work in due if objects[i_object[work.key]]]
            lit_by = SkyState(None) if _is_dark(reaching) else reaching
            if not own or lit_by.environment is None and not alone.scene.emission.any():
                self._set_black(light, own)
                continue
            visible = yield from map_steps(alone.light(lit_by, quality), lambda fraction: None)
            for work in own:
                fixed, rows = replace(work, fixed=True), alone.rows_of(i_object[work.key], quality.stride)
                parts = {}
                for tile in project_layer(alone.hits, rows, visible, shape_of(work)):
                    parts[tile.begin] = tile_content(fixed, tile)
                    yield None
                picture = join_tile_contents(fixed, parts).radiance(*both_curves(fixed)) * visible.lighting.unit
                if quality.stride > 1:
                    picture = placement.interpolated(picture, i_object[work.key], quality.stride)
                self._add(work, light, np.ascontiguousarray(picture, np.float32), quality.stride > 1)

    def of_emitter(self, work: LayerState, name: str) -> Float32Array | None:
        """The final picture (p, 3) of a layer under an emitter alone, of radiance 1; None where there is none."""
        ready = self._ready.get(work.key)
        if ready is None or not ready.is_of(work):
            return None
        return next((ready.alone[light] for light in ready.alone.keys() - ready.coarse if light.emitter == name), None)

    def _set_black(self, light: SingleLight, works: list[LayerState]) -> None:
        """Note that a light does not reach these layers."""
        for work in works:
            self._add(work, light, None)

    def _add(self, work: LayerState, light: SingleLight, picture: Float32Array | None, is_coarse: bool = False) -> None:
        self._ready[work.key] = self._ready[work.key].with_picture(light, picture, is_coarse)

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
