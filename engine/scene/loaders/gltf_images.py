"""Images of a glTF file as its materials use them: which can be read, what they multiply, and how they are mapped.

An image that is unavailable (in a format of an extension, mapped by a third set of coordinates, too large relative to
the file together with those before it, damaged or missing) is skipped with a note: the material's factors replace it.
Images with equal bytes are one. Mappings by KHR_texture_transform and samplers are preserved. Images are named `#N`
here, the Nth of the file; the caller, who knows the file's name, prepends it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, cast

from engine.core.errors import LoadError
from engine.material.layer_maps import MAX_REPEATS, Channel, ChannelImage, LayerMaps, TextureTransform, Wrap
from engine.material.map_tables import channel_image_table
from engine.scene.loaders.gltf_buffers import GltfBuffers
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.image_files import MOST_PIXELS, PIXELS_A_BYTE, decoding_cost
from engine.scene.loaders.pbr_layers import NumberImage
from engine.texture.texture_files import check_image, has_alpha, image_size, read_texture, read_weight

_REPEAT = 10497
_IMAGE_EXTENSIONS = ("KHR_texture_basisu", "EXT_texture_webp")
_LEAST_REPEAT = 1e-3
_WRAPS: dict[int, Wrap] = {_REPEAT: "repeat", 33648: "mirror", 33071: "clamp"}


@dataclass(frozen=True)
class TextureUse:
    """An image's number in its file, its repeats along u and v, and the rest of its mapping."""

    image: int
    scale: tuple[float, float]
    transform: TextureTransform


def uv_set_of_texture(info: JsonObject) -> int:
    """The set of texture coordinates of a texture; its transform may name another."""
    found = 0
    for owner in (info, info.child("extensions").child("KHR_texture_transform")):
        read = partial(owner.integer, "texCoord", 0, 64, found)
        found = owner.attempt("texCoord", "the first set of coordinates stands for it", read) or 0
    return found


class NumberTexture(NamedTuple):
    """A channel of a texture that multiplies a number: its factor where it is the same everywhere, else its image, and
    the least of its texels."""

    factor: float = 1.0
    image: NumberImage | None = None
    low: float = 1.0


class GltfImages:
    """The images of one file. uv_sets: the sets of texture coordinates of the meshes whose material is read now."""

    def __init__(self, root: JsonObject, buffers: GltfBuffers) -> None:
        self.uv_sets: tuple[int, ...] = (0,)
        self._root, self._buffers = root, buffers
        self._textures, self._images = root.children("textures"), root.children("images")
        self._samplers = root.children("samplers")
        self._extremes: dict[tuple[int, Channel], tuple[float, float]] = {}
        self._first_of: dict[str, int] = {}
        self._usable: dict[int, tuple[int | None, str]] = {}
        self._pixels_left = MOST_PIXELS + PIXELS_A_BYTE * buffers.n_bytes

    def use(self, info: JsonObject, notes: list[str]) -> TextureUse | None:
        """Read a material's texture, None if it cannot be shown; the reason becomes a note."""
        image = self._image(info, notes)
        if image is None:
            return None
        wrap = self._wrap(self._textures[info.integer("index", 0, len(self._textures) - 1)])
        uv_set = self.uv_sets.index(uv_set_of_texture(info))
        scale, rotation, offset = _transform(info.child("extensions").child("KHR_texture_transform"))
        # Whole offsets of an image that repeats have no effect.
        shifts = [o - round(o) if w == "repeat" else o for o, w in zip(offset, wrap, strict=True)]
        along_u, along_v = (0.0 if abs(shift) < 1e-9 else shift for shift in shifts)
        return TextureUse(image, scale, TextureTransform(rotation, (along_u, along_v), wrap, uv_set))

    def name(self, image: int) -> str:
        """An image's name, or its file's."""
        fields = self._images[image]
        return fields.text("name") or (fields.text("uri") or "")[:256]

    def has_alpha(self, image: int) -> bool:
        """Whether an image that can be read has alpha."""
        return has_alpha(self._buffers.image(image), f"{self._root.file}#{image}")

    def _wrap(self, texture: JsonObject) -> tuple[Wrap, Wrap]:
        """How a texture's sampler continues the image beyond its edges."""
        if not texture.has("sampler"):
            return "repeat", "repeat"
        read = partial(texture.integer, "sampler", 0, len(self._samplers) - 1)
        number = texture.attempt("sampler", "the image repeats", read)
        if number is None:
            return "repeat", "repeat"
        sampler = self._samplers[number]
        found: list[Wrap] = []
        for key in ("wrapS", "wrapT"):
            number = sampler.raw(key, _REPEAT)
            wrap = _WRAPS.get(number) if isinstance(number, int) else None
            if wrap is None:
                sampler.note(key, number, "taken as repeating")
            found.append(wrap or "repeat")
        return found[0], found[1]

    def maps(self, fields: JsonObject, key: str, notes: list[str]) -> LayerMaps:
        """A colour texture, decoded by sRGB, as what multiplies a layer; nothing if it cannot be shown."""
        used = self.use(fields.child(key), notes) if fields.has(key) else None
        if used is None:
            return LayerMaps()
        own = used.transform
        return LayerMaps(
            f"#{used.image}", "srgb", used.scale, texture_offset=own.offset, texture_rotation=own.rotation,
            texture_wrap=own.wrap, texture_uv_set=own.uv_set,
        )  # fmt: skip

    def channel(self, fields: JsonObject, key: str, channel: Channel, notes: list[str]) -> ChannelImage | None:
        """A channel of a texture; None if it cannot be shown."""
        used = self.use(fields.child(key), notes) if fields.has(key) else None
        return None if used is None else ChannelImage(f"#{used.image}", channel, used.scale, used.transform)

    def numbers(self, fields: JsonObject, key: str, channels: str, notes: list[str]) -> list[NumberTexture]:
        """Channels of a texture that multiply numbers; ones if it cannot be shown."""
        used = self.channel(fields, key, "grey", notes)
        if used is None:
            return [NumberTexture() for _ in channels]
        try:
            return [self._number(replace(used, channel=cast(Channel, channel))) for channel in channels]
        except LoadError as error:  # damaged inside
            number = int(used.file[1:])
            note = f"image {number} is not shown: {error.reason}"
            self._images[number].not_shown("uri" if self._images[number].has("uri") else "bufferView", note)
            self._usable[number] = None, note
            notes.append(note)
            return [NumberTexture() for _ in channels]

    def _number(self, image: ChannelImage) -> NumberTexture:
        number = int(image.file[1:])
        if (number, image.channel) not in self._extremes:
            self._measure(number, image.channel)
        low, high = self._extremes[number, image.channel]
        if low == high:
            return NumberTexture(low)
        return NumberTexture(1.0, NumberImage(channel_image_table(image)), low)

    def _measure(self, number: int, channel: Channel) -> None:
        """Find the least and the greatest texel of a channel; of red, green and blue together, as they are decoded."""
        data, name = self._buffers.image(number), f"{self._root.file}#{number}"
        channels: tuple[Channel, ...] = ("r", "g", "b") if channel in "rgb" else (channel,)
        texels = read_texture(data, name, "linear") if channel in "rgb" else read_weight(data, name, channel=channel)
        ends = texels.min(axis=(0, 1)).tolist(), texels.max(axis=(0, 1)).tolist()
        self._extremes |= {(number, each): (low, high) for each, low, high in zip(channels, *ends, strict=True)}

    def _image(self, info: JsonObject, notes: list[str]) -> int | None:
        """The number of an image that can be read."""
        read = partial(info.integer, "index", 0, len(self._textures) - 1)
        number = info.attempt("index", "a texture that is not there", read)
        if number is None:
            return None
        texture = self._textures[number]
        if uv_set_of_texture(info) not in self.uv_sets:
            notes.append("a texture by a third set of coordinates is not shown")
            info.not_shown("texCoord", "a texture by another set of coordinates than the material's first two")
            return None
        sources = [each for each in _sources(texture) if each.has("source")]
        if not sources:
            notes.append("a texture in a format of an extension is not shown")
            return None
        for k, source in enumerate(sources):
            read = partial(source.integer, "source", 0, len(self._images) - 1)
            image = source.attempt("source", "an image that is not there", read)
            if image is None:
                continue
            if image not in self._usable:
                self._usable[image] = self._examined(image)
                if self._usable[image][0] is None:
                    fields = self._images[image]
                    fields.not_shown("uri" if fields.has("uri") else "bufferView", self._usable[image][1])
            usable, note = self._usable[image]
            if usable is not None:
                for other in sources[k:]:
                    other.mark_read("source")
                return usable
            notes.append(note)
        return None

    def _examined(self, image: int) -> tuple[int | None, str]:
        """The first image with these bytes, if it can be read; else None and the reason."""
        where = [self._images[image].raw(key) for key in ("bufferView", "uri")]
        first = self._first_of.setdefault(repr(where), image)
        if first != image:
            return self._usable[first]
        try:
            data, name = self._buffers.image(image), f"{self._root.file}#{image}"
            if self._images[image].has("uri"):
                self._pixels_left += PIXELS_A_BYTE * len(data)
            size = image_size(data, name)
            if size is None:
                return None, f"image {image} is no PNG, JPEG, WebP or KTX 2 and not shown"
            n_pixels = decoding_cost(*size)
            if n_pixels > self._pixels_left:
                return None, "images are not shown that have, with those before them, too many pixels for such a file"
            check_image(data, name)
        except LoadError as error:
            return None, f"image {image} is not shown: {error.reason}"
        self._pixels_left -= n_pixels
        return image, ""


def _sources(texture: JsonObject) -> list[JsonObject]:
    """Where a texture names its image, the first choice first: extensions stand for a format that the image of the
    texture itself replaces where they are not known."""
    extensions = texture.child("extensions")
    return [*(extensions.child(name) for name in _IMAGE_EXTENSIONS), texture]


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
