"""Copying and pasting: the edit that a copied material, layer or curve becomes where it is pasted."""

from __future__ import annotations

from app.document.commands.curves import SetOperators
from app.document.commands.layers import AddLayers, SetMaterial, operators_of_copy
from app.document.document import Document, Selection, split_key
from app.document.linked_layers import Layers, linked_indices
from app.files.material_file import LAYER, Material
from engine.core.errors import InsituError


def copy_material(document: Document, name: str) -> Material:
    """All of an object's material, with the object's name."""
    return Material(name, document.object(name).layers)


def copy_layer(document: Document, key: str) -> Material:
    """One layer on its own, with its Fresnel term where it has one."""
    name, index = split_key(document, key)
    layers = document.object(name).layers
    lead = layers[linked_indices(layers, index)[0]] if layers[index].rises else layers[index]
    terms = [layer for layer in layers if layer.rises and layer.follows == lead.name]
    return Material(lead.name, (lead.replace(follows=""), *terms), part=LAYER)


def copy_curve(document: Document, key: str, factor: str) -> Material:
    """One curve of a layer."""
    layer = document.layer(key)
    alone = layer.with_fresnel(None).replace(follows="", rises=False)
    return Material(layer.name, (alone,), part=layer.model.leader(factor))


def paste_command(
    material: Material, document: Document, selected: Selection | None, as_layers: bool
) -> SetMaterial | AddLayers | SetOperators:
    """The edit. Raises InsituError where nothing is selected that could take it."""
    if selected is None:
        raise InsituError("nothing is selected; select the object or the curve to paste onto")
    if material.part in ("", LAYER):
        layers: Layers = tuple(layer.replace(frozen=False) for layer in material.layers)
        if as_layers or material.part == LAYER:
            return AddLayers(selected.object, layers)
        return SetMaterial(selected.object, layers, material.name)
    if selected.factor is None:
        raise InsituError("no curve is selected; select the one to paste onto")
    operators = operators_of_copy(material.layers[0], material.part, document.layer(selected.key), selected.factor)
    return SetOperators(selected.key, selected.factor, operators)
