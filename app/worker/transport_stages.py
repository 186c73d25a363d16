"""Computes the transport of layers, a stage at a time: the stages of a request, their light, and the layers' tiles.

Each stage is a whole picture: *coarse* (every fourth pixel, 400 lights) within a second or two, *preview* (every pixel,
400 lights), *final* (4,000 lights). A dragged light gets one *drag* stage instead (every eighth pixel, nothing traced).
Visibility and final transport are cached on disk, the latter tile by tile while it is made, so that a scene opened
before opens at once and a worker that follows one that died continues where that was.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Generator
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from app.document.scene_state import LayerState
from app.messages.worker_messages import Progress, Response
from app.modes.placement.placement_messages import ComputeTransport
from app.worker.cache import content_key
from app.worker.layer_data import LayerTiles, both_curves, join_tile_contents, shape_of, store_of, tile_content
from app.worker.tasks import CACHE_VERSION, WorkerContext
from engine.core.generators import map_steps
from engine.core.stored_arrays import ArrayReader, Arrays, n_bytes_of
from engine.precompute.direct.bandstore import BandStore, FixedPicture
from engine.precompute.direct.linking import LightGroup
from engine.precompute.direct.pipeline import COARSE, DRAG, PREVIEW, Placement, Quality, SkyState, final_quality
from engine.precompute.direct.projection import TILE, VisibleLight
from engine.scene.scene_loader import Scene

LayerStore = BandStore | FixedPicture


def stages_of(request: ComputeTransport) -> list[tuple[Quality, bool]]:
    """The stages of a request and whether each is the last."""
    if request.is_drag:
        return [(DRAG, True)]
    coarse = replace(COARSE, n_lights=request.n_lights_preview)
    if request.is_fine:
        return [(coarse, False), (final_quality(request.settings), True)]
    preview = replace(PREVIEW, n_lights=request.n_lights_preview)
    if request.settings.n_lights <= request.n_lights_preview:
        return [(coarse, False), (replace(preview, stays=True), True)]
    final = final_quality(request.settings)
    return [(coarse, False), (preview, False), (final, True)]


class StageClock:
    """Turns a stage's fraction into Progress with the time left."""

    def __init__(self, stage: str) -> None:
        self._stage, self._started, self._last_sent, self._most = stage, time.monotonic(), 0.0, 0.0

    def progress(self, fraction: float, text: str) -> Progress | None:
        """At most twenty a second, never less than before; the time left is known once two percent are done."""
        self._most = fraction = min(max(self._most, fraction), 1.0)
        now = time.monotonic()
        if now - self._last_sent < 0.05:
            return None
        self._last_sent = now
        left = (now - self._started) * (1 - fraction) / fraction if fraction > 0.02 else None
        return Progress(self._stage, fraction, left, text)


class TransportStages:
    """The light of the stages in the open view, and the layers' transport under it."""

    def __init__(self, context: WorkerContext) -> None:
        self._context, self._cache = context, context.store
        self._lights: dict[str, VisibleLight] = {}
        # Bytes of layers that are cached and not held, by key.
        self.dropped_bytes: dict[str, int] = {}

    def recall_visibility(self, placement: Placement) -> None:
        """Take the sphere's visibility from the cache, where it has that."""
        mine = placement.sphere.bits

        def bits_of(arrays: Arrays) -> np.ndarray:
            return ArrayReader(arrays).take("bits", mine.dtype, *mine.shape)

        kept = self._cache.get(content_key("visibility", self._context.geometry_key), bits_of)
        if kept is not None:
            mine[:] = kept
            placement.sphere.done[:] = True

    def light_key(self, sky: SkyState, placement: Placement, quality: Quality) -> str:
        """The key of a stage's light."""
        shadows = () if placement.has_shadows else ("no shadows",)
        return content_key(
            CACHE_VERSION, self._context.view_key, lit_key(sky, placement.scene), *shadows,
            quality.n_lights, quality.n_patches, quality.max_level, quality.own_rays,
        )  # fmt: skip

    def cached_unit(self, light_key: str) -> float | None:
        """The unit that cached transport under this light is in; None where there is none."""
        return self._cache.get(_unit_key(light_key), _unit)

    def cached_store(self, light_key: str, work: LayerState, n_points: int) -> LayerStore | None:
        """A layer's cached transport; None where there is none."""
        return self._cache.get(_transport_key(light_key, work), partial(store_of, work, n_points))

    def keep_lights(self, keys: Collection[str]) -> None:
        """Drop the stored light of other keys than these."""
        self._lights = {key: light for key, light in self._lights.items() if key in keys}

    def final_light(
        self, group: LightGroup, quality: Quality, key: str, clock: StageClock
    ) -> Generator[Response | None, None, VisibleLight]:
        """The light of a stage that reaches a group of objects; that of the last final stage is stored, for layers that
        change under it."""
        if key in self._lights:
            return self._lights[key]
        light = yield from self._trace_visibility(group, quality, clock)
        if key:
            self._lights[key] = light
            self._cache.put(_unit_key(key), {"unit": np.array([light.lighting.unit], np.float64)})
        return light

    def _trace_visibility(
        self, group: LightGroup, quality: Quality, clock: StageClock
    ) -> Generator[Response | None, None, VisibleLight]:
        placement = group.placement
        was_done = bool(placement.sphere.done.all()) or not placement.has_shadows
        light = yield from map_steps(
            self._context.executor.compute_light(group, quality),
            lambda fraction: clock.progress(0.3 * fraction, "shadows"),
        )
        if not was_done and placement.sphere.done.all():
            self._cache.put(content_key("visibility", self._context.geometry_key), {"bits": placement.sphere.bits})
        return light

    def project(
        self, placement: Placement, rows: np.ndarray, work: LayerState, light: VisibleLight, light_key: str,
        clock: StageClock, done: int, total: int,
    ) -> Generator[Response | None, None, LayerStore]:  # fmt: skip
        """The layer's transport; or its picture, where only the cache needs it."""
        shape = shape_of(work)
        parts: dict[int, dict[str, np.ndarray]] = {}
        if not light_key or not len(rows):
            for tile in self._context.executor.project_tiles(placement, rows, light, shape):
                if tile is not None:
                    parts[tile.begin] = tile_content(work, tile)
                yield clock.progress(0.3 + 0.7 * (done + len(parts) * TILE) / total, work.key)
            return join_tile_contents(work, parts)
        key = _transport_key(light_key, work)
        kept = self.cached_store(light_key, work, len(rows))
        if kept is not None:
            if not self._context.fills:
                return kept
            self.dropped_bytes[work.key] = kept.n_bytes
            return FixedPicture(kept.radiance(*both_curves(work)))
        with self._cache.open_tiles(key, -(-len(rows) // TILE)) as file:
            tiles = LayerTiles(work, len(rows), file, held=not self._context.fills)
            for tile in self._context.executor.project_tiles(placement, rows, light, shape, tiles.complete):
                if tile is not None:
                    tiles.add(tile)
                yield clock.progress(0.3 + 0.7 * (done + len(tiles.complete) * TILE) / total, work.key)
            arrays = tiles.arrays()
            if self._cache.put(key, arrays):
                file.finish()
            if not self._context.fills:
                return tiles.store()
            self.dropped_bytes[work.key] = n_bytes_of(arrays)
            return tiles.picture()


def _transport_key(light_key: str, work: LayerState) -> str:
    baked = work.coefficients if work.fixed else ()
    return content_key("transport", light_key, work.key, work.model, work.quotient_parameters, work.bands, *baked)


def _unit_key(light_key: str) -> str:
    """The key of the unit that transport under this light is in."""
    return content_key("unit", light_key)


def _unit(arrays: Arrays) -> float:
    return float(ArrayReader(arrays).take("unit", np.float64, 1)[0])


def lit_key(sky: SkyState, scene: Scene) -> str:
    """The key of all light in the scene."""
    environment = "" if sky.environment is None else sky.environment.digest
    links = [(repr((sorted(each.objects), sorted(each.dark))), lit_key(each.sky, scene)) for each in sky.links]
    return content_key(environment, sky.rotation, sky.scale, scene.emission, *chain.from_iterable(links))


def rows_of(placement: Placement, work: LayerState, quality: Quality) -> np.ndarray:
    """The points of a layer in a stage."""
    return placement.rows_of(placement.scene.object_index(work.object), quality.stride)
