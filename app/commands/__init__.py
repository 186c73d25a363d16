"""The edits: small frozen values that make a new document. Panels return them; they are the only writers.

A command names what it changes by key or path (see ``app.document``) and raises InsituError, with nothing changed,
when that is not there, is frozen, or the value is outside its range. A new one gets its place in `EditCommand`.
"""

from __future__ import annotations

from app.commands.curves import (
    AddOperator,
    CollapseOperators,
    MoveOperator,
    MuteOperator,
    RemoveOperator,
    ReplaceOperator,
    ResetCurve,
    SetOperators,
)
from app.commands.layers import SetEditable, SetFresnelTerm, SetFrozen, SetModel, SetParameter, SetVisible
from app.commands.light import SetEmission, SetEnvironment, SetIntensity, SetMapping, SetRotation
from app.commands.maps import SetMap
from app.commands.material import AddLayers, RemoveLayer, SetMaterial
from app.commands.paint import BlendByMap, ClearMap, Paint
from app.commands.plan import OverrideLine
from app.commands.poses import AddDeformer, MoveDeformer, RemoveDeformer, SetDeformer, SetPose, SetTime
from app.commands.series import SetFirstBands
from app.commands.surfaces import SetBumps, SetSurface

EditCommand = (
    SetParameter | SetModel | SetOperators | AddOperator | ReplaceOperator | RemoveOperator | MoveOperator
    | MuteOperator | CollapseOperators | ResetCurve | SetVisible | SetFrozen | SetFresnelTerm | SetEditable
    | SetBumps | SetMap | Paint | BlendByMap | ClearMap | SetMaterial | AddLayers | RemoveLayer | SetRotation
    | SetIntensity | SetEnvironment | SetMapping | SetEmission | SetFirstBands | SetPose | AddDeformer | SetDeformer
    | MoveDeformer | RemoveDeformer | SetTime | SetSurface | OverrideLine
)  # fmt: skip
