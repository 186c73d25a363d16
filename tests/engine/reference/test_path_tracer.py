"""Paths of several bounces: densities, closed forms, the direct oracle, and pictures of an independent path tracer."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.light.environment import Environment, constant_environment
from engine.light.radiance_files import read_radiance_image
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.reference.integrator import integrate_direct
from engine.reference.path_lights import EmitterLight, SkyLight
from engine.reference.path_lobes import Scattering
from engine.reference.path_tracer import PathEstimate, noise_of_halves, trace_halves, trace_paths
from engine.render.still import render_paths
from engine.scene.scene_loader import load_scene
from tests.chi_square import p_of_directions
from tests.scene_text import LAMBERT, LIT_TABLE, camera, facing_down, placed

VIEW = camera((0, 1.2, 3.4), resolution=(32, 24))
BALL = placed("ball", "sphere", more=LAMBERT)
# Facets: from behind one, a smooth shading normal would let light in, or none.
# A hollow ball of radius 0.5 around the camera, with a lamp of 0.04 by 0.04 in it that looks down.
FACETED = BALL + "smooth = false\n"
HOLLOW = FACETED + placed("lamp", "quad", facing_down(0.04, (0, 0.1, 0)), "emission = [100.0, 100.0, 100.0]\n")
Layers = Mapping[int, Sequence[Layer]]


def place(folder: Path, objects: str, view: str = VIEW) -> Placement:
    (folder / "scene.toml").write_text(view + objects)
    return Placement(load_scene(folder / "scene.toml"))


def trace(
    placement: Placement, layers: Layers, sky: SkyState, n_bounces: int, n_samples: int, seed: int = 0, rows=None
) -> PathEstimate:
    return run_to_end(trace_paths(placement, layers, sky, n_bounces, n_samples, seed, rows), lambda step: None)


def lambert(albedo: float) -> Layer:
    """Albedos above 1 by an edit, for parameters end there."""
    layer = make_layer(MODELS["lambert"], {"albedo": [min(albedo, 1.0)] * 3})
    edit = Operator("amplify", "y", 0.0, 0.0, np.pi / 2, np.pi / 2, albedo)
    return layer.with_operators("theta_i", (edit,)) if albedo > 1.0 else layer


def plain(model: str) -> Layer:
    """A layer whose highlight the directions of the direct oracle, a degree or two apart, resolve."""
    return make_layer(MODELS[model], {"alpha": 0.2} if model == "clearcoat" else None)


def edited(model: str) -> Layer:
    """A layer whose first curve has a second hump, different in each channel."""
    layer = plain(model)
    bend = Operator("translate", "y", 0.3, 0.4, 0.6, 0.8, 0.8, channels=(True, False, True))
    lift = Operator("amplify", "y", 0.0, 0.0, 0.1, 0.4, 1.5)
    return layer.with_operators(layer.model.factors[0].name, (bend, lift))


def test_a_coat_mirrors_the_sky_along_silhouettes(tmp_path: Path) -> None:
    """A black ball of 320 triangles under a coat and a white sky, which hides no direction above its faces: there is no
    dark place along its silhouette, where the coat reflects nearly all of the light."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    (tmp_path / "ball.ply").write_bytes(ball.export(file_type="ply", vertex_normal=True))
    placement = place(tmp_path, placed("ball", "ball.ply"), camera((0, 1.2, 3.4), 25, (64, 48)))
    layers = {0: (lambert(0.0), make_layer(MODELS["clearcoat"], {"alpha": 0.05}))}
    along = np.einsum("pk,pk->p", placement.hits.normal, placement.hits.wo)
    grazing = np.flatnonzero(along < 0.2)
    found = trace(placement, layers, SkyState(constant_environment((1.0,) * 3)), 1, 512, rows=grazing).radiance[:, 0]
    # Schlick: 0.04 + 0.96 (1 - cos)^5 is at least 0.35 there; facets and the lobe's lower half take some of it.
    fresnel = 0.04 + 0.96 * (1.0 - along[grazing]) ** 5
    assert len(grazing) > 20 and (found > 0.4 * fresnel).all()


def uneven_sky() -> Environment:
    image = np.random.default_rng(2).random((7, 11, 3)).astype(np.float32) ** 4
    image[2, 3] = 40.0
    return Environment(image, "uneven")


# ---------------------------------------------------------------------------------------------------------- densities


@pytest.mark.parametrize("model", sorted(MODELS))
def test_directions_are_drawn_with_the_reported_density(model: str) -> None:
    scattering = Scattering([edited(model), lambert(0.3)])
    random = np.random.default_rng(5)
    wo = np.tile(np.array([0.48, 0.36, 0.8]), (40_000, 1))
    wi = scattering.sample(random.random((len(wo), 4)), wo)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=1e-9)
    pdf = scattering.evaluate(wi, wo)[1]
    above = pdf > 0.0
    assert np.array_equal(above, wi[:, 2] > 1e-12)

    def told(ways: np.ndarray) -> np.ndarray:
        return scattering.evaluate(ways, np.tile(wo[:1], (len(ways), 1)))[1]

    assert p_of_directions(wi, told) > 1e-3


def test_the_sky_is_drawn_with_the_reported_density() -> None:
    light = SkyLight(SkyState(uneven_sky(), 77.0, 3.0))
    drawn = light.sample(np.zeros((100_000, 3)), np.random.default_rng(6).random((100_000, 3)))
    np.testing.assert_allclose(light.pdf(drawn.wi), drawn.pdf, rtol=1e-6)
    assert p_of_directions(drawn.wi, light.pdf) > 1e-3
    even = np.random.default_rng(7).normal(size=(200_000, 3))
    expected = 4 * np.pi * 3.0 * uneven_sky().evaluate(even, 77.0).mean(axis=0)
    np.testing.assert_allclose((drawn.radiance / drawn.pdf[:, None]).mean(axis=0), expected, rtol=0.02)
    # Drawn by brightness: the estimate of the luminance hardly varies.
    ratio = drawn.radiance.mean(axis=1) / drawn.pdf
    assert ratio.std() < 0.5 * ratio.mean()


def test_emitters_are_drawn_with_the_reported_density(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL + LIT_TABLE)
    light = EmitterLight(placement.scene)
    point, nobody = np.array([[0.6, -0.4, 0.2]]), np.zeros(0, np.int32)
    drawn = light.sample(np.tile(point, (20_000, 1)), nobody, np.random.default_rng(8).random((20_000, 3)))
    found = placement.caster.intersect(np.tile(np.float32(point), (20_000, 1)), drawn.wi.astype(np.float32))
    hit = placement.scene.emitters[placement.scene.object_of_triangle[found.triangle]]
    assert hit.mean() > 0.99
    told = light.pdf(found.of(hit), drawn.wi[hit])
    np.testing.assert_allclose(told, drawn.pdf[hit], rtol=1e-4)
    # A square of side 1 seen from 2 above its middle: 4 asin(1 / (1 + 4 h^2)) with h = 2.
    assert (1.0 / drawn.pdf).mean() == pytest.approx(4 * np.arcsin(1.0 / 17.0), rel=0.01)
    # From above it is dark.
    assert not light.sample(np.array([[0.6, 3.0, 0.2]]), nobody, np.array([[0.5, 0.5, 0.5]])).pdf.any()


# ------------------------------------------------------------------------------------------------------- closed forms


def test_a_convex_white_thing_under_a_white_sky_is_invisible(tmp_path: Path) -> None:
    placement = place(tmp_path, FACETED)
    sky = SkyState(constant_environment(0.7), 0.0, 2.0)
    picture = run_to_end(render_paths(placement, {0: [lambert(1.0)]}, sky, 4, 256), lambda step: None)
    seen = placement.hits.object_image >= 0
    assert seen.any() and not seen.all()
    assert picture[seen].mean() == pytest.approx(1.4, rel=3e-3) and picture[~seen] == pytest.approx(1.4)


@pytest.mark.parametrize(("albedo", "n_bounces"), [(0.5, 4), (0.9, 12), (1.6, 6)])
def test_a_hollow_ball_is_a_furnace(tmp_path: Path, albedo: float, n_bounces: int) -> None:
    # In a hollow ball every place gives the same share of its light to each other, so that what was reflected n times
    # is everywhere  flux / area · albedo^n / pi.  The lamp sends pi · 100 · 0.0016 W, and takes 0.1 % of the light.
    placement = place(tmp_path, HOLLOW, camera((0, -0.1, 0.2), 60, (8, 8), (1, -0.5, 0)))
    layers = {0: [lambert(albedo)]}
    once, often = (trace(placement, layers, SkyState(None), n, 256) for n in (1, n_bounces))
    edges = placement.scene.vertices[placement.scene.triangles].astype(np.float64)
    mine = placement.scene.object_of_triangle == 0
    area = np.linalg.norm(np.cross(edges[mine, 1] - edges[mine, 0], edges[mine, 2] - edges[mine, 0]), axis=1).sum() / 2
    expected = 100 * 0.0016 / area * sum(albedo**n for n in range(2, n_bounces + 1))
    assert (often.radiance - once.radiance).mean() == pytest.approx(expected, rel=0.01)


def test_each_bounce_has_its_own_materials(tmp_path: Path) -> None:
    # As above with the albedos 0.9, 0.5 and from the third bounce on 0.3: 0.9 · 0.5 + 0.9 · 0.5 · (0.3 + 0.3^2).
    placement = place(tmp_path, HOLLOW, camera((0, -0.1, 0.2), 60, (8, 8), (1, -0.5, 0)))
    rows, (first, *later) = np.arange(len(placement.hits.pixel)), [{0: [lambert(albedo)]} for albedo in (0.9, 0.5, 0.3)]
    halves = run_to_end(trace_halves(placement, first, SkyState(None), 4, 256, 0, rows, later))
    edges = placement.scene.vertices[placement.scene.triangles].astype(np.float64)
    mine = placement.scene.object_of_triangle == 0
    area = np.linalg.norm(np.cross(edges[mine, 1] - edges[mine, 0], edges[mine, 2] - edges[mine, 0]), axis=1).sum() / 2
    expected = 100 * 0.0016 / area * (0.9 * 0.5 + 0.9 * 0.5 * (0.3 + 0.3**2))
    assert (halves[:, :, 1] - halves[:, :, 0]).mean() == pytest.approx(expected, rel=0.01)


def test_any_albedo_stays_finite(tmp_path: Path) -> None:
    placement = place(tmp_path, HOLLOW, camera((0, 0, 0.2), resolution=(3, 3)))
    picture = run_to_end(render_paths(placement, {0: [lambert(1e12)]}, SkyState(None), 16, 4), lambda step: None)
    assert np.isfinite(picture).all() and picture.max() > 1e20


def test_darkness_is_black(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL)
    hidden = lambert(0.5).replace(visible=False)
    lit = SkyState(constant_environment(1.0))
    for layers, sky in (({0: [hidden]}, lit), ({}, lit), ({0: [lambert(0.5)]}, SkyState(None)),
                        ({0: [lambert(0.5)]}, SkyState(constant_environment(0.0)))):  # fmt: skip
        found = trace(placement, layers, sky, 3, 2)
        assert not found.radiance.any() and found.noise == 0.0


# --------------------------------------------------------------------------------------------------- the direct oracle


@pytest.mark.parametrize("model", sorted(MODELS))
def test_one_bounce_is_direct_light(tmp_path: Path, model: str) -> None:
    """Under a sky and a lamp, with an edited curve on the table and a plain one on the ball."""
    placement = place(tmp_path, BALL + LIT_TABLE)
    layers = {0: [plain(model), lambert(0.2)], 1: [edited(model)]}
    sky = SkyState(constant_environment([1.0, 0.5, 0.2]))
    n = len(placement.hits.pixel)
    rows = np.sort(np.random.default_rng(3).choice(n, 30, replace=False))
    found = trace(placement, layers, sky, 1, 512, rows=rows)
    truth = integrate_direct(
        placement.hits, rows, placement.caster, lambda i: layers.get(i, ()), sky.environment, 0.0,
        placement.patches(512), 5,
    )  # fmt: skip
    assert found.noise is not None and found.noise < 0.06
    error = np.sqrt(np.mean((found.radiance - truth) ** 2)) / truth.mean()
    # The oracle's own error, of directions a degree or two apart, is about half a percent.
    assert error < 1.5 * found.noise + 0.008
    assert found.radiance.mean() / truth.mean() == pytest.approx(1.0, abs=0.006 + found.noise / len(rows) ** 0.5)


# -------------------------------------------------------------------------------------------------------------- passes


def test_the_reported_noise_is_the_error_that_there_is(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL + LIT_TABLE)
    layers = {0: [make_layer(MODELS["rough_conductor"], {"alpha": 0.5})], 1: [lambert(0.7)]}
    sky = SkyState(constant_environment(0.5))
    truth = trace(placement, layers, sky, 3, 256, seed=9).radiance
    for n_samples in (2, 17, 32):
        found = trace(placement, layers, sky, 3, n_samples)
        error = np.sqrt(np.mean((found.radiance - truth) ** 2)) / truth.mean()
        assert found.noise == pytest.approx(error, rel=0.2)
    assert trace(placement, layers, sky, 3, 1).noise is None


def test_the_noise_of_halves_of_unequal_size() -> None:
    # 30 and 10 samples of variance 4 about 8: the mean of 40 is off by 2 / sqrt(40), relative to 8.
    samples = np.random.default_rng(4).normal(8.0, 2.0, (40, 5000, 3))
    halves = np.stack([samples[:30].sum(axis=0), samples[30:].sum(axis=0)])
    assert noise_of_halves(halves, np.array([30, 10])) == pytest.approx(2 / np.sqrt(40) / 8, rel=0.03)


def test_a_seed_gives_the_same_picture_again_and_another_one_another(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL + LIT_TABLE)
    layers, sky = {0: [lambert(0.5)], 1: [lambert(0.7)]}, SkyState(uneven_sky(), 20.0)
    a, b, c = (trace(placement, layers, sky, 2, 40, seed).radiance for seed in (1, 1, 2))
    assert np.array_equal(a, b) and not np.array_equal(a, c)


def test_progress_goes_up_to_one_and_tells_the_noise(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL)
    told = list(trace_paths(placement, {0: [lambert(0.5)]}, SkyState(uneven_sky()), 1, 64))
    fractions = [step.fraction for step in told]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert told[0].text == "0 of 64 samples a pixel" and told[0].noise is None
    half, last = next(step for step in told if step.noise is not None), told[-1]
    assert half.text == f"32 of 64 samples a pixel, noise {half.noise:.2%}"
    assert last.text == f"64 of 64 samples a pixel, noise {last.noise:.2%}" and 0.0 < last.noise < half.noise


@pytest.mark.parametrize(("n_bounces", "n_samples"), [(0, 1), (17, 1), (1, 0), (1, 1 << 21)])
def test_bounces_and_samples_out_of_range_are_refused(tmp_path: Path, n_bounces: int, n_samples: int) -> None:
    with pytest.raises(ValueError, match="expected 1 to"):
        next(trace_paths(place(tmp_path, BALL), {}, SkyState(None), n_bounces, n_samples))


# --------------------------------------------------------------------------------------------------------- references


@pytest.fixture
def reference(shared_reference: Path) -> Callable[[str], tuple[Placement, Layers, SkyState, np.ndarray]]:
    """A scene, and the rows of its points that its mask counts."""
    from app.project.project import open_project

    def opened(name: str) -> tuple[Placement, Layers, SkyState, np.ndarray]:
        project = open_project(str(shared_reference / f"{name}.toml"))
        placement = Placement(project.scene)
        layers: dict[int, list[Layer]] = {}
        for key, layer in project.layers.items():
            layers.setdefault(project.object_names.index(key.rpartition(".")[0]), []).append(layer)
        with Image.open(shared_reference / f"{name}_mask.png") as picture:
            mask = np.asarray(picture.convert("L")) > 127
        return placement, layers, project.sky, np.flatnonzero(mask.ravel()[placement.hits.pixel])

    return opened


@pytest.mark.parametrize("name", ["cornell", "teatray"])
def test_four_bounces_are_what_an_independent_path_tracer_finds(
    name: str, reference: Callable, shared_reference: Path
) -> None:
    placement, layers, sky, counted = reference(name)
    rows = np.sort(np.random.default_rng(1).choice(counted, 2500, replace=False))
    found = trace(placement, layers, sky, 4, 32, rows=rows)
    truth = read_radiance_image(shared_reference / f"{name}_4.exr").reshape(-1, 3)[placement.hits.pixel[rows]]
    assert found.noise is not None
    error = np.sqrt(np.mean((found.radiance - truth) ** 2)) / truth.mean()
    mean = found.radiance.mean() / truth.mean() - 1.0
    # A bounce less or more would change the Cornell box's mean by 2 % and 5 %.
    assert error < 1.15 * found.noise + 0.01 and abs(mean) < 3.0 * found.noise / np.sqrt(len(rows)) + 0.003


def test_samples_lower_the_noise(tmp_path: Path) -> None:
    placement = place(tmp_path, BALL + LIT_TABLE)
    layers = {0: [replace(lambert(0.5))], 1: [lambert(0.7)]}
    few, many = (trace(placement, layers, SkyState(uneven_sky()), 2, n).noise for n in (8, 128))
    # At least as fast as the square root of their number: a quarter.
    assert few is not None and many is not None and many < 0.27 * few
