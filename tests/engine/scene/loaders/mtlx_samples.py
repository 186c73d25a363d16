"""Small documents of MaterialX for tests, written from the specification."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from engine.scene.loaders.mtlx import read_materials


def write_png(path: Path, values: np.ndarray) -> None:
    """An 8-bit image of values (H, W) or (H, W, C) in [0, 1]."""
    Image.fromarray(np.round(np.asarray(values) * 255.0).astype(np.uint8)).save(path)


def document(body: str, version: str = "1.39", root: str = "") -> str:
    return f'<?xml version="1.0"?>\n<materialx version="{version}" {root}>{body}</materialx>'


def material(shader: str, inputs: str, nodes: str = "", name: str = "it") -> str:
    """A document of one material, whose shader has these inputs and takes from these nodes."""
    return document(f"{nodes}{surface(shader, inputs, name)}")


def surface(shader: str, inputs: str, name: str = "it") -> str:
    return (
        f'<{shader} name="{name}_surface" type="surfaceshader">{inputs}</{shader}>'
        f'<surfacematerial name="{name}" type="material">'
        f'<input name="surfaceshader" type="surfaceshader" nodename="{name}_surface"/></surfacematerial>'
    )


def given(name: str, kind: str, value: str, more: str = "") -> str:
    """An input with a value."""
    return f'<input name="{name}" type="{kind}" value="{value}" {more}/>'


def linked(name: str, kind: str, node: str, more: str = "") -> str:
    """An input that comes from a node."""
    return f'<input name="{name}" type="{kind}" nodename="{node}" {more}/>'


def node(category: str, kind: str, name: str, inputs: str) -> str:
    return f'<{category} name="{name}" type="{kind}">{inputs}</{category}>'


def image(name: str, kind: str, file: str, more: str = "", space: str = "") -> str:
    space = f'colorspace="{space}"' if space else ""
    return node("image", kind, name, given("file", "filename", file, space) + more)


def read_text(folder: Path, text: str):
    """The materials of a document."""
    (folder / "it.mtlx").write_text(text, encoding="utf-8")
    return read_materials(folder / "it.mtlx").materials
