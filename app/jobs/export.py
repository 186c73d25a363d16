"""The worker's share of exporting a scene to another program."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

from app.document import Document
from app.export.mitsuba import export_steps
from app.jobs.measured import ensure_tables
from app.jobs.messages import FilesWritten, Progress, Response, WriteFiles
from app.project import Project
from engine.measured.tables import ArrayStore
from engine.scene.load import Scene

STAGE = "export"


def write_scene(
    request: WriteFiles, document: Document, scene: Scene, store: ArrayStore | None
) -> Generator[Response | None, None, None]:
    """Write the folder for Mitsuba 3. Raises InsituError."""
    yield from ensure_tables(request.measured, store)
    steps = export_steps(Project(scene, document), Path(request.path), request.n_bounces)
    while True:
        try:
            fraction, name = next(steps)
        except StopIteration as end:
            yield FilesWritten(request.path, tuple(end.value))
            return
        yield Progress(STAGE, fraction, text=f"writing {name}")
