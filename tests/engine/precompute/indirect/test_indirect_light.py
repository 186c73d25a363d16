"""The gather operator times a polynomial against the thesis' tensor, on the same paths."""

from dataclasses import replace
from itertools import combinations_with_replacement
from math import comb

import numpy as np
import pytest

from benchmarks.dense_tensor import NONE, DenseTensor, Multisets
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial, Representation
from engine.precompute.indirect.indirect_layers import diffuse_slant, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import NO_OBJECT
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve

LAYERS = [
    matt(0, [0.5, 0.1, 0.9]), diffuse_slant(indirect_layer(0, make_layer(MODELS["phong"]), (32,))), matt(1, 0.8),
    diffuse_slant(indirect_layer(2, make_layer(MODELS["blinn_phong"]), (64,))),
]  # fmt: skip


@pytest.fixture(scope="module")
def found() -> IndirectLight:
    sky = constant_environment((1.0, 0.8, 0.6))
    light = solve(placement_of(CORNER, **CORNER_VIEW), LAYERS, 5, replace(QUICK, n_samples=64), sky)
    return light.without_glossy_hits()


@pytest.mark.parametrize("size", [1, 2, 3, 5])
@pytest.mark.parametrize("n_objects", [1, 2, 7])
def test_multisets_are_numbered_without_gaps(n_objects, size):
    sets = Multisets(n_objects, size)
    # With k members there are C(M + k - 1, k) of them.
    assert len(sets) == sum(comb(n_objects + k - 1, k) for k in range(size + 1))
    listed = np.array(list(combinations_with_replacement(range(n_objects + 1), size)))
    shuffled = np.random.default_rng(1).permuted(listed, axis=1)
    assert sorted(sets.rank(shuffled)) == list(range(len(sets)))
    assert not sets.members[0].any()


def test_a_multiset_with_one_more():
    sets = Multisets(4, 3)
    for z in range(len(sets)):
        for place in range(4):
            more = sets.joined[z, place]
            assert (more == NONE) == (sets.exponents[z].sum() == 3)
            if more != NONE:
                assert (sets.exponents[more] - sets.exponents[z]).tolist() == np.eye(4, dtype=int)[place].tolist()


@pytest.mark.parametrize(
    ("edited", "selected"),
    [(NO_OBJECT, None), (0, SelectedCurve(1, 0)), (0, SelectedCurve(0, 0)), (1, SelectedCurve(2, 0)), (2, None)],
)
def test_both_freeze_alike(found, edited, selected):
    edits = [replace(x, albedo=x.albedo * 0.0) if x.i_object == 2 else x for x in LAYERS]
    representations: list[Representation] = [GatherPolynomial(found), DenseTensor(found, LAYERS)]
    assert representations[0].n_bytes == 0 < representations[1].n_bytes
    for layers in (LAYERS, edits):  # as found, and with an albedo of 0
        curves = [] if selected is None else [selected]
        one, two = (run_to_end(each.freeze(layers, edited, curves), lambda step: None) for each in representations)
        assert one.reflected.keys() == two.reflected.keys() == {0, 1, 2, 3} - {selected.layer if selected else None}
        for i, values in one.reflected.items():
            assert values.max() > 0.0
            np.testing.assert_allclose(two.reflected[i], values, rtol=1e-5, atol=1e-5 * values.max())
        assert one.bands.keys() == two.bands.keys() == {each.layer for each in curves}
        for i, values in one.bands.items():
            np.testing.assert_allclose(two.bands[i], values, rtol=1e-5, atol=1e-5 * values.max())


def test_the_tensor_takes_one_curve(found):
    two = indirect_layer(1, make_layer(MODELS["rough_conductor"]), (16, 8))
    with pytest.raises(InsituError, match="one curve"):
        DenseTensor(found, [*LAYERS, two])
