"""The link of a curve to those of other objects: a chain with their number in the curve's toolbar, and the list of what
it can be linked to."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.document import Document
from app.document.linked_curves import linked_keys
from app.operators.edits import CurveLink
from engine.material.layer import object_of
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext
from ui.theme import Icon

POPUP = "curve.links"
HINT = "Link this curve to those of other objects: edits of one are edits of all."
CHOICE_HINT = "Becomes equal to this curve, and follows it from now on."
UNLINK_HINT = "Is edited alone from now on; it stays as it is."


def width(context: PanelContext, key: str, factor: str) -> float:
    """Pixels of the chain, with its number where the curve is linked."""
    count = _count(context, key, factor)
    return imgui.get_frame_height() + (imgui.calc_text_size(count).x + context.px(4) if count else 0.0)


def draw(context: PanelContext, key: str, factor: str, editable: bool) -> list[Action]:
    """The chain, lit where the curve is linked, and the list that it opens."""
    linked = linked_keys(context.document, key, factor)
    names = ", ".join(_title(context.document, each) for each in linked)
    hint = f"Shared with {names}: edits of one are edits of all." if linked else HINT
    if widgets.icon_button(context, POPUP, Icon.LINK, hint, lit=bool(linked)):
        imgui.open_popup(POPUP)
    if linked:
        imgui.same_line(0.0, 0.0)
        imgui.align_text_to_frame_padding()
        imgui.text_colored(look.ACCENT, _count(context, key, factor))
        widgets.tooltip(hint)
    if not imgui.begin_popup(POPUP):
        return []
    actions = _choices(context, key, factor, linked, editable)
    imgui.end_popup()
    return actions


def candidates(document: Document, key: str, factor: str) -> tuple[str, ...]:
    """The keys of layers of other objects that have this curve, in the order of the scene."""
    return tuple(
        other for other, layer in document.layers()
        if object_of(other) != object_of(key) and factor in layer.model.curve_names and not layer.rises
    )  # fmt: skip


def _choices(context: PanelContext, key: str, factor: str, linked: tuple[str, ...], editable: bool) -> list[Action]:
    """What the curve can be linked to; checked: what it is linked to."""
    actions: list[Action] = []
    imgui.text_disabled("Link to…")
    others = candidates(context.document, key, factor)
    for other in others:
        title, is_on = f"{_title(context.document, other)}###{other}", other in linked
        enabled = editable and not context.document.is_frozen(other)
        if imgui.menu_item_simple(title, None, is_on, enabled):
            path = f"{other}.{factor}"
            link = CurveLink(curve=f"{key}.{factor}", to=(path,))
            actions.append(RunOperator("unlink", path) if is_on else RunOperator("link", link))
        context.handles.note_item(f"curve.link.{other}")
        widgets.tooltip(UNLINK_HINT if is_on else CHOICE_HINT)
    if not others:
        imgui.text_unformatted("No other object has a curve of this angle")
    if len(others) > 1:
        imgui.separator()
        if imgui.menu_item_simple("All of them", None, False, editable):
            free = tuple(f"{other}.{factor}" for other in others if not context.document.is_frozen(other))
            actions += [RunOperator("link", CurveLink(curve=f"{key}.{factor}", to=free))] if free else []
    if linked and imgui.menu_item_simple("Unlink this curve", None, False, editable):
        actions.append(RunOperator("unlink", f"{key}.{factor}"))
    return actions


def _title(document: Document, key: str) -> str:
    return f"{object_of(key)} / {document.layer(key).title}"


def _count(context: PanelContext, key: str, factor: str) -> str:
    """How many curves share the link, this one too; "" for none."""
    linked = linked_keys(context.document, key, factor)
    return str(len(linked) + 1) if linked else ""
