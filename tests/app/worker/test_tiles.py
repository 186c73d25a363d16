"""An interrupted computation goes on after its last complete tile."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from app.worker.array_files import write_record
from app.worker.cache import ArrayCache
from engine.core.stored_arrays import UnsoundArrays
from tests.app.limits import largest_file


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
