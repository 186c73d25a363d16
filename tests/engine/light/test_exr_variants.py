"""OpenEXR files as programs write them: each is the same picture, whatever its parts, channels and storage are."""

import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from engine.core.colour import REC709, luminance_weights, xyz_to_rec709
from engine.core.errors import LoadError
from engine.light.environment import load_environment
from engine.light.exr_channels import PartChannels, choose_channels, interpolate_plane
from engine.light.radiance_files import read_radiance_image
from tests.engine.light.conftest import gradient
from tests.engine.light.test_radiance_files import ACES
from tests.naive.exr_files import ExrPart, exr_file

PICTURE = gradient()
HEIGHT, WIDTH, _ = PICTURE.shape


def planes(names: str = "RGB", layer: str = "", kind: type = np.float32) -> dict[str, np.ndarray]:
    return {layer + name: np.ascontiguousarray(PICTURE[..., i].astype(kind)) for i, name in enumerate(names)}


def read(folder: Path, *parts: ExrPart, is_colour: bool = True) -> tuple[np.ndarray, list[str]]:
    path, notes = folder / "a.exr", []
    path.write_bytes(exr_file(*parts))
    return read_radiance_image(path, notes, is_colour), notes


@pytest.mark.parametrize("tile", [0, 16, 17, 64])
@pytest.mark.parametrize("is_mip_map", [False, True])
def test_scan_lines_tiles_and_mip_maps(tmp_path: Path, tile: int, is_mip_map: bool) -> None:
    found, notes = read(tmp_path, ExrPart(planes(), tile=tile, is_mip_map=is_mip_map))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == []


LOSSLESS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")


@pytest.mark.parametrize("name", [*LOSSLESS, "PXR24", "B44", "B44A", "DWAA", "DWAB"])
def test_compressions(tmp_path: Path, name: str) -> None:
    """Half floats: those that lose lose at most 2.5 % here; 24 bits hold half floats exactly."""
    header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, planes(kind=np.float16)) as file:
        file.write(str(tmp_path / "a.exr"))
    found = read_radiance_image(tmp_path / "a.exr")
    np.testing.assert_allclose(found, PICTURE, rtol=0.0 if name in (*LOSSLESS, "PXR24") else 0.025)


@pytest.mark.parametrize("order", [("depth", "beauty"), ("beauty", "depth")])
@pytest.mark.parametrize("tile", [0, 16])
def test_the_part_with_colours_is_shown_and_the_others_are_listed(
    tmp_path: Path, order: tuple[str, str], tile: int
) -> None:
    parts = {
        "depth": ExrPart({"Z": PICTURE[..., 1]}, name="depth"),
        "beauty": ExrPart(planes(), name="beauty", tile=tile, is_mip_map=True),
    }
    found, notes = read(tmp_path, *(parts[name] for name in order))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == ["part beauty of 2 is shown, not depth (Z)"]


def test_parts_of_other_windows_and_the_first_of_two_pictures(tmp_path: Path) -> None:
    left = ExrPart(planes(), name="left", corner=(5, 2), display=(5, 2, 44, 25))
    right = ExrPart({name: plane[:9, :9] for name, plane in planes().items()}, name="right", display=left.display)
    found, notes = read(tmp_path, left, right)
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == ["part left of 2 is shown, not right (B, G, R)"]
    depth = ExrPart({"Z": PICTURE[..., 0]}, name="depth", display=(0, 0, 39, 29))
    moved = ExrPart(planes(), name="rgb", corner=(-3, 4), display=(0, 0, 39, 29))
    found, notes = read(tmp_path, depth, moved)
    expected = np.zeros((30, 40, 3), np.float32)
    expected[4:28, :37] = PICTURE[:, 3:]
    np.testing.assert_array_equal(found, expected)
    assert len(notes) == 2 and "40 x 24 pixels of data from (-3, 4) on" in notes[1]


def test_a_deep_part_is_passed_over(tmp_path: Path) -> None:
    deep = np.empty((HEIGHT, WIDTH), object)
    for index in np.ndindex(HEIGHT, WIDTH):
        deep[index] = np.ones(2, np.float16)
    storage = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION, "name": "deep"}
    flat = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "name": "flat"}
    parts = [OpenEXR.Part(storage, {"Z": deep}, "deep"), OpenEXR.Part(flat, planes(), "flat")]
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_radiance_image(tmp_path / "a.exr"), PICTURE)


@pytest.mark.parametrize("part", [0, 1])
def test_tiles_that_take_more_memory_than_a_picture_are_refused(tmp_path: Path, part: int) -> None:
    """One that is larger than its picture is fine, up to a limit: the library allocates the tile."""
    np.testing.assert_array_equal(read(tmp_path, ExrPart(planes(), tile=2048))[0], PICTURE)
    parts = [ExrPart(planes(), name="beauty"), ExrPart({"Z": PICTURE[..., 1]}, name="depth")]
    parts[part].tile = 1 << 20
    with pytest.raises(LoadError, match=r"OpenEXR tile = 1048576 x 1048576 pixels, expected at most 4194304 pixels"):
        read(tmp_path, *parts)


def test_parts_that_do_not_fit_into_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    depth, beauty = ExrPart({"Z": PICTURE[..., 1]}, name="depth"), ExrPart(planes(), name="beauty")
    monkeypatch.setattr("engine.light.exr_files.MAX_WHOLE_BYTES", 4 * 4 * HEIGHT * WIDTH - 1)
    with pytest.raises(LoadError, match="pixels of all parts"):
        read(tmp_path, depth, beauty)
    np.testing.assert_array_equal(read(tmp_path, beauty, depth)[0], PICTURE)


def test_layers(tmp_path: Path) -> None:
    """Channels without a layer come first, then the layer that is the whole picture."""
    other = {f"diffuse.{name}": np.zeros_like(plane) for name, plane in planes().items()}
    found, notes = read(tmp_path, ExrPart(planes() | other))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == ["channels that are not shown: diffuse.B, diffuse.G, diffuse.R"]
    found, notes = read(tmp_path, ExrPart(planes(layer="View.Combined.") | other | {"depth.Z": PICTURE[..., 0]}))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes[0] == "channels View.Combined.R, View.Combined.G, View.Combined.B are shown"
    found, notes = read(tmp_path, ExrPart(planes(layer="diffuse.")))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == ["channels diffuse.R, diffuse.G, diffuse.B are shown"]
    found, notes = read(tmp_path, ExrPart({"red": PICTURE[..., 0], "Green": PICTURE[..., 1], "b": PICTURE[..., 2]}))
    np.testing.assert_array_equal(found, PICTURE)


def test_alpha_does_not_count(tmp_path: Path) -> None:
    """Colours are premultiplied: they are the radiance [Kainz13]."""
    found, notes = read(tmp_path, ExrPart(planes() | {"A": np.full((HEIGHT, WIDTH), 0.5, np.float32)}))
    np.testing.assert_array_equal(found, PICTURE)
    assert notes == []


def test_integers_and_mixed_types(tmp_path: Path) -> None:
    mixed = {
        "R": PICTURE[..., 0],
        "G": PICTURE[..., 1].astype(np.float16),
        "B": (64 * PICTURE[..., 2]).astype(np.uint32),
    }
    found, notes = read(tmp_path, ExrPart(mixed))
    np.testing.assert_array_equal(found, PICTURE * np.float32([1, 1, 64]))
    assert notes == ["integers in channel B, read as they are"]
    large = {name: np.full((2, 4), 2**32 - 1, np.uint32) for name in "RGB"}
    np.testing.assert_allclose(read(tmp_path, ExrPart(large))[0], 2.0**32)


def test_luminance_alone_is_grey(tmp_path: Path) -> None:
    found, notes = read(tmp_path, ExrPart({"Y": PICTURE[..., 1]}))
    np.testing.assert_array_equal(found, PICTURE[..., 1:2].repeat(3, axis=2))
    assert notes == ["channel Y alone, shown as grey"]


def test_parts_of_a_colour(tmp_path: Path) -> None:
    found, notes = read(tmp_path, ExrPart({"R": PICTURE[..., 0], "G": PICTURE[..., 1]}))
    np.testing.assert_array_equal(found, PICTURE * np.float32([1, 1, 0]))
    assert notes == ["channels R, G are shown, B black"]
    found, notes = read(tmp_path, ExrPart({"Z": PICTURE[..., 0], "A": PICTURE[..., 1]}))
    np.testing.assert_array_equal(found, PICTURE[..., :1].repeat(3, axis=2))
    assert notes == ["channel Z alone, shown as grey"]


def luminance_and_chroma(picture: np.ndarray, weights: np.ndarray, step: int) -> ExrPart:
    """Y, and (R - Y) / Y and (B - Y) / Y at every step-th pixel [Kainz13]."""
    y = (picture @ weights).astype(np.float32)
    chroma = {name: (picture[..., i] / y - 1.0)[::step, ::step] for name, i in (("RY", 0), ("BY", 2))}
    exact = {name: np.ascontiguousarray(plane.astype(np.float32)) for name, plane in chroma.items()}
    return ExrPart({"Y": y} | exact, {"RY": (step, step), "BY": (step, step)} if step > 1 else {})


@pytest.mark.parametrize("step", [1, 2, 4])
def test_luminance_and_chroma(tmp_path: Path, step: int) -> None:
    # A picture whose chroma is linear in x and y comes back but for the last samples, beyond which it is constant.
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    y = 1.0 + (rows + 2.0 * columns) % 7.0
    red, blue = y * (1.2 + 0.01 * rows), y * (0.6 + 0.005 * columns)
    weights = luminance_weights(REC709)
    np.testing.assert_allclose(weights, [0.2126, 0.7152, 0.0722], atol=1e-4)
    picture = np.stack([red, (y - weights[0] * red - weights[2] * blue) / weights[1], blue], axis=2)
    found, notes = read(tmp_path, luminance_and_chroma(picture, weights, step))
    whole = slice(0, HEIGHT - step + 1), slice(0, WIDTH - step + 1)
    np.testing.assert_allclose(found[whole], picture[whole], rtol=2e-5)
    np.testing.assert_allclose(found, picture, rtol=0.05)
    assert notes == ["luminance and chroma (Y, RY, BY), converted to RGB"]


def test_luminance_and_chroma_in_other_primaries(tmp_path: Path) -> None:
    part = luminance_and_chroma(PICTURE, luminance_weights(ACES), 1)
    part.attributes["chromaticities"] = ("chromaticities", struct.pack("<8f", *ACES))
    plain = ExrPart(planes(), attributes=dict(part.attributes))
    found, notes = read(tmp_path, part)
    np.testing.assert_allclose(found, read(tmp_path, plain)[0], rtol=1e-4, atol=1e-4)
    assert len(notes) == 2


def test_xyz(tmp_path: Path) -> None:
    """By the channels' names, and by primaries that are those of CIE XYZ, as OpenEXR's own sample is."""
    expected = PICTURE @ xyz_to_rec709().T
    found, notes = read(tmp_path, ExrPart(planes("XYZ")))
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert notes[-1] == "CIE XYZ, converted to Rec. 709"
    np.testing.assert_array_equal(read(tmp_path, ExrPart(planes("XYZ")), is_colour=False)[0], PICTURE)
    primaries = {"chromaticities": ("chromaticities", struct.pack("<8f", 1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3))}
    found, notes = read(tmp_path, ExrPart(planes(), attributes=dict(primaries)))
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert notes == ["CIE XYZ, converted to Rec. 709"]
    # Luminance and chroma in XYZ: the luminance is Y, which is green.
    part = luminance_and_chroma(PICTURE, np.array([0.0, 1.0, 0.0]), 1)
    part.attributes |= primaries
    np.testing.assert_allclose(read(tmp_path, part)[0], expected, atol=1e-3)


@pytest.mark.parametrize("channel", ["all", "R"])
@pytest.mark.parametrize("conversion", ["none", "primaries", "chroma"])
def test_an_infinite_sun_stays_one_through_conversions(tmp_path: Path, conversion: str, channel: str) -> None:
    """It is clamped to the brightest half float, and the note names its place."""
    picture = PICTURE.copy()
    picture[3, 5, slice(None) if channel == "all" else 0] = np.inf
    picture[9, 6, 1] = np.nan
    part = ExrPart({name: picture[..., i].astype(np.float16) for i, name in enumerate("RGB")})
    if conversion == "primaries":
        part.attributes["chromaticities"] = ("chromaticities", struct.pack("<8f", *ACES))
    if conversion == "chroma":
        part = luminance_and_chroma(PICTURE, luminance_weights(REC709), 2)
        part.channels["Y"][3, 5], part.channels["Y"][9, 6] = np.inf, np.nan
    (tmp_path / "a.exr").write_bytes(exr_file(part))
    environment = load_environment(tmp_path / "a.exr")
    assert environment.radiance[3, 5, 0] == 65504.0 and environment.radiance[9, 6, 1] == 0.0
    if channel == "all" or conversion == "chroma":
        assert (environment.radiance[3, 5] == 65504.0).all()
    assert environment.notes[-1].startswith("2 pixels were not finite, the first in row 3, column 5, channel R")
    others = np.ones((HEIGHT, WIDTH), bool)
    others[3, 5] = others[9, 6] = False
    assert environment.radiance[others].max() < 10.0  # nothing else became bright


def test_subsampled_planes_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    part = luminance_and_chroma(PICTURE, luminance_weights(REC709), 3)
    with pytest.raises(LoadError, match="OpenEXR"):
        read(tmp_path, part)


def test_interpolation_between_samples() -> None:
    plane = np.float32([[0.0, 4.0, np.inf], [8.0, 12.0, 1.0]])
    # Every 2nd column and row has a sample: (0, 4) along the first row becomes 0, 2, 4.
    found = interpolate_plane(plane, (2, 2), np.arange(4), 4)
    np.testing.assert_array_equal(found[:, :3], [[0, 2, 4], [4, 6, 8], [8, 10, 12], [8, 10, 12]])
    assert np.isinf(found[0, 3])


@pytest.mark.parametrize(
    ("channels", "expected"),
    [
        (["A", "B", "G", "R"], ("R", "G", "B")),
        (["BY", "RY", "Y", "diffuse.R"], ("Y", "RY", "BY")),
        (["X", "Y", "Z"], ("X", "Y", "Z")),
        (["N.X", "N.Y", "N.Z", "c.B", "c.G", "c.R"], ("c.R", "c.G", "c.B")),
        (["B", "G"], (None, "G", "B")),
        (["A"], ("A",)),
    ],
)
def test_channels_of_a_part(channels: list[str], expected: tuple[str | None, ...]) -> None:
    chosen = choose_channels([PartChannels(0, "", channels)], [])
    assert chosen is not None and chosen.names == expected
    assert choose_channels([PartChannels(0, "", [])], []) is None
