"""A slice of `make fuzz` in every run: two hundred damaged files of each kind; and that what goes wrong is noticed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz.child import Source
from tests.fuzz.formats import FORMATS
from tests.fuzz.run import Readers

COUNT, SEED = 200, 1


@pytest.fixture(scope="module")
def readers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Readers]:
    """For all formats: what they import, they import once."""
    readers = Readers(tmp_path_factory.mktemp("fuzz"), SEED)
    yield readers
    readers.close()


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_read_or_are_refused(readers: Readers, name: str) -> None:
    count = max(1, round(COUNT * FORMATS[name].share))
    found = readers.read(name, 0, count)
    assert found.failures == {} and found.n_files == count


def test_a_number_is_the_same_file_again(tmp_path: Path) -> None:
    one, two = (Source("session", 5, tmp_path / name) for name in ("one", "two"))
    files = [one.file(number) for number in range(20)]
    assert [two.file(number) for number in range(20)] == files and len(set(files)) == 20


# A format whose reader does what none should; which of it, the damaged file decides.
FAULTY = """
import os, zlib
from engine.core.errors import InsituError
from tests.fuzz import child
from tests.fuzz.formats import FORMATS, Format

child.BASE_SECONDS, child.WARM, child.GROWTH = 0.1, 1, 1 << 22
kept, seed = [], bytes(range(64))

def read(path):
    data = path.read_bytes()
    what = zlib.crc32(data) % 32 if data != seed else 9
    if what == 0:
        raise KeyError("a defect")
    if what == 1:
        while True:
            pass
    if what == 2:
        os.abort()
    if what < 9:
        raise InsituError("a line")
    kept.append(b"x" * (1 << 20))

FORMATS["faulty"] = Format("a", lambda folder: [seed], read)
child.main()
"""


def test_what_goes_wrong_is_told(tmp_path: Path) -> None:
    faulty = Readers(tmp_path, SEED, (sys.executable, "-c", FAULTY))
    found = faulty.read("faulty", 0, 100)
    faulty.close()
    said = " ".join(found.failures.values())
    for what in ("KeyError: 'a defect'", "0.1 s of processor time", "SIGABRT", "memory has grown by"):
        assert what in said
    assert found.n_files == 100
