"""The keys by which objects are arranged: those that operators declare, as in Blender; or others, as the user prefers.

A keymap replaces the keys of some operators: those that move, rotate and scale, and those whose keys these take.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from app.files.preferences import Keys
from app.operators.operator import Operator

Binding = tuple[tuple[str, ...], str]  # the keys, and the list's text where these keys stand for several operators

_AT_ONCE: dict[str, Binding] = {
    "grab": (("Shift G",), "Shift G   R   S"), "turn": (("Shift R",), ""), "resize": (("Shift S",), ""),
    "toggle_deform": (("G",), ""), "solo": (("S",), ""),
}  # fmt: skip
KEYMAPS: Mapping[Keys, Mapping[str, Binding]] = MappingProxyType({
    "blender": {},
    "maya": {
        **_AT_ONCE, "gizmo_move": (("W",), "W   E   R"), "gizmo_rotate": (("E",), ""), "gizmo_scale": (("R",), ""),
        "draw_tool": (("Shift W",), "Shift W   P"), "error": (("Shift E",), ""), "duplicate": (("Ctrl D",), ""),
    },
    "insitu": {
        **_AT_ONCE, "gizmo_move": (("V",), "V   R   Z"), "gizmo_rotate": (("R",), ""), "gizmo_scale": (("Z",), ""),
    },
})  # fmt: skip
KEYMAP_LABELS: Mapping[Keys, str] = MappingProxyType(
    {"blender": "As in Blender: G R S", "maya": "As in Maya: W E R", "insitu": "Handles alone: V R Z"}
)


def in_keymap(operator: Operator, keys: Keys) -> Operator:
    """The operator with the keys that it has in a keymap."""
    if operator.name not in KEYMAPS[keys]:
        return operator
    own, listed = KEYMAPS[keys][operator.name]
    return replace(operator, keys=own, listed_keys=listed)
