"""Dome lights of USD: one as it is, and those that are tilted, tinted, several or in an archive as one image."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.document import LightState
from app.project.distant_light import sky_of
from engine.light.environment import Environment, texel_solid_angles
from engine.scene.loaders.usd import read_usd
from engine.scene.loaders.usd_domes import turned_image
from engine.scene.scene_loader import Scene, load_scene
from tests.pictures import write_exr
from tests.usd_text import CARD, unshown, usda, write

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")


def bright_spot(height: int, direction: tuple[float, float, float]) -> np.ndarray:
    """A smooth light (H, 2 H, 3) about a direction, in the frame of our images."""
    theta = (np.arange(height) + 0.5) / height * math.pi
    phi = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2.0 * math.pi
    x, y, z = (
        np.sin(theta)[:, None] * np.sin(phi),
        np.cos(theta)[:, None] + 0.0 * phi,
        -np.sin(theta)[:, None] * np.cos(phi),
    )
    near = x * direction[0] + y * direction[1] + z * direction[2]
    return np.repeat(np.exp(8.0 * (near - 1.0))[..., None], 3, axis=2).astype(np.float32)


def total(image: np.ndarray) -> np.ndarray:
    """The light of an image over the sphere (3,)."""
    return np.einsum("hwc,h->c", image, texel_solid_angles(*image.shape[:2]), dtype=np.float64)


def turned(operation: str, degrees: float) -> str:
    return f'double xformOp:{operation} = {degrees}\n uniform token[] xformOpOrder = ["xformOp:{operation}"]\n'


def dome(name: str, more: str, kind: str = "DomeLight") -> str:
    return f'def {kind} "{name}" {{ {more}\n}}\n'


SKY = "asset inputs:texture:file = @sky.exr@\n"


def opened(folder: Path, domes: str, head: str = "") -> Scene:
    return load_scene(write(folder / "a.usda", f"{CARD}\n{domes}", head), (8, 8))


def radiance(scene: Scene, direction: tuple[float, float, float]) -> np.ndarray:
    """What comes from a direction of the world."""
    assert scene.description.environment is not None
    sky = sky_of(scene, LightState(rotation=scene.description.environment.rotation))
    assert sky.environment is not None
    return sky.environment.evaluate([direction], sky.rotation)[0] * sky.scale


@pytest.mark.parametrize(
    ("turn", "direction"),
    [
        # The spot of the image is straight ahead of its centre, which a dome has along +Z.
        (turned("rotateX", 90.0), (0.0, -1.0, 0.0)),
        (turned("rotateX", -30.0), (0.0, 0.5, math.cos(math.radians(30.0)))),
        (turned("rotateY", 90.0), (1.0, 0.0, 0.0)),
        ("", (0.0, 0.0, 1.0)),
    ],
)
def test_a_tilted_dome_shines_from_where_it_is_turned(
    tmp_path: Path, turn: str, direction: tuple[float, float, float]
) -> None:
    write_exr(tmp_path / "sky.exr", bright_spot(64, (0.0, 0.0, -1.0)))
    scene = opened(tmp_path, dome("D", SKY + turn))
    # 1 at the middle of the spot; at 30 degrees from it exp(8 (cos 30° - 1)) = 0.34. Texels are 2.8 degrees wide.
    assert radiance(scene, direction) == pytest.approx([1.0] * 3, abs=0.03)
    aside = (direction[1], direction[2], direction[0])
    assert (radiance(scene, aside) < 0.1).all()
    is_tilted = "rotateX" in turn
    assert (scene.sky is not None) is is_tilted
    notes = [note for note in scene.notes if "environment" in note]
    assert notes == (["a: environment: D is tilted, as one image of 128 x 64 texels"] if is_tilted else [])
    assert not scene.unshown


def test_turned_images_keep_their_light_and_turn_about_the_vertical_as_rotations_do() -> None:
    rng = np.random.default_rng(3)
    image = Environment(rng.uniform(0.0, 1.0, (16, 32, 3)).astype(np.float32), "noise")
    turn, tilt = (np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) for c, s in ((0.0, 1.0), (0.6, 0.8)))
    frame = turn @ np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]]) @ tilt
    found = turned_image(image, frame, 16)
    assert total(found) == pytest.approx(total(image.radiance), rel=1e-5)
    # Mirrored along X, the image is the mirror image of itself.
    plain, mirrored = turned_image(image, np.eye(3), 16), turned_image(image, np.diag([-1.0, 1.0, 1.0]), 16)
    assert np.allclose(mirrored, plain[:, ::-1], atol=1e-5)


def test_a_colour_tints_the_image(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", np.full((4, 8, 3), 0.5, np.float32))
    more = "color3f inputs:color = (1, 0.5, 0)\n float inputs:intensity = 2\n float inputs:exposure = 1\n"
    scene = opened(tmp_path, dome("D", SKY + more))
    # 2 * 2^1 times the colour, times 0.5.
    assert radiance(scene, (0.0, 1.0, 0.0)) == pytest.approx([2.0, 1.0, 0.0])
    assert scene.sky is not None and scene.sky.radiance.shape == (4, 8, 3) and not scene.unshown


def test_several_domes_are_added_up(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", bright_spot(32, (0.0, 0.0, -1.0)))
    scene = opened(tmp_path, dome("A", SKY) + dome("B", SKY + turned("rotateX", 90.0)) + dome("C", ""))
    for direction in ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0)):
        assert radiance(scene, direction) == pytest.approx([2.0] * 3, abs=0.08)
    assert radiance(scene, (1.0, 0.0, 0.0)) == pytest.approx([1.0] * 3, abs=0.01)  # of C alone
    assert any("2 domes, added up" in note for note in scene.notes)
    plain = opened(
        tmp_path, dome("A", "color3f inputs:color = (1, 0, 0)") + dome("B", "color3f inputs:color = (0, 2, 0)")
    )
    assert plain.description.environment is not None and plain.description.environment.radiance == (1.0, 2.0, 0.0)


def test_the_image_of_a_dome_may_lie_in_the_archive(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", bright_spot(32, (0.0, 0.0, -1.0)))
    text = usda(f"{CARD}\n{dome('D', SKY + turned('rotateY', 90.0))}")
    with zipfile.ZipFile(tmp_path / "a.usdz", "w") as archive:
        archive.writestr("a.usda", text)
        archive.write(tmp_path / "sky.exr", "sky.exr")
    (tmp_path / "sky.exr").unlink()
    scene = load_scene(tmp_path / "a.usdz", (8, 8))
    assert radiance(scene, (1.0, 0.0, 0.0)) == pytest.approx([1.0] * 3, abs=0.03)
    assert not scene.unshown and scene.environment_path is None


def test_pictures_of_integers_are_decoded_by_srgb(tmp_path: Path) -> None:
    Image.new("RGB", (8, 4), (188, 188, 188)).save(tmp_path / "sky.png")
    scene = opened(tmp_path, dome("D", "asset inputs:texture:file = @sky.png@\n"))
    assert radiance(scene, (0.0, 1.0, 0.0)) == pytest.approx([0.503] * 3, abs=0.002)  # sRGB 0.737


@pytest.mark.parametrize(
    ("pole", "up", "direction"),
    [("scene", "Y", (0, 0, 1)), ("Z", "Y", (0, -1, 0)), ("scene", "Z", (0, 0, 1)), ("Y", "Z", (0, 1, 0))],
)
def test_poles_of_domes(tmp_path: Path, pole: str, up: str, direction: tuple[float, float, float]) -> None:
    """The centre of the image, +Z with the pole along Y; with the pole along +Z it is along -Y of the dome, which in a
    stage with Z up is +Z of ours."""
    write_exr(tmp_path / "sky.exr", bright_spot(64, (0.0, 0.0, -1.0)))
    more = SKY + f'uniform token poleAxis = "{pole}"\n'
    scene = opened(tmp_path, dome("D", more, "DomeLight_1"), f'upAxis = "{up}"')
    assert radiance(scene, direction) == pytest.approx([1.0] * 3, abs=0.03) and not scene.unshown


def test_an_image_that_cannot_be_read_is_listed(tmp_path: Path) -> None:
    (tmp_path / "sky.exr").write_bytes(b"no picture")
    tinted = SKY + "color3f inputs:color = (1, 0.5, 0)\n"
    model = read_usd(write(tmp_path / "a.usda", f"{CARD}\n{dome('D', tinted)}"))
    assert model.dome is not None and model.dome.radiance == (1.0, 0.5, 0.0) and model.dome.image is None
    assert unshown(model) == {"DomeLight.inputs:texture:file": 1}
    (listed,) = model.unshown
    assert "the dome has one radiance: sky.exr: first bytes" in listed.effect


def test_a_dome_under_a_flat_transform_is_not_lit(tmp_path: Path) -> None:
    flat = 'float3 xformOp:scale = (1, 0, 1)\n uniform token[] xformOpOrder = ["xformOp:scale"]\n'
    model = read_usd(write(tmp_path / "a.usda", f"{CARD}\n{dome('D', flat)}"))
    assert model.dome is None and unshown(model) == {"DomeLight.intensity": 1}
