"""Pictures for the screen and for files: values held to the same slow twin as the shader, files read back."""

import io
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from engine.core.colour import ToneMapping
from engine.light.radiance_files import read_radiance_image
from engine.render.display import display_picture, exr_bytes, png_bytes
from tests.naive import pictures as naive

VALUES = np.concatenate([[0.0, 0.0031307, 0.0031309], np.geomspace(1e-5, 1e5, 80)])


@pytest.mark.parametrize("exposure", [0.0, -2.0, 3.5])
@pytest.mark.parametrize("tone_mapping", ["linear", "filmic"])
def test_values_follow_the_formulas(tone_mapping: ToneMapping, exposure: float) -> None:
    picture = display_picture(np.repeat(VALUES[None, :, None], 3, axis=2), exposure, tone_mapping)
    curve = naive.filmic if tone_mapping == "filmic" else lambda value: min(max(value, 0.0), 1.0)
    expected = [round(255 * naive.encode_srgb(curve(value * 2.0**exposure))) for value in VALUES]
    assert picture.dtype == np.uint8
    # One step where the twin's and our rounding of a half differ.
    assert np.abs(picture[0, :, 1].astype(int) - expected).max() <= 1


def test_no_radiance_is_too_bright_or_too_dark() -> None:
    picture = display_picture(np.array([[[np.finfo(np.float32).max] * 3, [-1.0] * 3]], np.float32), exposure=-64.0)
    # Exposure -64 turns 3.4e38 into 1.8e19, still white; below zero is black.
    assert picture.tolist() == [[[255] * 3, [0] * 3]]


def picture() -> np.ndarray:
    random = np.random.default_rng(5)
    return (10.0 ** random.uniform(-8.0, 6.0, (37, 53, 3))).astype(np.float32)


def test_linear_radiance_returns_bit_by_bit(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(exr_bytes(picture()))
    assert np.array_equal(read_radiance_image(tmp_path / "a.exr"), picture())


@pytest.mark.parametrize("bad", [np.full((2, 2, 3), np.nan, np.float32), np.zeros((2, 2), np.float32)])
def test_what_is_no_picture_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected"):
        exr_bytes(bad)


def test_a_png_holds_the_display_values() -> None:
    with Image.open(io.BytesIO(png_bytes(picture(), exposure=1.0))) as image:
        assert np.array_equal(np.asarray(image), display_picture(picture(), exposure=1.0))


def with_random_alpha() -> np.ndarray:
    """Light of pixels that are covered by a quarter, half, whole, or not at all."""
    alpha = np.random.default_rng(6).choice([0.0, 0.25, 0.5, 1.0], (37, 53, 1)).astype(np.float32)
    return np.concatenate([alpha * np.minimum(picture(), 1e4), alpha], axis=2)


def test_a_png_with_alpha_holds_colours_without_it() -> None:
    picture = with_random_alpha()
    with Image.open(io.BytesIO(png_bytes(picture))) as image:
        found = np.asarray(image)
    alpha = picture[..., 3:]
    colours = display_picture(np.divide(picture[..., :3], alpha, out=np.zeros_like(picture[..., :3]), where=alpha > 0))
    assert found.shape == (37, 53, 4) and np.array_equal(found[..., :3], np.where(alpha > 0.0, colours, 0))
    assert set(np.unique(found[..., 3])) == {0, 64, 128, 255}


def test_an_exr_with_alpha_holds_light_times_alpha(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(exr_bytes(with_random_alpha()))
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    found = np.stack([channels[name].pixels for name in "RGBA"], axis=2)
    assert np.array_equal(found, with_random_alpha())
