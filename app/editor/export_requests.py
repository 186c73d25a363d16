"""Requests to write files for other programs."""

from __future__ import annotations

from pathlib import Path

from app.document.document import Document
from app.document.view_state import ViewState
from app.messages.worker_messages import WriteFiles
from engine.core.safe_files import resolved


def material_export_request(path: Path, document: Document, object_name: str) -> WriteFiles:
    """Export an object's material as a MERL file."""
    return WriteFiles(str(resolved(path)), document.object(object_name).layers)


def scene_export_request(folder: Path, document: Document, view: ViewState) -> WriteFiles:
    """Export the scene for Mitsuba 3, as it is now and with the number of bounces in the picture."""
    return WriteFiles(str(resolved(folder)), (), document, max(view.n_bounces, 1))
