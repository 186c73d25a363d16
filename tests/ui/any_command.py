"""Any edit of a document as it is, for random sequences over all commands: a maker for each kind of command."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.document.background import BACKGROUND_KINDS
from app.document.commands import EditCommand
from app.document.commands.curves import (
    AddOperator,
    CollapseOperators,
    CurveEdit,
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
    new_layer,
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
from app.document.commands.plan import FIRST_BANDS_CHOICES, OverrideLine, SetFirstBands
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
from app.document.document import Document, all_factors
from app.document.painted_parameters import parameters_of
from app.files.materials import Library
from engine.curve.operators import Operator
from engine.inverse.transferred_edit import MEASURES
from engine.light.suns import Sun
from engine.material.layer import FRAMES
from engine.material.parameters import Parameter
from engine.material.strokes import Stroke, pack_dabs
from engine.realtime.deformers import KINDS
from engine.scene.transform import Transform

MODELS = ("lambert", "oren_nayar", "schlick", "rough_conductor", "cook_torrance", "phong")
NAMES = ("ball", "bowl", "cup", "thing")
PLAN = {"lights": (300, 1000, None), "sphere": (0, 1, None), "edges": (0, 4, None)}


class AnyCommand:
    """Makes commands of one document, whatever chance picks; an IndexError where there is nothing to edit."""

    def __init__(self, document: Document, random: np.random.Generator, folder: Path) -> None:
        self.document, self._random = document, random
        self.image = str(folder / "card.png")
        self.sky = str(folder / "sky.exr")

    def one(self, of: Iterable[Any]) -> Any:
        """One of these; IndexError where there are none."""
        there = list(of)
        return there[int(self._random.integers(len(there)))] if there else there[0]

    def several(self, of: Sequence[str]) -> tuple[str, ...]:
        """Some of these, one at least."""
        return tuple(dict.fromkeys(self.one(of) for _ in range(3)))

    def number(self, low: float, high: float) -> float:
        return float(self._random.uniform(low, high))

    def three(self, low: float, high: float) -> tuple[float, float, float]:
        return self.number(low, high), self.number(low, high), self.number(low, high)

    def flag(self) -> bool:
        return bool(self._random.integers(2))

    def value(self, parameter: Parameter) -> Any:
        """Any value that a parameter takes."""
        low, high = parameter.limits
        high = min(high, low + 200.0)
        match parameter.kind:
            case "choice":
                return self.one(parameter.choices)
            case "rgb":
                return self.three(low, min(high, 2.0))
            case "pair":
                return self.number(low, high), self.number(low, high)
            case "file":
                return self.image
        return self.number(low, high)

    # Names of what there is.

    def object(self) -> str:
        return str(self.one(self.document.objects).name)

    def objects(self) -> tuple[str, ...]:
        return self.several([each.name for each in self.document.objects])

    def lamp(self) -> str:
        return str(self.one(each.name for each in self.document.objects if each.emits))

    def spot(self) -> str:
        return str(self.one(each.name for each in self.document.objects if each.cone is not None))

    def deformed(self) -> tuple[str, int]:
        state = self.one(each for each in self.document.objects if each.deformations)
        return state.name, int(self._random.integers(len(state.deformations)))

    def layer(self) -> str:
        return str(self.one(key for key, _ in self.document.layers()))

    def curve(self, is_edited: bool = False) -> tuple[str, str]:
        """A layer and one of its curves; is_edited: one that has operators."""
        curves = [
            (key, factor.name)
            for key, layer in self.document.layers()
            for factor in all_factors(layer.model)
            if not is_edited or layer.operators(factor.name)
        ]
        return self.one(curves)

    def edited(self) -> tuple[str, str, int]:
        """A curve, and the place of one of its operators."""
        key, factor = self.curve(is_edited=True)
        return key, factor, int(self._random.integers(len(self.document.layer(key).operators(factor))))

    def operator(self) -> CurveEdit:
        regions = sorted(self.number(0.0, 1.4) for _ in range(4))
        return Operator(self.one(("translate", "amplify")), "y", *regions, magnitude=self.number(0.1, 1.2))

    def sun(self) -> Sun:
        found: Sun = self.one(self.document.light.suns)
        return found

    def row(self) -> str:
        light = self.document.light
        painted = [f"light.painted.{each.name}" for each in light.painted]
        suns = [f"light.{each.name}" for each in light.suns]
        lamps = [each.name for each in self.document.objects if each.emits]
        return str(self.one(["light.environment", *painted, *suns, *lamps]))

    def mix(self) -> SetMix:
        name, value = self.one(
            (
                ("on", self.flag()), ("solo", self.flag()), ("strength", self.number(-3.0, 2.0)),
                ("colour", self.three(0.2, 1.0)), ("kelvin", self.number(2000.0, 9000.0)),
                ("group", self.one(("", "warm"))), ("excludes", self.one(((), (self.object(),)))),
            )
        )  # fmt: skip
        return SetMix(self.row(), name, value)

    def bumps(self) -> SetBumps:
        name, value = self.one(
            (
                ("normal_map", self.one(("", self.image))), ("bump_map", self.one(("", self.image))),
                ("bump_strength", self.number(0.0, 2.0)), ("bump_height", self.number(0.001, 0.05)),
                ("tangent_angle", self.number(-90.0, 90.0)), ("coat_normal_map", self.one(("", self.image))),
            )
        )  # fmt: skip
        return SetBumps(self.object(), name, value)

    def opacity(self) -> SetOpacity:
        name, value = self.one(
            (
                ("opacity_map", self.one(("", self.image))), ("opacity_mode", self.one(("opaque", "mask", "blend"))),
                ("opacity_factor", self.number(0.2, 1.0)), ("opacity_cutoff", self.number(0.0, 1.0)),
            )
        )  # fmt: skip
        return SetOpacity(self.object(), name, value)

    def maps(self) -> SetMap:
        name, value = self.one(
            (
                ("texture", self.one(("", self.image))), ("weight", self.one(("", self.image))),
                ("texture_strength", self.number(0.0, 1.0)), ("weight_invert", self.flag()),
            )
        )  # fmt: skip
        return SetMap(self.layer(), name, value)

    def stroke(self) -> Paint:
        places = self._random.uniform(-0.5, 0.5, (4, 3))
        dabs = pack_dabs(places, np.tile([0.0, 0.0, 1.0], (4, 1)))
        return Paint(self.layer(), Stroke(0.2, self.number(0.2, 1.0), 1.0, 0.5, dabs))

    def painted(self) -> SetPainted:
        light = self.one(self.document.light.painted)
        parameters = parameters_of(light.kind, light.placement)
        name = self.one(sorted(parameters))
        return SetPainted.of(light.name, name, self.value(parameters[name]))

    def parameter(self) -> SetParameter:
        key, layer = self.one(self.document.layers())
        parameter = self.one(layer.model.parameters)
        return SetParameter(key, parameter.name, self.value(parameter))

    def look(self) -> str:
        return str(self.one(self.document.looks).name)

    def plan_line(self) -> OverrideLine:
        line = self.one(sorted(PLAN))
        return OverrideLine(line, self.one(PLAN[line]))


LIBRARY = Library()
LIBRARY.read_all()
MAKERS: dict[type, Callable[[AnyCommand], EditCommand]] = {
    SetParameter: AnyCommand.parameter,
    SetModel: lambda any: SetModel(any.layer(), any.one(MODELS)),
    SetOperators: lambda any: SetOperators(*any.curve(), tuple(any.operator() for _ in range(2))),
    AddOperator: lambda any: AddOperator(*any.curve(), any.operator()),
    ReplaceOperator: lambda any: ReplaceOperator(*any.edited(), any.operator()),
    RemoveOperator: lambda any: RemoveOperator(*any.edited()),
    MoveOperator: lambda any: MoveOperator(*any.edited(), 0),
    MuteOperator: lambda any: MuteOperator(*any.edited(), any.flag()),
    CollapseOperators: lambda any: CollapseOperators(*any.curve(is_edited=True)),
    ResetCurve: lambda any: ResetCurve(*any.curve()),
    SetVisible: lambda any: SetVisible(any.one((any.object(), any.layer())), any.flag()),
    SetFrozen: lambda any: SetFrozen(any.one((any.object(), any.layer())), any.flag()),
    SetFresnelTerm: lambda any: SetFresnelTerm(any.layer(), any.flag()),
    SetUnder: lambda any: SetUnder(any.layer(), any.one(("", "base", "coat"))),
    SetFrame: lambda any: SetFrame(any.layer(), any.one(FRAMES)),
    SetEditable: lambda any: SetEditable(any.object(), any.flag()),
    SetBumps: AnyCommand.bumps,
    SetOpacity: AnyCommand.opacity,
    SetMap: AnyCommand.maps,
    SetParameterMap: lambda any: SetParameterMap(any.layer(), "alpha", any.one((None, any.image))),
    Paint: AnyCommand.stroke,
    BlendByMap: lambda any: BlendByMap(any.layer(), any.layer()),
    ClearMap: lambda any: ClearMap(any.layer()),
    SetMaterial: lambda any: SetMaterial(
        any.object(), LIBRARY.entry(any.one(("Copper", "Velvet, red", "Porcelain", "Plaster"))).material.layers
    ),
    SetVariant: lambda any: SetVariant(any.one(any.document.variants)),
    AddLayers: lambda any: AddLayers(any.object(), (new_layer(any.one(MODELS)),)),
    RemoveLayer: lambda any: RemoveLayer(any.layer()),
    SetRotation: lambda any: SetRotation(any.number(0.0, 360.0)),
    SetIntensity: lambda any: SetIntensity(any.number(0.2, 3.0)),
    SetEnvironment: lambda any: SetEnvironment(any.one(("studio", "hall", any.sky))),
    SetMapping: lambda any: SetMapping(any.one(("latlong", "probe"))),
    SetEmission: lambda any: SetEmission(any.lamp(), any.three(0.0, 8.0)),
    SetFirstBands: lambda any: SetFirstBands(any.one((None, *FIRST_BANDS_CHOICES[2:6]))),
    SetPose: lambda any: SetPose(any.object()),
    AddDeformer: lambda any: AddDeformer(any.object(), any.one(KINDS), any.number(-0.4, 0.4), any.one("xyz")),
    SetDeformer: lambda any: SetDeformer(*any.deformed(), any.number(-0.4, 0.4)),
    MoveDeformer: lambda any: MoveDeformer(*any.deformed(), 0),
    RemoveDeformer: lambda any: RemoveDeformer(*any.deformed()),
    SetTime: lambda any: SetTime(any.one((None, any.number(0.0, 2.0)))),
    SetSurface: lambda any: SetSurface(any.object(), any.one(("", "membrane", "subsurface", "wrinkles"))),
    OverrideLine: AnyCommand.plan_line,
    SetSun: lambda any: SetSun(
        any.sun().name, *any.one((("azimuth", any.number(0, 360)), ("diameter", any.number(0.2, 20.0))))
    ),
    SetMix: AnyCommand.mix,
    SetTransform: lambda any: SetTransform(any.object(), any.three(-0.3, 0.3), any.three(-40, 40), any.three(0.7, 1.3)),
    MoveObject: lambda any: MoveObject(any.object(), any.three(-0.2, 0.2)),
    DuplicateObject: lambda any: DuplicateObject(any.object(), linked=any.flag()),
    DeleteObject: lambda any: DeleteObject(any.object()),
    RenameObject: lambda any: RenameObject(any.object(), any.one(NAMES)),
    SetBackground: lambda any: SetBackground(any.one(BACKGROUND_KINDS)),
    SetBackgroundColour: lambda any: SetBackgroundColour(any.three(0.0, 1.0)),
    AddObject: lambda any: AddObject(any.one(("box", "cone", "plane", "rectangle light", "spot light"))),
    ShowObjects: lambda any: ShowObjects(),
    Several: lambda any: Several(
        tuple(SetTransform(name, any.three(-0.2, 0.2)) for name in any.objects()), "move several"
    ),
    PlaceObjects: lambda any: PlaceObjects(
        tuple((name, Transform(any.three(-0.2, 0.2))) for name in any.objects()), "place several"
    ),
    LinkCurves: lambda any: LinkCurves(".".join(any.curve()), (".".join(any.curve()),)),
    TransferEdit: lambda any: TransferEdit(
        ".".join(any.curve(is_edited=True)), (any.one(any.document.layers())[0],), any.one(MEASURES)
    ),
    UnlinkCurve: lambda any: UnlinkCurve(".".join(any.curve())),
    LinkObjects: lambda any: LinkObjects(any.objects(), any.one(("", "same"))),
    AddLook: lambda any: AddLook(),
    SetLook: lambda any: SetLook(any.look()),
    RenameLook: lambda any: RenameLook(any.look(), any.one(("day", "night"))),
    DeleteLook: lambda any: DeleteLook(any.look()),
    MoveLook: lambda any: MoveLook(any.look(), 0),
    DuplicateObjects: lambda any: DuplicateObjects(any.objects(), any.flag()),
    SetGroup: lambda any: SetGroup(any.objects(), any.one(("", "table", "tea"))),
    RenameGroup: lambda any: RenameGroup(any.one(any.document.groups), any.one(("", "cups"))),
    AddSun: lambda any: AddSun(),
    DuplicateSun: lambda any: DuplicateSun(any.sun().name),
    DeleteSun: lambda any: DeleteSun(any.sun().name),
    RenameSun: lambda any: RenameSun(any.sun().name, any.one(("noon", "dusk"))),
    SetShadowCatcher: lambda any: SetShadowCatcher(any.object(), any.flag()),
    SetMapChange: lambda any: SetMapChange(
        *any.one((("tilt", any.number(-90, 90)), ("hue", any.number(-180, 180)), ("contrast", any.number(0.2, 2.0))))
    ),
    SplitEnvironment: lambda any: SplitEnvironment(any.flag()),
    AddPainted: lambda any: AddPainted(any.one(("box", "disc", "gradient", "sky"))),
    SetPainted: AnyCommand.painted,
    RemovePainted: lambda any: RemovePainted(any.one(any.document.light.painted).name),
    SetLampSize: lambda any: SetLampSize(any.lamp(), any.one(("width", "height", "radius")), any.number(0.1, 1.0)),
    SetCone: lambda any: SetCone(any.spot(), any.number(5.0, 40.0)),
    SetTarget: lambda any: SetTarget(any.lamp(), any.three(-0.5, 0.5)),
}
