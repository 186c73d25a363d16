"""View transforms on the graphics card: a set of shader switches and a table, for shaders that end in display colours
(`ToneMapper`).

Making a table imports a library and evaluates a quarter of a million colours: half a second, in a thread. Meanwhile the
view before it is shown (`ToneView`).
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.core.colour import TABLE_SIDE, TABLE_STOPS, TABULATED_VIEWS, TONE_MAPPINGS, VIEWS, ToneMapping, view_table
from engine.core.errors import InsituError
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes, Textures, uniform

_SWITCHES = {"filmic": "TONE_FILMIC", "linear": "TONE_LINEAR", "false_colour": "TONE_FALSE_COLOUR"}
_TABLE_SWITCH = "TONE_TABLE"


class ToneMapper:
    """Programs and textures by view. A table is made when it is first drawn with, which takes half a second where it
    was not requested before (`is_table_ready`)."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        self._tables: dict[ToneMapping, moderngl.Texture3D] = {}

    def full_screen(self, fragment: str, view: ToneMapping, **switches: int) -> moderngl.Program:
        """The program of a fragment shader that includes common/tone_mapping.glsl, with more switches of its own."""
        program = self._passes.full_screen(fragment, **_switches(view), **switches)
        if view in TABULATED_VIEWS:
            uniform(program, "table_stops").value = TABLE_STOPS
        return program

    def textures(self, view: ToneMapping) -> Textures:
        """The textures that those programs sample besides the picture."""
        if view not in TABULATED_VIEWS:
            return {}
        if view not in self._tables:
            self._tables[view] = self._memory.cube(TABLE_SIDE, 3, "f2", view_table(view))
        return {"view_table": self._tables[view]}

    def release(self) -> None:
        for table in self._tables.values():
            self._memory.release(table)
        self._tables.clear()


def _switches(view: ToneMapping) -> dict[str, int]:
    if view not in TONE_MAPPINGS:
        raise GraphicsError(f"view {view!r}, expected one of {', '.join(TONE_MAPPINGS)}")
    chosen = _SWITCHES.get(view, _TABLE_SWITCH)
    return {name: int(name == chosen) for name in (*_SWITCHES.values(), _TABLE_SWITCH)}


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
