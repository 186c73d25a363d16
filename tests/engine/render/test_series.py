"""Series of bands by bounce: every series beside paths whose materials are as simple at each bounce."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from app.stills.stills import render_picture
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries, parse_series
from engine.reference.path_tracer import LayersOf, trace_halves
from engine.render.still import StillLayer, first_bounce_layers, indirect_radiance, still_layers
from engine.scene.scene_loader import load_scene
from engine.settings import RenderSettings
from tests.scene_text import camera, facing_down, facing_up, placed

# Three sides of a corner, all of copper, so that any three reflections are glossy, and a lamp.
WALLS = {"left": "0,0,1,-1, 0,2,0,1, -2,0,0,0, 0,0,0,1", "back": "2,0,0,0, 0,2,0,1, 0,0,1,-1, 0,0,0,1"}
COPPER = 'layer = [{ model = "rough_conductor", alpha = 0.3, eta = [0.2, 0.9, 1.1], k = [3.9, 2.4, 2.2] }]\n'


@cache
def corner(folder: Path) -> Placement:
    text = camera((2.2, 1.4, 2.2), 40, (8, 8), (-0.4, 0.7, -0.4)) + placed("floor", "quad", facing_up(2), COPPER)
    text += "".join(placed(name, "quad", transform, COPPER) for name, transform in WALLS.items())
    text += placed("lamp", "quad", facing_down(0.5, (0.3, 1.9, 0.3)), "emission = 20\n")
    (folder / "corner.toml").write_text(text)
    return Placement(load_scene(folder / "corner.toml"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("corner")


def materials(folder: Path) -> dict[int, tuple[Layer, ...]]:
    described = corner(folder).scene.description.objects
    return {
        i: tuple(make_layer(MODELS[layer.model], layer.parameters) for layer in each.layers)
        for i, each in enumerate(described)
    }


def by_albedo(layers_of: LayersOf) -> dict[int, tuple[Layer, ...]]:
    """Diffuse materials that reflect as much light."""
    found = {}
    for i, layers in layers_of.items():
        albedo = sum((equivalent_albedo(layer, (128, 32)[: len(layer.model.factors)]) for layer in layers), np.zeros(3))
        found[i] = (make_layer(MODELS["lambert"], {"albedo": tuple(albedo.tolist())}),) if layers else ()
    return found


def still_layers_of(folder: Path) -> list[StillLayer]:
    placement = corner(folder)
    names = placement.scene.object_names
    named = {f"{names[i]}.0": own[0] for i, own in materials(folder).items() if own}
    plan = plan_scene(placement.scene, named, has_sky=False, still=True, settings=RenderSettings())
    return still_layers(named.items(), names, plan)


@cache
def twin(folder: Path, curves: int) -> np.ndarray:
    """Indirect light (2, P, 3) of three bounces, the first `curves` of them by the curves and the others by albedos, by
    each half of the paths."""
    placement, own = corner(folder), materials(folder)
    stages = [own] * curves + [by_albedo(own)] * (3 - curves)
    rows = np.arange(len(placement.hits.pixel))
    halves = run_to_end(trace_halves(placement, stages[0], SkyState(None), 3, 1024, 3, rows, stages[1:]))
    return halves[:, :, 1] - halves[:, :, 0]


@cache
def found(folder: Path, series: BounceSeries) -> np.ndarray:
    """The indirect light (P, 3) of a series."""
    layers = first_bounce_layers(still_layers_of(folder), series)
    settings = STILL.with_rays(256)
    return run_to_end(indirect_radiance(corner(folder), layers, SkyState(None), series, settings))


def off(picture: np.ndarray, halves: np.ndarray) -> float:
    """The error, relative to the mean, without the noise of the paths, as that of their halves is independent."""
    squared = ((picture - halves[0]) * (picture - halves[1])).mean()
    return float(np.sqrt(max(squared, 0.0)) / halves.mean())


SERIES = {
    3: BounceSeries(3), 2: BounceSeries(3, None, None, 1), 1: BounceSeries(3, None, 1, 1),
    0: BounceSeries(3, 1, 1, 1, whole_direct=True),
}  # fmt: skip


@pytest.mark.parametrize("curves", SERIES)
def test_each_series_is_what_paths_with_such_materials_find(folder: Path, curves: int) -> None:
    own = found(folder, SERIES[curves])
    errors = {each: off(own, twin(folder, each)) for each in SERIES}
    assert errors[curves] < 0.1, errors  # mostly the noise of so few rays
    assert own.mean() == pytest.approx(twin(folder, curves).mean(), rel=0.03)
    others = [error for each, error in errors.items() if each != curves]
    assert min(others) > 1.5 * errors[curves], errors


def test_the_third_number_is_of_the_third_bounce_alone(folder: Path) -> None:
    # As many bands as at the second change no bit.
    np.testing.assert_array_equal(found(folder, BounceSeries(3, None, 8, 8)), found(folder, BounceSeries(3, None, 8)))
    eight, two = (found(folder, BounceSeries(3, None, 8, third)) for third in (8, 2))
    assert 1e-3 < np.abs(eight - two).mean() / eight.mean() < 0.2


def test_direct_light_stays_whole_where_the_series_says_so(folder: Path) -> None:
    corner(folder)
    project = open_project(str(folder / "corner.toml"))

    def drawn(text: str) -> np.ndarray:
        return render_picture(project, lambda step: None, series=parse_series(text), n_patches=96)

    one = render_picture(project, lambda step: None, series=BounceSeries(1), n_patches=96)
    np.testing.assert_array_equal(drawn("direct+4"), one)
    assert np.abs(drawn("4") - one).max() > 0.05 * one.max()
    np.testing.assert_array_equal(drawn("1"), one)  # not by a curve of one band, and not by an albedo


def test_a_series_is_written_as_it_is_read() -> None:
    for text in ("64", "64,8", "64,8,1,1", "64,16,8,1", "16,16,16", "direct+64,8,8,1,1", "direct+1,1,1,1"):
        assert str(parse_series(text)) == text
    assert parse_series("1,1,1,1") == parse_series("direct+1,1,1,1")
    assert parse_series("64,16,8,1") == BounceSeries(4, 64, 16, 8)
    assert str(BounceSeries(5)) == "J,J,J,1,1"
    for text, said in (
        ("64,8,8,8", "1 at every bounce after the third"), ("8,16", "no more bands"), ("64,8,16", "no more bands"),
        ("1,8", "no more bands"), ("64,3", "powers of two"), ("64,8,0", "powers of two"), ("direct+", "numbers"),
        ("direct64", "numbers"), ("64," * 17 + "1", "at most 16 bounces"),
    ):  # fmt: skip
        with pytest.raises(InsituError, match=said):
            parse_series(text)
