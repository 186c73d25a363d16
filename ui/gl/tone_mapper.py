"""The shader switches and the table of a view transform, for shaders that end in display colours."""

from __future__ import annotations

import moderngl

from engine.core.colour import TABLE_SIDE, TABLE_STOPS, TABULATED_VIEWS, TONE_MAPPINGS, ToneMapping, view_table
from ui.gl.context import GraphicsError
from ui.gl.passes import Passes, Textures, uniform
from ui.gl.textures import TextureMemory

_SWITCHES = {"filmic": "TONE_FILMIC", "linear": "TONE_LINEAR", "false_colour": "TONE_FALSE_COLOUR"}
_TABLE_SWITCH = "TONE_TABLE"


class ToneMapper:
    """Programs and textures by view. A table is made when it is first drawn with, which takes half a second where it
    was not requested before (`ui.tone_view`)."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        self._tables: dict[ToneMapping, moderngl.Texture3D] = {}

    def full_screen(self, fragment: str, view: ToneMapping) -> moderngl.Program:
        """The program of a fragment shader that includes common/tone_mapping.glsl."""
        return _with_stops(self._passes.full_screen(fragment, **_switches(view)), view)

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


def _with_stops(program: moderngl.Program, view: ToneMapping) -> moderngl.Program:
    if view in TABULATED_VIEWS:
        uniform(program, "table_stops").value = TABLE_STOPS
    return program


def _switches(view: ToneMapping) -> dict[str, int]:
    if view not in TONE_MAPPINGS:
        raise GraphicsError(f"view {view!r}, expected one of {', '.join(TONE_MAPPINGS)}")
    chosen = _SWITCHES.get(view, _TABLE_SWITCH)
    return {name: int(name == chosen) for name in (*_SWITCHES.values(), _TABLE_SWITCH)}
