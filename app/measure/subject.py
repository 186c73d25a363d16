"""The scene that is measured: geometry, document and distant light, opened as the worker opens them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document import Document, document_from_description
from engine.light.environment import constant_environment, load_environment
from engine.material.layer import Layer
from engine.plan import EDITABLE_BANDS, MOST_BANDS, MOST_BANDS_OVERRULED
from engine.scene.builtin import builtin_scenes
from engine.scene.load import Scene, load_scene
from engine.transport.pipeline import SkyState
from engine.transport.projection import LayerShape

Bands = dict[str, int]


@dataclass(frozen=True, eq=False)
class Subject:
    """An opened scene."""

    source: str
    scene: Scene
    document: Document
    sky: SkyState

    @property
    def layers(self) -> tuple[tuple[int, Layer], ...]:
        """(object index, layer) of all layers that reflect, in the scene's order."""
        return tuple(
            (i_object, layer)
            for i_object, state in enumerate(self.document.objects)
            if not state.emits
            for layer in state.layers
        )


def open_subject(source: str, resolution: tuple[int, int] | None = None) -> Subject:
    """Open a built-in scene or a scene file; `resolution` (width, height) replaces its own. Raises LoadError."""
    path = builtin_scenes().get(source) or Path(source)
    scene = load_scene(path, resolution)
    return Subject(source, scene, document_from_description(source, scene.description), scene_sky(scene))


def at_most(resolution: tuple[int, int], side: int) -> tuple[int, int]:
    """The resolution scaled down so that its longer side has at most `side` pixels."""
    longest = max(resolution)
    if longest <= side:
        return resolution
    width, height = (max(1, round(n * side / longest)) for n in resolution)
    return width, height


def scene_sky(scene: Scene) -> SkyState:
    """The distant light that the scene file describes."""
    described = scene.description.environment
    if described is None:
        return SkyState(None)
    if scene.environment_path is None:
        environment = constant_environment(described.radiance or (0.0, 0.0, 0.0))
    else:
        environment = load_environment(scene.environment_path, described.mapping)
    return SkyState(environment, described.rotation, described.scale)


def layer_bands(layer: Layer, most: int = MOST_BANDS) -> Bands:
    """J of each of a layer's curves when sharp ones get `most` (a power of two); slow ones keep their few."""
    bands = {}
    for place, factor in enumerate(layer.model.factors):
        usual = EDITABLE_BANDS[factor.gamma]
        wanted = most * usual // MOST_BANDS if usual >= MOST_BANDS // 2 else min(usual, most)
        bands[factor.name] = max(1, min(wanted, MOST_BANDS_OVERRULED[place]))
    return bands


def layer_shape(layer: Layer, bands: Bands) -> LayerShape:
    """What the projection needs to know of a layer."""
    counts = (*bands.values(), 1)
    return LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), (counts[0], counts[1]))
