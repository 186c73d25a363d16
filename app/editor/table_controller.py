"""Tables of measured samples for the window, which shows them where a measured layer is seen by itself.

The worker hands a table out once, on request; the receiver stores it. One request is under way at a time, of 17.5 MB
each. A table that could not be read is not requested again while its scene is open; the panel that would show it gives
the reason, not the status bar: the user only wanted to see it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import FetchTable, Request, RequestFailed, TableFetched
from app.modes.reconciler import Reconciler
from engine.measured.measurement import Measurement

Samples = NDArray[np.float32]
_TableName = tuple[str, int]


class TableController:
    """Requests tables of measured samples. ``send`` sends a request and returns its number."""

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._send = send
        self._reconciler = Reconciler[_TableName, TableFetched](patience=math.inf)
        self._received: dict[int, Samples] = {}
        self._read: dict[str, Measurement] = {}
        self._refused: dict[_TableName, str] = {}

    def scene_opened(self) -> None:
        """Another scene is open: tables that were refused may be available now."""
        self._refused.clear()

    def request_table(self, measurement: Measurement) -> None:
        """Request the table of a measurement, read or not, unless another request is under way."""
        if measurement.number in self._received or self.refusal(measurement):
            return
        name = measurement.file, measurement.number
        self._reconciler.desire(0.0, name)
        if self._reconciler.action(0.0) == "request":
            self._reconciler.sent(0.0, self._send(FetchTable(*name)))

    def refusal(self, measurement: Measurement) -> str:
        """Why the table is not available, in one line; empty where it may be."""
        return self._refused.get((measurement.file, measurement.number), "")

    def resolve_measurement(self, measurement: Measurement) -> Measurement:
        """The measurement with what is known of its file since its table was handed out; itself where nothing is."""
        return measurement if measurement.is_read else self._read.get(measurement.file, measurement)

    def take(self) -> tuple[int, Samples] | None:
        """Hand over a table that has come and the number that names it; the caller owns them."""
        return self._received.popitem() if self._received else None

    def receive(self, response: TableFetched) -> None:
        """A table has come."""
        if self._reconciler.receive(response.id, response):
            self._received[response.measurement.number] = response.samples
            self._read[response.measurement.file] = response.measurement
            self._reconciler.desire(0.0, None)  # it is handed over, and requested again if it is needed again

    def receive_failure(self, response: RequestFailed) -> bool:
        """A request failed; returns whether it was for a table."""
        requested = self._reconciler.requested
        if requested is None or not self._reconciler.fail(response.id):
            return False
        self._refused[requested.desired] = response.line
        self._reconciler.restart()  # which tables are refused is remembered here, of all of them
        return True
