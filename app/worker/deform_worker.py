"""Deform in the worker: precomputes transfer of the scene at rest, and between the steps draws pictures of any pose.

Precomputation continues where it was left off, whatever ended it; fitted transfer is cached on disk, object by object.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Generator, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Progress
from app.modes.deform.deform_messages import (
    DeformLoss,
    DrawDeform,
    EstimateDeform,
    GlossDecided,
    GlossPlan,
    PathPreview,
    PathsTraced,
    PoseExported,
    PrepareDeform,
)
from app.modes.mode import ModeWorker
from app.modes.orbit.orbit_messages import OrbitNotReady, OrbitPictureDrawn, OrbitProgress
from app.worker.cache import ArrayCache, content_key
from app.worker.catcher_engines import CatcherEngine, draw_caught
from app.worker.file_tasks import ensure_tables
from app.worker.kernels import COMPILING, DEFORM, FIRST_TIME, are_compiled, note_compiled
from app.worker.orbit_worker import layers_by_object
from app.worker.schedule import Handlers, Steps
from app.worker.tasks import WorkerContext
from engine.core.generators import StillProgress, run_to_end
from engine.core.stored_arrays import ArrayReader, Arrays, UnsoundArrays
from engine.precompute.direct.pipeline import SkyState
from engine.scene.description import CameraDescription
from engine.scene.scene_loader import Scene

if TYPE_CHECKING:
    from app.document.scene_state import SceneState
    from engine.realtime.stills import PathReference
    from engine.realtime.zonal_harmonics.deform_engine import Deform
    from engine.realtime.zonal_harmonics.zonal import Zonal

STAGE = "deform"
_NO_PICTURE = np.zeros((0, 0, 3), np.float32)
_ROUNDING = 1e-5  # of axes in single precision


class DeformWorker(ModeWorker):
    """Deform's precomputed data of the open scene, and the request that changes it next."""

    n_points: int | None = None
    n_rays: int | None = None
    n_passes: int | None = None

    def __init__(self, context: WorkerContext) -> None:
        self._context = context
        self._deform: Deform | None = None
        self._scene: Scene | None = None
        self._reference: tuple[tuple[PathPreview, SceneState, int], PathReference] | None = None
        self._prepared = 0
        self._catchers = CatcherEngine(context, self._new_deform)

    @property
    def handlers(self) -> Handlers:
        return {PrepareDeform: self._prepare, DrawDeform: self._draw, EstimateDeform: self._estimate}

    def view_traced(self) -> None:
        scene = self._context.rest_scene
        if scene is not self._scene:  # another one, not the same from another camera or in another pose
            self._deform, self._scene, self._reference = None, scene, None
            self._catchers.forget()

    def _prepare(self, request: PrepareDeform) -> Steps:
        scene = request.scene
        yield from ensure_tables((state.layer for state in scene.layers), self._context.store)
        sky = self._context.sky(scene.light)
        if (image := self._context.sky_image(sky)) is not None:
            yield image
        yield from self._context.until_compiled(DEFORM, COMPILING, goes_first=True)
        first_time, reported_version = not are_compiled(DEFORM), None  # still, where no other process compiles
        if first_time:
            yield Progress(STAGE, 0.0, text=FIRST_TIME)
        deform = self._open_deform()
        deform.set_emission(dict(scene.emission))
        deform.set_light(sky)
        deform.set_layers(layers_by_object(deform.scene, scene.layers))
        deform.set_surfaces(request.surfaces)
        deform.set_bending(request.posed)
        deform.set_moved(request.moved, request.lamps)
        deform.set_effort(self.n_rays or request.n_rays, request.n_lobes, request.n_gloss_rows)
        deform.set_bounces(request.n_bounces)
        self._desire_catchers(request)
        self._prepared = request.id
        if deform.is_ready and not first_time:  # what was edited shows before any step of work
            reported_version = self._version(deform)
            yield self._progress(deform)
        for step in self._catchers.working(deform, _stage):
            version = self._version(deform)
            if deform.is_ready and version != reported_version:
                if reported_version is None and first_time:  # compile the drawing before a quick request does
                    deform.draw(deform.scene.description.camera, (8, 8))
                reported_version = version
                yield self._progress(deform)
            yield Progress(STAGE, step.fraction, text=FIRST_TIME if first_time else step.text)
        if first_time:
            note_compiled(DEFORM)
        names = deform.scene.object_names
        yield DeformLoss(tuple((names[i], share) for i, share in deform.lost_shares.items()))
        yield GlossDecided(tuple(_gloss_plans(deform, scene)))
        yield self._progress(deform)
        if request.traced is not None:
            yield from self._trace(deform, request, sky, request.traced)

    def _trace(self, deform: Deform, request: PrepareDeform, sky: SkyState, wanted: PathPreview) -> Steps:
        """Trace paths, pass by pass; continues where it was left off."""
        from engine.realtime.stills import N_PASSES, PathReference

        layers, n_bounces = layers_by_object(deform.scene, request.scene.layers), request.n_bounces or 1
        made_of = wanted, request.scene, n_bounces
        if self._reference is None or self._reference[0] != made_of:
            scene = deform.scene.from_camera(wanted.camera, wanted.resolution)
            self._reference = made_of, PathReference(scene, wanted.poses)
        truth, n_passes = self._reference[1], self.n_passes or N_PASSES
        yield PathsTraced(truth.n_passes, n_passes)
        while truth.n_passes < n_passes:
            for _ in truth.trace(layers, sky, n_bounces):
                yield Progress(STAGE, truth.n_passes / n_passes, text="paths")
            deform.version += 1
            yield PathsTraced(truth.n_passes, n_passes)
            yield self._progress(deform)

    def _draw(self, request: DrawDeform) -> Steps:
        deform = self._deform
        if deform is None or not deform.is_ready:
            yield OrbitNotReady()
            return
        started, are_caught = time.monotonic(), False
        camera = deform.scene.from_camera(request.camera).description.camera
        export = (
            None if request.sent_parts is None else deform.export_picture(camera, request.poses, request.sent_parts)
        )
        if export is not None:
            picture = _NO_PICTURE
        elif request.fit_error:
            picture = deform.draw_errors(camera, request.resolution, request.poses)
        else:
            picture, are_caught = self._light_picture(deform, camera, request)
        if request.split is not None:
            picture = self._split_picture(picture, deform, camera, request, request.split)
        seconds, carried = time.monotonic() - started, tuple(deform.carried(request.poses).items())
        drawn = picture, self._prepared, self._version(deform), self._is_done(deform), seconds, carried
        if export is None:
            yield OrbitPictureDrawn(*drawn, are_caught=are_caught)
        else:
            yield PoseExported(*drawn, export=export)

    def _light_picture(
        self, deform: Deform, camera: CameraDescription, request: DrawDeform
    ) -> tuple[NDArray[np.float32], bool]:
        """The picture of light, and whether it shows shadows in place of their catchers."""

        def draw(engine: Deform, apart: Collection[int]) -> Generator[StillProgress, None, NDArray[np.float32]]:
            yield StillProgress(0.0, "")
            poses = request.poses
            if engine is not deform:  # what is alone is in its poses, except lamps
                assert self._catchers.alone is not None
                poses = self._catchers.alone.lamps_of(poses)
            how = poses, request.quality, True, request.transparent
            return engine.draw(camera, request.resolution, *how, apart)

        drawing = draw_caught(
            deform, self._catchers, draw, camera, request.transparent, request.poses
        )  # fmt: skip
        return run_to_end(drawing)

    def _progress(self, deform: Deform) -> OrbitProgress:
        n_bytes = deform.n_bytes + self._catchers.n_bytes
        return OrbitProgress(self._version(deform), self._is_done(deform), n_bytes)

    def _version(self, deform: Deform) -> int:
        """The version of pictures that are drawn of this and of shadow catchers alone."""
        return deform.version + self._catchers.version

    def _is_done(self, deform: Deform) -> bool:
        return deform.is_done and self._catchers.is_done

    def _desire_catchers(self, request: PrepareDeform) -> None:
        self._catchers.desire(request.catchers)
        alone, deform = self._catchers.alone, self._catchers.engine
        if alone is not None and deform is not None:
            deform.set_emission(dict(alone.scene.emission))
            deform.set_light(self._catchers.sky)
            deform.set_layers(layers_by_object(deform.scene, alone.scene.layers))
            deform.set_surfaces(alone.document.new_surfaces)
            deform.set_moved((), alone.lamps_of(request.lamps))
            deform.set_effort(self.n_rays or request.n_rays, request.n_lobes, request.n_gloss_rows)
            deform.set_bounces(request.n_bounces)

    def _estimate(self, request: EstimateDeform) -> Steps:
        from app.worker.error_tasks import estimate_drawn_error

        deform = self._deform
        if deform is None or not deform.is_ready:
            yield OrbitNotReady()
            return

        def drawing(wanted: DrawDeform) -> Generator[None, None, NDArray[np.float32]]:
            camera = deform.scene.from_camera(wanted.camera).description.camera
            yield
            return deform.draw(camera, wanted.resolution, wanted.poses, wanted.quality)

        yield from estimate_drawn_error(request, self._context, request.n_bounces or 1, drawing)

    def _split_picture(
        self, picture: NDArray[np.float32], deform: Deform, camera: CameraDescription, request: DrawDeform,
        split: tuple[float, float],
    ) -> NDArray[np.float32]:  # fmt: skip
        """The split picture: from left to right what paths show, transfer that does not rotate, and the picture."""
        from engine.realtime.stills import compose_split

        stays = deform.draw(camera, request.resolution, request.poses, request.quality, turned=False)
        traced = None
        if self._reference is not None:
            wanted, *_ = self._reference[0]
            is_same = (dict(wanted.camera), wanted.poses) == (dict(request.camera), request.poses)
            traced = self._reference[1].picture if is_same else None
        return compose_split(traced, stays, picture, split)

    def _open_deform(self) -> Deform:
        if self._deform is None:
            self._deform = self._new_deform(self._context.rest_scene)
        return self._deform

    def _new_deform(self, scene: Scene) -> Deform:
        from engine.realtime.zonal_harmonics.deform_engine import N_POINTS, Deform

        return Deform(scene, self.n_points or N_POINTS, store=StoredLobes(self._context.store))


def _stage(deform: Deform) -> int:
    """How far it has come: nothing, light, all."""
    return deform.is_ready + deform.is_done


def _gloss_plans(deform: Deform, scene: SceneState) -> Iterator[GlossPlan]:
    decided = deform.gloss
    for state in scene.layers:
        gloss = decided.get((deform.scene.object_index(state.object), state.layer))
        if gloss is not None:
            yield GlossPlan(state.key, gloss.choice.value, gloss.choice.reason, gloss.n_bytes)


class StoredLobes:
    """Fitted transfer, cached on disk."""

    def __init__(self, store: ArrayCache) -> None:
        self._store = store

    def get(self, made_of: tuple[object, ...], n_places: int) -> Zonal | None:
        """The cached transfer of so many places; None where there is none, or none that is sound."""
        return self._store.get(_key(made_of), lambda arrays: stored_lobes(arrays, n_places))

    def put(self, made_of: tuple[object, ...], zonal: Zonal) -> None:
        arrays: dict[str, NDArray[np.generic]] = {
            name: np.asarray(getattr(zonal, name), np.float32) for name in ("low", "axes", "coefficients", "errors")
        }
        self._store.put(_key(made_of), arrays)


def _key(made_of: tuple[object, ...]) -> str:
    return content_key("deform lobes 1", *made_of)  # type: ignore[arg-type]


def stored_lobes(arrays: Arrays, n_places: int) -> Zonal:
    """Zonal lobes of so many places, as pictures are drawn of. Raises UnsoundArrays."""
    from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, ORDER
    from engine.realtime.zonal_harmonics.zonal import Zonal

    reader = ArrayReader(arrays, points=n_places, order=ORDER)
    low, axes = reader.take("low", np.float32, "points", 4), reader.take("axes", np.float32, "points", "lobes", 3)
    coefficients = reader.take("coefficients", np.float32, "points", "lobes", "order")
    if not 1 <= reader.sizes["lobes"] <= N_LOBES:
        raise UnsoundArrays(f"{reader.sizes['lobes']} lobes, expected 1 to {N_LOBES}")
    if (np.abs(np.linalg.norm(axes.astype(np.float64), axis=2) - 1.0) > _ROUNDING).any():
        raise UnsoundArrays("'axes' are not of length 1")
    return Zonal(low, axes, coefficients, reader.take("errors", np.float32, "points"))
