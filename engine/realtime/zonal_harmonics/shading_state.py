"""What pictures of Deform are made of: a scene in some light, with the lobes of its points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.raster import BLACK, Backdrop
from engine.realtime.core.terms import LayersOf, diffuse_albedo, is_glossy
from engine.realtime.zonal_harmonics.gloss_rows import GlossBasis
from engine.realtime.zonal_harmonics.gloss_transfer import LayerGloss
from engine.realtime.zonal_harmonics.lamp_gloss import LampLight
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.scene_lamps import Lamp
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes, LowGloss, low_gloss
from engine.realtime.zonal_harmonics.sun_lights import SkyLight
from engine.realtime.zonal_harmonics.surface_details import Detail
from engine.scene.map_sampler import mean_factor
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


class LampRays(NamedTuple):
    """What rays have found of a lamp of emission 1, at the points of objects at rest: radiance (S, 3) of white ones,
    and the share (S,) of its light that arrives; 0 at those of other objects."""

    objects: frozenset[int]
    radiance: Float32Array
    share: Float32Array


@dataclass(frozen=True, eq=False)
class ShadingState:
    """A scene in some light: the visible layers of its objects by index, lobes of all points and errors (S,) of their
    fit, details of the objects that have any; casters: for each object the other bending objects, and lamps, whose
    shadows its transfer does not contain. alone: the objects whose transfer contains only themselves. lights: of those
    of them, by index, that have other distant light than the sky, and distant: its harmonics (n^2, 3); mirrored: what
    gloss mirrors of it in bands; sun_lights: the suns of those that are opaque, which it mirrors by its BRDF. added
    (S, 3): radiance of white points by neighbours, None for none.

    emitters: the L objects that are lamps, by index, and lamps: what these are in the placements, in which scene has
    them as well; by_rays: what rays have found of them, None for none; is_plain: points see all that is above them;
    lamp_reach (M, L): which objects each lights; shares_left: by object that is alone and number of a lamp the share of
    its light that others leave; far_lamps: by such an object the numbers of those that are a part of its distant light,
    and unlit: that light without them.

    gloss: how glossy layers, by object, are drawn; the others are one lobe each. linked: the sky of the objects, by
    index, that not all distant light reaches. version: differs for different pictures."""

    version: int
    scene: Scene
    light: SkyState
    sky: SkyLight
    layers_of: LayersOf
    lobes: Lobes
    errors: Float32Array
    details: Mapping[int, Detail]
    casters: tuple[frozenset[int], ...] = ()
    opaque: frozenset[int] = frozenset()
    alone: frozenset[int] = frozenset()
    lights: Mapping[int, BandLight] = field(default_factory=dict)
    distant: Mapping[int, Float64Array] = field(default_factory=dict)
    mirrored: Mapping[int, BandLight] = field(default_factory=dict)
    sun_lights: Mapping[int, Sequence[LampLight]] = field(default_factory=dict)
    added: Float32Array | None = None
    emitters: tuple[int, ...] = ()
    lamps: tuple[Lamp, ...] = ()
    placements: Poses = ()
    is_plain: bool = False
    by_rays: tuple[LampRays | None, ...] = ()
    lamp_reach: NDArray[np.bool_] | None = None
    shares_left: Mapping[tuple[int, int], float] = field(default_factory=dict)
    far_lamps: Mapping[int, Mapping[int, LampLight]] = field(default_factory=dict)
    unlit: Mapping[int, BandLight] = field(default_factory=dict)
    gloss: Mapping[tuple[int, Layer], LayerGloss] = field(default_factory=dict)
    linked: Mapping[int, SkyLight] = field(default_factory=dict)

    def is_opaque(self, i: int) -> bool:
        """Whether what an object's lobes contain is a cosine with shadows and reflections."""
        return i in self.opaque

    def reaches(self, k: int, i: int) -> bool:
        """Whether lamp number k lights an object."""
        return self.lamp_reach is None or bool(self.lamp_reach[i, k])

    def lamps_of(self, i: int) -> Iterator[int]:
        """The numbers of the lamps that light the points of an object from where they are."""
        for k, lamp in enumerate(self.lamps if i not in self.details else ()):
            if (
                lamp.emission.any()
                and self.reaches(k, i)
                and self.emitters[k] != i
                and k not in self.far_lamps.get(i, ())
            ):
                yield k

    @property
    def shining(self) -> tuple[int, ...]:
        """The emitters that are lamps and no more: they do not reflect light."""
        return tuple(i for i in self.emitters if not self.scene.reflecting[i])

    @property
    def rayed(self) -> tuple[int, ...]:
        """The objects that are alone and get the light of lamps by rays in pictures at rest."""
        return () if self.is_plain else tuple(sorted(self.alone & self.opaque & self.layers_of.keys()))

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
                found[i] = sum((diffuse_albedo(each) for each in own if each.maps.is_plain), np.zeros(3))
        return found

    @property
    def even_emission(self) -> Float32Array:
        """Emission of objects (M, 3) where it has no texture, which is added pixel by pixel; else 0."""
        found = self.scene.emission.copy()
        found[list(self.scene.emission_textures.tinted)] = 0.0
        return found

    @property
    def backdrop(self) -> Backdrop:
        environment, turn = self.light.environment, math.radians(self.light.rotation % 360.0)
        return BLACK if environment is None else Backdrop(environment.radiance, turn, self.light.scale)

    def pixel_layers(self, i: int) -> Iterator[Layer]:
        """The layers of an object that are shaded pixel by pixel: diffuse ones with images, or all if it has
        detail."""
        for layer in self.layers_of.get(i, ()):
            if i in self.details or not is_glossy(layer) and not layer.maps.is_plain:
                yield layer

    def glosses_of(self, i: int) -> Iterator[tuple[LowGloss, NDArray[np.floating]]]:
        """An object's glossy layers that are one lobe at each point, with the mean factor of their images (3,)."""
        for layer in filter(is_glossy, self.layers_of.get(i, ()) if i not in self.details else ()):
            if self._rows_of(i, layer) is None:
                yield low_gloss(layer, self.order), mean_factor(self.scene, i, layer.maps)

    def rows_of(self, i: int) -> Iterator[tuple[Lobes, Float32Array]]:
        """Rows of an object's layers that are drawn by rows, with their weights by the view (D, D, K, 3), times the
        mean factor of the layer's images."""
        for layer in filter(is_glossy, self.layers_of.get(i, ())):
            if (found := self._rows_of(i, layer)) is not None:
                lobes, basis = found
                yield lobes, basis.views * np.asarray(mean_factor(self.scene, i, layer.maps), np.float32)

    def _rows_of(self, i: int, layer: Layer) -> tuple[Lobes, GlossBasis] | None:
        found = self.gloss.get((i, layer))
        return found.rows if found is not None and i not in self.details else None

    def sky_of(self, i: int) -> SkyLight:
        """The distant light that reaches an object."""
        return self.linked.get(i, self.sky)

    @cached_property
    def skies(self) -> tuple[SkyLight, ...]:
        """All of these, the scene's first."""
        return tuple(dict.fromkeys((self.sky, *self.linked.values())))

    def is_under(self, sky: SkyLight) -> NDArray[np.bool_]:
        """Whether a sky is that of each object (M,)."""
        return np.array([self.sky_of(i) is sky for i in range(len(self.scene.smooth))], bool)

    def light_of(self, i: int) -> BandLight:
        """The light that comes to an object as if from afar."""
        return self.lights.get(i, self.sky_of(i).bands)

    def mirrored_light(self, i: int) -> BandLight:
        """The part of it that gloss mirrors in bands: without the lamps and suns that the BRDF mirrors."""
        if i in self.lights or i in self.details:
            return self.mirrored.get(i, self.light_of(i))
        return self.sky_of(i).dull_bands

    @property
    def mirrored_lamps(self) -> tuple[Lamp, ...]:
        """What the BRDF mirrors: lamps, then the suns of each sky."""
        return (*self.lamps, *chain.from_iterable(sky.lamps for sky in self.skies))

    def suns_at(self, i: int) -> Sequence[LampLight]:
        """The suns that reach an object, where its gloss mirrors them by its BRDF."""
        return self.sun_lights.get(i, ()) if i in self.lights else self.sky_of(i).sun_lights

    def suns_of(self, i: int) -> range:
        """The numbers among them of the suns of an object's sky."""
        skies = self.skies
        own = skies.index(self.sky_of(i))
        first = len(self.lamps) + sum(len(sky.lamps) for sky in skies[:own])
        return range(first, first + len(skies[own].lamps))

    @property
    def order(self) -> int:
        """Number of bands of light."""
        return self.sky.bands.table.shape[2]
