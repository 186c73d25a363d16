"""Stills in layers: their sums, each light against the picture of that light alone, surfaces in closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from app.document.background import Background
from app.document.view_state import Viewpoint
from app.project.project import Project, open_project
from app.stills.picture_layers import light_groups, only_lights, render_layers
from app.stills.stills import Still, render_project
from engine.light.radiance_files import read_radiance_image
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.data_layers import NO_DEPTH
from engine.render.display import exr_bytes
from tests.app.cli.command_line import run
from tests.scene_text import camera, environment, facing_down, material, placed, scaled

# A wall, its right half covered by a red box nearer to the camera; two lamps, one of them in the picture.
SCENE = (
    camera((0, 0, 5), 40, (24, 16), head="bounces = 2\n")
    + environment([0.3, 0.4, 0.5])
    + placed("wall", "quad", scaled(40), material('model = "lambert"', 'model = "rough_conductor", alpha = 0.3'))
    + placed("red box", "quad", scaled(2, (1, 0, 1)), material('model = "lambert", albedo = [0.8, 0.1, 0.1]'))
    + placed("key", "quad", facing_down(1, (0, 2.5, 2)), "emission = [6, 5, 4]\n")
    + placed("seen", "quad", scaled(0.8, (-1, 0.2, 0.5)), "emission = [0.2, 0.4, 3]\n")
)
MIX = (
    ("seen.excludes", ["red box"]),
    ("key.group", "Lamps"),
    ("key.strength", 0.5),
    ("light.groups.Lamps.colour", [1.0, 0.5, 0.5]),
)
SETTINGS = {"n_lights": 200, "n_patches": 64}


def opened(folder: Path) -> Project:
    path = folder / "wall.toml"
    path.write_text(SCENE)
    return open_project(str(path), values=MIX)


@pytest.fixture(scope="module")
def still(tmp_path_factory: pytest.TempPathFactory) -> Still:
    return render_layers(opened(tmp_path_factory.mktemp("wall")), lambda step: None, **SETTINGS)


def by_name(still: Still) -> dict[str, np.ndarray]:
    return {layer.name or layer.letters: layer.values for layer in still.layers}


def test_lights_and_kinds_of_light_sum_to_the_picture(still: Still) -> None:
    layers = by_name(still)
    lights = [layers[name] for name in ("light_environment", "light_Lamps", "light_seen")]
    assert [name for name in layers if name.startswith("light_")] == ["light_environment", "light_Lamps", "light_seen"]
    kinds = [layers[name] for name in ("direct", "indirect", "emission")]
    for parts in (lights, kinds):
        assert all(part.any() for part in parts)
        np.testing.assert_allclose(sum(parts), still.picture, atol=1e-4 * float(still.picture.mean()))


def test_a_light_is_the_picture_of_that_light_alone(still: Still, tmp_path: Path) -> None:
    project = opened(tmp_path)
    for name, keys in light_groups(project.document):
        alone = project.edited(only_lights(project.document, keys), Viewpoint())
        picture = render_project(alone, lambda step: None, **SETTINGS).picture
        np.testing.assert_allclose(by_name(still)[f"light_{name}"], picture, rtol=1e-5, atol=1e-6)


def test_the_picture_is_that_without_layers(still: Still, tmp_path: Path) -> None:
    """But for the noise of bounces, which are found for each light alone."""
    plain = render_project(opened(tmp_path), lambda step: None, **SETTINGS).picture
    assert np.sqrt(np.mean((still.picture - plain) ** 2)) < 0.02 * plain.mean()
    assert still.error is not None and still.error.overall < 0.1


def test_surfaces_are_those_at_the_centres_of_pixels(still: Still) -> None:
    layers = by_name(still)
    # Three walls that face the camera, one behind the other: lamps have places as well.
    wall, box, lamp = (2, 2), (7, 16), (7, 6)
    for place, z, name in ((wall, 0.0, "mask_wall"), (box, 1.0, "mask_red_box"), (lamp, 0.5, "mask_seen")):
        assert layers["position"][place][2] == pytest.approx(z, abs=1e-5)
        assert layers["Z"][place] == pytest.approx(5.0 - z, abs=1e-5)
        assert layers["normal"][place] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
        assert layers[name][place] == 1.0
    assert layers["albedo"][box] == pytest.approx([0.8, 0.1, 0.1], rel=1e-3)
    assert not layers["albedo"][lamp].any()


def test_masks_share_each_pixel(still: Still) -> None:
    masks = {name: values for name, values in by_name(still).items() if name.startswith("mask_")}
    assert set(masks) == {"mask_wall", "mask_red_box", "mask_seen"}  # the other lamp is out of sight
    np.testing.assert_allclose(sum(masks.values()), 1.0, atol=1e-6)  # the wall is behind all of the picture
    # The box is 2 m wide at 4 m: its area in pixels, in closed form.
    pixels = 16 / (2 * 4 * np.tan(np.radians(20)))
    assert masks["mask_red_box"].sum() == pytest.approx((2 * pixels) ** 2, rel=0.02)


def test_the_background_has_no_depth(tmp_path: Path) -> None:
    path = tmp_path / "ball.toml"
    path.write_text(
        camera((0, 0, 4), resolution=(12, 8), head="bounces = 1\n") + environment() + placed("ball", "sphere")
    )
    layers = by_name(render_layers(open_project(str(path)), lambda step: None, **SETTINGS))
    assert layers["Z"][0, 0] == np.float32(NO_DEPTH) and layers["Z"][4, 6] == pytest.approx(3.5, abs=0.1)
    assert not layers["mask_ball"][0, 0] and layers["emission"][0, 0] == pytest.approx([1.0, 1.0, 1.0])
    assert not layers["indirect"].any() and not layers["normal"][0, 0].any()


def test_a_background_of_one_colour_is_the_rest_of_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "ball.toml"
    path.write_text(
        camera((0, 0, 4), resolution=(12, 8), head="bounces = 1\n") + environment() + placed("ball", "sphere")
    )
    project = open_project(str(path))
    coloured = replace(project.document, background=Background("colour", (0.1, 0.2, 0.4)))
    still = render_layers(project.edited(coloured, Viewpoint()), lambda step: None, **SETTINGS)
    layers = by_name(still)
    assert still.picture[0, 0] == pytest.approx([0.1, 0.2, 0.4])
    for lights in (("direct", "indirect", "emission"), ("light_environment",)):
        found = sum(layers[name] for name in (*lights, "background"))
        np.testing.assert_allclose(found, still.picture, rtol=1e-5, atol=1e-6)


def test_lights_that_are_off_or_not_solo_have_no_layer(tmp_path: Path) -> None:
    path = tmp_path / "wall.toml"
    path.write_text(SCENE)
    groups = {}
    for name, values in {"off": [("key.on", False)], "solo": [("seen.solo", True)], "all": []}.items():
        groups[name] = [light for light, _ in light_groups(open_project(str(path), values=values).document)]
    assert groups == {"off": ["environment", "seen"], "solo": ["seen"], "all": ["environment", "key", "seen"]}


def test_a_lamp_that_is_called_as_a_group_has_a_layer_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "wall.toml"
    path.write_text(SCENE)
    project = open_project(str(path), values=[("key.group", "seen"), ("light.environment.on", False)])
    assert light_groups(project.document) == [("seen", ("key",)), ("seen", ("seen",))]
    layers = by_name(render_layers(project, lambda step: None, series=BounceSeries(1), **SETTINGS))
    assert layers["light_seen"].any() and layers["light_seen_2"].any()


def test_the_file_has_the_picture_and_its_layers(still: Still, tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(exr_bytes(still.picture, "wall", still.layers))
    np.testing.assert_array_equal(read_radiance_image(path), still.picture)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert {"R", "G", "B", "Z", "light_Lamps.G", "normal.X", "mask_red_box.A", "error.Y"} <= set(channels)
    np.testing.assert_array_equal(channels["direct.B"], by_name(still)["direct"][..., 2])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "a.png"), "a.png holds one picture, expected a name that ends in .exr"),
        (("-o", "a.exr", "--reference"), "--aovs --reference: layers are those of one picture of Placement"),
        (("-o", "a.exr", "--mode", "orbit"), "--aovs --mode orbit: layers are those"),
        (("-o", "a.exr", "--turntable", "4"), "--aovs --turntable 4: layers are those"),
    ],
)
def test_what_has_no_layers_is_refused(
    words: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("render", "teatray", "--aovs", *words) == 1
    assert said in capsys.readouterr().err and not list(tmp_path.iterdir())
