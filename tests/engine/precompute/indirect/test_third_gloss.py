"""Gloss seen in gloss seen in gloss: what the lamps bring by three of them, against paths."""

from dataclasses import replace

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import STILL
from engine.reference.path_tracer import trace_paths
from tests.engine.precompute.indirect.small_scenes import QUICK, placed, placement_of, solve

COPPER = make_layer(
    MODELS["rough_conductor"], {"alpha": 0.15, "eta": [0.2, 0.92, 1.1], "k": [3.9, 2.45, 2.14], "scale": 1.0}
)
LAYERS = [indirect_layer(i, COPPER, (128, 16)) for i in (0, 1)]
# Two upright plates that face one another, and a lamp in front of them: most of its light leaves again at their back.
PLATES = [
    {"name": "left", "primitive": "quad", "transform": [0, 0, 1, -0.25, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1]},
    {"name": "right", "primitive": "quad", "transform": [0, 0, -1, 0.25, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]},
]
LAMP = {"name": "lamp", "primitive": "cube", "emission": [20.0] * 3, "transform": placed(0.3, 0.6, 1.2, 0.3)}
FINENESS = replace(STILL, n_photons=0)


@pytest.fixture(scope="module")
def placement() -> Placement:
    return placement_of([*PLATES, LAMP], eye=(-0.15, 0.1, 1.0), n=20)


@pytest.fixture(scope="module")
def thrice(placement: Placement) -> IndirectLight:
    return solve(placement, LAYERS, 3, FINENESS)


def test_light_of_a_third_gloss_is_that_of_paths(placement: Placement, thrice: IndirectLight) -> None:
    twice = solve(placement, LAYERS, 2, FINENESS)
    ours = thrice.with_smoothing(None).picture(LAYERS).mean() - twice.with_smoothing(None).picture(LAYERS).mean()
    materials = {0: [COPPER], 1: [COPPER]}
    two, three = (
        run_to_end(trace_paths(placement, materials, SkyState(None), n, 2048)).radiance.mean() for n in (2, 3)
    )
    assert ours == pytest.approx(three - two, rel=0.3)  # paths' own noise is 0.15; by albedo it is 4.4 times as much


@pytest.mark.parametrize("edited", [0, 1])
def test_it_follows_the_albedo_of_what_is_edited(thrice: IndirectLight, edited: int) -> None:
    # By powers of that albedo, each as often as the light meets the object after the eye's own reflection.
    plain = thrice.outgoing_radiance(LAYERS)
    sent = thrice.outgoing_radiance(LAYERS, edited)
    albedo = LAYERS[edited].albedo.astype(np.float32)
    for i in (0, 1):
        curves = [LAYERS[i].curves]
        [whole], [powers] = (
            run_to_end(thrice.points.hemisphere_samples(i).reflect(curves, light)) for light in (plain, sent)
        )
        summed = sum(powers[:, n] * albedo**n for n in range(powers.shape[1]))
        np.testing.assert_allclose(summed, whole[:, 0], rtol=1e-3, atol=1e-5 * whole.max())
        assert powers[:, 1].max() > 0.0


def test_extra_sample_sets_go_where_gloss_is_noisy() -> None:
    # By albedo the plates are quiet: a third of the points took an extra set, and the noise was 0.40.
    fineness = replace(QUICK, n_photons=0, max_extra_sets=1)
    found = solve(placement_of([*PLATES, LAMP], eye=(-0.15, 0.1, 1.0), n=32), LAYERS, 3, fineness)
    samples = found.points.samples
    assert len(samples.rows) == 2 * len(samples.points)
    assert run_to_end(found.noise(LAYERS))[0] < 0.3  # 0.22
