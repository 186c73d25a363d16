"""Networks of shading nodes, whatever file they are from: the form that MaterialX and USD share here.

A `ShaderNode` has the category and the inputs of a node of MaterialX. Each input has a value or comes from another
node. All inputs of the node's definition are there, those that the file does not set with their defaults
(`engine.scene.loaders.mtlx_library`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Value = tuple[float, ...] | str


@dataclass(frozen=True)
class ShaderInput:
    """An input of a node. kind: its type in MaterialX; value: numbers (a boolean is 0 or 1), or text of files and
    choices, None where it has neither; node, output: what it comes from instead; is_set: whether the file sets it;
    space: the colour space of a value or a file; geometry: the property of the geometry that is its default, such as
    "UV0"."""

    kind: str
    value: Value | None = None
    node: ShaderNode | None = None
    output: str = "out"
    is_set: bool = False
    space: str = ""
    geometry: str = ""

    @property
    def text(self) -> str:
        """A value that is text; "" for others."""
        return self.value if isinstance(self.value, str) else ""


@dataclass(frozen=True, eq=False)
class ShaderNode:
    """A node: its category, such as "image" or "standard_surface", the type of its output, and its inputs by name."""

    category: str
    kind: str
    inputs: Mapping[str, ShaderInput]
    name: str = ""


@dataclass(frozen=True)
class Link:
    """A connection to another node of a network, by its name."""

    node: str
    output: str = "out"


@dataclass(frozen=True)
class NetworkNode:
    """A node of a network as USD has it, without defaults. definition: its identifier, such as "ND_image_color3";
    inputs: values as MaterialX writes them ("0.5", "0.8, 0.2, 0.1", "true", "wood.png"), or links; spaces: the colour
    spaces of inputs that name one."""

    name: str
    definition: str
    inputs: Mapping[str, str | Link]
    spaces: Mapping[str, str] = field(default_factory=dict)


N_CHANNELS = {
    "float": 1, "integer": 1, "boolean": 1, "vector2": 2, "vector3": 3, "vector4": 4, "color3": 3, "color4": 4,
    "matrix33": 9, "matrix44": 16,
}  # fmt: skip


def parse_value(kind: str, text: str) -> Value | None:
    """A value of MaterialX from its text; None for one that is not of its type."""
    if kind not in N_CHANNELS:
        return text
    if kind == "boolean":
        return (float(text.strip().lower() in ("true", "1")),)
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return None
    is_finite = all(abs(number) <= 1e30 for number in numbers)
    return numbers if is_finite and len(numbers) == N_CHANNELS[kind] else None
