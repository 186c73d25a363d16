"""Networks of nodes as fields: each operation against its definition."""

from pathlib import Path

import numpy as np
import pytest

from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Samples
from engine.scene.loaders.graph_noise import noise
from engine.scene.loaders.mtlx import read_materials
from tests.engine.scene.loaders.graph_samples import COLOUR, PLACES, A, fields_of, number, values_of
from tests.engine.scene.loaders.mtlx_samples import document, given, linked, material, node

pytest.importorskip("MaterialX")
OTHER = "0.6, 0.4, 0.1"
B = np.array([0.6, 0.4, 0.1])


def two(category: str, *names: str, more: str = "") -> str:
    one, other = names
    return node(category, "color3", "last", given(one, "color3", COLOUR) + given(other, "color3", OTHER) + more)


def one(category: str, more: str = "", kind: str = "color3") -> str:
    return node(category, kind, "last", given("in", kind, COLOUR) + more)


HALF = number("inlow", 0.0) + number("inhigh", 0.5)
CODES = given("value", "color3", COLOUR, 'colorspace="srgb_texture"')
RED = given("in", "color3", "1, 0, 0")
ONE_OF_TWO = given("in1", "color3", COLOUR) + given("in2", "color3", OTHER)
THREE = number("in1", 0.1) + number("in2", 0.2) + number("in3", 0.3)
LUMA = np.dot(A, [0.2722287, 0.6740818, 0.0536895])  # the default of MaterialX: those of ACEScg


@pytest.mark.parametrize(
    ("nodes", "expected"),
    [
        (two("add", "in1", "in2"), A + B),
        (two("subtract", "in1", "in2"), A - B),
        (two("multiply", "in1", "in2"), A * B),
        (two("divide", "in1", "in2"), A / B),
        (two("modulo", "in1", "in2"), np.mod(A, B)),
        (two("power", "in1", "in2"), A**B),
        (two("min", "in1", "in2"), np.minimum(A, B)),
        (two("max", "in1", "in2"), np.maximum(A, B)),
        (two("mix", "fg", "bg", more=number("mix", 0.3)), 0.3 * A + 0.7 * B),
        (two("screen", "fg", "bg", more=number("mix", 1.0)), 1.0 - (1.0 - A) * (1.0 - B)),
        (two("difference", "fg", "bg", more=number("mix", 1.0)), np.abs(A - B)),
        (two("plus", "fg", "bg", more=number("mix", 0.5)), B + 0.5 * A),
        (two("overlay", "fg", "bg", more=number("mix", 1.0)), np.where(B < 0.5, 2 * A * B, 1 - 2 * (1 - A) * (1 - B))),
        (one("invert"), 1.0 - A),
        (one("absval"), A),
        (one("floor"), [0.0, 0.0, 0.0]),
        (one("round"), [0.0, 1.0, 1.0]),
        (one("clamp", number("low", 0.3) + number("high", 0.6)), [0.3, 0.5, 0.6]),
        (one("remap", HALF + number("outlow", 1.0) + number("outhigh", 2.0)), 1 + 2 * A),
        (one("range", HALF + given("doclamp", "boolean", "true")), [0.4, 1.0, 1.0]),
        (one("contrast", number("amount", 2.0) + number("pivot", 0.5)), [-0.1, 0.5, 1.1]),
        (one("saturate", number("amount", 0.0)), [LUMA] * 3),
        (one("saturate", number("amount", 2.0)), LUMA + 2.0 * (A - LUMA)),
        (one("luminance"), [LUMA] * 3),
        (one("smoothstep", number("low", 0.0) + number("high", 1.0)), A * A * (3 - 2 * A)),
        # Half a turn of the hue: the largest and the smallest channel change places.
        (one("hsvadjust", given("amount", "vector3", "0.5, 1, 1")), [0.8, 0.5, 0.2]),
        (one("hsvadjust", given("amount", "vector3", "0, 0, 1")), [0.8, 0.8, 0.8]),
        (one("colorcorrect"), A),
        (one("colorcorrect", number("gain", 2.0) + number("exposure", 1.0)), 4.0 * A),
        (one("colorcorrect", number("lift", 0.1)), A * 0.9 + 0.1),
        (node("combine3", "color3", "last", THREE), [0.1, 0.2, 0.3]),
        (
            node("extract", "float", "e", given("in", "color3", COLOUR) + given("index", "integer", "2"))
            + node("convert", "color3", "last", linked("in", "float", "e")),
            [0.8, 0.8, 0.8],
        ),
        (node("constant", "color3", "last", CODES), [0.0331048, 0.2140411, 0.6038274]),
        (node("ifgreater", "color3", "last", number("value1", 2.0) + number("value2", 1.0) + ONE_OF_TWO), A),
        # Red of ACEScg, whose primaries lie outside of Rec. 709's.
        (node("acescg_to_lin_rec709", "color3", "last", RED), [1.705051, -0.1302564, -0.0240034]),
        (node("switch", "color3", "last", ONE_OF_TWO + number("which", 1.0)), B),
        # x about z by 90 degrees, clockwise as seen from the tip of z: −y.
        (
            node("rotate3d", "vector3", "r", given("in", "vector3", "1, 0, 0") + number("amount", 90.0)
                 + given("axis", "vector3", "0, 0, 2"))
            + node("convert", "color3", "last", linked("in", "vector3", "r")),
            [0.0, -1.0, 0.0],
        ),
    ],
)  # fmt: skip
def test_an_operation_is_its_definition(tmp_path: Path, nodes: str, expected: object) -> None:
    np.testing.assert_allclose(values_of(tmp_path, nodes)[0], expected, atol=2e-6)


def test_ramps_and_checkers_go_by_texture_coordinates(tmp_path: Path) -> None:
    ends = given("valuel", "color3", "1, 0, 0") + given("valuer", "color3", "0, 1, 0")
    np.testing.assert_allclose(
        values_of(tmp_path, node("ramplr", "color3", "last", ends)), [[0.75, 0.25, 0], [0.2, 0.8, 0]], atol=1e-6
    )
    # The top is where v is 1.
    ends = given("valuet", "color3", "1, 0, 0") + given("valueb", "color3", "0, 1, 0")
    np.testing.assert_allclose(
        values_of(tmp_path, node("ramptb", "color3", "last", ends)), [[0.75, 0.25, 0], [0.1, 0.9, 0]], atol=1e-6
    )
    colours = given("color1", "color3", "1, 1, 1") + given("color2", "color3", "0, 0, 0")
    field, made = fields_of(
        tmp_path, node("checkerboard", "color3", "last", colours + given("uvtiling", "vector2", "2, 2"))
    )
    found = field.at(Samples(np.array([[0.2, 0.2], [0.7, 0.2], [0.7, 0.7]], np.float32)))[:, 0]
    assert found.tolist() in ([1.0, 0.0, 1.0], [0.0, 1.0, 0.0]) and made.unshown == ()


def test_a_comparison_is_its_condition(tmp_path: Path) -> None:
    compared = node("ifgreater", "boolean", "c", number("value1", 2.0) + number("value2", 1.0))
    nodes = compared + node("convert", "color3", "last", linked("in", "boolean", "c"))
    assert values_of(tmp_path, nodes)[0].tolist() == [1.0, 1.0, 1.0]


def test_noise_in_space_that_is_not_known_counts_as_its_middle_and_is_listed(tmp_path: Path) -> None:
    field, made = fields_of(tmp_path, node("noise3d", "color3", "last", given("pivot", "float", "0.25")))
    assert field.is_constant and field.value.tolist() == [0.25] * 3
    assert [each.name for each in made.unshown] == ["nodes.noise3d"]
    # So do places that go through arithmetic first, which are listed themselves.
    field, made = fields_of(tmp_path, node("unifiednoise3d", "float", "last", given("type", "integer", "2")), "float")
    assert field.is_constant and {each.name for each in made.unshown} == {"nodes.Pobject", "nodes.worleynoise3d"}


def test_noise_over_texture_coordinates_is_its_pattern(tmp_path: Path) -> None:
    # At (0.25, 0.75) and (0.8, 0.1) times (4, 2), of amplitude 0.5 about 0.3.
    nodes = node("texcoord", "vector2", "t", "") + node(
        "multiply", "vector2", "p", linked("in1", "vector2", "t") + given("in2", "vector2", "4, 2")
    )
    more = linked("texcoord", "vector2", "p") + given("amplitude", "vector3", "0.5, 0.5, 0.5") + number("pivot", 0.3)
    field, made = fields_of(tmp_path, nodes + node("noise2d", "color3", "last", more))
    expected = 0.3 + 0.5 * noise(PLACES * np.array([4, 2], np.float32), 3)
    np.testing.assert_allclose(field.at(Samples(PLACES)), expected, atol=1e-6)
    # Maps cover the unit square; that is listed where the mesh's coordinates may go beyond.
    assert [each.effect[:18] for each in made.unshown] == ["in the unit square"]
    maps = MapMaker()
    assert maps.colours(field).texture_wrap == ("clamp", "clamp") and maps.maps[0].size == (1024, 1024)


def test_noise_on_a_ball_is_at_its_places(tmp_path: Path) -> None:
    text = material(
        "standard_surface", linked("base", "float", "n"), node("noise3d", "float", "n", number("pivot", 0.5))
    )
    (tmp_path / "it.mtlx").write_text(text, encoding="utf-8")
    read = read_materials(tmp_path / "it.mtlx")
    assert read.materials[0].material.unshown == ()
    texels = read.maps[0].texels()[..., 0]
    # The texel of u = 1/4 + half a texel on the equator: x is the radius, 1/2, there.
    phi = 2.0 * np.pi * (256 + 0.5) / 1024
    theta = np.pi * (512 + 0.5) / 1024
    place = 0.5 * np.array([[np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)]])
    expected = 0.5 + noise(place.astype(np.float32), 1)[0, 0]
    assert texels[512, 256] == pytest.approx(expected, abs=2e-5)


def test_many_octaves_are_bounded_and_listed(tmp_path: Path) -> None:
    field, made = fields_of(
        tmp_path, node("fractal2d", "float", "last", given("octaves", "integer", "2000000000")), "float"
    )
    assert np.isfinite(field.at(Samples(PLACES))).all()
    assert "nodes.fractal2d.octaves" in {each.name for each in made.unshown}
    # So are nodes: of those that are too many the middle counts.
    many = node("fractal2d", "float", "n0", given("octaves", "integer", "16"))
    for k in range(1, 12):
        more = linked("amplitude", "float", f"n{k - 1}") + given("octaves", "integer", "16")
        many += node("fractal2d", "float", f"n{k}", more)
    _, made = fields_of(tmp_path, many, "float", output="n11")
    assert ("nodes.fractal2d", 4) in {(each.name, each.count) for each in made.unshown}


def test_corner_ramps_and_ramps_of_points(tmp_path: Path) -> None:
    corners = "".join(given(f"value{name}", "float", str(value)) for name, value in
                      zip(("tl", "tr", "bl", "br"), (0.1, 0.3, 0.5, 0.9), strict=True))  # fmt: skip
    found = values_of(tmp_path, node("ramp4", "float", "last", corners), "float")[:, 0]
    # Bilinear, with v upwards.
    expected = [(1 - v) * ((1 - u) * 0.5 + u * 0.9) + v * ((1 - u) * 0.1 + u * 0.3) for u, v in PLACES]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    points = given("interval1", "float", "0.2") + given("color1", "color4", "1, 0, 0, 1")
    points += given("interval2", "float", "0.6") + given("color2", "color4", "0, 1, 0, 1")
    points += given("num_intervals", "integer", "2") + given("interpolation", "integer", "0")
    nodes = node("ramp", "color4", "r", points) + node("convert", "color3", "last", linked("in", "color4", "r"))
    share = (0.25 - 0.2) / 0.4  # at u = 0.25 between the points, at 0.8 beyond the last
    np.testing.assert_allclose(values_of(tmp_path, nodes), [[1 - share, share, 0], [0, 1, 0]], atol=1e-6)


@pytest.mark.parametrize("order", [0, 1])
def test_place2d_turns_scales_and_moves_in_its_order(tmp_path: Path, order: int) -> None:
    place = given("pivot", "vector2", "0.5, 0.25") + given("scale", "vector2", "2, 4") + number("rotate", 30.0)
    place += given("offset", "vector2", "0.1, -0.2") + given("operationorder", "integer", str(order))
    place += linked("texcoord", "vector2", "t")
    nodes = node("texcoord", "vector2", "t", "") + node("place2d", "vector2", "p", place)
    nodes += node("separate2", "multioutput", "s", linked("in", "vector2", "p"))
    nodes += node("combine3", "color3", "last", linked("in1", "float", "s", 'output="outx"')
                  + linked("in2", "float", "s", 'output="outy"'))  # fmt: skip
    cosine, sine = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    turn = np.array([[cosine, sine], [-sine, cosine]])  # clockwise [MaterialX, rotate2d]
    pivot, scale, offset = np.array([0.5, 0.25]), np.array([2.0, 4.0]), np.array([0.1, -0.2])
    if order == 0:  # scale, turn, move; of coordinates, so that images do the inverse
        expected = ((PLACES - pivot) / scale) @ turn.T - offset + pivot
    else:
        expected = ((PLACES - pivot - offset) @ turn.T) / scale + pivot
    np.testing.assert_allclose(values_of(tmp_path, nodes)[:, :2], expected, atol=1e-6)


def test_heights_become_normals(tmp_path: Path) -> None:
    # H = 0.7 s over coordinates s = 3 u: the slope along s is 0.7, times scale / 16.
    nodes = node("texcoord", "vector2", "t", "") + node(
        "multiply", "vector2", "p", linked("in1", "vector2", "t") + given("in2", "vector2", "3, 3")
    )
    nodes += node("separate2", "multioutput", "s", linked("in", "vector2", "p"))
    nodes += node("multiply", "float", "h", linked("in1", "float", "s", 'output="outx"') + number("in2", 0.7))
    more = linked("in", "float", "h") + number("scale", 8.0) + linked("texcoord", "vector2", "p")
    found = values_of(tmp_path, nodes + node("heighttonormal", "vector3", "last", more), "vector3")[0]
    normal = np.array([-0.7 * 8.0 / 16.0, 0.0, 1.0])
    np.testing.assert_allclose(found, 0.5 + 0.5 * normal / np.linalg.norm(normal), atol=1e-4)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_flat_and_mirrored_heights_look_up(tmp_path: Path, mirror: float) -> None:
    nodes = node("texcoord", "vector2", "t", "") + node(
        "multiply", "vector2", "p", linked("in1", "vector2", "t") + given("in2", "vector2", f"{mirror}, 1")
    )
    more = number("in", 0.5) + linked("texcoord", "vector2", "p")
    found = values_of(tmp_path, nodes + node("heighttonormal", "vector3", "last", more), "vector3")[0]
    np.testing.assert_allclose(found, [0.5, 0.5, 1.0], atol=1e-6)


def test_a_node_that_depends_on_itself_and_deep_networks_end(tmp_path: Path) -> None:
    loop = node("add", "color3", "last", linked("in1", "color3", "last"))
    assert fields_of(tmp_path, loop)[0].is_constant
    deep = node("absval", "color3", "n0", given("in", "color3", COLOUR))
    deep += "".join(node("absval", "color3", f"n{k}", linked("in", "color3", f"n{k - 1}")) for k in range(1, 400))
    with pytest.raises(Exception, match="depend on each other"):
        fields_of(tmp_path, deep, output="n399")


def test_older_versions_are_brought_up_to_date(tmp_path: Path) -> None:
    # Version 1.36: swizzles by a `channels` attribute, and parameters in place of inputs.
    nodes = node("constant", "color3", "c", f'<parameter name="value" type="color3" value="{COLOUR}"/>')
    nodes += node("swizzle", "color3", "last", linked("in", "color3", "c") + given("channels", "string", "bgr"))
    np.testing.assert_allclose(values_of(tmp_path, nodes, version="1.36")[0], A[::-1], atol=1e-6)


def test_a_document_of_two_graphs_and_custom_nodes(tmp_path: Path) -> None:
    custom = (
        '<nodedef name="ND_own" node="own"><input name="in" type="color3" value="1,1,1"/>'
        '<output name="out" type="color3"/></nodedef>'
        '<nodegraph name="NG_own" nodedef="ND_own">'
        '<multiply name="m" type="color3"><input name="in1" type="color3" interfacename="in"/>'
        '<input name="in2" type="float" value="0.5"/></multiply>'
        '<output name="out" type="color3" nodename="m"/></nodegraph>'
    )
    text = document(custom + node("own", "color3", "last", given("in", "color3", COLOUR)))
    nodes = text.split('version="1.39" >')[1].removesuffix("</materialx>")
    np.testing.assert_allclose(values_of(tmp_path, nodes)[0], 0.5 * A, atol=1e-6)


@pytest.mark.parametrize(
    "nodes",
    [
        node("separate3", "color3", "last", ""),
        node("convert", "color3", "last", ""),
        node("blur", "color3", "last", given("in", "float", "0.5")),
        node("blur", "color3", "last", ""),
        node("switch", "color3", "last", given("in2", "color3", COLOUR) + number("which", 1.0)),
        node("switch", "color3", "last", number("which", 1.0)),
        node("ifgreater", "color3", "last", given("in1", "float", "1") + given("in3", "float", "1")),
        node("combine3", "color3", "last", given("in2", "color4", "1, 2, 3, 4")),
        node("constant", "color3", "c", given("value", "float", "0.5"))
        + node("rgbtohsv", "color3", "last", linked("in", "color3", "c")),
        node("normal", "color4", "c", "")
        + node("add", "color4", "last", linked("in1", "color4", "c") + given("in2", "color4", "1, 1, 1, 1")),
        node("separate2", "color4", "c", "")
        + node("luminance", "color3", "last", linked("in", "color3", "c") + linked("lumacoeffs", "color3", "c")),
        node("texcoord", "vector2", "c", "")
        + node("luminance", "color3", "last", given("in", "color3", COLOUR) + linked("lumacoeffs", "color3", "c")),
        node("crossproduct", "color3", "last", given("in1", "vector2", "1, 2") + given("in2", "vector2", "3, 4")),
        node("geompropvalue", "color4", "c", given("default", "vector2", "1, 2"))
        + node("premult", "color4", "last", linked("in", "color4", "c")),
    ],
)  # fmt: skip
def test_nodes_without_inputs_or_of_other_types_are_still_values(tmp_path: Path, nodes: str) -> None:
    found = values_of(tmp_path, nodes)
    assert found.shape == (2, 3) and np.isfinite(found).all()
