"""Radiance pictures: every order and packing of pixels is read, and what is broken is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from engine.light.radiance_files import read_radiance_image
from tests.engine.light.conftest import REC2020, gradient, quarter_means, refusal, write_rgb


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
