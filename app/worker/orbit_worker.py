"""Orbit in the worker: precomputes what one scene is drawn of from any camera, and between the steps draws pictures.

Precomputation is a long job that continues where the last one was left off, whatever ended that: another camera,
another material, the user. A picture is a quick one; it never waits for more than a step.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Generator, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.document.light_state import RGB
from app.document.scene_state import LayerState
from app.messages.worker_messages import Progress, WorkerWarnings
from app.modes.mode import ModeWorker
from app.modes.orbit.orbit_messages import (
    DrawHeadlight,
    DrawOrbit,
    EstimateOrbit,
    OrbitNotReady,
    OrbitPartExported,
    OrbitPictureDrawn,
    OrbitProgress,
    PrepareOrbit,
    PrioritizeView,
)
from app.system.memory import orbit_bytes, orbit_slice_bytes
from app.worker.cache import content_key
from app.worker.catcher_engines import CatcherEngine, draw_caught
from app.worker.file_tasks import ensure_tables
from app.worker.kernels import COMPILING, FIRST_TIME, ORBIT, are_compiled, note_compiled
from app.worker.schedule import Handlers, Steps
from app.worker.tasks import WorkerContext
from engine.core.generators import map_steps
from engine.material.bumps import Bumps
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import movements_between, pose_scene
from engine.scene.cutouts import scene_caster
from engine.scene.description import CameraDescription
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

if TYPE_CHECKING:
    from engine.core.generators import StillProgress
    from engine.realtime.triple_product.gpu_export import PointExporter
    from engine.realtime.triple_product.kept_points import FormerPoints
    from engine.realtime.triple_product.orbit_engine import Orbit

STAGE = "orbit"
MOVE_SECONDS = 0.06  # from a movement to the first picture of it, and between pictures while it is seen and lit


class OrbitWorker(ModeWorker):
    """Orbit's precomputed data of the open scene, and the request that changes it next."""

    n_points: int | None = None

    def __init__(self, context: WorkerContext) -> None:
        self._context = context
        self._orbit: Orbit | None = None
        self._moved: Follower | None = None
        self._caster: RayCaster | None = None
        self._rest: Scene | None = None
        self._poses: Poses = ()
        self._prepared = 0
        self._prepared_poses: Poses = ()
        self._exporter: tuple[int, PointExporter] | None = None
        self._posed: tuple[tuple[Scene, Poses], Scene, RayCaster] | None = None
        self._emission: tuple[tuple[str, RGB], ...] = ()
        self._effort: tuple[int, ...] = ()
        self._noted: tuple[str, ...] = ()
        self._catchers = CatcherEngine(context, self._new_alone)

    @property
    def handlers(self) -> Handlers:
        return {
            PrepareOrbit: self._prepare,
            DrawOrbit: self._draw,
            DrawHeadlight: self._draw_headlight,
            PrioritizeView: self._prioritize_view,
            EstimateOrbit: self._estimate,
        }

    def view_traced(self) -> None:
        caster, rest, poses = self._context.open_placement.caster, self._context.rest_scene, self._context.poses
        if caster is self._caster:  # the same scene from another camera
            return
        # Until what is drawn of the objects in their new places is there, those of before are shown in these.
        if rest is not self._rest:
            self._moved = None
        elif self._moved is None and self._orbit is not None and self._orbit.is_ready:
            self._moved = Follower(self._orbit, self._poses)
        if self._moved is not None and not self._moved.can_follow(rest, poses):
            self._moved = None
        self._orbit, self._caster, self._emission, self._posed = None, caster, (), None
        if rest is not self._rest:
            self._catchers.forget()
        self._rest, self._poses = rest, poses

    def _prepare(self, request: PrepareOrbit) -> Steps:
        scene = request.scene
        yield from ensure_tables((state.layer for state in scene.layers), self._context.store)
        sky = self._context.sky(scene.light)
        if (image := self._context.sky_image(sky)) is not None:
            yield image
        yield from self._context.until_compiled(ORBIT, COMPILING, goes_first=True)
        first_time, reported_version = not are_compiled(ORBIT), None  # still, where no other process compiles
        yield from _prepared_sky(sky, FIRST_TIME if first_time else "light")
        self._desire_catchers(request)
        if (moved := self._follower(request.poses)) is not None:
            yield from self._follow(moved, request, sky)
            if request.poses != self._poses:
                return
        orbit = self._open_orbit(self.n_points or request.n_points, request.n_coefficients)
        orbit.set_bumps(_bumps(self._context.open_placement.scene))
        if not orbit.n_bytes:  # there are no points yet
            self._context.store.get(_key(orbit), orbit.restore)
        if scene.emission != self._emission:
            orbit.set_emission(dict(scene.emission))
            self._emission = scene.emission
        orbit.set_light(sky)
        orbit.set_layers(layers_by_object(orbit.scene, scene.layers))
        orbit.set_bounces(request.n_bounces)
        self._prepared, self._prepared_poses = request.id, request.poses
        for step in self._catchers.working(orbit, _stage):
            if self._moved is not None and orbit.is_shadowed:
                orbit.version, self._moved = max(orbit.version, self._moved.orbit.version) + 1, None
            version = self._version(orbit)
            if self._moved is None and orbit.is_ready and version != reported_version:
                if reported_version is None and first_time:
                    yield from _warm_up(orbit)
                reported_version = version
                yield from self._export_parts(orbit, request)
                yield self._progress(orbit)
            yield Progress(STAGE, step.fraction, text=FIRST_TIME if first_time else step.text)
        self._moved = None
        if first_time:
            note_compiled(ORBIT)
        if orbit.notes != self._noted:
            self._noted = orbit.notes
            if orbit.notes:
                yield WorkerWarnings(orbit.notes)
        yield from self._export_parts(orbit, request)
        yield self._progress(orbit)
        for each in filter(None, (orbit, self._catchers.engine)):
            if each.has_traced:
                self._context.store.put(_key(each), each.stored_visibility())

    def _progress(self, orbit: Orbit, follows_move: bool = False) -> OrbitProgress:
        is_done, n_bytes = not follows_move and self._is_done(orbit), orbit.n_bytes + self._catchers.n_bytes
        return OrbitProgress(self._version(orbit), is_done, n_bytes, follows_move)

    def _version(self, orbit: Orbit) -> int:
        """The version of pictures that are drawn of this and of shadow catchers alone."""
        return orbit.version + self._catchers.version

    def _desire_catchers(self, request: PrepareOrbit) -> None:
        self._catchers.desire(request.catchers, (self.n_points or request.n_points, request.n_coefficients))
        alone, orbit = self._catchers.alone, self._catchers.engine
        if alone is not None and orbit is not None:
            orbit.set_emission(dict(alone.scene.emission))
            orbit.set_light(self._catchers.sky)
            orbit.set_layers(layers_by_object(orbit.scene, alone.scene.layers))
            orbit.set_bounces(request.n_bounces)

    def _new_alone(self, scene: Scene, n_points: int, n_coefficients: int) -> Orbit:
        from engine.realtime.triple_product.orbit_engine import Orbit

        orbit = Orbit(
            scene, None, n_points, n_coefficients, most_bytes=orbit_bytes() // 2,
            most_slice_bytes=orbit_slice_bytes() // 2,
        )  # fmt: skip
        if not orbit.n_bytes:  # there are no points yet
            self._context.store.get(_key(orbit), orbit.restore)
        return orbit

    def _follower(self, poses: Poses) -> Follower | None:
        """What follows objects to these poses, which are not those it was prepared for; None where nothing can, or need
        not."""
        moved, rest = self._moved, self._context.rest_scene
        if poses == self._poses:
            return moved if moved is not None and moved.can_follow(rest, poses) else None
        if moved is None:
            if self._orbit is None or not self._orbit.is_ready:
                return None
            moved = Follower(self._orbit, self._poses)
        if not moved.can_follow(rest, poses):
            return None
        self._moved, self._orbit = moved, None
        return moved

    def _follow(self, moved: Follower, request: PrepareOrbit, sky: SkyState) -> Steps:
        """Let what was prepared before follow objects to the poses of a request, coarse first. Where all is to be
        prepared for these anyway, only what is in sight."""
        scene, orbit = request.scene, moved.orbit
        orbit.set_emission(dict(scene.emission))
        orbit.set_light(sky)
        orbit.set_layers(layers_by_object(orbit.scene, scene.layers))
        posed = pose_scene(self._context.rest_scene, request.poses)
        posed = posed.with_bumps(_bumps(self._context.open_placement.scene)).with_emission(dict(scene.emission))
        moved.move(posed)
        self._prepared, self._prepared_poses = request.id, request.poses
        version, is_last = -1, request.poses == self._poses
        reported_at = time.monotonic()
        for step in moved.work(only_in_sight=is_last):
            if time.monotonic() - reported_at > MOVE_SECONDS:
                reported_at, version = time.monotonic(), orbit.version
                yield self._progress(orbit, follows_move=True)
            yield Progress(STAGE, step.fraction, text=step.text)
        if orbit.version != version:
            yield self._progress(orbit, follows_move=True)
        # Two of them take twice the memory.
        if is_last and 2 * orbit.n_bytes > orbit_bytes():
            self._moved = None

    def _is_done(self, orbit: Orbit) -> bool:
        """Whether nothing is left to be done for the poses that were requested: the view is traced in these."""
        is_all = orbit.is_done and self._catchers.is_done
        return is_all and self._moved is None and self._prepared_poses == self._poses

    @property
    def _drawn(self) -> Orbit | None:
        """What pictures are drawn of."""
        return self._orbit if self._moved is None else self._moved.orbit

    def _export_parts(self, orbit: Orbit, request: PrepareOrbit) -> Steps:
        """Export the parts that the listener does not have yet."""
        from engine.realtime.triple_product.gpu_export import PointExporter

        if not request.listener:
            self._exporter = None
            return
        if self._exporter is None or self._exporter[0] != request.listener:
            self._exporter = request.listener, PointExporter(request.most_bytes)
        for part in self._exporter[1].parts(orbit):
            yield OrbitPartExported(part)

    def _prioritize_view(self, request: PrioritizeView) -> Steps:
        orbit = self._orbit
        if orbit is not None:
            was_done = orbit.is_done
            orbit.prioritize_view(orbit.scene.from_camera(request.camera).description.camera)
            if was_done and not orbit.is_done and self._moved is None:
                yield replace(self._progress(orbit), is_done=False, id=self._prepared)

    def _draw(self, request: DrawOrbit) -> Steps:
        orbit, moved, later = self._drawn, self._moved, self._orbit
        if orbit is None or not orbit.is_ready:
            yield OrbitNotReady()
            return
        started, prepared, was_done = time.monotonic(), self._prepared, self._is_done(orbit)
        version, camera = self._version(orbit), _camera_of(orbit, request)
        drawing = draw_caught(
            orbit, self._catchers, partial(_draw_steps, request), camera, request.transparent,
            self._prepared_poses,
        )  # fmt: skip
        picture, are_caught = yield from map_steps(drawing, lambda step: None)
        # It may have seen parts that are not ready, such as back faces.
        is_done = was_done and self._is_done(orbit)
        if moved is not None and later is not None:  # which is to have the same in sight
            later.prioritize_view(later.scene.from_camera(request.camera).description.camera)
        yield OrbitPictureDrawn(
            picture, prepared, version, is_done, time.monotonic() - started, follows_move=moved is not None,
            are_caught=are_caught,
        )  # fmt: skip

    def _draw_headlight(self, request: DrawHeadlight) -> Steps:
        from engine.render.headlight import headlight_picture

        if not self._context.has_placement:
            yield OrbitNotReady()
            return
        started, sky = time.monotonic(), self._context.sky(request.scene.light)
        scene, caster = self._posed_scene(request.poses)
        seen, layers = (
            scene.from_camera(request.camera, request.resolution),
            layers_by_object(scene, request.scene.layers),
        )
        picture = yield from map_steps(
            headlight_picture(seen, caster, layers, sky, request.resolution, request.transparent), lambda step: None
        )
        yield OrbitPictureDrawn(picture, 0, 0, False, time.monotonic() - started)

    def _estimate(self, request: EstimateOrbit) -> Steps:
        from app.worker.error_tasks import estimate_drawn_error

        orbit = self._orbit
        if orbit is None or not orbit.is_ready:
            yield OrbitNotReady()
            return
        yield from estimate_drawn_error(
            request, self._context, orbit.n_bounces, lambda wanted: _draw_steps(wanted, orbit)
        )

    def _posed_scene(self, poses: Poses | None) -> tuple[Scene, RayCaster]:
        """The scene in these poses, None: as it is open, and its ray caster."""
        if poses is None:
            return self._context.open_placement.scene, self._context.open_placement.caster
        made_of = self._context.rest_scene, poses
        if self._posed is None or self._posed[0][0] is not made_of[0] or self._posed[0][1] != poses:
            scene = pose_scene(*made_of)
            self._posed = made_of, scene, scene_caster(scene)
        return self._posed[1:]

    def _open_orbit(self, n_points: int, n_coefficients: int) -> Orbit:
        """The precomputation of the open scene; a new one where it is to have other points, or coefficients at each."""
        effort = n_points, n_coefficients
        if self._orbit is None or effort != self._effort:
            from engine.realtime.triple_product.orbit_engine import Orbit

            scene = self._context.open_placement.scene
            former = None if self._moved is None else self._moved.former_points
            self._orbit = Orbit(
                scene, self._caster, n_points, n_coefficients, most_bytes=orbit_bytes(),
                most_slice_bytes=orbit_slice_bytes(), former=former,
            )  # fmt: skip
            self._exporter, self._noted = None, ()
            self._effort, self._emission = effort, ()
        return self._orbit


class Follower:
    """What was prepared of objects in some poses, and follows them to others that differ by transforms alone."""

    def __init__(self, orbit: Orbit, poses: Poses) -> None:
        """orbit: which is ready for these poses; it is changed from now on."""
        from engine.realtime.triple_product.moved_orbit import MovedOrbit

        self.orbit, self._poses = orbit, poses
        self._moved = MovedOrbit(orbit)
        self._movements: dict[int, NDArray[np.float64]] = {}

    def can_follow(self, rest: Scene, poses: Poses) -> bool:
        """Whether it can follow the objects of a scene, as its file has it, to these poses."""
        movements = movements_between(rest, self._poses, poses)
        self._movements = movements or {}
        return movements is not None

    def move(self, scene: Scene) -> None:
        """Follow them to the poses that were asked for last, which the scene is in."""
        self._moved.move(scene, self._movements)

    def work(self, only_in_sight: bool) -> Iterator[StillProgress]:
        """See and light what the movement concerns, the most of it first."""
        for step in self._moved.work():
            if only_in_sight and not self._moved.waits_in_sight:
                return
            yield step

    @property
    def former_points(self) -> FormerPoints:
        """What an Orbit for the new poses can take over."""
        return self._moved.former_points


def _prepared_sky(sky: SkyState, text: str) -> Steps:
    """The sky, prepared in steps, between which the window gets pictures of objects lit from the camera."""
    yield Progress(STAGE, 0.0, text=text)
    from engine.realtime.triple_product.incident import preparing_sky

    for environment in (sky.environment, *(link.sky.environment for link in sky.links)):
        for _ in preparing_sky(environment):
            yield Progress(STAGE, 0.0, text=text)


def _draw_steps(
    wanted: DrawOrbit, orbit: Orbit, apart: Collection[int] = ()
) -> Generator[StillProgress, None, NDArray[np.float32]]:
    """The requested picture, piece by piece; apart: see `Orbit.draw`."""
    how = wanted.quality, wanted.n_coefficients, True, wanted.transparent, apart
    return orbit.draw_steps(_camera_of(orbit, wanted), wanted.resolution, *how)


def _camera_of(orbit: Orbit, wanted: DrawOrbit) -> CameraDescription:
    return orbit.scene.from_camera(wanted.camera).description.camera


def _stage(orbit: Orbit) -> int:
    """How far it has come: nothing, light, shadows of what is seen, all."""
    return orbit.is_ready + orbit.is_shadowed + orbit.is_done


def _key(orbit: Orbit) -> str:
    """The key of its visibility in the cache."""
    return content_key("orbit visibility 5", *orbit.geometry)


def _bumps(scene: Scene) -> dict[str, Bumps]:
    """The bumps of its objects, by name."""
    return {described.name: described.bumps for described in scene.description.objects}


def _warm_up(orbit: Orbit) -> Steps:
    """Compile the drawing before the first picture is requested, which is a quick request."""
    camera = orbit.scene.description.camera
    for quality in ("moving", "rest"):
        yield Progress(STAGE, orbit.fraction, text=FIRST_TIME)
        yield from map_steps(orbit.draw_steps(camera, (8, 8), quality), lambda step: None)


def layers_by_object(scene: Scene, layers: Sequence[LayerState]) -> dict[int, tuple[Layer, ...]]:
    """The layers of each object, by its index."""
    return {
        index: tuple(state.layer for state in layers if state.object == name)
        for index, name in enumerate(scene.object_names)
    }
