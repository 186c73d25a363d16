"""As few rays as the noise of the picture allows, and no fewer."""

from dataclasses import replace

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.core.stored_arrays import UnsoundArrays
from engine.light.environment import constant_environment
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect.checkpoints import arrays_of
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.ray_budget import TOLERANCE, RayBudget, noise_of, required_rays
from engine.precompute.indirect.sampling_settings import FINE, LEAST_PHOTONS, STILL
from engine.precompute.indirect.solver import Solver
from engine.settings import SETTINGS, checked_line
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of

ASKING = replace(QUICK, n_rays=512, n_record_rays=64, n_samples=64)
ONE = np.ones(50)
LAYERS = [matt(0, 0.7), matt(1, 0.5), matt(2, 0.3)]
MODELS_OF = {i: ["lambert"] for i in range(3)}
SKY = SkyState(constant_environment((1.0, 0.8, 0.6)))


def solver(other_light: float | None) -> Solver:
    return Solver(placement_of(CORNER, **CORNER_VIEW), MODELS_OF, SKY, 3, ASKING, True, other_light)


def solved(other_light: float | None) -> IndirectLight:
    return run_to_end(solver(other_light).solve(LAYERS))


@pytest.mark.parametrize(("noise", "expected"), [(0.0, 128), (0.004, 128), (0.015, 256), (0.08, 512), (np.inf, 512)])
def test_more_noise_calls_for_more_rays(noise: float, expected: int) -> None:
    need = required_rays(512, noise)
    assert need.n_rays == expected
    assert expected == 512 or need.added(need.n_rays) <= TOLERANCE
    assert expected == 128 or not need.added(expected // 2) <= TOLERANCE


def test_fewer_rays_take_others_with_them() -> None:
    quick = FINE.with_rays(128)
    assert (quick.n_rays, quick.n_record_rays, quick.n_samples) == (128, FINE.n_record_rays // 2, FINE.n_samples // 2)
    assert FINE.with_rays(512) == FINE and FINE.with_rays(1024) == replace(FINE, n_rays=1024)
    assert FINE.with_rays(0) == FINE  # as nobody has asked for
    assert quick.n_photons == FINE.n_photons == LEAST_PHOTONS
    still = [STILL.with_rays(n).n_photons for n in (128, 256, 1024)]
    assert still == [LEAST_PHOTONS, STILL.n_photons // 4, STILL.n_photons]
    assert STILL.with_rays(128, keeps_photons=True).n_photons == STILL.n_photons


def test_noise_is_half_of_what_halves_differ_by() -> None:
    # Halves 0.9 and 1.1 are 1.0 with an error of 0.1; beside three times as much other light a quarter of that.
    halves = np.full((2, 50, 3), 1.0) + np.array([-0.1, 0.1])[:, None, None]
    assert noise_of(halves, 0.4 * ONE, np.ones(50), 0.0) == pytest.approx(0.04)  # what a filter leaves of it
    assert noise_of(halves, ONE, np.ones(50), 0.0) == pytest.approx(0.1)
    assert noise_of(halves, ONE, np.ones(50), 3.0) == pytest.approx(0.025)
    weights = np.zeros(50)
    weights[:25], halves[:, 25:] = 2.0, 7.0
    assert noise_of(halves, ONE, weights, 0.0) == pytest.approx(0.1)  # what has no share of a pixel does not count
    halves = np.full((2, 10_000, 3), 1.0) + np.array([-0.1, 0.1])[:, None, None]
    halves[:, 7] = [[-99.0], [101.0]]
    assert noise_of(halves, np.ones(10_000), np.ones(10_000), 0.0) == pytest.approx(0.1)  # nor does one in ten thousand
    assert noise_of(np.zeros((2, 0, 3)), np.zeros(0), np.zeros(0), 0.0) == 0.0  # nothing reflects


def test_a_quiet_picture_is_found_by_few_rays_and_a_noisy_one_by_all() -> None:
    every, many, few = solved(None), solved(0.0), solved(1e3)  # the last beside a thousand times as much light
    assert every.ray_budget.n_rays == 512 and few.ray_budget.n_rays == 128
    assert many.ray_budget == required_rays(512, many.ray_budget.noise)
    assert few.points.samples.records.shape[1] == 128 and few.light.records_hit.shape[1] == ASKING.n_record_rays // 2
    assert every.ray_budget.noise is None and few.ray_budget.noise < many.ray_budget.noise
    first, last = (light.picture(LAYERS).mean() for light in (every, few))
    assert last == pytest.approx(first, rel=0.02)


def test_all_rays_are_those_of_a_solver_that_never_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    # Cells that the first look alone has hit have other places: so alike, not equal.
    monkeypatch.setattr("engine.precompute.indirect.ray_budget.TOLERANCE", 0.0)
    asked, plain = solved(0.0), solved(None)
    assert asked.ray_budget.n_rays == 512 and asked.ray_budget.reason.startswith("256 would be")
    assert asked.points.samples.records.shape == plain.points.samples.records.shape
    np.testing.assert_allclose(asked.picture(LAYERS), plain.picture(LAYERS), rtol=0.1, atol=0.02)


@pytest.mark.parametrize("other_light", [None, 0.0, 1e3])
def test_what_is_stored_knows_how_many_rays_it_has(other_light: float | None) -> None:
    light = solved(other_light)
    restored = solver(other_light).restored(arrays_of(light))
    assert restored.ray_budget == light.ray_budget
    np.testing.assert_array_equal(restored.picture(LAYERS), light.picture(LAYERS))


@pytest.mark.parametrize(("name", "value"), [("n_rays", np.array([300])), ("noise", np.array([-0.5]))])
def test_what_nobody_asked_for_is_refused(name: str, value: np.ndarray) -> None:
    with pytest.raises(UnsoundArrays):
        solver(0.0).restored({**arrays_of(solved(0.0)), name: value})


def test_each_reason_can_be_read() -> None:
    assert RayBudget(512, 512).reason == "the most there may be"
    assert required_rays(512, 0.004).reason == "within 0.2 % of what 512 show"
    assert required_rays(512, 0.08).reason == "256 would be 1.8 % noisier"


@pytest.mark.parametrize("value", [0, 100, 2048, "many", True, 128.0])
def test_a_line_takes_valid_numbers_of_rays(value: object) -> None:
    assert all(checked_line("rays", n) == n for n in SETTINGS["n_hemisphere_rays"].values)
    with pytest.raises(InsituError, match="rays = .*, expected 128, 256, 512 or 1024"):
        checked_line("rays", value)
