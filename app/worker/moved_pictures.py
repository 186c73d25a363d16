"""The first picture after objects were moved: what the view before had, with what the move changes of it.

Most points of the picture show the same place as before, and keep the radiance of the exact picture; a lattice finds
the light that they gained and lost (`engine.precompute.direct.moves`), interpolated as a coarse stage is. Detail of the
picture before that the lattice leaves out stays as far as light does. Points that show another place, those of the
moved objects and what these hid before, are lit as in a coarse stage. Emitters that were moved are lights of their own:
their light from where they were is taken away, and that from where they are added. The stages of the transport replace
all of it.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.document.scene_state import LayerState
from app.messages.worker_messages import Response
from app.worker.layer_data import (
    STAGES,
    LayerData,
    LightingState,
    both_curves,
    join_tile_contents,
    shape_of,
    tile_content,
)
from engine.core.generators import map_steps
from engine.light.environment import Environment
from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.precompute.direct.lighting import Lighting, prepare_lighting
from engine.precompute.direct.linking import BLACK
from engine.precompute.direct.moves import (
    SceneMove,
    changed_light,
    changed_rows,
    kept_detail,
    lattice_stride,
    same_points,
    scene_move,
)
from engine.precompute.direct.pipeline import COARSE, FINAL, Placement, SkyState, footprint, lattice_rows
from engine.precompute.direct.projection import VisibleLight, project_layer
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
Steps = Generator[Response | None, None, None]
# Points of the lattice: every fourth pixel of 512 x 512, every one of a small picture.
MOST_POINTS = 20_000
# Of the light that changes: a sun's shadows are as sharp as in final pictures.
QUALITY = replace(COARSE, max_level=FINAL.max_level, sun_level=FINAL.sun_level)
# Of the picture's points at least so many show what they did before, or all of it is another picture.
LEAST_SAME = 0.3


class TracedScene(NamedTuple):
    """A scene as a camera saw it."""

    scene: Scene
    caster: RayCaster
    hits: PrimaryHits


def whole_pictures(layers: Mapping[str, LayerData]) -> dict[str, LayerData]:
    """Of some layers those that have a picture at every point."""
    return {key: data for key, data in layers.items() if STAGES[data.stage].stride == 1}


@dataclass(frozen=True, eq=False)
class LightSamples:
    """Points of the picture, by row, ascending, where light is found, and that light: terms of a sum, each times a
    sign."""

    placement: Placement
    rows: Int32Array
    terms: tuple[tuple[VisibleLight, float], ...]

    def radiance(
        self, work: LayerState, i_object: int
    ) -> Generator[None, None, tuple[Int32Array, Float32Array, Float32Array]]:
        """Rows (s,) of one object's samples, a layer's radiance (s, 3) there, without f_q and f_o, and the same with
        all terms added."""
        fixed, (begin, end) = replace(work, fixed=True), self.placement.hits.object_ranges[i_object]
        total, added = np.zeros((2, end - begin, 3), np.float32)
        for light, sign in self.terms:
            lit = changed_rows(light)
            lit = lit[(lit >= begin) & (lit < end)]
            if not len(lit):
                continue
            parts = {}
            for tile in project_layer(self.placement.hits, lit, light, shape_of(work)):
                parts[tile.begin] = tile_content(fixed, tile)
                yield None
            found = np.float32(light.lighting.unit) * join_tile_contents(fixed, parts).radiance(*both_curves(fixed))
            total[lit - begin] += np.float32(sign) * found
            added[lit - begin] += found
        return self.rows[begin:end], total, added


class MovedPictures:
    """Pictures of a view, from those of the view before, between which objects were moved."""

    def __init__(self, before: TracedScene, after: Placement, layers: Mapping[str, LayerData], move: SceneMove) -> None:
        self.before, self.layers = before, dict(layers)
        self._after, self._move = after, move
        self.same = same_points(before.hits, after.hits)
        self._stride = lattice_stride(len(self.same), MOST_POINTS)
        self._changes: LightSamples | None = None
        self._anew: LightSamples | None = None

    @classmethod
    def between(cls, before: TracedScene, after: Placement, layers: Mapping[str, LayerData]) -> MovedPictures | None:
        """Those of layers that have a picture at every point; None where more was changed than the place of objects."""
        move = scene_move(before.scene, after.scene) if layers else None
        if move is None or not move.moved.any():
            return None
        found = cls(before, after, layers, move)
        return found if np.count_nonzero(found.same >= 0) > LEAST_SAME * len(found.same) else None

    @property
    def moves_emitters(self) -> bool:
        """Whether lights are among what was moved."""
        return bool((self._move.moved & self._after.scene.emitters).any())

    def takes(self, work: LayerState, lit_by: LightingState) -> bool:
        """Whether the view before has a picture of this layer in this light."""
        data = self.layers.get(work.key)
        return data is not None and not lit_by.light.exclusions and data.is_picture_of(work, lit_by)

    # ------------------------------------------------------------------------------------------------------------ light

    def find_light(self, sky: SkyState) -> Steps:
        """Find the light that changes, and all light where nothing is known."""
        after, names = self._after, np.array(self._after.scene.object_names)
        lattice = lattice_rows(after.hits, self._stride)
        kept, new = lattice[self.same[lattice] >= 0], self._new_samples(lattice)
        moved = self._move.moved & after.scene.emitters
        points = after.at_rows(kept)
        staying = points.with_emission(dict.fromkeys(names[moved], BLACK))
        terms = list[tuple[VisibleLight, float]]()
        for found in changed_light(staying, self.before.caster, _lighting(staying, sky), self._move.boxes):
            yield None
            terms += [] if found is None else [(found[0], 1.0), (found[1], -1.0)]
        if moved.any():
            now = points.with_emission(dict.fromkeys(names[~moved & after.scene.emitters], BLACK))
            was = replace(self.before.scene, emission=now.scene.emission)
            for placement, sign in ((now, 1.0), (Placement(was, self.before.caster, hits=points.hits), -1.0)):
                terms.append(((yield from _visible(placement, SkyState(None))), sign))
        self._changes = LightSamples(points, kept, tuple(terms))
        if len(new):
            fresh = after.at_rows(new)
            self._anew = LightSamples(fresh, new, (((yield from _visible(fresh, sky)), 1.0),))

    def _new_samples(self, lattice: Int32Array) -> Int32Array:
        """Rows of the lattice without a place in the view before, and some of each object that has no other."""
        new = self.same < 0
        chosen = np.zeros(len(new), bool)
        chosen[lattice] = new[lattice]
        for begin, end in self._after.hits.object_ranges:
            if new[begin:end].any() and not chosen[begin:end].any():
                own = begin + np.flatnonzero(new[begin:end])
                chosen[own[:: -(-len(own) // 4)]] = True
        return np.flatnonzero(chosen).astype(np.int32)

    # --------------------------------------------------------------------------------------------------------- pictures

    def picture(self, work: LayerState) -> Generator[None, None, Float32Array]:
        """The radiance (p, 3) of a layer at all of its points, without f_q and f_o; `find_light` comes first."""
        i_object, hits = self._after.scene.object_index(work.object), self._after.hits
        (begin, end), same = hits.object_ranges[i_object], self.same
        out, kept = np.zeros((end - begin, 3), np.float32), np.flatnonzero(same[begin:end] >= 0)
        old = self.layers[work.key].taken_over_by(work).radiance
        out[kept] = old[same[begin:end][kept] - self.before.hits.object_ranges[i_object, 0]]
        assert self._changes is not None
        rows, change, changed = yield from self._changes.radiance(work, i_object)
        if change.any() or changed.any():
            lattice = np.searchsorted(kept, rows - begin)
            known = np.concatenate([out[kept[lattice]], change, changed], axis=1)
            whole, change, changed = np.split(self._interpolated(begin + kept, rows, known, i_object), 3, axis=1)
            detail = kept_detail(whole + np.maximum(change, 0.0), changed) * (out[kept] - whole)
            touched = changed.any(axis=1)
            out[kept[touched]] = (whole + change + detail)[touched]
        new = np.flatnonzero(same[begin:end] < 0)
        if len(new) and self._anew is not None:
            rows, radiance, _ = yield from self._anew.radiance(work, i_object)
            out[new] = self._interpolated(begin + new, rows, radiance, i_object)
        return np.maximum(out, np.float32(0.0), out=out)

    def _interpolated(
        self, points: NDArray[np.integer], samples: Int32Array, values: Float32Array, i_object: int
    ) -> Float32Array:
        """Values (s, 3) of samples, rows of the picture among these points of an object, at all of these."""
        if len(samples) == len(points):
            return values
        part = self._after.hits.at(np.asarray(points, np.int32))
        chosen, weights = footprint(part, np.searchsorted(points, samples).astype(np.int32), self._stride)
        return np.einsum("ps,psc->pc", weights, values[chosen])


def _visible(placement: Placement, sky: SkyState) -> Generator[None, None, VisibleLight]:
    """All light that a placement's points see."""
    steps = placement.visible_light(_lighting(placement, sky), replace(QUALITY, stride=1))
    return (yield from map_steps(steps, lambda fraction: None))


def _lighting(placement: Placement, sky: SkyState) -> Lighting:
    """The light of the first picture, each of whose sky lights has a ray of its own."""
    cut = None if sky.environment is None else _sky_lights(sky.environment, sky.rotation)
    return prepare_lighting(cut, placement.emitters(QUALITY.n_patches), QUALITY.tolerance, True, sky.scale)


@lru_cache(maxsize=1)  # the same for all moves under a light
def _sky_lights(environment: Environment, rotation: float) -> TriangleLights:
    return cut_lights(environment, QUALITY.n_lights, rotation, QUALITY.max_level, peak_level=QUALITY.sun_level)
