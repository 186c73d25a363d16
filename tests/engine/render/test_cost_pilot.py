"""The predicted cost of indirect light: numbers of points and records, and tries with too many cells."""

from __future__ import annotations

from dataclasses import replace

import pytest

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect.irradiance_cache import MAX_RECORDS
from engine.precompute.indirect.solver import Solver
from engine.render.cost_pilot import NO_WASTE, expected_waste, indirect_cost
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of

ASKING = replace(QUICK, n_rays=512, n_samples=64)


@pytest.mark.parametrize("other_light", [None, 0.0, 1e3])
def test_a_trial_foresees_points_cells_and_rays(other_light: float | None) -> None:
    """Whether nobody asks how many rays are needed, all are or the fewest."""
    placement, sky = placement_of(CORNER, n=160, **CORNER_VIEW), SkyState(constant_environment((1.0, 0.8, 0.6)))
    models, layers = {i: ["lambert"] for i in range(3)}, [matt(0, 0.7), matt(1, 0.5), matt(2, 0.3)]
    cost = run_to_end(indirect_cost(placement, models, sky, 3, layers, ASKING, other_light))
    found = run_to_end(Solver(placement, models, sky, 3, ASKING, True, other_light).solve(layers))
    assert cost.ray_budget is not None and cost.ray_budget.n_rays == found.ray_budget.n_rays
    assert cost.n_points == pytest.approx(len(found.points.samples.points), rel=0.25)
    assert cost.n_records == pytest.approx(len(found.cache), rel=0.4)


def test_nothing_is_lost_where_there_are_no_more_cells_than_there_may_be() -> None:
    assert expected_waste(0.99 * MAX_RECORDS, 10_000, 1000, 2.0) == NO_WASTE


def test_on_plain_surfaces_one_try_is_lost() -> None:
    """Twice too many: there is room for (1/2)^(1 / 0.4) = 0.18 of the fans, then cells are large enough."""
    lost = expected_waste(2.0 * MAX_RECORDS, 100_000, 100_000, 2.0)
    assert lost.n_tries == 1 and lost.sets == pytest.approx(0.5**2.5)


def test_no_more_is_lost_than_a_first_look() -> None:
    lost = expected_waste(2.0 * MAX_RECORDS, 100_000, 5_000, 2.0)
    assert lost.n_tries == 1 and lost.sets == pytest.approx(0.05)


def test_beside_polished_metal_several_are() -> None:
    """Where cells hardly become fewer the second try gets further than the first, and is lost as well."""
    plain, polished = (expected_waste(1.3 * MAX_RECORDS, 8_000, 8_000, power) for power in (2.0, 0.5))
    assert polished.n_tries > plain.n_tries >= 1 and polished.sets > 1.0 > plain.sets


def test_an_end_is_put_to_tries_that_help_nothing() -> None:
    assert expected_waste(2.0 * MAX_RECORDS, 8_000, 8_000, -0.1).n_tries == 8
