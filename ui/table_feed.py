"""Brings tables of measurements from the worker to the GPU, in pieces, for all panels that show a BRDF by itself.

    panel with a measured layer ─► `want` ─► editor.tables ─► worker ─► `advance`, between frames ─► textures

Allocating 17.5 MB takes as long as a frame's panels where the processor draws, some 12 ms, so neither it nor a piece is
part of a frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.linked_layers import Layers
from app.document.named_files import measurement_in, with_measurements
from app.editor.editor import Editor
from engine.measured.measurement import Measurement
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.gl.measured_tables import MeasuredTables

# The time that a piece of an upload may take.
UPLOAD_SECONDS = 0.004


class TableFeed:
    """The tables of one window; `tables` are for stacks of layers."""

    def __init__(self, context: moderngl.Context) -> None:
        self.tables = MeasuredTables(TextureMemory(context))
        self._no_room: dict[int, str] = {}
        self._in_use: tuple[int, ...] = ()

    def missing(self, measurements: Iterable[Measurement]) -> list[Measurement]:
        """Those whose tables are not on the GPU."""
        return [each for each in measurements if each.number not in self.tables]

    def problem_of(self, editor: Editor, measurements: Iterable[Measurement]) -> str:
        """Why a table that is missing will not come, in one line; empty where it may."""
        reasons = (self._no_room.get(m.number) or editor.tables.refusal(m) for m in self.missing(measurements))
        return next(filter(None, reasons), "")

    def want(self, editor: Editor, measurements: Sequence[Measurement]) -> None:
        """Request what is on screen, which stays on the GPU as long as it is."""
        self._in_use = tuple(each.number for each in measurements)
        self._request_missing(editor, measurements)

    def _request_missing(self, editor: Editor, measurements: Iterable[Measurement]) -> bool:
        """Request the first missing table from the worker, unless one is under way; returns whether one may come."""
        coming = [each for each in self.missing(measurements) if not self.problem_of(editor, [each])]
        if coming and not self.tables.is_uploading:
            editor.tables.request_table(coming[0])
        return bool(coming)

    def complete(self, editor: Editor, layers: Layers) -> Layers | None:
        """The layers with what their files contain, once their tables are here or known not to come; None until
        then."""
        measured = [found for layer in layers if (found := measurement_in(layer)) is not None]
        known = [editor.tables.resolve_measurement(each) for each in measured]
        if self._request_missing(editor, known):
            return None
        return with_measurements(layers, {each.file: each for each in known}) if known else layers

    def advance(self, editor: Editor) -> bool:
        """Make room for a table that has come, or upload a piece of it. Returns whether there is something new to
        draw."""
        if not self.tables.is_uploading:
            come = editor.tables.take()
            return come is not None and not self._begin(*come)
        is_whole = self.tables.step(UPLOAD_SECONDS)
        if is_whole:
            self.tables.forget_but(self._in_use)
        return is_whole

    def release(self) -> None:
        """Free all textures."""
        self.tables.release()

    def _begin(self, number: int, samples: NDArray[np.float32]) -> bool:
        """Make room for a table; returns whether there is any."""
        try:
            self.tables.begin(number, samples)
        except GraphicsError as error:
            self._no_room[number] = str(error)
        return number not in self._no_room
