"""The meshes of the built-in scenes: for each scene, file name -> mesh. Their scene.toml are written by hand."""

from collections.abc import Callable

from . import cornell, dominoes, earrings, plant, ring, room, shapes, teatray, vase
from .mesh import Mesh

# The environment that each scene's folder holds a copy of: a scene reads no file outside of its folder.
LIT_BY = {
    "teatray": "studio",
    "earrings": "hall",
    "shapes": "sky",
    "plant": "sky",
    "dominoes": "studio",
    "ring": "studio",
    "room": "sky",
}

SCENES: dict[str, Callable[[], dict[str, Mesh]]] = {
    "teatray": teatray.meshes,
    "cornell": cornell.meshes,
    "earrings": earrings.meshes,
    "shapes": shapes.meshes,
    "plant": plant.meshes,
    "dominoes": dominoes.meshes,
    "vase": vase.meshes,
    "room": room.meshes,
    "ring": ring.meshes,
}
