"""Operators that give other materials the change that was drawn on a curve."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from pydantic import Field

from app.document.commands.transfer import TransferEdit
from app.document.selection import layer_shown
from app.editor.editor import Editor
from app.operators.operator import Need, Operator, OperatorContext, ScriptKey, ValueRecord
from engine.inverse.transferred_edit import MEASURES, Measure
from engine.scene.description import Text


class Transfer(ValueRecord):
    """A curve whose change other layers get."""

    curve: Annotated[Text, Field(description="The curve whose change is transferred, by its path.")]
    to: Annotated[
        tuple[Text, ...],
        Field(min_length=1, max_length=1000, description="Layers, or objects: the uppermost layer with such a curve."),
    ]
    measure: Annotated[
        Measure,
        Field(
            description="`ratio`: as many stops at each angle; `relative`: the same share of the highlight's middle; "
            "`absolute`: the same difference."
        ),
    ] = "ratio"


def _transfer(editor: Editor, value: Transfer) -> str | None:
    return editor.do(TransferEdit(value.curve, value.to, value.measure))


def _transfer_to_others(measure: Measure, editor: Editor, value: None) -> str | None:
    selected = layer_shown(editor.document, editor.view.selected)
    if selected is None or selected.factor is None:
        return "no curve is selected"
    return editor.do(TransferEdit(f"{selected.key}.{selected.factor}", editor.view.others, measure))


def _has_edit_and_others(context: OperatorContext) -> bool:
    selected = layer_shown(context.document, context.view.selected)
    if selected is None or selected.factor is None or not context.view.others:
        return False
    return any(not each.muted for each in context.document.layer(selected.key).operators(selected.factor))


EDIT_AND_OTHERS = Need("select objects, last the one whose curve is edited, and that curve", _has_edit_and_others)
_ENTRIES: dict[Measure, tuple[str, str]] = {
    "ratio": ("By the same ratio", "Other selected objects get as many stops more or less at each angle"),
    "relative": ("As the same share of the highlight", "They get the change as a share of their highlight's middle"),
    "absolute": ("By the same difference", "They get the same difference"),
}
TRANSFERS = (
    Operator("transfer", _transfer, script=ScriptKey(Transfer, "Gives layers the change of a curve: see below.")),
    *(
        Operator(
            f"transfer_{measure}", partial(_transfer_to_others, measure), entry=_ENTRIES[measure][0],
            help=_ENTRIES[measure][1], needs=EDIT_AND_OTHERS, waits=True,
        )
        for measure in MEASURES
    ),
)  # fmt: skip
