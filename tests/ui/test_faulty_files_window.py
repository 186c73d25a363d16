"""In the real window: what is said of files that are damaged or cannot be written, and that it goes on."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.app.limits import small_disk
from tests.ui.real_window import RealWindow, opened

pytestmark = pytest.mark.window


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("faulty")
    (folder / "state" / "journals").mkdir(parents=True)
    (folder / "state" / "journals" / "1-1-0.insitu").write_text("version = 1\nscene = ")
    return folder


@pytest.fixture(scope="module")
def real(folder: Path) -> Iterator[RealWindow]:
    with opened(folder) as window:
        yield window


def test_a_damaged_journal_is_reported_at_the_start_and_kept(real: RealWindow, folder: Path) -> None:
    kept = folder / "state" / "journals" / "1-1-0.damaged"
    real.wait_until("'edits that were not saved cannot be read' in editor.status.message")
    assert real.notice().endswith(f"the file is kept as {kept}") and kept.exists()


def test_a_picture_of_the_window_that_cannot_be_written_leaves_nothing(real: RealWindow, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1 << 16) as disk:
        (disk / "filling").write_bytes(bytes(os.statvfs(disk).f_bavail * 4096))
        before = real.ask("__import__('os').getcwd()")
        real.do(f"import os; os.chdir({str(disk)!r})")
        real.key("shift+f12")
        real.wait_until("'not written' in state.message.text")
        real.do(f"import os; os.chdir({before!r})")
        assert real.notice().startswith(f"{disk}/")
        assert real.notice().endswith(".png: not written, No space left on device; what was there is untouched")
        assert os.listdir(disk) == ["filling"]
    real.drag("curve.magnitude", by=(0, -40))
    assert real.n_steps() == 1
