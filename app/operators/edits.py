"""Operators on the document: undo, the clipboard, materials, curves, and the edits that scripts make by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import ConfigDict, Field, StrictInt, StrictStr, model_validator

from app.document.commands.curves import MuteOperator, RemoveOperator, ResetCurve
from app.document.commands.light import SetRotation
from app.document.commands.links import LinkCurves, UnlinkCurve
from app.document.commands.plan import override_from_value, set_series
from app.document.commands.poses import SetTime, with_amounts
from app.document.document import Selection
from app.document.effective_settings import override_lines_of
from app.document.pareto_front import load_front
from app.document.selection import layer_shown
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.modes.placement.painted_curves import Solved
from app.operators.operator import CURVE, LAYER, SCENE, Gesture, Need, Operator, OperatorContext, ScriptKey, ValueRecord
from app.project.assignments import set_path
from engine.inverse.curve_fit import HOLDING
from engine.inverse.highlight_brush import LEAST_RADIUS, MOST_RADIUS, MOST_STOPS, RGB, Effect
from engine.realtime.deformers import KINDS
from engine.scene.description import Number, Parameter, Text
from engine.settings import LineValue

MAX_PIXELS = 100_000.0

PictureIndex = Annotated[int, Field(ge=0, le=int(MAX_PIXELS), strict=True)]
Pixel = Annotated[Number, Field(ge=-MAX_PIXELS, le=MAX_PIXELS)]
Count = Annotated[int, Field(ge=1, le=1000, strict=True)]
Share = Annotated[Number, Field(ge=0.0, le=1.0)]
CurveSelection = tuple[str, str, tuple[Any, ...]]


class Drag(ValueRecord):
    """Press on a handle, or at a pixel of the window; move; release."""

    item: Annotated[Text | None, Field(description="A handle, such as `curve.b`.")] = None
    by: Annotated[tuple[Pixel, Pixel] | None, Field(description="Pixels to the right and down.")] = None
    start: Annotated[tuple[Pixel, Pixel] | None, Field(alias="from", description="A pixel of the window.")] = None
    to: Annotated[tuple[Pixel, Pixel] | None, Field(description="A pixel of the window.")] = None

    @model_validator(mode="after")
    def _is_one_kind(self) -> Drag:
        given = {name for name in ("item", "by", "start", "to") if getattr(self, name) is not None}
        if given not in ({"item", "by"}, {"start", "to"}):
            raise ValueError("item and by, or from and to")
        return self


class Deform(ValueRecord):
    """An object and the amounts of its deformers by kind; a time, which may be that of all objects."""

    model_config = ConfigDict(frozen=True, extra="allow")

    __pydantic_extra__: dict[str, Number]
    object: Annotated[Text | None, Field(description="Whose deformers they are.")] = None
    time: Annotated[
        Number | None, Field(description="Of an animation, seconds; without `object`: of all that are animated.")
    ] = None
    clip: Annotated[Text | None, Field(description="The animation's name.")] = None

    @model_validator(mode="after")
    def _deforms(self) -> Deform:
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


class CurveLink(ValueRecord):
    """A curve, and the curves of other layers that follow it from now on."""

    curve: Annotated[Text, Field(description="The curve that they become equal to, by its path.")]
    to: Annotated[tuple[Text, ...], Field(min_length=1, max_length=1000, description="Those that are linked to it.")]


class PaintStroke(ValueRecord):
    layer: Annotated[Text, Field(description="The layer whose weight map is painted, by its path.")]
    points: Annotated[
        tuple[tuple[Pixel, Pixel], ...],
        Field(min_length=1, max_length=1000, description="Pixels of the picture that the stroke goes through."),
    ]
    radius: Annotated[Number, Field(gt=0.0, le=MAX_PIXELS, description="Of the brush, pixels.")] = 24.0
    value: Annotated[Share, Field(description="The share that is painted.")] = 1.0
    strength: Annotated[Share, Field(description="Of the brush.")] = 1.0
    hardness: Annotated[Share, Field(description="1: the brush has a sharp edge.")] = 0.5


class HighlightStep(ValueRecord):
    layer: Annotated[Text, Field(description="The layer that is painted, or one of its curves, by its path.")]
    points: Annotated[
        tuple[tuple[Pixel, Pixel], ...],
        Field(min_length=1, max_length=1000, description="Pixels of the picture that the stroke goes through."),
    ]
    effect: Annotated[
        Effect,
        Field(description="`brighter`, `darker`, `tint`: this colour, as bright as it is; `as_there`: this radiance."),
    ] = "brighter"
    stops: Annotated[Number, Field(ge=0.0, le=MOST_STOPS, description="How much brighter or darker.")] = 1.0
    radius: Annotated[Number, Field(ge=LEAST_RADIUS, le=MOST_RADIUS, description="Of the brush, pixels.")] = 16.0
    hardness: Annotated[Share, Field(description="1: the brush has a sharp edge.")] = 0.5
    hold: Annotated[Share, Field(description="How much the rest of the object is held as it is.")] = HOLDING
    colour: Annotated[RGB, Field(description="Linear: of a tint, or the radiance of `as_there`.")] = (1.0, 1.0, 1.0)
    there: Annotated[
        tuple[Pixel, Pixel] | None, Field(description="The pixel whose radiance is painted, in place of a colour.")
    ] = None
    solve: Annotated[Solved, Field(description="`curve`, `curves`: all of the layer, or `scale`.")] = "curve"


# ----------------------------------------------------------------------------------------------------- how they are run


def _times(step: Callable[[Editor], str | None], nothing: str) -> Callable[[Editor, int | None], str | None]:
    """Undo or redo so many times; once where there is no number."""

    def run(editor: Editor, count: int | None) -> str | None:
        for _ in range(count or 1):
            if step(editor) is None:
                return nothing
        return None

    return run


def _set_values(editor: Editor, values: dict[str, Any]) -> str | None:
    for path, value in values.items():
        refusal = editor.do(set_series(path, value) or set_path(editor.document, path, value))
        if refusal is not None:
            return refusal
    return None


def _deform(editor: Editor, deform: Deform) -> str | None:
    if deform.time is not None:
        refusal = editor.do(SetTime(deform.time, deform.clip, deform.object))
        if refusal is not None:
            return refusal
    if deform.object is None or not deform.amounts:
        return None
    return editor.do(with_amounts(editor.document, deform.object, deform.amounts))


def _override(editor: Editor, lines: dict[str, LineValue]) -> str | None:
    for line, value in lines.items():
        refusal = editor.do(override_from_value(line, value))
        if refusal is not None:
            return refusal
    return None


def _set_accuracy(editor: Editor, share: float) -> str | None:
    point = load_front().nearest_point(editor.mode.name, share)
    for command in override_lines_of(point.command, editor.document):
        refusal = editor.do(command)
        if refusal is not None:
            return refusal
    return None


def selected_curve(context: OperatorContext) -> CurveSelection | None:
    """The selected curve: its layer's key, its name and its operators; None where none is selected."""
    selected = layer_shown(context.document, context.view.selected)
    if selected is None or selected.factor is None:
        return None
    return selected.key, selected.factor, context.document.layer(selected.key).operators(selected.factor)


def _has_operator(context: OperatorContext) -> bool:
    curve, index = selected_curve(context), context.view.operator
    return curve is not None and index is not None and index < len(curve[2])


def _can_reset(context: OperatorContext) -> bool:
    curve, selected = selected_curve(context), context.view.selected
    if curve is None or selected is None or context.document.is_frozen(curve[0]):
        return False
    return context.document.object(selected.object).editable and bool(curve[2])


def _delete_operator(editor: Editor, value: None) -> str | None:
    curve, index = selected_curve(editor), editor.view.operator
    return None if curve is None or index is None else editor.do(RemoveOperator(curve[0], curve[1], index))


def _mute_operator(editor: Editor, value: None) -> str | None:
    curve, index = selected_curve(editor), editor.view.operator
    if curve is None or index is None:
        return None
    return editor.do(MuteOperator(curve[0], curve[1], index, not curve[2][index].muted))


def _reset_curve(editor: Editor, value: None) -> str | None:
    curve = selected_curve(editor)
    refusal = None if curve is None else editor.do(ResetCurve(curve[0], curve[1]))
    return refusal or editor.do(SetView.of(operator=None))


def _unlink(editor: Editor, path: str | None) -> str | None:
    curve = selected_curve(editor)
    if path is None and curve is not None:
        path = f"{curve[0]}.{curve[1]}"
    return "no curve is selected" if path is None else editor.do(UnlinkCurve(path))


def _select(editor: Editor, paths: str | Selection | tuple[str, ...] | None) -> str | None:
    return editor.select(paths)


def _log_curve(editor: Editor, value: None) -> str | None:
    return editor.do(SetView.of(log_y=not editor.view.log_y, curve_zoom=None))


UNDO = Need("nothing to undo", lambda context: context.undo_label is not None)
REDO = Need("nothing to redo", lambda context: context.redo_label is not None)
UNDO_VIEW = Need("nothing to undo in the view", lambda context: context.camera_undo_label is not None)
REDO_VIEW = Need("nothing to redo in the view", lambda context: context.camera_redo_label is not None)
CURVE_OPERATOR = Need("select an operator of the curve", _has_operator)
LINKED = Need("no curves are linked", lambda context: bool(context.document.curve_links))
EDITED_CURVE = Need("select an edited curve that is not frozen", _can_reset)


def _label(start: str, label: str | None) -> str:
    return f"{start}{label}" if label else ""


EDITS = (
    Operator(
        "set", _set_values,
        script=ScriptKey(
            Annotated[dict[Text, Parameter], Field(min_length=1)],
            'Sets values by path, such as `{ "teapot.1.alpha" = 0.3 }`.',
        ),
    ),
    Operator("select", _select, script=ScriptKey(
        Text | Annotated[tuple[Text, ...], Field(min_length=1)],
        "Selects an object, a layer or a curve, by its path; or several objects, the last of which is active.",
    )),
    Operator("drag", script=ScriptKey(Drag, "Drags a handle or from one pixel to another: see below.")),
    Operator(
        "deform", _deform, script=ScriptKey(Deform, "Sets deformers or the time of an animation: see below.")
    ),
    Operator("paint", script=ScriptKey(PaintStroke, "Paints a weight map: see below.")),
    Operator(
        "paint_highlight", script=ScriptKey(HighlightStep, "Paints a highlight, from which curves follow: see below.")
    ),
    Operator(
        "rotate", lambda editor, degrees: editor.do(SetRotation(degrees)),
        script=ScriptKey(Annotated[Number, Field(ge=-1e9, le=1e9)], "Turns the environment by degrees."),
    ),
    Operator(
        "undo", _times(Editor.undo, "nothing to undo"), ("Ctrl Z",), "Undo; one drag is one step", entry="Undo",
        detail=lambda context: _label(" ", context.undo_label), needs=UNDO, repeats=True, waits=True,
        script=ScriptKey(Count, "Undoes so many edits."),
    ),
    Operator(
        "redo", _times(Editor.redo, "nothing to redo"), ("Ctrl Y", "Ctrl Shift Z"), "Redo (also Ctrl Shift Z)",
        entry="Redo", detail=lambda context: _label(" ", context.redo_label), needs=REDO, repeats=True, waits=True,
        script=ScriptKey(Count, "Redoes so many edits."),
    ),
    Operator(
        "undo_view", _times(lambda editor: editor.camera_history.undo(), "nothing to undo in the view"), ("Alt Z",),
        "Undo the view: where the camera was", entry="Undo the view",
        detail=lambda context: _label(": ", context.camera_undo_label), needs=UNDO_VIEW, repeats=True, waits=True,
        script=ScriptKey(Count, "Undoes so many moves of the camera."),
    ),
    Operator(
        "redo_view", _times(lambda editor: editor.camera_history.redo(), "nothing to redo in the view"),
        ("Shift Alt Z",), "Redo the view", entry="Redo the view",
        detail=lambda context: _label(": ", context.camera_redo_label), needs=REDO_VIEW, repeats=True, waits=True,
    ),
    Gesture("Esc", "Leave, cancel the drag, deselect: one per press"),
    Operator(
        "copy_material", keys=("Ctrl C",), help="Copy the object's material", entry="Copy the material", needs=LAYER
    ),
    Operator("copy_curve", keys=("Ctrl Shift C",), help="Copy the curve", entry="Copy the curve", needs=CURVE),
    Operator("copy_table", help="For a spreadsheet: angles in degrees and values, as text.",
             entry="Copy the curve as a table", needs=CURVE),
    Operator(
        "paste", keys=("Ctrl V",), help="Paste: material, layer, curve or table", entry="Paste", needs=LAYER, waits=True
    ),
    Operator(
        "paste_layers", keys=("Ctrl Shift V",), help="Paste the material's layers on top",
        entry="Paste as further layers", needs=LAYER, waits=True,
    ),
    Operator(
        "accuracy", _set_accuracy,
        script=ScriptKey(Share, "Moves the settings of the mode between speed, 0, and accuracy, 1."),
    ),
    Operator(
        "override", _override,
        script=ScriptKey(
            Annotated[dict[Text, StrictInt | StrictStr], Field(min_length=1)],
            'Sets lines of the plan; `"auto"`: as planned.',
        ),
    ),
)  # fmt: skip

MATERIAL = (
    Gesture("Right click", "Put a parameter back to the scene's value"),
    Gesture("Double click", "Type a number; a drag with Shift is fine"),
    Operator("brdf", keys=("Shift B",), help="Show the BRDF: sphere, lobe, slice, albedo"),
)

CURVES = (
    Gesture("Drag a b c d", "Where the edit begins, holds and ends"),
    Gesture("Drag the ring", "How strong the edit is"),
    Gesture("Drag the curve", "Pull it there: a new operator"),
    Gesture("Tab", "Next handle for the keys; with Shift the one before"),
    Gesture("Arrow keys", "Move that handle; with Shift by tenths"),
    Operator("translate", keys=("T",), help="Translate, amplify", listed_keys="T   A"),
    Operator("amplify", keys=("A",)),
    Operator("axis_x", keys=("X",), help="Along the angle, in height, diagonal", listed_keys="X   Y   D"),
    Operator("axis_y", keys=("Y",)),
    Operator("axis_xy", keys=("D",)),
    Operator(
        "log", _log_curve, ("L",), "Logarithmic height", entry="Logarithmic curve",
        is_on=lambda context: context.view.log_y,
    ),
    Operator(
        "mute", _mute_operator, ("M",), "Mute the operator", entry="Mute the operator", needs=CURVE_OPERATOR,
        waits=True,
    ),
    Operator(
        "delete", _delete_operator, ("Delete",), "Delete the operator", entry="Delete the operator",
        needs=CURVE_OPERATOR, waits=True,
    ),
    Operator(
        "link", lambda editor, value: editor.do(LinkCurves(value.curve, value.to)), needs=SCENE,
        script=ScriptKey(CurveLink, "Links curves of several objects, which are edited as one: see below."),
    ),
    Operator(
        "unlink", _unlink, entry="Unlink the curve", needs=LINKED, waits=True,
        help="The curve stays as it is, and is edited alone.",
        script=ScriptKey(Text, "Unlinks a curve, by its path, which is edited alone from then on."),
    ),
    Operator("reset_curve", _reset_curve, entry="Reset the curve", needs=EDITED_CURVE),
    Gesture("Wheel", "Zoom the angle; with Shift the height"),
    Gesture("Middle drag", "Pan; double click shows all"),
)  # fmt: skip
