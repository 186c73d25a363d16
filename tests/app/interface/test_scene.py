"""The Python interface: edits, pictures that keep their transport, errors, files."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import insitu
from app.interface import pictures as placement
from app.interface.pictures import Mode
from engine.core.generators import run_to_end
from engine.precompute.indirect import reflection
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.render import error_estimate
from engine.render.still import reflected_light
from tests.few_points import use_few_points
from tests.scene_text import LAMBERT, camera, environment, facing_down, facing_up, material, placed, scaled

ROOT = Path(__file__).resolve().parents[3]
BALL = 'model = "lambert", name = "paint"', 'model = "rough_conductor", name = "gloss", alpha = 0.4'
SCENE = (
    camera((0.0, 1.2, 3.0), 40, (24, 18), (0, 0.3, 0), "bounces = 1\n")
    + environment((0.4, 0.5, 0.7))
    + placed("ground", "quad", facing_up(3), LAMBERT)
    + placed("ball", "sphere", scaled(0.4, (0, 0.4, 0)), material(*BALL))
    + placed("lamp", "quad", facing_down(0.4, (0, 2, 0)), "emission = [9.0, 8.0, 6.0]\n")
)


@pytest.fixture(autouse=True)
def few_points_and_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    use_few_points(monkeypatch, n_points=100, n_rays=64)
    monkeypatch.setattr(placement, "STILL", ROUGH)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def cube_file(tmp_path: Path) -> Path:
    """The scene with a cube for the ball: few vertices at which Orbit and Deform compute transfer."""
    path = tmp_path / "cube.toml"
    path.write_text(SCENE.replace('"sphere"', '"cube"'))
    return path


def edit_in_some_way(scene: insitu.Scene, way: int, amount: float) -> None:
    """One of several edits; amount in [0, 1]."""
    ball, gloss = scene["ball"], scene["ball"]["gloss"]
    match way:
        case 0:
            gloss["theta_h"].amplify(y=0.5 + amount, region=(0.0, 0.0, 0.3, 0.3 + amount))
        case 1:
            gloss["theta_d"].translate(y=0.3 * amount, region=(0.2, 0.4, 0.9, 1.2))
        case 2:
            ball["paint"].albedo = (amount, 0.5, 0.2)
        case 3:
            ball["paint"].visible = amount > 0.5
        case 4:
            scene["lamp"].emission = (9.0 * amount, 2.0, 1.0)
        case 5:
            scene.light.intensity = 0.5 + amount
        case 6:
            gloss["theta_h"].reset()
        case 7:
            scene.camera.position = (0.3 * amount, 1.2, 3.0)


N_WAYS = 8


@pytest.mark.parametrize("seed", [1, 2])
def test_pictures_do_not_depend_on_those_before(file: Path, seed: int) -> None:
    """After any edits, with pictures in between, the picture is that of a scene that was edited alike at once."""
    choice, edited, plain = random.Random(seed), insitu.open(file), insitu.open(file)
    plain.image()  # plans the layers as they were opened
    edited.image()
    for _ in range(7):
        way, amount = choice.randrange(N_WAYS), choice.random()
        for scene in (edited, plain):
            edit_in_some_way(scene, way, amount)
        edited.image()
    plain._pictures = type(plain._pictures)()
    plain._pictures._placement._planned = edited._pictures._placement._planned
    np.testing.assert_allclose(edited.image(), plain.image(), rtol=2e-4, atol=2e-6)


def test_undo_gives_back_the_picture_to_the_last_bit(file: Path) -> None:
    choice, scene = random.Random(3), insitu.open(file)
    before, document, viewpoint = scene.image(), scene.document, scene.viewpoint
    for _ in range(6):
        edit_in_some_way(scene, choice.randrange(N_WAYS), choice.random())
    n_undone = 0
    while scene.undo() is not None:
        n_undone += 1
    assert 1 <= n_undone <= 6  # an edit that changes nothing is no step
    assert (scene.document, scene.viewpoint) == (document, viewpoint)
    np.testing.assert_array_equal(scene.image(), before)
    while scene.redo() is not None:
        pass
    assert scene.document != document or scene.viewpoint != viewpoint


def test_transport_is_made_anew_only_where_it_must_be(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    original = placement.project_layer
    monkeypatch.setattr(placement, "project_layer", lambda *a: made.append(a[3].model) or original(*a))
    scene = insitu.open(file)
    scene.image()
    assert sorted(made) == ["lambert", "lambert", "rough_conductor"]
    made.clear()
    gloss = scene["ball"]["gloss"]
    gloss["theta_h"].amplify(y=2.0)
    scene["ball"]["paint"].albedo = 0.1
    before = scene.image()
    assert made == []
    gloss.alpha = 0.3  # Smith's G stands in the quotient
    draft = scene.image(draft=True)
    assert made == [] and (draft != before).any()
    exact = scene.image()
    assert made == ["rough_conductor"] and (exact != draft).any()
    made.clear()
    scene.light.rotation = 30.0
    scene.image()
    assert len(made) == 3


def test_light_that_bounces_is_frozen_between_edits(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After an edit how layers weigh rays is not found again, and the sum is that of rays of which nothing is kept."""
    aimed: list[int] = []
    original = reflection.RayWeights
    monkeypatch.setattr(reflection, "RayWeights", lambda *a: aimed.append(1) or original(*a))
    scene = insitu.open(file)
    first = scene.image(bounces=3)
    aimed.clear()
    scene["ball"]["gloss"]["theta_h"].amplify(y=2.0)
    edited = scene.image(bounces=3)
    assert aimed == [] and (edited != first).any()
    pictures = scene._pictures._placement
    kept, hits = pictures._indirect, pictures._made()[0].placement.hits
    assert kept is not None and kept.radiance is not None
    _, layers, _ = pictures._radiance(scene._project, 3)
    assert aimed == []
    unfrozen = run_to_end(reflected_light(kept.light, layers, None, hits))
    assert len(aimed) == 3  # layers
    np.testing.assert_allclose(kept.radiance, unfrozen, rtol=1e-6, atol=1e-7)
    scene["ball"]["gloss"].alpha = 0.3
    scene.image(bounces=3)
    assert len(aimed) == 3 + 1


def test_other_modes_show_the_same_scene(cube_file: Path) -> None:
    """Means within a tenth of those of paths; Deform's light is soft, and of lamps it shows what is seen of them."""
    scene = insitu.open(cube_file)
    scene["lamp"].emission = 0.0
    paths = scene.image("paths", samples=16, bounces=1)
    for mode in ("placement", "orbit", "deform"):
        picture = scene.image(mode, bounces=1)  # type: ignore[arg-type]
        assert picture.shape == (18, 24, 3) and picture.dtype == np.float32
        assert picture.mean() == pytest.approx(paths.mean(), rel=0.1), mode
        scene.camera.orbit(20.0)
        assert (scene.image(mode, bounces=1) != picture).any()  # type: ignore[arg-type]
        scene.undo()


def test_bounces_and_resolution_are_of_one_picture(file: Path) -> None:
    scene = insitu.open(file)
    once, twice = scene.image(), scene.image(bounces=2)
    assert twice.mean() > 1.003 * once.mean()  # light between ball and ground
    np.testing.assert_array_equal(scene.image(), once)
    assert scene.image(resolution=(20, 10)).shape == (10, 20, 3)
    assert scene.image().shape == (18, 24, 3)


def test_the_error_is_estimated(cube_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(error_estimate, "N_TRUTH_SAMPLES", 2)
    scene = insitu.open(cube_file, resolution=(16, 12))
    direct, both = scene.error(bounces=1), scene.error(bounces=2)
    assert 0.0 <= direct.overall < 0.1 and direct.indirect is None
    assert 0.0 <= both.overall < 0.1 and both.indirect is not None
    assert 0.0 <= scene.error("orbit", bounces=1).overall < 0.05


def test_what_is_saved_opens_again(file: Path, tmp_path: Path) -> None:
    scene = insitu.open(file)
    with pytest.raises(insitu.Error, match=r"expected a path that ends in \.insitu"):
        scene.save()
    edit_in_some_way(scene, 0, 0.5)
    edit_in_some_way(scene, 7, 0.5)
    session = scene.save(tmp_path / "edited.insitu")
    again = insitu.open(session)
    assert again.document == scene.document
    np.testing.assert_allclose(again.image(), scene.image(), rtol=1e-4, atol=1e-6)
    edit_in_some_way(again, 2, 0.5)
    assert again.save() == session
    assert insitu.open(session).document == again.document
    for name in ("picture.exr", "picture.png"):
        assert scene.save(tmp_path / name).stat().st_size > 100


def test_a_notebook_shows_the_picture(file: Path) -> None:
    assert insitu.open(file)._repr_png_().startswith(b"\x89PNG")


def test_nodes_say_what_they_have(file: Path) -> None:
    scene = insitu.open(file)
    gloss = scene["ball"]["gloss"]
    assert list(scene) == ["ground", "ball", "lamp"] and list(scene["ball"]) == ["paint", "gloss"]
    assert {"alpha", "eta", "visible"} <= set(dir(gloss))
    gloss.alpha = np.float32(0.25)
    gloss.eta = np.array([1.0, 1.1, 1.2])
    assert gloss.alpha == 0.25 and gloss.eta == pytest.approx((1.0, 1.1, 1.2))
    scene["ball"].bend = 20.0
    assert scene["ball"].bend == 20.0 and scene["lamp"].emission == (9.0, 8.0, 6.0)
    curve = gloss["theta_h"]
    curve.translate(x=0.1, y=0.2, region=(0.1, 0.4, 0.8, 1.1))
    assert [(each.kind, each.axis, each.joined) for each in curve.operators] == [  # type: ignore[union-attr]
        ("translate", "y", True), ("translate", "x", False)
    ]  # fmt: skip
    assert scene.undo() is not None and curve.operators == ()  # one edit, one step


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ("insitu.open(3)", "open: 3, expected the name of a scene or a path"),
        ('insitu.open("nowhere.toml")', "nowhere.toml: no such file"),
        ("insitu.open(file, resolution=(0, 3))", "resolution = (0, 3), expected (width, height)"),
        ("insitu.open(file, resolution=3)", "resolution = 3, expected (width, height)"),
        ('scene["pot"]', "there is no object 'pot'; available: ground, ball, lamp"),
        ('scene["ball"]["varnish"]', "there is no layer of ball 'varnish'"),
        ('scene["ball"]["gloss"]["theta_i"]', "there is no curve 'theta_i' of ball.1; available: theta_h, theta_d"),
        ('scene["ball"].set_emission', "there is no layer of ball 'set_emission'"),
        ('setattr(scene["ball"]["gloss"], "alpha", 7)', "alpha = 7, expected a number from"),
        ('setattr(scene["ball"]["gloss"], "roughness", 1)', "there is no curve or parameter of ball.1 'roughness'"),
        ('setattr(scene["ball"], "emission", 1)', "ball is not an emitter"),
        ('setattr(scene.light, "rotation", "left")', "light.rotation: value = left, expected a number"),
        ('setattr(scene.camera, "fov_y", 400)', "fov_y = 400, expected"),
        ('setattr(scene.camera, "lens", 50)', "lens = 50, expected one of position, target, up, fov_y"),
        ('scene["ball"]["gloss"]["theta_h"].amplify()', "amplify: expected y, x, or both"),
        ('scene["ball"]["gloss"]["theta_h"].amplify(y=1, region=(2, 1))', "expected a <= b <= c <= d"),
        (
            'scene["ball"]["gloss"]["theta_h"].amplify(y=1, region=(1, 2, 3))',
            "region = (1, 2, 3), expected two or four",
        ),
        ('scene.image("preview")', "mode = 'preview', expected one of placement, orbit, deform, paths"),
        ("scene.image(bounces=0)", "bounces = 0, expected 1 to 16"),
        ('scene.image("paths", samples=0)', "samples = 0, expected a whole number from 1"),
        ('scene.error("paths")', "paths know no error of theirs"),
        ('scene.save("picture.jpg")', "picture.jpg: expected a path that ends in .insitu, .exr or .png"),
    ],
)
def test_what_is_wrong_ends_in_one_line(file: Path, wrong: str, line: str) -> None:
    scene = insitu.open(file)
    before = scene.document, scene.viewpoint
    with pytest.raises(insitu.Error) as caught:
        eval(wrong, {"insitu": insitu, "scene": scene, "file": file})
    assert line in str(caught.value) and "\n" not in str(caught.value)
    assert (scene.document, scene.viewpoint) == before


def test_nothing_is_imported_with_the_package_and_no_window_with_a_picture(file: Path) -> None:
    program = f"""
import sys
there = set(sys.modules)
import insitu
came = {{name.split(".")[0] for name in set(sys.modules) - there}} - sys.stdlib_module_names
if came != {{"insitu"}}:
    sys.exit(f"imported with insitu: {{came}}")
insitu.open({str(file)!r}, resolution=(8, 6)).image()
windows = sorted({{"ui", "glfw", "imgui_bundle", "moderngl", "glcontext", "matplotlib"}} & set(sys.modules))
if windows:
    sys.exit(f"imported with a picture: {{windows}}")
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform", "paths"])
def test_a_picture_without_its_environment_is_the_rest_of_it(cube_file: Path, mode: Mode) -> None:
    """Over the sky that it leaves out it is the picture as before, and over a colour that colour shows: alpha is the
    share of each pixel that is covered, whose light has it as a factor."""
    scene = insitu.open(cube_file)
    whole = scene.image(mode, samples=2)
    scene.light.background = "transparent"
    picture = scene.image(mode, samples=2)
    light, alpha = picture[..., :3], picture[..., 3:]
    assert whole.shape[2] == 3 and picture.shape[2] == 4 and alpha.min() == 0.0 and alpha.max() == 1.0
    np.testing.assert_allclose(light + (1.0 - alpha) * (0.4, 0.5, 0.7), whole, atol=1e-5)
    # The intensity multiplies the light alone.
    scene.light.background_colour, scene.light.intensity = (0.1, 0.0, 2.0), 3.0
    assert scene.light.background == "colour"
    expected = 3.0 * light + (1.0 - alpha) * (0.1, 0.0, 2.0)
    np.testing.assert_allclose(scene.image(mode, samples=2), expected, rtol=1e-5, atol=1e-5)


def test_a_light_is_placed_in_the_picture_and_what_hides_it_is_said() -> None:
    """The camera mirrors it where it was told to, and a wall that is put up in front of it is named."""
    scene = insitu.open("shapes", resolution=(48, 32))
    scene.add("sphere light", "key", at=(0.0, 1.5, 0.0))
    scene.add("sun", "Noon")
    scene.light.rotation = 0.0
    assert scene.place_light("Noon", highlight=(24, 30)) == ""
    assert scene.place_light("key", highlight=(24, 30)) == ""
    placed = np.array(scene["key"].position)
    assert scene.undo() == "place key" and scene.redo() == "place key"
    centre = np.array([0.0, 1.5, 0.0]) + placed
    point = ground_at(scene, 24, 30)
    towards = (centre - point) / np.linalg.norm(centre - point)
    np.testing.assert_allclose(scene.light["Noon"].direction, towards, atol=2e-3)
    half = towards + unit(np.array(scene.camera.position) - point)
    np.testing.assert_allclose(unit(half), (0.0, 1.0, 0.0), atol=2e-3)
    scene.add("box", "wall", at=tuple(point + 0.5 * (centre - point)), size=0.3)
    assert scene.place_light("key", highlight=(24, 30)) == "key is placed, but wall hides it from that point"
    assert scene.place_light("Noon", highlight=(24, 30)) == "Noon is placed, but wall hides it from that point"
    np.testing.assert_allclose(scene["key"].position, placed, atol=1e-9)
    with pytest.raises(insitu.Error, match="exactly one of highlight and shadow"):
        scene.place_light("key")
    with pytest.raises(insitu.Error, match="pixel 24, 0 sees no surface"):
        scene.place_light("key", highlight=(24, 0))
    with pytest.raises(insitu.Error, match="cube is no light"):
        scene.place_light("cube", highlight=(24, 30))


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def ground_at(scene: insitu.Scene, column: int, row: int) -> np.ndarray:
    """The point of the ground, at height 0, that the middle of a pixel sees."""
    eye, target = np.array(scene.camera.position), np.array(scene.camera.target)
    forward = unit(target - eye)
    right = unit(np.cross(forward, (0.0, 1.0, 0.0)))
    height = np.tan(np.radians(scene.camera.fov_y) / 2.0)
    x, y = (column + 0.5 - 24.0) / 16.0, (16.0 - row - 0.5) / 16.0
    ray = forward + height * (x * right + y * np.cross(right, forward))
    return eye - ray * eye[1] / ray[1]


def test_objects_are_moved_together_dropped_and_lights_aimed() -> None:
    scene = insitu.open("shapes", resolution=(48, 32))
    scene.add("box", "plinth", at=(0.0, 0.0, 5.0), size=0.2)
    scene.add("box", "lid", at=(0.0, 0.0, 6.0), size=0.2)
    scene.move(["plinth", "lid"], rotate=(0.0, 180.0, 0.0))  # they change places
    assert scene["plinth"].position == pytest.approx((0.0, 0.0, 1.0))
    assert scene["lid"].position == pytest.approx((0.0, 0.0, -1.0))
    scene.move("lid", by=(0.0, 0.5, 1.0))
    scene.drop("lid")  # onto the plinth, which is 0.2 m high
    assert scene["lid"].position == pytest.approx((0.0, 0.2, 0.0), abs=1e-6)
    scene.move("lid", by=(0.5, 0.0, 0.0))
    scene.drop("lid")  # beside it and the ground, whose lower side is the lowest of all
    assert scene["lid"].position == pytest.approx((0.5, -0.02, 0.0), abs=1e-6)
    scene.add("spot light", "key", at=(0.0, 1.0, 5.0))
    scene.aim("key", (1.0, 1.0, 5.0))
    assert scene["key"].rotation == pytest.approx((0.0, 0.0, 90.0), abs=1e-6)
    with pytest.raises(insitu.Error, match="shines to all sides"):
        scene.aim("lid", (0.0, 0.0, 0.0))
    with pytest.raises(insitu.Error, match="no object 'cup'"):
        scene.move(["lid", "cup"], by=(1.0, 0.0, 0.0))
