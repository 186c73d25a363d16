"""The figures of painted highlights, of a small picture."""

from pathlib import Path

import pytest

from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from benchmarks.figures import SPECS
from benchmarks.inverse import NAMES, InverseEffort, inverse_figures

pytestmark = pytest.mark.gl


def test_strokes_are_timed_and_curves_found(tmp_path: Path) -> None:
    def in_process() -> InProcessClient:
        return InProcessClient(RequestDispatcher(ArrayCache(tmp_path)))

    figures = {each.name: each for each in inverse_figures(InverseEffort(64, 48, 1), lambda line: None, in_process)}
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert len(figures["inverse_ms"].samples) == 3 and min(figures["inverse_ms"].samples) > 0.0
    assert "64 bands" in figures["inverse_ms"].how
    assert 0.0 < figures["inverse_curve_error"].parts["linear"] < 0.1


def test_a_quick_run_leaves_them_out() -> None:
    assert [figure.name for figure in inverse_figures(None, lambda line: None)] == list(NAMES)
