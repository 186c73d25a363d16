"""The state that all work in the worker shares, and the dispatch of its requests: scenes and files here, all else to
the workers of the modes (`app.modes.mode`).

The state is the cache, the open scene and its light, and who does the long work. A scene is open as a camera sees it:
its surfaces, what can be traced in them, the primary hits and, as far as it has been computed, the part of the sphere
that each of those sees. A scene that is only loaded replaces the open one when its first view is traced. The long work
on it is done by an executor: this process, or others (`app.cluster.cluster_jobs`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from app.document.described import document_from_description
from app.document.document import Document
from app.document.light_mix import mixed_light
from app.document.light_state import LightState
from app.document.named_files import (
    document_with_measurements,
    layers_of_document,
    layers_with_variants,
    unread_files,
    with_measurements,
)
from app.document.node_layers import channel_images, n_nodes_of, plan_layers, with_node_layers
from app.document.scene_files import files_of_scene, split_axis, unpacked_scene_file, variants_of
from app.files.session import archived_session
from app.messages.file_messages import (
    ChannelsRead,
    ObjectsRead,
    ReadChannels,
    ReadColourView,
    ReadCurveTable,
    ReadMaterials,
    ReadMeasured,
    ReadObjects,
    ReadPicture,
    SaveEnvironment,
    SaveScene,
    WriteFiles,
)
from app.messages.light_path_messages import LightPathTraced, TraceLightPath
from app.messages.worker_messages import (
    FetchTable,
    OpenScene,
    Progress,
    Request,
    SceneOpened,
    SetCamera,
    SkyImage,
    ViewTraced,
    WorkerWarnings,
)
from app.modes.mode import Mode
from app.modes.registry import MODES
from app.project.distant_light import sky_of
from app.project.document_scene import posed_scene
from app.system.file_watch import file_stamp
from app.system.lazy_import import import_named
from app.worker.cache import ArrayCache, content_key
from app.worker.executor import Executor, LocalExecutor
from app.worker.file_tasks import (
    described_paths,
    fetch_table,
    read_channels,
    read_colour_view,
    read_curve_table,
    read_files,
    read_for,
    read_materials,
    read_stored_picture,
    save_environment,
    save_scene,
    write_file,
    write_scene,
)
from app.worker.kernels import FIRST_TIME, Kernels
from app.worker.schedule import Steps
from engine.core.errors import InsituError
from engine.light.environment import Environment, downsample, load_environment
from engine.material.opacity import OpacityByObject
from engine.material.parameter_nodes import known_nodes
from engine.planner import planned_edge_rays
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.zonal_harmonics.pose import Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.added_objects import Part, added_files, read_added, read_again
from engine.scene.composed_scene import ComposedScene, SceneComposer
from engine.scene.composition import Composition
from engine.scene.cutouts import scene_caster
from engine.scene.description import ObjectDescription
from engine.scene.import_report import report_scene
from engine.scene.light_paths import describe_light_path
from engine.scene.picture_frame import picture_frame
from engine.scene.primary_hits import trace_primary_steps
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene

# Raised when anything that changes the numbers in a cached array changes.
CACHE_VERSION = 6
BACKGROUND_HEIGHT = 1024


class WorkerContext:
    """The shared state of the worker.

    kernels: what is to be ready before the first picture; None where nothing prepares them. fills: only fill the cache;
    results are neither held nor sent. executor: who does the long work, None for this process.
    """

    def __init__(
        self, store: ArrayCache | None = None, kernels: Kernels | None = None, fills: bool = False,
        executor: Executor | None = None,
    ) -> None:  # fmt: skip
        self.store = store or ArrayCache()
        self.kernels = kernels
        self.fills = fills
        self.executor = executor or LocalExecutor()
        self.geometry_key = self.view_key = ""
        self.view_id = 0
        self._placement: Placement | None = None
        self._scene = self._loaded = _LoadedScene()
        self._environments: dict[tuple[str, str], Environment] = {}
        self._sent_sky: tuple[object, ...] | None = None

    def is_compiled(self, what: str) -> bool:
        """Whether there is nothing to wait for before one of `app.worker.kernels.LATER` is called."""
        return self.kernels is None or self.kernels.is_ready(what)

    def until_compiled(self, what: str, stage: str = "", goes_first: bool = False) -> Iterator[Progress | None]:
        """Wait for one of `LATER` in steps, between which other requests are answered. stage: what the user waits for,
        empty where nobody does; goes_first: see `Kernels.until_ready`."""
        if self.kernels is not None:
            for _ in self.kernels.until_ready(what, goes_first):
                yield Progress(stage, 0.0, text=FIRST_TIME) if stage else None

    @property
    def open_placement(self) -> Placement:
        """The open scene, as its camera sees it; InsituError where none is."""
        if self._placement is None:
            raise InsituError("no scene is open")
        return self._placement

    @property
    def has_placement(self) -> bool:
        """Whether a scene is open."""
        return self._placement is not None

    @property
    def rest_scene(self) -> Scene:
        """The open scene at rest, whatever pose it is in, with the view's opacities; InsituError where none is."""
        if self._scene.resting is None:
            raise InsituError("no scene is open")
        return self._scene.resting[1]

    @property
    def poses(self) -> Poses:
        """The poses that the open scene was traced in."""
        return () if self._scene.pose is None else self._scene.pose[0]

    def load(self, scene: Scene, id: int, added: Mapping[ObjectDescription, Part] = MappingProxyType({})) -> None:
        """Note that a scene is loaded and can be traced, by the request of that number, and which objects were read
        besides."""
        self._loaded = _LoadedScene(id, SceneComposer(scene))
        self.note_added(added)
        self._environments = {}  # another program may have written the file

    def note_added(self, parts: Mapping[ObjectDescription, Part]) -> None:
        """Note objects that were read to be added."""
        for each in (self._scene, self._loaded):
            if each.composer is not None:
                each.composer.note(parts)

    def scene_of(self, document: Document) -> Scene:
        """The open scene with the objects of a document where it has them, whatever the camera sees. Raises
        InsituError where some cannot be read."""
        if self._scene.composer is None:
            raise InsituError("no scene is open")
        scene = posed_scene(self._scene.composer, document)
        seen = self.open_placement.scene
        return scene.with_bumps(dict(document.new_bumps)).from_camera(seen.description.camera, seen.resolution)

    def set_camera(self, request: SetCamera) -> Generator[None, None, ComposedScene]:
        """Open a loaded scene as this camera sees it, after some steps; that may be the background alone. Returns what
        its objects are."""
        seen = next((each for each in (self._loaded, self._scene) if each.id == request.scene), _LoadedScene())
        if seen.composer is None:
            raise InsituError("no scene is open")
        scene, caster = seen.in_poses(request.poses, request.opacities, request.composition)
        n_edge_rays = planned_edge_rays(scene.description) if request.n_edge_rays is None else request.n_edge_rays
        scene = scene.with_bumps(dict(request.bumps)).from_camera(request.camera, request.resolution)
        hits = yield from trace_primary_steps(scene, caster, n_edge_rays=n_edge_rays)
        placement = Placement(scene, caster, hits=hits)
        self._scene, self._loaded = seen, _LoadedScene()
        self._placement, self.view_id = placement, request.id
        self.geometry_key = _geometry_key(placement.scene, n_edge_rays)
        self.view_key = _view_key(placement, self.geometry_key)
        self._sent_sky = None
        assert seen.composed is not None
        return seen.composed

    def new_warnings(self) -> Iterator[WorkerWarnings]:
        """Warnings about the cache and about images that are shown smaller, as soon as there are new ones."""
        lines = self.store.take_notes()
        if self._placement is not None:
            lines += self._placement.scene.textures.take_notes()
        if lines:
            yield WorkerWarnings(lines)

    def sky(self, light: LightState) -> SkyState:
        """The sky of the open scene, under a document's light, mixed. Raises LoadError."""
        return self.sky_over(self.open_placement.scene, light)

    def sky_over(self, scene: Scene, light: LightState) -> SkyState:
        """The same of the open scene with other objects."""
        return sky_of(scene, light, self._environment)

    def sky_image(self, sky: SkyState) -> SkyImage | None:
        """The image of the sky, when it is not the one that was sent last."""
        environment = sky.environment
        shown = () if environment is None else (environment.digest, sky.scale, environment.notes)
        if shown == self._sent_sky:
            return None
        self._sent_sky = shown
        if environment is None:
            return SkyImage(np.zeros((1, 2, 3), np.float32), id=self.view_id)
        if environment.radiance.shape[0] > BACKGROUND_HEIGHT:
            environment = downsample(environment, BACKGROUND_HEIGHT)
        return SkyImage(environment.radiance * np.float32(sky.scale), environment.notes, id=self.view_id)

    def _environment(self, path: Path, mapping: str) -> Environment:
        key = (str(path), mapping)
        if key not in self._environments:
            self._environments = {key: load_environment(path, mapping)}  # type: ignore[arg-type]
        return self._environments[key]


@dataclass
class _LoadedScene:
    """The number of a scene's request, what composes it, the scene with its present objects and the composition that
    was asked for, that with its present opacities, and that in its present pose with its ray caster."""

    id: int = -1
    composer: SceneComposer | None = None
    composed: ComposedScene | None = None
    asked: Composition | None = None
    resting: tuple[OpacityByObject, Scene] | None = None
    pose: tuple[Poses, Scene, RayCaster] | None = None

    def in_poses(
        self, poses: Poses, opacities: OpacityByObject, composition: Composition | None = None
    ) -> tuple[Scene, RayCaster]:
        """The scene of these objects in these poses, and its ray caster: the same ones as long as all of these are.
        Objects that cannot be read are left out (`composed` says which)."""
        assert self.composer is not None
        if self.composed is None or self.asked != composition or self.composed.missing:
            own = ComposedScene(self.composer.own, ())
            self.composed, self.asked = own if composition is None else self.composer.compose(composition), composition
            self.resting = None
        if self.resting is None or self.resting[0] != opacities:
            scene = self.composed.scene
            self.resting = opacities, scene.with_opacities(dict(opacities)) if opacities else scene
            self.pose = None
        if self.pose is None or self.pose[0] != poses:
            scene = pose_scene(self.resting[1], poses)
            self.pose = poses, scene, scene_caster(scene)
        return self.pose[1:]


def _view_key(placement: Placement, geometry: str) -> str:
    """The key of what light depends on of the view: the surfaces, the bumps that perturb their normals, and the
    rotations of their tangents."""
    scene = placement.scene
    normals = [placement.hits.normal] if scene.bump_normals.objects else []
    normals += [placement.hits.coat_normal] if placement.hits.coat_normal is not None else []
    rotations = [scene.tangent_rotations.digest] if scene.tangent_rotations.digest else []
    return content_key(geometry, *normals, *rotations) if normals or rotations else geometry


def _geometry_key(scene: Scene, n_edge_rays: int) -> str:
    """The key of what visibility depends on of the view."""
    camera = scene.description.camera.model_dump_json()
    return content_key(
        CACHE_VERSION, camera, scene.origin, scene.resolution, n_edge_rays, scene.vertices, scene.normals,
        scene.triangles, scene.object_of_triangle, scene.smooth, scene.emission, scene.cones,
        scene.cutouts.digest, scene.emission_textures.digest,
    )  # fmt: skip


class RequestDispatcher:
    """The worker's state, and the handler of each request. Arguments: see `WorkerContext`."""

    def __init__(
        self, store: ArrayCache | None = None, kernels: Kernels | None = None, fills: bool = False,
        modes: Sequence[Mode] = MODES, executor: Executor | None = None,
    ) -> None:  # fmt: skip
        self.context = WorkerContext(store, kernels, fills, executor)
        self._workers = [import_named(mode.worker)(self.context) for mode in modes]
        self._handlers: dict[type[Request], Callable[[Any], Steps]] = {
            OpenScene: self._open,
            SetCamera: self._set_camera,
            ReadMeasured: lambda request: read_for(request, self.context.store),
            ReadCurveTable: read_curve_table,
            ReadMaterials: read_materials,
            ReadColourView: read_colour_view,
            ReadPicture: read_stored_picture,
            ReadObjects: self._read_objects,
            ReadChannels: self._read_channels,
            TraceLightPath: self._trace_light_path,
            FetchTable: lambda request: fetch_table(request, self.context.store),
            WriteFiles: self._write,
            SaveEnvironment: self._save_environment,
            SaveScene: lambda request: save_scene(request, self.context.scene_of(request.document)),
        }
        for work in self._workers:
            self._handlers |= work.handlers

    def handle(self, request: Request) -> Steps:
        """The responses to a request, step by step."""
        yield from self._handlers[type(request)](request)
        yield from self.context.new_warnings()

    def _open(self, request: OpenScene) -> Steps:
        yield Progress("scene", 0.0, text="reading the scene")
        path = unpacked_scene_file(request.source)
        has_session = archived_session(request.source) is not None  # one that cannot be read is refused before all else
        scene = load_scene(path, None, split_axis(request.source)[1], variants_of(request.source))
        document = document_from_description(request.source, scene.description)
        names = described_paths(unread_files(layers_with_variants(document)), scene.folder, path)
        names |= {file: Path(file) for file in request.measured}
        measurements = yield from read_files(names, self.context.store)
        added, problems, parts = read_again(request.added, scene)
        read = (*scene.files, *files_of_scene(request.source), *names.values(), *added_files(added))
        files = {str(path): file_stamp(path) for path in read}
        self.context.load(scene, request.id, parts)
        description = scene.description.model_dump_json(by_alias=True)
        wanted = dict.fromkeys(each.image for layer in request.layers for each in layer.parameter_maps)
        channels, _ = read_channels(scene, (*channel_images(document), *wanted))
        document = document_with_measurements(document, measurements)
        own = layers_of_document(with_node_layers(document, channels))
        plan_layers(request.layers, channels)
        layers = [*own, *(layer for layer in with_measurements(request.layers, measurements) if layer not in own)]
        planned = tuple(chain.from_iterable(work.plan(layers) for work in self._workers))
        yield SceneOpened(
            description,
            scene.notes + problems,
            measurements,
            planned,
            scene.bounds,
            scene.animations,
            files,
            report_scene(scene),
            channels,
            scene.cameras,
            known_nodes(channels),
            added,
            has_session,
        )

    def _set_camera(self, request: SetCamera) -> Steps:
        yield Progress("scene", 0.5, text="tracing what the camera sees")
        composed = yield from self.context.set_camera(request)
        for work in self._workers:
            work.view_traced()
        placement = self.context.open_placement
        flaws = tuple(" ".join(str(error).split()) for error in placement.scene.surface_flaws.values())
        frame = picture_frame(placement.hits, placement.scene.camera_position)
        yield ViewTraced(frame, flaws, composed.missing, composed.problems)

    def _read_objects(self, request: ReadObjects) -> Steps:
        yield Progress("scene", 0.0, text=f"reading {Path(request.what).name}")
        read = read_added(request.what, self.context.open_placement.scene, request.at, request.size)
        self.context.note_added(read.parts)
        yield ObjectsRead(read.objects, read.notes)

    def _read_channels(self, request: ReadChannels) -> Steps:
        scene = self.context.open_placement.scene
        needed = chain.from_iterable(map(channel_images, request.documents))
        # All of them anew: a file may have been written meanwhile, and nodes follow from what is read now.
        found, refused = read_channels(scene, dict.fromkeys((*request.images, *needed)))
        for document in request.documents:
            yield None
            with_node_layers(document, found, n_nodes_of(document))
        yield ChannelsRead(found, refused, known_nodes(found))

    def _trace_light_path(self, request: TraceLightPath) -> Steps:
        placement = self.context.open_placement
        yield LightPathTraced(describe_light_path(request.path, placement.scene, placement.caster))

    def _save_environment(self, request: SaveEnvironment) -> Steps:
        sky = self.context.sky(mixed_light(request.document))
        yield from save_environment(request, self.context.open_placement.scene, sky)

    def _write(self, request: WriteFiles) -> Steps:
        if request.document is None:
            yield from write_file(request, self.context.store)
        else:
            scene = self.context.scene_of(request.document)
            yield from write_scene(request, request.document, scene, self.context.store)
