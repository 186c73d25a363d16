"""The tables of measurements in the process that computes: read once, kept as long as it lives.

Kernels know a table by its address, which a number in their quotient parameters holds exactly; nothing that is looked
up by address may ever be freed, so nothing here is. Elsewhere a table has a number, the first 48 bits of a hash of its
file and of how factors are fitted. What was read is kept in a store, under that hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.errors import InsituError, LoadError
from engine.measured.coordinates import SHAPE
from engine.measured.cornell import SUFFIX as CORNELL
from engine.measured.cornell import read_cornell, scattered_samples
from engine.measured.fill import Filled, fill_samples
from engine.measured.fit import METHOD, Factors, fit_factors
from engine.measured.measurement import CURVES, ENDINGS, FitReport, Measurement
from engine.measured.merl import merl_samples, read_merl
from engine.measured.scattered import METHOD as SCATTERED_METHOD
from engine.measured.scattered import fit_scattered

# Raised when anything changes what is made of a file.
FIT_VERSION = 3

Steps = Generator[tuple[float, str], None, Measurement]


class ArrayStore(Protocol):
    """Arrays kept on disk by key, such as `app.jobs.cache.Store`."""

    def get(self, key: str) -> Mapping[str, NDArray[np.generic]] | None: ...

    def put(self, key: str, arrays: Mapping[str, NDArray[np.generic]]) -> bool: ...


@dataclass(eq=False)
class Table:
    """samples (90, 90, 180, 3) float32 without gaps, and the measurement fitted to them; `bound` by smoothing:
    strengths (3, 3) and curves (6, 91, 3), float32 in one array."""

    samples: NDArray[np.float32]
    measurement: Measurement
    bound: dict[float, NDArray[np.float32]] = field(default_factory=dict)

    def curves(self, smoothing: float) -> NDArray[np.float32]:
        """What kernels take of the factors."""
        if smoothing not in self.bound:
            there = self.measurement
            strengths = np.array([there.diffuse, there.specular, there.whole], np.float32)
            curves = [there.nodes(name, smoothing) for name in CURVES]
            joined = np.concatenate([strengths.ravel(), *(np.asarray(curve, np.float32).ravel() for curve in curves)])
            self.bound[smoothing] = joined
        return self.bound[smoothing]


_tables: dict[int, Table] = {}


def table_of(number: int) -> Table:
    """The table of that number. Raises InsituError where this process has not read it."""
    if number not in _tables:
        raise InsituError(f"the measurement {number:012x} has not been read; open its scene again")
    return _tables[number]


def is_known(number: int) -> bool:
    """Whether this process has that table."""
    return number in _tables


def add_table(samples: NDArray[np.float32], measurement: Measurement) -> None:
    """Keep a table under its measurement's number."""
    _tables.setdefault(measurement.number, Table(np.ascontiguousarray(samples, np.float32), measurement))


def read_measurement(path: Path, store: ArrayStore | None = None) -> Steps:
    """Read a file, fill and fit it, or take what was made of it before; yields (share done, what is at work).

    Raises LoadError.
    """
    yield 0.0, f"reading {path.name}"
    data = _read(path)
    key = hashlib.blake2b(data, digest_size=20, key=f"measured {FIT_VERSION}".encode()).hexdigest()
    number = int(key[:12], 16) or 1
    if number in _tables:
        return replace(_tables[number].measurement, file=str(path))
    kept = None if store is None else store.get(f"measured-{key}")
    if kept is not None:
        measurement = _from_arrays(str(path), number, kept)
        add_table(np.asarray(kept["samples"], np.float32), measurement)
        return measurement
    filled, factors, method = yield from _made_of(data, path)
    report = FitReport(filled.n_missing, filled.n_below, factors.error, factors.error_whole, method)
    arrays = _arrays(filled.table, factors, report)
    if store is not None:
        store.put(f"measured-{key}", arrays)
    measurement = _from_arrays(str(path), number, arrays)
    add_table(filled.table, measurement)
    return measurement


def _made_of(data: bytes, path: Path) -> Generator[tuple[float, str], None, tuple[Filled, Factors, str]]:
    """A table, its factors, and how they were found."""
    text = f"fitting factors to {path.name}"
    if path.suffix.lower() == CORNELL:
        for step in fit_scattered(scattered_samples(data, path)):
            if not isinstance(step, float):
                return (*step, SCATTERED_METHOD)
            yield step, text
    samples = merl_samples(data, path)
    yield 0.1, f"filling what {path.name} leaves out"
    filled = fill_samples(samples)
    if filled is None:
        raise LoadError(path, "samples", "all negative", "some that are not")
    yield 0.4, text
    for share in fit_factors(filled.table, filled.measured):
        if isinstance(share, Factors):
            return filled, share, METHOD
        yield 0.4 + 0.6 * share, text
    raise AssertionError("a fit ends with its factors")


def finish_reading(steps: Steps) -> Measurement:
    """The measurement, whatever is told on the way."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: Measurement = end.value
            return found


def _read(path: Path) -> bytes:
    suffix = path.suffix.lower()
    if suffix not in ENDINGS:
        raise LoadError(path, "name", path.suffix or path.name, f"a measured BRDF, {' or '.join(ENDINGS)}")
    return read_cornell(path) if suffix == CORNELL else read_merl(path)


def _arrays(table: NDArray[np.float32], factors: Factors, report: FitReport) -> dict[str, NDArray[np.generic]]:
    curves = [factors.slant, factors.slant, factors.theta_d, factors.theta_h, factors.slant_p, factors.half_q]
    return {
        "samples": table,
        "strengths": np.stack([factors.diffuse, factors.specular, factors.whole]),
        "curves": np.stack(curves).astype(np.float32),
        "filled": np.array([report.n_missing, report.n_below]),
        "error": np.array([report.error, report.error_whole]),
        "method": np.frombuffer(report.method.encode(), np.uint8),
    }


def _from_arrays(file: str, number: int, arrays: Mapping[str, NDArray[np.generic]]) -> Measurement:
    if arrays["samples"].shape != (*SHAPE, 3):
        raise InsituError(f"{file}: what was kept of it has another shape")
    diffuse, specular, whole = (_rgb(row) for row in np.asarray(arrays["strengths"], float))
    missing, below = (int(n) for n in np.asarray(arrays["filled"], int))
    error, error_whole = (float(error) for error in np.asarray(arrays["error"], float))
    method = np.asarray(arrays["method"], np.uint8).tobytes().decode()
    report = FitReport(missing, below, error, error_whole, method)
    curves = tuple(np.ascontiguousarray(curve, np.float32).tobytes() for curve in arrays["curves"])
    return Measurement(file, number, diffuse, specular, whole, curves, report)


def _rgb(row: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])
