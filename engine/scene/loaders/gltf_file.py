"""The lists of a GLB file that refer to each other, and the values of its accessors.

Counts, offsets and strides are checked against the binary chunk before anything is read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.scene.loaders.glb import JsonObject

FLOATS = (5126,)
SHARES = (5126, 5121, 5123)  # from 0 to 1: floats, or integers whose largest value is 1
ANY_SHARES = (5126, 5120, 5121, 5122, 5123)
INTEGERS = (5121, 5123, 5125)
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST_ZEROS = 1_000_000  # rows of a sparse accessor without a view, plus one for every byte of the file
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


@dataclass(frozen=True)
class GltfFile:
    """The lists of a file that refer to each other."""

    path: Path
    binary: bytes
    views: list[JsonObject]
    accessors: list[JsonObject]
    meshes: list[JsonObject]
    nodes: list[JsonObject]
    n_materials: int

    def read(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows (count, width) of the accessor that `owner` names under `key`."""
        accessor = self.accessors[owner.integer(key, 0, len(self.accessors) - 1)]
        if accessor.text("type") != kind:
            raise accessor.error("type", accessor.text("type") or "nothing", f"{kind} for {key}")
        component = accessor.integer("componentType", 5120, 5126)
        if component not in components:
            raise accessor.error("componentType", component, f"one of {', '.join(map(str, components))} for {key}")
        layout, width = np.dtype(_COMPONENTS[component]), _WIDTHS[kind]
        if not accessor.has("sparse"):
            return self._rows(accessor, layout, width)
        # A sparse accessor replaces some rows of the view, or of zeros [glTF20, 3.6.2.3].
        if accessor.has("bufferView"):
            rows = self._rows(accessor, layout, width).copy()
        else:
            rows = np.zeros((accessor.integer("count", 1, MOST_ZEROS + len(self.binary)), width), layout)
        sparse = accessor.child("sparse")
        n, where = sparse.integer("count", 0, len(rows)), sparse.child("indices")
        if n:
            index = np.dtype(_COMPONENTS[where.integer("componentType", 5121, 5125)])
            places = self._rows(where, index, 1, n)[:, 0].astype(np.int64)
            if places.min() < 0 or places.max() >= len(rows):
                raise where.error("indices", int(places.max()), f"indices from 0 to {len(rows) - 1}")
            rows[places] = self._rows(sparse.child("values"), layout, width, n)
        return rows

    def _rows(self, owner: JsonObject, layout: np.dtype, width: int, count: int | None = None) -> npt.NDArray:
        """Rows of a buffer view from an owner's byteOffset on; as many as the owner says, or count."""
        row = layout.itemsize * width
        view = self.views[owner.integer("bufferView", 0, len(self.views) - 1)]
        view.integer("buffer", 0, 0)
        start = view.integer("byteOffset", 0, len(self.binary), 0)
        length = view.integer("byteLength", 1, len(self.binary) - start)
        stride = view.integer("byteStride", max(4, row), 252) if view.has("byteStride") else row
        offset = owner.integer("byteOffset", 0, length, 0)
        most = max(0, length - offset - row) // stride + (1 if length - offset >= row else 0)
        if count is None:
            count = owner.integer("count", 1, most)
        elif count > most:
            raise owner.error("count", count, f"an integer from 1 to {most}")
        window = np.frombuffer(self.binary, np.uint8, (count - 1) * stride + row, start + offset)
        rows = np.lib.stride_tricks.as_strided(window, (count, row), (stride, 1))
        return np.ascontiguousarray(rows).view(layout)

    def read_shares(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows as floats, float64; integers are shares of their largest value [glTF20, 3.11]."""
        values = self.read(owner, key, kind, components)
        if values.dtype.kind == "f":
            return values.astype(np.float64)
        return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)
