"""The view transform that is shown: the chosen one, or the one before it while the table of the chosen one is made.

Making it imports a library and evaluates a quarter of a million colours: half a second, in a thread.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import TABULATED_VIEWS, VIEWS, ToneMapping, view_table
from engine.core.errors import InsituError


@lru_cache(maxsize=len(TABULATED_VIEWS))
def _start_table(view: ToneMapping) -> Future[NDArray[np.float16]]:
    with_one_thread = ThreadPoolExecutor(1, thread_name_prefix="view")
    coming = with_one_thread.submit(view_table, view)
    with_one_thread.shutdown(wait=False)
    return coming


def is_table_ready(view: ToneMapping) -> bool:
    """Whether a view can be drawn at once; if it cannot, its table is being made from now on."""
    return view not in TABULATED_VIEWS or _start_table(view).done()


class ToneView:
    """Follows the choice. `waits`: whether another frame will show it."""

    def __init__(self) -> None:
        self._shown: ToneMapping = "filmic"
        self._refused: set[ToneMapping] = set()
        self.waits = False

    def follow(self, wanted: ToneMapping) -> ToneMapping:
        """The view to show now. Raises InsituError once for a view that cannot be made."""
        self.waits = not is_table_ready(wanted)
        if self.waits or wanted in self._refused:
            return self._shown
        failure = _start_table(wanted).exception() if wanted in TABULATED_VIEWS else None
        if failure is not None:
            self._refused.add(wanted)
            raise InsituError(f"{VIEWS[wanted].label} cannot be shown: {failure}")
        self._shown = wanted
        return wanted
