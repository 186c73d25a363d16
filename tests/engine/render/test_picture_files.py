"""Pictures in files come back as they were, or an error says that they did not."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.light.radiance_files import read_radiance_image
from engine.render.display import display_picture
from engine.render.picture_files import exr_bytes, png_bytes


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
