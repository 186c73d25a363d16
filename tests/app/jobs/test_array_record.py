"""Arrays on disk come back as they were, or are refused."""

import io

import numpy as np
import pytest

from app.jobs.array_record import RecordError, read_record, record_size, write_record

ARRAYS = {
    "float": np.arange(3000, dtype=np.float64).reshape(30, 100),
    "half": np.ones((7, 11, 3), np.float16),
    "fortran": np.asfortranarray(np.arange(900, dtype=np.int32).reshape(9, 100)),
    "slice": np.arange(400).reshape(20, 20)[::2, 5:10],
    "big-endian": np.arange(20, dtype=">u4"),
    "booleans": np.arange(99) % 3 == 0,
    "empty": np.empty((0, 3), np.float32),
    "scalar": np.array(2.5 + 1j),
}


def record_of(label: str = "key") -> bytes:
    stream = io.BytesIO()
    write_record(stream, label, ARRAYS)
    return stream.getvalue()


def test_arrays_come_back() -> None:
    record = read_record(memoryview(record_of() + b"what follows"))
    assert record.label == "key"
    assert record.arrays.keys() == ARRAYS.keys()
    for name, array in record.arrays.items():
        assert array.dtype == ARRAYS[name].dtype
        assert not array.flags.writeable
        np.testing.assert_array_equal(array, ARRAYS[name])


def test_size_is_known_before_writing() -> None:
    data = record_of()
    assert len(data) == record_size(ARRAYS, "key")
    assert len(data) == read_record(memoryview(data)).n_bytes
    assert len(data) % 64 == 0  # so that the next record is aligned, too


def test_every_truncation_is_refused() -> None:
    data = record_of()
    for length in [0, 1, 27, 28, 100, 600, *range(1000, len(data), 1777), len(data) - 1]:
        with pytest.raises(RecordError):
            read_record(memoryview(data[:length]))


def test_flipped_bits_are_refused_or_harmless() -> None:
    """Only padding between arrays is not covered by a checksum; nothing else may change unnoticed."""
    data = record_of()
    rng = np.random.default_rng(5)
    n_refused = 0
    for place in [*range(0, 900, 7), *rng.integers(0, len(data), 300)]:
        damaged = bytearray(data)
        damaged[place] ^= 1 << rng.integers(8)
        try:
            record = read_record(memoryview(damaged))
        except RecordError:
            n_refused += 1
            continue
        for name, array in record.arrays.items():
            np.testing.assert_array_equal(array, ARRAYS[name])
    assert n_refused > 300


def test_record_of_another_version_is_refused() -> None:
    data = bytearray(record_of())
    data[8] += 1  # the version follows the eight bytes of the magic
    with pytest.raises(RecordError, match="not a record of this version"):
        read_record(memoryview(data))


def test_arrays_of_objects_are_refused() -> None:
    with pytest.raises(TypeError, match="'a' has dtype object"):
        write_record(io.BytesIO(), "key", {"a": np.array([{}, None])})
