"""Images of layers on their way from the worker to the renderer of Placement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import moderngl

from app.modes.placement.placement_events import LayerMapsChanged
from engine.material.layer_maps import LayerMaps
from ui.gl.gpu_memory import small_texture
from ui.modes.placement.gl.renderer import PlacementRenderer


class MapFeed:
    """Feeds one renderer. A layer's images may come before the layer itself."""

    def __init__(self, renderer: PlacementRenderer) -> None:
        self._renderer = renderer
        self._newest: dict[str, LayerMapsChanged] = {}
        self._thumbnails: dict[str, dict[str, moderngl.Texture]] = {}
        self._retired: list[moderngl.Texture] = []

    def thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        """The "texture" and the "weight" of a layer, small, row 0 at the top, where there are any."""
        return self._thumbnails.get(key, {})

    def take(self, event: LayerMapsChanged) -> None:
        """Take another image, or none."""
        self._newest[event.key] = event
        self._retire([event.key])
        context = self._renderer.context
        self._thumbnails[event.key] = {name: small_texture(context, p) for name, p in event.thumbnails.items()}
        if event.key in self._renderer.layer_keys:
            self._renderer.set_layer_maps(event.key, event.samples)

    def layer_made(self, key: str) -> None:
        """Note that the renderer has a new layer."""
        if key in self._newest:
            self._renderer.set_layer_maps(key, self._newest[key].samples)

    def follow(self, key: str, maps: LayerMaps) -> None:
        """Follow a layer's numbers in the document; there is nothing to invert before there is a weight."""
        shown = self._newest.get(key)
        inverts = maps.weight_invert and shown is not None and shown.has_weight
        self._renderer.set_map_numbers(key, maps.sampled_strength, inverts)

    def clear(self) -> None:
        """Drop all: another scene is open."""
        self._newest.clear()
        self._retire(list(self._thumbnails))

    def release_retired(self) -> None:
        """Free what panels drew in the last frame and no longer have."""
        for texture in self._retired:
            texture.release()
        self._retired.clear()

    def _retire(self, keys: Iterable[str]) -> None:
        self._retired += [texture for key in keys for texture in self._thumbnails.pop(key, {}).values()]
