"""Deform, kept: one scene whose meshes bend while their own shadows and reflections go along [Sloan05].

    deform = Deform(scene)
    deform.set_light(sky)             what is wanted: costs nothing, and may be said again at any time
    deform.set_layers(layers_of)
    for progress in deform.work():    transfer, unshadowed at once, then roughly, then by all rays, object by object
        ...                           between two pieces anything may be set or drawn
    picture = deform.draw(camera, (512, 384), poses)

What an object's points see of itself turns with them when it bends. What they see of other objects does not: an object
that is to bend has its own shadows alone, those that stay have one another's. Distant light alone is known here. What
the scene's file says of an object's surface (`engine.scene.surface_kinds`) takes the place of its own transfer.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from secrets import randbits
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.deform.details import Detail, detail, shaded
from engine.deform.gloss import LowGloss, add_gloss, low_gloss
from engine.deform.object_transfer import ALBEDO_STEPS, N_LOBES, ORDER, FoundTransfer, ObjectTransfer, Shelf
from engine.deform.parts import LookPart, ShapePart, Told
from engine.deform.pixels import pixels_of
from engine.deform.points import BendingPoints, bending_points
from engine.deform.pose import Poses
from engine.deform.posed_points import PosedPoints
from engine.deform.raster import BLACK, Backdrop, Drawn, draw, paint
from engine.deform.shading import BandLight, Lobes, band_light, shade
from engine.deform.telling import look_part, posed_part, shape_part
from engine.deform.transfer import N_RAYS, unshadowed
from engine.deform.zonal import Zonal, fit
from engine.light.environment import LUMINANCE, triangle_integrals
from engine.material.layer import Layer
from engine.material.maps import Images
from engine.orbit.slices import matt_reflectance
from engine.render.error_colours import shown
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.render.surface_maps import mean_factor
from engine.scene.description import CameraDescription
from engine.scene.load import Scene
from engine.scene.raycaster import RayCaster
from engine.scene.surface_kinds import DeformSurface, SurfacesOf
from engine.sphere.harmonics import project
from engine.steps import finish
from engine.transport.pipeline import SkyState

Singles = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]
Quality = Literal["moving", "rest"]

N_POINTS = 12_000  # besides the meshes' own vertices
N_BOUNCES = 2  # of an object's light onto itself
FEW_RAYS = 128  # of what stands in until there is better
_LIGHT_LEVEL = 5
_numbers = count(1 + randbits(48))  # of parts: another worker's are others


class Deform:
    """A scene of which pictures are drawn in any pose, from anywhere; see above."""

    def __init__(
        self, scene: Scene, n_points: int | None = None, n_rays: int = N_RAYS, shelf: Shelf | None = None,
        caster: RayCaster | None = None,
    ) -> None:  # fmt: skip
        """scene: at rest; n_points: besides the meshes' vertices, None for `N_POINTS`; n_rays: a point; caster: of the
        scene's triangles."""
        self.scene = scene
        self.version = 0
        self._caster = caster or RayCaster(scene.vertices, scene.triangles)
        self._n_points, self._shelf = N_POINTS if n_points is None else n_points, shelf
        self._rays, self._n_lobes = (min(FEW_RAYS, n_rays), n_rays), N_LOBES
        self._points: BendingPoints | None = None
        self._light = SkyState(None)
        self._bands: BandLight | None = None
        self._layers_of: dict[int, tuple[Layer, ...]] = {}
        self._albedos = np.zeros((len(scene.smooth), 3), np.float32)
        self._surfaces: dict[str, DeformSurface] = {}
        self._posed: frozenset[int] = frozenset()
        self._n_bounces = N_BOUNCES
        self._known: dict[int, ObjectTransfer] = {}
        self._found: FoundTransfer | None = None
        self._even: frozenset[int] = frozenset()
        self._job: tuple[ObjectTransfer, Generator[float, None, Zonal]] | None = None
        self._lobes: Lobes | None = None
        self._posed_points: PosedPoints | None = None
        self._errors: Singles | None = None
        self._details: dict[int, Detail] = {}
        self._shape: tuple[Lobes, ShapePart] | None = None
        self._look: tuple[int, LookPart] | None = None
        self._white: tuple[tuple[object, ...], Singles] | None = None

    # ------------------------------------------------------------------------------------------------ what is wanted

    def set_light(self, sky: SkyState) -> None:
        """The distant light from now on."""
        if sky != self._light or self._bands is None:
            self._light, self._bands = sky, band_light_of(sky)
            self.version += 1

    def shine(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Give emitters, by name, this radiance from now on: it is seen, but lights nothing here."""
        scene = self.scene.shining(emission)
        if not np.array_equal(scene.emission, self.scene.emission):
            self.scene = scene
            self.version += 1

    def set_layers(self, layers_of: LayersOf) -> None:
        """The layers of each object, by its index, from now on."""
        layers = {i: tuple(each for each in own if each.visible) for i, own in layers_of.items()}
        layers = {i: own for i, own in layers.items() if not self.scene.emitters[i]}
        if layers != self._layers_of:
            self._layers_of = layers
            self._albedos[:] = 0.0
            for i, own in layers.items():
                self._albedos[i] = sum((_matt(layer) for layer in own if layer.maps.is_plain), np.zeros(3)) * np.pi
            self.version += 1

    def set_posed(self, names: Sequence[str]) -> None:
        """The objects, by name, that bend: they have their own shadows alone, and cast none on others."""
        self._posed = frozenset(self.scene.object_index(each) for each in names if each in self.scene.object_names)

    def set_surfaces(self, surfaces: SurfacesOf) -> None:
        """What is said of the surfaces of objects, by name, from now on, in the place of what the scene's file says.
        Raises LoadError where an image cannot be used."""
        self.scene.textures.load(Images(weight=file) for _, says in surfaces for _, file in says.files)
        self._surfaces = dict(surfaces)

    def set_effort(self, n_rays: int, n_lobes: int) -> None:
        """How many rays go from a point, and how many lobes, 1 to `N_LOBES`, stand for what they found, from now on."""
        self._rays, self._n_lobes = (min(FEW_RAYS, n_rays), n_rays), n_lobes

    def set_bounces(self, n_bounces: int) -> None:
        """How often light is reflected between light and eye from now on."""
        self._n_bounces = min(max(n_bounces - 1, 0), N_BOUNCES)

    # ----------------------------------------------------------------------------------------------------- the work

    @property
    def is_ready(self) -> bool:
        """Whether a picture shows more than black."""
        return self._lobes is not None and self._bands is not None

    @property
    def is_done(self) -> bool:
        """Whether there is no work left."""
        return self._lobes is not None and all(self._known.get(each.i_object) == each for each in self._all())

    @property
    def fraction(self) -> float:
        """How much of the work is done, by points."""
        if self._points is None or not len(self._points):
            return 0.0
        counts = [len(self._points.of(each.i_object)) for each in self._all()]
        shares = [self._share(each) for each in self._all()]
        return float(np.dot(counts, shares) / max(sum(counts), 1))

    @property
    def n_bytes(self) -> int:
        """What points keep."""
        lobes = self._lobes
        return 0 if lobes is None else lobes.low.nbytes + lobes.axes.nbytes + lobes.coefficients.nbytes

    @property
    def lost(self) -> dict[int, float]:
        """The share of the sharpest layer's reflection that is too sharp for this, by object; see `LowGloss.lost`."""
        found = {
            i: [low_gloss(each, ORDER).lost for each in own if _is_glossy(each)] for i, own in self._layers_of.items()
        }
        return {i: max(each) for i, each in found.items() if each}

    def work(self) -> Iterator[StillProgress]:
        """All that is missing, piece by piece; ends where nothing is. What is set meanwhile is taken up at once."""
        if self._points is None or self._even != self._translucent():
            yield StillProgress(0.0, "points")
            self._make_points()
        for layer in [each for own in self._layers_of.values() for each in own if _is_glossy(each)]:
            low_gloss(layer, ORDER)  # kept: no picture waits for it
            yield StillProgress(self.fraction, "reflection")
        while (wanted := self._next()) is not None:
            if self._job is None or self._job[0] != wanted:
                self._job = wanted, self._simulate(wanted)
            try:
                yield StillProgress(self.fraction, "transfer" if next(self._job[1]) < 1.0 else "lobes")
            except StopIteration as end:
                self._job = None
                self._take(wanted, end.value)

    def _translucent(self) -> frozenset[int]:
        """Objects that light goes through: a sum over points that lie unevenly would show where triangles are cut."""
        return frozenset(i for i in range(len(self.scene.smooth)) if self._says(i).subsurface is not None)

    def _make_points(self) -> None:
        """All points, and lobes for them as if nothing shaded them; where there were some before, as near ones had."""
        before, had, errors = self._points, self._lobes, self._errors
        self._even = self._translucent()
        even = np.isin(np.arange(len(self.scene.smooth)), list(self._even))
        points = bending_points(self.scene, self._caster, self._n_points, even)
        self._points, self._found = points, FoundTransfer(self.scene, points, self._shelf)
        self._lobes, self._errors = _open(len(points)), np.zeros(len(points), np.float32)
        if before is not None and had is not None and errors is not None:
            near = points.nearest_of(before)
            self._lobes, self._errors = Lobes(had.low[near], had.axes[near], had.coefficients[near]), errors[near]
            self._known = {i: each for i, each in self._known.items() if points.stands_as(before, i)}
        self._posed_points = PosedPoints(self.scene, points)
        self._white, self._job = None, None
        self.version += 1

    def _all(self) -> list[ObjectTransfer]:
        """The best transfer of all objects that there is to be."""
        resting = tuple(i for i in range(len(self.scene.smooth)) if i not in self._posed)
        found = []
        for i in self._layers_of:
            says = self._says(i)
            casters = (i,) if i in self._posed or says.kind else resting
            albedo = round(float(self._albedos[i] @ LUMINANCE) * ALBEDO_STEPS) if self._n_bounces else 0
            albedo = 0 if says.kind else min(albedo, ALBEDO_STEPS - 1)
            n_bounces = self._n_bounces if albedo else 0
            found.append(ObjectTransfer(i, casters, says, albedo, n_bounces, self._rays[1], self._n_lobes))
        return found

    def _share(self, wanted: ObjectTransfer) -> float:
        known = self._known.get(wanted.i_object)
        return 0.0 if known is None else 1.0 if known == wanted else 0.1

    def _says(self, i: int) -> DeformSurface:
        """What is said of an object's surface."""
        described = self.scene.description.objects[i]
        return self._surfaces.get(described.name, described.deform)

    def _next(self) -> ObjectTransfer | None:
        """What is most urgent: of every object something before of any all; those that rest first, for on them stand
        shadows that have gone."""
        missing = [each for each in self._all() if self._known.get(each.i_object) != each]
        missing.sort(key=lambda each: each.i_object in self._posed)
        for each in missing:
            known = self._known.get(each.i_object)
            is_other = known is None or (known.casters, known.says) != (each.casters, each.says)
            if is_other:
                is_there = self._found is not None and self._found.get(each) is not None
                return each if is_there else replace(each, albedo=0, n_rays=self._rays[0], n_lobes=1)
        return missing[0] if missing else None

    def _simulate(self, wanted: ObjectTransfer) -> Generator[float, None, Zonal]:
        """What was kept of it, or found anew; yields the share of the rays that is done."""
        assert self._points is not None and self._found is not None
        is_final = (wanted.n_rays, wanted.n_lobes) == (self._rays[1], self._n_lobes)
        if is_final and (kept := self._found.get(wanted)) is not None:
            return kept
        zonal = yield from wanted.found(self.scene, self._points)
        if is_final:
            self._found.keep(wanted, zonal)
        return zonal

    def _take(self, wanted: ObjectTransfer, zonal: Zonal) -> None:
        assert self._points is not None and self._lobes is not None and self._errors is not None
        i, says = wanted.i_object, wanted.says
        self._known[i] = wanted
        self.version += 1
        self._details.pop(i, None)
        if says.is_mapped:
            self._details[i] = detail(self.scene, says, zonal)
            return
        mine, n = self._points.of(i), zonal.axes.shape[1]
        self._errors[mine] = zonal.relative_errors
        lobes = Lobes(self._lobes.low.copy(), self._lobes.axes.copy(), self._lobes.coefficients.copy())
        lobes.low[mine], lobes.axes[mine, :n], lobes.coefficients[mine] = zonal.low, zonal.axes, 0.0
        lobes.coefficients[mine, :n] = zonal.coefficients
        self._lobes = lobes

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (), quality: Quality = "moving",
        turned: bool = True,
    ) -> Singles:  # fmt: skip
        """Radiance (H, W, 3) as it is known by now; resolution (width, height). "rest": four samples a pixel. turned:
        whether transfer turns with the surface; False shows what one would get if it did not.

        Raises ValueError before `is_ready`.
        """
        if self._points is None or self._posed_points is None or self._lobes is None or self._bands is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        eye, fine = self._eye(camera), 2 if quality == "rest" else 1
        places, frames = self._posed_points.at(poses)
        white = self._shaded(poses, frames if turned else self._points.resting_frames)
        gloss = self._gloss(places, frames, eye, white)
        size = (resolution[0] * fine, resolution[1] * fine)
        drawn = draw(self._points.surface, places, camera, eye, size)
        albedos = self._albedos.copy()
        albedos[list(self._details)] = 0.0
        picture = paint(drawn, self._points.surface, white, gloss, albedos, self.scene.emission, self._backdrop())
        for i, own in self._layers_of.items():
            if i in self._details or any(not each.maps.is_plain for each in own):
                self._add_by_pixel(i, drawn, white, picture)
        return _halved(picture) if fine == 2 else picture

    def draw_errors(self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = ()) -> Singles:
        """How far the lobes of what is seen are off the transfer they were fitted to (H, W, 3): see `error_colours`.
        Raises ValueError before `is_ready`."""
        if self._points is None or self._posed_points is None or self._errors is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        drawn = draw(self._points.surface, self._posed_points.at(poses)[0], camera, self._eye(camera), resolution)
        errors = np.repeat(shown(self._errors).astype(np.float32)[:, None], 3, axis=1)
        one = np.ones_like(self._albedos)
        picture = paint(drawn, self._points.surface, errors, np.zeros_like(errors), one, np.zeros_like(one))
        for i, found in self._details.items():
            if (pixels := pixels_of(i, drawn, self._points)) is not None:
                of_pixels = shown(found.errors_at(pixels.uvs(self.scene))).astype(np.float32)
                picture[pixels.rows, pixels.columns] = of_pixels[:, None]
        return picture

    def told(self, camera: CameraDescription, poses: Poses, known: tuple[int, int] = (0, 0)) -> Told | None:
        """What a graphics card draws the same picture of, but for parts whose numbers are known; None where images or
        detail lie on what is seen. Raises ValueError before `is_ready`."""
        if self._points is None or self._posed_points is None or self._lobes is None or self._bands is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        layers = [each for own in self._layers_of.values() for each in own]
        if self._details or any(not each.maps.is_plain for each in layers):
            return None
        places, frames = self._posed_points.at(poses)
        if self._shape is None or self._shape[0] is not self._lobes:
            self._shape = self._lobes, shape_part(next(_numbers), self._points, self._lobes)
        if self._look is None or self._look[0] != self.version:
            glosses = {i: list(self._glosses_of(i)) for i in self._layers_of}
            made = look_part(
                next(_numbers), self._bands, self._albedos, self.scene.emission, glosses, self._backdrop()
            )  # fmt: skip
            self._look = self.version, made
        posed, shape, look = posed_part(places, frames, self._eye(camera)), self._shape[1], self._look[1]
        is_known = shape.number == known[0], look.number == known[1]
        return Told(posed, None if is_known[0] else shape, None if is_known[1] else look)

    def carried(self, poses: Poses) -> dict[str, tuple[float, float, float]]:
        """How far animations have carried the objects in these poses, by name: x, y, z."""
        return {} if self._posed_points is None else self._posed_points.carried(poses)

    def _eye(self, camera: CameraDescription) -> NDArray[np.float64]:
        return np.subtract(camera.position, self.scene.origin).astype(np.float64)

    def _backdrop(self) -> Backdrop:
        environment, turn = self._light.environment, math.radians(self._light.rotation % 360.0)
        return BLACK if environment is None else Backdrop(environment.radiance, turn, self._light.scale)

    def _glosses_of(self, i: int) -> Iterator[tuple[LowGloss, NDArray[np.floating]]]:
        """Of an object's layers that are not matt, and by what images multiply them on average (3,)."""
        for layer in filter(_is_glossy, self._layers_of[i]):
            yield low_gloss(layer, ORDER), mean_factor(self.scene, i, layer.maps)

    def _shaded(self, poses: Poses, frames: Singles) -> Singles:
        """What white matt points send (S, 3)."""
        assert self._points is not None and self._lobes is not None and self._bands is not None
        made_of = (poses, frames is self._points.frames, self._lobes, self._bands)
        if self._white is None or self._white[0] != made_of:
            self._white = made_of, np.maximum(shade(self._lobes, frames, self._bands), np.float32(0.0))
        return self._white[1]

    def _gloss(self, places: Singles, frames: Singles, eye: NDArray[np.float64], white: Singles) -> Singles:
        """What points send to the eye of layers that are not matt (S, 3)."""
        assert self._points is not None and self._bands is not None
        sent = np.zeros_like(white)
        normals = np.ascontiguousarray(frames[:, 2])
        for i in self._layers_of:
            for low, factor in self._glosses_of(i):
                add_gloss(low, factor, self._points.of(i), places, normals, eye, self._bands, white, sent)
        return sent

    def _add_by_pixel(self, i: int, drawn: Drawn, white: Singles, picture: Singles) -> None:
        """Add matt layers that images lie on, or all where there is detail on the object."""
        assert self._points is not None and self._posed_points is not None
        pixels, own = pixels_of(i, drawn, self._points), self._layers_of[i]
        if pixels is None:
            return
        if i in self._details and self._bands is not None:
            axes = self._posed_points.axes_of(i)[pixels.triangle]
            uvs = pixels.uvs(self.scene)
            matt = shaded(self._details[i], uvs, axes, pixels.weights, pixels.is_front, self._bands)
        else:
            matt = np.einsum("nk,nki->ni", pixels.weights, white[pixels.points])
        matt = matt * (pixels.points[:, :1] >= 0)
        n = len(pixels.rows)
        factors = MapFactors(self.scene, {i: own}).of_hits(pixels.at, np.full(n, i), np.arange(n))
        for k, layer in enumerate(own):
            if _is_glossy(layer) or layer.maps.is_plain and i not in self._details:
                continue
            factor = 1.0 if layer.maps.is_plain else factors[:, k]
            picture[pixels.rows, pixels.columns] += np.maximum(matt * factor * (np.pi * _matt(layer)), 0.0)


def _open(n_points: int) -> Lobes:
    """Of points that see all that is above them."""
    one = finish(fit(unshadowed(1, ORDER), 1))
    low, axes = np.repeat(one.low, n_points, axis=0), np.zeros((n_points, N_LOBES, 3))
    axes[:, :, 2] = 1.0
    axes[:, 0] = one.axes[0, 0]
    coefficients = np.zeros((n_points, N_LOBES, ORDER))
    coefficients[:, 0] = one.coefficients[0, 0]
    return Lobes(low.astype(np.float32), axes.astype(np.float32), coefficients.astype(np.float32))


def band_light_of(sky: SkyState) -> BandLight:
    """A sky in as many bands as transfer has."""
    if sky.environment is None:
        return band_light(np.zeros((ORDER * ORDER, 3)))
    powers = triangle_integrals(sky.environment, sky.rotation, _LIGHT_LEVEL) * sky.scale
    return band_light(project(powers, ORDER))


def _is_glossy(layer: Layer) -> bool:
    return matt_reflectance(layer) is None


def _matt(layer: Layer) -> NDArray[np.float64]:
    """The reflectance (3,) of a layer that is matt, 0 of any other."""
    found = matt_reflectance(layer)
    return np.zeros(3) if found is None else found


def _halved(picture: Singles) -> Singles:
    """With half as many pixels a side."""
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    return np.asarray(picture.reshape(height, 2, width, 2, 3).mean(axis=(1, 3)), np.float32)


def finished(deform: Deform) -> Deform:
    """With all its work done."""
    finish(_told(deform))
    return deform


def _told(deform: Deform) -> Generator[StillProgress, None, None]:
    yield from deform.work()
