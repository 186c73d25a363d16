"""The fit is no worse than the paper's, on random functions and on a mesh that shadows itself."""

import numpy as np
import pytest

from benchmarks.zonal_fit_errors import (
    PAPERS_MESH_3,
    PAPERS_RANDOM_6,
    fit_errors,
    random_vectors,
    shadowed_mesh,
)
from engine.core.generators import run_to_end


def test_random_functions_of_order_6_with_6_lobes() -> None:
    assert run_to_end(fit_errors(random_vectors(40), (6,)))[6] < PAPERS_RANDOM_6


def test_a_mesh_that_shadows_itself_with_3_lobes() -> None:
    errors = run_to_end(fit_errors(run_to_end(shadowed_mesh(250, 500)), (1, 3)))
    assert errors[3] < PAPERS_MESH_3 and errors[3] < errors[1]


def test_nothing_is_held_without_an_error() -> None:
    assert run_to_end(fit_errors(np.zeros((3, 36)), (1,))) == {1: 0.0}


def test_more_lobes_are_never_worse() -> None:
    errors = run_to_end(fit_errors(random_vectors(10), (1, 2, 3, 4)))
    assert sorted(errors.values(), reverse=True) == pytest.approx(list(errors.values()))
