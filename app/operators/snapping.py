"""Operators of what drags snap to, and of what several objects are rotated and scaled about; the window carries them
out."""

from __future__ import annotations

from typing import Literal

from app.document.arranging import Pivot
from app.operators.operator import SCENE, Operator, ScriptKey

SNAPPING = (
    Operator("snaps", keys=("Shift M",), help="Snap what is moved; Ctrl for a moment", entry="Snap", needs=SCENE),
    Operator(
        "snap_increments", entry="To increments", needs=SCENE, help="Snaps to 0.1 m, 15° and tenths; Ctrl is free then."
    ),
    Operator(
        "snap_ground", entry="To the ground", needs=SCENE,
        help="What is moved without an axis stands on what is below it.",
    ),
    Operator(
        "snap_surfaces", entry="To surfaces", needs=SCENE,
        help="What is moved without an axis stands on the surface under the mouse.",
    ),
    Operator("snap", script=ScriptKey(
        Literal["none", "increments", "ground", "surfaces"], "What drags of handles snap to."
    )),
    Operator(
        "aligns", entry="Upright on surfaces", needs=SCENE,
        help="Objects that snap to a surface are turned with it.",
    ),
)  # fmt: skip
PIVOTING = (
    Operator(
        "pivot_middle", entry="Their common middle", needs=SCENE,
        help="Several objects are rotated and scaled about it.",
    ),
    Operator(
        "pivot_own", entry="Each its own centre", needs=SCENE,
        help="Each of several objects is rotated and scaled about its own centre, along its own axes.",
    ),
    Operator(
        "pivot_active", entry="The active object", needs=SCENE,
        help="Several objects are rotated and scaled about the centre of the active one.",
    ),
    Operator("pivot", script=ScriptKey(Pivot, "What drags of handles rotate and scale several objects about.")),
)  # fmt: skip
