"""The visibility of Orbit's points as arrays that are stored, and read again for the same geometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, Arrays
from engine.realtime.triple_product.lit_points import LitPoints
from engine.realtime.triple_product.visibility import N_UPPER, Bits, deflate_bits, inflate_bits

# Bits of the sky and of patches, and the objects whose backs have points.
StoredVisibility = tuple[Bits, Bits, list[int]]


def dump_visibility(lit: LitPoints) -> dict[str, NDArray[np.generic]]:
    """The visibility of all points, by name."""
    arrays = {
        "backs": np.array(lit.with_backs, np.int64),
        "n_points": np.array([len(lit.points)], np.int64),
    }
    return arrays | deflate_bits("bits", lit.bits) | deflate_bits("patch_bits", lit.patch_bits)


def read_visibility(arrays: Arrays, n_objects: int, n_patches: int) -> StoredVisibility:
    """The same, read again. Raises UnsoundArrays."""
    reader = ArrayReader(arrays)
    n = int(reader.take("n_points", np.int64, 1)[0])
    backs = reader.take("backs", np.int64, "backs", below=n_objects)
    bits = inflate_bits("bits", reader, n, N_UPPER // 2)
    return bits, inflate_bits("patch_bits", reader, n, (n_patches + 7) // 8), backs.tolist()
