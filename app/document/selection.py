"""Selection by path, the selection that remains when the document changes, and solo: one layer shown by itself.

Solo is a way to view an object, neither an edit nor part of a session. Other objects stay as they are, and so does all
indirect light, including what the hidden layers reflect onto others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from app.document.commands.curves import CurveEdit
from app.document.document import Document, Selection, all_factors, layer_key, split_key
from app.document.light_state import sun_key
from app.document.targets import resolve
from app.document.view_state import SetView, ViewState
from engine.core.errors import InsituError
from engine.curve.operators import edits_of
from engine.light.suns import Sun
from engine.material.layer import object_of, place_of

Operators = tuple[CurveEdit, ...]
Path = str | Selection


def selection_of(document: Document, path: str | Selection) -> Selection:
    """The selection of a path: of an object its topmost layer, of a layer its first curve, of a lamp the lamp.
    InsituError where the path names nothing."""
    if isinstance(path, Selection) and document.object(path.object).is_lamp:
        return Selection(path.object, 0)
    target = resolve(document, path.path if isinstance(path, Selection) else path)
    if target.kind == "light":
        raise InsituError("the light cannot be selected; name an object, a layer, a curve or a sun")
    state = document.object(target.object)
    layers = state.layers
    if state.is_lamp:
        return Selection(state.name, 0)
    if not layers:
        raise InsituError(f"{target.object} has no layers to edit")
    topmost = max(i for i, layer in enumerate(layers) if not layer.rises)
    index = topmost if target.layer is None else target.layer
    factor = target.name if target.kind == "factor" else layers[index].model.factors[0].name
    return Selection(target.object, index, factor)


def select_in_view(document: Document, view: ViewState, paths: Path | Sequence[Path] | None) -> ViewState:
    """The view with these selected, the last of them active; of an object that is selected already, what is active of
    it stays. A sun is selected alone. InsituError where a path names nothing."""
    several: Sequence[Path] = [paths] if isinstance(paths, str | Selection) else paths or ()
    sun = sun_of_path(document, several[-1]) if several else None
    view = replace(view, sun=sun)
    if not several or sun is not None:
        return _activated(view, None, ())
    found = [selection_of(document, path) for path in several]
    now, active = view.selected, found[-1]
    if len(found) > 1 and now is not None and several[-1] == now.object:
        active = now
    names = dict.fromkeys(each.object for each in found if each.object != active.object)
    return _activated(view, active, tuple(names))


def toggled(view: ViewState, *names: str) -> tuple[str, ...]:
    """The selected objects after a click on one, or on one of a group, which is the last of these: they are selected as
    well and it is active, or, where one of them is active, they no longer are."""
    chosen = view.selected_objects
    rest = tuple(each for each in chosen if each not in names)
    return rest if chosen and chosen[-1] in names and set(names) <= set(chosen) else (*rest, *names)


def group_around(document: Document, name: str) -> tuple[str, ...]:
    """The objects of an object's group, it last; it alone where it is in none."""
    group = document.object(name).in_group
    members = document.groups[group] if group else ()
    return (*(each for each in members if each != name), name)


def clicked(document: Document, view: ViewState, name: str) -> tuple[str, ...]:
    """What a click on an object in the picture is about: all of its group, it last; it alone where only some of its
    group are selected, as by a double click on one before."""
    members = group_around(document, name)
    some = set(members) & set(view.selected_objects)
    return members if not some or len(some) == len(members) else (name,)


def follow_in_view(before: Document, document: Document, view: ViewState) -> ViewState:
    """The view after an edit, an undo or a redo, in which what is gone is no longer selected; objects that were
    renamed still are."""
    view = replace(_renamed_in_view(before, document, view), sun=sun_after_edit(before, document, view.sun))
    there = {state.name for state in document.objects}
    others = tuple(name for name in view.others if name in there)
    selected = view.selected
    if selected is None:
        return view
    if selected.object not in there and others:
        return _activated(view, selection_of(document, others[-1]), others[:-1])
    choice = selection_after_edit(document, selected)
    if choice != selected:
        return _activated(view, None if choice is None else selection_of(document, choice), others)
    operator = operator_after_edit(before, document, selected, view.operator)
    return replace(view, others=others, operator=operator)


def _renamed_in_view(before: Document, document: Document, view: ViewState) -> ViewState:
    """The view with the new names of selected objects and of the layer that is shown alone, where objects have only
    been renamed."""
    old, new = [state.name for state in before.objects], [state.name for state in document.objects]
    if len(old) != len(new) or old == new or set(old) == set(new):
        return view
    names = {a: b for a, b in zip(old, new, strict=True) if a != b and a not in new and b not in old}
    selected, solo = view.selected, view.solo
    if selected is not None:
        selected = selected._replace(object=names.get(selected.object, selected.object))
    if solo is not None and (name := names.get(object_of(solo))) is not None:
        solo = layer_key(name, place_of(solo))
    others = tuple(names.get(name, name) for name in view.others)
    return replace(view, selected=selected, others=others, solo=solo)


def _activated(view: ViewState, selected: Selection | None, others: tuple[str, ...]) -> ViewState:
    if selected == view.selected:
        return replace(view, others=others)
    return replace(view, selected=selected, others=others, operator=None, curve_zoom=None)


def sun_of_path(document: Document, path: str | Selection | None) -> str | None:
    """The name of the sun that a path such as "light.Noon" is of; None where it is of anything else."""
    if not isinstance(path, str):
        return None
    return next((each.name for each in document.light.suns if path == sun_key(each.name)), None)


def layer_shown(document: Document, selected: Selection | None) -> Selection | None:
    """The selection, where it is of a layer: a lamp only emits."""
    return None if selected is None or document.object(selected.object).is_lamp else selected


def initial_selection(document: Document) -> str | None:
    """The selection in a scene just opened: the first editable object's topmost layer."""
    with_layers = [state for state in document.objects if state.layers]
    editable = [state for state in with_layers if state.editable]
    return next((state.name for state in editable or with_layers), None)


def selection_after_edit(document: Document, selected: Selection) -> str | Selection | None:
    """The selection that replaces an object, a layer or a curve that an edit removed; else the present one."""
    state = next((each for each in document.objects if each.name == selected.object), None)
    if state is None:
        return initial_selection(document)
    layers = state.layers
    if state.is_lamp:
        return selected
    if selected.layer >= len(layers):
        return selected.object
    names = [factor.name for factor in all_factors(layers[selected.layer].model)]
    return selected if selected.factor is None or selected.factor in names else selected.key


def sun_after_edit(before: Document | None, after: Document, sun: str | None) -> str | None:
    """The selected sun after an edit, an undo or a redo, under its name of now; None where it is gone."""
    names = [each.name for each in after.light.suns]
    was = () if before is None else before.light.suns
    if sun is None or sun in names:
        return sun
    pairs = zip(was, names, strict=True) if len(was) == len(names) else ()
    return next((now for each, now in pairs if each.name == sun), None)


def selected_sun(document: Document, view: ViewState) -> Sun | None:
    """The sun that is selected."""
    return next((each for each in document.light.suns if each.name == view.sun), None)


def operator_after_edit(before: Document, after: Document, selected: Selection | None, index: int | None) -> int | None:
    """The index of the selected operator of the selected curve after an edit, an undo or a redo; None where it is gone.

    Where none is selected, a new one (a restored one, for example) is.
    """
    old, new = _operators(before, selected), _operators(after, selected)
    if old == new:
        return index
    same = 0
    while same < min(len(old), len(new)) and old[same] == new[same]:
        same += 1
    tail = 0
    while tail < min(len(old), len(new)) - same and old[-1 - tail] == new[-1 - tail]:
        tail += 1
    kept = None if index is None or index >= len(old) else _follow_index(old, new, same, tail, index)
    came = new[same : len(new) - tail]
    return same if kept is None and len(old) == same + tail and len(edits_of(came)) == 1 else kept


def _follow_index(old: Operators, new: Operators, same: int, tail: int, index: int) -> int | None:
    """The new index, of lists that agree in their first `same` and last `tail` places; the rest was moved or
    changed."""
    if index < same:
        return index
    if index >= len(old) - tail:
        return index + len(new) - len(old)
    moved = [place for place in range(same, len(new) - tail) if new[place] == old[index]]
    return moved[0] if moved else index if len(old) == len(new) else None


def _operators(document: Document, selected: Selection | None) -> Operators:
    """The operators of the selected curve; none where there is no such curve."""
    if selected is None or selected.factor is None:
        return ()
    layers = next((state.layers for state in document.objects if state.name == selected.object), ())
    return layers[selected.layer].operators(selected.factor) if selected.layer < len(layers) else ()


def toggle_solo(view: ViewState, key: str) -> SetView:
    """Show this layer alone, or all of its object again where it was alone."""
    return SetView.of(solo=None if view.solo == key else key)


def solo_layer(document: Document, view: ViewState) -> str | None:
    """The layer that is shown alone; None where there is none, or no such layer any more."""
    return view.solo if any(key == view.solo for key, _ in document.layers()) else None


def is_layer_visible(document: Document, view: ViewState, key: str) -> bool:
    """Whether the picture shows a layer. A hidden layer that is shown alone is visible, with its Fresnel term and its
    nodes."""
    solo = None if view.solo is None else solo_layer(document, view)
    if solo is None:
        return document.is_visible(key)
    name, index = split_key(document, key)
    if split_key(document, solo)[0] != name:
        return document.is_visible(key)
    state, chosen = document.object(name), document.layer(solo)
    layer = state.layers[index]
    is_part = layer.node_of == chosen.name or (layer.rises and layer.follows == chosen.name)
    return state.visible and (key == solo or is_part)
