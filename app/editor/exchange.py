"""Measured materials read into a document, and files written for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from app.document.commands import EditCommand
from app.document.document import Document, Selection
from app.document.selection import layer_shown
from app.document.view_state import ViewState
from app.export import written_names
from app.files.materials import PendingMeasurement, describe_reading, import_measured
from app.messages.worker_messages import MeasurementsRead, Request, WriteFiles
from app.modes.mode import ModeController
from app.system.atomic import require_folder, require_place
from engine.core.errors import InsituError
from engine.core.safe_files import resolved


class ExchangeHost(Protocol):
    """What the exchange of files needs of the editor."""

    view: ViewState
    controller: ModeController

    @property
    def document(self) -> Document: ...

    @property
    def scene_is_open(self) -> bool: ...

    def do(self, command: EditCommand) -> str | None: ...

    def select(self, path: str | Selection | None) -> str | None: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


class FileExchange:
    """Imports and exports of one editor. `send` sends a request to the worker, which reads and writes the files;
    `reading`: the edit that waits for a file to be read."""

    def __init__(self, host: ExchangeHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self.reading = PendingMeasurement(send)

    def import_measured(self, path: Path, cloth: bool = False) -> str | None:
        """Make the selected object of a measured file, once the worker has read it: two layers, or one as `cloth`.
        Returns None, or the reason why not."""
        host = self._host
        if host.view.selected is None:
            return self._refuse(f"{path.name}: select the object to make of it")
        try:
            command = import_measured(host.view.selected.object, path, cloth)
        except InsituError as error:
            return self._refuse(str(error))
        return host.do(command)

    def take_measurements(self, response: MeasurementsRead) -> None:
        """Carry out the edit that waited for these measurements."""
        host, command = self._host, self.reading.complete_edit(response)
        if command is None:
            return
        host.controller.add_band_plans(zip(command.layers, response.planned, strict=False))
        if host.do(command) is None:
            host.select(command.object)
            host.notify(describe_reading(command.layers))

    def export_measured(self, path: Path) -> str | None:
        """Export the selected object's material as a MERL file; returns None, or one line that says why not."""
        selected = layer_shown(self._host.document, self._host.view.selected)
        if selected is None:
            return self._refuse(f"{path.name}: select the object whose material to export")
        try:
            require_place(path)
        except InsituError as error:
            return self._refuse(str(error))
        self._send(WriteFiles(str(resolved(path)), self._host.document.object(selected.object).layers))
        return None

    def export_scene(self, folder: Path) -> str | None:
        """Export the scene for Mitsuba 3, as it is now and with the number of bounces in the picture; returns None, or
        one line that says why not."""
        host = self._host
        if not host.scene_is_open:
            return self._refuse(f"{folder.name}: no scene is open that could be written")
        try:
            require_folder(folder, written_names([state.name for state in host.document.objects]))
        except InsituError as error:
            return self._refuse(str(error))
        self._send(WriteFiles(str(resolved(folder)), (), host.document, max(host.view.settings.n_bounces, 1)))
        return None

    def _refuse(self, line: str) -> str:
        self._host.notify(line, True)
        return line
