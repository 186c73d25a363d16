"""Textures of a UsdPreviewSurface network: which image an input takes, which channel, how it is laid out, and what
scales it [UsdPreviewSurface: UsdUVTexture, UsdTransform2d, UsdPrimvarReader].

A texture whose image cannot be shown counts as not there: the input has the texture's fallback where the file has one,
else its own value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.core.errors import LoadError, describe_value
from engine.material.layer_maps import (
    IDENTITY_TRANSFORM,
    LEAST_REPEATS,
    MAX_REPEATS,
    Channel,
    ChannelImage,
    LayerMaps,
    Space,
    TextureTransform,
    Wrap,
)
from engine.material.map_tables import channel_image_table
from engine.scene.loaders.image_files import MOST_PIXELS, PIXELS_A_BYTE, decoding_cost
from engine.scene.loaders.pbr_layers import NumberImage
from engine.scene.loaders.usd_layers import UsdLayers, UsdPlace
from engine.scene.loaders.usd_prims import UsdPrim, UsdScene
from engine.texture.texture_files import MAX_IMAGE_BYTES, check_image, has_alpha, image_size, read_texture

RGBA = tuple[float, float, float, float]
_MOST_LINKS = 16  # of a chain of connections
_TEXTURE, _TRANSFORM = "UsdUVTexture", "UsdTransform2d"
_READERS = "UsdPrimvarReader_"
_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "useMetadata": "repeat"}
_SPACES: dict[str, Space] = {"raw": "linear", "sRGB": "srgb", "auto": ""}


@dataclass(frozen=True)
class UsdTexture:
    """A texture of an input. image: its name in a part; primvar: of its coordinates; channel: the output that the input
    takes, "rgb" or one of r, g, b, a; its values are scale · texel + bias."""

    prim: UsdPrim
    image: str
    place: UsdPlace
    primvar: str
    channel: str
    repeats: tuple[float, float]
    transform: TextureTransform
    space: Space
    scale: RGBA
    bias: RGBA

    @property
    def maps(self) -> LayerMaps:
        """What multiplies a layer, a colour."""
        own = self.transform
        return LayerMaps(
            self.image, self.space, self.repeats, texture_offset=own.offset, texture_rotation=own.rotation,
            texture_wrap=own.wrap, texture_uv_set=own.uv_set,
        )  # fmt: skip

    @property
    def single(self) -> Channel:
        """The channel of numbers; of a colour its red."""
        return "r" if self.channel == "rgb" else self.channel  # type: ignore[return-value]

    @property
    def gain(self) -> float:
        """What white of that channel becomes."""
        k = "rgba".index(self.single)
        return self.scale[k] + self.bias[k]

    def weight(self, channel: Channel) -> ChannelImage:
        """A channel as a share."""
        return ChannelImage(self.image, channel, self.repeats, self.transform)

    @property
    def numbers(self) -> NumberImage:
        """The channel as what multiplies a number."""
        return NumberImage(channel_image_table(self.weight(self.single)))


@dataclass(frozen=True)
class UsdPrimvar:
    """An input that takes the value of a primvar."""

    name: str


class UsdTextures:
    """The textures of one file."""

    def __init__(self, scene: UsdScene, layers: UsdLayers) -> None:
        self._scene, self._layers = scene, layers
        self._images: dict[UsdPlace, str] = {}
        self._places: dict[str, UsdPlace] = {}
        self._extremes: dict[str, tuple[list[float], list[float]]] = {}
        self._pixels_left = MOST_PIXELS + PIXELS_A_BYTE * layers.n_bytes

    def source(self, prim: UsdPrim, key: str) -> tuple[UsdPrim, str]:
        """The prim and the property that give an input its value: its own, that of an interface, or a shader's
        output."""
        for _ in range(_MOST_LINKS):
            prim.mark_read(key)
            found = self._scene.connected(prim, key)
            if found is None:
                return prim, key
            prim, key = found
        raise prim.error(key, "a circle of connections", f"at most {_MOST_LINKS} of them")

    def read(self, prim: UsdPrim, key: str) -> UsdTexture | UsdPrimvar | None:
        """The texture or the primvar that an input takes; None where it has a value of its own, or nothing that can be
        shown."""
        shader, output = self.source(prim, key)
        kind = shader.word("info:id", "") if output.startswith("outputs:") else ""
        if not output.startswith("outputs:"):
            return None
        if kind.startswith(_READERS):
            return UsdPrimvar(self._text(shader, "inputs:varname"))
        if kind != _TEXTURE:
            node = describe_value(kind or shader.place)
            prim.not_shown(key, f"a node {node} that is not known: its own value counts")
            return None
        return self._texture(shader, output.removeprefix("outputs:"))

    def value_of(self, prim: UsdPrim, key: str, default: object) -> object:
        """The value of an input, its own, an interface's, or a texture's fallback."""
        shader, output = self.source(prim, key)
        if not output.startswith("outputs:"):
            value = shader.raw(output)
            return default if value is None else value
        if shader.word("info:id", "") == _TEXTURE and shader.has("inputs:fallback"):
            fallback, channel = shader.raw("inputs:fallback"), output.removeprefix("outputs:")
            if isinstance(fallback, list) and len(fallback) == 4 and channel in ("rgb", *"rgba"):
                return fallback[:3] if channel == "rgb" else fallback["rgba".index(channel)]
        value = prim.raw(key)
        return default if value is None else value

    def extremes(self, texture: UsdTexture) -> tuple[float, float]:
        """The least and the greatest texel of a channel of numbers."""
        if texture.image not in self._extremes:
            pixels = read_texture(self._data(texture.place), texture.image, "linear")
            self._extremes[texture.image] = pixels.min(axis=(0, 1)).tolist(), pixels.max(axis=(0, 1)).tolist()
        low, high = self._extremes[texture.image]
        k = "rgba".index(texture.single)
        return (low[k], high[k]) if k < 3 else (0.0, 1.0)

    def has_alpha(self, texture: UsdTexture) -> bool:
        """Whether a texture's image has alpha."""
        return has_alpha(self._data(texture.place), texture.image)

    def image(self, name: str, layer: int) -> str:
        """The name in parts of an image that a layer names. Raises LoadError where it cannot be shown."""
        if "<UDIM>" in name:
            raise LoadError(name, "tiles", "several images", "one image")
        place = self._layers.find(name, layer)
        if place is None:
            raise LoadError(name, "file", name or "nothing", "an image in the file's folder")
        return self._image_name(place)

    def data_of(self, image: str) -> bytes:
        """The bytes of an image by its name in parts. Raises LoadError."""
        return self._data(self._places[image])

    def _data(self, place: UsdPlace) -> bytes:
        return self._layers.read(place, MAX_IMAGE_BYTES)

    def _text(self, prim: UsdPrim, key: str) -> str:
        owner, name = self.source(prim, key)
        value = owner.raw(name)
        return value if isinstance(value, str) else ""

    def _texture(self, shader: UsdPrim, channel: str) -> UsdTexture | None:
        """The texture of a node; None, listed, where its image cannot be shown."""
        if channel not in ("rgb", "r", "g", "b", "a"):
            shader.not_shown("outputs:" + channel, "an output that a texture does not have")
            return None
        owner, key = self.source(shader, "inputs:file")
        try:
            image = self.image(*owner.asset(key))
        except LoadError as error:
            owner.not_shown(key, f"an image that is not shown: {error.reason}")
            shader.mark_read(*shader.values)
            return None
        place = self._places[image]
        wraps = tuple(self._wrap(shader, f"inputs:wrap{axis}") for axis in "ST")
        primvar, repeats, transform = self._layout(shader)
        space = _SPACES.get(shader.word("inputs:sourceColorSpace", "auto"))
        if space is None:
            shader.note("inputs:sourceColorSpace", shader.raw("inputs:sourceColorSpace"), "taken as auto")
        shader.mark_read("inputs:fallback")
        return UsdTexture(
            shader, image, place, primvar, channel, repeats, transform._replace(wrap=(wraps[0], wraps[1])), space or "",
            self._four(shader, "inputs:scale", 1.0), self._four(shader, "inputs:bias", 0.0),
        )  # fmt: skip

    def _four(self, shader: UsdPrim, key: str, default: float) -> RGBA:
        red, green, blue, alpha = shader.numbers(key, 4, (default,) * 4)
        return red, green, blue, alpha

    def _wrap(self, shader: UsdPrim, key: str) -> Wrap:
        """How an image continues beyond its edges; black is shown as the edge's colour."""
        word = shader.word(key, "useMetadata")
        if word not in _WRAPS:
            shader.not_shown(key, "beyond the image's edge its last colour goes on")
        return _WRAPS.get(word, "clamp")

    def _layout(self, shader: UsdPrim) -> tuple[str, tuple[float, float], TextureTransform]:
        """The primvar of a texture's coordinates, and how often and how moved the image lies in them: a UsdTransform2d
        scales, then rotates counter-clockwise, then moves, v upwards, as a `TextureTransform` does."""
        node, output = self.source(shader, "inputs:st")
        if not output.startswith("outputs:"):
            return "st", (1.0, 1.0), IDENTITY_TRANSFORM
        repeats, transform = (1.0, 1.0), IDENTITY_TRANSFORM
        if node.word("info:id", "") == _TRANSFORM:
            across, up = node.numbers("inputs:scale", 2, (1.0, 1.0))
            along_u, along_v = node.numbers("inputs:translation", 2, (0.0, 0.0))
            repeats = self._repeat(node, across), self._repeat(node, up)
            offset = tuple(node.clamped(o, "inputs:translation", -MAX_REPEATS, MAX_REPEATS) for o in (along_u, along_v))
            rotation = float(np.fmod(node.number("inputs:rotation", 0.0), 360.0))
            transform = TextureTransform(rotation, (offset[0], offset[1]))
            node, output = self.source(node, "inputs:in")
        kind = node.word("info:id", "") if output.startswith("outputs:") else ""
        if not kind.startswith(_READERS):
            shader.not_shown("inputs:st", "coordinates of a node that is not known: those of the primvar st count")
            return "st", repeats, transform
        return self._text(node, "inputs:varname") or "st", repeats, transform

    def _repeat(self, node: UsdPrim, number: float) -> float:
        size = float(np.copysign(min(max(abs(number), LEAST_REPEATS), MAX_REPEATS), number))
        if size != number:
            node.note("inputs:scale", number, f"taken as {size:g}")
        return size

    def _image_name(self, place: UsdPlace) -> str:
        """The name of an image that can be read. Raises LoadError."""
        if place not in self._images:
            data, name = self._data(place), place.inner or place.file.name
            size = image_size(data, name) if not data.startswith(b"\x76\x2f\x31\x01") else (1, 1)
            if size is None:
                raise LoadError(name, "format", describe_value(data[:8]), "PNG, JPEG, WebP, KTX 2 or OpenEXR")
            n_pixels = decoding_cost(*size)
            left = self._pixels_left + PIXELS_A_BYTE * len(data)
            if n_pixels > left:
                raise LoadError(name, "pixels of all images", n_pixels, f"at most {left} more in a file of this size")
            check_image(data, name)
            self._pixels_left = left - n_pixels
            self._images[place] = self._layers.image_name(place)
            self._places[self._images[place]] = place
        return self._images[place]
