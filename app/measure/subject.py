"""The scene that is measured: geometry, document and distant light, opened as the worker opens them."""

from __future__ import annotations

from dataclasses import dataclass

from app.document.document import Document
from app.project.project import open_project
from engine.material.layer import Layer
from engine.planner import band_counts, bands_for_sharpest
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.direct.projection import LayerShape
from engine.scene.scene_loader import Scene

Bands = dict[str, int]


@dataclass(frozen=True, eq=False)
class Subject:
    """An opened scene."""

    source: str
    scene: Scene
    document: Document
    sky: SkyState

    @property
    def most_bands(self) -> int:
        """J of the curve that is planned with the most."""
        return max((n for _, layer in self.layers for n in band_counts(layer).values()), default=1)

    @property
    def layers(self) -> tuple[tuple[int, Layer], ...]:
        """(object index, layer) of all layers that reflect, in the scene's order."""
        return tuple(
            (i_object, layer) for i_object, state in enumerate(self.document.objects) for layer in state.layers
        )


def open_subject(source: str, resolution: tuple[int, int] | None = None) -> Subject:
    """Open what a person named; `resolution` (width, height) replaces the scene's own. Raises InsituError."""
    project = open_project(source, resolution)
    return Subject(source, project.scene, project.document, project.sky)


def at_most(resolution: tuple[int, int], side: int) -> tuple[int, int]:
    """The resolution scaled down so that its longer side has at most `side` pixels."""
    longest = max(resolution)
    if longest <= side:
        return resolution
    width, height = (max(1, round(n * side / longest)) for n in resolution)
    return width, height


def layer_bands(layer: Layer, most: int | None = None) -> Bands:
    """J of each of a layer's curves: as planned, or with `most` (a power of two) for the sharpest."""
    planned = band_counts(layer)
    return planned if most is None else bands_for_sharpest(layer, planned, most)


def layer_shape(layer: Layer, bands: Bands) -> LayerShape:
    """What the projection needs to know of a layer."""
    counts = (*bands.values(), 1)
    return LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), (counts[0], counts[1]))
