"""Files that other programs write are noticed, once they are whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.system.file_watch import FileStamp, FileWatch, file_stamp


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_file_counts_once_two_looks_agree(tmp_path: Path) -> None:
    file, watch = written(tmp_path / "a.ply", "one"), FileWatch()
    watch.watch({str(file): file_stamp(file)})
    watch.look()
    assert watch.changed == ()
    written(file, "more")
    watch.look()
    assert watch.changed == ()  # it may still be written
    watch.look()
    assert watch.changed == (str(file),)


def test_a_file_that_changes_at_each_look_is_still_being_written(tmp_path: Path) -> None:
    file, watch = written(tmp_path / "a.ply", "one"), FileWatch()
    watch.watch({str(file): file_stamp(file)})
    for n in range(2, 6):
        written(file, "x" * 10 * n)
        watch.look()
        assert watch.changed == ()


def test_a_missing_file_is_nothing_to_read_until_it_is_back(tmp_path: Path) -> None:
    file, watch = written(tmp_path / "a.ply", "one"), FileWatch()
    watch.watch({str(file): file_stamp(file)})
    file.unlink()
    for _ in range(3):
        watch.look()
        assert watch.changed == ()
    written(file, "another")
    watch.look()
    watch.look()
    assert watch.changed == (str(file),)


def test_what_this_program_writes_does_not_count(tmp_path: Path) -> None:
    file, watch = written(tmp_path / "a.insitu", "one"), FileWatch()
    watch.watch({})
    watch.add([file, tmp_path / "never there"])
    watch.look()
    written(file, "saved here")
    watch.forget(file)
    for _ in range(3):
        watch.look()
        assert watch.changed == ()
    watch.watch({})
    written(file, "of no interest now")
    watch.look()
    watch.look()
    assert watch.changed == ()


def test_a_file_that_is_saved_here_during_a_look_does_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, watch = written(tmp_path / "a.insitu", "one"), FileWatch()
    watch.watch({str(file): file_stamp(file)})

    def seen_before_it_is_saved(name: str) -> FileStamp:
        stamp = file_stamp(name)
        written(file, "saved here")
        watch.forget(file)
        return stamp

    with monkeypatch.context() as during:
        during.setattr("app.system.file_watch.file_stamp", seen_before_it_is_saved)
        watch.look()
    for _ in range(3):
        watch.look()
        assert watch.changed == ()


def test_the_thread_ends(tmp_path: Path) -> None:
    watch = FileWatch()
    watch.start()
    watch.close()
    assert watch._thread is not None and not watch._thread.is_alive()
    FileWatch().close()  # one that was never started
