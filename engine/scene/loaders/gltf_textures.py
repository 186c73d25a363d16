"""The image that a glTF material uses, its mapping to the surface, and its mean.

An image that is unavailable (in a format of an extension, mapped by a second set of coordinates, too large relative to
the file together with those before it, or missing) is skipped with a note: the material's factors replace it. Images
with equal bytes are one. Mappings by KHR_texture_transform and samplers are preserved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from engine.core.errors import LoadError
from engine.material.layer_maps import MAX_REPEATS, TextureTransform, Wrap
from engine.scene.loaders.glb import JsonObject
from engine.scene.loaders.gltf_images import image_bytes
from engine.texture.texture_files import image_size, read_texture, reduction

# Limit of pixels of all images of one file, plus more for every byte: a few kilobytes can claim millions of pixels.
# They are decoded when they are used, at 0.1 s a megapixel: at most 6 s for a small file, and never in the window's
# process.
MOST_PIXELS = 1 << 26
PIXELS_A_BYTE = 32
_REPEAT = 10497
_WRAPS: dict[int, Wrap] = {_REPEAT: "repeat", 33648: "mirror", 33071: "clamp"}
_LEAST_REPEAT = 1e-3


@dataclass(frozen=True)
class TextureUse:
    """An image's number in its file, its repeats along u and v, and the rest of its mapping."""

    image: int
    scale: tuple[float, float]
    transform: TextureTransform


class GltfImages:
    """The images of one file."""

    def __init__(self, root: JsonObject, binary: bytes) -> None:
        self._root, self._binary = root, binary
        self._textures, self._images = root.children("textures"), root.children("images")
        self._samplers = root.children("samplers")
        self._means: dict[int, tuple[float, float, float]] = {}
        self._first_of: dict[str, int] = {}
        self._usable: dict[int, tuple[int | None, str]] = {}
        self._pixels_left = MOST_PIXELS + PIXELS_A_BYTE * len(binary)

    def use(self, info: JsonObject, notes: list[str]) -> TextureUse | None:
        """Read a material's texture, None if it cannot be shown; the reason becomes a note."""
        image = self._image(info, notes)
        if image is None:
            return None
        wrap = self._wrap(self._textures[info.integer("index", 0, len(self._textures) - 1)])
        scale, rotation, offset = _transform(info.child("extensions").child("KHR_texture_transform"))
        # Whole offsets of an image that repeats have no effect.
        shifts = [o - round(o) if w == "repeat" else o for o, w in zip(offset, wrap, strict=True)]
        along_u, along_v = (0.0 if abs(shift) < 1e-9 else shift for shift in shifts)
        return TextureUse(image, scale, TextureTransform(rotation, (along_u, along_v), wrap))

    def _wrap(self, texture: JsonObject) -> tuple[Wrap, Wrap]:
        """How a texture's sampler continues the image beyond its edges."""
        if not texture.has("sampler"):
            return "repeat", "repeat"
        sampler = self._samplers[texture.integer("sampler", 0, len(self._samplers) - 1)]
        found: list[Wrap] = []
        for key in ("wrapS", "wrapT"):
            number = sampler.values.get(key, _REPEAT)
            wrap = _WRAPS.get(number) if isinstance(number, int) else None
            if wrap is None:
                sampler.note(key, number, "taken as repeating")
            found.append(wrap or "repeat")
        return found[0], found[1]

    def mean(self, info: JsonObject, notes: list[str]) -> tuple[float, float, float]:
        """Mean of an image of numbers, not of colours; 1 if it is unavailable."""
        image = self._image(info, notes)
        if image is None:
            return 1.0, 1.0, 1.0
        if image not in self._means:
            name = f"{self._root.file}#{image}"
            # A mean needs no mapping.
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
        """The first image with these bytes, if it can be read; else None and the reason."""
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
        n_pixels, k = size[0] * size[1], reduction(*size)
        if k > 1:  # cost: the pixels shown, and an eighth for decoding the rest
            n_pixels = n_pixels // k**2 + n_pixels // 8
        if n_pixels > self._pixels_left:
            return None, "images are not shown that have, with those before them, too many pixels for such a file"
        self._pixels_left -= n_pixels
        return image, ""


def _transform(transform: JsonObject) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Repeats (s_u, s_v), rotation in degrees and offset (o_u, o_v), v upwards.

    In glTF v grows downwards: u' = c s_u u + s s_v v + o_u and v' = −s s_u u + c s_v v + o_v with the cosine c and the
    sine s of the rotation (as in the extension's sample models). With 1 − v for v, before and after, this is a
    counter-clockwise rotation by the same angle and the offset (o_u + s s_v, 1 − o_v − c s_v).
    """
    given = transform.numbers("scale", 2, (1.0, 1.0))
    across, down = (_repeat(transform, number) for number in given)
    right, below = transform.numbers("offset", 2, (0.0, 0.0))
    angle = math.fmod(transform.number("rotation", 0.0), 2.0 * math.pi)
    cosine, sine = math.cos(angle), math.sin(angle)
    offset = right + sine * down, 1.0 - below - cosine * down
    along_u, along_v = (transform.clamped(o, "offset", -MAX_REPEATS, MAX_REPEATS) for o in offset)
    return (across, down), math.degrees(angle), (along_u, along_v)


def _repeat(transform: JsonObject, number: float) -> float:
    """The number, or one of a usable size: 0 would reduce an image to one colour."""
    size = min(max(abs(number), _LEAST_REPEAT), MAX_REPEATS)
    if size == abs(number):
        return number
    taken = math.copysign(size, number)
    transform.note("scale", number, f"taken as {taken:g}")
    return taken
