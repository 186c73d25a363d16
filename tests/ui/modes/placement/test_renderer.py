"""The picture that the renderer puts together, against twins that go pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from engine.core.colour import ToneMapping
from engine.scene.picture_frame import Lamps, PictureFrame
from tests.naive import pictures as naive
from tests.ui.gl.pictures import frame_of, full_frame, norms_of
from ui.gl.context import GraphicsError
from ui.gl.display import DisplayView
from ui.modes.placement.gl.renderer import PlacementRenderer

pytestmark = pytest.mark.gl

RNG_SEED = 11


def _two_objects() -> PictureFrame:
    """24×16: object 0 on the left, object 2 below it, object 1 an emitter, the rest background."""
    image = np.full((16, 24), -1)
    image[2:9, 1:13] = 0
    image[4:7, 16:20] = 1
    image[9:15, 3:22] = 2
    return frame_of(image, emitters=(1,))


def _n_pixels(frame: PictureFrame, i_object: int) -> int:
    return int(np.diff(frame.object_ranges[i_object])[0])


def _pixels_of(frame: PictureFrame, i_object: int) -> np.ndarray:
    start, stop = frame.object_ranges[i_object]
    return frame.pixel[start:stop]


def test_pixels_at_edges_show_several_surfaces_by_their_shares(renderer: PlacementRenderer) -> None:
    """Two objects, a lamp and the sky: pixel 1 shows all four, pixel 2 two points of one object."""
    share = np.array([1.0, 0.25, 0.5, 0.5, 1.0, 0.125, 0.5, 0.0], np.float32)
    lamps = Lamps(
        np.array([1, 4]),
        np.array([2, 2]),
        np.array([0.5, 0.25], np.float32),
        np.ones((2, 3)),
        np.tile([8.0, 4.0, 2.0], (2, 1)),
    )
    frame = PictureFrame(
        pixel=np.array([0, 1, 2, 2, 3, 1, 4, 5], np.int32),
        object_ranges=np.array([[0, 5], [5, 8], [8, 8]]),
        object_image=np.array([[0, 0, 0, 0, 1, -1]], np.int16),
        theta_o=np.zeros(8, np.float32),
        emission_image=np.array([[[0, 0, 0], [4, 2, 1], [0, 0, 0], [0, 0, 0], [2, 1, 0.5], [0, 0, 0]]], np.float32),
        ray_directions=np.tile(np.array([0.0, 0.0, -1.0], np.float32), (1, 6, 1)),
        share=share,
        open_image=np.array([[0, 0.125, 0, 0, 0.25, 1]], np.float32),
        lamps=lamps,
    )
    radiance = np.random.default_rng(RNG_SEED).uniform(1, 3, (8, 3)).astype(np.float32)
    radiance[7] = np.inf  # of no share: it is not seen
    renderer.set_frame(frame)
    renderer.set_environment(np.full((2, 4, 3), 16.0, np.float32))
    for i_object, (start, stop) in enumerate(frame.object_ranges[:2]):
        renderer.set_layer(f"o{i_object}.0", i_object, int(stop - start))
        renderer.set_layer_radiance(f"o{i_object}.0", radiance[start:stop])

    def expected(lamp: np.ndarray) -> np.ndarray:
        total = 16.0 * frame.open_image.reshape(-1, 1) + np.array([0, 0.5, 0, 0, 0.25, 0])[:, None] * lamp
        np.add.at(total, frame.pixel[:7], (share[:, None] * np.nan_to_num(radiance))[:7])
        return total

    lamp = np.array([8.0, 4.0, 2.0])
    np.testing.assert_allclose(renderer.linear_image()[0], expected(lamp), rtol=1e-6)
    for factor in (1e6, 0.0, 2.0):  # no trace is left of what it was
        renderer.set_emission(2, tuple(factor * lamp))
        np.testing.assert_allclose(renderer.linear_image()[0], expected(factor * lamp), rtol=1e-6)
    radiance[6] = np.nan
    renderer.set_layer_radiance("o1.0", radiance[5:8])
    image = renderer.linear_image()
    assert np.isfinite(image).all() and image[0, 4].tolist() == [0.0, 0.0, 0.0]


def test_layers_gains_view_curves_and_emitters_make_the_picture(renderer: PlacementRenderer) -> None:
    rng, frame = np.random.default_rng(RNG_SEED), _two_objects()
    renderer.set_frame(frame)
    expected = frame.emission_image.astype(np.float64).reshape(-1, 3)
    curve = rng.uniform(0, 2, (256, 3))
    for i_object in (0, 2):
        n, pixels = _n_pixels(frame, i_object), _pixels_of(frame, i_object)
        angles = frame.theta_o[slice(*frame.object_ranges[i_object])]
        coat, base = rng.uniform(0, 5, (2, n, 3)).astype(np.float32)
        renderer.set_layer(f"o{i_object}.0", i_object, n)
        renderer.set_layer(f"o{i_object}.1", i_object, n)
        renderer.set_layer_radiance(f"o{i_object}.0", coat)
        renderer.set_layer_radiance(f"o{i_object}.1", base)
        renderer.set_layer_gain(f"o{i_object}.0", (0.5, 1.0, 2.0))
        renderer.set_view_curve(f"o{i_object}.1", curve)
        f_o = np.stack([naive.view_curve(curve, angle) for angle in angles])
        expected[pixels] = coat * [0.5, 1.0, 2.0] + base * f_o
    image = renderer.linear_image()
    np.testing.assert_allclose(image.reshape(-1, 3), expected, rtol=3e-4, atol=1e-5)  # 1.3e-4 on an NVIDIA card

    renderer.set_layer_visible("o0.1", False)
    renderer.set_layer_visible("o2.0", False)
    changed = renderer.linear_image().reshape(-1, 3)
    shares = np.stack([naive.view_curve(curve, a) for a in frame.theta_o[slice(*frame.object_ranges[2])]])
    # What is left: object 0's coat alone and object 2's base alone.
    np.testing.assert_allclose(
        changed[_pixels_of(frame, 0)], renderer.layer_radiance("o0.0") * [0.5, 1.0, 2.0], rtol=1e-5
    )
    np.testing.assert_allclose(
        changed[_pixels_of(frame, 2)], renderer.layer_radiance("o2.1") * shares, rtol=1e-4, atol=1e-5
    )


def test_factors_by_the_coats_normal_take_its_angle(renderer: PlacementRenderer) -> None:
    rng, frame = np.random.default_rng(RNG_SEED), _two_objects()
    coat_theta_o = rng.uniform(0.0, np.pi / 2, frame.n_points).astype(np.float32)
    renderer.set_frame(replace(frame, coat_theta_o=coat_theta_o))
    mine, ones = slice(*frame.object_ranges[0]), np.ones((256, 3))
    radiance, (base, coat) = rng.uniform(0, 5, (_n_pixels(frame, 0), 3)), rng.uniform(0, 2, (2, 256, 3))
    renderer.set_layer("o0.0", 0, len(radiance))
    renderer.set_layer_radiance("o0.0", radiance.astype(np.float32))
    for of_base, of_coat in ((base, coat), (base, ones), (ones, coat), (ones, ones), (base, coat)):
        renderer.set_view_curve("o0.0", of_base, of_coat)
        factors = [
            np.stack([naive.view_curve(curve, angle) for angle in angles[mine]])
            for curve, angles in ((of_base, frame.theta_o), (of_coat, coat_theta_o))
        ]
        found = renderer.linear_image().reshape(-1, 3)[_pixels_of(frame, 0)]
        np.testing.assert_allclose(found, radiance * factors[0] * factors[1], rtol=3e-4, atol=1e-5)


@pytest.mark.parametrize("curve", [None, np.ones((256, 3)), np.linspace(0.0, 2.0, 768).reshape(256, 3)])
def test_indirect_light_is_added_at_samples_of_its_own(renderer: PlacementRenderer, curve: np.ndarray | None) -> None:
    rng, frame = np.random.default_rng(RNG_SEED), _two_objects()
    renderer.set_frame(frame)
    rows = rng.integers(0, 3, (frame.n_points, 4)).astype(np.int32)
    weights = rng.dirichlet(np.ones(4), frame.n_points).astype(np.float32)
    renderer.set_indirect_footprint(rows, weights)
    n, mine = _n_pixels(frame, 0), slice(*frame.object_ranges[0])
    f_o = np.ones(1) if curve is None else np.stack([naive.view_curve(curve, angle) for angle in frame.theta_o[mine]])
    expected = np.zeros((n, 3))
    for key, gain in (("o0.0", (0.5, 1.0, 2.0)), ("o0.1", (1.0, 3.0, 0.0))):
        direct, indirect = rng.uniform(0, 5, (n, 3)).astype(np.float32), rng.uniform(0, 5, (3, 3)).astype(np.float32)
        renderer.set_layer(key, 0, n)
        renderer.set_layer_gain(key, gain)
        renderer.set_view_curve(key, curve)
        renderer.set_layer_radiance(key, direct)
        renderer.set_layer_indirect(key, indirect)
        expected += np.array(gain) * f_o * (direct + np.einsum("pk,pkc->pc", weights[mine], indirect[rows[mine]]))
    image = renderer.linear_image().reshape(-1, 3)
    np.testing.assert_allclose(image[_pixels_of(frame, 0)], expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("rotation", [0.0, 37.0, -400.0])
def test_the_background_is_the_rotated_environment(renderer: PlacementRenderer, rotation: float) -> None:
    frame = frame_of(np.full((9, 13), -1))
    environment = np.random.default_rng(2).uniform(0, 3, (8, 16, 3)).astype(np.float32)
    renderer.set_frame(frame)
    renderer.set_environment(environment, rotation, intensity=2.0)
    image = renderer.linear_image()
    expected = [
        [2.0 * naive.background(environment, direction, rotation) for direction in row]
        for row in frame.ray_directions.astype(np.float64)
    ]
    # The software rasterizer interpolates texels with 8-bit weights: 1/256 of the largest step, twice 3.
    np.testing.assert_allclose(image, expected, atol=2 * 3 * 2 / 256)


def test_the_centre_of_the_environment_is_seen_along_minus_z(renderer: PlacementRenderer) -> None:
    frame = frame_of(np.full((1, 3), -1))
    frame.ray_directions[0] = [[0, 0, -1], [1, 0, 0], [0, 1, 0]]
    environment = np.zeros((4, 8, 3), dtype=np.float32)
    environment[:, 3:5] = (1, 0, 0)  # around the centre column: along -Z
    environment[:, 5:7] = (0, 1, 0)  # a quarter turn to the right: along +X
    renderer.set_frame(frame)
    renderer.set_environment(environment)
    image = renderer.linear_image()
    np.testing.assert_allclose(image[0, :2], [[1, 0, 0], [0, 1, 0]], atol=0.01)
    # Turned counter-clockwise seen from above by 90 degrees, what was at +X (right) is in front, at -Z.
    renderer.turn_environment(90.0)
    np.testing.assert_allclose(renderer.linear_image()[0, 0], [0, 1, 0], atol=0.01)


def test_a_footprint_mixes_samples_until_the_full_picture_comes(renderer: PlacementRenderer) -> None:
    rng, frame = np.random.default_rng(RNG_SEED), _two_objects()
    renderer.set_frame(frame)
    rows = rng.integers(0, 5, (frame.n_points, 4)).astype(np.int32)
    weights = rng.dirichlet(np.ones(4), frame.n_points).astype(np.float32)
    renderer.set_footprint(rows, weights)
    coarse = rng.uniform(0, 2, (2, 5, 3)).astype(np.float32)
    for i, i_object in enumerate((0, 2)):
        renderer.set_layer(f"o{i_object}.0", i_object, 5)
        renderer.set_layer_radiance(f"o{i_object}.0", coarse[i])
    image = renderer.linear_image().reshape(-1, 3)
    for i, i_object in enumerate((0, 2)):
        span = slice(*frame.object_ranges[i_object])
        mixed = np.einsum("pk,pkc->pc", weights[span], coarse[i][rows[span]])
        np.testing.assert_allclose(image[frame.pixel[span]], mixed, rtol=1e-5, atol=1e-6)

    # The next stage begins: the footprint goes, object 0's picture comes, object 2 keeps its coarse one until its own.
    renderer.set_footprint(None)
    fine = rng.uniform(0, 2, (_n_pixels(frame, 0), 3)).astype(np.float32)
    renderer.set_layer_radiance("o0.0", fine)
    later = renderer.linear_image().reshape(-1, 3)
    np.testing.assert_array_equal(later[_pixels_of(frame, 0)], fine)
    np.testing.assert_array_equal(later[_pixels_of(frame, 2)], image[_pixels_of(frame, 2)])


def test_a_coarse_transport_is_shown_through_its_footprint(renderer: PlacementRenderer) -> None:
    frame = full_frame(6)
    renderer.set_frame(frame)
    rows = np.array([[i // 3, 0, 0, 0] for i in range(6)])
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (6, 1))
    renderer.set_footprint(rows, weights)
    renderer.set_layer("ball.0", 0, 2)
    transport = np.array([[[1, 1, 1], [2, 2, 2]]], dtype=np.float32)
    renderer.begin_transport("ball.0", transport, norms_of(transport))
    renderer.want("ball.0", np.full((1, 3), 3.0))
    assert renderer.upload(1.0) and renderer.update().exact
    # Pixels 0 to 2 show sample 0 (3·1), pixels 3 to 5 sample 1 (3·2).
    np.testing.assert_array_equal(renderer.linear_image()[0, :, 0], [3, 3, 3, 6, 6, 6])


@pytest.mark.parametrize("worst", [0.0, np.nan, -np.inf])
def test_the_mean_is_of_what_is_finite(renderer: PlacementRenderer, worst: float) -> None:
    frame = full_frame(2500)
    radiance = np.random.default_rng(RNG_SEED).normal(size=(2500, 3)).astype(np.float32)
    radiance[::601, 1] = worst
    renderer.set_frame(frame)
    renderer.set_layer("a", 0, 2500)
    renderer.set_layer_radiance("a", radiance)
    assert renderer.mean_radiance == pytest.approx(np.mean(np.abs(np.nan_to_num(radiance, posinf=0.0, neginf=0.0))))


def test_no_nan_reaches_the_screen(renderer: PlacementRenderer) -> None:
    renderer.set_frame(full_frame(10))
    renderer.set_layer("ball.0", 0, 10)
    radiance = np.ones((10, 3), dtype=np.float32)
    radiance[2, 1], radiance[5, 0], radiance[9] = np.nan, np.inf, -np.inf
    renderer.set_layer_radiance("ball.0", radiance)
    image = renderer.linear_image()
    np.testing.assert_array_equal(image[0, :, 0], [1, 1, 0, 1, 1, 0, 1, 1, 1, 0])
    for tone_mapping in ("filmic", "linear", "false_colour"):
        for exposure in (-60.0, 0.0, 60.0):
            renderer.composite(DisplayView(exposure=exposure, tone_mapping=tone_mapping))
            assert renderer.display_image().shape == (1, 10, 3)
    assert not renderer.display_image()[0, 2].tolist() == renderer.display_image()[0, 0].tolist()


def test_a_picture_is_not_cut_where_halves_end(renderer: PlacementRenderer) -> None:
    """65504, where a target of halves would end."""
    radiance = np.array([[1e5, 65504.0, 65520.0], [3e38, 1e-8, 0.0]], np.float32)
    renderer.set_frame(full_frame(2))
    renderer.set_layer("ball.0", 0, 2)
    renderer.set_layer_radiance("ball.0", radiance)
    np.testing.assert_array_equal(renderer.linear_image()[0], radiance)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True)
@given(
    radiance=st.floats(width=32, allow_nan=True, allow_infinity=True),
    gain=st.floats(-1e30, 1e30),
    exposure=st.floats(-1e3, 1e3),
    tone_mapping=st.sampled_from(["filmic", "linear", "false_colour"]),
)
def test_whatever_the_numbers_the_linear_picture_is_finite(
    renderer: PlacementRenderer, radiance: float, gain: float, exposure: float, tone_mapping: ToneMapping
) -> None:
    renderer.set_frame(full_frame(2))
    renderer.set_layer("ball.0", 0, 2)
    renderer.set_layer_radiance("ball.0", np.array([[radiance, 0, 0], [1, 1, 1]], dtype=np.float32))
    renderer.set_layer_gain("ball.0", (gain, 1.0, 1.0))
    renderer.composite(DisplayView(exposure=exposure, tone_mapping=tone_mapping))
    image = renderer.linear_image()
    assert np.isfinite(image).all()
    # What is no number, or becomes none times the gain (beyond 3.4e38), is black; pixel 1 is always fine.
    is_bad = not np.isfinite(radiance) or abs(radiance * gain) > 3.5e38
    assert image[0, 1].any() and not (is_bad and image[0, 0].any())


def test_only_what_changed_is_drawn_and_the_rest_stays(renderer: PlacementRenderer) -> None:
    frame, view = _two_objects(), DisplayView(tone_mapping="linear")
    renderer.set_frame(frame)
    for i_object in (0, 2):
        n = _n_pixels(frame, i_object)
        renderer.set_layer(f"o{i_object}.0", i_object, n)
        renderer.set_layer_radiance(f"o{i_object}.0", np.full((n, 3), 1.0, dtype=np.float32))
    renderer.composite(view)
    before = renderer.display_image()
    renderer.set_layer_gain("o0.0", (0.0, 1.0, 0.0))
    renderer.composite(view)
    after = renderer.display_image()
    changed = np.any(before != after, axis=-1)
    np.testing.assert_array_equal(changed, frame.object_image == 0)
    np.testing.assert_array_equal(np.unique(after[changed], axis=0), [[0, 255, 0]])


def test_the_object_under_a_pixel(renderer: PlacementRenderer) -> None:
    renderer.set_frame(_two_objects())
    assert [renderer.object_at(1, 2), renderer.object_at(16, 4), renderer.object_at(0, 0)] == [0, 1, -1]
    assert renderer.object_at(-1, 3) == renderer.object_at(24, 3) == renderer.object_at(3, 16) == -1


def test_a_frame_that_does_not_fit_leaves_the_old_picture(renderer: PlacementRenderer) -> None:
    renderer.set_frame(full_frame(4))
    renderer.set_layer("ball.0", 0, 4)
    renderer.set_layer_radiance("ball.0", np.full((4, 3), 2.0, dtype=np.float32))
    before, bytes_before = renderer.linear_image(), renderer.memory_bytes
    too_wide = renderer.context.info["GL_MAX_TEXTURE_SIZE"] + 1
    with pytest.raises(GraphicsError, match="old picture stays"):
        renderer.set_frame(full_frame(too_wide))
    renderer.memory.limit = bytes_before + 100
    with pytest.raises(GraphicsError, match="exceed the limit"):
        renderer.set_frame(full_frame(500))
    assert renderer.memory_bytes == bytes_before
    np.testing.assert_array_equal(renderer.linear_image(), before)


def test_a_new_frame_drops_everything_of_the_old_one(renderer: PlacementRenderer) -> None:
    renderer.set_frame(full_frame(4))
    alone = renderer.memory_bytes
    renderer.set_layer("ball.0", 0, 4)
    renderer.set_environment(np.ones((2, 4, 3)))
    renderer.set_footprint(np.zeros((4, 4), int), np.full((4, 4), 0.25))
    renderer.snapshot_compare()
    renderer.set_frame(full_frame(4))
    assert renderer.layer_keys == () and renderer.memory_bytes == alone


def test_wrong_sample_counts_and_shapes_are_refused(renderer: PlacementRenderer) -> None:
    with pytest.raises(GraphicsError, match="set_frame comes first"):
        renderer.composite(DisplayView())
    renderer.set_frame(full_frame(4))
    with pytest.raises(GraphicsError, match="3 samples without a footprint, expected 4"):
        renderer.set_layer("ball.0", 0, 3)
    with pytest.raises(GraphicsError, match="object 1"):
        renderer.set_layer("ball.0", 1, 4)
    renderer.set_layer("ball.0", 0, 4)
    with pytest.raises(GraphicsError, match=r"expected \(p, 3\)"):
        renderer.set_layer_radiance("ball.0", np.zeros((4, 4)))
    with pytest.raises(GraphicsError, match=r"expected \(256, 3\)"):
        renderer.set_view_curve("ball.0", np.zeros((255, 3)))
    with pytest.raises(GraphicsError, match="expected 0 or more"):
        renderer.set_footprint(np.full((4, 4), -1), np.zeros((4, 4)))
    renderer.set_footprint(np.full((4, 4), 6), np.zeros((4, 4)))
    with pytest.raises(GraphicsError, match="the footprint needs 7"):
        renderer.set_layer_radiance("ball.0", np.zeros((4, 3)))


def test_a_frame_is_made_in_steps_while_the_picture_stays(renderer: PlacementRenderer) -> None:
    renderer.set_frame(full_frame(4))
    alone = renderer.memory_bytes
    renderer.set_layer("ball.0", 0, 4)
    renderer.set_layer_radiance("ball.0", np.full((4, 3), 2.0, dtype=np.float32))
    before, coming, n_steps = renderer.linear_image(), full_frame(4), 1
    while renderer.prepare_frame(coming):
        n_steps += 1
        np.testing.assert_array_equal(renderer.linear_image(), before)
    assert n_steps > 4 and not renderer.prepare_frame(coming)
    renderer.set_frame(coming)
    assert renderer.frame is coming and renderer.memory_bytes == alone


@pytest.mark.parametrize("n_steps", [1, 4, 30])
def test_a_frame_that_another_overtakes_is_freed(renderer: PlacementRenderer, n_steps: int) -> None:
    renderer.set_frame(full_frame(4))
    alone, overtaken = renderer.memory_bytes, full_frame(50)
    for _ in range(n_steps):
        renderer.prepare_frame(overtaken)
    renderer.set_frame(full_frame(4))
    assert renderer.memory_bytes == alone
