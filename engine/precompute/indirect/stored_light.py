"""Converts indirect light to named arrays and back: everything that was traced and sampled, nothing that follows from
scene and light.

The key under which the arrays are stored must identify everything they depend on: scene, camera, light, bounces,
sampling settings, the models of the objects, and the names of the arrays themselves. Arrays from a file are validated
against scene and light before a kernel uses them as indices.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, UnsoundArrays
from engine.precompute.indirect._cache_kernels import MAX_RECORDS, N_PLACES, NO_RECORD, CacheTable
from engine.precompute.indirect._second_bounce_kernels import N_BY_LOBE, N_BY_POWER, NO_LIGHT, GlossyHits, LitPlaces
from engine.precompute.indirect.albedo_from_curves import N_SLANTS
from engine.precompute.indirect.gather import MAX_SAMPLE_SETS, GatherSamples
from engine.precompute.indirect.indirect_light import Footprint, IndirectLight
from engine.precompute.indirect.irradiance import CacheLight
from engine.precompute.indirect.irradiance_cache import N_SLOTS
from engine.precompute.indirect.sampling_settings import LEVELS, RayBudget
from engine.precompute.indirect.smoothing import Smoothing, no_smoothing

Arrays = dict[str, NDArray[np.generic]]
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
    gathered, cells = light.points.samples, light.cells
    own = (
        gathered.rows, gathered.nth, gathered.records, gathered.clearance, *light.footprint, light.light.records_hit,
        light.light.direct, np.array([cells.size]), np.array([light.ray_budget.n_rays], np.int64),
        np.array([NOT_ESTIMATED if light.ray_budget.noise is None else light.ray_budget.noise]),
    )  # fmt: skip
    smoothing = light.points.smoothing or no_smoothing(len(gathered.points))
    return dict(zip(NAMES, (*own, *gathered.glossy_hits, *cells.table(), *smoothing), strict=True))


def arrays_of_gathered(gathered: GatherSamples) -> Arrays:
    """The arrays that `read_gathered` reads."""
    records = {_RECORDS + name: array for name, array in zip(GlossyHits._fields, gathered.glossy_hits, strict=True)}
    own: Arrays = {
        "rows": gathered.rows,
        "nth": gathered.nth,
        "seen": gathered.records,
        "clearance": gathered.clearance,
    }
    return own | records


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
        raise UnsoundArrays("more cells than there can be")
    cells = reader.take(_CELLS + "cells", np.int32, N_SLOTS, below=max(known["C"], 1))
    n_cells = reader.take(_CELLS + "n_cells", np.int64, 1)
    objects = reader.take(_CELLS + "objects", np.int32, "C", below=known["M"])
    seeds = reader.take(_CELLS + "seeds", np.uint64, "C")
    n_places = reader.take(_CELLS + "n_places", np.int64, "C", below=N_PLACES + 1)
    if n_cells[0] != known["C"] or not n_places.all():
        raise UnsoundArrays("cells without a position, or a wrong count")
    hashes = reader.take(_CELLS + "hashes", np.uint32, "C", N_PLACES)
    triangle = reader.take(_CELLS + "triangle", np.int32, "C", N_PLACES, below=known["T"])
    u, v = (reader.take(_CELLS + name, np.float32, "C", N_PLACES) for name in "uv")
    side = reader.take(_CELLS + "side", np.uint8, "C", N_PLACES)
    return CacheTable(keys, cells, n_cells, objects, seeds, n_places, hashes, triangle, u, v, side)


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
    if (beyond[third[2] != NO_LIGHT] == NO_RECORD).any():
        raise UnsoundArrays("light beyond rays that hit nothing")
    return GlossyHits(start, times, ray, *second, beyond, *third)


def _read_lit(reader: ArrayReader, ending: str) -> LitPlaces:
    """Normals, distances, lights, candidates and weights of one vertex of the glossy hits."""
    normal = reader.take(f"{_RECORDS}normal{ending}", np.float32, "n", 3)
    distance = reader.take(f"{_RECORDS}distance{ending}", np.float32, "n")
    light = reader.take(f"{_RECORDS}light{ending}", np.uint16, "n", below=reader.sizes["L"], or_else=NO_LIGHT)
    candidate = reader.take(f"{_RECORDS}candidate{ending}", np.uint8, "n", below=N_CANDIDATES)
    return normal, distance, light, candidate, reader.take(f"{_RECORDS}weight{ending}", np.float32, "n")


def read_footprint(reader: ArrayReader) -> Footprint:
    """The footprint of every point of the picture; call after `read_gathered`."""
    rows = reader.take("footprint", np.int32, "P", 4, below=reader.sizes["p"])
    return rows, reader.take("footprint_weights", np.float32, "P", 4)


def read_smoothing(reader: ArrayReader) -> Smoothing:
    """The filter; call after `read_gathered`."""
    start = reader.runs(_SMOOTHING + "start", "p", "entries")
    neighbour = reader.take(_SMOOTHING + "neighbour", np.int32, "entries", below=reader.sizes["p"])
    return Smoothing(start, neighbour, reader.take(_SMOOTHING + "weight", np.float32, "entries"))


def read_cell_light(reader: ArrayReader, n_rays: int, objects: NDArray[np.int32]) -> CacheLight:
    """The light between records of these objects, with n_rays each; call after `read_table`."""
    known = reader.sizes
    seen = reader.take("cell_seen", np.uint16, "sending", n_rays, below=known["C"], or_else=NO_RECORD)
    if known["sending"] > known["C"]:
        raise UnsoundArrays("more cells send than there are")
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
