"""The figures of matched pictures: measured of one case, left out of a quick run."""

from __future__ import annotations

from benchmarks.photos import CASES, FOLDER, NAMES, PhotoEffort, photo_figures


def test_a_metal_is_found_from_another_programs_picture() -> None:
    figures = {each.name: each for each in photo_figures(PhotoEffort(("ggx",)), lambda line: None)}
    assert list(figures) == list(NAMES)
    for figure in figures.values():
        assert list(figure.parts) == ["ggx", "ggx, 8 bits"]
        assert 0.0 < max(figure.samples) < 0.05


def test_a_quick_run_leaves_them_out() -> None:
    assert [figure.name for figure in photo_figures(None, lambda line: None)] == list(NAMES)


def test_every_case_has_its_pictures() -> None:
    for name, case in CASES.items():
        assert (FOLDER / f"{name}.exr").is_file()
        assert (FOLDER / f"{case.elsewhere or name}_elsewhere.exr").is_file()
