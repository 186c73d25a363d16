"""Values that vary over a surface, as functions of texture coordinates: what a network of shading nodes computes.

A `Field` is evaluated at any texture coordinates. One that depends on nothing is constant. Images are looked up by
bilinear interpolation, which at the centres of texels gives these exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
AddressMode = Literal["periodic", "clamp", "mirror", "constant"]
PATTERN_SIDE = 1024  # texels of a pattern without images along each side of the unit square


@dataclass(eq=False)
class Samples:
    """Texture coordinates (N, 2), u to the right and v upwards, and the values of fields there that were evaluated."""

    uv: Array
    known: dict[int, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ImageUse:
    """An image in a field: its size, what continues it beyond its edges, and the coordinates at which it is read."""

    size: tuple[int, int]
    modes: tuple[AddressMode, AddressMode]
    coordinates: Field


class PlainImage(NamedTuple):
    """An image as it is in its file: the file, its colour space in layers, and its channel, "" for its colours."""

    file: str
    space: Literal["srgb", "linear"] = "linear"
    channel: Literal["", "r", "g", "b"] = ""


@dataclass(frozen=True, eq=False)
class Field:
    """compute: the values (N, C) at samples, or (1, C) where they are the same; images: those that it reads;
    is_constant: whether it depends on nothing; is_pattern: whether it depends on texture coordinates in another way
    than by images; plain: the image that it is, if it is nothing but that; scaled: numbers (C,) and the field that it
    is their product with."""

    compute: Callable[[Samples], Array]
    is_constant: bool = False
    images: tuple[ImageUse, ...] = ()
    is_pattern: bool = False
    plain: PlainImage | None = None
    scaled: tuple[Array, Field] | None = None

    @property
    def parts(self) -> tuple[NDArray[np.float64], Field | None]:
        """The numbers (C,) and the field, None for a constant one, that it is the product of."""
        if self.is_constant:
            return self.value.astype(np.float64), None
        number, varying = self.scaled or (np.ones(1), self)
        return number.astype(np.float64), varying

    def at(self, samples: Samples) -> Array:
        """The values (N, C) or (1, C) at samples, evaluated once for each."""
        found = samples.known.get(id(self))
        if found is None:
            found = samples.known[id(self)] = self.compute(samples)
        return found

    @property
    def value(self) -> Array:
        """The value (C,) of a constant field."""
        return self.at(Samples(np.zeros((1, 2), np.float32)))[0]


def constant(*numbers: float) -> Field:
    """The same numbers everywhere."""
    values = np.array([numbers], np.float32)
    return Field(lambda _: values, is_constant=True)


COORDINATES = Field(lambda samples: samples.uv, is_pattern=True)


def combine(compute: Callable[..., Array], *fields: Field) -> Field:
    """A function of the values of fields: arrays (N, C) to one."""
    images = tuple(dict.fromkeys(use for each in fields for use in each.images))

    def evaluate(samples: Samples) -> Array:
        values = [each.at(samples) for each in fields]
        n = max(map(len, values))
        with np.errstate(all="ignore"):
            found = np.asarray(compute(*(np.broadcast_to(each, (n, each.shape[1])) for each in values)), np.float32)
        return np.nan_to_num(found, nan=0.0, posinf=1e30, neginf=-1e30)

    if all(each.is_constant for each in fields):
        values = evaluate(Samples(np.zeros((1, 2), np.float32)))
        return Field(lambda _: values, is_constant=True)
    return Field(evaluate, images=images, is_pattern=any(each.is_pattern for each in fields))


def image_field(use: ImageUse, texels: Callable[[], Array], default: Array, plain: PlainImage | None = None) -> Field:
    """An image at coordinates. texels: returns it, (H, W, C), row 0 on top; default: the value (C,) beyond edges of the
    mode "constant"."""

    def evaluate(samples: Samples) -> Array:
        return _bilinear(texels(), use.coordinates.at(samples), use.modes, default)

    return Field(evaluate, images=(*use.coordinates.images, use), plain=plain)


def _bilinear(texels: Array, uv: Array, modes: tuple[AddressMode, AddressMode], default: Array) -> Array:
    height, width = texels.shape[:2]
    x, y = uv[:, 0].astype(np.float64) * width - 0.5, (1.0 - uv[:, 1].astype(np.float64)) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    across, down = (x - left).astype(np.float32)[:, None], (y - top).astype(np.float32)[:, None]
    columns = [_texel(left + step, width, modes[0]) for step in (0.0, 1.0)]
    rows = [_texel(top + step, height, modes[1]) for step in (0.0, 1.0)]
    upper = texels[rows[0], columns[0]] * (1.0 - across) + texels[rows[0], columns[1]] * across
    lower = texels[rows[1], columns[0]] * (1.0 - across) + texels[rows[1], columns[1]] * across
    found = upper * (1.0 - down) + lower * down
    is_outside = np.zeros(len(uv), bool)
    for k in (0, 1):
        if modes[k] == "constant":
            is_outside |= (uv[:, k] < 0.0) | (uv[:, k] > 1.0)
    return np.where(is_outside[:, None], default, found) if is_outside.any() else found


def _texel(index: NDArray[np.float64], n: int, mode: AddressMode) -> NDArray[np.int64]:
    """Indices of texels within an image of n, from indices beyond it."""
    whole = np.nan_to_num(index, nan=0.0, posinf=0.0, neginf=0.0)
    if mode == "periodic":
        return np.mod(whole, n).astype(np.int64)
    if mode == "mirror":
        folded = np.mod(whole, 2 * n)
        return np.where(folded < n, folded, 2 * n - 1 - folded).astype(np.int64)
    return np.clip(whole, 0, n - 1).astype(np.int64)


def affine_map(coordinates: Field) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The matrix (2, 2) and offset (2,) by which coordinates follow from texture coordinates; None where they do so in
    another way, or not invertibly."""
    probes = np.array([[0, 0], [1, 0], [0, 1], [0.37, 0.83], [2.3, -1.6], [-0.9, 4.2]], np.float32)
    found = np.broadcast_to(coordinates.at(Samples(probes))[:, :2], (len(probes), 2)).astype(np.float64)
    offset = found[0]
    matrix = (found[1:3] - offset).T
    error = np.abs(probes @ matrix.T + offset - found).max()
    if error > 1e-4 * max(1.0, float(np.abs(found).max())) or abs(np.linalg.det(matrix)) < 1e-9:
        return None
    return matrix, offset


def texels_of_unit_square(values: Field) -> tuple[int, int]:
    """The texels along u and v that the unit square of texture coordinates has in the finest image of a field, or those
    that a pattern gets."""
    width, height = (PATTERN_SIDE,) * 2 if values.is_pattern or not values.images else (1, 1)
    for use in values.images:
        across, up = 1.0, 1.0
        if (mapping := affine_map(use.coordinates)) is not None:
            across, up = (max(float(np.linalg.norm(mapping[0][:, k])), 1.0) for k in (0, 1))
        width, height = max(width, round(use.size[0] * across)), max(height, round(use.size[1] * up))
    return width, height
