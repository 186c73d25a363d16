"""Lamps that are dragged in Placement: their direct light follows in the picture at rest, while all else stays.

Light adds up [BenArtzi07, eq. 7.4]: the picture at rest, less what the lamps gave where they are in it, and what they
give where the hand has them now. The latter is found at a lattice of pixels, with shadows and all curves, and
interpolated as a coarse stage is. The former is the lamp's own picture of the mix, where that is ready
(`light_pictures`), or found in the same way; then the picture at rest keeps its detail as far as other light makes it,
or the lamp's highlights would stay where they were. The lamps themselves hide no light meanwhile.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import Response
from app.worker.layer_data import LayerData, reflects_alike
from app.worker.light_pictures import LightPictures
from app.worker.moved_pictures import LightSamples
from engine.core.generators import map_steps
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.moves import kept_detail, lattice_stride, without_objects
from engine.precompute.direct.pipeline import Placement, Quality
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.cutouts import scene_caster
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
# Points of the lattice: every eighth pixel of 512 x 512, every one of a small picture.
MOST_POINTS = 5000
QUALITY = Quality("dragged", 1, 0, 16)


class DraggedLamps:
    """Some lamps, by name, in the open view."""

    def __init__(self, placement: Placement, names: Sequence[str]) -> None:
        self._placement, self._names = placement, tuple(names)
        scene = placement.scene
        self.objects = np.isin(scene.object_names, self._names)
        self._caster = scene_caster(without_objects(scene, self.objects))
        self._stride = lattice_stride(len(placement.hits.pixel), MOST_POINTS)
        self._lattice = placement.rows(self._stride)
        self._hits = placement.hits.at(self._lattice)
        self._before: LightSamples | None = None
        self._now: tuple[Scene, LightSamples] | None = None
        self._without: dict[str, tuple[LayerData, Float32Array]] = {}

    def serves(self, lamps: Poses) -> bool:
        """Whether these are the lamps that have moved."""
        return {name for name, _ in lamps} == set(self._names)

    def takes(self, work: LayerState, base: LayerData | None, scene: SceneState) -> bool:
        """Whether a layer's picture at rest is that of this scene, but for the place of the lamps."""
        if base is None or scene.light.exclusions or not reflects_alike(base.work, work):
            return False
        return (base.lit_by.light, base.lit_by.emission) == (scene.light, scene.emission)

    def picture(
        self, work: LayerState, base: LayerData, moved: Scene, lights: LightPictures
    ) -> Generator[Response | None, None, Float32Array]:
        """A layer's radiance (p, 3), without f_q and f_o. base: at rest; moved: the lamps where they are now."""
        if self._now is None or self._now[0] is not moved:
            self._now = moved, (yield from self._light(moved))
        known = self._without.get(work.key)
        if known is None or known[0] is not base:
            known = base, (yield from self._without_lamps(work, base, lights))
            self._without[work.key] = known
        total = known[1] + (yield from self._interpolated(self._now[1], work))
        return np.maximum(total, np.float32(0.0), out=total)

    def _without_lamps(
        self, work: LayerState, base: LayerData, lights: LightPictures
    ) -> Generator[None, None, Float32Array]:
        """The picture at rest without the lamps."""
        base, scene = base.with_curves(work) if base.fits_curves(work) else base, self._placement.scene
        picture, own = base.radiance, [lights.of_emitter(work, name) for name in self._names]
        if all(each is not None for each in own):
            without = picture.copy()
            for name, each in zip(self._names, own, strict=True):
                without -= scene.emission[scene.object_index(name)] * each
            return without
        if self._before is None:
            self._before = yield from self._light(scene)
        given = yield from self._interpolated(self._before, work)
        if self._stride == 1:
            return picture - given
        i_object = scene.object_index(work.object)
        begin, _ = self._placement.hits.object_ranges[i_object]
        samples = picture[self._placement.rows_of(i_object, self._stride) - begin]
        whole = self._placement.interpolated(samples, i_object, self._stride)
        return np.asarray(whole - given + kept_detail(whole, given) * (picture - whole), np.float32)

    def _light(self, scene: Scene) -> Generator[None, None, LightSamples]:
        """The light of the lamps where a scene has them, at the points of the lattice."""
        emission = np.where(self.objects[:, None], self._placement.scene.emission, np.float32(0.0))
        alone = Placement(replace(scene, emission=emission), self._caster, hits=self._hits)
        lighting = prepare_lighting(None, alone.emitters(QUALITY.n_patches), QUALITY.tolerance, True)
        steps = alone.visible_light(lighting, QUALITY)
        light = yield from map_steps(steps, lambda fraction: None)
        return LightSamples(alone, self._lattice, ((light, 1.0),))

    def _interpolated(self, samples: LightSamples, work: LayerState) -> Generator[None, None, Float32Array]:
        i_object = self._placement.scene.object_index(work.object)
        _, radiance, _ = yield from samples.radiance(work, i_object)
        return radiance if self._stride == 1 else self._placement.interpolated(radiance, i_object, self._stride)
