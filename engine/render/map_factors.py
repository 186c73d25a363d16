"""The factors by which textures and weight maps multiply layers at the vertices of paths.

At primary hits an image is filtered over the pixel, as in the editor; at further vertices it is interpolated between
texels. The editor instead uses the image's mean over a part of the surface there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.precompute.direct.pipeline import Placement
from engine.render.map_sampler import MapSampler, look_up_images, paint_weights
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import uvs_at

Factors = NDArray[np.float32]


class MapFactors:
    """Factors (N, K, 3) of the visible layers of each object, in their order; K is the largest number of layers of an
    object with maps, 0 if there is none."""

    def __init__(self, scene: Scene, layers_of: Mapping[int, Sequence[Layer]]) -> None:
        self._scene = scene
        self._maps: dict[int, list[tuple[int, LayerMaps]]] = {}
        n_layers = 0
        for i_object, layers in layers_of.items():
            visible = [layer for layer in layers if layer.visible]
            found = [(k, layer.maps) for k, layer in enumerate(visible) if not layer.maps.is_plain]
            if found:
                self._maps[i_object] = found
                n_layers = max(n_layers, len(visible))
        self._n_layers = n_layers

    def at_primary_hits(self, placement: Placement) -> Factors:
        """Factors at all points of the hits, (P, K, 3)."""
        hits = placement.hits
        factors, sampler = self._ones(len(hits.pixel)), MapSampler(self._scene, placement.caster, hits)
        for i_object, found in self._maps.items():
            begin, end = hits.object_ranges[i_object]
            for k, maps in found:
                seen = sampler.see(i_object, maps.images)
                factors[begin:end, k] = maps.factor(seen.texture, seen.weight)
        return factors

    def at_path_vertices(self, found: Intersections, ids: NDArray[np.integer], rays: NDArray[np.integer]) -> Factors:
        """Factors at some of the rays that were traced, on objects ids (R,): (N, K, 3)."""
        factors = self._ones(len(rays))
        for i_object, layers in self._maps.items():
            mine = np.flatnonzero(ids[rays] == i_object)
            own = found.of(rays[mine])
            uv = uvs_at(self._scene, own.triangle, own.u, own.v)
            for k, maps in layers:
                texture, weight = look_up_images(maps.images, self._scene.textures, uv)
                factors[mine, k] = maps.factor(texture, paint_weights(self._scene, own, maps.strokes, weight))
        return factors

    def _ones(self, n: int) -> Factors:
        return np.ones((n, self._n_layers, 3), np.float32)
