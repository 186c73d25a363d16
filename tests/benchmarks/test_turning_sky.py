"""What wavelets a turning sky is followed by."""

from pathlib import Path

import numpy as np
import pytest

from app.measure.settings_placement import STRATEGIES, Strategy
from benchmarks.turning_sky import ROWS, TurningEffort, followed, turning_errors, write_turning
from engine.sphere.haar import levels_of_coefficients
from tests.app.worker.test_relighting import SCENE, skylight
from tests.pictures import write_exr

N = 5120
ROW = np.random.default_rng(5).normal(size=(3, N, 3)).astype(np.float32)


def lights(n: int) -> list[np.ndarray]:
    random = np.random.default_rng(7)
    return [random.normal(size=(N, 3)).astype(np.float32) for _ in range(n)]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_all_terms_are_the_light_itself(strategy: Strategy) -> None:
    wanted = lights(3)
    np.testing.assert_array_equal(followed(ROW, wanted, N, strategy), wanted)


@pytest.mark.parametrize(("strategy", "n_left"), [("anew", N - 10), ("incremented", 0), ("by bands", 0)])
def test_what_stands_still_is_held_by_increments_alone(strategy: Strategy, n_left: int) -> None:
    (light,) = lights(1)
    (_, last) = followed(ROW, [light, light], 10, strategy)
    assert (last != light).any(axis=1).sum() == n_left


def test_a_band_that_has_turned_into_another_is_begun_anew_and_no_other() -> None:
    (before,) = lights(1)
    finest = levels_of_coefficients(4) == 3
    after = np.where(finest[:, None], -before, before)
    (_, kept), (_, anew) = (followed(ROW, [before, after], 10, strategy) for strategy in ("incremented", "by bands"))
    np.testing.assert_array_equal(kept[~finest], before[~finest])
    np.testing.assert_array_equal(anew[~finest], before[~finest])
    assert (kept[finest] == before[finest]).all(axis=1).sum() == finest.sum() - 10
    assert (anew[finest] == 0.0).all(axis=1).sum() == finest.sum() - 10


def test_more_terms_are_nearer_and_the_table_has_all_ways(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", skylight())
    (tmp_path / "scene.toml").write_text(SCENE)
    effort = TurningEffort((16, 12), 8, (5.0,), (40, 400), 6, 240)
    found = turning_errors(effort, lambda line: None, str(tmp_path / "scene.toml"))
    assert [(each.strategy, each.terms) for each in found[1:]] == [
        (strategy, n) for strategy in STRATEGIES for n in (40, 400)
    ]
    assert found[0].strategy == ROWS and 0.0 < found[0].error < 0.5
    assert all(more.error < few.error for few, more in zip(found[1::2], found[2::2], strict=True))
    write_turning(tmp_path, found)
    assert len((tmp_path / "turning.csv").read_text().splitlines()) == 8
