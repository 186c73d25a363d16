"""Deform, kept: one scene whose meshes bend while their own shadows and reflections go along [Sloan05].

    deform = Deform(scene)
    deform.set_light(sky)             what is wanted: costs nothing, and may be said again at any time
    deform.set_layers(layers_of)
    for progress in deform.work():    transfer, unshadowed at once, then by few rays, then by all, object by object
        ...                           between two pieces anything may be set or drawn
    picture = deform.draw(camera, (512, 384), poses)

What an object's points see of itself turns with them when it bends. What they see of other objects does not: an object
that is to bend has its own shadows alone, those that stay have one another's. Distant light alone is known here. What
the scene's file says of an object's surface (`engine.scene.surface_kinds`) takes the place of its own transfer.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from engine.deform.details import Detail, detail, heights, shaded, simulated, surface_axes
from engine.deform.gloss import add_gloss, low_gloss
from engine.deform.membrane import membrane
from engine.deform.points import BendingPoints, bending_points
from engine.deform.pose import Pose, Poses, Row, deformed
from engine.deform.posed_scene import at_moment, deformers
from engine.deform.raster import BLACK, Backdrop, Drawn, draw, paint
from engine.deform.shading import BandLight, Lobes, band_light, shade
from engine.deform.subsurface import Medium, simulate_subsurface
from engine.deform.transfer import N_RAYS, bounced, shadowed, unshadowed
from engine.deform.zonal import Zonal, fit
from engine.light.environment import LUMINANCE, triangle_integrals
from engine.material.layer import Layer
from engine.material.maps import Images
from engine.orbit.slices import matt_reflectance
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.render.surface_maps import mean_factor
from engine.scene.description import CameraDescription
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.surface_kinds import DeformSurface
from engine.scene.surface_uvs import uvs_at
from engine.sphere.harmonics import project
from engine.steps import finish, told_as
from engine.transport.pipeline import SkyState

Singles = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]
Quality = Literal["moving", "rest"]

ORDER, N_LOBES = 6, 4
N_POINTS = 12_000  # besides the meshes' own vertices
N_BOUNCES = 2  # of an object's light onto itself
FEW_RAYS = 256
_LIGHT_LEVEL = 5
_ALBEDO_STEPS = 8  # in which albedos count for what an object reflects onto itself


class Shelf(Protocol):
    """Where fitted transfer is kept, by all that it hangs on."""

    def get(self, made_of: tuple[object, ...]) -> Zonal | None: ...

    def put(self, made_of: tuple[object, ...], zonal: Zonal) -> None: ...


@dataclass(frozen=True)
class _Wanted:
    """The transfer of an object: the objects that shade its points, its albedo in steps, rays a point."""

    i_object: int
    casters: tuple[int, ...]
    albedo: int
    n_rays: int


class Deform:
    """A scene of which pictures are drawn in any pose, from anywhere; see above."""

    def __init__(
        self, scene: Scene, n_points: int = N_POINTS, n_rays: int = N_RAYS, shelf: Shelf | None = None,
        caster: RayCaster | None = None,
    ) -> None:  # fmt: skip
        """scene: at rest; n_points: besides the meshes' vertices; n_rays: a point; caster: of the scene's triangles."""
        self.scene = scene
        self.version = 0
        self._caster = caster or RayCaster(scene.vertices, scene.triangles)
        self._n_points, self._rays, self._shelf = n_points, (min(FEW_RAYS, n_rays), n_rays), shelf
        self._points: BendingPoints | None = None
        self._light = SkyState(None)
        self._bands: BandLight | None = None
        self._layers_of: dict[int, tuple[Layer, ...]] = {}
        self._albedos = np.zeros((len(scene.smooth), 3), np.float32)
        self._posed: frozenset[int] = frozenset()
        self._n_bounces = N_BOUNCES
        self._known: dict[int, _Wanted] = {}
        self._job: tuple[_Wanted, Generator[float, None, Zonal]] | None = None
        self._lobes: Lobes | None = None
        self._poses: dict[int, tuple[object, Pose]] = {}
        self._details: dict[int, Detail] = {}
        self._axes: dict[int, tuple[object, Singles]] = {}
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
        """The objects, by name, that are to bend: they have their own shadows alone, and cast none on others."""
        self._posed = frozenset(self.scene.object_index(each) for each in names if each in self.scene.object_names)

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
        if self._points is None:
            yield StillProgress(0.0, "points")
            self._points = bending_points(self.scene, self._caster, self._n_points)
        for layer in [each for own in self._layers_of.values() for each in own if _is_glossy(each)]:
            low_gloss(layer, ORDER)  # kept: no picture waits for it
            yield StillProgress(self.fraction, "reflection")
        if self._lobes is None:
            self._lobes = yield from told_as(_open(len(self._points)), lambda _: StillProgress(0.0, "transfer"))
            self.version += 1
        while (wanted := self._next()) is not None:
            if self._job is None or self._job[0] != wanted:
                self._job = wanted, self._simulate(wanted)
            try:
                yield StillProgress(self.fraction, "transfer" if next(self._job[1]) < 1.0 else "lobes")
            except StopIteration as end:
                self._job = None
                self._take(wanted, end.value)

    def _all(self) -> list[_Wanted]:
        """The best transfer of all objects that there is to be."""
        resting = tuple(i for i in range(len(self.scene.smooth)) if i not in self._posed)
        found = []
        for i in self._layers_of:
            casters = (i,) if i in self._posed or self._says(i) is not None else resting
            albedo = round(float(self._albedos[i] @ LUMINANCE) * _ALBEDO_STEPS) if self._n_bounces else 0
            found.append(_Wanted(i, casters, min(albedo, _ALBEDO_STEPS - 1), self._rays[1]))
        return found

    def _share(self, wanted: _Wanted) -> float:
        known = self._known.get(wanted.i_object)
        return 0.0 if known is None else 1.0 if known == wanted else 0.1

    def _says(self, i: int) -> DeformSurface | None:
        """What the scene's file says of an object's surface."""
        return self.scene.description.objects[i].deform

    def _next(self) -> _Wanted | None:
        """What is most urgent: of every object something before of any all."""
        missing = [each for each in self._all() if self._known.get(each.i_object) != each]
        for each in missing:
            known = self._known.get(each.i_object)
            if known is None or known.casters != each.casters:
                return _Wanted(each.i_object, each.casters, 0, self._rays[0])
        return missing[0] if missing else None

    def _simulate(self, wanted: _Wanted) -> Generator[float, None, Zonal]:
        """Rays, then lobes; yields the share of the rays that is done."""
        assert self._points is not None
        mesh, caster = self._points.mesh(wanted.i_object), self._points.caster(wanted.casters)
        is_final = wanted.n_rays == self._rays[1]
        made_of = (
            *self._points.geometry(wanted.i_object, wanted.casters),
            wanted.albedo,
            self._n_bounces,
            wanted.n_rays,
        )
        says = self._says(wanted.i_object)
        if says is not None:
            made_of = self._made_of(says, wanted)
        if is_final and self._shelf is not None and (found := self._shelf.get(made_of)) is not None:
            return found
        if says is not None and says.membrane is not None:
            return membrane(self._translucency(wanted.i_object, says.membrane.translucency), ORDER)
        if says is not None and says.is_mapped:
            zonal = yield from simulated(self.scene, says, ORDER, N_LOBES if is_final else 1, wanted.n_rays)
            if is_final and self._shelf is not None:
                self._shelf.put(made_of, zonal)
            return zonal
        if says is not None and says.subsurface is not None:
            medium = Medium(**dict(says.subsurface))
            own = mesh.corners[mesh.corners[:, 0] >= 0]
            vectors = yield from simulate_subsurface(mesh, caster, own, ORDER, medium, wanted.n_rays)
        else:
            vectors = yield from shadowed(mesh, caster, ORDER, wanted.n_rays)
        if wanted.albedo and says is None:
            albedo = wanted.albedo / _ALBEDO_STEPS
            vectors = yield from told_as(bounced(mesh, caster, vectors, albedo, self._n_bounces), lambda share: 0.99)
        zonal = yield from told_as(fit(vectors, N_LOBES if is_final else 1), lambda _: 1.0)
        if is_final and self._shelf is not None:
            self._shelf.put(made_of, zonal)
        return zonal

    def _made_of(self, says: DeformSurface, wanted: _Wanted) -> tuple[object, ...]:
        """All that the transfer of such a surface hangs on."""
        assert self._points is not None
        own = says.model_dump_json(), wanted.n_rays
        if says.patch is not None:
            return *own, heights(self.scene, says.patch)
        if says.wrinkles is not None:
            return ("wrinkles",)
        return *own, *self._points.geometry(wanted.i_object, wanted.casters)

    def _translucency(self, i: int, says: float | str) -> NDArray[np.float64]:
        """Of an object's points (P,), 0 to 1."""
        assert self._points is not None
        if not isinstance(says, str):
            return np.full(len(self._points.of(i)), says)
        image = self.scene.textures.weight(Images(weight=says))
        assert image is not None
        return np.clip(image.at(self._points.uvs(i))[:, 0].astype(np.float64), 0.0, 1.0)

    def _take(self, wanted: _Wanted, zonal: Zonal) -> None:
        assert self._points is not None and self._lobes is not None
        says = self._says(wanted.i_object)
        if says is not None and says.is_mapped:
            self._details[wanted.i_object], self._known[wanted.i_object] = detail(self.scene, says, zonal), wanted
            self.version += 1
            return
        mine, n = self._points.of(wanted.i_object), zonal.axes.shape[1]
        lobes = Lobes(self._lobes.low.copy(), self._lobes.axes.copy(), self._lobes.coefficients.copy())
        lobes.low[mine], lobes.axes[mine, :n], lobes.coefficients[mine] = zonal.low, zonal.axes, 0.0
        lobes.coefficients[mine, :n] = zonal.coefficients
        self._lobes, self._known[wanted.i_object] = lobes, wanted
        self.version += 1

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (), quality: Quality = "moving",
        turned: bool = True,
    ) -> Singles:  # fmt: skip
        """Radiance (H, W, 3) as it is known by now; resolution (width, height). "rest": four samples a pixel. turned:
        whether transfer turns with the surface; False shows what one would get if it did not.

        Raises ValueError before `is_ready`.
        """
        if self._points is None or self._lobes is None or self._bands is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        eye = np.subtract(camera.position, self.scene.origin).astype(np.float64)
        places, frames = self._posed_points(poses)
        white = self._shaded(poses, frames if turned else self._points.resting_frames)
        gloss = self._gloss(places, frames, eye, white)
        fine = 2 if quality == "rest" else 1
        size = (resolution[0] * fine, resolution[1] * fine)
        drawn = draw(self._points.surface, places, camera, eye, size)
        environment, turn = self._light.environment, math.radians(self._light.rotation % 360.0)
        backdrop = BLACK if environment is None else Backdrop(environment.radiance, turn, self._light.scale)
        albedos = self._albedos.copy()
        albedos[list(self._details)] = 0.0
        picture = paint(drawn, self._points.surface, white, gloss, albedos, self.scene.emission, backdrop)
        for i, own in self._layers_of.items():
            if i in self._details or any(not each.maps.is_plain for each in own):
                self._add_by_pixel(i, drawn, white, picture)
        return _halved(picture) if fine == 2 else picture

    def _posed_points(self, poses: Poses) -> tuple[Singles, Singles]:
        """Places (V, 3) of all that is drawn, and axes (S, 3, 3) of points; what did not move stays."""
        assert self._points is not None
        rows = {self.scene.object_index(name): row for name, row in poses if name in self.scene.object_names}
        for i in range(len(self.scene.smooth)):
            row = rows.get(i, ())
            if i not in self._poses or self._poses[i][0] != row:
                self._poses[i] = row, self._pose(i, row)
                self._points.place(i, self._poses[i][1])
        return self._points.places, self._points.frames

    def _pose(self, i: int, row: Row) -> Pose:
        """Where a row takes all that is drawn of an object."""
        assert self._points is not None
        resting = self._points.resting(i)
        rest, moment = at_moment(self.scene, i, row)
        carried = resting if moment is rest else self._points.carried(i, resting, rest, moment)
        return deformed(carried, deformers(row), resting.box)

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
        for i, own in self._layers_of.items():
            for layer in filter(_is_glossy, own):
                factor = mean_factor(self.scene, i, layer.maps)
                low = low_gloss(layer, ORDER)
                add_gloss(low, factor, self._points.of(i), places, normals, eye, self._bands, white, sent)
        return sent

    def _add_by_pixel(self, i: int, drawn: Drawn, white: Singles, picture: Singles) -> None:
        """Add matt layers that images lie on, or all where there is detail on the object."""
        assert self._points is not None
        surface, own = self._points.surface, self._layers_of[i]
        sees = drawn.found >= 0
        rows, columns = np.nonzero(sees & (surface.i_object[np.where(sees, drawn.found, 0)] == i))
        if not len(rows):
            return
        triangle, weights = drawn.found[rows, columns], drawn.weights(rows, columns)
        is_front = drawn.front[triangle] > 0.0
        points = surface.sides[triangle, np.where(is_front, 0, 1)]
        u, v = np.einsum("nk,nki->in", weights, self._points.within[triangle])
        at = Intersections(self._points.source[triangle], u, v, np.zeros(len(u), np.float32))
        if i in self._details and self._bands is not None:
            uvs = uvs_at(self.scene, at.triangle, u, v)
            matt = shaded(self._details[i], uvs, self._axes_of(i)[triangle], weights, is_front, self._bands)
        else:
            matt = np.einsum("nk,nki->ni", weights, white[points])
        matt = matt * (points[:, :1] >= 0)
        factors = MapFactors(self.scene, {i: own}).of_hits(at, np.full(len(u), i), np.arange(len(u)))
        for k, layer in enumerate(own):
            if _is_glossy(layer) or layer.maps.is_plain and i not in self._details:
                continue
            factor = 1.0 if layer.maps.is_plain else factors[:, k]
            picture[rows, columns] += np.maximum(matt * factor * (np.pi * _matt(layer)), 0.0)

    def _axes_of(self, i: int) -> Singles:
        """Axes along texture coordinates at the corners of an object's triangles as they stand now."""
        assert self._points is not None
        pose = self._poses[i][1]
        if i not in self._axes or self._axes[i][0] is not pose:
            self._axes[i] = pose, surface_axes(self.scene, self._points, i)
        return self._axes[i][1]


def _open(n_points: int) -> Generator[float, None, Lobes]:
    """Lobes of points that see all that is above them."""
    one = yield from fit(unshadowed(1, ORDER), 1)
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
