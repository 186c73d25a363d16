"""The cache saves time and never does anything else: what is wrong with it is a miss and a note."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.worker.cache import ArrayCache, cache_folder, content_key
from tests.app.limits import largest_file, small_disk


def arrays(value: float, n: int = 4096) -> dict[str, np.ndarray]:
    return {"transport": np.full((n, 3), value, np.float32), "norms": np.arange(7.0)}


def only_file(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def test_what_was_put_comes_back_read_only_and_for_good(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path)
    assert store.get("k", dict) is None
    assert store.put("k", arrays(2.0))
    found = ArrayCache(tmp_path).get("k", dict)
    assert found is not None
    assert not found["transport"].flags.writeable
    np.testing.assert_array_equal(found["transport"], arrays(2.0)["transport"])
    np.testing.assert_array_equal(found["norms"], np.arange(7.0))
    assert store.take_notes() == ()
    entry = next(tmp_path.iterdir())
    entry.write_bytes(bytes(entry.stat().st_size))  # another program at work on the files that are open here
    os.truncate(entry, 10)
    assert found["transport"].sum() == 4096 * 3 * 2.0
    store.clear()
    assert store.get("k", dict) is None
    assert found["transport"].sum() == 4096 * 3 * 2.0


def test_second_put_replaces_the_first(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path)
    store.put("k", arrays(1.0))
    store.put("k", arrays(2.0))
    found = store.get("k", dict)
    assert found is not None
    assert found["transport"][0, 0] == 2.0
    assert len(list(tmp_path.iterdir())) == 1


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size - 64)


def empty(path: Path) -> None:
    os.truncate(path, 0)


def flip_in_header(path: Path) -> None:
    flip(path, 40)


def flip_in_data(path: Path) -> None:
    flip(path, 20_000)


def other_version(path: Path) -> None:
    flip(path, 8)


def append(path: Path) -> None:
    path.write_bytes(path.read_bytes() + bytes(64))


def junk(path: Path) -> None:
    path.write_bytes(os.urandom(5000))


def flip(path: Path, place: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 16
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [truncate, empty, flip_in_header, flip_in_data, other_version, append, junk])
def test_damaged_entry_is_a_miss_a_note_and_gone(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    store = ArrayCache(tmp_path)
    store.put("k", arrays(2.0))
    damage(only_file(tmp_path))
    assert store.get("k", dict) is None
    (note,) = store.take_notes()
    assert note == f"part of the cache in {tmp_path} was damaged and is computed again"
    assert list(tmp_path.iterdir()) == []
    assert store.put("k", arrays(2.0))
    assert store.get("k", dict) is not None


def test_entry_under_a_wrong_hash_is_a_miss(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path)
    store.put("k", arrays(2.0))
    only_file(tmp_path).rename(tmp_path / "other.arrays")
    assert store.get("other", dict) is None
    assert "was damaged" in store.take_notes()[0]


def test_entry_that_cannot_be_read_now_is_a_miss_and_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = ArrayCache(tmp_path)
    store.put("k", arrays(2.0))

    def failing(*_: object, **__: object) -> None:
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr("os.fstat", failing)
        assert store.get("k", dict) is None
    assert "cannot be read (Input/output error)" in store.take_notes()[0]
    assert store.get("k", dict) is not None


def test_full_disk_is_a_note_and_the_old_entry_stays(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1 << 20) as folder:
        store = ArrayCache(folder)
        assert store.put("a", arrays(1.0))
        assert not store.put("a", arrays(2.0, n=200_000))
        assert not store.put("b", arrays(2.0, n=200_000))
        assert len(store.take_notes()) == 1  # said once
        found = store.get("a", dict)
        assert found is not None
        assert found["transport"][0, 0] == 1.0
        assert os.listdir(folder) == ["a.arrays"]


def test_limit_on_file_size_is_a_note(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path)
    with largest_file(1 << 15):
        assert not store.put("a", arrays(1.0))
    (note,) = store.take_notes()
    assert "cannot be written (File too large); results stay in memory only" in note
    assert list(tmp_path.iterdir()) == []


def test_folder_that_cannot_be_made_is_a_note(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    store = ArrayCache(tmp_path / "file" / "cache")
    assert store.get("a", dict) is None
    assert not store.put("a", arrays(1.0))
    assert "cannot be written (Not a directory)" in store.take_notes()[-1]
    with store.open_tiles("a", 2) as tiles:
        assert not tiles.append_tile(0, arrays(1.0))
        assert tiles.complete_tiles == frozenset()


def test_least_recently_used_entries_go(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path, bound=170_000)  # a, b, c take about 50,000 bytes each, d 100,000
    for age, key in enumerate("abc"):
        store.put(key, arrays(1.0))
        os.utime(tmp_path / f"{key}.arrays", (1000 + age, 1000 + age))
    assert store.get("a", dict) is not None  # used now
    store.put("d", arrays(1.0, n=8192))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.arrays", "d.arrays"]  # b and c were older
    assert store.size() <= 170_000


def test_entry_larger_than_the_bound_is_not_kept(tmp_path: Path) -> None:
    store = ArrayCache(tmp_path, bound=10_000)
    assert not store.put("a", arrays(1.0))
    assert "may hold 0 MiB, too few for all of this" in store.take_notes()[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("key", ["", "../a", "a/b", "a.b", "x" * 121])
def test_keys_stay_in_the_folder(tmp_path: Path, key: str) -> None:
    with pytest.raises(ValueError, match="expected 1 to 120"):
        ArrayCache(tmp_path).get(key, dict)


# Killed while it puts entry after entry; each value of `v` is one number throughout, so half an entry would show.
KILL_LOOP = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
from app.worker.cache import ArrayCache
folder = Path(sys.argv[1])
random.seed(3)
for kill in range(int(sys.argv[2])):
    pid = os.fork()
    if not pid:
        store = ArrayCache(folder)
        for k in range(1000):
            store.put("k", {"v": np.full(50_000, kill + k)})
        os._exit(0)
    time.sleep(random.uniform(0, 0.01))
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    store = ArrayCache(folder)
    found = store.get("k", dict)
    notes = store.take_notes()
    if notes or (found is not None and np.ptp(found["v"])):
        sys.exit(f"after kill {kill}: {notes}")
    if len(os.listdir(folder)) > 1:
        sys.exit(f"after kill {kill}: {os.listdir(folder)}")
"""


@pytest.mark.parametrize("n_kills", [20, pytest.param(250, marks=pytest.mark.sweep)])
def test_writer_killed_at_random_moments_leaves_whole_entries_and_no_litter(tmp_path: Path, n_kills: int) -> None:
    command = [sys.executable, "-c", KILL_LOOP, str(tmp_path), str(n_kills)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.delenv("INSITU_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    if sys.platform == "linux":
        assert cache_folder() == tmp_path / "xdg" / "insitu"


def test_content_keys_tell_all_parts_apart() -> None:
    """Values that look alike when written one after the other: types, borders, shapes, signs of zero."""
    parts = [
        (),
        ("ab", "c"),
        ("a", "bc"),
        ("abc",),
        (("abc",),),
        (b"abc",),
        (1,),
        (1.0,),
        (True,),
        ("1",),
        (None,),
        (0.0,),
        (-0.0,),
        (np.array([1, 2], np.int32),),
        (np.array([1, 2], np.int64),),
        (np.array([[1, 2]], np.int32),),
        (np.array([2, 1], np.int32),),
    ]
    keys = [content_key(*part) for part in parts]
    assert len(set(keys)) == len(parts)
    assert keys == [content_key(*part) for part in parts]
    with pytest.raises(TypeError, match="dict in a cache key"):
        content_key({})  # type: ignore[arg-type]
