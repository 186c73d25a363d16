"""The tables of measurements in the process that computes: read once, never freed.

Kernels identify a table by its address, which a number in their quotient parameters represents exactly; memory that is
read by address must never be freed, so nothing here is. Elsewhere a table has a number, the first 48 bits of a hash of
its file and of the version of the fit. A store caches what was read, under that hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError, LoadError
from engine.core.stored_arrays import ArrayReader, Arrays
from engine.measured.adaptive import grid_samples
from engine.measured.fit import METHOD, Factors, fit_factors
from engine.measured.measurement import CURVES, ENDINGS, N_NODES, SHAPE, FitReport, Measurement
from engine.measured.sample_files import (
    CORNELL_SUFFIX,
    FilledTable,
    fill_samples,
    merl_samples,
    read_cornell,
    read_merl,
    scattered_samples,
)
from engine.measured.scattered_fit import METHOD as SCATTERED_METHOD
from engine.measured.scattered_fit import fit_scattered
from engine.measured.tensor_files import TENSOR_SUFFIX, adaptive_reflection, read_tensor_file

Made = TypeVar("Made")
# Increased when the results for a file change.
FIT_VERSION = 3

Steps = Generator[tuple[float, str], None, Measurement]


class ArrayStore(Protocol):
    """Arrays on disk by key, such as `app.worker.cache.ArrayCache`."""

    def get(self, key: str, read: Callable[[Arrays], Made]) -> Made | None: ...

    def put(self, key: str, arrays: Arrays) -> bool: ...


@dataclass(eq=False)
class Table:
    """samples (90, 90, 180, 3) float32 without gaps, and the measurement fitted to them; `bound` by smoothing:
    strengths (3, 3) and curves (6, 91, 3), float32 in one array."""

    samples: NDArray[np.float32]
    measurement: Measurement
    bound: dict[float, NDArray[np.float32]] = field(default_factory=dict)

    def curves(self, smoothing: float) -> NDArray[np.float32]:
        """The factors in the kernels' form."""
        if smoothing not in self.bound:
            there = self.measurement
            strengths = np.array([there.diffuse, there.specular, there.whole], np.float32)
            curves = [there.nodes(name, smoothing) for name in CURVES]
            joined = np.concatenate([strengths.ravel(), *(np.asarray(curve, np.float32).ravel() for curve in curves)])
            self.bound[smoothing] = joined
        return self.bound[smoothing]


_tables: dict[int, Table] = {}


def table_of(number: int) -> Table:
    """The table of that number. Raises InsituError if this process has not read it."""
    if number not in _tables:
        raise InsituError(f"the measurement {number:012x} has not been read; open its scene again")
    return _tables[number]


def is_table_loaded(number: int) -> bool:
    """Whether this process has that table."""
    return number in _tables


def add_table(samples: NDArray[np.float32], measurement: Measurement) -> None:
    """Store a table under its measurement's number."""
    _tables.setdefault(measurement.number, Table(np.ascontiguousarray(samples, np.float32), measurement))


def read_measurement(path: Path, store: ArrayStore | None = None) -> Steps:
    """Read, fill and fit a file, or take the cached result; yields (share done, current step).

    Raises LoadError.
    """
    yield 0.0, f"reading {path.name}"
    data = _read(path)
    key = hashlib.blake2b(data, digest_size=20, key=f"measured {FIT_VERSION}".encode()).hexdigest()
    number = int(key[:12], 16) or 1
    if number in _tables:
        return replace(_tables[number].measurement, file=str(path))
    stored = None if store is None else store.get(f"measured-{key}", partial(_from_arrays, str(path), number))
    if stored is not None:
        add_table(*stored)
        return stored[1]
    filled, factors, method = yield from _fit_file(data, path)
    report = FitReport(filled.n_missing, filled.n_below, factors.error, factors.error_whole, method)
    arrays = _arrays(filled.table, factors, report)
    if store is not None:
        store.put(f"measured-{key}", arrays)
    samples, measurement = _from_arrays(str(path), number, arrays)
    add_table(samples, measurement)
    return measurement


def _fit_file(data: bytes, path: Path) -> Generator[tuple[float, str], None, tuple[FilledTable, Factors, str]]:
    """A table, its factors, and how they were found."""
    text = f"fitting factors to {path.name}"
    suffix = path.suffix.lower()
    if suffix == CORNELL_SUFFIX:
        for step in fit_scattered(scattered_samples(data, path)):
            if not isinstance(step, float):
                return (*step, SCATTERED_METHOD)
            yield step, text
    samples = (yield from _tensor_samples(data, path)) if suffix == TENSOR_SUFFIX else merl_samples(data, path)
    yield 0.3, f"filling what {path.name} leaves out"
    filled = fill_samples(samples)
    if filled is None:
        raise LoadError(path, "samples", "all negative", "some that are not")
    yield 0.4, text
    for share in fit_factors(filled.table, filled.measured):
        if isinstance(share, Factors):
            return filled, share, METHOD
        yield 0.4 + 0.6 * share, text
    raise AssertionError("a fit ends with its factors")


def _tensor_samples(data: bytes, path: Path) -> Generator[tuple[float, str], None, NDArray[np.float32]]:
    """Samples of an isotropic tensor file."""
    reflection = adaptive_reflection(data, path)
    if not reflection.is_isotropic:
        raise LoadError(path, "azimuths of wi", len(reflection.phi), "one or two, of an isotropic surface")
    for step in grid_samples(reflection):
        if not isinstance(step, float):
            return step
        yield 0.3 * step, f"evaluating {path.name}"
    raise AssertionError("a grid ends with its samples")


def _read(path: Path) -> bytes:
    suffix = path.suffix.lower()
    if suffix not in ENDINGS:
        raise LoadError(path, "name", path.suffix or path.name, f"a measured BRDF, {' or '.join(ENDINGS)}")
    return {CORNELL_SUFFIX: read_cornell, TENSOR_SUFFIX: read_tensor_file}.get(suffix, read_merl)(path)


def _arrays(table: NDArray[np.float32], factors: Factors, report: FitReport) -> dict[str, NDArray[np.generic]]:
    curves = [factors.slant, factors.slant, factors.theta_d, factors.theta_h, factors.slant_p, factors.half_q]
    return {
        "samples": table,
        "strengths": np.stack([factors.diffuse, factors.specular, factors.whole]).astype(np.float64),
        "curves": np.stack(curves).astype(np.float32),
        "filled": np.array([report.n_missing, report.n_below], np.int64),
        "error": np.array([report.error, report.error_whole], np.float64),
        "method": np.frombuffer(report.method.encode(), np.uint8),
    }


def _from_arrays(file: str, number: int, arrays: Arrays) -> tuple[NDArray[np.float32], Measurement]:
    """The samples and their fit from cached arrays. Raises UnsoundArrays."""
    reader = ArrayReader(arrays)
    samples = reader.take("samples", np.float32, *SHAPE, 3)
    diffuse, specular, whole = (_rgb(row) for row in reader.take("strengths", np.float64, 3, 3))
    missing, below = (int(n) for n in reader.take("filled", np.int64, 2))
    error, error_whole = (float(error) for error in reader.take("error", np.float64, 2))
    method = reader.take("method", np.uint8, "text").tobytes().decode(errors="replace")
    curves = tuple(curve.tobytes() for curve in reader.take("curves", np.float32, len(CURVES), N_NODES, 3))
    report = FitReport(missing, below, error, error_whole, method)
    return samples, Measurement(file, number, diffuse, specular, whole, curves, report)


def _rgb(row: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])
