"""Fields as maps of layers: the file itself where a field is one image, else texels that are computed when the texture
store asks for them.

The texels of a computed map lie as those of its images do. Where all of these have one affine mapping, the map has it
as its own, and each texel is computed from texels without resampling (of small images every third, see `_size`); else,
and where there are patterns, it covers the unit square of texture coordinates, at a resolution for the image that
repeats most, at least `PATTERN_SIDE` squared for patterns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import MAX_REPEATS, Channel, ChannelImage, LayerMaps, TextureTransform, Wrap
from engine.scene.loaders.graph_fields import AddressMode, Array, Field, Samples, affine_map, texels_of_unit_square
from engine.scene.loaders.graph_nodes import MOST_TEXELS
from engine.scene.loaders.pbr_layers import NumberImage

_BAND = 1 << 16  # samples at a time
_LEAST_REPEAT = 1e-3
_WRAPS: dict[AddressMode, Wrap] = {"periodic": "repeat", "mirror": "mirror", "clamp": "clamp", "constant": "clamp"}
_BRIGHTEST = 1e4
_SMALL, _FINER = 256, 3  # the texels of a side up to which images have finer maps, and how many times


@dataclass(frozen=True)
class Placement:
    """How a map lies on texture coordinates, see `engine.material.layer_maps.TextureTransform`."""

    repeats: tuple[float, float] = (1.0, 1.0)
    transform: TextureTransform = TextureTransform()

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The linear part of the mapping, (2, 2)."""
        cosine, sine = self.transform.turn
        return np.array([[cosine, -sine], [sine, cosine]]) * np.array(self.repeats)


@dataclass(frozen=True, eq=False)
class BakedMap:
    """A field as an image of (width, height) texels."""

    field: Field
    size: tuple[int, int]
    placement: Placement

    def texels(self) -> Array:
        """The texels (H, W, 3), row 0 on top."""
        width, height = self.size
        inverse = np.linalg.inv(self.placement.matrix)
        offset = np.array(self.placement.transform.offset)
        columns = (np.arange(width) + 0.5) / width
        n_rows = max(_BAND // width, 1)
        found = np.empty((height, width, 3), np.float32)
        for top in range(0, height, n_rows):
            rows = 1.0 - (np.arange(top, min(top + n_rows, height)) + 0.5) / height
            grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
            values = self.field.at(Samples(((grid - offset) @ inverse.T).astype(np.float32)))
            found[top : top + len(rows)] = np.broadcast_to(values[:, :3], (len(grid), 3)).reshape(len(rows), width, 3)
        return np.clip(found, 0.0, _BRIGHTEST)

    def exr(self) -> bytes:
        """The texels as an OpenEXR file."""
        from engine.render.display import exr_bytes

        return exr_bytes(self.texels())


@dataclass
class MapMaker:
    """Makes maps of fields. maps: those that are computed; layers name them "#N", from the number `first` on, with a
    mark behind it that says of which variants of the file."""

    first: int = 0
    mark: str = ""
    maps: list[BakedMap] = field(default_factory=list)
    _made: dict[tuple[int, bool], tuple[str, Placement]] = field(default_factory=dict)

    def colours(self, colours: Field) -> LayerMaps:
        """A texture of colours."""
        plain, image = colours.plain, LayerMaps()
        if plain is not None and not plain.channel and (placement := _placement(colours)) is not None:
            image = LayerMaps(plain.file, plain.space)
        else:
            name, placement = self._computed(colours)
            image = LayerMaps(name, "linear")
        own = placement.transform
        return replace(
            image, texture_scale=placement.repeats, texture_offset=own.offset, texture_rotation=own.rotation,
            texture_wrap=own.wrap,
        )  # fmt: skip

    def numbers(self, numbers: Field) -> NumberImage:
        """The map of a number: the keys of a parameter's map."""
        file, channel, placement = self._channel(numbers)
        own = placement.transform
        return NumberImage(
            {"map": file, "channel": channel, "repeats": placement.repeats, "offset": own.offset,
             "rotation": own.rotation, "wrap": own.wrap}
        )  # fmt: skip

    def share(self, numbers: Field) -> ChannelImage:
        """The map of a share."""
        file, channel, placement = self._channel(numbers)
        return ChannelImage(file, channel, placement.repeats, placement.transform)

    def normals(self, colours: Field) -> tuple[str, Placement]:
        """The file of a normal map and its place; without a rotation, which relief cannot have."""
        plain, own = colours.plain, _placement(colours)
        if plain is not None and not plain.channel and own is not None and own.transform.rotation == 0.0:
            return plain.file, own
        is_turned = own is not None and own.transform.rotation != 0.0
        return self._computed(colours, in_unit_square=is_turned)

    def opacity(self, numbers: Field) -> tuple[str, Placement]:
        """The file of an opacity, which is its brightness, and its place."""
        return self._computed(numbers)

    def _channel(self, numbers: Field) -> tuple[str, Channel, Placement]:
        plain = numbers.plain
        if plain is not None and plain.channel and (placement := _placement(numbers)) is not None:
            return plain.file, plain.channel, placement
        name, placement = self._computed(numbers)
        return name, "r", placement

    def _computed(self, values: Field, in_unit_square: bool = False) -> tuple[str, Placement]:
        """The name of a computed map and its place; one for each field."""
        key = id(values), in_unit_square
        if key not in self._made:
            own = None if in_unit_square else _placement(values)
            placement = own or Placement(transform=TextureTransform(wrap=_wrap_of_unit_square(values)))
            size = _size(values, own is None)
            if in_unit_square:
                placement = Placement()
            self.maps.append(BakedMap(values, size, placement))
            self._made[key] = f"#{self.first + len(self.maps) - 1}{self.mark}", placement
        return self._made[key]


def _placement(values: Field) -> Placement | None:
    """The mapping that all images of a field have; None where they differ, where none of a layer is the same, or where
    it has patterns besides."""
    if values.is_pattern:
        return None
    maps = [affine_map(use.coordinates) for use in values.images]
    if not maps or maps[0] is None:
        return None
    matrix, offset = maps[0]
    for other in maps[1:]:
        if other is None or not (np.allclose(other[0], matrix) and np.allclose(other[1], offset)):
            return None
    if len({use.modes for use in values.images}) > 1:
        return None
    (a, b), (c, d) = matrix
    across, angle = math.hypot(a, c), math.atan2(c, a)
    up = float(d * math.cos(angle) - b * math.sin(angle))
    if abs(a * b + c * d) > 1e-6 * across * math.hypot(b, d):
        return None
    if (
        not all(_LEAST_REPEAT <= abs(each) <= MAX_REPEATS for each in (across, up))
        or np.abs(offset).max() > MAX_REPEATS
    ):
        return None
    first, second = (_WRAPS[mode] for mode in values.images[0].modes)
    right, above = (_whole_part_removed(o, wrap) for o, wrap in zip(offset.tolist(), (first, second), strict=True))
    degrees = round(math.degrees(angle), 5)
    return Placement(
        (round(across, 6), round(up, 6)), TextureTransform(degrees or 0.0, (right, above), (first, second))
    )


def _whole_part_removed(offset: float, wrap: Wrap) -> float:
    """An offset without whole images, which have no effect where they repeat."""
    shift = offset - round(offset) if wrap == "repeat" else offset
    return 0.0 if abs(shift) < 1e-6 else round(shift, 6)


def _size(values: Field, in_unit_square: bool) -> tuple[int, int]:
    """The texels of a map (width, height): as many as those of its largest image, in the unit square times its
    repeats; three times as many along each side of a small image, of which every third is one of the image's: between
    texels, what is computed of interpolated values is not what is interpolated of computed ones."""
    if in_unit_square:
        width, height = texels_of_unit_square(values)
    else:
        width, height = (max(use.size[k] for use in values.images) for k in (0, 1))
        if max(width, height) <= _SMALL:
            width, height = width * _FINER, height * _FINER
    while width * height > MOST_TEXELS:
        width, height = max(width // 2, 1), max(height // 2, 1)
    return width, height


def _wrap_of_unit_square(values: Field) -> tuple[Wrap, Wrap]:
    """Whether values repeat beyond the unit square along u and v, at a few places; else they continue its edge."""
    places = np.array([[0.13, 0.71], [0.58, 0.22], [0.87, 0.93]], np.float32)
    found: list[Wrap] = []
    for step in ((1.0, 0.0), (0.0, 1.0)):
        there = values.at(Samples(places + np.array(step, np.float32)))
        found.append("repeat" if np.allclose(there, values.at(Samples(places)), atol=1e-3) else "clamp")
    return found[0], found[1]
