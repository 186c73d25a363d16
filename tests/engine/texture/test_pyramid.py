"""Filtered look-ups: means are preserved, texels are reproduced, and slanted views neither blur nor shimmer."""

import numpy as np
import pytest

from engine.material.layer_maps import TextureTransform
from engine.texture.pyramid import MOST_PROBES, Pyramid, make_pyramid


def noise(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(3).random((height, width, 3)).astype(np.float32)


@pytest.mark.parametrize("size", [(8, 8), (7, 5), (13, 1), (1, 6), (33, 100)])
def test_every_level_has_the_mean_of_the_image(size: tuple[int, int]) -> None:
    image = noise(*size)
    pyramid = make_pyramid(image)
    assert pyramid.levels[-1].shape == (1, 1, 3)
    for level in pyramid.levels:
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=1e-5)


def test_middles_of_texels_have_their_values_and_v_grows_upwards() -> None:
    image = noise(3, 4)
    column, row = np.meshgrid(np.arange(4), np.arange(3))
    uv = np.stack([(column + 0.5) / 4, 1.0 - (row + 0.5) / 3], axis=2).reshape(-1, 2)
    pyramid = make_pyramid(image)
    np.testing.assert_allclose(pyramid.at(uv), image.reshape(-1, 3), atol=1e-6)
    np.testing.assert_allclose(pyramid.at(uv + [3.0, -2.0]), image.reshape(-1, 3), atol=1e-5)  # it repeats
    # Half way between two texels is half of both.
    np.testing.assert_allclose(pyramid.at(np.array([[0.25, 5 / 6]]))[0], image[0, :2].mean(axis=0), atol=1e-6)


def looked_up(image: np.ndarray, u: float, v: float, transform: TextureTransform) -> np.ndarray:
    """A slow twin: the four texels around a place, each wherever wrapping puts it."""
    height, width = image.shape[:2]
    angle = np.radians(transform.rotation)
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ [u, v] + transform.offset

    def texel(i: int, n: int, wrap: str) -> int:
        if wrap == "clamp":
            return min(max(i, 0), n - 1)
        if wrap == "mirror":
            return min(i % (2 * n), 2 * n - 1 - i % (2 * n))
        return i % n

    x, y = turned[0] * width - 0.5, (1.0 - turned[1]) * height - 0.5
    found = np.zeros(image.shape[2])
    for dx in (0, 1):
        for dy in (0, 1):
            column, row = int(np.floor(x)) + dx, int(np.floor(y)) + dy
            share = (1 - abs(x - column)) * (1 - abs(y - row))
            found += share * image[texel(row, height, transform.wrap[1]), texel(column, width, transform.wrap[0])]
    return found


@pytest.mark.parametrize("wrap", [("repeat", "repeat"), ("clamp", "mirror"), ("mirror", "clamp"), ("repeat", "clamp")])
@pytest.mark.parametrize(("rotation", "offset"), [(0.0, (0.0, 0.0)), (30.0, (0.4, -1.3)), (-90.0, (0.0, 0.25))])
def test_turned_moved_and_wrapped(wrap: tuple, rotation: float, offset: tuple) -> None:
    image, transform = noise(5, 7), TextureTransform(rotation, offset, wrap)
    pyramid = make_pyramid(image).with_transform(transform)
    uv = np.random.default_rng(1).uniform(-2.5, 2.5, (200, 2))
    expected = [looked_up(image, *place, transform) for place in uv]
    np.testing.assert_allclose(pyramid.at(uv), expected, atol=1e-5)
    small = np.full((200, 2), 1e-4)
    np.testing.assert_allclose(pyramid.over(uv, small, small[:, ::-1] * [1, -1]), expected, atol=1e-5)
    # repeats come before the turn, and the sides of a pixel are turned with it
    repeats = (1.5, -0.5)
    expected = [looked_up(image, *(place * repeats), transform) for place in uv]
    np.testing.assert_allclose(pyramid.over(uv, small, small, repeats=repeats), expected, atol=1e-5)


def test_what_a_pixel_sees_is_turned_with_the_image() -> None:
    """Stripes along v, which a quarter's turn lays along u: pixels long in u see one of them, in v their mean."""
    stripes = np.repeat(np.tile(np.float32([0.0, 1.0]), 16)[None, :, None], 32, axis=0)
    pyramid = make_pyramid(stripes).with_transform(TextureTransform(90.0))
    uv = np.stack([np.full(32, 0.3), (np.arange(32) + 0.5) / 32], axis=1)
    sharp = over(pyramid, uv, (8 / 32, 0.0), (0.0, 0.25 / 32))[:, 0]
    np.testing.assert_allclose(sharp, stripes[0, ::-1, 0], atol=1e-6)  # u on the image is −v
    np.testing.assert_allclose(over(pyramid, uv, (0.25 / 32, 0.0), (0.0, 8 / 32)), 0.5, atol=1e-6)


def test_an_image_under_another_transform_is_the_same_object_each_time() -> None:
    pyramid, clamped = make_pyramid(noise(2, 2)), TextureTransform(wrap=("clamp", "clamp"))
    assert pyramid.with_transform(TextureTransform()) is pyramid
    assert (
        pyramid.with_transform(clamped) is pyramid.with_transform(clamped)
        and pyramid.with_transform(clamped).flat is pyramid.flat
    )


def over(pyramid: Pyramid, uv: np.ndarray, across: tuple[float, float], down: tuple[float, float]) -> np.ndarray:
    sides = [np.tile(np.array(side, np.float64), (len(uv), 1)) for side in (across, down)]
    return pyramid.over(uv, *sides)


def test_a_pixel_that_sees_all_of_an_image_sees_its_mean() -> None:
    image = noise(16, 16)
    uv = np.random.default_rng(1).random((50, 2))
    found = over(make_pyramid(image), uv, (1.0, 0.0), (0.0, 1.0))
    np.testing.assert_allclose(found, np.tile(image.mean(axis=(0, 1)), (50, 1)), atol=1e-6)
    beyond = over(make_pyramid(image), uv, (np.inf, 0.0), (np.nan, 1.0))  # a plane seen edge on
    np.testing.assert_allclose(beyond, np.tile(image.mean(axis=(0, 1)), (50, 1)), atol=0.02)


def test_a_slanted_pixel_is_blurred_along_its_longer_side_only() -> None:
    # Stripes along v, seen by pixels eight stripes long in v and a quarter of a texel wide in u: as sharp as ever.
    stripes = np.repeat(np.tile(np.float32([0.0, 1.0]), 16)[None, :, None], 32, axis=0)
    pyramid = make_pyramid(stripes)
    u = (np.arange(32) + 0.5) / 32
    uv = np.stack([u, np.full(32, 0.3)], axis=1)
    np.testing.assert_allclose(over(pyramid, uv, (0.25 / 32, 0.0), (0.0, 8 / 32))[:, 0], stripes[0, :, 0], atol=1e-6)
    # The same pixels across the stripes see the mean of them.
    across = over(pyramid, uv, (8 / 32, 0.0), (0.0, 0.25 / 32))
    np.testing.assert_allclose(across, 0.5, atol=1e-6)


def test_a_turned_footprint_is_the_mean_over_its_ellipse() -> None:
    # Against many points of the pixel's own parallelogram, of a smooth image: the shape of the filter does not matter.
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64) + 0.5) / 64)
    image = (0.5 + 0.4 * np.sin(2 * np.pi * (x + 2 * y)))[..., None].astype(np.float32)
    pyramid = make_pyramid(image)
    a, b = np.array([0.16, 0.08]), np.array([-0.01, 0.02])
    uv = np.random.default_rng(5).random((20, 2))
    places = (np.arange(16) + 0.5) / 16 - 0.5
    covered = uv[:, None, None] + places[:, None, None] * a + places[None, :, None] * b
    expected = pyramid.at(covered.reshape(-1, 2)).reshape(20, 256).mean(axis=1)
    np.testing.assert_allclose(over(pyramid, uv, tuple(a), tuple(b))[:, 0], expected, atol=0.02)


def test_no_pixel_takes_more_look_ups_than_the_most() -> None:
    # Of 1,000 texels by a tenth of one the width is that of the longer side shared among the most look-ups.
    ramp = np.linspace(0.0, 1.0, 2048, dtype=np.float32)[None, :, None]
    pyramid = make_pyramid(ramp)
    found = over(pyramid, np.array([[0.5, 0.5]]), (1000 / 2048, 0.0), (0.0, 1e-4))
    assert found[0, 0] == pytest.approx(0.5, abs=1e-3) and MOST_PROBES == 16


def test_a_quick_look_up_is_of_the_nearest_level() -> None:
    chance = np.random.default_rng(6)
    transform = TextureTransform(30.0, (0.2, -0.3), ("mirror", "repeat"))
    image = make_pyramid(chance.random((32, 32, 3))).with_transform(transform)
    n = 150  # more than are prepared at once, and not a multiple of that
    uv, wide = chance.random((n, 2)) * 3.0 - 1.0, 2.0 ** chance.uniform(-1.0, 6.0, n)  # texels
    side = np.zeros((2, n, 2))
    side[0, :, 0] = side[1, :, 1] = wide / 32.0
    level = np.clip(np.rint(np.log2(wide)), 0.0, 5.0)
    quick = image.over(uv, side[0], side[1], 2, is_quick=True)
    np.testing.assert_allclose(quick, image.at(uv, level), atol=1e-5)
    assert np.abs(quick - image.over(uv, side[0], side[1], 2)).max() > 0.05  # that between two levels is another
