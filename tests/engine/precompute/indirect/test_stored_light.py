"""Indirect light as arrays and back."""

from dataclasses import replace

import numpy as np

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect.checkpoints import NAMES, arrays_of
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.solver import Solver, relit
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of


def test_stored_light_is_the_light():
    fineness = replace(QUICK, n_samples=64)
    placement, sky = placement_of(CORNER, **CORNER_VIEW), SkyState(constant_environment((1.0, 0.8, 0.6)))
    layers = [matt(0, 0.5), indirect_layer(1, make_layer(MODELS["rough_conductor"]), (16, 8)), matt(2, 0.3)]
    models = {0: ["lambert"], 1: ["rough_conductor"], 2: ["lambert"]}
    light = run_to_end(Solver(placement, models, sky, 4, fineness).solve(layers), lambda progress: None)
    arrays = {name: array.copy() for name, array in arrays_of(light).items()}
    assert tuple(arrays) == NAMES
    for array in arrays.values():
        array.setflags(write=False)  # as they come from a file
    other = placement_of(CORNER, **CORNER_VIEW)
    restored = Solver(other, models, sky, 4, fineness).restored(arrays)
    assert light.picture(layers).max() > 0.0
    np.testing.assert_array_equal(restored.picture(layers), light.picture(layers))
    # Half of the sky on the same rays: the cells are where they were.
    evening = SkyState(constant_environment((0.5, 0.4, 0.3)))
    one, two = (relit(each, placement, evening, fineness, 4).picture(layers) for each in (light, restored))
    np.testing.assert_array_equal(one, two)


def test_light_of_points_that_see_nothing_but_sky_is_stored_too():
    """Nothing is around them: an infinite clearance was taken for damage, and all was found again at every start."""
    fineness = replace(QUICK, n_samples=64)
    placement, sky = placement_of(CORNER[:1], **CORNER_VIEW), SkyState(constant_environment((1.0, 0.8, 0.6)))
    solver = Solver(placement, {0: ["lambert"]}, sky, 2, fineness)
    light = run_to_end(solver.solve([matt(0, 0.5)]), lambda progress: None)
    restored = solver.restored(arrays_of(light))
    np.testing.assert_array_equal(restored.picture([matt(0, 0.5)]), light.picture([matt(0, 0.5)]))
