"""The predicted memory of an editor, against what is held once all of it is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS, make_layer
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.precompute.direct.relight import MOST_ROW_BYTES, RowMaker, joined_rows, turning_effects
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.relighting import IndirectRelighting, SceneLight, SourceLighting
from engine.precompute.indirect.solver import Solver
from engine.render.cost_pilot import indirect_cost
from engine.render.editing_pilot import sky_row_bytes
from tests.engine.precompute.indirect.small_scenes import QUICK, matt, placement_of
from tests.engine.precompute.indirect.test_photons import BALL, FLOOR, GOLD, VIEW

CURVES = SelectedCurve(1, 0), SelectedCurve(0, 0)
SETTINGS = replace(QUICK, n_rays=128, n_photons=1 << 14)
MODELS_OF = {0: ["lambert"], 1: ["rough_conductor"]}


@pytest.fixture(scope="module")
def placement() -> Placement:
    return placement_of([FLOOR, BALL], **VIEW, n=160)


@pytest.fixture(scope="module")
def layers() -> list[IndirectLayer]:
    return [matt(0, 0.7), indirect_layer(1, make_layer(MODELS["rough_conductor"], GOLD), (64, 16))]


def half_bright() -> SkyState:
    radiance = np.full((16, 32, 3), 0.2, np.float32)
    radiance[:8, :6] = 20.0
    return SkyState(Environment(radiance, "half"))


def held(placement: Placement, sky: SkyState, light: IndirectLight, layers: list[IndirectLayer]) -> int:
    """What is held of light, of the curve for which most is frozen, and of a sky that may turn."""
    polynomial = GatherPolynomial(light)
    frozen = [run_to_end(polynomial.freeze(layers, layers[curve.layer].i_object, (curve,))) for curve in CURVES]
    lighting = SourceLighting(light, placement.scene, sky)
    resting = SceneLight(sky, placement.scene.emission)
    relighting = IndirectRelighting(lighting, resting, layers, lambda out: polynomial.reflect(layers, out))
    run_to_end(relighting.prepare())
    return light.n_bytes + polynomial.n_bytes + relighting.n_bytes + max(each.n_bytes for each in frozen)


@pytest.mark.parametrize("sky", [SkyState(constant_environment((1.0, 0.8, 0.6))), half_bright()])
def test_a_trial_foresees_what_an_editor_holds(
    placement: Placement, layers: list[IndirectLayer], sky: SkyState
) -> None:
    cost = run_to_end(indirect_cost(placement, MODELS_OF, sky, 3, layers, SETTINGS, curves=CURVES))
    light = run_to_end(Solver(placement, MODELS_OF, sky, 3, SETTINGS, True).solve(layers))
    table = light.cache.n_bytes  # has room for the most records, however few there are
    planned, was = cost.editing_bytes - table, held(placement, sky, light, layers) - table
    assert planned == pytest.approx(was, rel=0.3)
    assert planned > 1.2 * (light.n_bytes - table)  # the rest is what an edit adds to the light


def test_rows_have_as_many_terms_and_channels_as_those_that_are_made(placement: Placement) -> None:
    grey, coloured = make_layer(MODELS["lambert"], {}), make_layer(MODELS["rough_conductor"], GOLD)
    points, sky = placement.rows_of(0), half_bright()
    run_to_end(placement.light(sky, replace(FINAL, n_lights=64, n_patches=0)))
    assert sky.environment is not None
    effects = run_to_end(turning_effects(sky.environment))
    rows = []
    for layer in (grey, coloured):
        maker = RowMaker(placement.hits, placement.sphere, effects).rows_within([(layer, points)], MOST_ROW_BYTES)
        rows.append(joined_rows(list(maker.rows(layer, points))).n_bytes + 12 * len(points))
        assert sky_row_bytes(placement, sky, [(0, layer)]) == pytest.approx(rows[-1], rel=0.2)
    assert rows[1] > 1.5 * rows[0]
    assert sky_row_bytes(placement, SkyState(None), [(0, grey)]) == 0
    many = sky_row_bytes(placement, sky, [(0, coloured)] * 10_000)
    assert many == round(MOST_ROW_BYTES) + 12 * 10_000 * len(points)
