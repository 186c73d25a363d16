"""Rows of what glossy surfaces mirror of the sky, against the light that is found under each sky."""

from dataclasses import replace

import numpy as np
import pytest

from engine.core.clamping import unscaled
from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.direct.relight import MEAN_TERMS
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.gloss_rows import GlossRows, gloss_rows
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.relighting import IndirectRelighting, SceneLight, SourceLighting
from engine.precompute.indirect.sampling_settings import STILL
from engine.precompute.indirect.solver import Solver
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve
from tests.engine.precompute.indirect.test_third_gloss import LAYERS, PLATES

FINENESS = replace(STILL, n_photons=0, max_extra_sets=0)


def window() -> Environment:
    """A window of some ten degrees in a dark sky."""
    radiance = np.full((32, 64, 3), 0.1, np.float32)
    radiance[10:16, 28:36] += np.float32((12.0, 8.0, 5.0))
    return Environment(radiance, "window")


SKY = SkyState(window())


@pytest.fixture(scope="module")
def placement() -> Placement:
    return placement_of(PLATES, eye=(-0.15, 0.1, 1.0), n=20)


def found_under(placement: Placement, sky: SkyState) -> IndirectLight:
    models = {i: ["rough_conductor"] for i in (0, 1)}
    return run_to_end(Solver(placement, models, sky, 3, FINENESS).solve(LAYERS)).with_smoothing(None)


@pytest.fixture(scope="module")
def found(placement: Placement) -> IndirectLight:
    return found_under(placement, SKY)


@pytest.fixture(scope="module")
def rows(found: IndirectLight) -> GlossRows:
    return run_to_end(gloss_rows(found, LAYERS, window(), 1.0))


def reflected(light: IndirectLight) -> np.ndarray:
    """What both plates reflect at their gather points, (p, 3)."""
    frozen = run_to_end(GatherPolynomial(light).freeze(LAYERS))
    return np.concatenate([unscaled(frozen.reflected[i][:, 0].T, light.unit) for i in (0, 1)])


def error(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)) / other.mean())


@pytest.mark.parametrize("rotation", [0.0, 20.0, -50.0])
def test_rows_add_what_lights_bring_to_glossy_surfaces(placement, found, rows, rotation: float) -> None:
    turned = replace(SKY, rotation=rotation)
    lighting = SourceLighting(found, placement.scene, SKY)
    lit = run_to_end(lighting.by_sky(turned))
    ours = reflected(lighting.with_gloss(lit)) + np.concatenate(rows.lit(turned))
    truth = reflected(found_under(placement, turned))
    assert ours.mean() == pytest.approx(truth.mean(), rel=0.05)
    # By albedo alone it is two to four times as far off; the truth's own noise is a part of the error.
    assert error(ours, truth) < min(0.5 * error(reflected(lit), truth), 0.3)


def test_rows_are_linear_and_of_few_terms(rows: GlossRows) -> None:
    once, twice = (np.concatenate(rows.lit(replace(SKY, scale=scale))) for scale in (1.0, 2.0))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-5)
    assert not np.concatenate(rows.lit(SkyState(None))).any()
    for layer, _ in rows.layers:
        assert 0 < layer.n_terms <= MEAN_TERMS * layer.n_points
    assert rows.n_bytes > 0


def relighting_of(placement: Placement, light: IndirectLight, layers, sky: SkyState) -> IndirectRelighting:
    def reflect(outgoing: OutgoingRadiance):
        return (yield from GatherPolynomial(light).reflect(layers, outgoing))

    at_rest = SceneLight(sky, placement.scene.emission)
    return IndirectRelighting(SourceLighting(light, placement.scene, sky), at_rest, layers, reflect)


def test_a_turn_begins_without_a_jump_and_shows_what_is_mirrored(placement: Placement, found: IndirectLight) -> None:
    relighting, exact = relighting_of(placement, found, LAYERS, SKY), reflected(found)
    run_to_end(relighting.prepare())

    def picture(rotation: float) -> np.ndarray:
        parts = run_to_end(relighting.relit(SceneLight(replace(SKY, rotation=rotation), placement.scene.emission)))
        now, resting, gloss, mirrored = (
            np.concatenate([getattr(part, what) for part in parts]) for what in ("now", "resting", "gloss", "mirrored")
        )
        return np.maximum(now + gloss * (exact - resting) + mirrored, 0.0)

    np.testing.assert_allclose(picture(0.0), exact, rtol=1e-5, atol=1e-6)
    truth = reflected(found_under(placement, replace(SKY, rotation=30.0)))
    assert error(picture(30.0), truth) < 0.5 * error(exact, truth)


def test_diffuse_scenes_and_even_skies_have_no_rows() -> None:
    diffuse, layers = placement_of(CORNER, **CORNER_VIEW), (matt(0, 0.8), matt(1, 0.6), matt(2, 0.5))
    light = solve(diffuse, layers, 3, QUICK, window())
    relighting = relighting_of(diffuse, light, layers, SKY)
    run_to_end(relighting.prepare())
    parts = run_to_end(relighting.relit(SceneLight(replace(SKY, rotation=30.0), diffuse.scene.emission)))
    assert not any(part.mirrored.any() for part in parts)


def test_two_lights_in_one_pass_are_each_of_them(placement: Placement, found: IndirectLight) -> None:
    lighting = SourceLighting(found, placement.scene, SKY)
    lit = run_to_end(lighting.by_sky(replace(SKY, rotation=30.0)))
    one, other = (each.outgoing_radiance(LAYERS) for each in (lit, lighting.with_gloss(lit)))
    representation = GatherPolynomial(found)
    both = run_to_end(representation.reflect(LAYERS, one.beside(other)))
    for i, light in enumerate((one, other)):
        for layer, expected in zip(both, run_to_end(representation.reflect(LAYERS, light)), strict=True):
            np.testing.assert_allclose(layer[:, i], expected[:, 0], rtol=1e-5, atol=1e-6 * expected.max())
