"""Checkpoints of indirect light, so that an interrupted computation resumes where it stopped, and its result as arrays.

Each part depends on its inputs and on the parts before it, so it is stored with a digest of all of them. A part with
another digest belongs to other materials or another grid; it and all later parts are computed anew.

Parts and the whole are stored as named arrays: everything that was traced and sampled, nothing that follows from scene
and light. The key of the whole must identify everything it depends on: scene, camera, light, bounces, sampling
settings, the models of the objects, and the names of the arrays themselves. Arrays from a file are validated against
scene and light before a kernel uses them as indices.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, Arrays, UnsoundArrays
from engine.precompute.indirect._cache_kernels import MAX_RECORDS, N_PLACES, NO_RECORD, CacheTable
from engine.precompute.indirect._light_choice_kernels import N_BY_LOBE, N_BY_POWER, NO_LIGHT, LitPlaces
from engine.precompute.indirect._second_bounce_kernels import GlossyHits
from engine.precompute.indirect.albedo import N_SLANTS
from engine.precompute.indirect.direction_patterns import MAX_SAMPLE_SETS
from engine.precompute.indirect.gather import GatherSamples
from engine.precompute.indirect.indirect_light import Footprint, IndirectLight
from engine.precompute.indirect.irradiance_cache import N_SLOTS, CacheFull, CacheLight
from engine.precompute.indirect.ray_budget import LEVELS, RayBudget
from engine.precompute.indirect.smoothing import Smoothing, no_smoothing

Made = TypeVar("Made")
_DIGEST = "digest"
_TOO_FINE = b"the grid is too fine"


class CheckpointStore(Protocol):
    """Stores parts by their index. `load` returns None if there is no valid part."""

    def load(self, index: int) -> Arrays | None: ...

    def store(self, index: int, arrays: Arrays) -> None: ...


class Checkpoints:
    """One run through the parts, in order: `begin` each part, and `store_part` if it had to be computed."""

    def __init__(self, storage: CheckpointStore | None = None) -> None:
        """storage: None to store nothing."""
        self._storage = storage
        self._index = 0
        self._finished = self._current = b""

    def begin(self, read: Callable[[Arrays], Made], *inputs: bytes) -> Made | None:
        """The result of `read` for the next stored part if its digest matches these inputs, else None.

        Raises CacheFull where an earlier run did.
        """
        stored, digest = self._stored()
        if digest is not None and digest == self._after(_TOO_FINE):
            raise CacheFull("as before")
        self._current = self._after(*inputs)
        if stored is None or digest != self._current:
            return None
        try:
            made = read(stored)
        except UnsoundArrays:
            return None
        self._end(self._current)
        return made

    def store_part(self, arrays: Arrays) -> None:
        """Stores the part that was begun."""
        self._store(self._current, arrays)

    def mark_too_fine(self) -> None:
        """Ends this grid: the next parts belong to a coarser one."""
        digest = self._after(_TOO_FINE)
        if self._stored()[1] == digest:
            self._end(digest)
        else:
            self._store(digest, {})

    def _store(self, digest: bytes, arrays: Arrays) -> None:
        """Stores a part with its digest, and ends it."""
        if self._storage is not None:
            self._storage.store(self._index, {_DIGEST: np.frombuffer(digest, np.uint8), **arrays})
        self._end(digest)

    def _stored(self) -> tuple[Arrays | None, bytes | None]:
        """The stored part at the current index, and its digest."""
        stored = None if self._storage is None else self._storage.load(self._index)
        digest = None if stored is None else stored.get(_DIGEST)
        return stored, None if digest is None else digest.tobytes()

    def _after(self, *inputs: bytes) -> bytes:
        """The digest of a part with these inputs after the finished parts."""
        digest = hashlib.blake2b(self._finished, digest_size=20)
        for each in inputs:
            digest.update(len(each).to_bytes(8, "little"))
            digest.update(each)
        return digest.digest()

    def _end(self, digest: bytes) -> None:
        self._index, self._finished = self._index + 1, digest


NOT_ESTIMATED = -1.0  # marks noise that was not estimated
N_CANDIDATES = N_BY_POWER + N_BY_LOBE
_RECORDS, _CELLS, _SMOOTHING = "records.", "cells.", "smoothing."
_OWN_NAMES = (
    "rows", "nth", "seen", "clearance", "footprint", "footprint_weights", "cell_seen", "direct", "cell_size", "n_rays",
    "noise",
)  # fmt: skip
NAMES = (
    *_OWN_NAMES, *(_RECORDS + name for name in GlossyHits._fields), *(_CELLS + name for name in CacheTable._fields),
    *(_SMOOTHING + name for name in Smoothing._fields),
)  # fmt: skip


def arrays_of(light: IndirectLight) -> Arrays:
    """The arrays of indirect light, by `NAMES`."""
    gathered, cache = light.points.samples, light.cache
    own = (
        gathered.rows, gathered.nth, gathered.records, gathered.clearance, *light.footprint, light.light.records_hit,
        light.light.direct, np.array([cache.size]), np.array([light.ray_budget.n_rays], np.int64),
        np.array([NOT_ESTIMATED if light.ray_budget.noise is None else light.ray_budget.noise]),
    )  # fmt: skip
    smoothing = light.points.smoothing or no_smoothing(len(gathered.points))
    return dict(zip(NAMES, (*own, *gathered.glossy_hits, *cache.table(), *smoothing), strict=True))


def arrays_of_gathered(gathered: GatherSamples) -> Arrays:
    """The arrays that `read_gathered` reads."""
    own = gathered.rows, gathered.nth, gathered.records, gathered.clearance
    records = {_RECORDS + name: array for name, array in zip(GlossyHits._fields, gathered.glossy_hits, strict=True)}
    return {**dict(zip(_OWN_NAMES, own, strict=False)), **records}


def arrays_of_table(table: CacheTable) -> Arrays:
    """The arrays that `read_table` reads."""
    return {_CELLS + name: array for name, array in zip(CacheTable._fields, table, strict=True)}


def read_table(reader: ArrayReader) -> CacheTable:
    """The records as `IrradianceCache.table` returns them. The reader knows the sizes M and T of objects and triangles,
    and learns C.

    Raises UnsoundArrays, as do all functions below.
    """
    known = reader.sizes
    keys = reader.take(_CELLS + "keys", np.uint64, N_SLOTS)
    known["C"] = int(np.count_nonzero(keys))
    if known["C"] > MAX_RECORDS:
        raise UnsoundArrays("more records than there can be")
    records = reader.take(_CELLS + "cells", np.int32, N_SLOTS, below=max(known["C"], 1))
    n_records = reader.take(_CELLS + "n_cells", np.int64, 1)
    objects = reader.take(_CELLS + "objects", np.int32, "C", below=known["M"])
    seeds = reader.take(_CELLS + "seeds", np.uint64, "C")
    n_places = reader.take(_CELLS + "n_places", np.int64, "C", below=N_PLACES + 1)
    if n_records[0] != known["C"] or not n_places.all():
        raise UnsoundArrays("records without a position, or a wrong count")
    hashes = reader.take(_CELLS + "hashes", np.uint32, "C", N_PLACES)
    triangle = reader.take(_CELLS + "triangle", np.int32, "C", N_PLACES, below=known["T"])
    u, v = (reader.take(_CELLS + name, np.float32, "C", N_PLACES) for name in "uv")
    side = reader.take(_CELLS + "side", np.uint8, "C", N_PLACES)
    return CacheTable(keys, records, n_records, objects, seeds, n_places, hashes, triangle, u, v, side)


def read_gathered(reader: ArrayReader) -> GatherSamples:
    """The gather points; call after `read_table`. The reader knows P points of the picture, R rays per sample set and L
    lights, and learns q sample sets and p gather points."""
    known = reader.sizes
    rows = reader.take("rows", np.int32, "q", below=known["P"])
    nth = reader.take("nth", np.uint8, "q", below=MAX_SAMPLE_SETS)
    if (np.diff(rows * np.int64(MAX_SAMPLE_SETS) + nth) <= 0).any():
        raise UnsoundArrays("gather points that do not ascend")
    seen = reader.take("seen", np.uint16, "q", "R", below=known["C"], or_else=NO_RECORD)
    clearance = reader.take("clearance", np.float32, "q")
    gathered = GatherSamples(rows, nth, seen, _read_records(reader, seen), clearance)
    known["p"] = len(gathered.points)
    return gathered


def _read_records(reader: ArrayReader, seen: NDArray[np.uint16]) -> GlossyHits:
    """The glossy hits of sample sets whose rays hit the records seen (q, R)."""
    known = reader.sizes
    start = reader.runs(_RECORDS + "start", "q", "n")
    times = reader.take(_RECORDS + "times", np.float32, "q")
    ray = reader.take(_RECORDS + "ray", np.uint16, "n", below=known["R"])
    if (seen[np.repeat(np.arange(known["q"]), np.diff(start)), ray] == NO_RECORD).any():
        raise UnsoundArrays("records of rays that hit nothing")
    second = _read_lit(reader, "")
    beyond = reader.take(_RECORDS + "beyond", np.uint16, "n", below=known["C"], or_else=NO_RECORD)
    third = _read_lit(reader, "_3")
    if (beyond[third[3] != NO_LIGHT] == NO_RECORD).any():
        raise UnsoundArrays("light beyond rays that hit nothing")
    return GlossyHits(start, times, ray, *second, beyond, *third)


def _read_lit(reader: ArrayReader, ending: str) -> LitPlaces:
    """Normals, turns, distances, lights, candidates and weights of one vertex of the glossy hits."""
    normal = reader.take(f"{_RECORDS}normal{ending}", np.float32, "n", 3)
    turn = reader.take(f"{_RECORDS}turn{ending}", np.uint8, "n")
    distance = reader.take(f"{_RECORDS}distance{ending}", np.float32, "n")
    light = reader.take(f"{_RECORDS}light{ending}", np.uint16, "n", below=reader.sizes["L"], or_else=NO_LIGHT)
    candidate = reader.take(f"{_RECORDS}candidate{ending}", np.uint8, "n", below=N_CANDIDATES)
    return normal, turn, distance, light, candidate, reader.take(f"{_RECORDS}weight{ending}", np.float32, "n")


def read_footprint(reader: ArrayReader) -> Footprint:
    """The footprint of every point of the picture; call after `read_gathered`."""
    rows = reader.take("footprint", np.int32, "P", 4, below=reader.sizes["p"])
    return rows, reader.take("footprint_weights", np.float32, "P", 4)


def read_smoothing(reader: ArrayReader) -> Smoothing:
    """The filter; call after `read_gathered`."""
    start = reader.runs(_SMOOTHING + "start", "p", "entries")
    neighbour = reader.take(_SMOOTHING + "neighbour", np.int32, "entries", below=reader.sizes["p"])
    return Smoothing(start, neighbour, reader.take(_SMOOTHING + "weight", np.float32, "entries"))


def read_record_light(reader: ArrayReader, n_rays: int, objects: NDArray[np.int32]) -> CacheLight:
    """The light between records of these objects, with n_rays each; call after `read_table`."""
    known = reader.sizes
    seen = reader.take("cell_seen", np.uint16, "sending", n_rays, below=known["C"], or_else=NO_RECORD)
    if known["sending"] > known["C"]:
        raise UnsoundArrays("more records send than there are")
    return CacheLight(objects, seen, reader.take("direct", np.float32, "C", N_SLANTS, 3))


def read_ray_budget(reader: ArrayReader, most: int) -> RayBudget:
    """The ray budget, of at most `most` rays per sample set."""
    n_rays, noise = int(reader.take("n_rays", np.int64, 1)[0]), float(reader.take("noise", np.float64, 1)[0])
    if n_rays not in [most // level for level in LEVELS] or noise < 0.0 and noise != NOT_ESTIMATED:
        raise UnsoundArrays("hemisphere samples without a gather point")
    return RayBudget(n_rays, most, None if noise == NOT_ESTIMATED else noise)


def read_cell_size(reader: ArrayReader) -> float:
    """The cell size in metres."""
    size = float(reader.take("cell_size", np.float64, 1)[0])
    if size <= 0.0:
        raise UnsoundArrays("cells without a size")
    return size
