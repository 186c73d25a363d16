"""Deform's renderer: draws one scene whose meshes bend, while their own shadows and reflections follow [Sloan05].

    deform = Deform(scene)
    deform.set_light(sky)             declares the desired state: costs nothing, may be repeated at any time
    deform.set_layers(layers_of)
    for progress in deform.work():    transfer: unshadowed at once, then by few rays, then by all, object by object
        ...                           between two pieces the caller may set or draw anything
    picture = deform.draw(camera, (512, 384), poses)

Glossy layers come last: where a pilot finds rows of transfer better than one lobe, they are drawn by these from then on
(`engine.realtime.zonal_harmonics.gloss_transfer`).

What an object's points see of the object itself rotates with them when it bends. What they see of other objects does
not. So the transfer of an object that bends contains only its own shadows, and that of objects at rest contains one
another's; bending objects shade all others by a few clusters of their surface
(`engine.realtime.zonal_harmonics.shading`). Transfer is that of distant light; lamps light each point from where they
are (`engine.realtime.zonal_harmonics.lamp_light`). Where the scene's file describes an object's
surface (`engine.scene.surface_kinds`), this replaces its own transfer.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress
from engine.light.environment import LUMINANCE
from engine.material.layer import Layer
from engine.material.layer_maps import Images
from engine.precompute.direct.linking import reaching_skies
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.gpu_parts import NO_PARTS, Numbers, PictureExport
from engine.realtime.core.terms import LayersOf, is_glossy
from engine.realtime.zonal_harmonics.bending_points import BendingPoints, bending_points
from engine.realtime.zonal_harmonics.desired_transfers import N_BOUNCES, DesiredTransfers
from engine.realtime.zonal_harmonics.gloss_transfer import GlossTransfer, GlossTransfers, LayerGloss
from engine.realtime.zonal_harmonics.gpu_export import PictureExporter
from engine.realtime.zonal_harmonics.light_between_objects import LightBetweenObjects
from engine.realtime.zonal_harmonics.neighbours import sky_powers
from engine.realtime.zonal_harmonics.object_transfer import (
    ORDER,
    UNSHADOWED,
    ObjectTransfer,
    Reflectance,
    TransferCache,
    TransferStore,
    albedos,
    reflectance,
)
from engine.realtime.zonal_harmonics.picture_renderer import PictureRenderer, Quality, camera_position_of
from engine.realtime.zonal_harmonics.point_transfers import PointTransfers
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.scene_lamps import hiding_lamps, lamp_placements
from engine.realtime.zonal_harmonics.shading import BandLight, band_light, low_gloss
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.realtime.zonal_harmonics.sun_lights import SkyLight, sky_light
from engine.realtime.zonal_harmonics.transfer import N_RAYS
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.cutouts import scene_caster
from engine.scene.description import CameraDescription
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_kinds import SurfacesByObject
from engine.sphere.harmonics import project

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

N_POINTS = 12_000  # in addition to the meshes' vertices


class Deform:
    """Draws a scene in any pose from any camera; see the module."""

    def __init__(
        self, scene: Scene, n_points: int | None = None, n_rays: int = N_RAYS, store: TransferStore | None = None,
        caster: RayCaster | None = None,
    ) -> None:  # fmt: skip
        """scene: at rest; n_points: in addition to the meshes' vertices, None for `N_POINTS`; n_rays: of each point;
        caster: intersects the scene's triangles."""
        self.scene = scene
        self.version = 0
        self._caster = caster or scene_caster(scene)
        self._n_points, self._store = N_POINTS if n_points is None else n_points, store
        self._desired = DesiredTransfers(scene.description.objects, n_rays)
        self._points: BendingPoints | None = None
        self._light = SkyState(None)
        self._sky: SkyLight | None = None
        self._linked: dict[int, SkyLight] = {}  # of objects that not all distant light reaches
        self._layers_of: dict[int, tuple[Layer, ...]] = {}
        self._albedos: dict[int, Float64Array] = {}  # of points (P, 3), computed on request
        self._between = LightBetweenObjects()
        self._state: ShadingState | None = None
        self._transfers: TransferCache | None = None
        self._n_gloss_rows: int | None = None
        self._glosses: GlossTransfers | None = None
        self._even: frozenset[int] = frozenset()
        self._job: tuple[ObjectTransfer, Generator[float, None, Zonal]] | None = None
        self._found: PointTransfers | None = None  # there as soon as there are points
        self._pictures: PictureRenderer | None = None
        self._exporter: PictureExporter | None = None

    # ---------------------------------------------------------------------------------------------- desired state

    def set_light(self, sky: SkyState) -> None:
        """Set the distant light."""
        if sky != self._light or self._sky is None:
            radius, whole = float(np.abs(self.scene.vertices).max(initial=0.0)), replace(sky, links=())
            skies = {each: sky_light(each, radius) for each in {whole, *(link.sky for link in sky.links)}}
            self._light, self._sky = sky, skies[whole]
            self._linked = {i: skies[link.sky] for link in sky.links for i in link.objects}
            self.version += 1

    def set_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Set the radiance of emitters, by name."""
        scene = self.scene.with_emission(emission)
        if not np.array_equal(scene.emission, self.scene.emission):
            self.scene = scene
            self.version += 1

    def set_layers(self, layers_of: LayersOf) -> None:
        """Set the layers of each object, by its index."""
        layers = {i: tuple(each for each in own if each.visible) for i, own in layers_of.items()}
        has_surface = np.ptp(self.scene.triangle_ranges, axis=1) > 0  # hidden objects have none
        layers = {i: own for i, own in layers.items() if self.scene.reflecting[i] and has_surface[i]}
        if layers != self._layers_of:
            before, self._layers_of = self._layers_of, layers
            self._albedos = {i: each for i, each in self._albedos.items() if before.get(i) == layers.get(i)}
            self.version += 1

    def set_bending(self, names: Sequence[str]) -> None:
        """Set the names of the objects that bend. Their transfer contains only their own shadows; the shadows that they
        cast on others are coarse, see `engine.realtime.zonal_harmonics.shading`."""
        known = [self.scene.object_index(each) for each in names if each in self.scene.object_names]
        posed = frozenset(i for i in known if not self.scene.lights[i])
        if posed != self._desired.posed:
            self._desired.posed = posed
            self.version += 1

    def set_moved(self, moved: Sequence[str], lamps: Poses) -> None:
        """Set the names of objects that stand elsewhere than at rest, and the placements of emitters, by name, for
        which rays find their light. Pictures have both where their poses say."""
        if self._between.set_moved(tuple(moved), lamp_placements(self.scene, lamps)):
            self.version += 1

    def set_surfaces(self, surfaces: SurfacesByObject) -> None:
        """Set descriptions of objects' surfaces, by name, which replace those of the scene's file. Raises LoadError if
        an image cannot be used."""
        self.scene.textures.load(Images(weight=file) for _, surface in surfaces for _, file in surface.files)
        self._desired.surfaces = dict(surfaces)

    def set_effort(self, n_rays: int, n_lobes: int, n_gloss_rows: int | None = None) -> None:
        """Set the number of rays of each point, and of lobes that approximate the result, 1 to `N_LOBES`; `UNSHADOWED`
        for light without shadows and reflections. n_gloss_rows: of each glossy layer, 0 for one lobe, None for what a
        pilot finds."""
        self._desired.n_rays, self._desired.n_lobes = n_rays, n_lobes
        if n_gloss_rows != self._n_gloss_rows:
            self._n_gloss_rows = n_gloss_rows
            self.version += 1

    def set_bounces(self, n_bounces: int) -> None:
        """Set the number of reflections between light and camera; 0 restores the largest possible number."""
        self._desired.n_bounces = min(n_bounces - 1, N_BOUNCES) if n_bounces else N_BOUNCES

    @property
    def _is_plain(self) -> bool:
        """Whether points see all that is above them."""
        return self._desired.n_lobes == UNSHADOWED

    # ----------------------------------------------------------------------------------------------------- the work

    @property
    def is_ready(self) -> bool:
        """Whether a picture shows more than black."""
        return self._found is not None and self._sky is not None

    @property
    def is_done(self) -> bool:
        """Whether no work is left."""
        found = self._found
        return (
            found is not None
            and all(map(found.has, self._final_transfers()))
            and self._between.is_traced(self.scene, self._desired.alone, self._is_plain)
            and self._glosses is not None
            and (self._glosses.first_missing(self._wanted_gloss()) is None)
        )

    @property
    def fraction(self) -> float:
        """Share of the work that is done, counted in points."""
        found = self._found
        if found is None or self._points is None or not len(self._points):
            return 0.0
        counts = [len(self._points.points_of(each.i_object)) for each in self._final_transfers()]
        shares = [found.share_of(each) for each in self._final_transfers()]
        return float(np.dot(counts, shares) / max(sum(counts), 1))

    @property
    def n_bytes(self) -> int:
        """Bytes that the points' data take."""
        return 0 if self._found is None else self._found.n_bytes + sum(each.n_bytes for each in self.gloss.values())

    @property
    def lost_shares(self) -> dict[int, float]:
        """For each object, the share of its sharpest layer's reflection that is too sharp for the bands; see
        `LowGloss.lost_share` and `GlossBasis.lost_share`."""
        known, found = self.gloss, dict[int, list[float]]()
        for i, own in self._layers_of.items():
            for layer in filter(is_glossy, own):
                rows = known.get((i, layer))
                lost = rows.rows[1].lost_share if rows and rows.rows else low_gloss(layer, ORDER).lost_share
                found.setdefault(i, []).append(lost)
        return {i: max(each) for i, each in found.items()}

    @property
    def gloss(self) -> dict[tuple[int, Layer], LayerGloss]:
        """How the glossy layers, by object, are drawn now, as far as it has been decided."""
        return {} if self._glosses is None else self._glosses.known(self._wanted_gloss())

    def work(self) -> Iterator[StillProgress]:
        """Compute what is missing, piece by piece, until nothing is. Changes made meanwhile take effect at once."""
        if self._points is None or self._even != self._desired.translucent:
            yield StillProgress(0.0, "placing points")
            self._make_points()
        assert self._found is not None and self._glosses is not None
        for layer in [each for own in self._layers_of.values() for each in own if is_glossy(each)]:
            low_gloss(layer, ORDER)  # cached: no picture waits for it
            yield StillProgress(self.fraction, "finding reflections")
        while True:
            has_outdated = any(map(self._found.is_outdated, self._final_transfers()))
            if not has_outdated and not self._between.is_traced(self.scene, self._desired.alone, self._is_plain):
                yield from self._trace_light_between_objects()
                continue
            if (wanted := self._most_urgent()) is None:
                if (gloss := self._glosses.first_missing(self._wanted_gloss())) is None:
                    return
                yield from self._compute_gloss(self._glosses, gloss)
                continue
            if self._job is None or self._job[0] != wanted:
                self._job = wanted, self._load_or_simulate(wanted)
            try:
                yield StillProgress(self.fraction, "tracing transfer" if next(self._job[1]) < 1.0 else "fitting lobes")
            except StopIteration as end:
                self._job = None
                self._found.put(wanted, end.value, self.scene)
                self.version += 1

    def _wanted_gloss(self) -> Iterator[GlossTransfer]:
        """The transfer of the glossy layers that may be drawn by rows."""
        skies = reaching_skies(self._light, len(self.scene.smooth))
        for each in self._final_transfers():
            if each.can_have_gloss_rows:
                environment = skies[each.i_object].environment if self._n_gloss_rows is None else None
                for layer in filter(is_glossy, self._layers_of[each.i_object]):
                    yield GlossTransfer(each, layer, self._n_gloss_rows, environment)

    def _compute_gloss(self, glosses: GlossTransfers, wanted: GlossTransfer) -> Iterator[StillProgress]:
        """Choose how a layer is drawn, and compute its rows where it is drawn by these."""
        assert self._transfers is not None
        diffuse = self._transfers.get(wanted.of) if wanted.of.surface.is_opaque else None
        computing = glosses.compute(wanted, diffuse)
        while wanted in self._wanted_gloss():
            try:
                yield StillProgress(next(computing), "fitting gloss")
            except StopIteration as end:
                glosses.put(wanted, end.value, self._wanted_gloss())
                self.version += 1
                return

    def _trace_light_between_objects(self) -> Iterator[StillProgress]:
        """Trace where light goes between objects; stops where other objects begin to bend, and the caller begins
        anew."""
        assert self._points is not None
        alone = self._desired.alone
        for _ in self._between.trace(self.scene, self._points, alone):
            yield StillProgress(self.fraction, "tracing light between objects")
            if alone != self._desired.alone:
                return
        self.version += 1

    def _make_points(self) -> None:
        """Make all points, with unshadowed lobes, or with those of the nearest points if there were points before."""
        before, had = self._points, self._found
        self._even = self._desired.translucent
        even = np.isin(np.arange(len(self.scene.smooth)), list(self._even))
        points = bending_points(self.scene, self._caster, self._n_points, even)
        self._albedos = {}
        self._points, self._transfers = points, TransferCache(self.scene, points, self._store)
        self._glosses = GlossTransfers(self.scene, points, self._store)
        self._found, near = PointTransfers(points), None
        if before is not None and had is not None:
            near = points.nearest_of(before)
            self._found.take_over(had, near)
        self._between.take_over_points(near)
        self._pictures = PictureRenderer(self.scene, points)
        self._exporter, self._job = PictureExporter(points, self._pictures.posed, self._pictures.blockers), None
        self.version += 1

    def _final_transfers(self) -> list[ObjectTransfer]:
        return self._desired.final(self._layers_of, self._reflectance)

    def _reflectance(self, i: int) -> Reflectance:
        """The albedos with which an object reflects light onto itself."""
        return reflectance(self._albedos_of(i) @ LUMINANCE)

    def _albedos_of(self, i: int) -> Float64Array:
        """Albedos of an object's points (P, 3)."""
        if i not in self._albedos:
            assert self._points is not None
            self._albedos[i] = albedos(self.scene, self._points, i, self._layers_of[i], ORDER)
        return self._albedos[i]

    def _most_urgent(self) -> ObjectTransfer | None:
        """Choose the most urgent transfer: a first approximation of every object before the final one of any; objects
        at rest first, because they show outdated shadows."""
        assert self._found is not None
        missing = [each for each in self._final_transfers() if not self._found.has(each)]
        missing.sort(key=lambda each: each.i_object in self._desired.posed)
        for each in missing:
            if self._found.is_outdated(each):
                is_there = self._transfers is not None and self._transfers.get(each) is not None
                if is_there or each.surface.wrinkles is not None or each.n_lobes == UNSHADOWED:
                    return each  # which costs as much by few rays
                return self._desired.first(each)
        return missing[0] if missing else None

    def _load_or_simulate(self, wanted: ObjectTransfer) -> Generator[float, None, Zonal]:
        """Load a transfer from the cache or compute it; yields the share of the rays that is done."""
        assert self._points is not None and self._transfers is not None
        is_final = (wanted.n_rays, wanted.n_lobes) == (self._desired.n_rays, self._desired.n_lobes)
        if is_final and (cached := self._transfers.get(wanted)) is not None:
            return cached
        zonal = yield from wanted.compute(self.scene, self._points)
        if is_final:
            self._transfers.put(wanted, zonal)
        return zonal

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = (), quality: Quality = "moving",
        turned: bool = True, transparent: bool = False, apart: Collection[int] = (),
    ) -> Float32Array:  # fmt: skip
        """Draw radiance (H, W, 3) as it is known now; resolution (width, height). "rest": four samples a pixel. turned:
        whether transfer rotates with the surface; False shows the picture without this, for comparison. transparent:
        without the sky, and with alpha (H, W, 4); apart: objects, by index, whose own part of such a picture follows
        it, (H, W, 8).

        Raises ValueError before `is_ready`.
        """
        subject, pictures = self._posed_state(poses)
        return pictures.draw(subject, camera, resolution, poses, quality, turned, transparent, apart)

    def draw_errors(self, camera: CameraDescription, resolution: tuple[int, int], poses: Poses = ()) -> Float32Array:
        """Draw the errors of the visible lobes relative to the transfer that they were fitted to (H, W, 3): see
        `error_colours`. Raises ValueError before `is_ready`."""
        subject, pictures = self._shading_state()
        return pictures.draw_errors(subject, camera, resolution, poses)

    def export_picture(self, camera: CameraDescription, poses: Poses, known: Numbers = NO_PARTS) -> PictureExport:
        """Export what a graphics card needs to draw the same picture, without the parts whose numbers are known. Raises
        ValueError before `is_ready`."""
        subject, _ = self._posed_state(poses)
        assert self._exporter is not None
        return self._exporter.export(subject, camera_position_of(self.scene, camera), poses, known)

    def carried(self, poses: Poses) -> dict[str, tuple[float, float, float]]:
        """Translations (x, y, z) by animations of the objects in these poses, by name."""
        return {} if self._pictures is None else self._pictures.posed.animation_offsets(poses)

    def _posed_state(self, poses: Poses) -> tuple[ShadingState, PictureRenderer]:
        """A snapshot of everything that pictures use, with points and lamps in these poses."""
        state, pictures = self._shading_state()
        assert self._points is not None
        pictures.posed.at(poses)
        away = self._between.away(self.scene)
        return self._between.lamps.in_pose(state, self.scene, self._points, away, poses), pictures

    def _shading_state(self) -> tuple[ShadingState, PictureRenderer]:
        """The same with lamps where they rest."""
        if self._pictures is None or self._found is None or self._sky is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        if self._state is None or self._state.version != self.version:
            scene, alone, found = self._between.lamps.lit_scene(self.scene), self._desired.alone, self._found
            has_sky = any(sky.powers.any() for sky in (self._sky, *self._linked.values()))
            hiding = hiding_lamps(scene) if has_sky else ()
            casters = self._desired.missing_casters(found.known, self._layers_of, hiding)
            known = self._layers_of, found.lobes, found.errors, found.details, casters
            state = ShadingState(
                self.version, scene, self._light, self._sky, *known, gloss=self.gloss, linked=self._linked,
                opaque=frozenset(i for i in self._layers_of if not self._desired.surface_of(i).kind),
            )  # fmt: skip
            assert self._points is not None
            what = state, self.scene, self._pictures, self._points, alone, self._albedos_of_all()
            self._state = self._between.added_to(*what, is_plain=self._is_plain)
        return self._state, self._pictures

    def _albedos_of_all(self) -> Float64Array:
        """Albedos of all points (P, 3); 0 where light is reflected once only."""
        assert self._points is not None
        found = np.zeros((len(self._points), 3))
        for i in self._layers_of if self._desired.n_bounces else ():
            found[self._points.points_of(i)] = self._albedos_of(i)
        return found


def band_light_of(sky: SkyState) -> BandLight:
    """Project a sky onto the bands of transfer."""
    return band_light(project(sky_powers(sky), ORDER))


def finish_deform(deform: Deform) -> Deform:
    """Do all the work of a Deform."""
    for _ in deform.work():
        pass
    return deform
