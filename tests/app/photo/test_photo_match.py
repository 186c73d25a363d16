"""A photograph to a material: pictures of known materials, of our own path tracer, become them again."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.commands.layers import SetEditable, SetFrozen, SetVisible
from app.document.commands.light import SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.objects import DuplicateObject
from app.document.light_mix import lights_of
from app.document.linked_layers import with_layer
from app.document.view_state import Viewpoint
from app.files.materials import Library
from app.photo.compared_points import compared_points
from app.photo.photo_match import _read, edit_of, linked_to, match_photo
from app.photo.photo_request import PhotoRequest
from app.project.project import Project, open_project
from app.stills.stills import render_picture, write_picture
from engine.core.camera import project as project_points
from engine.core.colour import encode_srgb
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.inverse.camera_fit import PointPair
from engine.inverse.change_operator import change_operator
from engine.inverse.photo import read_photo
from engine.inverse.photo_fit import PhotoFit, _State
from engine.inverse.photo_targets import Target
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.scene.builtin import builtin_environments
from engine.scene.description import Camera

SCENE = """version = 1
[camera]
position = [0.0, 1.1, 2.6]
target = [0.0, 0.35, 0.0]
fov_y = 34.0
resolution = [96, 72]
[environment]
file = "{environment}"
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.5,0,0,0, 0,0.5,0,0.5, 0,0,0.5,0, 0,0,0,1]
layer = [{layers}]
[[object]]
name = "ground"
primitive = "backdrop"
layer = [{{ model = "lambert", albedo = [0.4, 0.4, 0.4] }}]
"""
GLOSSY = '{{ model = "rough_conductor", alpha = {alpha}, scale = {scale} }}'
COATED = '{{ model = "lambert", albedo = {albedo} }}, ' + GLOSSY


def scene_of(
    folder: Path,
    name: str,
    layers: str,
    environment: str = "studio",
    more: str = "",
    change: tuple[str, str] = ("", ""),
) -> Project:
    shutil.copy(builtin_environments()[environment], folder)
    file = folder / f"{name}.toml"
    file.write_text(
        SCENE.replace(*change).format(environment=builtin_environments()[environment].name, layers=layers) + more
    )
    return open_project(str(file))


def photographed(project: Project, file: Path, bounces: int = 1, **changes) -> Path:
    """The scene's picture as a linear file, by our own transport."""
    picture = render_picture(project, lambda step: None, series=BounceSeries(bounces))
    write_picture(file, picture)
    return file


def matched(project: Project, photo: Path, **request):
    request.setdefault("n_bounces", 1)
    return run_to_end(match_photo(project, PhotoRequest("ball", photo, **request)))


def curve_error(outcome, truth: Project, layer: int, curve: str, n_bands: int = 64) -> float:
    """relRMSE of a curve times its scale."""
    found, wanted = (
        each.coefficients(curve, n_bands) * each.scale()
        for each in (outcome.match.layers[layer], truth.document.object("ball").layers[layer])
    )
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("photos")


@pytest.fixture(scope="module")
def start(folder) -> Project:
    return scene_of(folder, "start", GLOSSY.format(alpha=0.12, scale=1.0))


@pytest.fixture(scope="module")
def truth(folder) -> Project:
    return scene_of(folder, "truth", GLOSSY.format(alpha=0.25, scale=0.8))


@pytest.fixture(scope="module")
def photo(folder, truth) -> Path:
    return photographed(truth, folder / "truth.exr")


def test_finds_a_roughness_a_scale_and_a_curve(start, truth, photo):
    outcome = matched(start, photo)
    layer = outcome.match.layers[0]
    assert layer.values["alpha"] == pytest.approx(0.25, rel=0.1)
    assert curve_error(outcome, truth, 0, "theta_h") < 0.03
    assert outcome.match.error < 0.02 < outcome.match.before
    assert outcome.match.exposure == pytest.approx(1.0, rel=1e-3)


def test_finds_it_from_eight_bits_at_an_unknown_exposure(start, truth, photo, folder):
    light = render_picture(truth, lambda step: None, series=BounceSeries(1)) * 0.35
    code = np.round(255.0 * encode_srgb(np.clip(light, 0.0, 1.0))).astype(np.uint8)
    assert (code == 255).any()  # some of it is clipped
    Image.fromarray(code).save(folder / "truth.png")
    outcome = matched(start, folder / "truth.png")
    assert outcome.match.exposure == pytest.approx(0.35, rel=5e-3)
    assert curve_error(outcome, truth, 0, "theta_h") < 0.05


def test_finds_two_layers_with_light_between_surfaces(folder):
    of = {"alpha": 0.2, "scale": 0.3, "albedo": [0.1, 0.3, 0.5]}
    truth = scene_of(folder, "two", COATED.format(**of))
    start = scene_of(folder, "two_start", COATED.format(alpha=0.1, scale=0.6, albedo=[0.5, 0.5, 0.5]))
    photo = photographed(truth, folder / "two.exr", bounces=2)
    outcome = matched(start, photo, n_bounces=2)
    assert np.allclose(outcome.match.layers[0].values["albedo"], of["albedo"], atol=0.03)
    assert curve_error(outcome, truth, 1, "theta_h") < 0.05
    assert outcome.match.error < 0.02


def test_one_edit_makes_the_material(start, photo):
    outcome = matched(start, photo)
    document = outcome.edit.apply(start.document)
    assert document.object("ball").layers == outcome.match.layers
    assert outcome.edit.label == "match ball to a picture"


def test_what_is_found_holds_in_another_light(start, photo, folder, truth):
    outcome = matched(start, photo)
    look = Viewpoint(Camera(position=(1.9, 0.8, 1.7), target=(0.0, 0.4, 0.0), fov_y=34.0), (96, 72))
    elsewhere = scene_of(folder, "elsewhere", GLOSSY.format(alpha=0.25, scale=0.8), "hall")
    wanted = elsewhere.edited(elsewhere.document, look)
    found = elsewhere.edited(outcome.edit.apply(replace_material(elsewhere, start)), look)
    one, two = (render_picture(each, lambda step: None, series=BounceSeries(1)) for each in (found, wanted))
    assert np.linalg.norm(one - two) / np.linalg.norm(two) < 0.05


def replace_material(project: Project, source: Project):
    """The project's document with the ball of another."""
    ball = source.document.object("ball")
    return project.document.with_object(replace(project.document.object("ball"), layers=ball.layers))


def test_what_the_picture_does_not_determine_has_a_wide_band(start, photo):
    deviation = matched(start, photo).match.deviations
    (spread,) = deviation.values()
    relative = spread[:, 1] / matched(start, photo).match.layers[0].coefficients("theta_h", len(spread))[:, 1]
    assert relative[1:12].max() < 0.2  # the highlight
    assert relative[-1] > 0.4  # angles that hardly any pixel sees


def test_point_pairs_align_the_camera(start, truth, photo, folder):
    corners = [(x, 0.0, z) for x in (-0.6, 0.6) for z in (-0.5, 0.5)] + [(0.0, 1.0, 0.0), (0.45, 0.5, 0.2)]
    camera = truth.scene.description.camera
    seen = project_points(camera, (96, 72), np.array(corners) - np.array(camera.position))
    pairs = tuple(PointPair(tuple(place), corner) for place, corner in zip(seen.tolist(), corners, strict=True))
    turned = start.edited(start.document, Viewpoint(Camera(position=(1.5, 1.5, 2.0), target=(0.0, 0.3, 0.0)), None))
    outcome = matched(turned, photo, pairs=pairs)
    assert outcome.camera is not None
    assert outcome.camera.error < 0.1
    assert np.allclose(outcome.camera.camera.position, camera.position, atol=0.02)
    assert curve_error(outcome, truth, 0, "theta_h") < 0.05


def test_only_what_is_wanted_changes(start, photo):
    layer = matched(start, photo, targets=("0.alpha", "0.scale")).match.layers[0]
    assert not layer.edits
    assert layer.values["alpha"] == pytest.approx(0.25, rel=0.05)
    assert layer.values["scale"] == pytest.approx(0.8, rel=0.02)


def test_begins_with_a_material_of_the_library(start, photo):
    name = "Gold"
    outcome = matched(start, photo, start=name)
    document = outcome.edit.apply(start.document)
    assert document.object("ball").layers == outcome.match.layers
    model = Library().entry(name).material.layers[0].model
    assert document.object("ball").layers[0].model is model
    with pytest.raises(InsituError, match="no material 'nothing'"):
        matched(start, photo, start="nothing")


def test_a_curve_is_right_where_its_light_between_surfaces_is(folder):
    """The true curve is a fixed point: in the light that it makes it is found again from another, however bright the
    ground is."""
    bright = "albedo = [0.4, 0.4, 0.4]", "albedo = [0.9, 0.9, 0.9]"
    scene = scene_of(folder, "bright", GLOSSY.format(alpha=0.3, scale=1.0), change=bright)
    request = PhotoRequest("ball", photographed(scene, folder / "bright.exr", bounces=3), n_bounces=3)
    points = compared_points(scene, "ball", read_photo(request.file), "")
    view, still = run_to_end(points.view(scene, 3))
    known = scene.document.object("ball").layers
    curve = known[0].coefficients("theta_h", 64)
    change = change_operator(np.linspace(-0.8, 0.5, 64)[:, None] * curve, curve)
    layers = with_layer(known, 0, known[0].with_operators("theta_h", (change,)))
    fit = PhotoFit(view, still, 0, layers, [0], points.pixels(scene), [Target(0, "theta_h")], with_layer)
    lit = fit._with_light(_State(known, known, 1.0, np.zeros((0, 3)), known))
    found = fit._with_curves(replace(lit, starts=layers, layers=layers))
    one, other = (each[0].coefficients("theta_h", 64) for each in (found.layers, known))
    assert np.linalg.norm(one - other) < 0.04 * np.linalg.norm(other)


@pytest.mark.parametrize("ending", ["png", "jpg", "webp"])
def test_a_mask_of_any_format_says_which_pixels_count(photo, tmp_path, ending):
    """White at the right; a lossy edge is still one."""
    codes = np.zeros((72, 96, 3), np.uint8)
    codes[:, 50:] = 255
    Image.fromarray(codes).save(tmp_path / f"mask.{ending}", quality=90)
    read = _read(PhotoRequest("ball", photo, mask=tmp_path / f"mask.{ending}"))
    np.testing.assert_array_equal(read.usable, read_photo(photo).usable & (codes[..., 0] > 0))


def test_what_is_linked_to_the_object_does_not_say_how_it_was_exposed(start, photo):
    assert linked_to(start.document, "ball") == frozenset()
    assert linked_to(DuplicateObject("ball", "twin", linked=True).apply(start.document), "ball") == {"twin"}
    seen = read_photo(photo)
    with_ground, alone = (compared_points(start, "ball", seen, "", unknown) for unknown in ((), ("ground",)))
    objects = alone.placement.hits.objects
    assert set(objects[with_ground.rows]) == {0, 1} and set(objects[alone.rows]) == {0}


def test_layers_that_are_not_in_the_picture_are_refused(start, photo):
    hidden = start.document.object("ball").layers[0].replace(visible=False)
    shown = start.document.object("ball").layers[0].replace(name="upper")
    ball = replace(start.document.object("ball"), layers=(hidden, shown))
    with pytest.raises(InsituError, match="is hidden, expected a layer in the picture"):
        matched(replace(start, document=start.document.with_object(ball)), photo, targets=("0.scale",))


def test_a_layer_that_follows_another_gets_its_own_scale(start):
    """The leader's curves are written once, and what is the follower's own as well."""
    leader = start.document.object("ball").layers[0].replace(name="lead")
    follower = leader.replace(name="second", follows="lead")
    document = start.document.with_object(replace(start.document.object("ball"), layers=(leader, follower)))
    before = document.object("ball").layers
    after = with_layer(before, 1, before[1].with_parameter("scale", 0.25))
    after = with_layer(after, 0, after[0].with_parameter("alpha", 0.3))
    assert edit_of("ball", before, after).apply(document).object("ball").layers == after


def test_a_rotation_of_a_dark_environment_is_refused(folder):
    project = scene_of(folder, "dark", GLOSSY.format(alpha=0.2, scale=0.9))
    key = lights_of(project.document)[0]
    dark = project.edited(SetMix(key, "on", False).apply(project.document), Viewpoint(None, None))
    photo = photographed(project, folder / "dark.exr")
    with pytest.raises(InsituError, match="no environment that shines"):
        matched(dark, photo, finds_rotation=True)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (np.full((72, 96, 3), 255), "usable pixels of ball"),
        (np.full((1, 1, 3), 100), "1 usable pixels of ball"),
    ],
)
def test_refuses_a_picture_that_says_nothing(start, folder, values, line):
    Image.fromarray(values.astype(np.uint8)).save(folder / "bad.png")
    with pytest.raises(InsituError, match=line):
        matched(start, folder / "bad.png")


@pytest.mark.parametrize("value", [0.0, 1e-6, 1e6])
def test_a_picture_as_no_light_makes_it_has_a_finite_answer(start, truth, folder, value):
    """Black, or brighter than any material in this light at its exposure."""
    light = np.full((72, 96, 3), value, np.float32) * np.random.default_rng(1).uniform(0.9, 1.0, (72, 96, 3))
    write_picture(folder / "flat.exr", light.astype(np.float32))
    outcome = matched(start, folder / "flat.exr", exposure=1.0)
    for layer in outcome.match.layers:
        assert np.isfinite(layer.coefficients("theta_h", 64)).all()
        assert np.isfinite(layer.values["scale"])
    assert np.isfinite(outcome.match.error)
    outcome.edit.apply(start.document)


def test_without_any_light_it_is_refused(start, photo):
    dark = replace(start.document, light=replace(start.document.light, intensity=0.0))
    with pytest.raises(InsituError, match="light.intensity = 0, expected more"):
        matched(replace(start, document=dark), photo, exposure=1.0)


def test_finds_how_the_environment_was_turned(start, folder):
    turned = start.edited(SetRotation(117.0).apply(start.document), Viewpoint(None, None))
    photo = photographed(turned, folder / "turned.exr")
    outcome = matched(start, photo, finds_rotation=True, targets=("0.alpha", "0.scale"))
    document = outcome.edit.apply(start.document)
    assert document.light.rotation == pytest.approx(117.0, abs=1.5)
    assert outcome.match.layers[0].values["alpha"] == pytest.approx(0.12, rel=0.1)


def test_finds_how_strong_each_light_was(folder):
    lamp = """
[[object]]
name = "lamp"
primitive = "quad"
transform = [0.4,0,0,0.8, 0,0,-0.4,1.6, 0,0.4,0,0.5, 0,0,0,1]
emission = [9.0, 9.0, 9.0]
"""
    start = scene_of(folder, "lit", GLOSSY.format(alpha=0.2, scale=0.9), more=lamp)
    weaker = SetMix("lamp", "strength", -1.5).apply(start.document)
    photo = photographed(start.edited(weaker, Viewpoint(None, None)), folder / "lit.exr")
    outcome = matched(start, photo, finds_lights=True)
    mix = outcome.edit.apply(start.document).light
    environment = next(key for key in lights_of(start.document) if key != "lamp")
    between = mix.row("lamp").strength - mix.row(environment).strength
    assert between == pytest.approx(-1.5, abs=0.1)
    assert outcome.match.error < 0.03


@pytest.mark.parametrize(
    ("request_", "line"),
    [
        ({"targets": ("7.alpha",)}, "expected LAYER.NAME"),
        ({"targets": ("0.eta",)}, "expected theta_h"),
        ({"transfer": "log"}, "expected srgb, linear or a gamma"),
        ({"exposure": -1.0}, "exposure = -1"),
        ({"longer_side": 4}, "longer side = 4"),
        ({"n_bounces": -1}, "bounces = -1, expected 1 to 16"),
        ({"pairs": (PointPair((0.0, 0.0), (0.0, 0.0, 0.0)),)}, "1 point pairs, expected 4 or more"),
    ],
)
def test_refuses_bad_requests_in_one_line(start, photo, request_, line):
    with pytest.raises(InsituError, match=line):
        matched(start, photo, **request_)


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (SetEditable("ball", False), "ball is fixed; make it editable"),
        (SetFrozen("ball.0", True), "ball has no layer that can be edited"),
        (SetVisible("ball", False), "ball is hidden; show it"),
    ],
)
def test_what_cannot_be_edited_is_refused_in_one_line(start, photo, command, line):
    locked = start.edited(command.apply(start.document), Viewpoint(None, None))
    with pytest.raises(InsituError, match=line):
        matched(locked, photo)
