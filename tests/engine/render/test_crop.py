"""Crops: their pixels, their files, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from engine.core.errors import InsituError
from engine.render.crop import Crop, cropped
from engine.render.display import PictureLayer, exr_bytes
from engine.render.picture_files import read_picture

FRACTION = some.floats(0.0, 1.0)


def test_pixels_whose_centres_are_in_it() -> None:
    assert Crop(0.25, 0.5, 0.75, 1.0).box((8, 4)) == (2, 2, 4, 2)
    assert Crop(0.0, 0.0, 1.0, 1.0).box((7, 3)) == (0, 0, 7, 3)
    assert Crop(0.5, 0.5, 0.5 + 1e-9, 0.5 + 1e-9).box((10, 10)) == (5, 5, 1, 1)  # never less than a pixel
    assert Crop(1.0 - 1e-9, 0.0, 1.0, 1e-9).box((10, 10)) == (9, 0, 1, 1)


@given(FRACTION, FRACTION, some.integers(1, 50))
def test_crops_side_by_side_share_no_pixel_and_leave_none_out(left: float, between: float, n: int) -> None:
    left, between = sorted((left, between))
    x, _, width, _ = Crop(left, 0.0, between, 1.0).box((n, 1))
    x_after, _, width_after, _ = Crop(between, 0.0, 1.0, 1.0).box((n, 1))
    assert 0 <= x < x + width <= n and 0 <= x_after < x_after + width_after == n
    if width > 1 and width_after > 1:
        assert x + width == x_after


def test_a_rectangle_that_is_drawn_ends_at_the_picture() -> None:
    assert Crop.between((0.8, -3.0), (0.2, 0.5)) == (0.2, 0.0, 0.8, 0.5)
    assert Crop.between((0.5, 0.2), (0.5, 0.9)) is None and Crop.between((2.0, 0.2), (3.0, 0.9)) is None


@pytest.mark.parametrize("sides", [(0.5, 0.0, 0.5, 1.0), (0.0, 0.9, 1.0, 0.1), (-0.1, 0, 1, 1), (0, 0, 1.1, 1),
                                   (float("nan"), 0, 1, 1)])  # fmt: skip
def test_what_is_no_part_of_the_picture_is_refused(sides: tuple[float, ...]) -> None:
    with pytest.raises(InsituError, match="--crop .*: expected fractions"):
        Crop.checked(sides, "--crop")


def test_rows_of_pixels_are_those_of_the_box() -> None:
    crop, pixel = Crop(0.25, 0.5, 0.75, 1.0), np.array([0, 18, 21, 22, 30, 31])  # of 8 x 4 pixels
    np.testing.assert_array_equal(crop.rows(pixel, (8, 4)), [1, 2])


def test_an_exr_file_keeps_the_place_in_the_whole(tmp_path: Path) -> None:
    import OpenEXR

    crop = Crop(0.25, 0.5, 0.75, 1.0)
    light = np.random.default_rng(1).uniform(0.1, 1.0, (4, 8, 3)).astype(np.float32)
    file = tmp_path / "part.exr"
    file.write_bytes(exr_bytes(light, layers=[PictureLayer("depth", "Z", light[..., 0])], crop=crop))
    header = OpenEXR.File(str(file)).header()
    np.testing.assert_array_equal(np.array(header["dataWindow"]), [[2, 2], [5, 3]])
    np.testing.assert_array_equal(np.array(header["displayWindow"]), [[0, 0], [7, 3]])
    read = read_picture(file)  # of the whole's size, black beside it
    np.testing.assert_array_equal(cropped(read, crop), cropped(light, crop))
    assert read.shape == light.shape and read[:2].max() == 0.0
