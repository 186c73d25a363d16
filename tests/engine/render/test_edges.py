"""Pictures with several shading points at edges, against the slow twin: a picture of many more pixels, averaged."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.render.error_estimate import estimate_error
from engine.render.still import indirect_radiance, reflect_layers, render_still, still_layers
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.render.test_still import TABLE

QUALITY = replace(FINAL, n_lights=100, n_patches=64)
FEWER_RAYS = replace(STILL, n_rays=256, n_cache_records=4000)
SKY = SkyState(constant_environment((0.5, 0.6, 0.7)))


def picture(scene: Scene, n_edge_rays: int = 0, n_bounces: int = 1) -> np.ndarray:
    placement = Placement(scene, n_edge_rays=n_edge_rays)
    layers = layers_of(scene)
    indirect = None
    if n_bounces > 1:
        indirect = run_to_end(indirect_radiance(placement, layers, SKY, BounceSeries(n_bounces), FEWER_RAYS))
    return run_to_end(render_still(placement, layers, SKY, QUALITY, indirect))


def layers_of(scene: Scene):
    from app.document.described import document_from_description
    from app.document.document import reflecting_layers

    layers = dict(reflecting_layers(document_from_description("table", scene.description)))
    plan = plan_scene(scene, layers, has_sky=True)
    return still_layers(layers.items(), scene.object_names, plan)


def averaged(image: np.ndarray, n: int) -> np.ndarray:
    height, width = image.shape[0] // n, image.shape[1] // n
    return image.reshape(height, n, width, n, 3).mean(axis=(1, 3))


def off(image: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((image - truth) ** 2)) / truth.mean())


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path: Path = tmp_path_factory.mktemp("edges") / "scene.toml"
    path.write_text(TABLE)
    return load_scene(path)


@pytest.fixture(scope="module")
def truth(table: Scene) -> np.ndarray:
    return averaged(picture(replace(table, resolution=(32 * 8, 24 * 8))), 8)


@pytest.mark.parametrize(("n_edge_rays", "most"), [(4, 0.5), (8, 0.3), (16, 0.25)])
def test_edges_bring_a_picture_near_to_one_of_many_more_pixels(
    table: Scene, truth: np.ndarray, n_edge_rays: int, most: float
) -> None:
    plain = picture(table)
    assert off(picture(table, n_edge_rays), truth) < most * off(plain, truth)


def test_light_between_surfaces_is_there_at_edges_too(table: Scene) -> None:
    truth = averaged(picture(replace(table, resolution=(128, 96)), n_bounces=2), 4)
    plain, smooth = (picture(table, n, n_bounces=2) for n in (0, 16))
    assert off(smooth, truth) < 0.4 * off(plain, truth)


def test_the_error_is_estimated_over_all_points(table: Scene) -> None:
    placement, layers = Placement(table, n_edge_rays=8), layers_of(table)
    radiance = run_to_end(reflect_layers(placement, layers, SKY, QUALITY))
    estimate = run_to_end(estimate_error(placement, layers, SKY, QUALITY, 1, radiance))
    assert 0.0 < estimate.direct < 0.03
    beside = np.flatnonzero(~placement.hits.is_centred)
    wrong = radiance.copy()
    wrong[beside] *= 3.0
    worse = run_to_end(estimate_error(placement, layers, SKY, QUALITY, 1, wrong))
    assert worse.direct > 2.0 * estimate.direct
