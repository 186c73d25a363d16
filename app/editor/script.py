"""Scripts of edits for ``insitu screenshot --script``: a TOML list of ``[[step]]``, each one action of a user.

    [[step]]
    select = "teapot.1.theta_h"
    [[step]]
    drag = { item = "curve.b", by = [40, -25] }
    [[step]]
    wait = "exact"

The whole script is read and checked before its first step runs. The owner of the window carries the steps out, with the
same mouse events and commands as a user's; here they are typed values.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, ValidationError, model_validator

from app.files.bookmarks import MAX_NAME, is_name
from app.files.old_names import upgrade_script
from engine.core.colour import ToneMapping, find_view
from engine.core.errors import LoadError
from engine.core.safe_files import resolved
from engine.plan_lines import LineValue
from engine.realtime.deformers import KINDS
from engine.scene.camera_moves import Side
from engine.scene.description import Number, Parameter, Text
from engine.scene.toml_text import load_toml
from engine.scene.validation_errors import first_validation_error

MAX_SCRIPT_BYTES = 2**20
MAX_STEPS = 10_000
MAX_PIXELS = 100_000.0

Point = tuple[float, float]
Turn = Annotated[Number, Field(ge=-1e6, le=1e6)]
AwaitedPicture = Literal["first", "orbit", "exact", "error"]


@dataclass(frozen=True)
class SetValues:
    """Set what each path names (``"teapot.1.alpha"``, ``"light.rotation"``) to a value."""

    values: tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class SelectPath:
    """Select an object, a layer or a curve."""

    path: str


@dataclass(frozen=True)
class SetAccuracy:
    """Set the settings of the current mode to a place between speed, 0, and accuracy, 1
    (`app.document.pareto_front`)."""

    share: float


@dataclass(frozen=True)
class OverrideLines:
    """Override lines of the plan, by name; "auto": as planned (`app.document.commands.plan`)."""

    lines: tuple[tuple[str, LineValue], ...]


@dataclass(frozen=True)
class DeformObject:
    """Set an object's deformers, by kind, to these amounts; move it (None: all animated objects) to a time of its
    animation, see `app.document.commands.SetTime`."""

    object: str | None
    amounts: tuple[tuple[str, float], ...] = ()
    time: float | None = None
    clip: str | None = None


@dataclass(frozen=True)
class DragItem:
    """Press on a named handle, move by so many pixels (right, down), release."""

    item: str
    by: Point


@dataclass(frozen=True)
class DragPoints:
    """Press at a pixel of the window, move to another, release."""

    start: Point
    end: Point


@dataclass(frozen=True)
class ShowPanelStep:
    """Open a panel and bring it in front of those in the same dock."""

    panel: str


@dataclass(frozen=True)
class ChooseView:
    """Show light through one of the views of `engine.core.colour`."""

    view: ToneMapping


@dataclass(frozen=True)
class GoToView:
    """See the scene from the bookmarked view of this name."""

    name: str


@dataclass(frozen=True)
class SaveViewStep:
    """Bookmark the view under this name."""

    name: str


@dataclass(frozen=True)
class ChooseMode:
    """Switch to the mode of this name."""

    mode: str


@dataclass(frozen=True)
class PickLobe:
    """Show the selected layer's lobe at a pixel (column, row) of the picture."""

    pixel: tuple[int, int]


@dataclass(frozen=True)
class PaintStroke:
    """Paint a stroke on a layer's weight map, through points (column, row) of the picture; ``radius`` in its pixels."""

    layer: str
    points: tuple[Point, ...]
    radius: float
    value: float
    strength: float
    hardness: float


@dataclass(frozen=True)
class RotateLight:
    """Rotate the environment to so many degrees."""

    degrees: float


@dataclass(frozen=True)
class ImportFile:
    """Make the selected object of a measured file (as ``cloth``, of one layer)."""

    file: Path
    cloth: bool


@dataclass(frozen=True)
class UndoSteps:
    """Undo so many times."""

    count: int


@dataclass(frozen=True)
class UndoViews:
    """Undo so many steps of the view's own history."""

    count: int


@dataclass(frozen=True)
class RedoSteps:
    """Redo so many times."""

    count: int


@dataclass(frozen=True)
class WaitFor:
    """Draw frames until a stage is reached: the first shaded picture, Orbit's own picture of an idle view, the picture
    after which nothing more comes, or that picture with its error estimated."""

    picture: AwaitedPicture


@dataclass(frozen=True)
class CaptureWindow:
    """Write the window's picture to a PNG file (absolute path)."""

    path: Path


@dataclass(frozen=True)
class AssertErrorBelow:
    """Fail unless what the curve still has to change in the picture is below this, relative RMS."""

    bound: float


class MoveCamera(BaseModel):
    """Move the camera, one step of the view's own history, in this order: back to the scene's `own`; seen from a
    `side`; with a lens of `focal` mm; so that it frames an object, or "all"; by `orbit` to its right and up, degrees;
    by `pan` to its right and up, heights of the picture; to `dolly` times the distance; with a `level` horizon."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    own: Literal[True] | None = None
    side: Side | None = None
    focal: Annotated[Number, Field(gt=0.0, le=1e6)] | None = None
    frame: Text | None = None
    orbit: tuple[Turn, Turn] | None = None
    pan: tuple[Turn, Turn] | None = None
    dolly: Annotated[Number, Field(ge=1e-6, le=1e6)] | None = None
    level: Literal[True] | None = None

    @model_validator(mode="after")
    def _is_something(self) -> MoveCamera:
        if not self.model_fields_set:
            raise ValueError(f"at least one of {', '.join(type(self).model_fields)}")
        return self


Step = (
    SetValues
    | SelectPath
    | SetAccuracy
    | OverrideLines
    | DeformObject
    | DragItem
    | DragPoints
    | ShowPanelStep
    | ChooseView
    | GoToView
    | SaveViewStep
    | MoveCamera
    | ChooseMode
    | PickLobe
    | PaintStroke
    | RotateLight
    | ImportFile
    | UndoSteps
    | UndoViews
    | RedoSteps
    | WaitFor
    | CaptureWindow
    | AssertErrorBelow
)

Pixel = Annotated[Number, Field(ge=-MAX_PIXELS, le=MAX_PIXELS)]
PictureIndex = Annotated[int, Field(ge=0, le=int(MAX_PIXELS), strict=True)]
Count = Annotated[int, Field(ge=1, le=1000, strict=True)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class DragRecord(_Record):
    item: Text | None = None
    by: tuple[Pixel, Pixel] | None = None
    start: tuple[Pixel, Pixel] | None = Field(default=None, alias="from")
    to: tuple[Pixel, Pixel] | None = None

    @model_validator(mode="after")
    def _is_one_kind(self) -> DragRecord:
        given = {name for name in ("item", "by", "start", "to") if getattr(self, name) is not None}
        if given not in ({"item", "by"}, {"start", "to"}):
            raise ValueError("item and by, or from and to")
        return self

    def step(self) -> Step:
        """The drag as a step."""
        if self.item is not None and self.by is not None:
            return DragItem(self.item, self.by)
        assert self.start is not None and self.to is not None
        return DragPoints(self.start, self.to)


class DeformRecord(_Record):
    """An object and the amounts of its deformers by kind; a time, which may be that of all objects."""

    model_config = ConfigDict(frozen=True, extra="allow")

    __pydantic_extra__: dict[str, Number]
    object: Text | None = None
    time: Number | None = None
    clip: Text | None = None

    @model_validator(mode="after")
    def _deforms(self) -> DeformRecord:
        if set(self.amounts) - set(KINDS) or not (self.amounts or self.time is not None):
            raise ValueError(f"object, and at least one of {', '.join(KINDS)}, time")
        if self.object is None and self.amounts:
            raise ValueError(f"object, whose {', '.join(self.amounts)} it is")
        if self.clip is not None and self.time is None:
            raise ValueError("time, beside clip")
        return self

    @property
    def amounts(self) -> dict[str, float]:
        """Amounts by kind."""
        return self.__pydantic_extra__

    def step(self) -> Step:
        """The step."""
        return DeformObject(self.object, tuple(self.amounts.items()), self.time, self.clip)


Share = Annotated[Number, Field(ge=0.0, le=1.0)]


class PaintRecord(_Record):
    layer: Text
    points: Annotated[tuple[tuple[Pixel, Pixel], ...], Field(min_length=1, max_length=1000)]
    radius: Annotated[Number, Field(gt=0.0, le=MAX_PIXELS)] = 24.0
    value: Share = 1.0
    strength: Share = 1.0
    hardness: Share = 0.5


class ImportRecord(_Record):
    file: Text
    cloth: bool = False


class StepRecord(_Record):
    """One step: exactly one of its keys."""

    set: Annotated[dict[Text, Parameter], Field(min_length=1)] | None = None
    select: Text | None = None
    drag: DragRecord | None = None
    deform: DeformRecord | None = None
    show: Text | None = None
    view: Text | None = None
    save_view: Text | None = None
    camera: MoveCamera | None = None
    undo_view: Count | None = None
    mode: Text | None = None
    lobe: tuple[PictureIndex, PictureIndex] | None = None
    paint: PaintRecord | None = None
    rotate: Annotated[Number, Field(ge=-1e9, le=1e9)] | None = None
    measured: ImportRecord | None = None
    undo: Count | None = None
    redo: Count | None = None
    accuracy: Share | None = None
    override: Annotated[dict[Text, StrictInt | StrictStr], Field(min_length=1)] | None = None
    wait: AwaitedPicture | None = None
    capture: Text | None = None
    assert_error_below: Annotated[Number, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _has_one_key(self) -> StepRecord:
        if len(self.model_fields_set) != 1:
            raise ValueError(f"exactly one of {', '.join(type(self).model_fields)}")
        return self

    def step(self, folder: Path) -> Step:
        """The step; files that it writes are relative to ``folder``."""
        (name,) = self.model_fields_set
        return _STEPS[name](getattr(self, name), folder)


_STEPS: dict[str, Callable[[Any, Path], Step]] = {
    "set": lambda values, folder: SetValues(tuple(values.items())),
    "select": lambda path, folder: SelectPath(path),
    "deform": lambda deform, folder: deform.step(),
    "drag": lambda drag, folder: drag.step(),
    "show": lambda panel, folder: ShowPanelStep(panel),
    "view": lambda name, folder: _view(name),
    "save_view": lambda name, folder: SaveViewStep(name),
    "camera": lambda move, folder: move,
    "undo_view": lambda count, folder: UndoViews(count),
    "mode": lambda name, folder: ChooseMode(name),
    "lobe": lambda pixel, folder: PickLobe(pixel),
    "paint": lambda stroke, folder: PaintStroke(**dict(stroke)),
    "rotate": lambda degrees, folder: RotateLight(degrees),
    "measured": lambda measured, folder: ImportFile(Path(measured.file), measured.cloth),
    "undo": lambda count, folder: UndoSteps(count),
    "redo": lambda count, folder: RedoSteps(count),
    "accuracy": lambda share, folder: SetAccuracy(share),
    "override": lambda lines, folder: OverrideLines(tuple(lines.items())),
    "wait": lambda picture, folder: WaitFor(picture),
    "capture": lambda name, folder: CaptureWindow(Path(os.path.abspath(folder / name))),
    "assert_error_below": lambda bound, folder: AssertErrorBelow(bound),
}


def _view(name: str) -> Step:
    """The step for one of `engine.core.colour`'s views; any other name is that of a bookmarked view."""
    try:
        return ChooseView(find_view(name))
    except LoadError:
        return GoToView(name)


class ScriptRecord(_Record):
    """A whole script."""

    steps: Annotated[tuple[StepRecord, ...], Field(alias="step", min_length=1, max_length=MAX_STEPS)]


def load_script(path: Path, folder: Path | None = None) -> tuple[Step, ...]:
    """Read and check a script; pictures that it captures go to ``folder`` (default: the script's own).

    Raises LoadError that names the step and the key of the first error.
    """
    tree = load_toml(path, MAX_SCRIPT_BYTES)
    return parse_script(tree, path, resolved(path).parent if folder is None else folder)


def parse_script(tree: dict[str, Any], file: Path, folder: Path) -> tuple[Step, ...]:
    """The steps of a script's tree."""
    tree = upgrade_script(tree)
    try:
        record = ScriptRecord.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, file, ScriptRecord) from None
    for number, step in enumerate(record.steps):
        if step.capture is not None and Path(step.capture).suffix.lower() != ".png":
            raise LoadError(file, f"step {number}: capture", step.capture, "a file name that ends in .png")
        if step.capture is not None and "\0" in step.capture:
            raise LoadError(file, f"step {number}: capture", step.capture, "the name of a file, without NUL")
        if step.save_view is not None and not is_name(step.save_view):
            raise LoadError(file, f"step {number}: save_view", step.save_view, f"a name of 1 to {MAX_NAME} characters")
    return tuple(step.step(folder) for step in record.steps)
