"""Typed access to the tree of a USD stage, which records what is read of each prim.

The tree comes from a process that the file may have corrupted: all of it is checked here. A prim's properties are a
`JsonObject` of glTF's reader, so that whoever asks for a property has read it; what nobody asks for is listed as not
shown (`usd_unshown`), by the prim's schema and the property's name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value
from engine.core.native_decoders import Arrays
from engine.scene.loaders.gltf_json import JsonObject, ReadLog

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]

MAX_DEPTH = 256
_CENTIMETRE = 0.01


@dataclass(frozen=True)
class UsdPrim(JsonObject):
    """A prim: its properties by name, its path as the place, its schema; meta: of properties; own: what the tree says
    of the prim beside its properties; children: their numbers in the scene."""

    kind: str = ""
    meta: Mapping[str, Any] = field(default_factory=dict)
    own: Mapping[str, Any] = field(default_factory=dict)
    arrays: Arrays = field(default_factory=dict)
    children_numbers: tuple[int, ...] = ()

    def not_shown(self, key: str, effect: str, count: int = 1) -> None:
        """List a property that the picture does not show, or in part, by the name of its schema."""
        self.mark_read(key)
        name = f"{self.kind or 'Prim'}.{key}", effect
        self.log.unshown[name] = self.log.unshown.get(name, 0) + count

    @property
    def name(self) -> str:
        """The last part of its path."""
        return self.place.rpartition("/")[2]

    @property
    def is_off(self) -> bool:
        """Whether the stage has it only for others: a class, or what is inactive or only refined."""
        return self.own.get("off") in ("inactive", "abstract", "over")

    @property
    def material(self) -> str:
        """The path of the material that is bound to it, "" for none."""
        value = self.own.get("material", "")
        return value if isinstance(value, str) else ""

    def word(self, key: str, default: str) -> str:
        """A token; default where it has no value."""
        value = self.raw(key)
        if value is None:
            return default
        if not isinstance(value, str):
            raise self.error(key, value, "a token")
        return value

    def input(self, name: str) -> str:
        """The key of an input of a light; files before USD 21 have no `inputs:`."""
        return name if self.has(name) else f"inputs:{name}"

    def paths(self, key: str) -> list[str]:
        """The targets of a relationship."""
        value = self.raw(key)
        paths = value.get("paths") if isinstance(value, dict) else []
        if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
            raise self.error(key, value, "a relationship")
        return paths

    def asset(self, key: str) -> tuple[str, int]:
        """The path of a file, and the number of the layer that names it; "" where it has none."""
        value = self.raw(key)
        if not isinstance(value, dict):
            return "", 0
        path, layer = value.get("asset"), value.get("layer")
        if not isinstance(path, str) or not isinstance(layer, int) or layer < 0:
            raise self.error(key, value, "the path of a file")
        return path, layer

    def array(self, key: str, width: int = 1) -> Float64Array | None:
        """The rows (N, width), of one number (N,), of an array; None where it has no value."""
        value = self.raw(key)
        if value is None:
            return None
        return self._stored(key, value.get("array") if isinstance(value, dict) else None, width)

    def integers(self, key: str) -> Int64Array | None:
        """The integers of an array."""
        found = self.array(key)
        if found is not None and not (np.abs(found) <= 1e15).all():
            raise self.error(key, "numbers that are not whole", "integers")
        return None if found is None else found.astype(np.int64)

    def stored(self, key: str, width: int = 1) -> Float64Array | None:
        """An array that the tree has beside the properties; None where there is none."""
        name = self.own.get(key)
        return None if name is None else self._stored(key, name, width)

    def inner(self, key: str) -> UsdPrim:
        """The prim with what the tree has of it under a key, in place of the rest. Raises LoadError."""
        own = self.own.get(key)
        if not isinstance(own, dict):
            raise self.error(key, own, "a table")
        return replace(self, own=own)

    def _stored(self, key: str, name: object, width: int) -> Float64Array:
        rows = self.arrays.get(name) if isinstance(name, str) else None
        if rows is None or rows.dtype.kind not in "fiub":
            raise self.error(key, "no numbers", "an array")
        if rows.size % width:
            raise self.error(key, f"{rows.size} numbers", f"rows of {width}")
        found = np.asarray(rows, np.float64)
        return found.reshape(-1) if width == 1 else found.reshape(-1, width)

    def about(self, key: str, what: str, default: str = "") -> str:
        """A text that the tree has on a property, such as its interpolation."""
        meta = self.meta.get(key)
        value = meta.get(what, default) if isinstance(meta, dict) else default
        return value if isinstance(value, str) else default

    def source(self, key: str) -> str:
        """The path of the property that this one is connected to, "" for none."""
        meta = self.meta.get(key)
        found = meta.get("from") if isinstance(meta, dict) else None
        return found[0] if isinstance(found, list) and found and isinstance(found[0], str) else ""

    def triple(self, key: str) -> Float64Array:
        """Three numbers (3,) that the tree has beside the properties."""
        value = self.own.get(key)
        if not isinstance(value, list) or len(value) != 3 or not np.isfinite(value).all():
            raise self.error(key, value, "3 finite numbers")
        return np.array(value, np.float64)

    @cached_property
    def matrix(self) -> Float64Array:
        """The transform to its parent (4, 4)."""
        return self.affine(self.own.get("matrix", np.eye(4).ravel().tolist()))

    def affine_all(self, matrices: Float64Array) -> Float64Array:
        """Check that matrices (N, 4, 4) are affine transforms of a usable size."""
        for entries in matrices if not (np.abs(matrices) <= 1e9).all() else matrices[:1]:
            self.affine(entries)
        return matrices

    def affine(self, entries: object) -> Float64Array:
        """Check that 16 entries are an affine transform of a usable size; returns it as (4, 4)."""
        try:
            matrix = np.array(entries, np.float64).reshape(4, 4)
        except (TypeError, ValueError):
            raise self.error("transform", entries, "16 numbers") from None
        if not (np.abs(matrix) <= 1e9).all() or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
            raise self.error("transform", matrix.ravel().tolist(), "an affine matrix with entries up to 1e+09")
        return matrix


@dataclass(frozen=True)
class UsdScene:
    """All prims of a stage, parents before their children, and what is common to them: up, the axis; metres, of one
    unit; start, in time codes, and seconds of one."""

    file: Path
    prims: tuple[UsdPrim, ...]
    log: ReadLog
    by_path: Mapping[str, UsdPrim]
    up: str
    metres: float
    start: float
    seconds: float

    def children(self, prim: UsdPrim) -> list[UsdPrim]:
        """The prims below one."""
        return [self.prims[k] for k in prim.children_numbers]

    def owner(self, prim: UsdPrim, key: str) -> UsdPrim | None:
        """The prim itself or the nearest one above that has a property; None where none has."""
        while not prim.has(key):
            above = prim.own["parent"]
            if above < 0:
                return None
            prim = self.prims[above]
        return prim

    def connected(self, prim: UsdPrim, key: str) -> tuple[UsdPrim, str] | None:
        """The prim and the property that a property takes its value from; None where it has its own."""
        path, _, name = prim.source(key).rpartition(".")
        found = self.by_path.get(path)
        return (found, name) if found is not None and name else None


def scene_of_tree(file: Path, tree: Any, arrays: Arrays) -> UsdScene:
    """The scene of a decoder's tree; raises LoadError where it is none."""
    log = ReadLog()
    try:
        rows = [(dict(row["values"]), dict(row["meta"]), str(row["path"]), str(row["kind"]), int(row["parent"]), row)
                for row in tree["prims"]]  # fmt: skip
        up, metres, start, seconds = str(tree["up"]), *(float(tree[key]) for key in ("metres", "start", "seconds"))
        below: list[list[int]] = [[] for _ in rows]
        for k, (*_, parent, _) in enumerate(rows):
            if not -1 <= parent < k:
                raise ValueError(parent)
            if parent >= 0:
                below[parent].append(k)
    except (KeyError, TypeError, ValueError, IndexError):
        raise LoadError(file, "USD", "makes the decoder answer nonsense", "a sound USD file") from None
    prims = tuple(
        UsdPrim(values, path, file, log, kind, meta, own, arrays, tuple(below[k]))
        for k, (values, meta, path, kind, _, own) in enumerate(rows)
    )
    if up not in ("Y", "Z"):
        log.notes[f"upAxis = {describe_value(up)}, taken as Y"] = None
        up = "Y"
    if not 1e-9 <= metres <= 1e9:
        log.notes[f"metersPerUnit = {metres:g}, taken as {_CENTIMETRE:g}, as without one"] = None
        metres = _CENTIMETRE
    return UsdScene(file, prims, log, {prim.place: prim for prim in prims}, up, metres, start, seconds)
