"""MERL's and Cornell's files: what is read, how errors are reported, colours, and factors of few samples."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.core.generators import run_to_end
from engine.measured.measurement import (
    SHAPE,
    Measurement,
    above_horizon,
    directions_at,
    evaluate_table,
    grid_directions,
    half_and_difference,
    node_angles,
)
from engine.measured.sample_files import (
    N_MERL_BYTES,
    merl_bytes,
    merl_samples,
    read_cornell,
    read_merl,
    rgb_weights,
    scattered_samples,
)
from engine.measured.tables import read_measurement, table_of
from tests.naive.measured import analytic_samples

HEADER = struct.pack("<3i", *SHAPE)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", "size = 0 bytes, expected 34992012 bytes"),
        (HEADER, "size = 12 bytes, expected 34992012 bytes"),
        (HEADER + bytes(N_MERL_BYTES - 13), "size = 34992011 bytes, expected 34992012 bytes"),
        (HEADER + bytes(N_MERL_BYTES - 11), "size = 34992013 bytes, expected at most 34992012 bytes"),
        (
            struct.pack("<3i", 90, 90, 360) + bytes(N_MERL_BYTES - 12),
            "dimensions = 90 x 90 x 360, expected 90 x 90 x 180",
        ),
        (
            struct.pack("<3i", 90, -90, 180) + bytes(N_MERL_BYTES - 12),
            "dimensions = 90 x -90 x 180, expected 90 x 90 x 180",
        ),
    ],
)
def test_files_of_another_shape_are_refused(tmp_path: Path, data: bytes, found: str) -> None:
    path = tmp_path / "x.binary"
    path.write_bytes(data)
    with pytest.raises(LoadError, match=f"^{path}: {found}.*; nothing was changed$"):
        read_merl(path)


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.binary")
    with pytest.raises(LoadError, match="a named pipe, expected a regular file"):
        read_merl(tmp_path / "x.binary")


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_what_is_no_number_is_named(value: float) -> None:
    # Green, sample (3, 4, 5): plane 1, index 5 + 180 (4 + 90 * 3).
    data = bytearray(HEADER + bytes(N_MERL_BYTES - 12))
    struct.pack_into("<d", data, 12 + 8 * (90 * 90 * 180 + 5 + 180 * (4 + 90 * 3)), value)
    with pytest.raises(LoadError, match=r"green at theta_h 3, theta_d 4, phi_d 5 = .*, expected a finite number"):
        merl_samples(bytes(data), Path("x.binary"))


def test_written_and_read_again(tmp_path: Path) -> None:
    # To single precision; -1 stands for what is missing, and comes back as negative.
    samples = analytic_samples(gaps=0.1)
    path = tmp_path / "x.binary"
    path.write_bytes(merl_bytes(samples))
    found = merl_samples(read_merl(path), path)
    np.testing.assert_array_equal(found < 0.0, samples < 0.0)
    np.testing.assert_allclose(found[found > 0], samples[found > 0], rtol=1e-6)
    # Blue at (1, 2, 3) stands in the third plane, times 1500 / 1.66.
    raw = np.fromfile(path, "<f8", offset=12).reshape(3, *SHAPE)
    assert raw[2, 1, 2, 3] == pytest.approx(samples[1, 2, 3, 2] * 1500 / 1.66)


def test_grid_points_are_where_the_format_says() -> None:
    # theta_h = 90 (i / 90)^2 degrees, theta_d = j, phi_d = k degrees, wherever the half vector points.
    wi, wo = grid_directions()
    i, j, k = (np.random.default_rng(1).integers(1, n, 500) for n in SHAPE)
    theta_h, theta_d, phi_d = half_and_difference(wi[i, j, k], wo[i, j, k])
    np.testing.assert_allclose(np.degrees(theta_h), 90 * (i / 90) ** 2, rtol=1e-9)
    np.testing.assert_allclose(np.degrees(theta_d), j, rtol=1e-9)
    np.testing.assert_allclose(np.degrees(phi_d), k, atol=1e-7)
    assert node_angles(True)[45] == pytest.approx(np.radians(22.5))


def test_angles_do_not_know_the_azimuth_nor_who_is_who() -> None:
    random = np.random.default_rng(2)
    wi, wo = directions_at(*(random.random(200) * n for n in (1.5, 1.5, np.pi)))
    turn = 1.234
    about = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    expected = half_and_difference(wi, wo)
    for found in (half_and_difference(wi @ about.T, wo @ about.T), half_and_difference(wo, wi)):
        for one, two in zip(found, expected, strict=True):
            apart = np.abs(one - two)
            assert np.minimum(apart, np.pi - apart).max() < 1e-7


WAVELENGTHS = np.arange(400.0, 701.0, 20.0)


def gloss(theta_h: np.ndarray, theta_d: np.ndarray) -> np.ndarray:
    return 0.05 + 4.0 * np.exp(-25.0 * np.tan(theta_h) ** 2) * (0.1 + 0.9 * np.sin(theta_d) ** 4)


def written(path: Path, values: np.ndarray, angles: np.ndarray, wavelengths: np.ndarray = WAVELENGTHS) -> Path:
    """A file of samples at (theta_i, phi_i, theta_o, phi_o) (N, 4) with values (N,), the same at all wavelengths."""
    numbers = [f"# paint\n{len(wavelengths)}\n", " ".join(f"{w:g}" for w in wavelengths), "\n\n"]
    for place, value in zip(angles, values, strict=True):
        numbers.append(" ".join(f"{x:.6f}" for x in [*place, *np.full(len(wavelengths), value)]) + "\n")
    path.write_text("".join(numbers))
    return path


def some_samples(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Values (N,) of the gloss, and angles (N, 4) above the horizon."""
    random = np.random.default_rng(1)
    theta_h = np.radians(80.0 * random.random(4 * count) ** 2)
    theta_d, phi_d = random.random((2, 4 * count)) * [[np.radians(80.0)], [np.pi]]
    wi, wo = directions_at(theta_h, theta_d, phi_d)
    up = np.flatnonzero((wi[:, 2] > 0.1) & (wo[:, 2] > 0.1))[:count]
    polar = [(np.arccos(v[up, 2]), np.arctan2(v[up, 1], v[up, 0])) for v in (wi, wo)]
    return gloss(theta_h[up], theta_d[up]), np.stack([*polar[0], *polar[1]], axis=1)


def test_an_even_spectrum_is_white() -> None:
    # Under the illuminant of the colour space; whatever wavelengths it is given at.
    for wavelengths in (WAVELENGTHS, np.arange(380.0, 781.0, 5.0)):
        assert rgb_weights(wavelengths).sum(axis=0) == pytest.approx([1.0, 1.0, 1.0], rel=1e-12)


def test_colours_of_bands() -> None:
    # Bands at 450, 540 and 620 nm are blue, green and red; luminance is the observer's, 555 nm being the brightest.
    weights = rgb_weights(np.arange(400.0, 701.0, 10.0))
    assert [int(np.argmax(weights[i])) for i in (5, 14, 22)] == [2, 1, 0]
    assert 400 + 10 * int(np.argmax(weights @ [0.2126, 0.7152, 0.0722])) in (550, 560)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "number of wavelengths = nothing"),
        ("# only a comment\n", "number of wavelengths = nothing"),
        ("31\n400 410\n", "number of wavelengths = 31, expected 3 to 1000, and as many"),
        ("3\n700 500 400\n", "wavelengths = 700 to 400 nm, expected ascending"),
        ("3\n400 550 700\n0.1 0 0.2 0 1 1\n", "samples = 0.86, expected 50 whole ones"),
        ("3\n400 550 700\n0.1 0 0.2 x 1 1 1\n", "line 3 = 0.1 0 0.2 x 1 1 1, expected numbers"),
        ("3\n400 550 700\n0.1 0 0.2 0 1 nan 1\n", "line 3 = nan, expected finite numbers"),
        ("3\n400 550 700\n" + 60 * "2 0 0.2 0 1 1 1\n", "samples above the horizon = 0, expected 50"),
    ],
)
def test_refusals(tmp_path: Path, text: str, found: str) -> None:
    path = tmp_path / "x.brdf"
    path.write_text(text)
    with pytest.raises(LoadError, match=f"^{path}: {found}.*; nothing was changed$"):
        scattered_samples(read_cornell(path), path)


def test_few_samples_tell_of_all(tmp_path: Path) -> None:
    # 1,500 samples of a gloss that is a product: the factors alone are near, the table nearer, between samples too.
    path = written(tmp_path / "gloss.brdf", *some_samples(1500))
    measurement = run_to_end(read_measurement(path))
    report = measurement.report
    assert report is not None and report.error < 0.1 and report.n_below == 0
    assert 0 < report.n_missing < 0.8 * above_horizon().sum()
    assert measurement.strength("diffuse") == pytest.approx([0.05] * 3, rel=0.1)
    random = np.random.default_rng(2)
    theta_h, theta_d, phi_d = random.random((3, 2000)) * [[0.5], [1.2], [np.pi]]
    wi, wo = directions_at(theta_h, theta_d, phi_d)
    up = (wi[:, 2] > 0.15) & (wo[:, 2] > 0.15)
    found = evaluate_table(table_of(measurement.number).samples, wi[up], wo[up])
    apart = np.log(found / gloss(theta_h, theta_d)[up, None])
    assert np.sqrt((apart**2).mean()) < 0.12


def test_a_measured_paint(shared_data: Path) -> None:
    # A blue enamel: factors within a factor of 1.5, the table within 11 % of the samples.
    path = shared_data / "brdf" / "cornell" / "krylon_blue.brdf"
    measurement: Measurement = run_to_end(read_measurement(path))
    assert int(np.argmax(measurement.strength("diffuse"))) == 2 and measurement.report is not None
    assert measurement.report.error < 0.4
    samples = scattered_samples(read_cornell(path), path)
    found = evaluate_table(table_of(measurement.number).samples, samples.wi, samples.wo)
    apart = np.log((found + 1e-3) / (samples.values + 1e-3))
    assert np.sqrt((apart**2).mean()) < 0.11
