"""Where samples lie: the packed order, its inverse and the addresses agree."""

import numpy as np
import pytest

from ui.modes.placement.gl.transport import (
    SAMPLES_PER_ROW,
    pack_samples,
    row_count,
    sample_addresses,
    unpack_samples,
)


@pytest.mark.parametrize(
    ("n_samples", "rows"), [(0, 3), (1, 3), (1024, 3), (3072, 3), (3073, 5), (4096, 5), (5000, 5), (5121, 6)]
)
def test_unpacking_undoes_packing(n_samples: int, rows: int) -> None:
    values = np.arange(3 * n_samples, dtype=np.float32).reshape(n_samples, 3)
    texels = pack_samples(values, 4)
    # Rows of 1,024 samples, as many as are needed but no power of two. Padding is 0 and the fourth component too.
    assert texels.shape == (rows, 1024, 4) and row_count(n_samples) == rows
    np.testing.assert_array_equal(unpack_samples(texels, n_samples)[:, :3], values)
    assert texels.sum() == values.sum()


def test_addresses_point_at_the_packed_samples() -> None:
    values = np.arange(1, 3001, dtype=np.float32)[:, None]
    flat = pack_samples(values, 1).ravel()
    np.testing.assert_array_equal(flat[sample_addresses(np.arange(3000))], values[:, 0])


def test_a_known_address() -> None:
    # Sample 1024 + 8*5 + 3: row 1, group 5, lane 3, so column 3*128 + 5.
    assert sample_addresses(np.array([1024 + 43])) == [SAMPLES_PER_ROW + 389]
