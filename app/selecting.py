"""What a path selects in a document, and what stays selected when the document changes."""

from __future__ import annotations

from app.document import Document, Selection, all_factors, resolve
from engine.errors import InsituError


def selection_of(document: Document, path: str | Selection) -> Selection:
    """Of an object its topmost layer, of a layer its first curve. InsituError where there is no such thing."""
    target = resolve(document, path.path if isinstance(path, Selection) else path)
    if target.kind == "light":
        raise InsituError("the light cannot be selected; name an object, a layer or a curve")
    layers = document.object(target.object).layers
    if not layers:
        raise InsituError(f"{target.object} has no layers to edit")
    topmost = max(i for i, layer in enumerate(layers) if not layer.rises)
    index = topmost if target.layer is None else target.layer
    factor = target.name if target.kind == "factor" else layers[index].model.factors[0].name
    return Selection(target.object, index, factor)


def first_choice(document: Document) -> str | None:
    """What is selected in a scene just opened: the first editable object's topmost layer."""
    with_layers = [state for state in document.objects if state.layers and not state.emits]
    editable = [state for state in with_layers if state.editable]
    return next((state.name for state in editable or with_layers), None)


def next_choice(document: Document, selected: Selection) -> str | Selection:
    """What is selected in the place of a layer or a curve that an edit took away; else what was."""
    layers = document.object(selected.object).layers
    if selected.layer >= len(layers):
        return selected.object
    names = [factor.name for factor in all_factors(layers[selected.layer].model)]
    return selected if selected.factor is None or selected.factor in names else selected.key
