"""Matching a material with a model: the list of models in menus, and what the last match came to."""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.material_match import matching_models
from app.operators.material_matches import MatchMaterial
from ui.panels import widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext

HINT = (
    "Replaces all layers of the object by one layer of the chosen model that looks like this material: parameters such "
    "as its roughness are searched for, and each of its curves gets one operator. Both errors are shown, of the BRDF "
    "and in the picture."
)
ERRORS_HINT = (
    "Of the BRDF: root mean square over all directions, relative to the material, dark and bright values alike. In the "
    "picture: of the object's pixels, as it was and as it is now, relative to their mean, with as many bounces as the "
    "picture, by path tracing without its noise."
)

NAME_WIDTH = 160.0


def models(context: PanelContext, handle: str, source: str, object_name: str) -> list[Action]:
    """The entries of a menu: the models to match a material with, for an object. source: as in `MatchMaterial`."""
    actions: list[Action] = []
    imgui.text_disabled(f"Replace all layers of {widgets.shortened(object_name, context.px(NAME_WIDTH))} by")
    imgui.separator()
    for model in sorted(matching_models(), key=lambda each: each.label):
        if imgui.menu_item_simple(model.label):
            value = MatchMaterial(object=object_name, source=source, model=model.name)
            actions.append(RunOperator("match_material", value))
        context.handles.note_item(f"{handle}.{model.name}")
        widgets.tooltip(model.tooltip)
    return actions


def draw_result(context: PanelContext, object_name: str) -> None:
    """The errors of the last match, as long as the object has what it found."""
    matched, note = context.status.material_match_note
    if matched == object_name:
        widgets.caption(note)
        context.handles.note_item("material.match_material.result")
        widgets.tooltip(ERRORS_HINT)
