"""Reads RGL's tensor files, `.bsdf`: reflection in the adaptive parameterization [Dupuy18].

A file starts with "tensor_file" and a zero byte, the version 1.0 and the number of fields; for each field follow the
length of its name, the name, the number of dimensions, type, offset and sizes; the arrays are at their offsets, all
little-endian. Of the fields we read

    phi_i (P,), theta_i (T,)        azimuths and angles of wi; one or two azimuths: the surface is isotropic
    ndf (., .), sigma (., .)        density of microfacets over wm, and their projected area over wi
    vndf (P, T, ., .)               density of visible microfacets over wm, for each wi
    rgb (P, T, 3, n, n)             reflection, linear Rec. 709; or spectra (P, T, W, n, n) at wavelengths (W,), nm
    jacobian (1,)                   whether reflection is to be multiplied by ndf / (4 sigma)

`engine.measured.adaptive` says what they mean. Spectra become linear Rec. 709 as in Cornell's files; reflection is
linear in them, so nothing is lost by doing so once. Sizes are compared with the file's length before anything is made.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.measured.adaptive import AdaptiveReflection
from engine.measured.sample_files import LARGEST, MAX_WAVELENGTHS, require_visible_range, rgb_weights

Float32Array = NDArray[np.float32]

TENSOR_SUFFIX = ".bsdf"
MAX_TENSOR_BYTES = 512 * 2**20
MAGIC = b"tensor_file\0\x01\x00"
MAX_FIELDS = 64
MAX_DIMENSIONS = 8
# Most values of the densities, and of the colours: RGL's largest have a third.
MAX_VALUES = 24 * 2**20
_DTYPES = ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")  # types 1 to 11
_COUNTED = struct.Struct("<H")
_TYPED = struct.Struct("<HBQ")


def read_tensor_file(path: Path) -> bytes:
    """The bytes of a file. Raises LoadError."""
    return read_regular_file(path, MAX_TENSOR_BYTES)


def tensor_fields(data: bytes, path: Path) -> dict[str, NDArray[np.generic]]:
    """The arrays of a file by name, views of its bytes. Raises LoadError."""
    if data[: len(MAGIC)] != MAGIC:
        raise LoadError(path, "first bytes", data[: len(MAGIC)].hex(" "), "those of a tensor file, version 1.0")
    header = _Header(data, path)
    (count,) = header.take(struct.Struct("<I"))
    if count > MAX_FIELDS:
        raise LoadError(path, "number of fields", count, f"at most {MAX_FIELDS}")
    fields: dict[str, NDArray[np.generic]] = {}
    for _ in range(count):
        name = header.text(*header.take(_COUNTED))
        n_dimensions, kind, offset = header.take(_TYPED)
        if n_dimensions > MAX_DIMENSIONS or not 1 <= kind <= len(_DTYPES):
            found = f"{n_dimensions} dimensions of type {kind}"
            raise LoadError(path, f"field {name}", found, f"at most {MAX_DIMENSIONS}, of a type from 1 to 11")
        shape = header.take(struct.Struct(f"<{n_dimensions}Q"))
        dtype, size = np.dtype(_DTYPES[kind - 1]), math.prod(shape)
        if size == 0 or offset + size * dtype.itemsize > len(data):
            found = f"{_sizes(shape)} of {dtype.itemsize} bytes at {offset}"
            raise LoadError(path, f"field {name}", found, f"an array within the file's {len(data)} bytes")
        fields[name] = np.frombuffer(data, dtype, size, offset).reshape(shape)
    return fields


class _Header:
    """Takes numbers and text from the start of a file, one after the other."""

    def __init__(self, data: bytes, path: Path) -> None:
        self._data, self._path, self._at = data, path, len(MAGIC)

    def take(self, layout: struct.Struct) -> tuple[int, ...]:
        self._require(layout.size)
        self._at += layout.size
        return layout.unpack_from(self._data, self._at - layout.size)

    def text(self, length: int) -> str:
        self._require(length)
        self._at += length
        return self._data[self._at - length : self._at].decode("utf-8", "replace")

    def _require(self, n_bytes: int) -> None:
        if self._at + n_bytes > len(self._data):
            raise LoadError(self._path, "size", f"{len(self._data)} bytes", "a whole header")


def adaptive_reflection(data: bytes, path: Path) -> AdaptiveReflection:
    """Reflection of the bytes from `read_tensor_file`. Raises LoadError."""
    fields = _Fields(tensor_fields(data, path), path)
    theta, phi = fields.ascending("theta_i"), fields.ascending("phi_i")
    if len(theta) < 2:
        raise LoadError(path, "number of theta_i", len(theta), "2 at least")
    if len(phi) > 2 and not 1.4 < phi[-1] - phi[0] < 7.0:
        raise LoadError(path, "phi_i", f"{phi[0]:g} to {phi[-1]:g}", "a quarter of the circle at least, in radians")
    slices = len(phi), len(theta)
    ndf, sigma = fields.density("ndf"), fields.density("sigma")
    vndf = fields.density("vndf", *slices)
    empty = np.argwhere(vndf.mean(axis=(2, 3)) <= 0.0)
    if len(empty):
        raise LoadError(path, f"vndf at phi_i {empty[0, 0]}, theta_i {empty[0, 1]}", "all 0", "some positive values")
    jacobian = fields.of("jacobian", "u1", (1,))
    colours = _colours(fields, slices)
    return AdaptiveReflection(phi, theta, ndf, sigma, vndf, colours, bool(jacobian[0]))


def _colours(fields: _Fields, slices: tuple[int, int]) -> Float32Array:
    """Reflection (P, T, n, n, 3), linear Rec. 709."""
    if "rgb" in fields.there:
        weights = np.eye(3)
        values = fields.of("rgb", "<f4", (*slices, 3, None, None))
    else:
        wavelengths = fields.ascending("wavelengths").astype(float)
        if not 3 <= len(wavelengths) <= MAX_WAVELENGTHS:
            raise LoadError(fields.path, "number of wavelengths", len(wavelengths), f"3 to {MAX_WAVELENGTHS}")
        require_visible_range(wavelengths, fields.path)
        weights = rgb_weights(wavelengths)
        values = fields.of("spectra", "<f4", (*slices, len(wavelengths), None, None))
    rows, columns = values.shape[3:]
    fields.require_size("colours", 3 * rows * columns * slices[0] * slices[1])
    colours = np.empty((*slices, rows, columns, 3), np.float32)
    for place in np.ndindex(*slices):
        if not (np.abs(values[place]) <= LARGEST).all():
            where = f"reflection at phi_i {place[0]}, theta_i {place[1]}"
            raise LoadError(fields.path, where, "not all finite", f"finite numbers of at most {LARGEST:g}")
        colours[place] = np.einsum("wyx,wc->yxc", values[place].astype(float), weights)
    return colours


@dataclass(frozen=True)
class _Fields:
    """Fields of a file, with what is expected of them."""

    there: dict[str, NDArray[np.generic]]
    path: Path

    def of(self, name: str, dtype: str, shape: tuple[int | None, ...]) -> NDArray[np.generic]:
        """A field of that type and shape; None: any size of 2 or more."""
        if name not in self.there:
            named = ", ".join(self.there) or "no fields"
            raise LoadError(self.path, "fields", named, f"a measured BRDF, with {name}")
        found = self.there[name]
        fits = found.ndim == len(shape) and all(
            n >= 2 if wanted is None else n == wanted for n, wanted in zip(found.shape, shape, strict=True)
        )
        if not fits or found.dtype != np.dtype(dtype):
            wanted = f"{_sizes(tuple('N' if n is None else n for n in shape))} of {np.dtype(dtype).name}"
            raise LoadError(self.path, f"field {name}", f"{_sizes(found.shape)} of {found.dtype.name}", wanted)
        return found

    def ascending(self, name: str) -> Float32Array:
        """A field of one dimension (N,) whose values ascend."""
        values = self.of(name, "<f4", (self.there[name].size if name in self.there else 0,)).astype(np.float32)
        if not (np.abs(values) <= LARGEST).all() or not (np.diff(values) > 0.0).all():
            raise LoadError(self.path, f"field {name}", "values that do not ascend", "finite, ascending ones")
        return values

    def density(self, name: str, *slices: int) -> Float32Array:
        """A field (*slices, rows, columns) of values that are not negative."""
        values = self.of(name, "<f4", (*slices, None, None)).astype(np.float32)
        self.require_size(name, values.size)
        good = (values >= 0.0) & (values <= LARGEST)  # false for NaN
        if not good.all():
            raise LoadError(self.path, f"field {name}", float(values[~good][0]), f"numbers from 0 to {LARGEST:g}")
        return values

    def require_size(self, name: str, n_values: int) -> None:
        if n_values > MAX_VALUES:
            raise LoadError(self.path, f"field {name}", f"{n_values} values", f"at most {MAX_VALUES}")


def _sizes(shape: tuple[int | str, ...]) -> str:
    return " x ".join(str(n) for n in shape) or "a single value"
