"""View transforms on the graphics card: a set of shader switches and a table, for shaders that end in display colours
(`ToneMapper`).

Making a table imports a library and evaluates a quarter of a million colours: half a second, in a thread. Meanwhile the
view before it is shown (`ToneView`).
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from typing import TypeGuard

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.editor.colour_controller import ColourController
from engine.core.colour import (
    TABLE_SIDE,
    TABLE_STOPS,
    TABULATED_VIEWS,
    TONE_MAPPINGS,
    VIEWS,
    AnyView,
    ConfigView,
    ToneMapping,
    view_table,
)
from engine.core.colour_config import ShaderTexture, ViewShader
from engine.core.errors import InsituError
from ui.gl.context import GraphicsError, is_software
from ui.gl.gpu_memory import AnyTexture, TextureMemory
from ui.gl.program import Passes, Textures, uniform

_SWITCHES = {"filmic": "TONE_FILMIC", "linear": "TONE_LINEAR", "false_colour": "TONE_FALSE_COLOUR"}
_TABLE_SWITCH, _CONFIGURED_SWITCH = "TONE_TABLE", "TONE_CONFIGURED"
# The file whose text that of a configured view replaces.
_CONFIGURED = "common/configured_view.glsl"
DrawnView = ToneMapping | ViewShader


class ToneMapper:
    """Programs and textures by view. A table is made when it is first drawn with, which takes half a second where it
    was not requested before (`is_table_ready`). The shader of a configured view is compiled when it is first drawn
    with: only the driver can say how long that takes, and it draws nothing else meanwhile."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        self._tables: dict[ToneMapping, moderngl.Texture3D] = {}
        self._configured: tuple[ViewShader, dict[str, AnyTexture]] | None = None
        self._uses_text = not is_software(memory.context)

    def full_screen(self, fragment: str, view: DrawnView, **switches: int) -> moderngl.Program:
        """The program of a fragment shader that includes common/tone_mapping.glsl, with more switches of its own."""
        made = {_CONFIGURED: view.text} if self._draws_text(view) else None
        switches |= self._switches(view)
        try:
            program = self._passes.full_screen(fragment, made, **switches)
        except GraphicsError:
            if made is None:
                raise
            self._uses_text = False  # the driver refuses the library's text
            return self.full_screen(fragment, view, **switches)
        if switches[_TABLE_SWITCH]:
            uniform(program, "table_stops").value = TABLE_STOPS
        return program

    def _draws_text(self, view: DrawnView) -> TypeGuard[ViewShader]:
        """Whether a view is drawn by OpenColorIO's own shader."""
        return isinstance(view, ViewShader) and self._uses_text

    def _switches(self, view: DrawnView) -> dict[str, int]:
        if isinstance(view, ViewShader):
            chosen = _CONFIGURED_SWITCH if self._uses_text else _TABLE_SWITCH
        elif view in TONE_MAPPINGS:
            chosen = _SWITCHES.get(view, _TABLE_SWITCH)
        else:
            raise GraphicsError(f"view {view!r}, expected one of {', '.join(TONE_MAPPINGS)}")
        return {name: int(name == chosen) for name in (*_SWITCHES.values(), _TABLE_SWITCH, _CONFIGURED_SWITCH)}

    def textures(self, view: DrawnView) -> Textures:
        """The textures that those programs sample besides the picture."""
        if isinstance(view, ViewShader):
            return self._textures_of(view)
        if view not in TABULATED_VIEWS:
            return {}
        if view not in self._tables:
            self._tables[view] = self._memory.cube(TABLE_SIDE, 3, "f2", view_table(view))
        return {"view_table": self._tables[view]}

    def _textures_of(self, view: ViewShader) -> dict[str, AnyTexture]:
        """Those of a configured view; those of the one before are freed."""
        if self._configured is not None and self._configured[0] is view:
            return self._configured[1]
        self._release_configured()
        uploaded: dict[str, AnyTexture] = {}
        if self._uses_text:
            uploaded |= {each.sampler: self._uploaded(each) for each in view.textures}
        else:
            uploaded["view_table"] = self._memory.cube(TABLE_SIDE, 3, "f2", view.table)
        self._configured = view, uploaded
        return uploaded

    def _uploaded(self, each: ShaderTexture) -> AnyTexture:
        *sides, n_components = each.values.shape
        made: AnyTexture
        if len(sides) == 3:
            made = self._memory.cube(sides[0], n_components, "f4", each.values)
        else:
            made = self._memory.texture((sides[1], sides[0]), n_components, "f4", each.values)
        kind = moderngl.LINEAR if each.is_linear else moderngl.NEAREST
        made.filter = (kind, kind)
        return made

    def _release_configured(self) -> None:
        for texture in () if self._configured is None else self._configured[1].values():
            self._memory.release(texture)
        self._configured = None

    def release(self) -> None:
        for table in self._tables.values():
            self._memory.release(table)
        self._tables.clear()
        self._release_configured()


@lru_cache(maxsize=len(TABULATED_VIEWS))
def _start_table(view: ToneMapping) -> Future[NDArray[np.float16]]:
    with_one_thread = ThreadPoolExecutor(1, thread_name_prefix="view")
    coming = with_one_thread.submit(view_table, view)
    with_one_thread.shutdown(wait=False)
    return coming


def is_table_ready(view: ToneMapping) -> bool:
    """Whether a view can be drawn at once; if it cannot, its table is being made from now on."""
    return view not in TABULATED_VIEWS or _start_table(view).done()


def is_view_ready(view: AnyView, colours: ColourController) -> bool:
    """Whether a view can be drawn at once, or cannot be drawn at all; if neither, it is coming."""
    return not colours.is_coming(view) if isinstance(view, ConfigView) else is_table_ready(view)


class ToneView:
    """Follows the choice. `waits`: whether another frame will show it."""

    def __init__(self) -> None:
        self._shown: DrawnView = "filmic"
        self._refused: set[ToneMapping] = set()
        self.waits = False

    def follow(self, wanted: AnyView, colours: ColourController) -> DrawnView:
        """The view to show now; colours: has those of configurations. Raises InsituError once for a view of ours that
        cannot be made."""
        self.waits = not is_view_ready(wanted, colours)
        if isinstance(wanted, ConfigView):
            self._shown = colours.shader(wanted) or self._shown
            return self._shown
        if self.waits or wanted in self._refused:
            return self._shown
        failure = _start_table(wanted).exception() if wanted in TABULATED_VIEWS else None
        if failure is not None:
            self._refused.add(wanted)
            raise InsituError(f"{VIEWS[wanted].label} cannot be shown: {failure}")
        self._shown = wanted
        return wanted
