"""The figures of moved objects and lamps, of a small picture."""

import pytest

from benchmarks.figures import SPECS
from benchmarks.moves import NAMES, OTHER_EDITS, MoveEffort, move_figures
from tests.quick_indirect import light_quickly

pytestmark = pytest.mark.gl


def test_the_first_pictures_after_moves_are_near_the_exact_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    light_quickly(monkeypatch)
    figures = {each.name: each for each in move_figures(MoveEffort(40, 120, 2, 2), lambda line: None)}
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert len(figures["light_drag_first_ms"].samples) == 1 and len(figures["move_first_s"].samples) == 2
    direct, whole = (figures[name].parts["a sun"] for name in NAMES[:2])
    assert 0.0 < direct < 1e3 * whole  # light between surfaces comes after direct light
    assert max(figures["light_drag_exact_s"].samples) > 0.001 * max(figures["light_drag_first_ms"].samples)
    parts = figures["move_first_s"].parts
    assert all(parts[name] > 0.0 and parts[f"{name}, processor"] > 0.0 for name in OTHER_EDITS)
    assert 0.0 < parts["error"] < 0.1 and parts["error of a lamp"] < 0.1


@pytest.mark.parametrize("name", NAMES)
def test_a_quick_run_leaves_them_out(name: str) -> None:
    assert name in [figure.name for figure in move_figures(None, lambda line: None)]
