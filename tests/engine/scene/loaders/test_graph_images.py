"""Images in networks of nodes as fields, against their texels."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Samples
from engine.scene.loaders.mtlx import read_materials
from tests.engine.scene.loaders.graph_samples import COLOUR, A, fields_of, number, values_of
from tests.engine.scene.loaders.mtlx_samples import given, image, linked, material, node, write_png

pytest.importorskip("MaterialX")


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Images: colours of 4 x 2 texels, and one channel of 2 x 2."""
    rng = np.random.default_rng(3)
    write_png(tmp_path / "colour.png", rng.random((2, 4, 3)))
    write_png(tmp_path / "grey.png", np.array([[0.0, 1.0], [0.2, 0.6]]))
    write_png(tmp_path / "alpha.png", rng.random((2, 2, 4)))
    return tmp_path


def test_hexagonal_tiles_are_those_of_an_image(pictures: Path) -> None:
    nodes = node("hextiledimage", "color3", "last", given("file", "filename", "colour.png")
                 + given("tiling", "vector2", "3, 2"))  # fmt: skip
    field, made = fields_of(pictures, nodes)
    assert MapMaker().colours(field).texture_scale == (3.0, 2.0)
    assert [each.name for each in made.unshown] == ["nodes.hextiledimage"]


def test_a_pattern_on_an_image_that_repeats_is_not_repeated_with_it(pictures: Path) -> None:
    nodes = node("tiledimage", "color3", "i", given("file", "filename", "colour.png")
                 + given("uvtiling", "vector2", "2, 1"))  # fmt: skip
    ends = given("valuel", "color3", "0, 0, 0") + given("valuer", "color3", "1, 1, 1")
    nodes += node("ramplr", "color3", "r", ends)
    nodes += node("multiply", "color3", "last", linked("in1", "color3", "i") + linked("in2", "color3", "r"))
    maps = MapMaker()
    assert maps.colours(fields_of(pictures, nodes)[0]).texture_scale == (1.0, 1.0)
    texels = np.asarray(Image.open(pictures / "colour.png"), np.float64) / 255.0
    # The middle of the third texel of the second repeat: u = (1 + 2.5 / 4) / 2, the ramp's value there.
    u = (1.0 + 2.5 / 4.0) / 2.0
    found = maps.maps[0].texels()
    column = int(u * found.shape[1])
    u = (column + 0.5) / found.shape[1]
    assert found[found.shape[0] // 4, column] == pytest.approx(texels[0, 2] * u, abs=5e-3)


def test_heights_of_an_image_have_central_differences(tmp_path: Path) -> None:
    heights = np.round(np.random.default_rng(4).random((4, 4)) * 255) / 255
    write_png(tmp_path / "h.png", heights)
    nodes = image("i", "float", "h.png") + node("heighttonormal", "vector3", "last", linked("in", "float", "i"))
    field, _ = fields_of(tmp_path, nodes, "vector3")
    # At the middle of the texel of row 1 and column 2, v upwards, 4 texels to the unit.
    found = field.at(Samples(np.array([[2.5 / 4, 1.0 - 1.5 / 4]], np.float32)))[0]
    slope = [(heights[1, 3] - heights[1, 1]) * 2.0 / 16.0, (heights[0, 2] - heights[2, 2]) * 2.0 / 16.0]
    normal = np.array([-slope[0], -slope[1], 1.0])
    np.testing.assert_allclose(found, 0.5 + 0.5 * normal / np.linalg.norm(normal), atol=1e-5)


def test_bumps_are_a_normal_map_of_their_strength(tmp_path: Path) -> None:
    write_png(tmp_path / "h.png", np.array([[0.0, 1.0], [0.2, 0.6]]))
    nodes = image("i", "float", "h.png") + node(
        "bump", "vector3", "b", linked("height", "float", "i") + number("scale", 0.5)
    )
    (tmp_path / "it.mtlx").write_text(material("standard_surface", linked("normal", "vector3", "b"), nodes))
    read = read_materials(tmp_path / "it.mtlx")
    bumps = read.materials[0].material.bumps
    assert (bumps.normal_map, bumps.bump_strength) == ("#0", 0.5) and read.materials[0].material.unshown == ()
    texels = read.maps[0].texels()
    np.testing.assert_allclose(np.linalg.norm(2.0 * texels - 1.0, axis=2), 1.0, atol=1e-5)


def test_one_image_is_its_file(pictures: Path) -> None:
    nodes = node("tiledimage", "color3", "last", given("file", "filename", "colour.png", 'colorspace="srgb_texture"')
                 + given("uvtiling", "vector2", "3, 2"))  # fmt: skip
    maps = MapMaker()
    found = maps.colours(fields_of(pictures, nodes)[0])
    assert (found.texture, found.texture_space, found.texture_scale) == ("colour.png", "srgb", (3.0, 2.0))
    assert maps.maps == []


def test_a_map_of_a_small_image_is_right_between_texels(pictures: Path) -> None:
    # Between texels 1 and 0.6 of the second column, a third of their distance from the first: 0.8667², interpolated
    # before it is squared. The squares of both are 0.7867 there.
    nodes = image("i", "float", "grey.png")
    nodes += node("multiply", "float", "last", linked("in1", "float", "i") + linked("in2", "float", "i"))
    maps = MapMaker()
    maps.share(fields_of(pictures, nodes)[0])
    assert maps.maps[0].texels()[2, 4, 0] == pytest.approx(0.8667**2, abs=2e-3)


def test_a_computed_map_has_the_texels_of_its_image(pictures: Path) -> None:
    # Inverted: texel by texel 1 − the decoded value, in the image's own mapping; every third texel of a small image.
    nodes = image("i", "color3", "colour.png", linked("texcoord", "vector2", "p"), "srgb_texture")
    place = linked("texcoord", "vector2", "t") + given("scale", "vector2", "0.5, 0.25") + number("rotate", 90.0)
    nodes += node("texcoord", "vector2", "t", "") + node("place2d", "vector2", "p", place)
    nodes += node("invert", "color3", "last", linked("in", "color3", "i"))
    maps = MapMaker()
    field, _ = fields_of(pictures, nodes)
    found = maps.colours(field)
    assert found.texture == "#0" and found.texture_space == "linear"
    codes = np.asarray(Image.open(pictures / "colour.png"), np.float64) / 255.0
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(maps.maps[0].texels()[1::3, 1::3], 1.0 - linear, atol=1e-4)
    # At the place of a texel, by the layer's own transform, the network has that texel.
    own = maps.maps[0].placement
    assert (own.repeats, own.transform.rotation) == ((2.0, 4.0), -90.0)
    texel = np.array([(2 + 0.5) / 4, 1.0 - (1 + 0.5) / 2])  # column 2, row 1
    uv = np.linalg.solve(own.matrix, texel - own.transform.offset)
    np.testing.assert_allclose(field.at(Samples(uv[None].astype(np.float32)))[0], 1.0 - linear[1, 2], atol=1e-4)


@pytest.mark.parametrize(
    ("space", "expected"),
    [
        ("", 0.5019608),
        ("lin_rec709", 0.5019608),
        ("srgb_texture", 0.2158605),
        ("g22_rec709", 0.2195197),
        ("acescg", 0.5019608),
    ],
)
def test_colours_are_decoded_by_their_space(tmp_path: Path, space: str, expected: float) -> None:
    write_png(tmp_path / "grey.png", np.full((2, 2, 3), 0.5))  # grey is grey in any primaries
    nodes = image("last", "color3", "grey.png", space=space)
    np.testing.assert_allclose(values_of(tmp_path, nodes)[0], [expected] * 3, atol=2e-4)


def test_numbers_are_decoded_by_nothing(pictures: Path) -> None:
    nodes = image("last", "float", "grey.png", space="srgb_texture")
    field, _ = fields_of(pictures, nodes, "float")
    middles = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]], np.float32)
    np.testing.assert_allclose(field.at(Samples(middles))[:, 0], [0.0, 1.0, 0.2, 0.6], atol=1e-6)
    assert MapMaker().numbers(field).keys["map"] == "grey.png"


@pytest.mark.parametrize(("mode", "expected"), [("periodic", 0.0), ("clamp", 1.0), ("mirror", 1.0), ("constant", 0.3)])
def test_beyond_the_edge_the_address_mode_counts(pictures: Path, mode: str, expected: float) -> None:
    more = given("uaddressmode", "string", mode) + given("default", "float", "0.3")
    field, _ = fields_of(pictures, image("last", "float", "grey.png", more), "float")
    assert field.at(Samples(np.array([[1.25, 0.75]], np.float32)))[0, 0] == pytest.approx(expected, abs=1e-6)


def test_alpha_and_channels(pictures: Path) -> None:
    nodes = image("i", "color4", "alpha.png") + node("separate4", "multioutput", "s", linked("in", "color4", "i"))
    nodes += node("convert", "color3", "last", linked("in", "float", "s", 'output="outa"'))
    field, _ = fields_of(pictures, nodes)
    alpha = np.asarray(Image.open(pictures / "alpha.png"))[0, 0, 3] / 255.0
    assert field.at(Samples(np.array([[0.25, 0.75]], np.float32)))[0, 0] == pytest.approx(alpha, abs=1e-6)


def test_an_image_that_is_not_there_has_its_default_and_is_listed(tmp_path: Path) -> None:
    nodes = image("last", "color3", "../../etc/passwd", given("default", "color3", COLOUR))
    field, made = fields_of(tmp_path, nodes)
    np.testing.assert_allclose(field.value, A, atol=1e-6)
    assert made.unshown[0].name == "nodes.image ../../etc/passwd" and "not there" in made.unshown[0].effect
