"""All that pictures of bending meshes are drawn of, as it is known by now."""

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
    """A scene in some light: the visible layers of its objects by their index, lobes of all points and errors (S,) of
    their fit, details of the objects that have any; casters: for each object the others that bend and whose shadows its
    transfer does not have. version: another one looks otherwise."""

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
        """The C objects that shade others from somewhere else than where transfer has them."""
        return sorted(frozenset[int]().union(*self.casters))

    @property
    def casts(self) -> NDArray[np.bool_]:
        """Whether the shadow of each of these is to be on an object (M, C)."""
        shading = self.casting_objects
        found = np.array([[each in casters for each in shading] for casters in self.casters], bool)
        return found.reshape(len(self.scene.smooth), len(shading))

    @property
    def albedos(self) -> Float32Array:
        """What objects (M, 3) make of the matt light of their points; that of detail, and of what images lie on, is
        added pixel by pixel."""
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
        """The matt layers of an object whose light is known of no point: those that images lie on, of detail all."""
        for layer in self.layers_of.get(i, ()):
            if not is_glossy(layer) and (i in self.details or not layer.maps.is_plain):
                yield layer

    def glosses_of(self, i: int) -> Iterator[tuple[LowGloss, NDArray[np.floating]]]:
        """Of an object's layers that are not matt, and by what images multiply them on average (3,)."""
        for layer in filter(is_glossy, self.layers_of.get(i, ())):
            yield low_gloss(layer, self.bands.table.shape[2]), mean_factor(self.scene, i, layer.maps)


def diffuse_albedo(layers: Sequence[Layer]) -> NDArray[np.float64]:
    """Of the matt ones without images, together (3,)."""
    return sum((albedo(each) for each in layers if each.maps.is_plain), np.zeros(3))


def albedo(layer: Layer) -> NDArray[np.float64]:
    """Of a layer that is matt (3,), 0 of any other."""
    found = _reflectance(layer)
    return np.zeros(3) if found is None else found * np.pi


def is_glossy(layer: Layer) -> bool:
    return _reflectance(layer) is None


_reflectance = lru_cache(maxsize=256)(diffuse_reflectance)  # which every picture asks for
