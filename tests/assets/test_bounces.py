"""The guide's pictures of indirect light: there, small, and made of both halves."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from assets.scripts.bounces import GAP, MOST_BYTES, SCENES, SIDE, save, side_by_side

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "docs" / "guides" / "indirect-light.md"


@pytest.mark.parametrize("name", SCENES)
def test_the_guide_shows_each_scene_before_and_after(name: str) -> None:
    file = ROOT / "docs" / "images" / f"bounces_{name}.png"
    assert file.stat().st_size <= MOST_BYTES and f"images/{file.name}" in GUIDE.read_text()
    with Image.open(file) as picture:
        assert picture.width == 2 * SIDE + GAP
        pixels = np.asarray(picture.convert("RGB"), np.float64)
    # Whatever more bounces bring is light.
    assert pixels[:, -SIDE:].mean() > pixels[:, :SIDE].mean()


def test_a_picture_has_direct_light_left_and_more_of_it_right() -> None:
    pixels = side_by_side("cornell", 24)
    assert pixels.shape == (24, 48 + GAP, 3)
    left, right = pixels[:, :24].astype(int), pixels[:, -24:].astype(int)
    assert (right >= left - 2).all() and (right[2:5] > left[2:5] + 10).mean() > 0.5  # the ceiling has no direct light


def test_a_picture_that_would_be_too_large_gets_a_palette(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (300, 300, 3)).astype(np.uint8)
    save(tmp_path / "noise.png", noise)
    save(tmp_path / "even.png", np.zeros_like(noise))
    with Image.open(tmp_path / "noise.png") as large, Image.open(tmp_path / "even.png") as small:
        assert (large.mode, small.mode) == ("P", "RGB")
