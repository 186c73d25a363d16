"""Showing one layer of an object by itself: a way to view it, neither an edit nor part of a session.

Other objects stay as they are, and so does all indirect light, including what the hidden layers reflect onto others.
"""

from __future__ import annotations

from app.document.document import Document, split_key
from app.document.view_state import SetView, ViewState


def toggle_solo(view: ViewState, key: str) -> SetView:
    """Show this layer alone, or all of its object again where it was alone."""
    return SetView.of(solo=None if view.solo == key else key)


def solo_layer(document: Document, view: ViewState) -> str | None:
    """The layer that is shown alone; None where there is none, or no such layer any more."""
    return view.solo if any(key == view.solo for key, _ in document.layers()) else None


def is_layer_visible(document: Document, view: ViewState, key: str) -> bool:
    """Whether the picture shows a layer. A hidden layer that is shown alone is visible, its Fresnel term with it."""
    solo = None if view.solo is None else solo_layer(document, view)
    if solo is None:
        return document.is_visible(key)
    name, index = split_key(document, key)
    if split_key(document, solo)[0] != name:
        return document.is_visible(key)
    state, chosen = document.object(name), document.layer(solo)
    layer = state.layers[index]
    return state.visible and (key == solo or (layer.rises and layer.follows == chosen.name))
