"""The reflections of a scene's objects as sums of terms; computes their layers' slices piece by piece.

Slices take a limited number of bytes: with many layers they use larger triangles
(`engine.realtime.triple_product.slices`). An LRU cache that recomputes dropped slices was rejected: a picture
needs all that it shows, and 500 metals took 160 s of processor time for each.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StepRunner, run_to_end
from engine.material.layer import Frame, Layer
from engine.material.layer_maps import LayerMaps
from engine.realtime.core.terms import LayersOf, diffuse_reflectance
from engine.realtime.triple_product import _slice_kernels
from engine.realtime.triple_product.glossy_bounces import GlossyTerm
from engine.realtime.triple_product.slices import SliceLevels, Slices, slice_steps
from engine.realtime.triple_product.visibility import LEVEL
from engine.scene.map_sampler import mean_factor
from engine.scene.scene_loader import Scene

# Steradians. Below it are the copper of the tea tray (Ashikhmin-Shirley, 320 and 70) and Beckmann with roughness 0.12.
SHARP = 0.4


@dataclass(frozen=True)
class Term:
    """One term of an object's reflection: diffuse layers, with reflectance ρ (3,), or glossy layers, in one frame and
    under the same covers of the other; factor: which of the object's visible maps multiplies it."""

    i_object: int
    layers: tuple[Layer, ...]
    reflectance: tuple[float, float, float] | None
    factor: int | None = None

    @property
    def frame(self) -> Frame:
        """The frame of its layers."""
        return self.layers[0].frame

    @property
    def covers(self) -> tuple[Layer, ...]:
        """What lies on its layers in the other frame."""
        return _other_covers(self.layers[0])


class Reflections:
    """The terms of all objects and the slices of their layers, which are missing, coarse or fine."""

    def __init__(self, most_bytes: int) -> None:
        """most_bytes: limit for the slices."""
        self.layers_of: dict[int, tuple[Layer, ...]] = {}
        self.terms: tuple[Term, ...] = ()
        self._levels = SliceLevels(most_bytes)
        self._slices: dict[Layer, Slices] = {}
        self._fine: set[Layer] = set()
        self._tables: dict[tuple[Layer, ...], _slice_kernels.Tables] = {}
        self._slice_steps: tuple[Layer, StepRunner[Slices]] | None = None
        self._means: dict[tuple[object, ...], NDArray[np.floating]] = {}

    def set_layers(self, layers_of: LayersOf) -> bool:
        """Set the layers of each object, by its index; return whether they changed. Unchanged layers keep their
        slices."""
        layers = {i: tuple(own) for i, own in layers_of.items()}
        if layers == self.layers_of:
            return False
        self.layers_of, self.terms = layers, tuple(_terms(layers))
        glossy = list(dict.fromkeys(term.layers for term in self.terms if term.reflectance is None))
        self._levels.choose(glossy)
        before, self._slices = self._slices, {}
        for layer, slices in before.items():
            level = self._levels.of.get(layer, 0)
            if slices.level > level > 0:
                self._slices[layer] = slices.at_level(level)
            elif slices.level >= min(level, LEVEL - 1) > 0:
                self._slices[layer] = slices
        same = {layer for layer, slices in self._slices.items() if slices is before[layer]}
        self._fine = {layer for layer in self._fine & same if self._slices[layer].level == LEVEL}
        self._tables = {
            those: self._tables[those] for those in glossy if those in self._tables and same.issuperset(those)
        }
        return True

    @property
    def n_slices(self) -> int:
        """Number of layers that have slices."""
        return len(self._slices)

    @property
    def slice_bytes(self) -> int:
        """Bytes that slices take now."""
        arrays = [slices.flat for slices in self._slices.values()]
        arrays += [array for tables in self._tables.values() for array in (tables.table, tables.values)]
        return sum({id(array): array.nbytes for array in arrays}.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages about what was made coarser to stay within memory."""
        return self._levels.notes

    @property
    def is_done(self) -> bool:
        """Whether all slices are as fine as intended."""
        return not self._rough and all(layer in self._slices for layer in self._wanted)

    def are_glossy(self, n_objects: int) -> NDArray[np.bool_]:
        """Which objects (M,) are not diffuse."""
        found = np.zeros(n_objects, bool)
        found[[term.i_object for term in self.terms if term.reflectance is None]] = True
        return found

    def find_coarse(self) -> bool:
        """Compute the coarse slices of a layer that has none; return whether there was one."""
        missing = next((layer for layer in self._wanted if layer not in self._slices), None)
        if missing is None:
            return False
        coarse = run_to_end(slice_steps(missing, -1))
        self._take(missing, coarse.at_level(min(coarse.level, self._levels.of[missing])))
        return True

    def refine(self) -> bool:
        """Do a step towards the fine slices of a layer; return whether it was the layer's last step."""
        rough = self._rough
        if self._slice_steps is None or self._slice_steps[0] not in rough:
            self._slice_steps = rough[0], StepRunner(slice_steps(rough[0]))
        layer, steps = self._slice_steps
        if not steps.advance():
            return False
        self._take(layer, steps.result)
        self._fine.add(layer)
        self._slice_steps = None
        return True

    def tables(self, layers: tuple[Layer, ...]) -> _slice_kernels.Tables | None:
        """The slices of a stack of layers; None until they are known."""
        if layers not in self._tables:
            if any(layer not in self._slices for layer in layers):
                return None
            total = self._slices[layers[0]]
            for layer in layers[1:]:
                total = total + self._slices[layer]
            self._tables[layers] = total.make_tables()
        return self._tables[layers]

    def is_sharp(self, layers: tuple[Layer, ...]) -> bool:
        """Whether one of the layers whose slices are known has highlights too sharp for the points' spacing."""
        return self.lobe(layers) < SHARP

    def lobe(self, layers: tuple[Layer, ...]) -> float:
        """Steradians of the sharpest lobe of layers whose slices are known, see `Slices.lobe`; infinite for none."""
        return min((self._slices[layer].lobe for layer in layers if layer in self._slices), default=math.inf)

    def albedo(self, term: Term) -> NDArray[np.float64]:
        """Equivalent albedo of a term (3,), without its maps."""
        if term.reflectance is not None:
            return np.pi * np.array(term.reflectance)
        known = (self._slices[layer].albedo for layer in term.layers if layer in self._slices)
        return sum(known, start=np.zeros(3))

    def albedos(self, scene: Scene) -> NDArray[np.float32]:
        """Equivalent albedos of all objects (M, 3), with the means of their maps."""
        albedos = np.zeros((len(scene.smooth), 3))
        for term in self.terms:
            albedos[term.i_object] += self.albedo(term) * self._mean_factor(scene, term)
        return albedos.astype(np.float32)

    def blunt_terms(self, scene: Scene) -> list[GlossyTerm]:
        """The terms of blunt gloss whose slices are known, with the means of their maps."""
        found = []
        for term in self.terms:
            is_blunt = term.reflectance is None and not self.is_sharp(term.layers)
            if is_blunt and (tables := self.tables(term.layers)) is not None:
                albedo, factor = self.albedo(term), np.broadcast_to(self._mean_factor(scene, term), 3)
                found.append(GlossyTerm(term.i_object, tables, albedo.astype(np.float32), factor.astype(np.float32)))
        return found

    def _mean_factor(self, scene: Scene, term: Term) -> NDArray[np.floating]:
        """Mean factor of a term's maps over its object, (3,); cached while its files stay the same."""
        i_object, maps = term.i_object, term.layers[0].maps
        if maps.is_plain:
            return np.ones(3)
        textures = tuple(map(scene.textures.texture, maps.images.textures))
        key = i_object, maps, textures, scene.textures.weight(maps.images)
        if key not in self._means:
            self._means = {other: mean for other, mean in self._means.items() if other[1] in self._all_maps}
            self._means[key] = mean_factor(scene, i_object, maps)
        return self._means[key]

    @property
    def _all_maps(self) -> set[LayerMaps]:
        return {layer.maps for layers in self.layers_of.values() for layer in layers}

    @property
    def _wanted(self) -> list[Layer]:
        """The layers that need slices."""
        return list(self._levels.of)

    @property
    def _rough(self) -> list[Layer]:
        """The layers whose slices are still to be refined."""
        return [layer for layer, level in self._levels.of.items() if level == LEVEL and layer not in self._fine]

    def _take(self, layer: Layer, slices: Slices) -> None:
        self._slices[layer] = slices
        self._tables = {layers: tables for layers, tables in self._tables.items() if layer not in layers}


def _terms(layers_of: Mapping[int, Sequence[Layer]]) -> Iterator[Term]:
    """Group the layers of each object into terms: of each frame all diffuse layers without maps, all glossy ones
    without, and each layer with maps by itself."""
    for i, layers in layers_of.items():
        visible = [layer for layer in layers if layer.visible]
        groups = dict[tuple[Frame, tuple[Layer, ...]], list[Layer]]()
        for layer in visible:
            if layer.maps.is_plain:
                groups.setdefault((layer.frame, _other_covers(layer)), []).append(layer)
        for plain in groups.values():
            glossy = tuple(layer for layer in plain if _diffuse(layer) is None)
            diffuse = [found for layer in plain if (found := _diffuse(layer)) is not None]
            if diffuse:
                red, green, blue = np.sum(diffuse, axis=0)
                yield Term(i, tuple(layer for layer in plain if layer not in glossy), (red, green, blue))
            if glossy:
                yield Term(i, glossy, None)
        yield from (Term(i, (layer,), _diffuse(layer), k) for k, layer in enumerate(visible) if not layer.maps.is_plain)


def _other_covers(layer: Layer) -> tuple[Layer, ...]:
    return tuple(cover for cover in layer.covers if cover.visible and cover.frame != layer.frame)


def _diffuse(layer: Layer) -> tuple[float, float, float] | None:
    found = diffuse_reflectance(layer)
    return None if found is None else (float(found[0]), float(found[1]), float(found[2]))
