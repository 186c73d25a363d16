"""Materials that wait for a file: measured BRDFs are read by the worker before their layers are put on an object.

The edit is carried out when the response comes, as one step of the history; until then the document does not change.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.document.commands.layers import AddLayers, SetMaterial
from app.document.document import Document
from app.document.linked_layers import Layers
from app.document.named_files import FILE, measurement_in, unread_files, with_measurements
from app.messages.worker_messages import MeasurementsRead, ReadMeasured, Request
from engine.core.safe_files import resolved
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.measured.measurement import Measurement


def measured_layers(file: Path, cloth: bool = False) -> Layers:
    """The diffuse part and the highlight of a file that is still to be read; or one layer of P·Q·P."""
    parts = (("measured_cloth", "cloth"),) if cloth else (("measured_diffuse", "diffuse"), ("measured", "highlight"))
    return tuple(make_layer(MODELS[model], {FILE: str(resolved(file))}, name) for model, name in parts)


def import_measured(object_name: str, file: Path, cloth: bool = False) -> SetMaterial:
    """The edit that makes an object of what was measured; cloth: as in `measured_layers`."""
    return SetMaterial(object_name, measured_layers(file, cloth), file.stem)


class PendingMeasurement:
    """At most one edit that waits; a newer one replaces it. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._send = send
        self._waiting: tuple[int, SetMaterial | AddLayers] | None = None

    @property
    def is_under_way(self) -> bool:
        """Whether an edit waits for its files."""
        return self._waiting is not None

    def defer_command(self, command: object, document: Document) -> bool:
        """Whether a command has to wait; if so its files are requested. Raises InsituError where it would not be
        carried out."""
        if not isinstance(command, SetMaterial | AddLayers):
            return False
        files = unread_files(command.layers)
        if files:
            command.apply(document)
            self._waiting = self._send(ReadMeasured(files, command.layers)), command
        return bool(files)

    def complete_edit(self, response: MeasurementsRead) -> SetMaterial | AddLayers | None:
        """The edit that waited for this response, complete."""
        if self._waiting is None or self._waiting[0] != response.id:
            return None
        (_, command), self._waiting = self._waiting, None
        return replace(command, layers=with_measurements(command.layers, response.found))

    def cancel(self, id: int | None = None) -> None:
        """Give up the edit that waits, or only if it waits for that request."""
        if self._waiting is not None and id in (None, self._waiting[0]):
            self._waiting = None


def describe_reading(layers: tuple[Layer, ...]) -> str:
    """One line on the files of layers that were just read."""
    there = dict.fromkeys(found for layer in layers if (found := measurement_in(layer)) is not None)
    return "; ".join(describe_measurement(each) for each in there)


def describe_measurement(measurement: Measurement) -> str:
    """A file, what was filled in it, and the error of its factors alone."""
    report, name = measurement.report, Path(measurement.file).name
    if report is None:
        return f"{name}: not read"
    filled = f"{report.n_missing:,} missing samples and {report.n_below:,} below the horizon filled"
    error = f"error of the curves alone: a factor of {math.exp(report.error):.2f} (log RMS {report.error:.3f})"
    return f"{name}: {filled}; {error}; the residual is stored, too"
