"""Which image a glTF material uses, how it lies on the surface, and its mean.

An image that cannot be had (kept in a format of an extension, placed by a second set of coordinates, larger with those
before it than the file is worth, or not there) is stepped over with a note: the material's factors stand for it. Images
that are the same bytes are one. Repeats are kept; a texture that is turned or moved by
another part than whole repeats is shown without that, with a note.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.errors import LoadError
from engine.material.maps import MAX_REPEATS
from engine.scene.glb import JsonObject
from engine.scene.gltf_images import image_bytes
from engine.texture.images import image_size, read_texture

# Of all images of one file, and more for every byte: a few kilobytes can claim millions of pixels. They are decoded
# when they are used, 0.1 s a megapixel: whatever a small file claims, that is 6 s, and never in the window's process.
MOST_PIXELS = 1 << 26
PIXELS_A_BYTE = 32


@dataclass(frozen=True)
class TextureUse:
    """The number of an image in its file, and how often it repeats along u and v."""

    image: int
    scale: tuple[float, float]


class GltfImages:
    """The images of one file."""

    def __init__(self, root: JsonObject, binary: bytes) -> None:
        self._root, self._binary = root, binary
        self._textures, self._images = root.children("textures"), root.children("images")
        self._means: dict[int, tuple[float, float, float]] = {}
        self._first_of: dict[str, int] = {}
        self._usable: dict[int, tuple[int | None, str]] = {}
        self._pixels_left = MOST_PIXELS + PIXELS_A_BYTE * len(binary)

    def use(self, info: JsonObject, notes: list[str]) -> TextureUse | None:
        """What a material's texture says, None where it cannot be shown; notes tell why."""
        image = self._image(info, notes)
        if image is None:
            return None
        return TextureUse(image, _repeats(info.child("extensions").child("KHR_texture_transform"), notes))

    def mean(self, info: JsonObject, notes: list[str]) -> tuple[float, float, float]:
        """Of an image of numbers, not of colours; 1 where it cannot be had."""
        image = self._image(info, notes)
        if image is None:
            return 1.0, 1.0, 1.0
        if image not in self._means:
            name = f"{self._root.file}#{image}"
            pixels = read_texture(image_bytes(self._root, self._binary, image), name, "linear")
            red, green, blue = pixels.reshape(-1, 3).mean(axis=0, dtype=np.float64).tolist()
            self._means[image] = red, green, blue
        notes.append("of a metallic-roughness texture the means are shown")
        return self._means[image]

    def _image(self, info: JsonObject, notes: list[str]) -> int | None:
        """The number of an image that can be read."""
        texture = self._textures[info.integer("index", 0, len(self._textures) - 1)]
        transform = info.child("extensions").child("KHR_texture_transform")
        if transform.integer("texCoord", 0, 64, info.integer("texCoord", 0, 64, 0)):
            notes.append("a texture by a second set of coordinates is not shown")
            return None
        if not texture.has("source"):
            notes.append("a texture in a format of an extension is not shown")
            return None
        image = texture.integer("source", 0, len(self._images) - 1)
        if image not in self._usable:
            self._usable[image] = self._examined(image)
        usable, note = self._usable[image]
        if note:
            notes.append(note)
        return usable

    def _examined(self, image: int) -> tuple[int | None, str]:
        """The first image of these bytes, if it can be read; else None and why not."""
        where = [self._images[image].values.get(key) for key in ("bufferView", "uri")]
        first = self._first_of.setdefault(repr(where), image)
        if first != image:
            return self._usable[first]
        try:
            size = image_size(image_bytes(self._root, self._binary, image), f"{self._root.file}#{image}")
        except LoadError as error:
            return None, f"image {image} is not shown: {error.reason}"
        if size is None:
            return None, f"image {image} is no PNG or JPEG and not shown"
        n_pixels = size[0] * size[1]
        if n_pixels > self._pixels_left:
            return None, "images are not shown that have, with those before them, too many pixels for such a file"
        self._pixels_left -= n_pixels
        return image, ""


def _repeats(transform: JsonObject, notes: list[str]) -> tuple[float, float]:
    """The repeats of a transform. In glTF v grows downwards: scaled by s and moved by o, what is 1 − v here becomes
    s (1 − v) + o, the same as s v but for a shift by 1 − s − o."""
    across, down = transform.numbers("scale", 2, (1.0, 1.0))
    for number in (across, down):
        if not 1e-3 <= abs(number) <= MAX_REPEATS:
            raise transform.error("scale", [across, down], f"numbers up to {MAX_REPEATS:g}, none 0")
    right, below = transform.numbers("offset", 2, (0.0, 0.0))
    shifts = (right, 1.0 - down - below)
    if transform.number("rotation", 0.0) != 0.0 or any(abs(s - round(s)) > 1e-6 for s in shifts):
        notes.append("a texture is turned or moved in the file and shown without that")
    return across, down
