"""The transfer of one object of a scene: what it depends on, and how it is computed.

It depends on the albedos with which the object's points reflect light onto the object itself, images and strokes
included. These are quantized so coarsely that most edits of a material do not invalidate the transfer. Light between
points is colourless, like all transfer: an albedo is its luminance.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import map_steps
from engine.material.layer import Layer
from engine.material.layer_maps import Images
from engine.realtime.core.terms import diffuse_albedo, is_glossy, map_factor
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.shading import low_gloss
from engine.realtime.zonal_harmonics.surface_details import (
    detail_normals,
    heights,
    n_texels,
    patch_vectors,
    slab_of,
    wrinkle_lobes,
)
from engine.realtime.zonal_harmonics.transfer import Medium, add_bounces, simulate_shadows, simulate_subsurface
from engine.realtime.zonal_harmonics.zonal import Zonal, fit, fit_linear_lobe, membrane, unshadowed_lobes
from engine.scene.scene_loader import Scene
from engine.scene.surface_kinds import DeformSurface, Membrane
from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

ORDER, N_LOBES, UNSHADOWED = 6, 4, 0
ALBEDO_STEPS = 8  # for the brightest point
SHARE_STEPS = 15  # for the others, relative to it


@dataclass(frozen=True)
class ObjectTransfer:
    """Description of one object's transfer: the object; the objects that shade its points; its surface; its points'
    reflectance and the number of bounces on the object itself; rays and lobes of each point, `UNSHADOWED` for light
    without shadows and reflections."""

    i_object: int
    casters: tuple[int, ...]
    surface: DeformSurface
    reflectance: Reflectance
    n_bounces: int
    n_rays: int
    n_lobes: int

    @property
    def is_worth_storing(self) -> bool:
        """Whether computing it takes longer than reading it; a membrane's map may also change while the cache stays."""
        return self.surface.membrane is None and self.n_lobes != UNSHADOWED

    @property
    def can_have_gloss_rows(self) -> bool:
        """Whether gloss on it may have shadows of its own: not on detail, which shades itself pixel by pixel, nor on
        membranes, which shade nothing."""
        return self.n_lobes != UNSHADOWED and not self.surface.is_mapped and self.surface.membrane is None

    def dependencies(self, scene: Scene, points: BendingPoints) -> tuple[object, ...]:
        """Everything that it depends on."""
        surface = self.surface
        bright = (self.reflectance.brightest, self.n_bounces, *filter(None, (self.reflectance.shares,)))
        if surface.wrinkles is not None:  # one map for all depths
            return "wrinkles 3", *bright
        if surface.patch is not None:
            slab = repr(slab_of(surface.patch)) if surface.patch.thickness else ""
            return "patch 2", self.n_rays, self.n_lobes, heights(scene, surface.patch), *bright, slab
        own = (surface.model_dump_json(),) if surface.kind else bright
        lobes = () if self.n_lobes == N_LOBES else (self.n_lobes,)
        return *points.geometry(self.i_object, self.casters), *own, self.n_rays, *lobes

    def n_places(self, scene: Scene, points: BendingPoints) -> int:
        """Number of places it is computed at: the object's points, or a map's texels."""
        if self.surface.is_mapped:
            return n_texels(scene, self.surface)
        return len(points.points_of(self.i_object))

    def compute(self, scene: Scene, points: BendingPoints) -> Generator[float, None, Zonal]:
        """Compute transfer by rays, where needed, and fit lobes. Yields the share of the rays that is done."""
        surface = self.surface
        if surface.membrane is not None:
            return _membrane_lobes(scene, points, self.i_object, surface.membrane)
        if self.n_lobes == UNSHADOWED:
            upright = np.tile([0.0, 0.0, 1.0], (len(points.points_of(self.i_object)), 1))
            return unshadowed_lobes(detail_normals(scene, surface) if surface.is_mapped else upright, ORDER)
        if surface.wrinkles is not None:
            return (yield from wrinkle_lobes(ORDER, float(self.reflectance.albedo), self.n_bounces))
        vectors = yield from self._vectors(scene, points)
        if self.n_lobes == 1:  # it will soon be replaced
            return fit_linear_lobe(vectors)
        return (yield from map_steps(fit(vectors, self.n_lobes), lambda _: 1.0))

    def _vectors(self, scene: Scene, points: BendingPoints) -> Generator[float, None, NDArray[np.float64]]:
        """Vectors of the object's points or of a patch's texels (P, n^2)."""
        if self.surface.patch is not None:
            bounces = float(self.reflectance.albedo), self.n_bounces
            return (yield from patch_vectors(scene, self.surface.patch, ORDER, *bounces, self.n_rays))
        mesh, caster = points.mesh(self.i_object, self.casters), points.caster(self.casters)
        if self.surface.subsurface is not None:
            medium, own = Medium(**self.surface.values), mesh.corners[mesh.corners[:, 0] >= 0]
            return (yield from simulate_subsurface(mesh, caster, own, ORDER, medium, self.n_rays))
        vectors = yield from simulate_shadows(mesh, caster, ORDER, self.n_rays)
        if self.reflectance.brightest and self.n_bounces:
            albedo = self.reflectance.albedo
            vectors = yield from map_steps(
                add_bounces(mesh, caster, vectors, albedo, self.n_bounces), lambda share: 0.99
            )
        return vectors


class TransferStore(Protocol):
    """Stores fitted transfer by everything that it depends on. `get` returns transfer of the requested number of
    places."""

    def get(self, made_of: tuple[object, ...], n_places: int) -> Zonal | None: ...

    def put(self, made_of: tuple[object, ...], zonal: Zonal) -> None: ...


class TransferCache:
    """Caches the transfer of a scene's objects: the last two of each in memory, because a bent object returns to rest,
    and all of them in the store."""

    def __init__(self, scene: Scene, points: BendingPoints, store: TransferStore | None) -> None:
        self._scene, self._points, self._store = scene, points, store
        self._at_hand: dict[ObjectTransfer, Zonal] = {}
        self._loaded: dict[int, ObjectTransfer] = {}  # the last look-up of each object, which is not repeated

    def get(self, wanted: ObjectTransfer) -> Zonal | None:
        if wanted in self._at_hand or self._loaded.get(wanted.i_object) == wanted:
            return self._at_hand.get(wanted)
        self._loaded[wanted.i_object] = wanted
        if self._store is not None and wanted.is_worth_storing:
            made_of = wanted.dependencies(self._scene, self._points)
            found = self._store.get(made_of, wanted.n_places(self._scene, self._points))
            if found is not None:
                self._hold_recent(wanted, found)
        return self._at_hand.get(wanted)

    def put(self, wanted: ObjectTransfer, zonal: Zonal) -> None:
        self._hold_recent(wanted, zonal)
        if self._store is not None and wanted.is_worth_storing:
            self._store.put(wanted.dependencies(self._scene, self._points), zonal)

    def _hold_recent(self, wanted: ObjectTransfer, zonal: Zonal) -> None:
        for other in [each for each in self._at_hand if each.i_object == wanted.i_object][:-1]:
            del self._at_hand[other]
        self._at_hand[wanted] = zonal


def _membrane_lobes(scene: Scene, points: BendingPoints, i: int, surface: Membrane) -> Zonal:
    """Lobes of an object's points: by the membrane's thickness and what it is of, or by its translucency alone."""
    if not surface.thickness:
        return membrane(_translucency(scene, points, i, surface.translucency), ORDER)
    medium = Medium(surface.scattering, surface.absorption, surface.ior)
    reflected, transmitted = medium.slab_shares(surface.thickness)
    return membrane(np.full(len(points.points_of(i)), transmitted), ORDER, reflected)


def _translucency(scene: Scene, points: BendingPoints, i: int, surface: float | str) -> NDArray[np.float64]:
    """Translucency of an object's points (P,), 0 to 1."""
    if not isinstance(surface, str):
        return np.full(len(points.points_of(i)), surface)
    image = scene.textures.weight(Images(weight=surface))
    assert image is not None
    return np.clip(image.at(points.uvs(i))[:, 0].astype(np.float64), 0.0, 1.0)


@dataclass(frozen=True)
class Reflectance:
    """brightest: the largest albedo of an object's points, in `ALBEDO_STEPS`; shares: each point's share of it, in
    `SHARE_STEPS`; empty if all are equal."""

    brightest: int = 0
    shares: bytes = b""

    @property
    def albedo(self) -> Float64Array:
        """Albedo of the points (P,), or of all of them ()."""
        shares = np.frombuffer(self.shares, np.uint8) / SHARE_STEPS if self.shares else np.ones(())
        return np.asarray(self.brightest / ALBEDO_STEPS * shares)

    @property
    def average(self) -> Reflectance:
        """One albedo for all points: their mean."""
        return reflectance(np.atleast_1d(self.albedo.mean()))


def reflectance(albedo: Float64Array) -> Reflectance:
    """Quantize the albedos of points (P,), which are below 1."""
    most = float(albedo.max(initial=0.0))
    brightest = min(round(most * ALBEDO_STEPS), ALBEDO_STEPS - 1)
    if not brightest:
        return Reflectance()
    shares = np.rint(albedo / most * SHARE_STEPS).astype(np.uint8)
    return Reflectance(brightest, b"" if (shares == SHARE_STEPS).all() else shares.tobytes())


def albedos(scene: Scene, points: BendingPoints, i_object: int, layers: Sequence[Layer], order: int) -> Float64Array:
    """Albedos of an object's points (P, 3), gloss taken as diffuse: the mean over the triangles around each, because an
    image may be finer than the points. order: of the approximation of gloss. Raises LoadError."""
    middles, uvs, sides = points.middles(i_object)
    total, across, down = np.zeros((len(uvs), 3)), np.zeros_like(uvs), np.zeros_like(uvs)
    across[:, ::2] = down[:, 1::2] = sides

    def sample(image: Pyramid, repeats: tuple[float, float]) -> Float32Array:
        return image.over(uvs, across, down, repeats=repeats)

    for layer in layers:
        factor = map_factor(scene, layer.maps, len(sides), sample, lambda: middles)
        own = low_gloss(layer, order).albedo if is_glossy(layer) else diffuse_albedo(layer)
        total += factor * own
    return np.stack([points.means_around(i_object, each) for each in total.T], axis=1)
