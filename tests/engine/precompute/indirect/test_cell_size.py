"""How often the solver begins anew where there are too many cells: seldom, whatever they have that makes them so."""

import numpy as np
import pytest

from engine.precompute.indirect._ray_kernels import HALF, NORMAL
from engine.precompute.indirect.cell_size import RECORDS_BY_SETS, CellSizeSearch, CellSizeTry, first_cell_size, growth
from engine.precompute.indirect.direction_patterns import sample_counts
from engine.precompute.indirect.gather import gather
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS, CacheFull, IrradianceCache
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, placement_of


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


def test_a_forecast_of_too_many_records_ends_the_attempt_where_the_table_would_be_full() -> None:
    search = CellSizeSearch(1.0, lambda: 32_000.0)
    search.n_sets = 1000
    # 32 times as many sample sets find 32^0.4 = 4 times as many records.
    search.check_forecast(MAX_RECORDS // 4, 1000)
    assert search.n_sets == 1000
    with pytest.raises(CacheFull):
        search.check_forecast(MAX_RECORDS // 2, 1000)
    assert search.n_sets == round(1000 * (MAX_RECORDS / (MAX_RECORDS // 2)) ** 2.5)  # 2^(1 / 0.4) times as many


def test_cells_grow_from_one_attempt_to_the_next_by_all_that_were_tried() -> None:
    search, tries, size = CellSizeSearch(0.5, lambda: 50_000.0), list[CellSizeTry](), 0.5
    for n_sets in (10_000, 20_000, 40_000):
        search.n_sets = n_sets
        search.enlarge()
        tries.append(CellSizeTry(size, n_sets))
        size *= growth(tries, 50_000.0)
        assert search.size == size


def test_cells_are_as_small_as_the_number_of_records_allows() -> None:
    placement = placement_of(CORNER, **CORNER_VIEW)
    lobe_axes, rows = np.full(len(CORNER), NORMAL, np.int64), np.arange(len(placement.hits.pixel), dtype=np.int32)

    def n_records(size: float) -> int:
        cache = IrradianceCache(placement.scene, placement.caster, size)
        counts = sample_counts(64, HALF)
        for _ in gather(placement.hits, cache, rows, np.zeros(len(rows), np.uint8), lobe_axes, counts, focused=False):
            pass
        return len(cache)

    for most in (1200, 600, 300):
        size = first_cell_size(placement, lobe_axes, most)
        assert n_records(size) <= most / 2 < n_records(0.9 * size)
