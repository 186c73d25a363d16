"""The mix of lights in the Light panel: a line for the environment, each painted light, each sun, each emitter and each
group.

A line has the light's name, its strength in stops, and whether it is on and solo. Opened, it has its temperature or
colour, its group and the objects that it lights, and of a sun where it is seen.
"""

from __future__ import annotations

from functools import partial

from imgui_bundle import imgui

from app.document.commands.light import SplitEnvironment
from app.document.commands.mix import COLOUR, KELVIN, STRENGTH, SetMix
from app.document.document import ObjectState
from app.document.light_state import (
    ENVIRONMENT_KEY,
    PLAIN_ROW,
    group_key,
    group_of,
    painted_key,
    side_key,
    sun_key,
)
from engine.light.sides import SIDES
from engine.light.suns import Sun
from ui.panels import lamp_rows, light_colour, painted_lights, rows, suns, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.theme import Icon

GAP, NAME_WIDTH = 4.0, 108.0
ENVIRONMENT_HINT = "The environment, without suns. Opened: its colour and its group."
SIDES_HINT = (
    "Split the map into six lights, as by the faces of a cube: front is the middle of its image. They fade into each "
    "other, turn with it, and this line multiplies all of them."
)
SIDE_HINT = "A side of the environment. Opened: its colour and its group."
SUN_HINT = (
    "A directional light: a distant disc that lights all objects alike. A click selects it and opens where it is seen; "
    "a right click has its name, duplicates and deletes it."
)
PAINTED_HINT = (
    "Painted onto the environment; a click selects it, then H and J place it in the picture. Opened: where it is, its "
    "size and colour."
)
EMITTER_HINT = "An object that emits light. Opened: its size, colour and group; its radiance is in the Material panel."
GROUP_HINT = "All lights of this group: what is set here multiplies each of them."
GROUP_OF_HINT = "Lights of a group have a line together, which multiplies all of them."
LIT_HINT = "The objects that it lights. Those without a tick still throw its shadow."


def draw(context: PanelContext) -> list[Action]:
    """All lines; of a single sun the rows are open at first."""
    document, light, actions = context.document, context.document.light, list[Action]()
    if light.has_sky(context.has_environment) or light.suns:
        actions += _environment(context)
    for painted in reversed(light.painted):  # what is painted last is on top
        key = painted_key(painted.name)
        is_open, changed = _line(context, key, painted.name, PAINTED_HINT, chosen=painted == context.painted)
        actions += changed
        if is_open:
            actions += painted_lights.draw_rows(context, painted) + _details(context, key)
            imgui.tree_pop()
    for sun in light.suns:
        chosen = sun.name == context.view.sun
        is_open, changed = _line(context, sun_key(sun.name), sun.name, SUN_HINT, len(light.suns) == 1, chosen, sun)
        actions += changed
        if is_open:
            actions += suns.draw(context, sun) + _details(context, sun_key(sun.name))
            imgui.tree_pop()
    for state in document.objects:
        if state.emits:
            actions += _light(context, state.name, state.name, EMITTER_HINT, state)
    if light.groups:
        widgets.caption("Groups")
    for name in light.groups:
        actions += _light(context, group_key(name), name, GROUP_HINT)
    return actions


def _environment(context: PanelContext) -> list[Action]:
    """Its line, and those of its sides where it is split."""
    light = context.document.light
    is_open, actions = _line(context, ENVIRONMENT_KEY, "Environment", ENVIRONMENT_HINT)
    if is_open:
        is_pressed, _ = imgui.checkbox("Six sides, each with a line", light.sides)
        context.handles.note_item("mix.light.environment.sides")
        widgets.tooltip(SIDES_HINT)
        actions += [SplitEnvironment(not light.sides)] if is_pressed else []
        actions += _details(context, ENVIRONMENT_KEY)
        imgui.tree_pop()
    for name in SIDES if light.sides else ():
        actions += _light(context, side_key(name), name.capitalize(), SIDE_HINT)
    return actions


def _light(context: PanelContext, key: str, name: str, hint: str, lamp: ObjectState | None = None) -> list[Action]:
    is_open, actions = _line(context, key, name, hint)
    if is_open:
        if lamp is not None:
            actions += lamp_rows.draw(context, lamp, f"light.{name}")
        actions += _details(context, key)
        imgui.tree_pop()
    return actions


def _line(
    context: PanelContext, key: str, name: str, hint: str, opened: bool = False, chosen: bool = False,
    sun: Sun | None = None,
) -> tuple[bool, list[Action]]:  # fmt: skip
    """A light's line; whether it is open, and what the user did. That of a sun or a painted light selects it."""
    row, at = context.document.light.row(key), f"mix.{key}"
    start, width, side = imgui.get_cursor_pos_x(), context.px(NAME_WIDTH), imgui.get_frame_height()
    imgui.set_next_item_open(opened, imgui.Cond_.once)
    shown = widgets.shortened(name, width - imgui.get_tree_node_to_label_spacing() - context.px(GAP))
    flags = imgui.TreeNodeFlags_.frame_padding | (imgui.TreeNodeFlags_.selected if chosen else 0)
    is_open = imgui.tree_node_ex(f"{shown}###{at}", flags)
    context.handles.note_item(at)
    painted = next((each for each in context.document.light.painted if painted_key(each.name) == key), None)
    actions: list[Action] = []
    if painted is not None and imgui.is_item_clicked():
        actions.append(painted_lights.selection(context, painted))
    widgets.tooltip(f"{name}. {hint}")
    of_sun = [] if sun is None else suns.selection(sun) + suns.menu(context, sun)
    imgui.same_line(start + width)
    imgui.set_next_item_width(max(imgui.get_content_region_avail().x - 2.0 * side, 1.0))
    strength = rows.Row(
        STRENGTH, row.strength, partial(SetMix, key, "strength"), f"{at}.strength", PLAIN_ROW.strength, origin=0.0
    )
    actions += of_sun + rows.control(context, strength)
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"{at}.on", Icon.EMITTER, "Switch it off or on; its values stay.", lit=row.on):
        actions.append(SetMix(key, "on", not row.on))
    imgui.same_line(0.0, 0.0)
    hint = "Solo: only lights that are solo shine; again: all of them."
    if widgets.icon_button(context, f"{at}.solo", Icon.SOLO, hint, lit=row.solo):
        actions.append(SetMix(key, "solo", not row.solo))
    return is_open, actions


def _details(context: PanelContext, key: str) -> list[Action]:
    """A light's temperature and colour, its group, where it is not one, and the objects that it lights."""
    row, at = context.document.light.row(key), f"mix.{key}"
    kelvin = rows.Row(
        KELVIN, row.kelvin or KELVIN.default, partial(SetMix, key, "kelvin"), f"{at}.kelvin", 0.0,
        note="0 K is none: then the colour counts.", shown="" if row.kelvin else "none",
    )  # fmt: skip
    actions = rows.draw(context, kelvin)
    colour = rows.Row(COLOUR, row.tint, partial(SetMix, key, "colour"), f"{at}.colour")
    actions += light_colour.draw(context, colour)
    actions += _group_name(context, key) if group_of(key) else _group(context, key)
    return actions + _lit_objects(context, key)


def _group_name(context: PanelContext, key: str) -> list[Action]:
    """The name of a group, to be typed."""
    widgets.label(context, "Name")
    _, typed = imgui.input_text("##name", group_of(key), imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item(f"mix.{key}.name")
    widgets.tooltip("Another name, then Enter. An empty one dissolves the group.")
    is_renamed = imgui.is_item_deactivated_after_edit() and typed.strip() != group_of(key)
    return [SetMix(key, "group", typed)] if is_renamed else []


def _group(context: PanelContext, key: str) -> list[Action]:
    names, now = context.document.light.groups, context.document.light.row(key).group
    new = next(name for i in range(1, len(names) + 2) if (name := f"Group {i}") not in names)
    choices = [widgets.Choice("None", key=""), *map(widgets.Choice, names), widgets.Choice("A new group", apart=True)]
    widgets.label(context, "Group")
    chosen = [names.index(now) + 1 if now else 0]
    picked = widgets.choose(context, f"mix.{key}.group", choices, chosen, GROUP_OF_HINT)
    return [] if picked is None else [SetMix(key, "group", ("", *names, new)[picked])]


def _lit_objects(context: PanelContext, key: str) -> list[Action]:
    """A tick for each object that reflects: whether the light reaches it."""
    names = [state.name for state in context.document.objects if not state.is_lamp]
    excluded, actions = set(context.document.light.row(key).excludes), list[Action]()
    n_lit = sum(name not in excluded for name in names)
    shown = "all objects" if n_lit == len(names) else f"{n_lit} of {len(names)} objects"
    is_open = imgui.tree_node_ex(f"Lights {shown}###lit.{key}")
    context.handles.note_item(f"mix.{key}.excludes")
    widgets.tooltip(LIT_HINT)
    if not is_open:
        return actions
    visible = imgui.ListClipper()  # of hundreds of objects
    visible.begin(len(names))
    while visible.step():
        for name in names[visible.display_start : visible.display_end]:
            is_pressed, _ = imgui.checkbox(f"{name}##lit.{key}", name not in excluded)
            context.handles.note_item(f"mix.{key}.excludes.{name}")
            if is_pressed:
                actions.append(SetMix(key, "excludes", tuple(excluded ^ {name})))
    imgui.tree_pop()
    return actions
