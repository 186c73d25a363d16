"""Files that are broken, hostile or not images must end in one LoadError that names what is wrong."""

import os
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from engine.core.errors import LoadError, plain_line
from engine.light.picture_bands import MAX_SIDE
from engine.light.radiance_files import read_radiance_image

HEIGHT, WIDTH = 24, 40
SCANLINES = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}


def gradient(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """An image whose every value is a different power-of-two fraction, exact in half and in RGBE's shared exponent."""
    rows, columns, channels = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    return ((1 + (7 * rows + 3 * columns + 5 * channels) % 120 + 128) / 64.0).astype(np.float32)


def write_exr(path: Path, channels: dict[str, np.ndarray], **header: object) -> Path:
    with OpenEXR.File(SCANLINES | header, channels) as file:
        file.write(str(path))
    return path


def write_rgb(path: Path, image: np.ndarray, **header: object) -> Path:
    return write_exr(path, {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}, **header)


def patch(path: Path, attribute: bytes, offset: int, value: bytes) -> Path:
    """Overwrite bytes of a header attribute's value; `attribute` is its name, a 0, its type, a 0."""
    data = bytearray(path.read_bytes())
    place = data.index(attribute) + len(attribute) + 4 + offset
    data[place : place + len(value)] = value
    path.write_bytes(data)
    return path


def rgbe(image: np.ndarray) -> np.ndarray:
    """(H, W, 4) uint8, exact for `gradient`: 8 bits of mantissa under the largest channel's exponent."""
    _, exponent = np.frexp(image.max(axis=2))
    mantissa = np.ldexp(image, (8 - exponent)[..., None])
    quads = np.concatenate([mantissa, (exponent + 128)[..., None]], axis=2).astype(np.uint8)
    return np.where(image.max(axis=2, keepdims=True) > 0.0, quads, 0).astype(np.uint8)


def flat_scanlines(quads: np.ndarray) -> bytes:
    return quads.tobytes()


def packed_scanlines(quads: np.ndarray) -> bytes:
    """New run-length scanlines, runs where three or more bytes agree."""
    out = bytearray()
    for row in quads:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for channel in row.T.tolist():
            i = 0
            while i < len(channel):
                run = 1
                while i + run < len(channel) and run < 127 and channel[i + run] == channel[i]:
                    run += 1
                out += bytes([128 + run, channel[i]]) if run > 2 else bytes([1, channel[i]])
                i += run if run > 2 else 1
    return bytes(out)


def write_hdr(path: Path, pixels: bytes, size: bytes = b"-Y 24 +X 40", header: bytes = b"") -> Path:
    path.write_bytes(b"#?RADIANCE\n" + header + b"FORMAT=32-bit_rle_rgbe\n\n" + size + b"\n" + pixels)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(LoadError) as caught:
        read_radiance_image(path)
    message = str(caught.value)
    assert plain_line(str(path)) in message and message.endswith("nothing was changed")
    return message


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


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Images of more than 256 pixels are too large, and bands are a few rows."""
    for module in ("radiance_files", "picture_bands"):
        monkeypatch.setattr(f"engine.light.{module}.MAX_PIXELS", 256)
    monkeypatch.setattr("engine.light.picture_bands.BAND_PIXELS", 256)


def quarter_means(image: np.ndarray) -> np.ndarray:
    """Of each 2 x 2 pixels; of 48 x 40 these are fewer than 512."""
    return (image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]) / 4.0


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


REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
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


@pytest.mark.parametrize("encode", [flat_scanlines, packed_scanlines])
def test_hdr_round_trip(tmp_path: Path, encode: object) -> None:
    image = gradient()
    image[3, 5] = 0.0
    path = write_hdr(tmp_path / "a.hdr", encode(rgbe(image)), header=b"# a comment\nEXPOSURE=0\n")
    np.testing.assert_array_equal(read_radiance_image(path), image)


@pytest.mark.usefixtures("small_limit")
@pytest.mark.parametrize("encode", [flat_scanlines, packed_scanlines])
@pytest.mark.parametrize("size", [b"-Y 24 +X 40", b"+Y 24 -X 40"])
def test_a_large_hdr_is_read_as_its_means(tmp_path: Path, encode: object, size: bytes) -> None:
    path, notes = write_hdr(tmp_path / "a.hdr", encode(rgbe(gradient())), size), []
    expected = quarter_means(gradient())
    if size.startswith(b"+"):
        expected = expected[::-1, ::-1]
    np.testing.assert_array_equal(read_radiance_image(path, notes), expected)
    assert notes == ["40 x 24 pixels, shown at 20 x 12"]
    path.write_bytes(path.read_bytes()[:-1])
    assert "scanline 23 of 24" in refusal(path)


@pytest.mark.usefixtures("small_limit")
def test_a_repeat_at_the_start_of_a_band_means_the_scanline_before(tmp_path: Path) -> None:
    rows = [bytes([i, 20, 30, 136] * 63 + [40 + i, 50, 60, 136]) for i in range(8)]  # rows of 64, bands of 4
    rows[4] = bytes([1, 1, 1, 64])
    image = read_radiance_image(write_hdr(tmp_path / "a.hdr", b"".join(rows), b"-Y 8 +X 64"))
    np.testing.assert_array_equal(image[2, :, 0], [(43 + 5) / 2] * 31 + [(43 + 43 + 5 + 45) / 4])


def test_hdr_extremes_of_the_exponent(tmp_path: Path) -> None:
    quads = np.zeros((1, 4, 4), np.uint8)
    quads[0] = [[128, 64, 1, 255], [128, 64, 1, 1], [200, 200, 200, 0], [1, 2, 3, 136]]
    path = write_hdr(tmp_path / "a.hdr", quads.tobytes(), b"-Y 1 +X 4")
    # 128 * 2^(255 - 136) = 2^126; 128 * 2^(1 - 136) = 2^-128, subnormal; exponent 0 is black; 2^0 leaves 1, 2, 3.
    np.testing.assert_array_equal(
        read_radiance_image(path)[0],
        np.float32([[2.0**126, 2.0**125, 2.0**119], [2.0**-128, 2.0**-129, 2.0**-135], [0, 0, 0], [1, 2, 3]]),
    )


def test_hdr_old_repeats(tmp_path: Path) -> None:
    pixel, other = bytes([10, 20, 30, 136]), bytes([40, 50, 60, 136])
    # 1 + 3 times the first pixel, then 1 + (4 + 256 * 1) times the other: two repeats in a row count by bytes.
    data = pixel + bytes([1, 1, 1, 3]) + other + bytes([1, 1, 1, 4]) + bytes([1, 1, 1, 1])
    image = read_radiance_image(write_hdr(tmp_path / "a.hdr", data, b"-Y 1 +X 265"))
    np.testing.assert_array_equal(image[0, :4], [[10, 20, 30]] * 4)
    np.testing.assert_array_equal(image[0, 4:], [[40, 50, 60]] * 261)


def test_hdr_cut_anywhere_is_refused(tmp_path: Path) -> None:
    whole = write_hdr(tmp_path / "a.hdr", packed_scanlines(rgbe(gradient()))).read_bytes()
    path = tmp_path / "cut.hdr"
    for length in [*range(1, 60), *range(60, len(whole), 97), len(whole) - 1]:
        path.write_bytes(whole[:length])
        refusal(path)


@pytest.mark.parametrize(
    ("pixels", "what"),
    [
        (bytes([2, 2, 0, 40, 128 + 41, 7]), "leaves its scanline"),  # a run of 41 in a line of 40
        (bytes([2, 2, 0, 40, 41]) + bytes(41), "leaves its scanline"),  # 41 single bytes
        (bytes([2, 2, 0, 40, 0, 7]), "leaves its scanline"),  # a count of 0 never ends
        (bytes([2, 2, 0, 41, 128 + 40, 7]), "another width"),
        (bytes([1, 1, 1, 5]), "nothing to repeat"),
        (bytes([9, 9, 9, 136, 1, 1, 1, 255]), "leaves its scanline"),
    ],
)
def test_hdr_with_bad_runs_is_refused(tmp_path: Path, pixels: bytes, what: str) -> None:
    message = refusal(write_hdr(tmp_path / "a.hdr", pixels + bytes(10_000)))
    assert "scanline 0 of 24" in message and what in message


@pytest.mark.parametrize(
    "size",
    [
        b"",
        b"24 40",
        b"-Y 24",
        b"+X 40 -X 24",
        b"-Y 40 +Y 24",
        b"-Y -24 +X 40",
        b"-Y 24 +X 1e3",
        b"-Y 24 +X 40 5",
        b"-Y 99999999999 +X 1",
    ],
)
def test_hdr_with_a_bad_size_line_is_refused(tmp_path: Path, size: bytes) -> None:
    assert "size line" in refusal(write_hdr(tmp_path / "a.hdr", bytes(5000), size))


@pytest.mark.parametrize("size", [b"-Y 60000 +X 60000", b"-Y 16385 +X 12000", b"-Y 0 +X 40", b"-Y 24 +X 0"])
def test_hdr_of_absurd_size_is_refused_by_its_header(tmp_path: Path, size: bytes) -> None:
    assert "image size" in refusal(write_hdr(tmp_path / "a.hdr", bytes(5000), size))


@pytest.mark.parametrize("encode", [flat_scanlines, packed_scanlines])
@pytest.mark.parametrize("size", [f"{a}{b}" for a in ("-Y 24 ", "+Y 24 ") for b in ("+X 40", "-X 40")])
@pytest.mark.parametrize("by_columns", [False, True])
def test_hdr_in_each_order_of_pixels(tmp_path: Path, encode: object, size: str, by_columns: bool) -> None:
    """+Y begins at the bottom, -X at the right; where X comes first, scanlines are columns."""
    quads = rgbe(gradient())
    quads = quads[:: -1 if "+Y" in size else 1, :: -1 if "-X" in size else 1]
    if by_columns:
        first, second = size[:5], size[6:]
        size, quads = f"{second} {first}", quads.swapaxes(0, 1)
    notes: list[str] = []
    path = write_hdr(tmp_path / "a.hdr", encode(np.ascontiguousarray(quads)), size.encode())
    np.testing.assert_array_equal(read_radiance_image(path, notes), gradient())
    assert notes == []


def test_hdr_with_carriage_returns_or_without_its_first_line(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    head = b"#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y 24 +X 40\r\n"
    for start in (head, head.replace(b"\r", b""), head[12:].replace(b"\r", b"")):
        path.write_bytes(start + packed_scanlines(rgbe(gradient())))
        np.testing.assert_array_equal(read_radiance_image(path), gradient())


def test_hdr_exposures_are_taken_off(tmp_path: Path) -> None:
    """Numbers are radiance times all exposures and corrections of the header [Ward91]."""
    header = b"EXPOSURE=4\nEXPOSURE= 0.5\nCOLORCORR=1 2 4\nGAMMA=1\nEXPOSURE=nan\nEXPOSURE=x\n"
    path, notes = write_hdr(tmp_path / "a.hdr", packed_scanlines(rgbe(gradient())), header=header), []
    np.testing.assert_array_equal(read_radiance_image(path, notes), gradient() / np.float32([2, 4, 8]))
    assert notes == ["exposure of the header taken off: radiance times 0.5 0.25 0.125"]


def test_hdr_of_xyz_and_of_other_primaries(tmp_path: Path) -> None:
    # Of D65 with Y = 1 (x 0.3127, y 0.3290): white. Mantissas of 8 bits: to 1 %.
    white = np.array([0.9505, 1.0, 1.0891], np.float32)
    path, notes = tmp_path / "a.hdr", []
    quads = rgbe(np.broadcast_to(white, (2, 9, 3)))
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 2 +X 9\n" + quads.tobytes())
    np.testing.assert_allclose(read_radiance_image(path, notes), 1.0, atol=0.02)
    assert notes == ["CIE XYZ, converted to Rec. 709"]
    said = "PRIMARIES=" + " ".join(map(str, REC2020)) + "\n"
    path = write_hdr(tmp_path / "b.hdr", packed_scanlines(rgbe(gradient())), header=said.encode())
    exr = write_rgb(tmp_path / "b.exr", gradient(), chromaticities=REC2020)
    np.testing.assert_allclose(read_radiance_image(path), read_radiance_image(exr), atol=1e-5)
    unknown = tmp_path / "c.hdr"
    unknown.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_yuv\n\n-Y 1 +X 1\n" + bytes(4))
    assert "FORMAT = 32-bit_rle_yuv" in refusal(unknown)


def test_variants_of_one_picture_are_one_picture(shared_data: Path) -> None:
    folder = shared_data / "cases" / "38-hdr-variants"
    normal = read_radiance_image(folder / "normal.hdr")
    paths = sorted(folder.glob("*.hdr"))
    assert len(paths) == 12
    for path in paths:
        # The one of XYZ has 8 bits of these, cut off, of which differences make RGB.
        tolerance = 0.02 * normal.max() if path.stem == "xyze" else 0.0
        assert np.abs(read_radiance_image(path) - normal).max() <= tolerance, path.name


def test_hdr_header_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(b"#?RADIANCE\n" + b"A=1\n" * 100_000)
    assert "Radiance header" in refusal(path)


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
