"""Pictures read back as they were written; those that cannot be are refused in one line."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps

from engine.core.colour import encode_srgb
from engine.core.errors import LoadError
from engine.inverse.photo import read_photo
from engine.render.display import deep_png, exr_bytes, png_bytes
from engine.render.picture_files import read_picture
from tests.pictures import write_flawed_exr

LIGHT = np.random.default_rng(5).uniform(0.0, 1.0, (7, 9, 3)).astype(np.float32)


def coded(codes: np.ndarray, kind: str, **options: object) -> bytes:
    """A file of values (H, W, 3) of 8 bits."""
    file = io.BytesIO()
    Image.fromarray(codes).save(file, kind, **options)
    return file.getvalue()


def test_exr_files_are_read_back_to_the_bit(tmp_path: Path) -> None:
    file = tmp_path / "a.exr"
    file.write_bytes(exr_bytes(100.0 * LIGHT))
    np.testing.assert_array_equal(read_picture(file), 100.0 * LIGHT)


@pytest.mark.parametrize(("deep", "bound"), [(False, 0.5), (True, 1.0)])  # of 255; Pillow cuts 16 bits to 8
def test_png_files_are_decoded_by_srgb(tmp_path: Path, deep: bool, bound: float) -> None:
    file = tmp_path / "a.png"
    file.write_bytes(deep_png(encode_srgb(LIGHT)) if deep else png_bytes(LIGHT, tone_mapping="linear"))
    read = read_picture(file)
    np.testing.assert_allclose(encode_srgb(read), encode_srgb(LIGHT), atol=1.01 * bound / 255.0)


@pytest.mark.parametrize("kind", ["png", "jpeg", "webp"])
def test_photographs_of_8_bits_are_those_that_are_matched(tmp_path: Path, kind: str) -> None:
    """By sRGB, within what lossy compression does to a step; each pixel where the reader of photographs has it."""
    codes = np.full((16, 32, 3), (188, 100, 50), np.uint8)
    codes[:, 16:] = 20
    file = tmp_path / "a.file"  # the content says what it is
    file.write_bytes(coded(codes, kind, quality=100))
    read = read_picture(file)
    np.testing.assert_allclose(read[8, 4], (0.503, 0.127, 0.0319), atol=0.02)  # the decoded codes
    np.testing.assert_allclose(read[8, 28], 0.00700, atol=0.003)
    np.testing.assert_allclose(read, read_photo(file).radiance, atol=1e-6)


@pytest.mark.parametrize("kind", ["png", "jpeg", "webp"])
@pytest.mark.parametrize("orientation", range(10))
def test_photographs_are_upright_however_the_camera_was_held(tmp_path: Path, kind: str, orientation: int) -> None:
    """As Pillow turns them by their EXIF data; 0 and 9 mean nothing."""
    codes = np.zeros((16, 32, 3), np.uint8)
    codes[:8, :16], codes[:8, 16:], codes[8:, :16] = (200, 40, 40), (40, 200, 40), (40, 40, 200)
    exif = Image.Exif()
    exif[0x0112] = orientation
    file = tmp_path / "a.file"
    file.write_bytes(coded(codes, kind, quality=100, exif=exif))
    with Image.open(file) as picture:
        upright = np.asarray(ImageOps.exif_transpose(picture).convert("RGB"))
    assert upright.shape == ((32, 16, 3) if 5 <= orientation <= 8 else (16, 32, 3))
    np.testing.assert_allclose(encode_srgb(read_picture(file)), upright / 255.0, atol=0.01)
    np.testing.assert_allclose(read_picture(file), read_photo(file).radiance, atol=1e-6)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "file size = 0 bytes"),
        (b"not a picture", "expected an OpenEXR, Radiance HDR, PNG, JPEG or WebP picture"),
        (exr_bytes(LIGHT)[:200], "a.exr"),
        (png_bytes(LIGHT)[:80], "a.exr"),
        (coded(np.zeros((64, 64, 3), np.uint8), "jpeg")[:400], "a.exr: JPEG image"),
        (coded(np.zeros((64, 64, 3), np.uint8), "webp")[:40], "a.exr: WebP image"),
        (b"#?RADIANCE\n", "a.exr"),
    ],
)
def test_what_is_no_whole_picture_is_refused(tmp_path: Path, data: bytes, words: str) -> None:
    file = tmp_path / "a.exr"
    file.write_bytes(data)
    with pytest.raises(LoadError, match=words):
        read_picture(file)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused_with_their_place_or_0(tmp_path: Path, value: float) -> None:
    light = LIGHT.copy()
    light[2, 3, 1] = value
    file = tmp_path / "a.exr"
    write_flawed_exr(file, light)
    with pytest.raises(LoadError, match="pixel 3, 2"):
        read_picture(file)
    light[2, 3, 1] = 0.0
    np.testing.assert_array_equal(read_picture(file, may_have_gaps=True), light)


@pytest.mark.parametrize(
    ("ending", "limit"),
    [
        ("exr", "engine.light.picture_bands"),
        ("hdr", "engine.light.picture_bands"),
        ("png", "engine.texture.texture_files"),
        ("jpeg", "engine.texture.texture_files"),
        ("webp", "engine.texture.texture_files"),
    ],
)
def test_one_that_is_too_large_to_be_read_whole_is_refused_by_its_size(
    tmp_path: Path, ending: str, limit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / f"shown at half.{ending}"  # the name says nothing of the size
    if ending == "exr":
        file.write_bytes(exr_bytes(LIGHT))
    elif ending != "hdr":
        file.write_bytes(coded(np.zeros((7, 9, 3), np.uint8), ending))
    else:
        file.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 7 +X 9\n" + bytes([128, 128, 128, 129]) * 63)
    assert read_picture(file).shape == LIGHT.shape
    for module in {limit, "engine.render.picture_files"} if "texture" in limit else {limit}:
        monkeypatch.setattr(f"{module}.MAX_PIXELS", 62)
    with pytest.raises(
        LoadError, match=r"half\.(exr|hdr|png|jpeg|webp): image size = 9 x 7, expected at most 62 pixels"
    ):
        read_picture(file)


def test_the_pixels_of_a_file_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.render.picture_files.read_regular_file", None)  # only of whole numbers
    file = tmp_path / "a.exr"
    file.write_bytes(exr_bytes(LIGHT))
    np.testing.assert_array_equal(read_picture(file), LIGHT)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="none.exr"):
        read_picture(tmp_path / "none.exr")
