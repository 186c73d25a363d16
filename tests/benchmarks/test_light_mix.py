"""The figures of a mix of lights, of a small picture."""

import pytest

from benchmarks.figures import SPECS
from benchmarks.light_mix import NAMES, MixEffort, mix_figures

pytestmark = pytest.mark.gl


def test_a_mix_is_near_its_own_transport() -> None:
    figures = {each.name: each for each in mix_figures(MixEffort((32, 24), 240, 32, 2), lambda line: None)}
    assert set(figures) == set(NAMES) <= SPECS.keys()
    assert len(figures["mix_ms_8"].samples) == len(figures["mix_ms_64"].samples) == 2
    assert set(figures["mix_error"].parts) >= {"sky x 10", "lamp 0 alone"}
    assert 0.0 < max(figures["mix_error"].samples) < 0.05


@pytest.mark.parametrize("name", NAMES)
def test_a_quick_run_leaves_them_out(name: str) -> None:
    assert name in [figure.name for figure in mix_figures(None, lambda line: None)]
