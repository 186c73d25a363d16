"""Records of arrays, and files of tiles: what is written reads back, and what is damaged is found."""

import io
import json
import os
import signal
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from app.worker.array_files import RecordError, read_record, record_size, write_record
from app.worker.cache import ArrayCache
from engine.core.stored_arrays import UnsoundArrays
from tests.app.limits import largest_file

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


def tile(index: int) -> dict[str, np.ndarray]:
    return {"visibility": np.full(3000, index, np.uint64)}


def fill(store: ArrayCache, n: int, key: str = "k") -> Path:
    with store.open_tiles(key, 8) as tiles:
        assert all(tiles.append_tile(index, tile(index)) for index in range(n))
    return next(path for path in store._folder.iterdir() if path.suffix == ".tiles")


def test_tiles_of_an_earlier_run_are_there(tmp_path: Path) -> None:
    fill(ArrayCache(tmp_path), 3)
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0, 1, 2}
        assert all(tiles.tile(index, dict)["visibility"][0] == index for index in range(3))
        assert tiles.tile(3, dict) is None
        assert tiles.append_tile(5, tile(5))
        assert tiles.complete_tiles == {0, 1, 2, 5}
        assert tiles.tile(5, dict)["visibility"][-1] == 5
        tiles.finish()
    assert list(tmp_path.iterdir()) == []


def test_tile_may_be_written_again(tmp_path: Path) -> None:
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        tiles.append_tile(0, tile(1))
        tiles.append_tile(0, tile(2))
        assert tiles.tile(0, dict)["visibility"][0] == 2
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.tile(0, dict)["visibility"][0] == 2


@pytest.mark.parametrize("cut", [1, 100, 20_000])
def test_half_a_tile_at_the_end_is_cut_off(tmp_path: Path, cut: int) -> None:
    path = fill(ArrayCache(tmp_path), 3)
    os.truncate(path, path.stat().st_size - cut)
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0, 1}
        assert tiles.append_tile(2, tile(2))
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0, 1, 2}


def test_damaged_tile_and_all_after_it_are_computed_again(tmp_path: Path) -> None:
    path = fill(ArrayCache(tmp_path), 3)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1  # in the second of three tiles
    path.write_bytes(data)
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0}


def test_tile_damaged_while_open_is_refused(tmp_path: Path) -> None:
    path = fill(ArrayCache(tmp_path), 1)
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        with open(path, "r+b") as file:
            file.seek(10_000)
            file.write(b"damage")
        assert tiles.tile(0, dict) is None


def test_tiles_of_another_division_do_not_count(tmp_path: Path) -> None:
    fill(ArrayCache(tmp_path), 3)
    with ArrayCache(tmp_path).open_tiles("k", 9) as tiles:
        assert tiles.complete_tiles == frozenset()


def test_tiles_under_a_wrong_name_do_not_count(tmp_path: Path) -> None:
    fill(ArrayCache(tmp_path), 3).rename(tmp_path / "other.tiles")
    with ArrayCache(tmp_path).open_tiles("other", 8) as tiles:
        assert tiles.complete_tiles == frozenset()


def test_full_disk_keeps_the_tiles_before(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path)
    with store.open_tiles("k", 8) as tiles:
        assert tiles.append_tile(0, tile(0))
        with largest_file(40_000):
            assert not tiles.append_tile(1, tile(1))
        assert not tiles.append_tile(2, tile(2))  # said once, not tried for each tile
        assert tiles.complete_tiles == {0}
        assert tiles.tile(0, dict)["visibility"][0] == 0
    assert len(store.take_notes()) == 1
    with store.open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0}


def test_second_process_computes_without(tmp_path: Path) -> None:
    first, second = ArrayCache(tmp_path), ArrayCache(tmp_path)
    with first.open_tiles("k", 8) as mine:
        mine.append_tile(0, tile(0))
        with second.open_tiles("k", 8) as theirs:
            assert theirs.complete_tiles == frozenset()
            assert not theirs.append_tile(1, tile(1))
        assert mine.append_tile(1, tile(1))
        assert mine.complete_tiles == {0, 1}
    assert "another Insitu" in second.take_notes()[0]


def test_index_outside_is_refused(tmp_path: Path) -> None:
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles, pytest.raises(IndexError, match="tile 8, expected 0 to 7"):
        tiles.append_tile(8, tile(8))


WRITER = """
import sys
from pathlib import Path
import numpy as np
from app.worker.array_files import write_record
from app.worker.cache import ArrayCache
from engine.core.stored_arrays import UnsoundArrays
tiles = ArrayCache(Path(sys.argv[1])).open_tiles("k", 8)
for index in range(8):
    if index == 5:
        print("five", flush=True)
    tiles.append_tile(index, {"visibility": np.full(3000 if index < 5 else 10_000_000, index, np.uint64)})
"""


def test_killed_writer_leaves_its_complete_tiles(tmp_path: Path) -> None:
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE)
    with writer:
        assert writer.stdout is not None
        writer.stdout.readline()  # now it is within the sixth tile, of 80 MB
        writer.send_signal(signal.SIGKILL)
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0, 1, 2, 3, 4}
        assert tiles.tile(4, dict)["visibility"].sum() == 3000 * 4


@pytest.mark.parametrize(
    "label",
    ["", "k", "[", "null", '["k", 8, 8]', '["k", 8, -1]', '["k", 8, 1.0]', '["k", 8, true]', '["k", 8]', '["k", 9, 0]',
     '{"k": 8}', "[" * 100_000],
)  # fmt: skip
def test_a_forged_label_ends_the_tiles(tmp_path: Path, label: str) -> None:
    path = fill(ArrayCache(tmp_path), 2)
    with open(path, "ab") as file:
        write_record(file, label, tile(2))
    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        assert tiles.complete_tiles == {0, 1}


def test_a_tile_that_is_not_what_was_needed_is_none(tmp_path: Path) -> None:
    def refuse(arrays: object) -> None:
        raise UnsoundArrays("another shape")

    with ArrayCache(tmp_path).open_tiles("k", 8) as tiles:
        tiles.append_tile(0, tile(0))
        assert tiles.tile(0, refuse) is None and tiles.tile(0, dict) is not None
