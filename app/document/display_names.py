"""Layers in lines for the user: by their names, not by the keys that commands, scripts and the worker use."""

from __future__ import annotations

import re

from app.document.document import Document, all_factors
from engine.material.layer import Layer, object_of


def with_display_names(document: Document, text: str) -> str:
    """A line for the user with layers by name, and the curve or parameter that follows each, as panels show them.

    Commands, scripts and the worker use keys and paths ("tray.1", "theta_h"); on screen the layer is "tray / lacquer"
    and its curve "half". A path that could be typed ("tray.1.alpha") stays one.
    """
    for key, layer in document.layers():
        if key in text:
            text = _with_layer_name(key, layer, text)
    return text


def _with_layer_name(key: str, layer: Layer, text: str) -> str:
    labels = {factor.name: factor.word for factor in all_factors(layer.model)}
    labels |= {parameter.name: parameter.label for parameter in layer.parameter_table}
    name = f"{object_of(key)} / {layer.title}"

    def said(found: re.Match[str]) -> str:
        what = found[1] or ""
        return f"{name} {labels[what]}" if what in labels else f"{name} {what}" if what else name

    return re.sub(rf"(?<![\w.]){re.escape(key)}(?!\w|\.\w)(?: (\w+))?", said, text)
