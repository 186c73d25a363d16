"""Tone mapping, sRGB, silhouettes, outlines and A/B on the display picture."""

import dataclasses

import numpy as np
import pytest

from engine.core.colour import ToneMapping
from engine.render.display import display_picture
from tests.naive import pictures as naive
from tests.ui.gl.pictures import frame_of, full_frame
from ui.gl.context import GraphicsError
from ui.gl.display import HOVER_COLOUR, SELECTION_COLOUR, DisplayView, outline_pixels
from ui.modes.placement.gl.renderer import PlacementRenderer

pytestmark = pytest.mark.gl


def _show(renderer: PlacementRenderer, radiance: np.ndarray) -> None:
    """One row of pixels with these radiances (p,3)."""
    renderer.set_frame(full_frame(len(radiance)))
    renderer.set_layer("ball.0", 0, len(radiance))
    renderer.set_layer_radiance("ball.0", radiance.astype(np.float32))


def _displayed(renderer: PlacementRenderer, view: DisplayView) -> np.ndarray:
    renderer.composite(view)
    return renderer.display_image()


RADIANCES = np.concatenate([[-1.0, 0.0], np.geomspace(1e-4, 100.0, 60)])


@pytest.mark.parametrize("exposure", [0.0, -2.0, 3.5])
@pytest.mark.parametrize("tone_mapping", ["linear", "filmic"])
def test_display_values_follow_the_formulas(renderer: PlacementRenderer, tone_mapping: str, exposure: float) -> None:
    _show(renderer, np.repeat(RADIANCES[:, None], 3, axis=1))
    image = _displayed(renderer, DisplayView(exposure=exposure, tone_mapping=tone_mapping))
    exposed = [value * 2.0**exposure for value in RADIANCES]
    curve = naive.filmic if tone_mapping == "filmic" else lambda value: min(max(value, 0.0), 1.0)
    expected = [round(255 * naive.encode_srgb(curve(value))) for value in exposed]
    # One step of 255 for the rounding of the rasterizer's power function.
    assert np.abs(image[0, :, 1].astype(int) - expected).max() <= 1


@pytest.mark.parametrize(("view", "at_most"), [("filmic", 1), ("linear", 1), ("false_colour", 2), ("agx", 2),
                                               ("aces_2", 5), ("aces_1", 9)])  # fmt: skip
def test_the_shader_and_pictures_in_files_show_every_colour_alike(
    renderer: PlacementRenderer, view: ToneMapping, at_most: int
) -> None:
    # ACES has folds that its table rounds off: 999 of 1,000 values are within 2 of 255 all the same.
    rng = np.random.default_rng(5)
    light = np.exp2(rng.uniform(-9.0, 6.0, (1000, 1)) + rng.uniform(-5.0, 0.0, (1000, 3))).astype(np.float32)
    light[:4] = [[0, 0, 0], [-1, 0.5, 2], [1e30, 1e30, 1e30], [1e-30, 0, 1]]
    _show(renderer, light)
    shown = _displayed(renderer, DisplayView(tone_mapping=view))[0].astype(int)
    off = shown - display_picture(light[None], 0.0, view)[0]
    assert np.abs(off).max() <= at_most and np.quantile(np.abs(off), 0.999) <= 2


def test_middle_grey_in_srgb(renderer: PlacementRenderer) -> None:
    # Linear 0.2140411 is sRGB one half, 127.5: 127 or 128.
    _show(renderer, np.full((1, 3), 0.2140411))
    assert _displayed(renderer, DisplayView(tone_mapping="linear"))[0, 0, 0] in (127, 128)


def test_false_colour_tells_stops_apart(renderer: PlacementRenderer) -> None:
    stops = np.arange(-8.0, 8.0) + 0.75  # the bright half of each stop
    _show(renderer, np.repeat(2.0 ** stops[:, None], 3, axis=1))
    image = _displayed(renderer, DisplayView(tone_mapping="false_colour"))[0].astype(float)
    luminance = image @ [0.2126, 0.7152, 0.0722]
    # Lightness of viridis grows all the way, from dark blue (68, 1, 84) to yellow (253, 231, 37); 7.75 is near its end.
    assert np.all(np.diff(luminance) > 0)
    np.testing.assert_allclose(image[-1], [253, 231, 37], atol=12)
    # The lower half of a stop is 0.85 times as light as its upper half, but for the map's own slope.
    renderer.set_layer_radiance("ball.0", np.repeat(2.0 ** (stops - 0.5)[:, None], 3, axis=1))
    darker = _displayed(renderer, DisplayView(tone_mapping="false_colour"))[0].astype(float)
    assert np.all(darker.sum(axis=1) < image.sum(axis=1))


def test_false_colour_looks_at_luminance(renderer: PlacementRenderer) -> None:
    # A green of luminance 1 looks as a grey of 1 does.
    _show(renderer, np.array([[0, 1 / 0.7152, 0], [1, 1, 1]]) * 1.2)
    image = _displayed(renderer, DisplayView(tone_mapping="false_colour"))
    np.testing.assert_allclose(image[0, 0].astype(int), image[0, 1].astype(int), atol=1)


def test_an_unknown_tone_mapping_is_refused(renderer: PlacementRenderer) -> None:
    _show(renderer, np.ones((1, 3)))
    with pytest.raises(GraphicsError, match="expected one of filmic, agx, aces_2"):
        renderer.composite(DisplayView(tone_mapping="sepia"))  # type: ignore[arg-type]


def test_outlines_surround_the_selected_and_the_hovered_object(renderer: PlacementRenderer) -> None:
    image = np.full((12, 20), -1)
    image[3:8, 2:8] = 0
    image[3:8, 11:17] = 1
    renderer.set_frame(frame_of(image))
    shown = _displayed(renderer, DisplayView(selected=0, hovered=1))
    for i_object, colour in ((0, SELECTION_COLOUR), (1, HOVER_COLOUR)):
        found = np.all(np.abs(shown.astype(int) - np.round(255 * np.array(colour))) <= 1, axis=-1)
        expected = np.zeros(image.size, dtype=bool)
        expected[outline_pixels(image == i_object)] = True
        np.testing.assert_array_equal(found, expected.reshape(image.shape))
    assert not _displayed(renderer, DisplayView()).any()


def test_the_outline_of_one_pixel_leaves_it_free() -> None:
    mask = np.zeros((3, 4), dtype=bool)
    mask[1, 1] = True
    # Itself (5) and its neighbours above (1), left (4), right (6), below (9), row-major in rows of four.
    np.testing.assert_array_equal(outline_pixels(mask), [1, 4, 6, 9])


def test_the_divider_shows_the_snapshot_left_and_the_picture_right(renderer: PlacementRenderer) -> None:
    _show(renderer, np.full((10, 3), 1.0))
    renderer.snapshot_compare()
    renderer.set_layer_gain("ball.0", (0.0, 0.0, 0.0))
    view = DisplayView(tone_mapping="linear", compare_divider=0.4)
    shown = _displayed(renderer, view)[0, :, 0].astype(int)
    # Four pixels of B, white; the divider, 0.95 · 255 = 242; then A, black.
    np.testing.assert_allclose(shown, [255] * 4 + [242] + [0] * 5, atol=1)
    np.testing.assert_array_equal(renderer.linear_image(), 0)
    assert (_displayed(renderer, dataclasses.replace(view, compare_divider=1.0))[0, :9, 0] == 255).all()
    renderer.drop_compare()
    assert not _displayed(renderer, view).any()


def half_covered(renderer: PlacementRenderer) -> None:
    """One row of four pixels: a surface, one of which it covers half, a lamp of which a quarter is seen, and nothing
    but the sky, which is hidden."""
    frame = frame_of(np.array([[0, 0, -1, -1]]))
    frame = dataclasses.replace(
        frame, share=np.array([1.0, 0.5]), open_image=np.array([[0.0, 0.5, 0.75, 1.0]], np.float32),
        emission_image=np.array([[[0, 0, 0], [0, 0, 0], [0.1, 0.1, 0.1], [0, 0, 0]]], np.float32),
    )  # fmt: skip
    renderer.set_frame(frame)
    renderer.set_environment(np.full((1, 2, 3), 7.0, np.float32))
    renderer.set_layer("ball.0", 0, 2)
    renderer.set_layer_radiance("ball.0", np.full((2, 3), 0.4, np.float32))
    renderer.hide_environment(True)


def test_without_the_environment_alpha_is_what_is_covered(renderer: PlacementRenderer) -> None:
    half_covered(renderer)
    linear = renderer.linear_image_with_alpha()[0]
    np.testing.assert_allclose(linear[:, 3], [1.0, 0.5, 0.25, 0.0])
    np.testing.assert_allclose(linear[:, 0], [0.4, 0.2, 0.1, 0.0], rtol=1e-6)
    renderer.hide_environment(False)
    whole = renderer.linear_image_with_alpha()[0]
    np.testing.assert_allclose(whole[:, 3], 1.0)
    np.testing.assert_allclose(whole[:, 0], linear[:, 0] + 7.0 * (1.0 - linear[:, 3]), rtol=1e-6)


def test_a_colour_behind_is_exposed_but_not_multiplied_by_the_light(renderer: PlacementRenderer) -> None:
    half_covered(renderer)
    view = DisplayView(exposure=1.0, tone_mapping="linear", behind=(0.3, 0.3, 0.3))
    shown = _displayed(renderer, view)[0, :, 1]
    expected = [0.8, 2.0 * 0.2 + 0.5 * 0.3, 2.0 * 0.1 + 0.75 * 0.3, 0.3]
    assert np.abs(shown - [255.0 * naive.encode_srgb(value) for value in expected]).max() <= 1.0


def test_a_transparent_picture_is_over_a_checkerboard_on_screen_and_has_alpha_in_files(
    renderer: PlacementRenderer,
) -> None:
    half_covered(renderer)
    view = DisplayView(tone_mapping="linear", behind=None)
    shown, finished = _displayed(renderer, view)[0].astype(float), renderer.finished_image(view)[0]
    np.testing.assert_allclose(finished[:, 3], [1.0, 0.5, 0.25, 0.0])
    own = naive.encode_srgb(0.4)  # that of a lamp of which a quarter is seen as well: 0.1 / 0.25
    np.testing.assert_allclose(finished[:3, 0], own, atol=0.002)
    board = shown[3, 0]
    assert 50 < board < 120 and abs(shown[1, 0] - (0.5 * 255 * own + 0.5 * board)) <= 1.0


def test_one_channel_alone_is_grey_by_its_own_value(renderer: PlacementRenderer) -> None:
    half_covered(renderer)
    renderer.set_layer_radiance("ball.0", np.array([[0.1, 0.2, 0.4]] * 2, np.float32))
    luminance = 0.2126 * 0.1 + 0.7152 * 0.2 + 0.0722 * 0.4
    for channel, value in (("red", 0.1), ("green", 0.2), ("blue", 0.4), ("luminance", luminance)):
        view = DisplayView(exposure=1.0, tone_mapping="linear", channel=channel)
        grey = 255.0 * naive.encode_srgb(2.0 * value)
        assert np.abs(_displayed(renderer, view)[0, 0] - grey).max() <= 1.0, channel
    alpha = _displayed(renderer, DisplayView(exposure=3.0, channel="alpha"))[0, :, 1]
    np.testing.assert_array_equal(alpha, [255, 128, 64, 0])  # what covers the pixels, whatever the exposure
    assert _displayed(renderer, DisplayView(tone_mapping="linear"))[0, 0, 0] < 255


def test_stripes_are_where_the_screen_clips_alone_and_not_in_files(renderer: PlacementRenderer) -> None:
    light = np.full((32, 3), 0.5)
    light[8:24, 1] = 1.5
    _show(renderer, light)
    plain = _displayed(renderer, DisplayView(tone_mapping="linear"))[0]
    view = DisplayView(tone_mapping="linear", zebra=True)
    striped = _displayed(renderer, view)[0]
    differs = (striped != plain).any(axis=1)
    np.testing.assert_array_equal(differs, [8 <= i < 24 and i // 4 % 2 == 0 for i in range(32)])
    np.testing.assert_allclose(renderer.finished_image(view)[0], plain / 255.0, atol=0.003)


def test_gamma_is_the_power_of_the_finished_colours(renderer: PlacementRenderer) -> None:
    _show(renderer, RADIANCES[:, None] * np.ones(3))
    plain = renderer.finished_image(DisplayView())
    lifted = renderer.finished_image(DisplayView(gamma=2.0))
    np.testing.assert_allclose(lifted, np.sqrt(plain), atol=1e-5)


def test_a_part_is_sampled_evenly(renderer: PlacementRenderer) -> None:
    """24 pixels from the eighth on, by eight: the second of each three."""
    steps = np.linspace(0.0, 0.9, 40)
    _show(renderer, steps[:, None] * np.ones(3))
    view, (display, target) = DisplayView(tone_mapping="linear"), renderer.shown
    whole = _displayed(renderer, view)[0]
    linear = target.color_attachments[0]
    some = display.sampled(linear, view, (8, 0, 24, 1), (8, 1))
    np.testing.assert_array_equal(some[0, :, :3], whole[9:32:3])
