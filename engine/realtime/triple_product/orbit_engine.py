"""Orbit's renderer: draws one scene from any camera while its light and materials change, and works in small pieces.

    orbit = Orbit(scene)
    orbit.set_light(sky)              declares the desired state: costs nothing, may be repeated at any time
    orbit.set_layers(layers_of)
    for progress in orbit.work():     computes what is missing, the most urgent first, in pieces of about 30 ms
        ...                           between two pieces the caller may set or draw anything
    picture = orbit.draw(camera, (512, 384), "moving")

A picture shows what is known when it is drawn: at first unshadowed light, coarse light before fine, coarse reflections
before fine ones, and the points of the last picture before all others. Shadows and indirect light appear together, all
at once. `version` rises with every change that affects pictures, so that a window knows when to draw again; it does not
rise while some visible points have their shadows and others still lack them. One thread uses an object of this class.
The object refers to no window and no process, and may be dropped between any two pieces; so may its generators.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StepRunner, run_to_end
from engine.core.stored_arrays import Arrays
from engine.core.threads import n_threads
from engine.material.bumps import Bumps
from engine.material.layer import FRAMES
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.terms import LayersOf
from engine.realtime.core.view_samples import ViewSamples, assemble_picture
from engine.realtime.triple_product.incident import SkyMap
from engine.realtime.triple_product.kept_points import FormerPoints, keep_points
from engine.realtime.triple_product.lit_points import EXACTLY, GLOSSILY, UNLIT, LitPoints
from engine.realtime.triple_product.point_placement import PointPlacement
from engine.realtime.triple_product.reaching_lights import ReachingLights, shining_patches
from engine.realtime.triple_product.reflections import Reflections
from engine.realtime.triple_product.scene_patches import ScenePatches, scene_patches
from engine.realtime.triple_product.stored_visibility import StoredVisibility, dump_visibility, read_visibility
from engine.realtime.triple_product.view_radiance import N_MOVING, Quality, view_radiance
from engine.render.still import StillProgress
from engine.scene.cutouts import scene_caster
from engine.scene.description import CameraDescription
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Steps = Iterator[StillProgress]

N_POINTS = 40_000  # in addition to the meshes' vertices
N_COEFFICIENTS = 320
N_PATCHES = 64
N_BOUNCES = 4  # if the scene gives no number
MOST_BYTES = 3 << 29
MOST_SLICE_BYTES = 1 << 29
# Points a piece and thread: about 15 ms.
_COARSE, _FINE, _TRACED = 1536, 256, 96
# Share of a picture. Back faces below it wait until the user is idle: perturbed normals show them at silhouettes one
# pixel wide.
_LEAST_BACK = 0.005
_EDGE_RAYS = {"moving": 0, "rest": 16, "still": 16}
_SOFT_EDGE_RAYS = 4  # of a moving picture with soft edges
_FIRST_VIEW_SIDE = 256  # pixels across, to find the points that come first


class Orbit:
    """Draws a scene from any camera; see the module."""

    def __init__(
        self, scene: Scene, caster: RayCaster | None = None, n_points: int = N_POINTS,
        n_coefficients: int = N_COEFFICIENTS, n_patches: int = N_PATCHES, most_bytes: int = MOST_BYTES,
        most_slice_bytes: int = MOST_SLICE_BYTES, former: FormerPoints | None = None,
    ) -> None:  # fmt: skip
        """caster: intersects the scene's triangles, made here if None; n_points: in addition to the meshes' vertices;
        n_coefficients: of light at each point, 20 to 5,120; n_patches: of all emitters together; most_bytes: limit for
        the points' data, most_slice_bytes: limit for the layers' slices, see `notes`; former: points of the same scene
        with objects at other places, of which those are taken over that this does not concern."""
        self.scene = scene
        self.version = 0
        self._notes: tuple[str, ...] = ()
        self._caster = caster or scene_caster(scene)
        self._n_points, self._n_coefficients, self._n_patches = n_points, n_coefficients, n_patches
        self._most_bytes = most_bytes
        self._placing: StepRunner[LitPoints] | None = None
        self._former = former
        self._lit: LitPoints | None = None
        self._restored: StoredVisibility | None = None
        self._patches = scene_patches(scene, n_patches)
        self._n_bounces = scene.description.bounces or N_BOUNCES
        self._lights = ReachingLights()
        self._reflections = Reflections(most_slice_bytes)

    # ------------------------------------------------------------------------------------------ stored visibility

    @property
    def geometry(self) -> tuple[NDArray[np.generic] | int | str, ...]:
        """Everything that visibility depends on."""
        scene = self.scene
        arrays = scene.vertices, scene.normals, scene.triangles, scene.object_of_triangle, scene.smooth
        own = scene.emitters, scene.reflecting, self._n_points, self._n_patches
        return (*arrays, *own, scene.tangent_rotations.digest, scene.cutouts.digest, scene.emission_textures.digest)

    @property
    def has_traced(self) -> bool:
        """Whether the visibility of all points that exist so far is known, and some of it was traced and not
        restored."""
        return self._lit is not None and self._lit.n_traced > 0 and bool(self._lit.traced.all())

    def stored_visibility(self) -> dict[str, NDArray[np.generic]]:
        """Return the visibility of all points, to be stored under `geometry`. Raises ValueError before points exist."""
        if self._lit is None:
            raise ValueError("nothing is seen yet: expected some steps of work before")
        self._lit.n_traced = 0
        return dump_visibility(self._lit)

    def restore(self, arrays: Arrays) -> None:
        """Take over visibility that `stored_visibility` returned for the same geometry; before any work. Raises
        UnsoundArrays."""
        n_patches = 0 if self._patches is None else len(self._patches[0])
        self._restored = read_visibility(arrays, len(self.scene.smooth), n_patches)

    # ---------------------------------------------------------------------------------------------- desired state

    def set_light(self, sky: SkyState) -> None:
        """Set the distant light."""
        if self._lights.set_sky(sky):
            self._stale()

    def set_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Set the radiance of emitters, by name; see `Scene.with_emission`."""
        scene = self.scene.with_emission(emission)
        if not np.array_equal(scene.emission, self.scene.emission):
            self.scene = scene
            if self._lit is not None:
                self._lit.mesh.set_emission(scene)
            self._stale()

    def set_bumps(self, bumps: Mapping[str, Bumps]) -> None:
        """Set the bump or normal maps and the rotations of tangents of objects, by name; see `Scene.with_bumps`."""
        scene = self.scene.with_bumps(bumps)
        if scene.description == self.scene.description:
            return
        is_rotated = scene.tangent_rotations.digest != self.scene.tangent_rotations.digest
        self.scene = scene
        if self._lit is not None:
            if is_rotated:
                self._lit.rotate_tangents(scene)
            self._lit.add_gloss(self._are_glossy)
        if is_rotated:
            self._placing = None
            self._reset_bounces()
        self.version += 1

    def set_bounces(self, n_bounces: int) -> None:
        """Set the number of reflections between light and camera; 0 restores the scene's own number, or 4 if it has
        none."""
        n_bounces = n_bounces or self.scene.description.bounces or N_BOUNCES
        if n_bounces != self._n_bounces:
            self._n_bounces = n_bounces
            self._reset_bounces()

    def set_layers(self, layers_of: LayersOf) -> None:
        """Set the layers of each object, by its index. Layers that did not change are not computed again."""
        if self._reflections.set_layers({i: own for i, own in layers_of.items() if self.scene.reflecting[i]}):
            if self._lit is not None:
                self._lit.add_gloss(self._are_glossy)
            self._reset_bounces()

    def move(self, scene: Scene, caster: RayCaster, patches: ScenePatches | None) -> None:
        """Take over the scene with some objects elsewhere, whose points were moved (`moved_orbit`)."""
        self.scene, self._caster, self._patches = scene, caster, patches
        self.version += 1

    # ----------------------------------------------------------------------------------------- inputs of a picture

    @property
    def caster(self) -> RayCaster:
        """Intersects the scene's triangles."""
        return self._caster

    @property
    def patches(self) -> ScenePatches | None:
        """The patches of all that may emit, with the radiance of emission 1, and the object of each."""
        return self._patches

    @property
    def lit(self) -> LitPoints | None:
        """The shading points and their light; None before they are placed."""
        return self._lit

    @property
    def light(self) -> SkyState:
        """The distant light."""
        return self._lights.sky

    @property
    def sky_map(self) -> SkyMap:
        """The same, as points look it up."""
        return self._lights.sky_map

    @property
    def sky_maps(self) -> list[SkyMap]:
        """The same for each object: what its links say."""
        return self._lights.sky_maps(len(self.scene.emission))

    @property
    def reflections(self) -> Reflections:
        """The objects' reflections."""
        return self._reflections

    @property
    def n_bounces(self) -> int:
        """Number of reflections between light and camera."""
        return self._n_bounces

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages about what was made coarser to stay within memory."""
        return (*self._notes, *self._reflections.notes)

    # ----------------------------------------------------------------------------------------------------- the work

    @property
    def is_ready(self) -> bool:
        """Whether a picture shows more than black: all visible points have been lit once, if only without shadows.
        Before the first picture, these are the points that the scene's own camera sees."""
        return self._lit is not None and bool(self._lit.known[self._lit.seen].all())

    @property
    def is_shadowed(self) -> bool:
        """Whether all visible points have been lit with their shadows, and indirectly."""
        lit = self._lit
        if lit is None or not lit.behind.issubset(lit.with_backs) or not (lit.traced & lit.shadowed)[lit.seen].all():
            return False
        return self._n_bounces == 1 or lit.is_bounced > UNLIT

    @property
    def is_done(self) -> bool:
        """Whether no work is left."""
        lit = self._lit
        if lit is None or not lit.is_done or not self._reflections.is_done:
            return False
        return self._n_bounces == 1 or lit.is_bounced == GLOSSILY and lit.is_refined

    @property
    def fraction(self) -> float:
        """Share of the work that is done, 0 to 1."""
        return 0.0 if self._lit is None else self._lit.fraction

    @property
    def n_bytes(self) -> int:
        """Bytes that the points' data take."""
        lit = self._lit
        return 0 if lit is None else lit.bits.nbytes + lit.patch_bits.nbytes + lit.incident.n_bytes

    def work(self) -> Steps:
        """Compute what is missing, piece by piece, until nothing is. Changes made meanwhile take effect at once.

        Raises InsituError if the meshes have too many vertices.
        """
        while self._lit is None:
            yield StillProgress(0.0, "shading points")
            self._place()
        while (piece := self._do_next_piece()) is not None:
            # The unshadowed light stays in the picture until all of it is replaced.
            self.version += not self._lit.is_outdated
            yield StillProgress(self.fraction, piece)

    def _do_next_piece(self) -> str | None:
        """Do the most urgent piece and return its name; None if nothing is left."""
        lit = self._lit
        assert lit is not None
        if self._reflections.find_coarse():
            self._reset_bounces()
            return "reflection"
        if len(which := lit.next_points(lit.state == UNLIT, _COARSE * n_threads())):
            self.light_points(lit, which, is_coarse=True)
            lit.is_bounced = UNLIT
            return "light"
        if not self._reflections.is_done:
            if self._reflections.refine():
                self._reset_bounces()
            return "reflection"
        if not lit.is_outdated and self._bounce(lit):
            return "bounces"
        # Light with shadows but without bounces would blacken metal that reflects itself, point by point. So the light
        # waits for the shadows of all visible points and for the bounce rays, and the picture shows them together.
        waits = bool((lit.seen & ~lit.traced).any()) or self._n_bounces > 1 and lit.bounces is None
        ripe = lit.traced & (lit.state != EXACTLY)
        if len(which := lit.next_points(ripe & lit.shadowed if waits else ripe, _FINE * n_threads())):
            was_outdated = lit.is_outdated
            self.light_points(lit, which, is_coarse=False)
            if was_outdated and not lit.is_outdated:
                self._bounce(lit)
            return "light"
        if behind := sorted(lit.behind.difference(lit.with_backs)):
            lit.add_backs(behind, self._are_glossy)
            return "backs"
        if len(which := lit.next_points(~lit.traced & lit.seen, _TRACED * n_threads())):
            lit.trace(which, self._patches)
            return "visibility"
        if self._n_bounces > 1 and lit.bounces is None:
            lit.send_rays()
            return "bounces"
        if len(which := lit.next_points(~lit.traced, _TRACED * n_threads())):
            lit.trace(which, self._patches)
            return "visibility"
        if self._n_bounces > 1 and lit.bounces is not None and not lit.is_refined:
            lit.refine_rays(None if self._patches is None else self._patches[0])
            return "bounces"
        if self._n_bounces > 1 and lit.is_bounced == EXACTLY:
            terms = self._reflections.blunt_terms(self.scene)
            lit.bounce_gloss(terms, self._reflections.albedos(self.scene), self._n_bounces)
            return "bounces"
        return None

    def _bounce(self, lit: LitPoints) -> bool:
        """Recompute indirect light if it is desired and direct light is known better than before; return whether it
        did."""
        if self._n_bounces == 1 or lit.bounces is None or lit.is_bounced >= lit.is_lit:
            return False
        lit.bounce(self._reflections.albedos(self.scene), self._n_bounces)
        return True

    # ---------------------------------------------------------------------------------------------------- pictures

    def draw(
        self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest",
        n_moving: int = N_MOVING, transparent: bool = False, apart: Collection[int] = (),
    ) -> Float32Array:  # fmt: skip
        """Draw radiance (H, W, 3) as it is known now; resolution (width, height). transparent: without the sky, and
        with alpha (H, W, 4); apart: objects, by index, whose own part of such a picture follows it, (H, W, 8).

        quality: "moving" is the fastest, with n_moving coefficients a point; "rest" evaluates the reflection at every
        pixel; "still" evaluates every peak exactly as well. Raises ValueError before `is_ready`.
        """
        drawing = self.draw_steps(camera, resolution, quality, n_moving, transparent=transparent, apart=apart)
        return run_to_end(drawing)

    def draw_steps(
        self, camera: CameraDescription, resolution: tuple[int, int], quality: Quality = "rest",
        n_moving: int = N_MOVING, has_soft_edges: bool = False, transparent: bool = False,
        apart: Collection[int] = (),
    ) -> Generator[StillProgress, None, Float32Array]:  # fmt: skip
        """As `draw`, piece by piece; has_soft_edges: antialias edges in "moving" pictures as well, which takes a fifth
        longer."""
        lit = self._lit
        if lit is None:
            raise ValueError("nothing is ready to be drawn: expected some steps of work before")
        least = 0.0 if quality == "still" else _LEAST_BACK
        n_edge_rays = _EDGE_RAYS[quality] or (_SOFT_EDGE_RAYS if has_soft_edges else 0)
        how = n_edge_rays, quality != "moving", quality == "rest"
        seen = self._prioritize(lit, camera, resolution, how, least)
        # Points without any light, because the camera jumped or back faces came into view, would be black: light them
        # now.
        while len(which := np.flatnonzero(lit.seen & ~lit.known)[: _COARSE * n_threads()]):
            self.light_points(lit, which, is_coarse=True)
            yield StillProgress(0.0, "light")
        what = lit, self._reflections, self.scene, self._lights.reaching(self.scene, self._patches, lit)
        radiance = yield from view_radiance(seen, *what, self._n_bounces, quality, n_moving)
        sky = self._lights.sky
        return assemble_picture(seen, radiance, sky.environment, sky.rotation, sky.scale, transparent, apart)

    # ---------------------------------------------------------------------------------------------------- private

    @property
    def _are_glossy(self) -> NDArray[np.bool_]:
        found = self._reflections.are_glossy(len(self.scene.smooth))
        for frame in FRAMES:  # each pixel has its own frame there, diffuse or not
            found[list(self.scene.in_frame(frame).bump_normals.objects)] = True
        return found

    def _stale(self) -> None:
        if self._lit is not None:
            self._lit.state[:] = UNLIT
        self._reset_bounces()

    def _reset_bounces(self) -> None:
        if self._lit is not None:
            self._lit.is_bounced = UNLIT
        self.version += 1

    def _place(self) -> None:
        """Do one piece of placing points."""
        if self._placing is None:
            placement = PointPlacement(
                self.scene, self._caster, self._n_points, self._n_coefficients, self._n_patches, self._most_bytes
            )
            placement.check_vertices()
            self._placing = StepRunner(self._placed(placement))
        if not self._placing.advance():
            return
        self._lit, self._placing, self._former = self._placing.result, None, None
        self.prioritize_view(self.scene.description.camera)
        self.version += 1

    def _placed(self, placement: PointPlacement) -> Generator[None, None, LitPoints]:
        """The points, with what is known of them from before."""
        points, n = yield from placement.steps()
        if n < self._n_coefficients:
            self._notes = (f"{n} coefficients of light a point instead of {self._n_coefficients}, for want of memory",)
        n_patches = 0 if self._patches is None else len(self._patches[0])
        lit = LitPoints(self.scene, self._caster, points, n, n_patches, self._are_glossy)
        if self._restored is not None:
            lit.restore(*self._restored, self._are_glossy)
            self._restored = None
        elif self._former is not None:
            yield from keep_points(
                lit, self.scene, self._former, self._lights.sky, shining_patches(self.scene, self._patches)
            )
        return lit

    def prioritize_view(self, camera: CameraDescription) -> None:
        """Give priority to the points that this camera sees."""
        lit = self._lit
        if lit is not None:
            width, height = self.scene.resolution
            self._prioritize(lit, camera, (_FIRST_VIEW_SIDE, max(1, round(_FIRST_VIEW_SIDE * height / width))))

    def _prioritize(
        self, lit: LitPoints, camera: CameraDescription, resolution: tuple[int, int],
        how: tuple[int, bool, bool] = (0, False, False), least: float = 0.0,
    ) -> ViewSamples:  # fmt: skip
        """Give priority to the points of this picture, and sample it; how: see `PointMesh.sample_view`. Add points to
        back faces that no picture has seen yet: at once, without shadows, if they cover more than `least` of the
        picture, else when nothing more urgent is left."""
        seen = lit.mesh.sample_view(camera, resolution, *how)
        if behind := seen.from_behind(least):
            lit.add_backs(behind, self._are_glossy)
            self.version += 1
            seen = lit.mesh.sample_view(camera, resolution, *how)
        lit.seen, lit.behind = seen.visible_points(), lit.behind | set(seen.from_behind())
        return seen

    def light_points(self, lit: LitPoints, which: NDArray[np.int64], is_coarse: bool, asks_peaks: bool = False) -> None:
        """Light some points, each by what reaches its object; asks_peaks: see `LitPoints.light`."""
        for each in self._lights.reaching(self.scene, self._patches, lit):
            if len(mine := which[each.objects[lit.points.i_object[which]]]):
                lit.light(mine, each.sky, each.emitters, is_coarse, asks_peaks)

    def former_points(
        self, scene: Scene, caster: RayCaster, is_sound: NDArray[np.bool_], is_lit: NDArray[np.bool_]
    ) -> FormerPoints:
        """What another Orbit, for other places of objects, can take over of this one; scene, caster: that its points
        were made for; is_sound, is_lit (S,): see `FormerPoints`. Raises ValueError before there are points."""
        if self._lit is None:
            raise ValueError("no points are known yet: expected some steps of work before")
        return FormerPoints(
            scene, caster, self._lit, is_sound, is_lit, self._lights.sky, shining_patches(self.scene, self._patches)
        )
