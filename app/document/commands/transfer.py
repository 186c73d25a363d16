"""Giving curves of other layers the change that was drawn on one."""

from __future__ import annotations

from dataclasses import dataclass

from app.document.commands.curves import SetOperators
from app.document.commands.layers import editable_layer
from app.document.commands.links import curve_of
from app.document.document import Document, layer_key
from app.document.linked_curves import linked_keys
from app.document.targets import resolve
from engine.core.errors import InsituError, list_names
from engine.inverse.transferred_edit import MEASURES, Measure, transferred_edit


@dataclass(frozen=True)
class TransferEdit:
    """Add the change of a curve, by its path, to the curves of the same angle of other layers, by their paths: one
    operator each, whatever is named twice or linked. measure: see `engine.inverse.transferred_edit`."""

    curve: str
    to: tuple[str, ...]
    measure: Measure = "ratio"

    @property
    def label(self) -> str:
        return f"transfer the edit of {self.curve}"

    def apply(self, document: Document) -> Document:
        if self.measure not in MEASURES:
            raise InsituError(f"measure = {self.measure!r}, expected {', '.join(MEASURES[:-1])} or {MEASURES[-1]}")
        key, factor = curve_of(document, self.curve)
        source = document.layer(key)
        if not any(not each.muted for each in source.operators(factor)):
            raise InsituError(f"{self.curve} has no operators whose change could be transferred")
        if not self.to:
            raise InsituError(f"{self.curve} is transferred to nothing; name at least one layer")
        for other in self._targets(document, key, factor):
            layer = editable_layer(document, other)
            operator = transferred_edit(source, layer, factor, self.measure)
            if operator is not None:
                document = SetOperators(other, factor, (*layer.operators(factor), operator)).apply(document)
        return document

    def _targets(self, document: Document, key: str, factor: str) -> list[str]:
        """The keys of the layers that are edited: each once, and one of those that share the curve, which the others
        follow."""
        found: list[str] = []
        for path in self.to:
            other = _layer_of(document, path, factor)
            sharing = {other, *linked_keys(document, other, factor)}
            if key in sharing:
                reason = "is where the change is from" if other == key else "shares the curve that the change is from"
                raise InsituError(f"{path} {reason}; name another layer")
            if sharing.isdisjoint(found):
                found.append(other)
        return found


def _layer_of(document: Document, path: str, factor: str) -> str:
    """The key of the layer that a path names, itself or one of its curves, or of the uppermost of an object that has
    the curve. Raises InsituError."""
    target = resolve(document, path)
    if target.kind == "object":
        state = document.object(target.object)
        having = [i for i, layer in enumerate(state.layers) if factor in layer.model.curve_names]
        if not having:
            raise InsituError(f"{path} has no layer with a curve {factor}")
        return layer_key(target.object, having[-1])
    if target.key is None:
        raise InsituError(f"{path!r} is a {target.kind}; name a layer, such as cup.coat")
    if factor not in document.layer(target.key).model.curve_names:
        there = sorted(document.layer(target.key).model.curve_names)
        raise InsituError(f"{path} has no curve {factor}; it has {list_names(there)}")
    return target.key
