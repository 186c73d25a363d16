"""A snapshot of everything that pictures of bending meshes use."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product.slices import diffuse_reflectance
from engine.realtime.zonal_harmonics.gloss import LowGloss, low_gloss
from engine.realtime.zonal_harmonics.raster import BLACK, Backdrop
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes
from engine.realtime.zonal_harmonics.surface_details import Detail
from engine.render.map_sampler import mean_factor
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]


@dataclass(frozen=True, eq=False)
class ShadingState:
    """A scene in some light: the visible layers of its objects by index, lobes of all points and errors (S,) of their
    fit, details of the objects that have any; casters: for each object the other bending objects whose shadows its
    transfer does not contain. version: differs for different pictures."""

    version: int
    scene: Scene
    light: SkyState
    bands: BandLight
    layers_of: LayersOf
    lobes: Lobes
    errors: Float32Array
    details: Mapping[int, Detail]
    casters: tuple[frozenset[int], ...] = ()

    @property
    def casting_objects(self) -> list[int]:
        """The C objects whose current shadows differ from those in some object's transfer."""
        return sorted(frozenset[int]().union(*self.casters))

    @property
    def casts(self) -> NDArray[np.bool_]:
        """Whether each of these casts a shadow on an object (M, C)."""
        shading = self.casting_objects
        found = np.array([[each in casters for each in shading] for casters in self.casters], bool)
        return found.reshape(len(self.scene.smooth), len(shading))

    @property
    def albedos(self) -> Float32Array:
        """Albedos of objects (M, 3) for the diffuse light of their points; layers with detail or images are added pixel
        by pixel."""
        found = np.zeros((len(self.scene.smooth), 3), np.float32)
        for i, own in self.layers_of.items():
            if i not in self.details:
                found[i] = diffuse_albedo(own)
        return found

    @property
    def backdrop(self) -> Backdrop:
        environment, turn = self.light.environment, math.radians(self.light.rotation % 360.0)
        return BLACK if environment is None else Backdrop(environment.radiance, turn, self.light.scale)

    def pixel_layers(self, i: int) -> Iterator[Layer]:
        """The diffuse layers of an object that are shaded pixel by pixel: those with images, or all if it has
        detail."""
        for layer in self.layers_of.get(i, ()):
            if not is_glossy(layer) and (i in self.details or not layer.maps.is_plain):
                yield layer

    def glosses_of(self, i: int) -> Iterator[tuple[LowGloss, NDArray[np.floating]]]:
        """An object's glossy layers, with the mean factor of their images (3,)."""
        for layer in filter(is_glossy, self.layers_of.get(i, ())):
            yield low_gloss(layer, self.bands.table.shape[2]), mean_factor(self.scene, i, layer.maps)


def diffuse_albedo(layers: Sequence[Layer]) -> NDArray[np.float64]:
    """Sum of the diffuse albedos without images (3,)."""
    return sum((albedo(each) for each in layers if each.maps.is_plain), np.zeros(3))


def albedo(layer: Layer) -> NDArray[np.float64]:
    """Albedo of a diffuse layer (3,), 0 for any other."""
    found = _reflectance(layer)
    return np.zeros(3) if found is None else found * np.pi


def is_glossy(layer: Layer) -> bool:
    return _reflectance(layer) is None


_reflectance = lru_cache(maxsize=256)(diffuse_reflectance)  # every picture needs it
