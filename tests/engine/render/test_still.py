"""Stills: against closed forms, against brute force, and against pictures of an independent path tracer."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from engine.core.generators import StillProgress, run_to_end
from engine.curve.operators import Operator
from engine.light.environment import constant_environment, load_environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct import projection
from engine.precompute.direct.pipeline import COARSE, Placement, SkyState
from engine.render import still
from engine.render.still import StillLayer, curves_of, render_reference, render_still, still_layers, still_quality
from engine.scene.scene_loader import Scene, load_scene
from tests.reference_thirds import open_third, third
from tests.scene_text import LAMBERT, LIT_TABLE, camera, placed

BALL = camera((0, 0, 4), resolution=(32, 24)) + placed("ball", "sphere", more=LAMBERT)
TABLE = BALL.replace("[0, 0, 4]", "[0, 1.2, 3.4]") + LIT_TABLE


def load(folder: Path, text: str) -> Scene:
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def render(scene: Scene, layers: dict[str, Layer], sky: SkyState) -> np.ndarray:
    """The still of a scene as the command line renders it."""
    plan = plan_scene(scene, layers, has_sky=sky.environment is not None, still=True)
    names = [described.name for described in scene.description.objects]
    steps = render_still(Placement(scene), still_layers(layers.items(), names, plan), sky, still_quality(plan))
    return run_to_end(steps, lambda step: None)


def test_a_convex_white_thing_under_a_white_sky_is_invisible(tmp_path: Path) -> None:
    # Lambert of albedo 1 on a sphere that shadows nothing reflects the sky's 0.7 everywhere, as does the background.
    layers = {"ball.0": make_layer(MODELS["lambert"], {"albedo": (1.0, 1.0, 1.0)})}
    image = render(load(tmp_path, BALL), layers, SkyState(constant_environment(0.7)))
    assert image.shape == (24, 32, 3) and image.dtype == np.float32
    # Facets stand for a ball and shading normals lean beyond the horizon of their facet: 1 % at the rim.
    assert np.abs(image / 0.7 - 1.0).max() < 0.02 and abs(image.mean() / 0.7 - 1.0) < 2e-3


def test_the_curves_of_a_layer_are_evaluated_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated = list[StillLayer]()
    monkeypatch.setattr(still, "curves_of", lambda each: evaluated.append(each) or curves_of(each))
    monkeypatch.setattr(projection, "TILE", 16)  # the layer is projected in several tiles
    layers = {"ball.0": make_layer(MODELS["lambert"])}
    render(load(tmp_path, BALL), layers, SkyState(constant_environment(0.7)))
    assert [each.layer for each in evaluated] == [layers["ball.0"]]


def test_no_silhouette_of_a_coarse_smooth_mesh_is_a_dark_dot(tmp_path: Path) -> None:
    # White under a white sky and convex: all a pixel can lose is what its shading normal looks at below its face's
    # horizon, (1 - cos 55°) / 2 = 21 % in the corners of an octahedron. Turned round it would lose nearly all of it.
    corners = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n"
    faces = "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n"
    (tmp_path / "octahedron.obj").write_text(corners + faces)
    text = BALL.replace('primitive = "sphere"', 'mesh = "octahedron.obj"').replace("[0, 0, 4]", "[1.3, 2.2, 3.4]")
    layers = {"ball.0": make_layer(MODELS["lambert"], {"albedo": (1.0, 1.0, 1.0)})}
    image = render(load(tmp_path, text), layers, SkyState(constant_environment(1.0)))
    assert image.min() > 0.75


def test_scale_and_rotation_of_the_sky_reach_the_background(tmp_path: Path) -> None:
    environment = load_environment(write_gradient(tmp_path))
    scene = load(tmp_path, BALL)
    dark = {"ball.0": make_layer(MODELS["lambert"], {"albedo": (0.0, 0.0, 0.0)})}
    sky = SkyState(environment, 50.0, 2.0)
    image = render(scene, dark, sky)
    hits = Placement(scene).hits
    behind = hits.object_image < 0
    # A black ball in front of twice the environment, turned.
    assert np.allclose(image[behind], 2.0 * environment.evaluate(hits.ray_directions[behind], 50.0))
    assert not image[~behind].any() and behind.any() and not behind.all()


def write_gradient(folder: Path) -> Path:
    from tests.pictures import write_exr

    rows, columns = np.mgrid[0:16, 0:32]
    write_exr(folder / "sky.exr", np.stack([rows / 16, columns / 32, 0 * rows], axis=2).astype(np.float32))
    return folder / "sky.exr"


def test_a_still_agrees_with_brute_force(tmp_path: Path) -> None:
    """A ball on a table under a gradient and a lamp, with an edited curve: both ways to the same picture."""
    scene = load(tmp_path, TABLE)
    bend = Operator("amplify", "y", 0.1, 0.2, 0.5, 0.9, 1.6)
    shiny = make_layer(MODELS["rough_conductor"], {"alpha": 0.3}).with_operators("theta_h", (bend,))
    lambert = make_layer(MODELS["lambert"], {"albedo": (0.7, 0.5, 0.2)})
    layers = {"ball.0": shiny, "table.0": lambert}
    sky = SkyState(load_environment(write_gradient(tmp_path)), 20.0, 1.5)
    image = render(scene, layers, sky)
    steps = render_reference(Placement(scene), {0: (shiny,), 1: (lambert,)}, sky, 256, 4)
    truth = run_to_end(steps, lambda step: None)
    rmse = np.sqrt(np.mean((image - truth) ** 2)) / truth.mean()
    # One ray for each of 5,120 triangles has an error of its own, of about one percent.
    assert rmse < 0.02 and abs(image.mean() / truth.mean() - 1.0) < 0.005
    # The lamp is seen from below, where it does not shine; it lights the table.
    assert truth[scene_mask(scene, 1)].mean() > 1.05 * render(scene, layers, SkyState(None)).mean()


def scene_mask(scene: Scene, i_object: int) -> np.ndarray:
    return Placement(scene).hits.object_image == i_object


def test_hidden_layers_and_darkness(tmp_path: Path) -> None:
    scene = load(tmp_path, BALL)
    hidden = {"ball.0": make_layer(MODELS["lambert"]).replace(visible=False)}
    seen = scene_mask(scene, 0)
    assert not render(scene, hidden, SkyState(constant_environment(1.0)))[seen].any()
    # No sky and no lamp: black, and no NaN from a light of nothing.
    assert not render(scene, {"ball.0": make_layer(MODELS["phong"])}, SkyState(None)).any()


def test_progress_ends_at_one_and_never_goes_back(tmp_path: Path) -> None:
    scene = load(tmp_path, BALL)
    layers = {"ball.0": make_layer(MODELS["lambert"])}
    plan = plan_scene(scene, layers, has_sky=True, still=True)
    told: list[StillProgress] = []
    sky = SkyState(constant_environment(1.0))
    run_to_end(render_still(Placement(scene), still_layers(layers.items(), ["ball"], plan), sky), told.append)
    fractions = [step.fraction for step in told]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="stride"):
        next(render_still(Placement(scene), (), sky, COARSE))


@pytest.fixture(scope="module")
def compare(shared_reference: Path) -> ModuleType:
    """The references' own judge."""
    spec = importlib.util.spec_from_file_location("reference_compare", shared_reference / "compare.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("teatray", marks=pytest.mark.sweep), "bunny", "cornell"])
def test_references(name: str, shared_reference: Path, compare: ModuleType) -> None:
    project = open_third(shared_reference / f"{name}.toml")
    image = render(project.scene, project.layers, project.sky)
    with Image.open(shared_reference / f"{name}_mask.png") as picture:
        mask = np.asarray(picture.convert("L")) > 127
    expected = compare.load(shared_reference / f"{name}_1.exr")
    rmse, mean = compare.errors(image, third(expected), third(mask))
    assert np.isfinite(image).all()
    # The path tracer's own noise is 0.04 to 0.37 %.
    assert rmse <= 0.02 and abs(mean) <= 0.002, f"relRMSE {rmse:.3%}, mean {mean:+.3%}"
