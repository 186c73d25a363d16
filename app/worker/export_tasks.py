"""The worker's part of exporting a scene to another program."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

from app.document.document import Document
from app.document.named_files import files_of_document, layers_of_document
from app.export.mitsuba import export_steps
from app.messages.worker_messages import FilesWritten, Progress, Response, WriteFiles
from app.project.project import Project
from app.system.inputs import set_inputs
from app.worker.measured_tasks import ensure_tables
from engine.core.generators import map_steps
from engine.measured.tables import ArrayStore
from engine.scene.scene_loader import Scene

STAGE = "export"


def write_scene(
    request: WriteFiles, document: Document, scene: Scene, store: ArrayStore | None
) -> Generator[Response | None, None, None]:
    """Write the folder for Mitsuba 3. Raises InsituError."""
    yield from ensure_tables(layers_of_document(document), store)
    set_inputs((*scene.files, *files_of_document(document)))
    steps = export_steps(Project(scene, document), Path(request.path), request.n_bounces)
    notes = yield from map_steps(steps, lambda step: Progress(STAGE, step[0], text=f"writing {step[1]}"))
    yield FilesWritten(request.path, tuple(notes))
