"""Indirect light as named arrays and back: all that was traced and sampled, nothing that follows from scene and light.

What it is stored under has to tell apart all that it depends on: scene, camera, light, bounces, fineness, the models of
the objects, and the names of the arrays themselves.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engine.indirect._cell_kernels import Table
from engine.indirect._second_kernels import Records
from engine.indirect.gather import Gathered
from engine.indirect.irradiance import CellLight
from engine.indirect.light import Footprint, IndirectLight
from engine.indirect.smoothing import Smoothing, no_smoothing

Arrays = dict[str, NDArray[np.generic]]
_RECORDS, _CELLS, _SMOOTHING = "records.", "cells.", "smoothing."
_OWN = ("rows", "seen", "footprint", "footprint_weights", "cell_seen", "direct", "cell_size")
NAMES = (
    *_OWN, *(_RECORDS + name for name in Records._fields), *(_CELLS + name for name in Table._fields),
    *(_SMOOTHING + name for name in Smoothing._fields),
)  # fmt: skip


def arrays_of(light: IndirectLight) -> Arrays:
    """The light's arrays, by `NAMES`."""
    gathered, cells = light.points.gathered, light.cells
    own = (
        gathered.rows, gathered.seen, *light.footprint, light.light.seen, light.light.direct,
        np.array([cells.size]),
    )  # fmt: skip
    smoothing = light.points.smoothing or no_smoothing(len(gathered.rows))
    return dict(zip(NAMES, (*own, *gathered.records, *cells.table(), *smoothing), strict=True))


def arrays_of_gathered(gathered: Gathered) -> Arrays:
    """What `gathered_of` reads."""
    records = {_RECORDS + name: array for name, array in zip(Records._fields, gathered.records, strict=True)}
    return {"rows": gathered.rows, "seen": gathered.seen, **records}


def arrays_of_table(table: Table) -> Arrays:
    """What `table_of` reads."""
    return {_CELLS + name: array for name, array in zip(Table._fields, table, strict=True)}


def gathered_of(arrays: Mapping[str, NDArray[np.generic]]) -> Gathered:
    """The gather points among the arrays, as copies: kernels are compiled for arrays that can be written."""
    records = Records(*(np.array(arrays[_RECORDS + name]) for name in Records._fields))
    return Gathered(np.array(arrays["rows"]), np.array(arrays["seen"]), records)


def footprint_of(arrays: Mapping[str, NDArray[np.generic]]) -> Footprint:
    return np.array(arrays["footprint"]), np.array(arrays["footprint_weights"])


def smoothing_of(arrays: Mapping[str, NDArray[np.generic]]) -> Smoothing:
    return Smoothing(*(np.array(arrays[_SMOOTHING + name]) for name in Smoothing._fields))


def table_of(arrays: Mapping[str, NDArray[np.generic]]) -> Table:
    """The cells as `Cells.table` gave them."""
    return Table(*(np.array(arrays[_CELLS + name]) for name in Table._fields))


def cell_light_of(arrays: Mapping[str, NDArray[np.generic]], objects: NDArray[np.int32]) -> CellLight:
    return CellLight(objects, np.array(arrays["cell_seen"]), np.array(arrays["direct"]))
