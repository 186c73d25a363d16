"""Ctrl-C and SIGTERM in the middle of a measurement: what it started and wrote for itself goes before it does."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

ENDINGS = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def ended_in_order() -> Iterator[None]:
    """Within the block both signals unwind the stack; a second one does not disturb what the first has set off.

    Raises KeyboardInterrupt on SIGINT and SystemExit with the status a shell gives (143) on SIGTERM. Main thread only.
    """

    def unwind(number: int, frame: FrameType | None) -> None:
        for ending in ENDINGS:
            signal.signal(ending, signal.SIG_IGN)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)

    before = {ending: signal.signal(ending, unwind) for ending in ENDINGS}
    try:
        yield
    finally:
        for ending, handler in before.items():
            signal.signal(ending, handler)
