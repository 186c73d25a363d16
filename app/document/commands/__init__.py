"""The edits: small frozen values that make a new document. Panels return them; they are the only writers.

A command names what it changes by key or path (see ``app.document.document``) and raises InsituError, with nothing
changed, when that does not exist, is frozen, or the value is outside its range. A new command is added to
`EditCommand`.
"""

from __future__ import annotations

from app.document.commands.curves import (
    AddOperator,
    CollapseOperators,
    MoveOperator,
    MuteOperator,
    RemoveOperator,
    ReplaceOperator,
    ResetCurve,
    SetOperators,
)
from app.document.commands.groups import RenameGroup, SetGroup
from app.document.commands.lamps import SetCone, SetLampSize, SetTarget
from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetEditable,
    SetFrame,
    SetFresnelTerm,
    SetFrozen,
    SetMaterial,
    SetModel,
    SetParameter,
    SetShadowCatcher,
    SetUnder,
    SetVariant,
    SetVisible,
)
from app.document.commands.light import (
    SetBackground,
    SetBackgroundColour,
    SetEmission,
    SetEnvironment,
    SetIntensity,
    SetMapChange,
    SetMapping,
    SetRotation,
    SplitEnvironment,
)
from app.document.commands.linked_objects import LinkObjects
from app.document.commands.links import LinkCurves, UnlinkCurve
from app.document.commands.looks import AddLook, DeleteLook, MoveLook, RenameLook, SetLook
from app.document.commands.maps import (
    BlendByMap,
    ClearMap,
    Paint,
    SetBumps,
    SetMap,
    SetOpacity,
    SetParameterMap,
    SetSurface,
)
from app.document.commands.mix import SetMix
from app.document.commands.objects import (
    AddObject,
    DeleteObject,
    DuplicateObject,
    DuplicateObjects,
    RenameObject,
    ShowObjects,
)
from app.document.commands.painted import AddPainted, RemovePainted, SetPainted
from app.document.commands.plan import OverrideLine, SetFirstBands
from app.document.commands.poses import (
    AddDeformer,
    MoveDeformer,
    MoveObject,
    PlaceObjects,
    RemoveDeformer,
    SetDeformer,
    SetPose,
    SetTime,
    SetTransform,
)
from app.document.commands.several import Several
from app.document.commands.suns import AddSun, DeleteSun, DuplicateSun, RenameSun, SetSun
from app.document.commands.transfer import TransferEdit

EditCommand = (
    SetParameter | SetModel | SetOperators | AddOperator | ReplaceOperator | RemoveOperator | MoveOperator
    | MuteOperator | CollapseOperators | ResetCurve | SetVisible | SetFrozen | SetFresnelTerm | SetUnder | SetFrame
    | SetEditable | SetBumps | SetOpacity | SetMap | SetParameterMap | Paint | BlendByMap | ClearMap | SetMaterial
    | SetVariant | AddLayers | RemoveLayer | SetRotation | SetIntensity | SetEnvironment | SetMapping | SetEmission
    | SetFirstBands | SetPose | AddDeformer | SetDeformer | MoveDeformer | RemoveDeformer | SetTime | SetSurface
    | OverrideLine | SetSun | SetMix | SetTransform | MoveObject | DuplicateObject | DeleteObject
    | RenameObject | SetBackground | SetBackgroundColour | AddObject | ShowObjects | Several | PlaceObjects
    | LinkCurves | UnlinkCurve | TransferEdit | LinkObjects | AddLook | SetLook | RenameLook | DeleteLook | MoveLook
    | DuplicateObjects | SetGroup | RenameGroup | AddSun | DuplicateSun | DeleteSun | RenameSun
    | SetShadowCatcher | SetMapChange | SplitEnvironment | AddPainted | SetPainted | RemovePainted
    | SetLampSize | SetCone | SetTarget
)  # fmt: skip
