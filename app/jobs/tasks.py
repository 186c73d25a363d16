"""What the worker does with each request: scenes and files here, all else the modes' works (`app.mode`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from app.document import document_from_description
from app.jobs.bench import Bench
from app.jobs.cache import Store
from app.jobs.kernels import Kernels
from app.jobs.labour import Labour
from app.jobs.measured import described_paths, hand_out, read_files, read_for, write_file
from app.jobs.schedule import Steps
from app.measurements import document_with_measurements, layers_of_document, unread_files, with_measurements
from app.messages import (
    FetchTable,
    SetCamera,
    OpenScene,
    Progress,
    ReadMeasured,
    Request,
    SceneOpened,
    ViewTraced,
    WriteFiles,
)
from app.mode import Mode
from app.modes import MODES
from app.lazy_import import import_named
from engine.scene.builtin import scene_path
from engine.scene.scene_loader import load_scene
from engine.scene.picture_frame import picture_frame


class Tasks:
    """The worker's state, and who carries out which request. Arguments: see `Bench`."""

    def __init__(
        self, store: Store | None = None, kernels: Kernels | None = None, fills: bool = False,
        modes: Sequence[Mode] = MODES, labour: Labour | None = None,
    ) -> None:  # fmt: skip
        self.bench = Bench(store, kernels, fills, labour)
        self._works = [import_named(mode.worker)(self.bench) for mode in modes]
        self._handlers: dict[type[Request], Callable[[Any], Steps]] = {
            OpenScene: self._open,
            SetCamera: self._look,
            ReadMeasured: self._read,
            FetchTable: self._hand_out,
            WriteFiles: self._write,
        }
        for work in self._works:
            self._handlers |= work.handlers

    def handle(self, request: Request) -> Steps:
        """The answers to a request, step by step."""
        yield from self._handlers[type(request)](request)
        yield from self.bench.noted()

    def _open(self, request: OpenScene) -> Steps:
        yield Progress("scene", 0.0, text="reading the scene")
        path = scene_path(request.source)
        scene = load_scene(path)
        document = document_from_description(request.source, scene.description)
        names = described_paths(unread_files(layers_of_document(document)), scene.folder, path)
        names |= {file: Path(file) for file in request.measured}
        measurements = yield from read_files(names, self.bench.store)
        self.bench.load(scene, request.id)
        description = scene.description.model_dump_json(by_alias=True)
        own = layers_of_document(document_with_measurements(document, measurements))
        layers = [*own, *(layer for layer in with_measurements(request.layers, measurements) if layer not in own)]
        planned = tuple(chain.from_iterable(work.plan(layers) for work in self._works))
        files = tuple(map(str, (*scene.files, *names.values())))
        yield SceneOpened(description, scene.notes, measurements, planned, scene.bounds, scene.animations, files)

    def _look(self, request: SetCamera) -> Steps:
        yield Progress("scene", 0.5, text="tracing what the camera sees")
        yield from self.bench.look(request)
        for work in self._works:
            work.view_traced()
        placement = self.bench.open_placement
        flaws = tuple(" ".join(str(error).split()) for error in placement.scene.bump_normals.flaws.values())
        yield ViewTraced(picture_frame(placement.hits, placement.scene.camera_position), flaws)

    def _read(self, request: ReadMeasured) -> Steps:
        yield from read_for(request, self.bench.store)

    def _hand_out(self, request: FetchTable) -> Steps:
        yield from hand_out(request, self.bench.store)

    def _write(self, request: WriteFiles) -> Steps:
        if request.document is None:
            yield from write_file(request, self.bench.store)
        else:
            from app.jobs.export import write_scene

            scene = self.bench.open_placement.scene
            yield from write_scene(request, request.document, scene, self.bench.store)
