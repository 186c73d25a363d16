"""MERL files: what is read, what is refused and in which words, and the grid they are samples of."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.measured.coordinates import SHAPE, directions_at, grid_directions, half_and_difference, node_angles
from engine.measured.merl import N_BYTES, merl_bytes, merl_samples, read_merl
from tests.naive.measured import analytic_samples

HEADER = struct.pack("<3i", *SHAPE)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", "size = 0 bytes, expected 34992012 bytes"),
        (HEADER, "size = 12 bytes, expected 34992012 bytes"),
        (HEADER + bytes(N_BYTES - 13), "size = 34992011 bytes, expected 34992012 bytes"),
        (HEADER + bytes(N_BYTES - 11), "size = 34992013 bytes, expected at most 34992012 bytes"),
        (struct.pack("<3i", 90, 90, 360) + bytes(N_BYTES - 12), "dimensions = 90 x 90 x 360, expected 90 x 90 x 180"),
        (struct.pack("<3i", 90, -90, 180) + bytes(N_BYTES - 12), "dimensions = 90 x -90 x 180, expected 90 x 90 x 180"),
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
    data = bytearray(HEADER + bytes(N_BYTES - 12))
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
