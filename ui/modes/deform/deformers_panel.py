"""The deformers of the selected object, and its surface: Deform's part of the Material panel."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.commands import AddDeformer, MoveDeformer, RemoveDeformer, SetDeformer, SetPose
from app.document.commands.poses import MAX_DEFORMERS
from engine.realtime.deformers import KINDS, DeformerKind
from engine.realtime.zonal_harmonics.pose import Deformation
from ui.panels import number_fields, surfaces, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag
from ui.panels.context import PanelContext
from ui.theme import Icon

AXES = ("x", "y", "z")
REST = "Back to rest"
DEGREES_A_PIXEL = 0.5
FROM_AFAR = "A deformed object shadows only itself; shadows between objects come back when idle."


def draw(context: PanelContext) -> list[Action]:
    """The stack of the selected object, first to apply on top, and its surface; nothing where none is selected."""
    if context.view.selected is None:
        return []
    state = context.document.object(context.view.selected.object)
    imgui.separator_text(f"Pose of {state.name}")
    actions: list[Action] = []
    for index, deformation in enumerate(state.deformations):
        actions += _row(context, state.name, index, deformation, len(state.deformations))
    actions += _add(context, state.name, len(state.deformations))
    if state.deformations:
        hint = "Remove all deformers; Ctrl+Z brings them back."
        _beside(REST)
        if widgets.text_button(context, "pose.reset", REST, hint):
            actions.append(SetPose(state.name))
        if not getattr(context.status, "deform_only", ()):
            widgets.caption(FROM_AFAR)
    if not state.is_lamp:
        actions += surfaces.draw(context, state)
    imgui.separator_text("Material")
    return actions


def _row(context: PanelContext, name: str, index: int, deformation: Deformation, count: int) -> list[Action]:
    """A deformer: its kind and axis, buttons up, down and remove; its amount."""
    kind, actions = KINDS[deformation.kind], list[Action]()
    imgui.push_id(index)
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(kind.title)
    side, gap = imgui.get_frame_height(), imgui.get_style().item_spacing.x
    imgui.same_line()
    axes = [(axis.upper(), f"{kind.title} along the object's {axis.upper()}.") for axis in AXES]
    widgets.align_right(widgets.segments_width(context, [text for text, _ in axes]) + 3.0 * side + gap)
    chosen = widgets.segments(context, f"pose.{index}.axis", axes, AXES.index(deformation.axis))
    if chosen is not None:
        actions.append(SetDeformer(name, index, axis=AXES[chosen]))
    imgui.same_line()
    for what, icon, hint, enabled, action in (
        ("up", Icon.UP, "Apply it earlier.", index > 0, MoveDeformer(name, index, index - 1)),
        ("down", Icon.DOWN, "Apply it later.", index < count - 1, MoveDeformer(name, index, index + 1)),
        ("delete", Icon.CLOSE, "Remove it.", True, RemoveDeformer(name, index)),
    ):
        if widgets.icon_button(context, f"pose.{index}.{what}", icon, hint, enabled=enabled):
            actions.append(action)
        if what != "delete":
            imgui.same_line(0.0, 0.0)
    imgui.set_next_item_width(-1.0)
    low, high = kind.limits
    handle = f"pose.{index}"
    if kind.unit == "degrees":  # two turns are too much for a track: a few of its pixels would be a right angle
        touch, amount = number_fields.number(
            context, "amount", deformation.amount, _format(kind), handle, low, high, DEGREES_A_PIXEL, kind.title
        )
    else:
        touch, amount = number_fields.slider(
            context, "amount", deformation.amount, low, high, _format(kind), handle=handle, origin=0.0,
            title=kind.title,
        )  # fmt: skip
    widgets.tooltip("Amount; double-click to type, drag with Shift for fine steps. 0 leaves the object undeformed.")
    actions += edits(touch, name, index, amount)
    imgui.pop_id()
    return actions


def edits(touch: number_fields.Touch, name: str, index: int, amount: float) -> list[Action]:
    """One drag of a deformer's amount as one step of the history."""
    actions: list[Action] = []
    if touch.began:
        actions.append(BeginDrag())
    if touch.changed:
        actions.append(SetDeformer(name, index, amount=amount))
    if touch.ended:
        actions.append(EndDrag())
    return actions


def _add(context: PanelContext, name: str, count: int) -> list[Action]:
    """One button for each kind of deformer, in as many rows as they need."""
    imgui.begin_disabled(count >= MAX_DEFORMERS)
    hint = "Add one after the others, then drag its amount."
    actions: list[Action] = []
    for index, (kind, form) in enumerate(KINDS.items()):
        if index:
            _beside(form.title)
        if widgets.text_button(context, f"pose.add.{index}", form.title, hint):
            actions.append(AddDeformer(name, kind))
    imgui.end_disabled()
    return actions


def _beside(title: str) -> None:
    """Continue in the row of the button before it, where a button of that title fits."""
    widgets.same_line_if_room(imgui.calc_text_size(title).x + 2.0 * imgui.get_style().frame_padding.x)


def _format(kind: DeformerKind) -> str:
    return "%.1f°" if kind.unit == "degrees" else "%.3f"
