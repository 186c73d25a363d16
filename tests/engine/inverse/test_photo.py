"""Photographs as measurements: transfer curves, precision, clipping, sizes."""

import numpy as np
import pytest
from PIL import Image

from engine.core.colour import encode_srgb
from engine.core.errors import InsituError, LoadError
from engine.inverse.photo import photo_from_codes, photo_from_light, read_photo, size_for
from engine.inverse.transfer_curve import check_transfer


@pytest.mark.parametrize("transfer", ["srgb", "linear", "2.2"])
def test_decoded_values_are_within_their_error(transfer):
    light = np.random.default_rng(1).uniform(0.01, 0.9, (32, 32, 3))
    encoded = {"srgb": encode_srgb(light), "linear": light, "2.2": light ** (1 / 2.2)}[transfer]
    photo = photo_from_codes(np.round(255.0 * encoded), transfer)
    off = (photo.radiance - light) / photo.error
    assert np.abs(off).max() < 2.0  # rounding is even over a width of sqrt(12) deviations
    assert 0.9 < np.sqrt(np.mean(off**2)) < 1.1


def test_codes_at_the_end_of_the_scale_say_nothing():
    codes = np.full((2, 3, 3), 100.0)
    codes[0, 1] = (255.0, 90.0, 80.0)
    assert photo_from_codes(codes).usable.tolist() == [[True, False, True], [True, True, True]]


def test_a_linear_picture_with_a_plateau_was_clipped_there():
    light = np.random.default_rng(2).uniform(0.0, 2.0, (64, 64, 3))
    photo = photo_from_light(np.minimum(light, 1.0))
    assert (photo.usable == (light < 1.0).all(axis=2)).all()
    assert photo_from_light(light).usable.all()  # one pixel is the brightest of any picture
    assert photo_from_light(np.full((8, 8, 3), 0.5)).usable.all()  # and one may be all of one brightness


def test_values_that_are_no_light_say_nothing():
    light = np.ones((2, 4, 3))
    light[0, 0, 0], light[0, 1, 1], light[0, 2, 2] = np.nan, np.inf, -1.0
    photo = photo_from_light(light)
    assert photo.usable.tolist() == [[False, False, False, True], [True] * 4]
    assert np.isfinite(photo.radiance).all()


def test_a_smaller_size_has_the_means_of_what_is_usable():
    light = np.arange(4 * 6 * 3, dtype=np.float64).reshape(4, 6, 3)
    photo = photo_from_light(light).masked(np.arange(24).reshape(4, 6) != 1).resized((3, 2))
    assert np.allclose(photo.radiance[1, 2], light[2:, 4:].mean(axis=(0, 1)))
    assert photo.usable.tolist() == [[False, True, True], [True, True, True]]


def test_sizes_keep_their_shape():
    assert size_for((4000, 3000), 512) == (512, 384)
    assert size_for((100, 50), 512) == (100, 50)
    assert size_for((5000, 1), 100) == (100, 1)


@pytest.mark.parametrize("ending", ["png", "jpg", "webp"])
def test_reads_files_of_whole_numbers(tmp_path, ending):
    Image.new("RGB", (8, 8), (188, 100, 50)).save(tmp_path / f"photo.{ending}", quality=100)
    photo = read_photo(tmp_path / f"photo.{ending}")
    assert photo.radiance[4, 4, 0] == pytest.approx(0.503, abs=0.02)
    assert read_photo(tmp_path / f"photo.{ending}", "linear").radiance[4, 4, 0] == pytest.approx(188 / 255, abs=0.02)


def test_refuses_what_is_no_picture(tmp_path):
    (tmp_path / "photo.png").write_bytes(b"no picture at all")
    with pytest.raises(LoadError, match="photo.png: first bytes"):
        read_photo(tmp_path / "photo.png")


@pytest.mark.parametrize("transfer", ["rec2100", "0.5", "nan", "9", ""])
def test_refuses_other_transfer_curves(transfer):
    with pytest.raises(InsituError, match="expected srgb, linear or a gamma"):
        check_transfer(transfer)
