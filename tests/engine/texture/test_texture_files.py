"""Reading textures: sRGB against the formula, grey and deep images, and rejected files."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.texture.texture_files import read_heights, read_normal_map, read_texture, read_weight, reduction
from engine.texture.texture_store import TextureStore
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


def test_colours_of_other_primaries_are_converted_and_numbers_are_not(tmp_path: Path) -> None:
    import OpenEXR

    green = np.zeros((2, 3, 3), np.float32)
    green[..., 1] = 0.5
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header["chromaticities"] = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)  # Rec. 2020
    with OpenEXR.File(header, {"RGB": green}) as file:
        file.write(str(tmp_path / "a.exr"))
    data = (tmp_path / "a.exr").read_bytes()
    # [ITU-R BT.2087]: -0.5876, 1.1329 and -0.1006 of it; Rec. 709 cannot show it, so red and blue are 0.
    notes: list[str] = []
    found = read_texture(data, "a.exr", report=notes.append)
    np.testing.assert_allclose(found[0, 0], [0.0, 0.5 * 1.1329, 0.0], atol=1e-4)
    assert len(notes) == 1 and notes[0].startswith("a.exr: primaries 0.708 0.292")
    np.testing.assert_allclose(read_weight(data, "a.exr"), 0.5 * 0.7152, atol=1e-6)


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
        (b"GIF89a" + bytes(100), "a PNG, JPEG, WebP, KTX 2 or OpenEXR image"),
        (header_of_png(16384, 16385), "image size = 16384 x 16385"),
        (header_of_png(65500, 65500), "image size = 65500 x 65500, expected sides of 1 to 16384"),
        (header_of_png(13000, 13000), "PNG image"),  # of a size that may be read, but cut off
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


def exr(tmp_path: Path, pixels: np.ndarray) -> bytes:
    import OpenEXR

    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}).write(str(tmp_path / "a.exr"))
    return (tmp_path / "a.exr").read_bytes()


@pytest.mark.parametrize(
    # Red is 0.25 in the upper and 0.75 in the lower row. What is no number is the mean of the five others.
    ("value", "taken"),
    [(np.nan, 0.45), (np.inf, 0.75), (-np.inf, 0.0), (-0.25, 0.0), (1e6, 1e4)],
)
def test_numbers_that_are_no_factor_are_mended_with_one_note(tmp_path: Path, value: float, taken: float) -> None:
    pixels = np.repeat(np.repeat([[[0.25]], [[0.75]]], 3, axis=1), 3, axis=2)
    expected, notes = pixels.copy(), []
    pixels[1, 2, 0], expected[1, 2, 0] = value, taken
    data = exr(tmp_path, pixels)
    np.testing.assert_allclose(read_texture(data, "a.exr", report=notes.append), expected, rtol=1e-6)
    assert len(notes) == 1 and notes[0].startswith("a.exr: 1 pixels with numbers that are none")
    assert "(2, 1)" in notes[0]
    weight = read_weight(data, "a.exr")
    np.testing.assert_allclose(weight[..., 0], np.minimum(expected @ (0.2126, 0.7152, 0.0722), 1.0), rtol=1e-6)
    assert np.isfinite(read_normal_map(data, "a.exr")).all() and np.isfinite(read_heights(data, "a.exr")).all()


def test_a_hole_in_a_flat_normal_map_is_flat(tmp_path: Path) -> None:
    pixels = np.full((3, 4, 3), 0.5)
    pixels[..., 2] = 1.0
    pixels[1, 1] = np.nan
    np.testing.assert_array_equal(read_normal_map(exr(tmp_path, pixels), "a.exr"), 0.0)


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Images of more than 64 pixels are too large, and bands are a few rows."""
    monkeypatch.setattr("engine.texture.texture_files.MAX_PIXELS", 64)
    monkeypatch.setattr("engine.texture.texture_files._BAND_PIXELS", 64)


def block_means(values: np.ndarray, k: int) -> np.ndarray:
    """Of whole blocks, one by one."""
    height, width = values.shape[0] // k, values.shape[1] // k
    blocks = [
        [values[k * i : k * i + k, k * j : k * j + k].mean(axis=(0, 1)) for j in range(width)] for i in range(height)
    ]
    return np.array(blocks)


@pytest.mark.usefixtures("small_limit")
@pytest.mark.parametrize(("size", "k"), [((16, 16), 2), ((32, 24), 4), ((8, 64), 4)])
def test_large_images_are_means_of_linear_numbers(size: tuple[int, int], k: int) -> None:
    codes = np.random.default_rng(1).integers(0, 256, (*size, 3)).astype(np.uint8)
    notes: list[str] = []
    found = read_texture(png(codes), "a.png", report=notes.append)
    # Means of light, and not of codes, of which every second black and white would come out too dark.
    np.testing.assert_allclose(found, block_means(decode_srgb(codes / np.float32(255.0)), k), atol=1e-5)
    height, width = size
    assert notes == [f"a.png: {width} x {height} pixels, shown at {width // k} x {height // k}"]
    np.testing.assert_allclose(read_texture(png(codes), "a.png", "linear"), block_means(codes / 255.0, k), atol=1e-5)
    grey = codes[..., 0].astype(np.uint16) * 257
    np.testing.assert_allclose(read_weight(png(grey), "a.png"), block_means(grey[..., None] / 65535.0, k), atol=1e-5)
    assert read_normal_map(png(codes), "a.png").shape == (height // k, width // k, 2)
    assert read_heights(png(codes), "a.png").shape == (height // k, width // k, 2)


@pytest.mark.usefixtures("small_limit")
def test_sides_that_cannot_be_halved_go_on_as_their_edge() -> None:
    codes = np.full((9, 9), 100, np.uint8)
    codes[8] = 200
    found = read_weight(png(codes), "a.png")[..., 0] * 255.0
    assert found.shape == (5, 5) and found[:4] == pytest.approx(100.0) and found[4] == pytest.approx(200.0)


@pytest.mark.usefixtures("small_limit")
def test_a_large_jpeg_is_not_decoded_beyond_what_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL.JpegImagePlugin import JpegImageFile

    sizes = []
    load = JpegImageFile.load
    monkeypatch.setattr(JpegImageFile, "load", lambda self: (sizes.append(self.size), load(self))[1])
    buffer = io.BytesIO()
    Image.fromarray(np.full((64, 32, 3), 188, np.uint8)).save(buffer, "JPEG")
    notes: list[str] = []
    found = read_texture(buffer.getvalue(), "a.jpg", report=notes.append)
    assert found.shape == (8, 4, 3) and notes == ["a.jpg: 32 x 64 pixels, shown at 4 x 8"]
    np.testing.assert_allclose(found, 0.5029, atol=0.01)
    assert set(sizes) == {(4, 8)}


@pytest.mark.usefixtures("small_limit")
def test_a_large_exr_is_its_means(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).random((16, 8, 3)).astype(np.float16).astype(np.float32)
    write_exr(tmp_path / "a.exr", pixels)
    found = read_texture((tmp_path / "a.exr").read_bytes(), "a.exr")
    np.testing.assert_allclose(found, block_means(pixels, 2), atol=1e-5)


@pytest.mark.usefixtures("small_limit")
def test_a_store_tells_once_what_is_shown_smaller(tmp_path: Path) -> None:
    from engine.material.layer_maps import Images

    (tmp_path / "a.png").write_bytes(png(np.zeros((16, 16), np.uint8)))
    store = TextureStore(tmp_path / "scene.toml")
    for _ in range(2):
        assert store.weight(Images(weight="a.png")).size == (8, 8)  # type: ignore[union-attr]
    assert store.take_notes() == (f"{tmp_path / 'a.png'}: 16 x 16 pixels, shown at 8 x 8",)
    assert store.take_notes() == ()


def test_sizes_that_cameras_and_painters_give() -> None:
    sizes = ((4096, 4096), (8192, 8192), (16384, 16384), (16384, 8192), (8192, 4096), (6000, 4000))
    assert [reduction(*size) for size in sizes] == [1, 2, 4, 4, 2, 2]
