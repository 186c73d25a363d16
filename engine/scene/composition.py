"""Which objects a scene has that does not have those of its file: duplicates, other names, objects of its own, hidden
ones."""

from __future__ import annotations

from dataclasses import dataclass

from engine.scene.description import ObjectDescription, Primitive

# The shapes, props and lights that a user can add, by the names of menus and scripts.
SHAPES: dict[str, Primitive] = {
    "box": "cube", "sphere": "sphere", "plane": "quad", "cylinder": "cylinder", "cone": "cone", "torus": "torus"
}  # fmt: skip
PROPS: dict[str, tuple[Primitive, ...]] = {
    "backdrop": ("backdrop",), "shader ball": ("shader_ball", "shader_ball_base"), "pedestal": ("pedestal",)
}  # fmt: skip
LIGHTS: dict[str, Primitive] = {
    "rectangle light": "quad", "disc light": "disc", "sphere light": "sphere", "point light": "sphere",
    "spot light": "sphere",
}  # fmt: skip
ADDABLE = (*SHAPES, *PROPS, *LIGHTS)
SUN = "sun"  # a light that is no object
# The name of an object of the scene's file, or the description of one that was added: what it is read from, without
# layers, its file by its full path.
ObjectSource = str | ObjectDescription


@dataclass(frozen=True)
class SceneObject:
    """An object of a composed scene: its name, and what it is. is_hidden: whether it has no surface now; it keeps its
    place among the others."""

    name: str
    source: ObjectSource
    is_hidden: bool = False


# In their order; None in its place: the scene as its file has it.
Composition = tuple[SceneObject, ...]
