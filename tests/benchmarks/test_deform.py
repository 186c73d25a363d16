"""Deform's figures on a small mesh: all are told, and lobes that turn are nearer to rays than transfer that stays."""

from __future__ import annotations

from benchmarks.deform import NAMES, DeformEffort, deform_figures
from benchmarks.figures import SPECS

TINY = DeformEffort(24, 14, 64, 20, 40, 2, (48, 36))


def test_a_bent_mesh_is_nearer_to_the_truth_than_one_that_is_not_turned() -> None:
    found = deform_figures(TINY, lambda line: None)
    figures = {figure.name: figure.value for figure in found}
    (on_card,) = [figure.how for figure in found if figure.name == "deform_fps_gpu"]
    assert "no graphics card with OpenGL 4.3" in on_card  # llvmpipe draws the tests
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert [name for name, value in figures.items() if value is None] == ["deform_fps_gpu"]
    assert 0.0 < 2.0 * figures["deform_error_bent"] < figures["deform_error_undeformed"]


def test_a_quick_run_leaves_them_out() -> None:
    assert {figure.name for figure in deform_figures(None, lambda line: None)} == set(NAMES)
