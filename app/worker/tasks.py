"""Dispatches each request of the worker: scenes and files here, all else to the workers of the modes
(`app.modes.mode`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from app.document.document import document_from_description
from app.document.named_files import document_with_measurements, layers_of_document, unread_files, with_measurements
from app.messages.worker_messages import (
    FetchTable,
    OpenScene,
    Progress,
    ReadMeasured,
    Request,
    SceneOpened,
    SetCamera,
    ViewTraced,
    WriteFiles,
)
from app.modes.mode import Mode
from app.modes.registry import MODES
from app.system.lazy_import import import_named
from app.worker.cache import ArrayCache
from app.worker.file_tasks import described_paths, fetch_table, read_files, read_for, write_file, write_scene
from app.worker.kernels import Kernels
from app.worker.schedule import Steps
from app.worker.worker_context import Executor, WorkerContext
from engine.scene.builtin import scene_path
from engine.scene.picture_frame import picture_frame
from engine.scene.scene_loader import load_scene


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
            FetchTable: lambda request: fetch_table(request, self.context.store),
            WriteFiles: self._write,
        }
        for work in self._workers:
            self._handlers |= work.handlers

    def handle(self, request: Request) -> Steps:
        """The responses to a request, step by step."""
        yield from self._handlers[type(request)](request)
        yield from self.context.new_warnings()

    def _open(self, request: OpenScene) -> Steps:
        yield Progress("scene", 0.0, text="reading the scene")
        path = scene_path(request.source)
        scene = load_scene(path)
        document = document_from_description(request.source, scene.description)
        names = described_paths(unread_files(layers_of_document(document)), scene.folder, path)
        names |= {file: Path(file) for file in request.measured}
        measurements = yield from read_files(names, self.context.store)
        self.context.load(scene, request.id)
        description = scene.description.model_dump_json(by_alias=True)
        own = layers_of_document(document_with_measurements(document, measurements))
        layers = [*own, *(layer for layer in with_measurements(request.layers, measurements) if layer not in own)]
        planned = tuple(chain.from_iterable(work.plan(layers) for work in self._workers))
        files = tuple(map(str, (*scene.files, *names.values())))
        yield SceneOpened(description, scene.notes, measurements, planned, scene.bounds, scene.animations, files)

    def _set_camera(self, request: SetCamera) -> Steps:
        yield Progress("scene", 0.5, text="tracing what the camera sees")
        yield from self.context.set_camera(request)
        for work in self._workers:
            work.view_traced()
        placement = self.context.open_placement
        flaws = tuple(" ".join(str(error).split()) for error in placement.scene.bump_normals.flaws.values())
        yield ViewTraced(picture_frame(placement.hits, placement.scene.camera_position), flaws)

    def _write(self, request: WriteFiles) -> Steps:
        if request.document is None:
            yield from write_file(request, self.context.store)
        else:
            scene = self.context.open_placement.scene
            yield from write_scene(request, request.document, scene, self.context.store)
