"""Pictures of light that tests write, and how they are refused."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from engine.core.errors import LoadError, plain_line
from engine.light.radiance_files import read_radiance_image

HEIGHT, WIDTH = 24, 40
SCANLINES = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)


def gradient(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """An image whose every value is a different power-of-two fraction, exact in half and in RGBE's shared exponent."""
    rows, columns, channels = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    return ((1 + (7 * rows + 3 * columns + 5 * channels) % 120 + 128) / 64.0).astype(np.float32)


def write_exr(path: Path, channels: dict[str, np.ndarray], **header: object) -> Path:
    with OpenEXR.File(SCANLINES | header, channels) as file:
        file.write(str(path))
    return path


def write_rgb(path: Path, image: np.ndarray, **header: object) -> Path:
    return write_exr(path, {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}, **header)


def refusal(path: Path) -> str:
    with pytest.raises(LoadError) as caught:
        read_radiance_image(path)
    message = str(caught.value)
    assert plain_line(str(path)) in message and message.endswith("nothing was changed")
    return message


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Images of more than 256 pixels are too large, and bands are a few rows."""
    for module in ("radiance_files", "picture_bands"):
        monkeypatch.setattr(f"engine.light.{module}.MAX_PIXELS", 256)
    monkeypatch.setattr("engine.light.picture_bands.BAND_PIXELS", 256)


def quarter_means(image: np.ndarray) -> np.ndarray:
    """Of each 2 x 2 pixels; of 48 x 40 these are fewer than 512."""
    return (image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]) / 4.0
