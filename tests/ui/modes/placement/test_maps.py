"""Textures and weight maps multiply a layer at every pixel, whatever it was computed at."""

import numpy as np
import pytest

from engine.core.colour import encode_srgb
from tests.ui.gl.pictures import frame_of
from ui.gl.context import GraphicsError
from ui.gl.display import DisplayView
from ui.modes.placement.gl.layers import ComparedAppearance
from ui.modes.placement.gl.renderer import PlacementRenderer

pytestmark = pytest.mark.gl

# Two objects, so that the second one's rows do not begin at 0.
IMAGE = np.repeat(np.array([[0, 1], [-1, 1]]), 8, axis=0).repeat(12, axis=1)
FRAME = frame_of(IMAGE)
START, STOP = FRAME.object_ranges[1]
N = int(STOP - START)
RNG = np.random.default_rng(9)
RADIANCE = RNG.uniform(0.5, 4.0, (N, 3)).astype(np.float32)
SAMPLES = RNG.uniform(0.0, 1.0, (N, 4)).astype(np.float16)


def shown(renderer: PlacementRenderer) -> np.ndarray:
    return renderer.linear_image().reshape(-1, 3)[FRAME.pixel[START:STOP]]


def start(renderer: PlacementRenderer) -> None:
    renderer.set_frame(FRAME)
    renderer.set_layer("o1.0", 1, N)
    renderer.set_layer_radiance("o1.0", RADIANCE)
    renderer.set_layer_gain("o1.0", (0.5, 1.0, 2.0))


def factor(strength: float = 1.0, inverts: bool = False) -> np.ndarray:
    exact = SAMPLES.astype(np.float64)
    weight = 1.0 - exact[:, 3:] if inverts else exact[:, 3:]
    return (1.0 + strength * (exact[:, :3] - 1.0)) * weight


def test_texture_and_weight_multiply_the_layer(renderer: PlacementRenderer) -> None:
    start(renderer)
    plain = RADIANCE * [0.5, 1.0, 2.0]
    renderer.set_layer_maps("o1.0", SAMPLES)
    np.testing.assert_allclose(shown(renderer), plain * factor(), rtol=1e-5, atol=1e-6)
    renderer.set_map_numbers("o1.0", 0.25, True)
    np.testing.assert_allclose(shown(renderer), plain * factor(0.25, True), rtol=1e-5, atol=1e-6)
    renderer.set_layer("o1.0", 1, N)  # made anew, it keeps them
    renderer.set_layer_radiance("o1.0", RADIANCE)
    np.testing.assert_allclose(shown(renderer), plain * factor(0.25, True), rtol=1e-5, atol=1e-6)
    renderer.set_layer_maps("o1.0", None)
    np.testing.assert_allclose(shown(renderer), plain, rtol=1e-5)


def test_a_coarse_picture_and_indirect_light_have_sharp_images(renderer: PlacementRenderer) -> None:
    start(renderer)
    rows, weights = np.zeros((FRAME.pixel.size, 4), np.int32), np.full((FRAME.pixel.size, 4), 0.25, np.float32)
    renderer.set_footprint(rows, weights)
    renderer.set_layer_radiance("o1.0", np.full((1, 3), 2.0, np.float32))
    renderer.set_indirect_footprint(rows, weights)
    renderer.set_layer_indirect("o1.0", np.full((1, 3), 0.5, np.float32))
    renderer.set_layer_maps("o1.0", SAMPLES)
    np.testing.assert_allclose(shown(renderer), 2.5 * np.array([0.5, 1.0, 2.0]) * factor(), rtol=1e-5, atol=1e-6)


def test_side_a_may_have_other_images(renderer: PlacementRenderer) -> None:
    start(renderer)
    renderer.set_layer_maps("o1.0", SAMPLES)
    curves = np.ones((2, 256, 3))
    others = RNG.uniform(0.0, 1.0, (N, 4)).astype(np.float16)
    renderer.snapshot_compare()
    used = renderer.memory_bytes
    pictures = []
    for maps in ((others, 0.5, False), (SAMPLES, 1.0, True), (None, 1.0, False)):
        renderer.snapshot_compare({"o1.0": ComparedAppearance((0.1, 0.1, 0.1), curves, True, None, maps)})
        renderer.composite(DisplayView(compare_divider=1.0, tone_mapping="linear"))  # all of it is side A
        image = renderer.display_image()
        pictures.append(image.reshape(-1, image.shape[-1])[FRAME.pixel[START:STOP]])
        np.testing.assert_allclose(shown(renderer), RADIANCE * [0.5, 1.0, 2.0] * factor(), rtol=1e-5, atol=1e-6)
    exact = others.astype(np.float64)
    factors = ((1.0 + 0.5 * (exact[:, :3] - 1.0)) * exact[:, 3:], factor(1.0, True), np.ones((N, 3)))
    seen = FRAME.pixel[START:STOP] % FRAME.width < FRAME.width - 2  # the last columns hold the divider
    for found, expected in zip(pictures, factors, strict=True):
        wanted = 255 * encode_srgb(0.1 * RADIANCE * expected)
        np.testing.assert_allclose(found[seen, :3], wanted[seen], atol=1.0)
    assert renderer.memory_bytes == used


def test_images_of_another_size_are_refused(renderer: PlacementRenderer) -> None:
    start(renderer)
    with pytest.raises(GraphicsError, match="expected"):
        renderer.set_layer_maps("o1.0", SAMPLES[1:])
