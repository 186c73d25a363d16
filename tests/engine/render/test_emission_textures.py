"""Emission that varies over a surface, in pictures of every mode and in paths: against lamps of one colour each, which
shine as the parts of a textured one do; and surfaces that shine without light, which light nothing."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.project.project import open_project
from app.stills.stills import render_project
from tests.few_points import use_few_points
from tests.scene_text import camera, facing_down, facing_up, placed

MODES = ["placement", "orbit", "deform", "paths"]
WHITE = 'smooth = false\nlayer = [{ model = "lambert", albedo = 1.0 }]\n'
VIEW = camera((0, 0.35, 1.2), 35, (24, 16), head="bounces = 1\n")
FLOOR = placed("floor", "quad", facing_up(2), WHITE)
STRIPES = 'emission_texture = { texture = "stripes.png" }\n'


def picture(folder: Path, text: str, how: str) -> np.ndarray:
    (folder / "scene.toml").write_text(text)
    given = {"reference": True, "n_samples": 1024} if how == "paths" else {"mode": how}
    return render_project(open_project(str(folder / "scene.toml")), lambda *_: None, **given).picture  # type: ignore[arg-type]


def halved(folder: Path) -> None:
    """An image that is red on the left and, on the right, blue of which a quarter is white."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:, :32, 0], pixels[:, 32:, 2], pixels[32:, 48:] = 255, 255, 255
    Image.fromarray(pixels).save(folder / "stripes.png")


def lamp(name: str, colour: str, x: float, z: float, width: float, depth: float) -> str:
    """A rectangle that shines downwards; u of a quad that looks down grows along X, v along +Z there."""
    where = f"{width},0,0,{x}, 0,0,-1,0.8, 0,{depth},0,{z}, 0,0,0,1"
    return placed(name, "quad", where, f"emission = {colour}\n")


@pytest.mark.parametrize("how", MODES)
def test_a_textured_lamp_lights_as_lamps_of_its_colours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    halved(tmp_path)
    textured = placed("lamp", "quad", facing_down(1, (0, 0.8, 0)), "emission = [6, 3, 4]\n" + STRIPES)
    # The image's lower right quarter, where v < 1/2 and u > 3/4, is white.
    parts = lamp("red", "[6, 0, 0]", -0.25, 0.0, 0.5, 1.0) + lamp("white", "[6, 3, 4]", 0.375, -0.25, 0.25, 0.5)
    parts += lamp("blue", "[0, 0, 4]", 0.125, 0.0, 0.25, 1.0) + lamp("more", "[0, 0, 4]", 0.375, 0.25, 0.25, 0.5)
    found = picture(tmp_path, VIEW + FLOOR + textured, how)
    expected = picture(tmp_path, VIEW + FLOOR + parts, how)
    most = {"placement": 0.01, "orbit": 0.02, "deform": 0.03, "paths": 0.04}[how]
    assert expected.mean() > 0.05
    assert np.sqrt(np.mean((found - expected) ** 2)) < most * expected.mean()
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.5 * most)


@pytest.mark.parametrize("how", MODES)
def test_the_texture_is_seen_where_the_camera_sees_the_lamp(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    halved(tmp_path)
    text = camera((0, 0, 3), 15, (16, 16), head="bounces = 1\n") + FLOOR
    found = picture(tmp_path, text + placed("lamp", "quad", more="emission = [6, 3, 4]\n" + STRIPES), how)
    np.testing.assert_allclose(found[:, :7], np.broadcast_to([6, 0, 0], (16, 7, 3)), atol=1e-3)
    np.testing.assert_allclose(found[:, 9:11], np.broadcast_to([0, 0, 4], (16, 2, 3)), atol=1e-3)
    np.testing.assert_allclose(found[9:, 14:], np.broadcast_to([6, 3, 4], (7, 2, 3)), rtol=1e-3)


@pytest.mark.parametrize("how", MODES)
def test_what_is_unlit_is_seen_and_lights_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    use_few_points(monkeypatch)
    halved(tmp_path)
    card = "1,0,0,0, 0,1,0,0.5, 0,0,1,-0.6, 0,0,0,1"
    above = camera((0, 1.2, 1.6), 40, (24, 16), head="bounces = 1\n") + placed("floor", "quad", facing_up(8), WHITE)
    above += placed("lamp", "quad", facing_down(1, (0, 2.0, 0)), "emission = 5\n")
    black = placed("card", "quad", card, 'layer = [{ model = "lambert", albedo = 0.0 }]\n')
    unlit = placed("card", "quad", card, "emission = [6, 3, 4]\nunlit = true\n" + STRIPES)
    found = picture(tmp_path, above + unlit, how)
    expected = picture(tmp_path, above + black, how)
    on_card = (expected == 0.0).all(axis=2)
    inside = on_card & np.roll(on_card, 1, 1) & np.roll(on_card, -1, 1) & np.roll(on_card, 1, 0)
    assert 15 < inside.sum() < 300
    left, right = inside & (np.arange(24) < 10), inside & (np.arange(24) > 13)
    np.testing.assert_allclose(found[left], np.broadcast_to([6, 0, 0], found[left].shape), atol=1e-3)
    np.testing.assert_allclose(found[right][:, 2], 4.0, rtol=1e-3)
    around = [np.roll(on_card, (x, y), (1, 0)) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    away = ~np.any(around, axis=0)
    # The same floor under the same lamp, in the shadow of the same card.
    np.testing.assert_allclose(found[away], expected[away], rtol=0.05 if how == "paths" else 0.02, atol=1e-3)


@pytest.mark.parametrize("how", MODES)
def test_what_is_there_by_a_third_lights_by_a_third(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    use_few_points(monkeypatch)
    where, blend = facing_down(1, (0, 0.8, 0)), 'opacity = { mode = "blend", factor = 0.3 }\n'
    found = picture(tmp_path, VIEW + FLOOR + placed("lamp", "quad", where, "emission = 10\n" + blend), how)
    expected = picture(tmp_path, VIEW + FLOOR + placed("lamp", "quad", where, "emission = 3\n"), how)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=0.02)
