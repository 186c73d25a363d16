"""The lists of a glTF file that refer to each other, and the values of its accessors.

An accessor's rows come from a buffer view, at its stride, from zeros, or from a compressed primitive
(`gltf_draco.decode_primitive`); a sparse accessor replaces some of them. Every count, offset and stride is checked
against the bytes that are there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.scene.loaders.gltf_buffers import GltfBuffers
from engine.scene.loaders.gltf_json import JsonObject

FLOATS = (5126,)
SHARES = (5126, 5121, 5123)  # from 0 to 1: floats, or integers whose largest value is 1
# Of KHR_mesh_quantization, and of outputs of animations. Files use them without declaring the extension.
QUANTIZED = (5126, 5120, 5121, 5122, 5123)
INTEGERS = (5121, 5123, 5125)
MOST_ZEROS = 1_000_000  # rows of an accessor without a view, plus one for every byte of the file
# Limit of the numbers that are read of all accessors, plus more for every byte: accessors may be shared, and small
# files must not cost much.
MOST_READ, READ_A_BYTE = 1 << 24, 16
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


@dataclass(frozen=True)
class GltfFile:
    """The lists of a file. decoded: the rows of accessors that compressed primitives have, by their number."""

    path: Path
    root: JsonObject
    buffers: GltfBuffers
    accessors: list[JsonObject]
    meshes: list[JsonObject]
    nodes: list[JsonObject]
    n_materials: int
    decoded: dict[int, npt.NDArray] = field(default_factory=dict)

    @staticmethod
    def of(root: JsonObject, buffers: GltfBuffers) -> GltfFile:
        """The lists of an opened file."""
        accessors, meshes, nodes = (root.children(key) for key in ("accessors", "meshes", "nodes"))
        return GltfFile(root.file, root, buffers, accessors, meshes, nodes, len(root.children("materials")))

    def read(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows (count, width) of the accessor that `owner` names under `key`, as they are stored."""
        number = owner.integer(key, 0, len(self.accessors) - 1)
        accessor = self.accessors[number]
        if accessor.text("type") != kind:
            raise accessor.error("type", accessor.text("type") or "nothing", f"{kind} for {key}")
        component = accessor.integer("componentType", 5120, 5126)
        if component not in components:
            raise accessor.error("componentType", component, f"one of {', '.join(map(str, components))} for {key}")
        accessor.flag("normalized")
        most = MOST_READ + READ_A_BYTE * self.buffers.n_bytes
        if self.buffers.n_read > most:
            raise accessor.error("numbers of all accessors", self.buffers.n_read, f"at most {most}")
        layout, width = np.dtype(_COMPONENTS[component]), _WIDTHS[kind]
        if number in self.decoded:
            rows = self._decoded(accessor, self.decoded[number], layout, width)
        elif accessor.has("bufferView"):
            rows = self._rows(accessor, layout, width)
        else:
            rows = np.zeros((accessor.integer("count", 1, MOST_ZEROS + self.buffers.n_bytes), width), layout)
        self.buffers.n_read += rows.size
        if number in self.decoded or not accessor.has("sparse"):
            return rows
        # A sparse accessor replaces some rows of the view, or of zeros [glTF20, 3.6.2.3].
        rows = rows.copy()
        sparse = accessor.child("sparse")
        n, where = sparse.integer("count", 0, len(rows)), sparse.child("indices")
        if n:
            component = where.integer("componentType", 5121, 5125)
            if component not in INTEGERS:
                raise where.error("componentType", component, f"one of {', '.join(map(str, INTEGERS))}")
            places = self._rows(where, np.dtype(_COMPONENTS[component]), 1, n)[:, 0].astype(np.int64)
            if places.max() >= len(rows):
                raise where.error("indices", int(places.max()), f"indices from 0 to {len(rows) - 1}")
            rows[places] = self._rows(sparse.child("values"), layout, width, n)
        return rows

    def is_decoded(self, owner: JsonObject, key: str) -> bool:
        """Whether a compressed primitive has the rows of an accessor."""
        return owner.integer(key, 0, len(self.accessors) - 1) in self.decoded

    def _decoded(self, accessor: JsonObject, rows: npt.NDArray, layout: np.dtype, width: int) -> npt.NDArray:
        """Rows of a compressed primitive in the type of their accessor, whose view is for programs without it."""
        accessor.mark_read("count", "bufferView", "byteOffset")
        if rows.shape[1] != width:
            raise accessor.error("type", f"{rows.shape[1]} compressed components", f"{width}")
        return rows.astype(layout)

    def _rows(self, owner: JsonObject, layout: np.dtype, width: int, count: int | None = None) -> npt.NDArray:
        """Rows of a buffer view from an owner's byteOffset on; as many as the owner says, or count."""
        row = layout.itemsize * width
        view, content = self.buffers.view(owner)
        stride = view.integer("byteStride", max(4, row), 252) if view.has("byteStride") else row
        offset = owner.integer("byteOffset", 0, len(content), 0)
        left = len(content) - offset
        most = max(0, left - row) // stride + (1 if left >= row else 0)
        if count is None:
            count = owner.integer("count", 1, most)
        elif count > most:
            raise owner.error("count", count, f"an integer from 1 to {most}")
        window = content[offset : offset + (count - 1) * stride + row]
        rows = np.lib.stride_tricks.as_strided(window, (count, row), (stride, 1))
        return np.ascontiguousarray(rows).view(layout)

    def read_floats(self, owner: JsonObject, key: str, kind: str) -> npt.NDArray[np.float64]:
        """Rows as float64: integers are shares of their largest value if the accessor is normalized, else they are as
        they are [KHR_mesh_quantization]."""
        values = self.read(owner, key, kind, QUANTIZED)
        accessor = self.accessors[owner.integer(key, 0, len(self.accessors) - 1)]
        return _shares(values) if accessor.flag("normalized") else values.astype(np.float64)

    def read_shares(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows as float64 where integers are always shares of their largest value [glTF20, 3.11]."""
        return _shares(self.read(owner, key, kind, components))


def _shares(values: npt.NDArray) -> npt.NDArray[np.float64]:
    """Integers as shares of their largest value, from −1 to 1; floats as they are."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)
