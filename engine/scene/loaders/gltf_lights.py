"""The lights of a glTF file (KHR_lights_punctual), in radiometric units and in the file's frame.

A light shines along −Z of its node, and the node's scale does not change it. Candela and lux are divided by 683 lm/W,
as the programs multiply that write such files: they become W/sr and W/m². Lights have no size here; `punctual_lights`
gives them one. Light falls off by the square of the distance alone: a `range` is listed as not shown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from engine.core.errors import LoadError
from engine.scene.description import valid_name
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.gltf_nodes import Float64Array, MeshNode
from engine.scene.loaders.model import ImportedLight, triple

LIGHTS = "KHR_lights_punctual"
LUMENS_PER_WATT = 683.0
MOST_LIGHTS = 64
_STRONGEST = 1e12
CONVERTED = (
    "lights without size are lamps of 1 % of the model's radius, or of their distance from its middle; candela and lux "
    f"are divided by {LUMENS_PER_WATT:g} lm/W"
)


def read_lights(file: GltfFile, nodes: Sequence[MeshNode]) -> tuple[ImportedLight, ...]:
    """The lights of these nodes; one that cannot be read is listed as not shown."""
    if not file.root.aside().child("extensions").has(LIGHTS):
        return ()
    described = file.root.child("extensions").child(LIGHTS).children("lights")
    moved = _moved_nodes(file)
    found: list[ImportedLight] = []
    for each in nodes:
        node = file.nodes[each.node]
        if not node.aside().child("extensions").has(LIGHTS):
            continue
        extension = node.child("extensions").child(LIGHTS)
        if len(found) >= MOST_LIGHTS:
            extension.not_shown("light", f"lamps after the first {MOST_LIGHTS} are not lit")
            continue
        try:
            fields = described[extension.integer("light", 0, len(described) - 1)]
            light = _light(fields, each.matrix, node.text("name") or fields.text("name") or f"Light {len(found) + 1}")
            found += [light] if any(light.intensity) else []
            if each.node in moved:
                extension.not_shown("light", "the lamp does not move in the animation")
        except LoadError as error:
            extension.not_shown("light", f"a lamp that is not lit: {error.reason}")
    return tuple(found)


def _moved_nodes(file: GltfFile) -> set[int]:
    """The nodes that animations move, and those below them; none where an animation is not valid, of which its own
    reader tells."""
    moved: set[int] = set()
    try:
        for animation in file.root.aside().children("animations"):
            targets = [channel.child("target") for channel in animation.children("channels")]
            moved |= {target.integer("node", 0, len(file.nodes) - 1) for target in targets if target.has("node")}
    except LoadError:
        return set()
    below = list(moved)
    while below:
        children = file.nodes[below.pop()].aside().indices("children", len(file.nodes))
        below += [child for child in children if child not in moved]
        moved.update(children)
    return moved


def _light(fields: JsonObject, matrix: Float64Array, name: str) -> ImportedLight:
    """The light under its node's transform (4, 4)."""
    kinds: tuple[Literal["point", "spot", "directional"], ...] = ("point", "spot", "directional")
    kind = next((each for each in kinds if each == fields.text("type")), None)
    if kind is None:
        raise fields.error("type", fields.text("type") or "nothing", "point, spot or directional")
    strength = fields.number("intensity", 1.0)
    colour = fields.numbers("color", 3, (1.0, 1.0, 1.0))
    if not 0.0 <= strength <= _STRONGEST or not all(0.0 <= each <= 1e6 for each in colour):
        raise fields.error("intensity, color", [strength, *colour], f"from 0 to {_STRONGEST:g}, from 0 to 1")
    if fields.has("range"):
        fields.not_shown("range", "light goes on beyond it, and falls off by the square of the distance alone")
    back = matrix[:3, 2]
    length = float(np.linalg.norm(back))
    if kind != "point" and not length > 0.0:
        raise fields.error("direction", back.tolist(), "an axis that has a length")
    inner, outer = _cone(fields) if kind == "spot" else (0.0, 0.0)
    intensity = tuple(strength / LUMENS_PER_WATT * each for each in colour)
    return ImportedLight(
        valid_name(name, "light"), kind, triple(np.array(intensity)), triple(matrix[:3, 3]),
        triple(-back / max(length, 1e-300)), inner, outer,
    )  # fmt: skip


def _cone(fields: JsonObject) -> tuple[float, float]:
    """The half angles of a spot's cone, 0 <= inner <= outer <= 90 degrees."""
    spot = fields.child("spot")
    outer = spot.clamped(spot.number("outerConeAngle", math.pi / 4.0), "outerConeAngle", 1e-3, math.pi / 2.0)
    return spot.clamped(spot.number("innerConeAngle", 0.0), "innerConeAngle", 0.0, outer), outer
