"""Arrays on disk come back as they were, or are refused."""

import io
import json
import struct
import zlib

import numpy as np
import pytest

from app.worker.array_files import RecordError, read_record, record_size, write_record

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


FIXED = struct.Struct("<8sIIQI")


def forged(data: bytes, header: bytes, size: int | None = None) -> bytes:
    """The record with another header, under its correct checksum; the arrays stay where they are."""
    magic, version, json_size, old_size, _ = FIXED.unpack_from(data)
    start, new_start = (-(-(FIXED.size + length) // 64) * 64 for length in (json_size, len(header)))
    size = old_size - start + new_start if size is None else size
    numbers = FIXED.pack(magic, version, len(header), size, 0)
    fixed = FIXED.pack(magic, version, len(header), size, zlib.crc32(header, zlib.crc32(numbers)))
    return (fixed + header).ljust(new_start, b"\0") + data[start:]


def header_of(data: bytes) -> dict:
    return json.loads(data[FIXED.size : FIXED.size + FIXED.unpack_from(data)[2]])


def test_a_header_made_by_our_own_rules_reads() -> None:
    """What the tests below change is all that is wrong with their records."""
    data = record_of()
    assert read_record(memoryview(forged(data, json.dumps(header_of(data)).encode()))).arrays.keys() == ARRAYS.keys()


ODD = [None, True, -1, 0, 3, 2**31, 2**63, 10**30, 1.5, "", "x", "O", "V8", "|O", "<c1", ">U4", [], [0],
       [-1, -1], [2**62, 4], [2**40, 2**40, 0], [1] * 70, [[1]], ["3"], [1.0], {}, {"a": 1}, "ffffffffff",
       "0x12", "-1234567"]  # fmt: skip


@pytest.mark.parametrize("field", range(5), ids=["name", "dtype", "shape", "offset", "checksum"])
@pytest.mark.parametrize("value", ODD, ids=repr)
def test_a_forged_array_is_refused(field: int, value: object) -> None:
    data = record_of()
    for number in range(len(ARRAYS)):
        header = header_of(data)
        row = header["arrays"][number]
        if row[field] == value or (field == 0 and isinstance(value, str)) or (field < 3 and row[0] == "empty"):
            continue  # any name will do, and no bytes are no bytes
        header["arrays"][number][field] = value
        with pytest.raises(RecordError):
            read_record(memoryview(forged(data, json.dumps(header).encode())))


@pytest.mark.parametrize(
    "header",
    [b"", b"{", b"\xff\xfe", b"null", b"3", b"[]", b"{}", b'"label"', b"[" * 100_000, b"9" * 5_000,
     b'{"label": "key"}', b'{"arrays": []}', b'{"label": 3, "arrays": []}', b'{"label": "key", "arrays": {}}',
     b'{"label": "key", "arrays": [3]}', b'{"label": "key", "arrays": [[]]}', b'{"label": "key", "arrays": []}',
     b'{"label": "key", "arrays": [[1,2,3,4,5,6]]}'],
)  # fmt: skip
def test_a_header_that_is_not_ours_is_refused(header: bytes) -> None:
    with pytest.raises(RecordError):
        read_record(memoryview(forged(record_of(), header)))


def test_arrays_missing_twice_or_in_another_order_are_refused() -> None:
    data = record_of()
    rows = header_of(data)["arrays"]
    for changed in (rows[1:], rows[:-1], rows[::-1], [*rows, rows[0]], [rows[0], *rows]):
        with pytest.raises(RecordError):
            read_record(memoryview(forged(data, json.dumps({"label": "key", "arrays": changed}).encode())))


@pytest.mark.parametrize("size", [0, 1, 64, 2**40, 2**64 - 1])
def test_a_forged_size_is_refused(size: int) -> None:
    data = record_of()
    with pytest.raises(RecordError):
        read_record(memoryview(forged(data, json.dumps(header_of(data)).encode(), size)))
