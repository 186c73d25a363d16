"""Pictures of two checkouts are compared by their bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.stills.stills import write_picture
from benchmarks.compare_checkouts import built_in_scenes, compare

ROOT = Path(__file__).resolve().parents[2]
PICTURE = np.linspace(0.1, 1.0, 4 * 3 * 3, dtype=np.float32).reshape(4, 3, 3)


@pytest.mark.parametrize(
    ("value", "n_different"), [(PICTURE[2, 1, 0], 0), (np.nextafter(PICTURE[2, 1, 0], np.float32(2.0)), 1)]
)
def test_a_single_bit_is_a_difference(tmp_path: Path, value: np.float32, n_different: int) -> None:
    changed = PICTURE.copy()
    changed[2, 1, 0] = value
    write_picture(tmp_path / "old.exr", PICTURE)
    write_picture(tmp_path / "new.exr", changed)
    found = compare("a", tmp_path / "old.exr", tmp_path / "new.exr")
    assert (found.n_different, found.n_pixels, found.same) == (n_different, 12, n_different == 0)
    assert (found.largest == 0.0) == found.same


def test_pictures_of_two_sizes_differ_everywhere(tmp_path: Path) -> None:
    write_picture(tmp_path / "old.exr", PICTURE)
    write_picture(tmp_path / "new.exr", PICTURE[:2])
    assert compare("a", tmp_path / "old.exr", tmp_path / "new.exr").n_different == 12


def test_all_built_in_scenes_are_compared() -> None:
    assert {"teatray", "ring", "cornell"} <= set(built_in_scenes(ROOT))
