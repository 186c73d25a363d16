"""How often the solver begins anew where there are too many cells: seldom, whatever they have that makes them so."""

import pytest

from engine.precompute.indirect.irradiance_cache import MAX_RECORDS
from engine.precompute.indirect.solver import RECORDS_BY_SETS, CellSizeTry, growth


def beginnings(power: float, too_many: float, n_fans: float = 50_000.0) -> tuple[int, float]:
    """How many tries there are where cells of size 1 would be so many times too many, C n^0.4 s^-power; and the share
    of the cells that there may be in the last."""
    size, tries = 1.0, list[CellSizeTry]()
    while (cells := too_many * size**-power) > 1.0:
        # The table is full after so many fans: the part under way is given up, and half of it counted.
        full_after = n_fans * cells ** (-1.0 / RECORDS_BY_SETS)
        tries.append(CellSizeTry(size, max(int(full_after), 2048)))
        size *= growth(tries, n_fans)
        assert len(tries) < 20
    return len(tries) + 1, cells


@pytest.mark.parametrize("power", [0.5, 0.7, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("too_many", [1.1, 1.6, 2.5])
def test_four_times_at_most(power: float, too_many: float) -> None:
    """Growing by what a plain surface would need each time, it were seven and more where the power is 0.5."""
    n_tries, share = beginnings(power, too_many)
    assert n_tries <= 4
    assert share > 0.35  # and cells are not made much larger than need be


def test_a_plain_surface_is_found_at_once() -> None:
    assert beginnings(2.0, 2.5)[0] == 2


def test_never_by_less_than_a_quarter() -> None:
    assert growth([CellSizeTry(1.0, 50_000)], 50_000.0) == pytest.approx(1.26)
    assert MAX_RECORDS < 1 << 16
