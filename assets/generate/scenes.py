"""The meshes and images of the built-in scenes, by file name. Their scene.toml are written by hand."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from . import (
    ajar,
    amphora,
    bat,
    cornell,
    dominoes,
    earrings,
    idol,
    mime,
    plant,
    plate,
    ring,
    rings,
    room,
    shapes,
    stairwell,
    storeroom,
    teatray,
    urn,
    vase,
)
from .mesh import Mesh

# The environment that each scene's folder holds a copy of: a scene reads no file outside of its folder.
LIT_BY = {
    "teatray": "studio",
    "earrings": "hall",
    "shapes": "sky",
    "plant": "sky",
    "dominoes": "studio",
    "plate": "studio",
    "ring": "studio",
    "room": "sky",
    "rings": "studio",
    "idol": "studio",
    "bat": "studio",
    "amphora": "studio",
    "mime": "studio",
    "empty": "studio",
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
    "plate": plate.meshes,
    "stairwell": stairwell.meshes,
    "ajar": ajar.meshes,
    "storeroom": storeroom.meshes,
    "rings": rings.meshes,
    "idol": idol.meshes,
    "amphora": amphora.meshes,
    "mime": mime.meshes,
}

# Scenes whose mesh moves: what writes it to a file, by its name.
MODELS: dict[str, dict[str, Callable[[Path], None]]] = {"bat": {"bat.glb": bat.save}, "mime": {"face.glb": mime.save}}

# Models of no scene, for users to add to one: what writes each to its file in `models`.
SINGLE_MODELS: dict[str, Callable[[Path], None]] = {"urn": urn.save}

# Textures and weight maps: for each scene, file name -> (H, W, 3) sRGB or (H, W) shares, 8 bits.
IMAGES: dict[str, Callable[[], dict[str, NDArray[np.uint8]]]] = {
    "plate": plate.images,
    "room": room.images,
    "rings": rings.images,
}
