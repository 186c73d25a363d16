"""Images of Basis Universal in KTX 2 files, and WebP images. The files in `ktx2/` were written with alktx2 0.1.7 from
the gradient below, as ETC1S and as UASTC with Zstandard."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.texture.texture_files import has_alpha, image_size, is_image, read_opacity, read_texture

FILES = Path(__file__).parent / "ktx2"


def gradient() -> np.ndarray:
    """(12, 20, 3) uint8: red grows to the right, green downwards."""
    pixels = np.zeros((12, 20, 3), np.uint8)
    pixels[..., 0] = np.arange(20) * 12
    pixels[..., 1] = np.arange(12)[:, None] * 20
    pixels[..., 2] = 80
    return pixels


def webp(pixels: np.ndarray, **options: object) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "WebP", **options)
    return buffer.getvalue()


@pytest.mark.parametrize(("name", "error"), [("etc1s", 40), ("uastc", 2)])
def test_basis_images(name: str, error: int) -> None:
    data = (FILES / f"{name}.ktx2").read_bytes()
    assert image_size(data, name) == (20, 12) and is_image(data, name) and not has_alpha(data, name)
    codes = [np.clip(gradient().astype(int) + k, 0, 255).astype(np.float32) for k in (-error, error)]
    low, high = (decode_srgb(each / 255.0) for each in codes)
    found = read_texture(data, name)
    assert (found >= low).all() and (found <= high).all()


def test_alpha_of_basis_images() -> None:
    data = (FILES / "uastc_alpha.ktx2").read_bytes()
    assert has_alpha(data, "a")
    assert np.allclose(read_opacity(data, "a")[..., 0], np.repeat([[0.0, 1.0]], 10, axis=1), atol=0.01)


@pytest.mark.parametrize("options", [{"lossless": True}, {"quality": 95}])
@pytest.mark.parametrize("transparent", [False, True])
def test_webp_images(options: dict, transparent: bool) -> None:
    pixels = gradient()
    if transparent:
        pixels = np.dstack([pixels, np.full((12, 20), 200, np.uint8)])
    data = webp(pixels, **options)
    assert image_size(data, "w") == (20, 12) and has_alpha(data, "w") == transparent
    error = 0.0 if "lossless" in options else 0.1
    expected = decode_srgb(gradient().astype(np.float32) / 255.0)
    assert np.abs(read_texture(data, "w") - expected).max() <= error + 1e-6


@pytest.mark.parametrize("kind", ["VP8 ", "VP8L", "VP8X"])
def test_webp_images_that_say_they_are_huge_are_not_opened(kind: str) -> None:
    heads = {
        "VP8X": b"\0" * 4 + b"\xff" * 6,
        "VP8L": b"\x2f" + b"\xff" * 9,
        "VP8 ": b"\0\0\0\x9d\x01\x2a" + b"\xff" * 4,
    }
    data = b"RIFF\x40\0\0\0WEBP" + kind.encode() + b"\x30\0\0\0" + heads[kind] + b"\0" * 40
    with pytest.raises(LoadError, match="image size = 16777216 x 16777216" if kind == "VP8X" else "WebP image = "):
        read_texture(data, "w")


@pytest.mark.parametrize("cut", [12, 30, 100, 300])
def test_broken_files_are_named(cut: int) -> None:
    for data in ((FILES / "uastc.ktx2").read_bytes(), webp(gradient(), lossless=True)):
        with pytest.raises(LoadError, match="KTX 2|WebP image"):
            read_texture(data[: min(cut, len(data) - 8)], "broken")


def test_ktx2_files_that_say_they_are_huge_are_not_decoded() -> None:
    data = bytearray((FILES / "uastc.ktx2").read_bytes())
    data[20:28] = b"\xff" * 8
    with pytest.raises(LoadError, match="image size = 4294967295 x 4294967295"):
        read_texture(bytes(data), "huge")


def test_ktx2_files_of_other_texels_are_named_by_their_header() -> None:
    data = bytearray((FILES / "uastc.ktx2").read_bytes())
    data[12] = 43  # VK_FORMAT_R8G8B8A8_SRGB
    with pytest.raises(LoadError, match="format 43 packed by scheme 2, expected texels of Basis Universal"):
        image_size(bytes(data), "plain")
