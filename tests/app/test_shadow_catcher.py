"""Shadow catchers: known shares of light in closed form, paths beside Placement, alpha, and files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import insitu
from app.document.commands import DuplicateObject, SetShadowCatcher
from app.project.assignments import set_path
from app.project.project import open_project
from app.stills.picture_layers import render_layers
from app.stills.shadow_catcher import caught_shadows
from app.stills.stills import picture_bytes, render_project
from engine.core.errors import InsituError
from engine.light.environment import LUMINANCE
from engine.render.crop import Crop, cropped
from tests.scene_text import camera, environment, facing_down, facing_up, material, placed

GREY = material('model = "lambert", albedo = [0.5, 0.5, 0.5]')
RED = material('model = "lambert", albedo = [0.9, 0.1, 0.05]')


def scene_under_a_disc(folder: Path, light: str, bounces: int = 1, paint: str = GREY, size: float = 1.0) -> str:
    """A floor, and a disc `size` m wide half a metre above it, seen from below its edge."""
    text = camera((1.6, 0.3, 0), 12, (16, 12), head=f"bounces = {bounces}\n") + light
    text += placed("floor", "quad", facing_up(20), GREY) + placed("disc", "disc", facing_down(size, (0, 0.5, 0)), paint)
    (folder / "scene.toml").write_text(text)
    return str(folder / "scene.toml")


def opened(source: str, background: str = "transparent") -> insitu.Scene:
    scene = insitu.open(source)
    scene["floor"].shadow_catcher = True
    scene.light.background = background
    return scene


def at_centre(picture: Any) -> np.ndarray:
    return np.asarray(picture)[5:7, 7:9].reshape(4, -1).mean(axis=0)


@pytest.mark.parametrize(("mode", "within"), [("placement", 0.01), ("paths", 0.02), ("orbit", 0.03), ("deform", 0.05)])
def test_below_a_disc_an_even_sky_is_hidden_by_its_share(tmp_path: Path, mode: Any, within: float) -> None:
    """Of a sky of constant radiance a disc of radius r at the height h hides r² / (r² + h²) of the irradiance below its
    middle: 1/2 with r = h. So much is alpha, and nothing is added; over a colour the rest of that is left."""
    scene = opened(scene_under_a_disc(tmp_path, environment()))
    assert at_centre(scene.image(mode, samples=256)) == pytest.approx([0.0, 0.0, 0.0, 0.5], abs=within)
    scene.light.background_colour = (0.2, 0.4, 0.8)
    assert at_centre(scene.image(mode, samples=256)) == pytest.approx([0.1, 0.2, 0.4], abs=within)
    scene.light.background = "environment"  # of radiance 1, itself seen through the floor
    scene.light.intensity = 3.0
    assert at_centre(scene.image(mode, samples=256)) == pytest.approx([1.5, 1.5, 1.5], abs=3.0 * within)


def test_the_umbra_of_a_sun_is_opaque_and_what_it_lights_is_not(tmp_path: Path) -> None:
    scene = opened(scene_under_a_disc(tmp_path, "", size=0.2))
    sun = scene.add("sun", "key", size=1.0)
    sun.direction = (0.0, 1.0, 0.0)
    alpha = scene.image()[..., 3]
    assert (alpha == 1.0).any() and (alpha == 0.0).any()  # to the last bit
    row = alpha[6]
    assert row[7] == 1.0 and row[0] == 0.0 and set(np.unique(np.round(row[[0, 1, -1, -2]], 6))) == {0.0}


def test_over_its_own_picture_it_is_the_picture_with_all(tmp_path: Path) -> None:
    """Grey light: channel by channel. With a red disc, whose light comes on top, in luminance: Y(s W + e) = Y(C)."""
    for paint, bounces in ((GREY, 1), (GREY, 2), (RED, 2)):
        source = scene_under_a_disc(tmp_path, environment(), bounces, paint)
        scene = insitu.open(source)
        scene.light.background = "transparent"
        whole = np.asarray(scene.image(bounces=bounces), np.float64)
        scene["floor"].shadow_catcher = True
        caught = np.asarray(scene.image(bounces=bounces), np.float64)
        own = 0.5 * np.ones(3)  # a floor of albedo 1/2 under a sky of radiance 1
        over = caught[..., :3] + (whole[..., 3:] - caught[..., 3:]) * own
        if paint == GREY:
            np.testing.assert_allclose(over, whole[..., :3], atol=0.004)
        np.testing.assert_allclose(over @ LUMINANCE, whole[..., :3] @ LUMINANCE, atol=0.004)


def test_placement_agrees_with_paths(tmp_path: Path) -> None:
    """Light and alpha, with two bounces, a lamp and the red disc."""
    lamp = placed("lamp", "quad", facing_down(0.6, (1.0, 1.5, 0.5)), "emission = [4, 4, 4]\n")
    source = scene_under_a_disc(tmp_path, environment((0.3, 0.4, 0.5)), 2, RED)
    Path(source).write_text(Path(source).read_text() + lamp)
    scene = opened(source)
    shown, traced = scene.image(bounces=2), scene.image("paths", bounces=2, samples=512)
    assert np.abs(shown[..., 3] - traced[..., 3]).max() < 0.03
    assert np.abs(shown[..., :3] - traced[..., :3]).max() < 0.02
    assert shown[..., 3].max() > 0.4 and shown[..., 3].min() < 0.1


@pytest.mark.parametrize("mode", ["orbit", "deform"])
def test_over_its_own_picture_it_is_the_picture_with_all_at_edges_too(tmp_path: Path, mode: Any) -> None:
    """In grey light, where the disc covers a part of the floor's darkest pixels."""
    text = camera((3, 1.5, 0), 40, (16, 12), head="bounces = 1\n") + environment()
    text += placed("floor", "quad", facing_up(20), GREY) + placed("disc", "disc", facing_down(1, (0, 0.5, 0)), RED)
    (tmp_path / "scene.toml").write_text(text)
    scene = insitu.open(str(tmp_path / "scene.toml"))
    scene.light.background = "transparent"
    whole = np.asarray(scene.image(mode))
    scene["floor"].shadow_catcher = True
    caught = np.asarray(scene.image(mode))
    edges = (caught[..., 3] > 0.55) & (caught[..., 3] < 0.95)
    assert edges.sum() >= 4
    below = whole[..., 3] == 1.0
    over = caught[..., :3] + (1.0 - caught[..., 3:]) * 0.5  # a floor of albedo 1/2 under a sky of radiance 1
    np.testing.assert_allclose(over[below], whole[below][:, :3], atol=0.01)


def test_a_crop_has_the_shadow_of_the_whole(tmp_path: Path) -> None:
    """Of pixels that a lamp covers in part, where catchers alone are in no pixel that is computed."""
    source = scene_under_a_disc(tmp_path, environment())
    lamp = placed("lamp", "quad", facing_up(0.2, (0.0, 0.1, 0.0)), "emission = [4, 4, 4]\n")
    Path(source).write_text(Path(source).read_text() + lamp)
    project = open_project(source, values=[("floor.shadow_catcher", True), ("light.background", "transparent")])
    whole = render_project(project, lambda step: None).picture
    light = whole[..., 0]
    rows, columns = np.nonzero((light > 0.4) & (light < 3.6))
    assert len(rows)
    for row, column in list(zip(rows.tolist(), columns.tolist(), strict=True))[:3]:
        crop = Crop(column / 16, row / 12, (column + 1) / 16, (row + 1) / 12)
        part = cropped(render_project(project, lambda step: None, crop=crop).picture, crop)
        np.testing.assert_allclose(part[0, 0], whole[row, column], atol=0.03)


@pytest.mark.parametrize(("mode", "within"), [("placement", 0.01), ("orbit", 0.02), ("deform", 0.03)])
def test_shadows_of_emitters_are_those_of_paths_with_and_without_the_object(
    tmp_path: Path, mode: Any, within: float
) -> None:
    """Of a lamp, and of a disc that shines and reflects, without a sky; emitters throw no shadows that are caught."""
    text = camera((0, 2.5, 2.5), 40, (16, 12), head="bounces = 1\n") + placed("floor", "quad", facing_up(20), GREY)
    text += placed("disc", "disc", facing_down(0.4, (0, 0.5, 0)), GREY)
    text += placed("lamp", "quad", facing_down(0.5, (0.4, 1.6, 0)), "emission = [12, 10, 8]\n")
    text += placed("shine", "disc", facing_down(0.2, (-0.5, 0.4, 0.4)), "emission = [1, 3, 6]\n" + GREY)
    (tmp_path / "scene.toml").write_text(text)
    scene = insitu.open(str(tmp_path / "scene.toml"))
    whole = np.asarray(scene.image("paths", samples=512), np.float64)
    scene["disc"].visible = False
    alone = np.asarray(scene.image("paths", samples=512), np.float64)
    scene["disc"].visible = True
    scene["floor"].shadow_catcher, scene.light.background = True, "transparent"
    caught = np.asarray(scene.image(mode), np.float64)
    on_floor = (caught[..., :3] == 0.0).all(axis=2)
    left = np.minimum(whole, alone) @ LUMINANCE / (alone @ LUMINANCE)
    assert on_floor.mean() > 0.7 and caught[..., 3][on_floor].max() > 0.7
    errors = np.abs(caught[..., 3] - (1.0 - left))[on_floor]
    assert errors.mean() < within and np.quantile(errors, 0.95) < 5.0 * within


def test_what_objects_throw_on_it_is_added() -> None:
    """In closed form: C = 1/2, 1 and 3 times W, alone, at an edge, and where nothing else is."""
    empty, share, others = np.array([0.2, 0.4, 0.6]), np.array([[1.0, 1.0, 0.25, 0.0]]), np.array([0.9, 0.5, 0.1])
    times = np.array([[0.5, 3.0, 0.5, 0.0]])
    light = times[..., None] * share[..., None] * empty
    whole = np.concatenate([light + (1.0 - share[..., None]) * others, np.ones((1, 4, 1))], axis=2)
    part = np.concatenate([light, share[..., None]], axis=2)
    alone = np.concatenate([np.broadcast_to(empty, (1, 4, 3)), np.ones((1, 4, 1))], axis=2)
    expected = np.array([
        [0.0, 0.0, 0.0, 0.5], [*(2.0 * empty), 0.0], [*(0.75 * others), 0.75 + 0.25 * 0.5], [*others, 1.0],
    ])  # fmt: skip
    found = caught_shadows(*(each.astype(np.float32) for each in (whole, part, alone)))
    np.testing.assert_allclose(found[0], expected, atol=1e-6)


def test_files_have_its_alpha_and_layers_its_shadow(tmp_path: Path) -> None:
    values = [("floor.shadow_catcher", True), ("light.background", "transparent")]
    project = open_project(scene_under_a_disc(tmp_path, environment()), values=values)
    still = render_project(project, lambda step: None)
    png = np.asarray(Image.open(io.BytesIO(picture_bytes(Path("x.png"), still.picture))))
    assert png[6, 8, 3] == round(255 * float(still.picture[6, 8, 3])) and 120 < png[6, 8, 3] < 135
    layers = render_layers(project, lambda step: None)
    np.testing.assert_allclose(layers.picture, still.picture, atol=2e-3)
    (shadow,) = [each for each in layers.layers if each.name == "shadow"]
    assert shadow.letters == "A" and shadow.values[6, 8] == pytest.approx(float(still.picture[6, 8, 3]), abs=2e-3)


@pytest.mark.parametrize("background", ["environment", "transparent", "colour"])
def test_lights_sum_to_the_picture_with_its_shadows(tmp_path: Path, background: str) -> None:
    """Within 1e-4, and so do direct light, indirect light and what is seen of emitters and sky. What the red disc
    throws on the floor is due to the lamp below it, whose light it is."""
    source = Path(scene_under_a_disc(tmp_path, environment((0.05, 0.06, 0.07)), 2, RED))
    lamp = placed("lamp", "quad", facing_up(0.3, (0.3, 0.1, 0.3)), "emission = [20, 20, 20]\n")
    source.write_text(source.read_text() + lamp)
    project = open_project(str(source), values=[("floor.shadow_catcher", True), ("light.background", background)])
    still = render_layers(project, lambda step: None)
    layers = {each.name: each.values for each in still.layers}
    behind = layers.get("background", 0.0)
    lights = layers["light_lamp"] + layers["light_environment"]
    own = layers["direct"] + layers["indirect"] + layers["emission"]
    for total in (lights, own):
        np.testing.assert_allclose(total + behind, still.picture[..., :3], atol=1e-4)
    assert all((layers[name] >= 0.0).all() for name in ("light_lamp", "light_environment", "direct", "indirect"))
    thrown = still.picture[6, 3, :3] if background == "transparent" else layers["indirect"][6, 3]
    assert thrown[0] > 0.01 and thrown[0] > 2.0 * thrown[1]
    plain = render_project(project, lambda step: None)
    np.testing.assert_allclose(still.picture, plain.picture, atol=0.02)


def test_an_added_plane_catches_shadows_and_duplicates_and_sessions_keep_it(tmp_path: Path) -> None:
    source = tmp_path / "scene.toml"
    source.write_text(
        camera((1.6, 0.3, 0), 12, (16, 12), head="bounces = 1\n") + environment()
        + placed("disc", "disc", facing_down(1, (0, 0.5, 0)), GREY)
    )  # fmt: skip
    scene = insitu.open(str(source))
    scene.add("plane", "floor", at=(0.0, 0.0, 0.0), size=20.0).shadow_catcher = True
    scene.light.background = "transparent"
    assert at_centre(scene.image())[3] == pytest.approx(0.5, abs=0.01)
    scene.save(tmp_path / "mine.insitu")
    again = insitu.open(str(tmp_path / "mine.insitu"))
    assert again["floor"].shadow_catcher and again.document == scene.document
    copied = DuplicateObject("floor", "other").apply(scene.document)
    assert copied.shadow_catchers == ("floor", "other")
    assert scene.undo() and scene.undo() and scene.document.shadow_catchers == ()


def test_lamps_catch_none_and_what_is_no_switch_is_refused(tmp_path: Path) -> None:
    lamp = placed("lamp", "quad", facing_down(0.6, (1.0, 1.5, 0.5)), "emission = [4, 4, 4]\n")
    source = scene_under_a_disc(tmp_path, environment())
    Path(source).write_text(Path(source).read_text() + lamp)
    document = open_project(source).document
    with pytest.raises(InsituError, match="lamp emits light: it catches no shadows"):
        SetShadowCatcher("lamp", True).apply(document)
    with pytest.raises(InsituError, match="expected true or false"):
        set_path(document, "floor.shadow_catcher", 3)
    caught = set_path(document, "floor.shadow_catcher", True).apply(document)
    assert SetShadowCatcher("floor", False).apply(caught) == document


def test_frames_around_the_scene_have_the_shadow(tmp_path: Path) -> None:
    from app.stills.frame_sequence import Frames, draw_here

    values = [("floor.shadow_catcher", True), ("light.background", "transparent")]
    project = open_project(scene_under_a_disc(tmp_path, environment()), values=values)
    for mode in ("placement", "orbit"):
        frames = list(draw_here(project, Frames(2, mode=mode), [0, 1], lambda step: None))
        for _, picture in frames:
            assert at_centre(picture)[3] == pytest.approx(0.5, abs=0.03)
