"""The tables of measurements in the process that computes: read once, never freed.

Kernels identify a table by its address, which a number in their quotient parameters represents exactly; memory that is
read by address must never be freed, so nothing here is. Elsewhere a table has a number, the first 48 bits of a hash of
its file and of the version of the fit. A store caches what was read, under that hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError, LoadError
from engine.core.stored_arrays import ArrayReader, Arrays, UnsoundArrays
from engine.measured.adaptive import AdaptiveReflection, grid_samples, is_packed, scattered_directions
from engine.measured.factors import Factors
from engine.measured.fit import METHOD, fit_factors
from engine.measured.measurement import (
    CURVES,
    ENDINGS,
    N_NODES,
    PARTS,
    SHAPE,
    FitReport,
    Measurement,
    evaluate_table,
)
from engine.measured.sample_files import (
    CORNELL_SUFFIX,
    ScatteredSamples,
    fill_samples,
    merl_samples,
    read_cornell,
    read_merl,
    scattered_samples,
)
from engine.measured.scattered_fit import METHOD as SCATTERED_METHOD
from engine.measured.scattered_fit import fit_anisotropic, fit_scattered
from engine.measured.tensor_files import TENSOR_SUFFIX, adaptive_reflection, read_tensor_file

Made = TypeVar("Made")
# Increased when the results for a file change.
FIT_VERSION = 4

Steps = Generator[tuple[float, str], None, Measurement]


class ArrayStore(Protocol):
    """Arrays on disk by key, such as `app.worker.cache.ArrayCache`."""

    def get(self, key: str, read: Callable[[Arrays], Made]) -> Made | None: ...

    def put(self, key: str, arrays: Arrays) -> bool: ...


@dataclass(eq=False)
class Table:
    """samples: (90, 90, 180, 3) without gaps, or of an anisotropic surface (N,), `AdaptiveReflection.packed`, float32;
    the measurement fitted to them; `bound` by smoothing: strengths (6, 3) and curves (11, 91, 3), float32 in one
    array."""

    samples: NDArray[np.float32]
    measurement: Measurement
    bound: dict[float, NDArray[np.float32]] = field(default_factory=dict)

    def curves(self, smoothing: float) -> NDArray[np.float32]:
        """The factors in the kernels' form: one array for ever, whichever of several threads makes it first."""
        if smoothing not in self.bound:
            there = self.measurement
            curves = [there.nodes(name, smoothing) for name in CURVES]
            joined = np.concatenate([np.ravel(there.strengths), *(curve.ravel() for curve in curves)])
            # `setdefault` replaces nothing: another thread's kernels may read what is there by its address.
            self.bound.setdefault(smoothing, joined.astype(np.float32))
        return self.bound[smoothing]

    def evaluate(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """The measurement (N, 3), 1/sr, for unit directions (N, 3) above the horizon."""
        if not self.measurement.is_anisotropic:
            return evaluate_table(self.samples, wi, wo)
        return np.maximum(AdaptiveReflection.unpacked(self.samples).evaluate(wi, wo), 0.0)


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
    key, number = _names(data)
    if number in _tables:
        return replace(_tables[number].measurement, file=str(path))
    stored = None if store is None else store.get(f"measured-{key}", partial(_from_arrays, str(path), number))
    if stored is not None:
        add_table(*stored)
        return stored[1]
    fitted = yield from _fit_file(data, path)
    if store is not None:
        store.put(f"measured-{key}", fitted)
    samples, measurement = _from_arrays(str(path), number, fitted)
    add_table(samples, measurement)
    return measurement


def is_content(measurement: Measurement, data: bytes) -> bool:
    """Whether a measurement was read from these bytes."""
    return measurement.number == _names(data)[1]


def _names(data: bytes) -> tuple[str, int]:
    """The key and the number of a file's content."""
    key = hashlib.blake2b(data, digest_size=20, key=f"measured {FIT_VERSION}".encode()).hexdigest()
    return key, int(key[:12], 16) or 1


def _fit_file(data: bytes, path: Path) -> Generator[tuple[float, str], None, dict[str, NDArray[np.generic]]]:
    """The samples of a file and their factors, as they are stored."""
    text, suffix = f"fitting factors to {path.name}", path.suffix.lower()
    if suffix == CORNELL_SUFFIX:
        for step in fit_scattered(scattered_samples(data, path)):
            if not isinstance(step, float):
                filled, factors = step
                return _arrays(filled.table, factors, (filled.n_missing, filled.n_below), SCATTERED_METHOD)
            yield step, text
    if suffix == TENSOR_SUFFIX:
        reflection = adaptive_reflection(data, path)
        if not reflection.is_isotropic:
            return (yield from _fit_adaptive(reflection, text))
        samples = yield from last_of(grid_samples(reflection), 0.0, 0.3, f"evaluating {path.name}")
    else:
        samples = merl_samples(data, path)
    yield 0.3, f"filling what {path.name} leaves out"
    table = fill_samples(samples)
    if table is None:
        raise LoadError(path, "samples", "all negative", "some that are not")
    factors = yield from last_of(fit_factors(table.table, table.measured), 0.4, 1.0, text)
    return _arrays(table.table, factors, (table.n_missing, table.n_below), METHOD)


def _fit_adaptive(
    reflection: AdaptiveReflection, text: str
) -> Generator[tuple[float, str], None, dict[str, NDArray[np.generic]]]:
    """An anisotropic measurement and its factors."""
    wi, wo = scattered_directions()
    values = reflection.evaluate(wi, wo)
    there = (values >= 0.0).all(axis=1)
    samples = ScatteredSamples(wi[there], wo[there], values[there], int((~there).sum()))
    factors = yield from last_of(fit_anisotropic(samples), 0.1, 1.0, text)
    return _arrays(reflection.packed(), factors, (0, 0), SCATTERED_METHOD)


Last = TypeVar("Last")


def last_of(
    steps: Iterator[float | Last], first: float, end: float, text: str
) -> Generator[tuple[float, str], None, Last]:
    """What steps end with; their shares done are reported between `first` and `end`."""
    for step in steps:
        if not isinstance(step, float):
            return step
        yield first + (end - first) * step, text
    raise AssertionError("steps end with a result")


def _read(path: Path) -> bytes:
    suffix = path.suffix.lower()
    if suffix not in ENDINGS:
        raise LoadError(path, "name", path.suffix or path.name, f"a measured BRDF, {' or '.join(ENDINGS)}")
    return {CORNELL_SUFFIX: read_cornell, TENSOR_SUFFIX: read_tensor_file}.get(suffix, read_merl)(path)


def _arrays(
    samples: NDArray[np.float32], factors: Factors, filled: tuple[int, int], method: str
) -> dict[str, NDArray[np.generic]]:
    """As it is stored. filled: the numbers of samples above the horizon and below it that were not measured."""
    method = f"{method}; {factors.note}"
    return {
        "samples": samples,
        "strengths": np.stack([factors.strengths[part] for part in PARTS]).astype(np.float64),
        "curves": np.stack([factors.curves[name] for name in CURVES]).astype(np.float32),
        "filled": np.array(filled, np.int64),
        "error": np.array([factors.error, factors.error_whole], np.float64),
        "highlight": np.array([PARTS.index(factors.highlight)], np.int64),
        "method": np.frombuffer(method.encode(), np.uint8),
    }


def _from_arrays(file: str, number: int, arrays: Arrays) -> tuple[NDArray[np.float32], Measurement]:
    """The samples and their fit from cached arrays. Raises UnsoundArrays."""
    reader = ArrayReader(arrays)
    is_anisotropic = "samples" in arrays and arrays["samples"].ndim == 1
    samples = reader.take("samples", np.float32, *(("packed",) if is_anisotropic else (*SHAPE, 3)))
    if is_anisotropic and not is_packed(samples):
        raise UnsoundArrays("the samples do not have their sizes")
    strengths = tuple(_rgb(row) for row in reader.take("strengths", np.float64, len(PARTS), 3))
    missing, below = (int(n) for n in reader.take("filled", np.int64, 2))
    error, error_whole = (float(error) for error in reader.take("error", np.float64, 2))
    highlight = PARTS[int(reader.take("highlight", np.int64, 1, below=len(PARTS))[0])]
    method = reader.take("method", np.uint8, "text").tobytes().decode(errors="replace")
    curves = tuple(curve.tobytes() for curve in reader.take("curves", np.float32, len(CURVES), N_NODES, 3))
    report = FitReport(missing, below, error, error_whole, method)
    return samples, Measurement(file, number, strengths, curves, report, is_anisotropic, highlight)


def _rgb(row: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])
