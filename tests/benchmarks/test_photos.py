"""The figures of matched pictures: each case by another program's pictures within the aims, left out of a quick run."""

from __future__ import annotations

import pytest

from benchmarks.figures import SPECS
from benchmarks.photos import CASES, FOLDER, NAMES, PhotoEffort, photo_figures


@pytest.mark.parametrize("name", CASES)
def test_a_material_is_found_from_another_programs_picture(name: str) -> None:
    figures = photo_figures(PhotoEffort((name,)), lambda line: None)
    assert [each.name for each in figures] == list(NAMES)
    for figure in figures:
        assert list(figure.parts) == [name, f"{name}, 8 bits"]
        assert 0.0 < max(figure.samples) < (SPECS[figure.name].limit or 0.0)


def test_a_quick_run_leaves_them_out() -> None:
    assert [figure.name for figure in photo_figures(None, lambda line: None)] == list(NAMES)


def test_every_case_has_its_pictures() -> None:
    for name, case in CASES.items():
        assert (FOLDER / f"{name}.exr").is_file()
        assert (FOLDER / f"{case.elsewhere or name}_elsewhere.exr").is_file()
