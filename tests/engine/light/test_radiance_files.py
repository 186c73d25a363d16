"""Files that are broken, hostile or not images must end in one LoadError that names what is wrong."""

import os
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from engine.core.errors import LoadError
from engine.light.picture_bands import MAX_SIDE
from engine.light.radiance_files import read_radiance_image
from tests.engine.light.conftest import (
    HEIGHT,
    REC2020,
    SCANLINES,
    WIDTH,
    gradient,
    quarter_means,
    refusal,
    write_exr,
    write_rgb,
)


def patch(path: Path, attribute: bytes, offset: int, value: bytes) -> Path:
    """Overwrite bytes of a header attribute's value; `attribute` is its name, a 0, its type, a 0."""
    data = bytearray(path.read_bytes())
    place = data.index(attribute) + len(attribute) + 4 + offset
    data[place : place + len(value)] = value
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("compression", [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_exr_round_trip(tmp_path: Path, dtype: type, compression: object) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient().astype(dtype), compression=compression)
    np.testing.assert_array_equal(read_radiance_image(path), gradient())


def test_alpha_and_other_channels_are_ignored(tmp_path: Path) -> None:
    image = gradient().astype(np.float16)
    channels = {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}
    path = write_exr(tmp_path / "a.exr", channels | {"A": image[..., 0], "depth.Z": image[..., 1]})
    np.testing.assert_array_equal(read_radiance_image(path), gradient())


def test_tiled_mip_mapped_exr(shared_data: Path) -> None:
    # The finest level of the mip map is the image: 1024 x 512 (SOURCES.md).
    assert read_radiance_image(shared_data / "probes" / "OrientationLatLong.exr").shape == (512, 1024, 3)


@pytest.mark.parametrize("compression", [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_exr_cut_anywhere_is_refused(tmp_path: Path, compression: object, capfd: pytest.CaptureFixture[str]) -> None:
    whole = write_rgb(tmp_path / "a.exr", gradient(), compression=compression).read_bytes()
    cuts = [1, 4, 8, 100, 300, *range(340, len(whole), max(1, len(whole) // 40)), len(whole) - 1]
    for length in cuts:
        path = tmp_path / "cut.exr"
        path.write_bytes(whole[:length])
        refusal(path)
    # The library's own remarks never reach the terminal.
    assert capfd.readouterr() == ("", "")


def test_exr_whole_in_a_truncated_pair_of_parts(tmp_path: Path) -> None:
    planes = {name: np.ascontiguousarray(gradient()[..., i]) for i, name in enumerate("RGB")}
    parts = [
        OpenEXR.Part(SCANLINES | {"name": name}, channels, name)
        for name, channels in (("depth", {"Z": planes["R"]}), ("beauty", planes))
    ]
    path = tmp_path / "multi.exr"
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    np.testing.assert_array_equal(read_radiance_image(path), gradient())
    path.write_bytes(path.read_bytes()[:-500])
    assert "OpenEXR" in refusal(path)


@pytest.mark.parametrize("side", [60_000, 12_000, MAX_SIDE + 1, 2**31 - 1])
def test_exr_of_absurd_size_is_refused_by_its_header(tmp_path: Path, side: int) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        patch(path, window, 8, struct.pack("<2i", side - 1, side - 1))
    message = refusal(path)
    # Above the library's limit it is the library that refuses, below it the pixels that are not there.
    assert ("OpenEXR pixels" in message) == (side <= MAX_SIDE)


def test_exr_with_an_empty_window_is_refused(tmp_path: Path) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    refusal(patch(path, b"dataWindow\0box2i\0", 8, struct.pack("<2i", -5, -5)))


WINDOWS = {  # data from (x, y) on, and the display window
    "less": ((30, 10), (0, 0, 99, 49)),
    "overscan": ((-5, -3), (0, 0, 29, 14)),
    "across a corner": ((-10, 5), (0, 0, 39, 19)),
    "from elsewhere on": ((7, 9), (3, 4, 60, 40)),
}


def in_windows(path: Path, at: tuple[int, int], window: tuple[int, int, int, int]) -> Path:
    """The gradient from a place on, in a display window."""
    (x, y), (left, top, right, bottom) = at, window
    write_rgb(path, gradient())
    patch(path, b"dataWindow\0box2i\0", 0, struct.pack("<4i", x, y, x + WIDTH - 1, y + HEIGHT - 1))
    patch(path, b"displayWindow\0box2i\0", 0, struct.pack("<4i", left, top, right, bottom))
    data = bytearray(path.read_bytes())
    for place in chunk_places(bytes(data), -(-HEIGHT // 16)):  # blocks of 16 lines, numbered as in the data window
        (line,) = struct.unpack_from("<i", data, place)
        struct.pack_into("<i", data, place, line + y)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", WINDOWS)
def test_exr_data_stand_in_their_display_window(tmp_path: Path, name: str) -> None:
    (x, y), (left, top, right, bottom) = WINDOWS[name]
    path = in_windows(tmp_path / "a.exr", *WINDOWS[name])
    notes: list[str] = []
    image = read_radiance_image(path, notes)
    expected = np.zeros((bottom - top + 1, right - left + 1, 3), np.float32)
    for row in range(HEIGHT):
        for column in range(WIDTH):
            at = row + y - top, column + x - left
            if 0 <= at[0] < len(expected) and 0 <= at[1] < expected.shape[1]:
                expected[at] = gradient()[row, column]
    np.testing.assert_array_equal(image, expected)
    assert len(notes) == 1 and f"40 x 24 pixels of data from ({x - left}, {y - top}) on" in notes[0]


def chunk_places(data: bytes, n_chunks: int) -> list[int]:
    """Where the chunks of scan lines begin, by the table of them: it is followed by the first."""
    for start in range(len(data) - 8 * n_chunks):
        places = struct.unpack_from(f"<{n_chunks}Q", data, start)
        if places[0] == start + 8 * n_chunks:
            return list(places)
    raise AssertionError("no table of chunks")


TILES = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}


@pytest.mark.usefixtures("small_limit")
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("storage", [{}, TILES, {"compression": OpenEXR.PIZ_COMPRESSION}])
def test_a_large_exr_is_read_as_its_means(tmp_path: Path, dtype: type, storage: dict) -> None:
    path, notes = write_rgb(tmp_path / "a.exr", gradient().astype(dtype), **storage), []
    np.testing.assert_array_equal(read_radiance_image(path, notes), quarter_means(gradient()))
    assert notes == ["40 x 24 pixels, shown at 20 x 12"]
    by_bytes = path.rename(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.exr"))
    np.testing.assert_array_equal(read_radiance_image(by_bytes, most_pixels=240), quarter_means(gradient()))
    whole = path.parent.joinpath(by_bytes.name).read_bytes()
    for length in range(len(whole) // 2, len(whole) - 1, len(whole) // 9):
        path.write_bytes(whole[:length])
        refusal(path)


@pytest.mark.usefixtures("small_limit")
@pytest.mark.parametrize("name", WINDOWS)
def test_a_large_exr_stands_in_its_display_window(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = in_windows(tmp_path / "a.exr", *WINDOWS[name])
    with monkeypatch.context() as unlimited:
        unlimited.setattr("engine.light.picture_bands.MAX_PIXELS", 1 << 20)
        whole = read_radiance_image(path)
    height, width, k = *whole.shape[:2], 1
    while -(-height // k) * -(-width // k) > 256:
        k *= 2
    beyond = np.pad(whole, ((0, -whole.shape[0] % k), (0, -whole.shape[1] % k), (0, 0)), mode="edge")
    expected = sum(beyond[i::k, j::k] for i in range(k) for j in range(k)) / k**2
    np.testing.assert_allclose(read_radiance_image(path), expected, rtol=1e-6)


def test_exr_data_outside_their_display_window_are_shown_without_it(tmp_path: Path) -> None:
    path, notes = write_rgb(tmp_path / "a.exr", gradient()), []
    patch(path, b"displayWindow\0box2i\0", 0, struct.pack("<4i", 50, 0, 99, 23))
    np.testing.assert_array_equal(read_radiance_image(path, notes), gradient())
    assert notes == ["data from (0, 0) to (39, 23) outside the display window (50, 0) to (99, 23): shown without it"]


ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)


@pytest.mark.parametrize(
    ("primaries", "matrix"),
    [
        # [ITU-R BT.2087, annex 2]: no adaptation, the white is the same.
        (REC2020, [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]),
        # As the built-in configuration of OpenColorIO has it, by Bradford from the white of ACES.
        (ACES, [[2.52169, -1.13413, -0.38756], [-0.27648, 1.37272, -0.09624], [-0.01538, -0.15298, 1.16835]]),
    ],
)
def test_exr_of_other_primaries_is_converted(tmp_path: Path, primaries: tuple[float, ...], matrix: object) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient(), chromaticities=primaries)
    notes: list[str] = []
    found = read_radiance_image(path, notes)
    np.testing.assert_allclose(found, gradient() @ np.transpose(matrix), atol=1e-3)
    assert len(notes) == 1 and notes[0].endswith("converted to Rec. 709 (Bradford)")
    white = write_rgb(tmp_path / "white.exr", np.ones((2, 2, 3), np.float32), chromaticities=primaries)
    np.testing.assert_allclose(read_radiance_image(white), 1.0, atol=2e-6)  # white stays white
    np.testing.assert_array_equal(read_radiance_image(path, is_colour=False), gradient())


def test_exr_of_rec_709_stays_what_it_is_and_one_of_no_colours_too(tmp_path: Path) -> None:
    notes: list[str] = []
    same = write_rgb(tmp_path / "a.exr", gradient(), chromaticities=(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    np.testing.assert_array_equal(read_radiance_image(same, notes), gradient())
    assert notes == []
    for bad in ((0.0,) * 8, (0.3, 0.3) * 4, (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0), (float("nan"),) * 8):
        path = write_rgb(tmp_path / "b.exr", gradient(), chromaticities=bad)
        notes.clear()
        np.testing.assert_array_equal(read_radiance_image(path, notes), gradient())
        assert len(notes) == 1 and "no colours" in notes[0]
    data = path.read_bytes().replace(b"chromaticities\0chromaticities\0", b"chromaticities\0chromaticitiex\0")
    path.write_bytes(data)
    notes.clear()
    np.testing.assert_array_equal(read_radiance_image(path, notes), gradient())
    assert notes == ["chromaticities that are none, taken for Rec. 709's"]


def test_deep_exr_is_refused(tmp_path: Path) -> None:
    deep = np.empty((4, 8), object)
    for index in np.ndindex(4, 8):
        deep[index] = np.ones(2, np.float16)
    path = write_exr(
        tmp_path / "deep.exr",
        dict.fromkeys("RGB", deep),
        type=OpenEXR.deepscanline,
        compression=OpenEXR.ZIPS_COMPRESSION,
    )
    assert "OpenEXR storage = deepscanline" in refusal(path)


@pytest.mark.parametrize("compression", [77, 255])
def test_exr_with_unknown_compression_is_refused(tmp_path: Path, compression: int) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    message = refusal(patch(path, b"compression\0compression\0", 0, bytes([compression])))
    # The library itself would take it for ZIP without a word.
    assert f"OpenEXR compression = {compression}" in message


def test_exr_with_any_byte_of_its_header_flipped_is_read_or_refused(tmp_path: Path) -> None:
    whole = write_rgb(tmp_path / "a.exr", gradient(), compression=OpenEXR.NO_COMPRESSION).read_bytes()
    n_refused = 0
    for place in range(len(whole) - HEIGHT * WIDTH * 12 - HEIGHT * 16):
        data = bytearray(whole)
        data[place] ^= 0xFF
        path = tmp_path / "flipped.exr"
        path.write_bytes(data)
        try:
            image = read_radiance_image(path)
        except LoadError:
            n_refused += 1
        else:
            assert image.ndim == 3 and image.shape[2] == 3
    # Some of the header does not matter (pixel aspect, screen window) and may pass; but nothing else may be raised.
    assert n_refused > 150


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", b"PK\x03\x04", b"hello", bytes(100)])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(content)
    refusal(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "pipe.exr"
    os.mkfifo(path)
    assert "not a regular file" in refusal(path)


def test_folders_missing_files_and_impossible_names_are_refused(tmp_path: Path) -> None:
    assert "directory" in refusal(tmp_path).lower() or os.name == "nt"
    assert "No such file" in refusal(tmp_path / "nowhere.hdr")
    assert "null" in refusal(Path("nul\0byte.hdr"))
