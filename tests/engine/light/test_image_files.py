"""Files that are broken, hostile or not images must end in one LoadError that names what is wrong."""

import os
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from engine.errors import LoadError, plain_line
from engine.light.image_files import MAX_SIDE, read_radiance_image

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
    channels = {name: gradient()[..., 0] for name in "RGB"}
    parts = [OpenEXR.Part(SCANLINES | {"name": name}, channels, name) for name in ("left", "right")]
    path = tmp_path / "multi.exr"
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    assert "number of OpenEXR parts = 2, expected 1" in refusal(path)
    path.write_bytes(path.read_bytes()[:-500])
    refusal(path)


@pytest.mark.parametrize("side", [60_000, 12_000, MAX_SIDE + 1, 2**31 - 1])
def test_exr_of_absurd_size_is_refused_by_its_header(tmp_path: Path, side: int) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        patch(path, window, 8, struct.pack("<2i", side - 1, side - 1))
    message = refusal(path)
    # Above the library's limit it is the library that refuses, below it the number of pixels.
    assert (f"image size = {side} x {side}" in message) == (side <= MAX_SIDE)


def test_exr_with_an_empty_window_is_refused(tmp_path: Path) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    refusal(patch(path, b"dataWindow\0box2i\0", 8, struct.pack("<2i", -5, -5)))


def test_exr_with_less_data_than_picture_is_refused(tmp_path: Path) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    patch(path, b"displayWindow\0box2i\0", 8, struct.pack("<2i", 99, 49))
    assert "data window = 40 x 24, expected the display window, 100 x 50" in refusal(path)


@pytest.mark.parametrize("names", ["Y", "RG", "GB", "XYZ"])
def test_exr_without_all_of_rgb_is_refused(tmp_path: Path, names: str) -> None:
    path = write_exr(tmp_path / "a.exr", {name: gradient()[..., 0] for name in names})
    assert f"channels = {', '.join(sorted(names))}, expected R, G and B" in refusal(path)


def test_exr_of_mixed_or_integer_types_is_refused(tmp_path: Path) -> None:
    plane = gradient()[..., 0]
    mixed = write_exr(tmp_path / "mixed.exr", {"R": plane, "G": plane.astype(np.float16), "B": plane})
    assert "types of channels R, G, B = float32, float16, float32" in refusal(mixed)
    integer = write_exr(tmp_path / "uint.exr", {name: plane.astype(np.uint32) for name in "RGB"})
    assert "uint32" in refusal(integer)


def test_exr_with_subsampled_channels_is_refused(tmp_path: Path) -> None:
    path = write_rgb(tmp_path / "a.exr", gradient())
    # In the channel list B comes first: name, type (4 bytes), linear and reserved (4), then the two samplings.
    refusal(patch(path, b"channels\0chlist\0", 2 + 8, struct.pack("<2i", 2, 2)))


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


def test_exr_cube_map_is_refused(tmp_path: Path) -> None:
    path = write_rgb(tmp_path / "cube.exr", gradient(), envmap=OpenEXR.ENVMAP_CUBE)
    assert "envmap = cube" in refusal(path)


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
    path = write_hdr(tmp_path / "a.hdr", encode(rgbe(image)), header=b"# a comment\nEXPOSURE=2.0\n")
    np.testing.assert_array_equal(read_radiance_image(path), image)


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
        b"+X 40 -Y 24",
        b"-Y -24 +X 40",
        b"-Y 24 +X 1e3",
        b"-Y 24 +X 40 5",
        b"-Y 99999999999 +X 1",
    ],
)
def test_hdr_with_a_bad_size_line_is_refused(tmp_path: Path, size: bytes) -> None:
    assert "size line" in refusal(write_hdr(tmp_path / "a.hdr", bytes(5000), size))


@pytest.mark.parametrize("size", [b"-Y 60000 +X 60000", b"-Y 12000 +X 12000", b"-Y 0 +X 40", b"-Y 24 +X 0"])
def test_hdr_of_absurd_size_is_refused_by_its_header(tmp_path: Path, size: bytes) -> None:
    assert "image size" in refusal(write_hdr(tmp_path / "a.hdr", bytes(5000), size))


def test_hdr_in_another_colour_space_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n" + bytes(4))
    assert "FORMAT = 32-bit_rle_xyze" in refusal(path)


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
