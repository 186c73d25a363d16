"""Measured materials, tables of curves and objects read into a document, and files written for other programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from app.document.commands import EditCommand
from app.document.commands.curves import AddOperator
from app.document.commands.objects import AddObject
from app.document.document import Document, ObjectState, Selection
from app.document.selection import layer_shown
from app.document.view_state import ViewState
from app.export import require_package_place, written_names
from app.export.environment import require_environment_file
from app.files.material_files import import_material
from app.files.materials import PendingMeasurement, describe_reading, import_measured
from app.messages.file_messages import (
    CurveTableRead,
    FilesWritten,
    MaterialsRead,
    MeasurementsRead,
    ObjectsRead,
    ReadCurveTable,
    ReadObjects,
    SaveEnvironment,
    SaveScene,
    WriteFiles,
)
from app.messages.worker_messages import Request
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
    `reading`: the edit that waits for measured files to be read."""

    def __init__(self, host: ExchangeHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self.reading = PendingMeasurement(send)
        self._table: tuple[int, str, str] | None = None  # the request, and the curve that its table is for
        self._late: CurveTableRead | None = None  # one that came during a drag
        self._late_material: MeasurementsRead | MaterialsRead | None = None  # as well
        self._adding: list[AddObject] = []  # the first one's objects are being read, by the request of that number
        self._adding_id = -1
        self._late_objects: tuple[ObjectsRead, tuple[ObjectState, ...]] | None = None  # as well
        self._writing = set[int]()  # the requests

    @property
    def is_writing(self) -> bool:
        """Whether the worker is writing files."""
        return bool(self._writing)

    @property
    def is_reading(self) -> bool:
        """Whether an edit waits for files to be read."""
        return self.reading.is_under_way or self._table is not None or bool(self._adding)

    def cancel(self, id: int | None = None) -> None:
        """Give up the edits that wait, or only those that wait for that request."""
        self.reading.cancel(id)
        self._writing.discard(-1 if id is None else id)
        if id is None:
            self._adding.clear()
            self._late_objects = None
        elif id == self._adding_id:
            self._read_next()
        if self._table is not None and id in (None, self._table[0]):
            self._table = self._late = None

    def defer_command(self, command: object) -> bool:
        """Whether a command has to wait for files or shapes, which are then requested. Raises InsituError where it
        would not be carried out."""
        if not isinstance(command, AddObject) or command.objects:
            return self.reading.defer_command(command, self._host.document)
        command.check(self._host.document)
        self._adding.append(command)
        if len(self._adding) == 1:
            self._request_objects()
        return True

    def _request_objects(self) -> None:
        command = self._adding[0]
        self._adding_id = self._send(ReadObjects(command.what, command.at, command.size))

    def _read_next(self) -> None:
        """Go on with what is to be added next: a newer request would replace the one before it."""
        del self._adding[:1]
        if self._adding:
            self._request_objects()

    def take_objects(self, response: ObjectsRead, objects: tuple[ObjectState, ...], is_dragging: bool) -> None:
        """Add the objects that were read, and select the first of them; the end of a drag, of which that is no part, is
        waited for."""
        if not self._adding or response.id != self._adding_id:
            return
        if is_dragging:
            self._late_objects = response, objects
            return
        command, host, n_before = self._adding[0], self._host, len(self._host.document.objects)
        self._read_next()
        if host.do(replace(command, objects=objects)) is None:
            host.select(host.document.objects[n_before].name)
            if response.notes:
                host.notify("; ".join((command.label, *response.notes)))

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

    def import_material(self, name: str) -> str | None:
        """Give the selected object a material of a MaterialX file, FILE.mtlx or FILE.mtlx#NAME, once the worker has
        read it. Returns None, or the reason why not."""
        host = self._host
        if host.view.selected is None:
            return self._refuse(f"{name}: select the object that is to have the material")
        try:
            command = import_material(host.view.selected.object, name)
        except InsituError as error:
            return self._refuse(str(error))
        return host.do(command)

    def take_material(self, response: MeasurementsRead | MaterialsRead, is_dragging: bool) -> None:
        """Carry out the edit that waited for these measurements, or for a material of a file, as a step of its own: the
        end of a drag is waited for."""
        if is_dragging and self.reading.waits_for(response.id):
            self._late_material = response
            return
        host, command = self._host, self.reading.complete_edit(response)
        if command is None:
            return
        host.controller.add_band_plans(zip(command.layers, response.planned, strict=False))
        if host.do(command) is None:
            host.select(command.object)
            if isinstance(response, MaterialsRead):
                host.notify("; ".join((command.label, *response.notes)))
            else:
                host.notify(describe_reading(command.layers))

    def read_table(self, name: str, text: str | None = None) -> str | None:
        """Put a table on the selected curve, as an operator on top, once the worker has read it: from a file, or from
        `text` called `name`. Returns None, or the reason why not."""
        selected = layer_shown(self._host.document, self._host.view.selected)
        if selected is None or selected.factor is None:
            return self._refuse(f"{name}: select the curve that it is for")
        if not self._host.document.object(selected.object).editable or self._host.document.is_frozen(selected.key):
            return self._refuse(f"{name}: {selected.key} is frozen; thaw it in the object list to edit its curves")
        file = name if text is not None else str(resolved(Path(name)))
        self._table = self._send(ReadCurveTable(file, text)), selected.key, selected.factor
        return None

    def take_table(self, response: CurveTableRead, is_dragging: bool) -> None:
        """Put a table on the curve that it was read for; a drag, which replaces all operators, is waited for."""
        if self._table is None or self._table[0] != response.id:
            return
        if is_dragging:
            self._late = response
            return
        (_, key, factor), self._table = self._table, None
        try:
            self._host.document.layer(key).operators(factor)
        except (InsituError, ValueError):
            self._refuse(f"the table was not put on {key} {factor}: there is no such curve any more")
            return
        if self._host.do(AddOperator(key, factor, response.table)) is None:
            self._host.notify(f"a table of {len(response.table.gammas)} rows is on {key} {factor}")

    def drag_ended(self) -> None:
        """Take what came during a drag: a material first, then a table for a curve, then objects."""
        material, self._late_material = self._late_material, None
        if material is not None:
            self.take_material(material, False)
        late, self._late = self._late, None
        if late is not None:
            self.take_table(late, False)
        objects, self._late_objects = self._late_objects, None
        if objects is not None:
            self.take_objects(*objects, False)

    def export_measured(self, path: Path) -> str | None:
        """Export the selected object's material as a MERL file; returns None, or one line that says why not."""
        selected = layer_shown(self._host.document, self._host.view.selected)
        if selected is None:
            return self._refuse(f"{path.name}: select the object whose material to export")
        try:
            require_place(path)
        except InsituError as error:
            return self._refuse(str(error))
        self._write(WriteFiles(str(resolved(path)), self._host.document.object(selected.object).layers))
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
        self._write(WriteFiles(str(resolved(folder)), (), host.document, max(host.view.settings.n_bounces, 1)))
        return None

    def save_environment(self, path: Path) -> str | None:
        """Write the environment with what is painted on it to an OpenEXR file; returns None, or one line that says why
        not."""
        host = self._host
        if not host.scene_is_open:
            return self._refuse(f"{path.name}: no scene is open whose environment could be saved")
        try:
            require_environment_file(path)
        except InsituError as error:
            return self._refuse(str(error))
        self._write(SaveEnvironment(str(resolved(path)), host.document))
        return None

    def save_scene(self, path: Path, replaces: bool = True) -> str | None:
        """Save the scene as it is now with everything it needs, in a new folder or in an archive, which `replaces`
        one of that name; returns None, or one line that says why not."""
        host = self._host
        if not host.scene_is_open:
            return self._refuse(f"{path.name}: no scene is open that could be saved")
        try:
            require_package_place(path, replaces=replaces)
        except InsituError as error:
            return self._refuse(str(error))
        view = replace(host.view, panels={})  # the window's own, which another process cannot be sent
        self._write(SaveScene(str(resolved(path)), host.document, view))
        return None

    def _write(self, request: WriteFiles | SaveScene | SaveEnvironment) -> None:
        self._writing.add(self._send(request))

    def take_written(self, response: FilesWritten) -> None:
        """Say that files were written."""
        self._writing.discard(response.id)
        self._host.notify("; ".join((f"written {response.path}", *response.notes)))

    def _refuse(self, line: str) -> str:
        self._host.notify(line, True)
        return line
