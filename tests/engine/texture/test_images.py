"""Reading textures: sRGB against the formula, grey and deep images, and what is refused."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.errors import LoadError
from engine.texture.images import read_texture, read_weight
from tests.pictures import write_exr

CODES = np.arange(256, dtype=np.uint8)


def png(pixels: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def header_of_png(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return start + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


def test_srgb_of_eight_bits_is_decoded_by_the_formula() -> None:
    data = png(np.repeat(CODES[None, :, None], 3, axis=2))
    x = CODES / 255.0
    expected = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    np.testing.assert_allclose(read_texture(data, "a.png")[0, :, 1], expected, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(read_texture(data, "a.png", "linear")[0, :, 2], x, rtol=1e-6)


def test_weights_are_linear_whatever_the_file() -> None:
    x = CODES / 255.0
    np.testing.assert_allclose(read_weight(png(CODES[None]), "a.png")[0, :, 0], x, rtol=1e-6)
    coloured = np.zeros((1, 2, 3), np.uint8)
    coloured[0, 0, 1] = coloured[0, 1] = 255  # green counts by its luminance, white as 1
    np.testing.assert_allclose(read_weight(png(coloured), "a.png")[0, :, 0], [0.7152, 1.0], rtol=1e-6)


def test_sixteen_bits_and_transparency() -> None:
    deep = np.array([[0, 32768, 65535]], np.uint16)
    np.testing.assert_allclose(read_weight(png(deep), "a.png")[0, :, 0], deep[0] / 65535.0, rtol=1e-6)
    clear = np.full((2, 2, 4), 255, np.uint8)
    clear[..., 3] = 0
    np.testing.assert_array_equal(read_texture(png(clear), "a.png"), np.ones((2, 2, 3)))


def test_jpeg_and_exr(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), 188, np.uint8)).save(buffer, "JPEG", quality=95)
    np.testing.assert_allclose(read_texture(buffer.getvalue(), "a.jpg"), 0.5029, atol=0.01)  # sRGB 188 is half
    write_exr(tmp_path / "a.exr", np.full((2, 3, 3), 0.25, np.float32))
    data = (tmp_path / "a.exr").read_bytes()
    np.testing.assert_array_equal(read_texture(data, "a.exr"), np.full((2, 3, 3), 0.25))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "first bytes"),
        (b"GIF89a" + bytes(100), "a PNG, JPEG or OpenEXR image"),
        (header_of_png(13000, 13000), "image size = 13000 x 13000"),
        (header_of_png(40000, 2), "image size = 40000 x 2"),
        (header_of_png(60000, 60000), "image size"),
        (header_of_png(0, 4), "PNG image"),
        (png(np.zeros((64, 64, 3), np.uint8))[:60], "not cut off or damaged"),
        (b"\xff\xd8\xff" + bytes(20), "JPEG image"),
        (b"\x76\x2f\x31\x01" + bytes(20), "OpenEXR"),
    ],
)
def test_what_cannot_be_used_is_one_line(data: bytes, words: str) -> None:
    with pytest.raises(LoadError, match=words) as caught:
        read_texture(data, "map.png")
    assert str(caught.value).startswith("map.png: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.25, 1e6])
def test_numbers_that_are_no_factor_are_named(tmp_path: Path, value: float) -> None:
    pixels = np.full((2, 3, 3), 0.5, np.float32)
    write_exr(tmp_path / "a.exr", pixels)
    spoilt = (tmp_path / "a.exr").read_bytes()
    import OpenEXR

    pixels[1, 2, 0] = value
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": pixels}).write(str(tmp_path / "b.exr"))
    assert read_texture(spoilt, "a.exr").max() == 0.5
    with pytest.raises(LoadError, match=r"pixel \(2, 1\)"):
        read_texture((tmp_path / "b.exr").read_bytes(), "b.exr")
