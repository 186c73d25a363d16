"""What the solver of indirect light loses where there are too many cells, as a plan has it."""

from __future__ import annotations

import pytest

from engine.indirect.cells import MOST_CELLS
from engine.render.indirect_pilot import NOTHING_LOST, lost_tries


def test_nothing_is_lost_where_there_are_no_more_cells_than_there_may_be() -> None:
    assert lost_tries(0.99 * MOST_CELLS, 10_000, 1000, 2.0) == NOTHING_LOST


def test_on_plain_surfaces_one_try_is_lost() -> None:
    """Twice too many: there is room for (1/2)^(1 / 0.4) = 0.18 of the fans, then cells are large enough."""
    lost = lost_tries(2.0 * MOST_CELLS, 100_000, 100_000, 2.0)
    assert lost.n_tries == 1 and lost.fans == pytest.approx(0.5**2.5)


def test_no_more_is_lost_than_a_first_look() -> None:
    lost = lost_tries(2.0 * MOST_CELLS, 100_000, 5_000, 2.0)
    assert lost.n_tries == 1 and lost.fans == pytest.approx(0.05)


def test_beside_polished_metal_several_are() -> None:
    """Where cells hardly become fewer the second try gets further than the first, and is lost as well."""
    plain, polished = (lost_tries(1.3 * MOST_CELLS, 8_000, 8_000, power) for power in (2.0, 0.5))
    assert polished.n_tries > plain.n_tries >= 1 and polished.fans > 1.0 > plain.fans


def test_an_end_is_put_to_tries_that_help_nothing() -> None:
    assert lost_tries(2.0 * MOST_CELLS, 8_000, 8_000, -0.1).n_tries == 8
