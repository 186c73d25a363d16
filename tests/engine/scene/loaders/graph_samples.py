"""Networks of nodes for tests, and their fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.scene.loaders.graph_fields import Samples
from engine.scene.loaders.graph_nodes import NodeFields
from engine.scene.loaders.mtlx import folder_images
from engine.scene.loaders.mtlx_library import complete_document
from tests.engine.scene.loaders.mtlx_samples import given, linked, material

PLACES = np.array([[0.25, 0.75], [0.8, 0.1]], np.float32)


def fields_of(folder: Path, nodes: str, kind: str = "color3", output: str = "last", version: str = "1.39"):
    """The field of the node `output`, and what makes fields."""
    link = linked("base_color", "color3", output) if kind == "color3" else linked("base", kind, output)
    if kind == "vector3":
        link = linked("normal", kind, output)
    text = material("standard_surface", link, nodes).replace('version="1.39"', f'version="{version}"')
    surface = complete_document(text.encode(), folder / "it.mtlx")[0].surface
    made = NodeFields(folder_images(folder))
    name = {"color3": "base_color", "vector3": "normal"}.get(kind, "base")
    return made.of_input(surface.inputs[name]), made


def values_of(folder: Path, nodes: str, kind: str = "color3", **more: str) -> np.ndarray:
    field, _ = fields_of(folder, nodes, kind, **more)
    return np.broadcast_to(field.at(Samples(PLACES)), (2, 3 if kind != "float" else 1))


COLOUR = "0.2, 0.5, 0.8"
A = np.array([0.2, 0.5, 0.8])


def number(name: str, value: float) -> str:
    return given(name, "float", str(value))
