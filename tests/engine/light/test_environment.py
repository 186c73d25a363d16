from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.errors import LoadError
from engine.light.environment import (
    LUMINANCE,
    Environment,
    constant_environment,
    downsample,
    load_environment,
    texel_solid_angles,
    tone_mapped_thumbnail,
    upsample_interpolated,
)
from tests.naive.sphere import directions_of_texels


def noise(height: int, width: int, seed: int = 2) -> Environment:
    return Environment(np.random.default_rng(seed).random((height, width, 3)), "noise")


def total_power(environment: Environment) -> np.ndarray:
    """The integral of L over the sphere, texel by texel."""
    height, width, _ = environment.radiance.shape
    return np.einsum("hwc,h->c", environment.radiance.astype(np.float64), texel_solid_angles(height, width))


def write_exr(path: Path, image: np.ndarray) -> Path:
    channels = {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))
    return path


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 9), (7, 1), (5, 3), (64, 128)])
def test_texels_tile_the_sphere(height: int, width: int) -> None:
    # Row by row, all texels together are 4 pi.
    assert texel_solid_angles(height, width).sum() * width == pytest.approx(4.0 * np.pi, rel=1e-14)


@pytest.mark.parametrize(("height", "width"), [(4, 8), (5, 7), (32, 64), (3, 12)])
def test_evaluate_at_texel_centres_is_the_texel(height: int, width: int) -> None:
    environment = noise(height, width)
    found = environment.evaluate(directions_of_texels(height, width).reshape(-1, 3))
    np.testing.assert_allclose(found, environment.radiance.reshape(-1, 3), rtol=0, atol=3e-6)


def test_frame_of_the_map() -> None:
    image = np.zeros((3, 4, 3), np.float32)
    # Columns of the middle row look along -Z turned by -135, -45, 45, 135 degrees towards +X.
    image[1] = np.arange(4)[:, None]
    image[0], image[2] = 10.0, 20.0
    environment = Environment(image, "frame")
    east, south = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    # -Z lies between columns 1 and 2, +X between 2 and 3, -X between 0 and 1, +Z on the seam between 3 and 0.
    directions = np.array([[0.0, 0.0, -1.0], east, [-1.0, 0.0, 0.0], south, [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(environment.evaluate(directions)[:, 0], [1.5, 2.5, 0.5, 1.5, 10.0, 20.0], atol=1e-6)


def test_rotation_turns_counter_clockwise_seen_from_above() -> None:
    image = np.zeros((9, 360, 3), np.float32)
    image[4, 179:181] = 1.0  # a lamp in the centre columns: at -Z
    lamp = Environment(image, "lamp")
    # From above, with -Z up on the page and +X to the right, counter-clockwise leads from -Z to -X.
    for rotation, direction in [
        (0, (0, 0, -1)),
        (90, (-1, 0, 0)),
        (180, (0, 0, 1)),
        (270, (1, 0, 0)),
        (-90, (1, 0, 0)),
    ]:
        assert lamp.evaluate(np.array([direction]), rotation)[0, 0] == pytest.approx(1.0, abs=1e-4)
        assert lamp.evaluate(-np.array([direction]), rotation)[0, 0] == 0.0


@settings(deadline=None)  # the first example may compile
@given(rotation=st.floats(-720.0, 720.0), seed=st.integers(0, 99))
def test_rotating_the_light_is_rotating_the_directions_back(rotation: float, seed: int) -> None:
    environment = noise(16, 32)
    directions = np.random.default_rng(seed).normal(size=(20, 3))
    r = np.radians(-rotation)
    back = np.array([[np.cos(r), 0.0, np.sin(r)], [0.0, 1.0, 0.0], [-np.sin(r), 0.0, np.cos(r)]])
    # radiance(d) = env(R_y(-r) d)
    np.testing.assert_allclose(
        environment.evaluate(directions, rotation), environment.evaluate(directions @ back.T), rtol=0, atol=1e-5
    )


def test_whole_turns_change_nothing() -> None:
    directions = np.random.default_rng(4).normal(size=(50, 3))
    environment = noise(8, 16)
    np.testing.assert_array_equal(environment.evaluate(directions, 360.0), environment.evaluate(directions))


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 5), (5, 1), (2, 2), (7, 3)])
def test_evaluate_stays_between_the_texels(height: int, width: int) -> None:
    environment = noise(height, width)
    directions = np.concatenate(
        [np.random.default_rng(1).normal(size=(500, 3)), np.eye(3), -np.eye(3), np.zeros((1, 3))]
    )
    found = environment.evaluate(directions)
    lowest, highest = environment.radiance.min(axis=(0, 1)), environment.radiance.max(axis=(0, 1))
    # A weighted mean of texels, poles, seam and the zero direction included.
    assert (found >= lowest - 1e-6).all() and (found <= highest + 1e-6).all()


def test_labelled_axes_of_the_openexr_project(shared_data: Path) -> None:
    # Its centre column looks along +Z with +X on the left: our map turned by half a turn, and no mirror.
    environment = load_environment(shared_data / "probes" / "OrientationLatLong.exr")
    axes = np.eye(3)
    for sign in (1.0, -1.0):
        for i in range(3):
            for j in {0, 1, 2} - {i}:
                third = axes[3 - i - j]
                across = [sign * axes[i] + 0.002 * k * third for k in range(-4, 5)]
                drawn = environment.evaluate(np.array([d + 0.15 * axes[j] for d in across]), 180.0)[:, 2]
                blank = environment.evaluate(np.array([d - 0.15 * axes[j] for d in across]), 180.0)[:, 2]
                # In blue, as the text is blue. Around each axis dark lines lead towards the two other positive
                # axes; on the opposite side there is only paper.
                assert drawn.min() < 0.4 < 0.5 < blank.min(), (sign, "XYZ"[i], "XYZ"[j])


def test_angular_map_against_the_latlong_of_the_same_place(shared_data: Path) -> None:
    probe = load_environment(shared_data / "probes" / "ennis_probe.hdr", "angular")
    latlong = load_environment(shared_data / "probes" / "ennis_latlong_256.hdr")
    assert probe.radiance.shape == (512, 1024, 3)
    reduced = np.maximum(downsample(probe, 128).radiance @ LUMINANCE, 1e-3)
    other = np.maximum(latlong.radiance @ LUMINANCE, 1e-3)

    def correlation(image: np.ndarray) -> float:
        return float(np.corrcoef(np.log(image).ravel(), np.log(other).ravel())[0, 1])

    # SOURCES.md: no yaw, no mirror, correlation of log luminance 0.985, median ratio 1.007.
    assert correlation(reduced) > 0.98
    assert np.median(reduced / other) == pytest.approx(1.0, abs=0.02)
    for wrong in (reduced[:, ::-1], reduced[::-1], np.roll(reduced, 64, axis=1), np.roll(reduced, 128, axis=1)):
        assert correlation(wrong) < 0.95  # the room is nearly symmetric: mirrored it still reaches 0.89


def test_second_angular_map_against_its_latlong(shared_data: Path) -> None:
    probe = load_environment(shared_data / "probes" / "grace_probe.hdr", "angular")
    stored = load_environment(shared_data / "probes" / "grace_latlong_pbrt2_vflipped.exr")
    # That file is upside down and 31.7 times darker (SOURCES.md).
    other = np.maximum(downsample(stored, 128).radiance[::-1] @ LUMINANCE, 1e-4)
    reduced = np.maximum(downsample(probe, 128).radiance @ LUMINANCE, 1e-4)
    assert np.median(reduced / other) == pytest.approx(31.7, rel=0.05)
    assert np.corrcoef(np.log(reduced).ravel(), np.log(other).ravel())[0, 1] > 0.96


def angular_directions(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions of an angular map's texels (N, N, 3), and which lie in its disc: radius = angle from -Z / pi."""
    place = (2.0 * np.arange(size) + 1.0) / size - 1.0
    x, y = np.meshgrid(place, -place)
    radius = np.hypot(x, y)
    angle = np.pi * radius
    sine = np.sin(angle) / np.where(radius > 0.0, radius, 1.0)
    return np.stack([sine * x, sine * y, -np.cos(angle)], axis=2), radius <= 1.0


@pytest.mark.parametrize("size", [199, 200])
def test_angular_map_of_a_known_field(tmp_path: Path, size: int) -> None:
    directions, inside = angular_directions(size)
    # L = 1 + 0.9 d, a field as smooth as can be; outside the disc rubbish that must not be read, not even as a fault.
    image = np.where(inside[..., None], 1.0 + 0.9 * directions, np.nan).astype(np.float32)
    environment = load_environment(write_exr(tmp_path / "a.exr", image), "angular")
    expected = 1.0 + 0.9 * directions_of_texels(*environment.radiance.shape[:2])
    # A texel covers 2 pi / 200 = 0.03 radians, so that taking the nearest one errs by half of it at most; the rim,
    # which is the single direction +Z, by one and a half.
    np.testing.assert_allclose(environment.radiance, expected, atol=0.05)
    assert np.abs(environment.radiance - expected).mean() < 0.006


def test_angular_map_keeps_the_light_of_a_small_sun(tmp_path: Path) -> None:
    size = 200
    directions, inside = angular_directions(size)
    image = np.zeros((size, size, 3), np.float32)
    row, column = 60, 150
    assert inside[row, column]
    image[row, column] = 1e4
    environment = load_environment(write_exr(tmp_path / "a.exr", image), "angular")
    theta = np.arccos(-directions[row, column, 2])
    # Solid angle of an angular map's texel: (2 pi / N)^2 sin(theta) / theta.
    expected = 1e4 * (2.0 * np.pi / size) ** 2 * np.sin(theta) / theta
    np.testing.assert_allclose(total_power(environment), expected, rtol=0.15)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_angular_maps(tmp_path: Path, size: int) -> None:
    image = np.full((size, size, 3), 2.0, np.float32)
    environment = load_environment(write_exr(tmp_path / "a.exr", image), "angular")
    np.testing.assert_allclose(environment.radiance, 2.0, rtol=1e-6)


def test_angular_maps_are_square(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="size = 6 x 4, expected a square angular map"):
        load_environment(write_exr(tmp_path / "a.exr", np.ones((4, 6, 3), np.float32)), "angular")


def test_unknown_mapping_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="mapping = octahedron"):
        load_environment(tmp_path / "a.exr", "octahedron")  # type: ignore[arg-type]


def test_negative_pixels_are_clamped_and_counted(tmp_path: Path) -> None:
    image = np.ones((4, 8, 3), np.float32)
    image[1, 2] = -5.0
    image[3, 7, 1] = -1e-6
    environment = load_environment(write_exr(tmp_path / "a.exr", image))
    assert environment.notes == ("2 of 32 pixels had negative values, set to 0",)
    expected = np.maximum(image, 0.0)
    np.testing.assert_array_equal(environment.radiance, expected)


def test_real_maps_with_ringing(shared_data: Path) -> None:
    environment = load_environment(shared_data / "probes" / "ph_studio.exr")
    # SOURCES.md counts 2028 negative values; several can share a pixel.
    assert len(environment.notes) == 1
    assert environment.radiance.min() == 0.0 and environment.radiance.max() == 3730.0


@pytest.mark.parametrize(("value", "kept"), [(np.nan, 0.0), (np.inf, 65504.0), (-np.inf, 0.0)])
def test_non_finite_pixels_are_replaced_and_said_with_their_place(tmp_path: Path, value: float, kept: float) -> None:
    image = np.ones((5, 9, 3), np.float32)
    image[2, 6, 1] = value
    image[4, 0, 0] = value
    environment = load_environment(write_exr(tmp_path / "a.exr", image))
    (note,) = environment.notes
    assert note.startswith(
        "2 pixels were not finite, the first in row 2, column 6, channel G: infinite ones set to 65504"
    )
    expected = np.where(np.isfinite(image), image, np.float32(kept))
    np.testing.assert_array_equal(environment.radiance, expected)


def test_an_infinite_sun_is_as_bright_as_the_brightest_there_is(tmp_path: Path) -> None:
    image = np.full((5, 9, 3), 3e5, np.float32)
    image[1, 1] = np.inf
    assert (load_environment(write_exr(tmp_path / "a.exr", image)).radiance == 3e5).all()


def test_environments_that_other_programs_write_open(shared_data: Path) -> None:
    for path in sorted((shared_data / "cases" / "35-exr-inf-nan").glob("*.exr")):
        environment = load_environment(path)
        assert len(environment.notes) == ("nan" in path.stem or "inf" in path.stem), path.name


def test_environments_are_frozen_and_copied() -> None:
    image = np.ones((2, 4, 3), np.float32)
    environment = Environment(image, "copy")
    image[:] = 5.0
    assert environment.radiance.max() == 1.0
    with pytest.raises(ValueError, match="read-only"):
        environment.radiance[0] = 2.0


def test_equal_environments_have_equal_digests() -> None:
    image = np.random.default_rng(3).random((4, 8, 3)).astype(np.float32)
    others = [image.reshape(8, 4, 3), np.nextafter(image, np.float32(2.0)), image[::-1]]
    assert Environment(image, "one").digest == Environment(image.copy(), "two").digest
    assert len({Environment(each, "one").digest for each in (image, *others)}) == 4


@pytest.mark.parametrize("bad", [np.ones((2, 4)), np.ones((2, 4, 4)), np.ones((0, 4, 3)), -np.ones((1, 1, 3))])
def test_environments_of_other_shapes_or_signs_are_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="radiance"):
        Environment(bad, "bad")


@pytest.mark.parametrize("bad", [np.ones(3), np.ones((2, 2)), np.full((1, 3), np.nan)])
def test_bad_directions_are_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="directions"):
        noise(2, 4).evaluate(bad)


def test_constant_environment() -> None:
    directions = np.random.default_rng(0).normal(size=(10, 3))
    np.testing.assert_array_equal(constant_environment(0.5).evaluate(directions, 40.0), np.full((10, 3), 0.5))
    coloured = constant_environment([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(coloured.evaluate(directions), np.tile(np.float32([1, 2, 3]), (10, 1)))
    # L over the whole sphere: 4 pi L.
    np.testing.assert_allclose(total_power(coloured), 4.0 * np.pi * np.array([1.0, 2.0, 3.0]), rtol=1e-13)
    for bad in (-1.0, np.nan, [1.0, np.inf, 1.0]):
        with pytest.raises(ValueError, match="radiance"):
            constant_environment(bad)


@pytest.mark.parametrize(("height", "width"), [(64, 128), (63, 127), (100, 30), (200, 401)])
@pytest.mark.parametrize("rows", [1, 2, 7, 32, 50])
def test_downsampling_keeps_the_light(height: int, width: int, rows: int) -> None:
    environment = noise(height, width)
    small = downsample(environment, rows)
    assert small.radiance.shape == (rows, max(1, round(width * rows / height)), 3)
    # An average over solid angle: the integral over the sphere stays, to float32.
    np.testing.assert_allclose(total_power(small), total_power(environment), rtol=3e-7)


def test_downsampling_halves_are_plain_means() -> None:
    environment = noise(8, 16)
    small = downsample(environment, 4).radiance
    weight = texel_solid_angles(8, 16)[:, None, None]
    blocks = (environment.radiance * weight).reshape(4, 2, 8, 2, 3).sum(axis=(1, 3))
    np.testing.assert_allclose(small, blocks / (2.0 * weight.reshape(4, 2, 1, 1).sum(axis=1)), rtol=1e-6)


def test_downsampling_keeps_a_lone_sun_and_black() -> None:
    image = np.zeros((90, 180, 3), np.float32)
    image[0, 179] = 1e5
    sun = Environment(image, "sun")
    small = downsample(sun, 13)
    np.testing.assert_allclose(total_power(small), total_power(sun), rtol=1e-6)
    # Its light stays in the one texel it lies in; all else is exactly black.
    assert np.count_nonzero(small.radiance) == 3
    assert small.radiance[0, -1].min() > 0.0


def test_downsampling_to_no_less_returns_the_same() -> None:
    environment = noise(8, 16)
    assert downsample(environment, 8) is environment
    assert downsample(environment, 99) is environment
    with pytest.raises(ValueError, match="height = 0"):
        downsample(environment, 0)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_thumbnail_does_not_depend_on_the_unit_of_radiance(scale: float) -> None:
    base = noise(32, 64)
    thumbnail = tone_mapped_thumbnail(Environment(base.radiance * np.float32(scale), "scaled"), 24)
    assert thumbnail.shape == (12, 24, 3) and thumbnail.dtype == np.uint8
    np.testing.assert_allclose(thumbnail.astype(int), tone_mapped_thumbnail(base, 24).astype(int), atol=1)


def test_thumbnail_of_grey_and_black() -> None:
    # A grey sky is exposed to 0.18, which Reinhard's curve maps to 0.18 (1 + 0.18/16) / 1.18 = 0.154,
    # which is 109 in sRGB.
    assert np.unique(tone_mapped_thumbnail(constant_environment(7.0), 16)).tolist() == [109]
    assert tone_mapped_thumbnail(constant_environment(0.0), 16).max() == 0
    assert tone_mapped_thumbnail(constant_environment(1.0), 1).shape == (1, 1, 3)
    with pytest.raises(ValueError, match="width = 0"):
        tone_mapped_thumbnail(constant_environment(1.0), 0)


def test_thumbnail_shows_the_zenith_on_top() -> None:
    image = np.zeros((20, 40, 3), np.float32)
    image[:10, :, 2] = 1.0
    thumbnail = tone_mapped_thumbnail(Environment(image, "blue sky"), 8)
    assert thumbnail[0, 0, 2] > 100 and thumbnail[-1].max() == 0


def test_interpolated_is_what_is_shown_and_keeps_the_light() -> None:
    image = np.random.default_rng(5).uniform(0.0, 1.0, (16, 32, 3)).astype(np.float32) ** 4
    environment = Environment(image, "test")
    finer = upsample_interpolated(environment)
    assert finer.radiance.shape == (64, 128, 3)
    light = [np.einsum("hwc,h->c", e.radiance, texel_solid_angles(*e.radiance.shape[:2])) for e in (environment, finer)]
    np.testing.assert_allclose(*light, rtol=1e-4)
    theta, phi = np.pi * (np.arange(64) + 0.5) / 64, 2.0 * np.pi * ((np.arange(128) + 0.5) / 128 - 0.5)
    theta, phi = (axis.ravel() for axis in np.meshgrid(theta, phi, indexing="ij"))
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=1)
    np.testing.assert_allclose(finer.radiance.reshape(-1, 3), environment.evaluate(d), rtol=0.02, atol=1e-3)
    assert upsample_interpolated(constant_environment(2.0)).radiance == pytest.approx(2.0)
    many = Environment(np.ones((1024, 2, 3), np.float32), "test")
    assert upsample_interpolated(many) is many
