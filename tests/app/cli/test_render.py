"""`insitu render`: whole pictures, in the formats that were asked for."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.light.radiance_files import read_radiance_image
from tests.app.cli.command_line import SCENE, run
from tests.app.limits import largest_file
from tests.colour_configs import write_config
from tests.scene_text import environment, facing_down, placed

Captured = pytest.CaptureFixture[str]


def test_render_writes_linear_radiance(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    output = tmp_path / "new" / "a.exr"
    values = ("--set", "ball.chalk.albedo=[0.5, 1, 0]", "--set", "light.intensity=2")
    assert run("render", scene, "-o", output, "--resolution", "32", "20", *values) == 0
    image = read_radiance_image(output)
    assert image.shape == (20, 32, 3)
    # Sky 0.5, doubled; a convex thing of albedo (1/2, 1, 0) under it.
    assert image[10, 16] == pytest.approx([0.5, 1.0, 0.0], abs=0.01) and image[0, 0] == pytest.approx([1.0, 1.0, 1.0])
    assert "32 x 20" in capsys.readouterr().out
    assert [file.name for file in output.parent.iterdir()] == ["a.exr"]


def test_intensity_multiplies_lamps_as_well_as_the_sky(tmp_path: Path) -> None:
    scene = tmp_path / "lamp.toml"
    lamp = placed("lamp", "quad", facing_down(1, (0, 1.2, 0.5)), "emission = [6, 5, 4]\n")
    scene.write_text(SCENE.replace(environment(0.5), "") + lamp)
    pictures = {}
    for intensity in (1, 3):
        output = tmp_path / f"{intensity}.exr"
        assert run("render", scene, "-o", output, "--set", f"light.intensity={intensity}") == 0
        pictures[intensity] = read_radiance_image(output)
    # Lit by the lamp alone; the ball's upper half is bright.
    assert pictures[1].max() > 0.2
    np.testing.assert_array_equal(pictures[3], np.float32(3) * pictures[1])


def test_reference_is_the_same_picture(scene: Path, tmp_path: Path) -> None:
    words = ("render", scene, "--resolution", "10", "8")
    assert run(*words, "-o", tmp_path / "a.exr") == 0 and run(*words, "-o", tmp_path / "b.exr", "--reference") == 0
    ours, truth = read_radiance_image(tmp_path / "a.exr"), read_radiance_image(tmp_path / "b.exr")
    assert np.abs(ours - truth).max() < 0.02 * truth.max()


def test_bounces_by_brute_force_change_nothing_about_a_convex_thing(
    scene: Path, tmp_path: Path, capsys: Captured
) -> None:
    words = ("--bounces", "3", "--reference", "--samples", "256", "--set", "light.intensity=2")
    assert run("render", scene, "-o", tmp_path / "a.exr", "--resolution", "12", "8", *words) == 0
    image = read_radiance_image(tmp_path / "a.exr")
    assert re.search(r"12 x 8, .* s, noise [0-3]\.\d\d%", capsys.readouterr().out)
    # White under a sky of 0.5, doubled: all of it is 1.
    assert image.shape == (8, 12, 3) and np.abs(image - 1.0).max() < 0.05 and abs(image.mean() - 1.0) < 0.003


def test_render_to_png_is_what_the_screen_shows(scene: Path, tmp_path: Path) -> None:
    assert run("render", scene, "-o", tmp_path / "a.png", "--lights", "200") == 0
    with Image.open(tmp_path / "a.png") as image:
        # Filmic of 0.5: 0.6425/1.0425 = 0.6163, in sRGB 0.806 of 255.
        assert image.size == (24, 16) and image.getpixel((0, 0)) == (206, 206, 206)


def test_a_view_is_chosen_by_name(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    words = ("render", scene, "--lights", "200", "--resolution", "6", "4", "-o")
    assert run(*words, tmp_path / "a.png", "--view", "standard") == 0
    with Image.open(tmp_path / "a.png") as image:
        assert image.getpixel((0, 0)) == (188, 188, 188)  # 0.5 in sRGB is 0.735 of 255
    assert run(*words, tmp_path / "a.png", "--view", "sepia") == 1
    assert "insitu: view: name = sepia, expected Filmic, AgX, ACES 2.0, ACES 1.3, Standard" in capsys.readouterr().err
    assert run(*words, tmp_path / "a.exr", "--view", "agx") == 1
    assert "holds light itself, expected a name that ends in .png" in capsys.readouterr().err


def test_views_of_a_configuration_are_chosen_by_name(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    config, output = write_config(tmp_path), tmp_path / "a.png"
    words = ("render", scene, "--lights", "200", "--resolution", "6", "4", "-o", output, "--ocio", config)
    # Of 0.5: 0.735 in sRGB; a quarter of it, 0.125, on the curve x^2 (3 - 2x) is 0.0430; 0.5^(1/2.2) is 0.7297.
    for view, level in ((), 188), (("--view", "Film"), 11), (("--view", "Projector: Plain"), 186):
        assert run(*words, *view) == 0
        with Image.open(output) as image:
            assert image.getpixel((0, 0)) == pytest.approx((level, level, level), abs=1)
    capsys.readouterr()
    assert run(*words, "--view", "Cinema") == 1
    assert re.search(r"insitu: .*Cinema.*expected .*Film", capsys.readouterr().err)
    assert run(*words[:-1], tmp_path / "none.ocio") == 1
    assert "none.ocio" in capsys.readouterr().err
    assert run(*(tmp_path / "a.exr" if word is output else word for word in words)) == 1
    assert "holds light itself, expected a name that ends in .png" in capsys.readouterr().err


def test_an_old_picture_survives_a_failed_one(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    output = tmp_path / "a.exr"
    output.write_bytes(b"old")
    with largest_file(100):
        assert run("render", scene, "-o", output, "--lights", "50") == 1
    assert f"insitu: {output}: not written, File too large; what was there is untouched" in capsys.readouterr().err
    assert output.read_bytes() == b"old" and len(list(tmp_path.glob("*a.exr*"))) == 1


def test_edges_are_smooth_by_default(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    """A ball that is darker than the sky: between the two there are pixels that show both."""
    values = ("--resolution", "32", "20", "--set", "ball.chalk.albedo=0.5")
    levels = {}
    for edges in ((), ("--edges", "0")):
        assert run("render", scene, "-o", tmp_path / "a.exr", *values, *edges) == 0
        image = read_radiance_image(tmp_path / "a.exr")
        levels[edges] = np.mean((image > 0.3) & (image < 0.45))
    assert levels[()] > 0.015 and levels["--edges", "0"] < 0.005
    capsys.readouterr()
    assert run("render", scene, "-o", tmp_path / "a.exr", "--edges", "5") != 0
    assert "--edges 5: expected one of 0, 4, 8, 16" in capsys.readouterr().err


def test_exposure_and_gamma_are_of_png_files(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    words = ("render", scene, "-o", tmp_path / "a.png", "--lights", "200", "--view", "standard")
    assert run(*words, "--exposure", "-1", "--gamma", "2") == 0
    with Image.open(tmp_path / "a.png") as image:
        # 0.5 a stop darker is 0.25, in sRGB 0.5371; its square root is 0.7329, of 255: 187.
        assert image.getpixel((0, 0)) == (187, 187, 187)
    for option in ("--exposure", "--gamma"):
        capsys.readouterr()
        assert run("render", scene, "-o", tmp_path / "a.exr", option, "1") == 1
        assert "holds light itself, expected a name that ends in .png" in capsys.readouterr().err


@pytest.mark.parametrize("mode", ["placement", "orbit"])
def test_a_crop_is_that_part_of_the_picture(scene: Path, tmp_path: Path, capsys: Captured, mode: str) -> None:
    words, sides = ("--resolution", "24", "16", "--mode", mode), ("--crop", "0.25", "0.5", "0.75", "1")
    assert run("render", scene, "-o", tmp_path / "whole.exr", *words) == 0
    assert run("render", scene, "-o", tmp_path / "part.exr", *words, *sides) == 0
    assert "12 x 8" in capsys.readouterr().out
    whole, part = (read_radiance_image(tmp_path / f"{name}.exr") for name in ("whole", "part"))
    assert part.shape == whole.shape and part[:8].max() == part[:, :6].max() == part[:, 18:].max() == 0.0
    np.testing.assert_allclose(part[8:, 6:18], whole[8:, 6:18], rtol=0.02)
    assert run("render", scene, "-o", tmp_path / "part.png", *words, *sides) == 0
    with Image.open(tmp_path / "part.png") as image:
        assert image.size == (12, 8)


def test_a_crop_in_which_nothing_reflects_is_rendered(scene: Path, tmp_path: Path) -> None:
    words = ("--crop", "0", "0", "0.1", "0.1", "--bounces", "2")
    assert run("render", scene, "-o", tmp_path / "sky.png", *words) == 0
    with Image.open(tmp_path / "sky.png") as image:
        assert image.size == (2, 2) and image.getpixel((0, 0)) == (206, 206, 206)


def test_what_is_no_crop_is_refused_before_the_work(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    for words, says in (
        (("--crop", "0.5", "0", "0.2", "1"), "--crop 0.5 0 0.2 1: expected fractions"),
        (("--crop", "0", "0", "1", "1", "--turntable", "3"), "--crop: expected one picture"),
    ):
        assert run("render", scene, "-o", tmp_path / "a.png", *words) == 1
        assert says in capsys.readouterr().err
