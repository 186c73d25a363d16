"""The deformers of the selected object, and its surface: Deform's part of the Material panel."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from app.document.commands import AddDeformer, MoveDeformer, RemoveDeformer, SetDeformer, SetPose, SetSurface
from app.document.commands.poses import MAX_DEFORMERS
from app.document.document import ObjectState
from app.operators.registry import keys_of
from engine.material.parameters import Parameter
from engine.realtime.deformers import KINDS
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.surface_kinds import SURFACES
from ui.panels import rows, widgets
from ui.panels.actions import Action, AskFile
from ui.panels.context import PanelContext
from ui.panels.maps import file_button
from ui.theme import Icon

AXES = ("x", "y", "z")
REST = "Back to rest"
PLAIN, PLAIN_HINT = "As its material", "An opaque surface, shaded by its layers."
# By the parameter that it replaces: which of `SURFACE_IMAGES` it is, and its effect.
IMAGES = {
    "translucency": (
        "translucency", "A grey image of translucency by texture coordinates: black lets no light through, white all.",
    ),
    "depth": (
        "depth", "A grey image of depth by texture coordinates: black is flat, white as deep as a groove is wide.",
    ),
    "kind": ("heights", "A grey image of heights that repeats in the place of a pattern; white is the highest."),
}  # fmt: skip
FROM_AFAR = "Shadows between a deformed object and others are coarse; sharp ones come back when idle."


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
        hint = f"Remove all deformers; {keys_of('undo')} brings them back."
        _beside(REST)
        if widgets.text_button(context, "pose.reset", REST, hint):
            actions.append(SetPose(state.name))
        if not getattr(context.status, "deform_only", ()):
            widgets.caption(FROM_AFAR)
    if not state.is_lamp:
        actions += _surface(context, state)
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

    def set_amount(amount: float) -> SetDeformer:
        return SetDeformer(name, index, amount=amount)

    row = rows.Row(kind.amount, deformation.amount, set_amount, f"pose.{index}", 0.0, origin=0.0)
    actions += rows.control(context, row)
    imgui.pop_id()
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


# --------------------------------------------------------------------------------------------------------- its surface


def _surface(context: PanelContext, state: ObjectState) -> list[Action]:
    """The kind of the object's surface, which Deform alone draws, and the parameters of that kind."""
    imgui.separator_text(f"Surface of {state.name}")
    imgui.begin_disabled(state.frozen or not state.editable)
    kind, kinds, actions = state.surface.kind, ["", *SURFACES], list[Action]()
    choices = [widgets.Choice(PLAIN, PLAIN_HINT, "none")]
    choices += [widgets.Choice(each.title, each.tooltip, name) for name, each in SURFACES.items()]
    hint = f"{SURFACES[kind].tooltip if kind else PLAIN_HINT} Deform alone shows it."
    widgets.label(context, "Kind")
    picked = widgets.choose(context, "surface.kind", choices, [kinds.index(kind)], hint)
    if picked is not None:
        actions.append(SetSurface(state.name, kinds[picked]))
    for parameter in SURFACES[kind].parameters if kind else ():
        if parameter.name not in state.surface.idle_parameters:
            actions += _surface_row(context, state, parameter)
    imgui.end_disabled()
    return actions


def _surface_row(context: PanelContext, state: ObjectState, parameter: Parameter) -> list[Action]:
    """A parameter; one that an image can replace has a button for that, or the image's name in its place."""

    def set_value(value: object) -> SetSurface:
        return SetSurface(state.name, state.surface.kind, ((parameter.name, value),))

    value, handle = state.surface.values.get(parameter.name), f"surface.{parameter.name}"
    row = rows.Row(parameter, value, set_value, handle, parameter.default)
    if parameter.name not in IMAGES:
        return rows.draw(context, row)
    what, hint = IMAGES[parameter.name]
    file = value if parameter.kind == "scalar" else state.surface.values.get("file")
    open_file, gap = AskFile(f"open_{what}", state.name), context.px(rows.GAP)
    widgets.label(context, parameter.label)
    room = imgui.get_content_region_avail().x - imgui.get_frame_height() - gap
    if isinstance(file, str):
        actions = file_button(context, f"{handle}.file", Path(file).name, file, hint, room, open_file)
        imgui.same_line(0.0, gap)
        remove = f"Remove the image; {keys_of('undo')} brings it back."
        if widgets.icon_button(context, f"{handle}.clear", Icon.CLOSE, remove):
            actions.append(set_value(parameter.default))
        return actions
    imgui.set_next_item_width(room)
    actions = rows.control(context, row)
    imgui.same_line(0.0, gap)
    if widgets.icon_button(context, f"{handle}.image", Icon.IMAGE, hint):
        actions.append(open_file)
    return actions
