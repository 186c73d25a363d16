"""The edits of links: curves that layers of several objects share (`app.document.linked_curves`)."""

from __future__ import annotations

from dataclasses import dataclass

from app.document.commands.layers import editable_layer
from app.document.document import Document
from app.document.linked_curves import free_link_name, linked_keys
from app.document.targets import resolve
from engine.core.errors import InsituError


@dataclass(frozen=True)
class LinkCurves:
    """Let curves follow one, by their paths: they become equal to it, and edits of any of them are edits of all. They
    join those that it is linked to already."""

    curve: str
    to: tuple[str, ...]

    @property
    def label(self) -> str:
        return f"link {', '.join(self.to)} to {self.curve}"

    def apply(self, document: Document) -> Document:
        key, factor = curve_of(document, self.curve)
        source = editable_layer(document, key)
        if not self.to:
            raise InsituError(f"{self.curve} is linked to nothing; name at least one curve")
        name = source.link(factor) if linked_keys(document, key, factor) else ""
        if not name:
            name = free_link_name(document, factor)
            document = document.with_layer(key, source.with_link(factor, name))
        for path in self.to:
            other, named = curve_of(document, path)
            if named != factor:
                raise InsituError(f"{path} cannot follow {self.curve}: a curve follows one of the same angle, {factor}")
            if other == key:
                raise InsituError(f"{path} is linked to itself; name the curve of another layer")
            linked = editable_layer(document, other).with_link(factor, name)
            document = document.with_layer(other, linked.with_curve_of(document.layer(key), factor))
        return document


@dataclass(frozen=True)
class UnlinkCurve:
    """Take a curve out of its link: it stays as it is, and is edited alone from now on."""

    curve: str

    @property
    def label(self) -> str:
        return f"unlink {self.curve}"

    def apply(self, document: Document) -> Document:
        key, factor = curve_of(document, self.curve)
        layer = editable_layer(document, key)
        others = linked_keys(document, key, factor)
        if not others:
            raise InsituError(f"{self.curve} is linked to no other curve")
        document = document.with_layer(key, layer.with_link(factor, ""))
        if len(others) == 1:  # which is linked to nothing now
            document = document.with_layer(others[0], document.layer(others[0]).with_link(factor, ""))
        return document


def curve_of(document: Document, path: str) -> tuple[str, str]:
    """The key of a layer, and the curve of it that a path names; of one that equals another curve of its layer that
    one. Raises InsituError."""
    target = resolve(document, path)
    if target.kind != "factor" or target.key is None or target.name is None:
        raise InsituError(f"{path!r} is a {target.kind}; name a curve, such as cup.coat.theta_h")
    return target.key, document.layer(target.key).model.leader(target.name)
