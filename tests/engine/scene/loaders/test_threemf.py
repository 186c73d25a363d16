"""3MF files: units, components, materials and colours; and how each kind of error is reported."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.material.layer_maps import LayerMaps
from engine.scene.loaders.formats import read_model
from engine.scene.loaders.image_files import image_reader
from engine.scene.scene_loader import load_scene

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
HEAD = f'<?xml version="1.0"?><model xmlns="{CORE}" xmlns:m="m" xmlns:p="p"'
TETRAHEDRON = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
    '<vertex x="0" y="0" z="2"/></vertices><triangles>{}</triangles></mesh>'
)
FACES = ("0 2 1", "0 1 3", "0 3 2", "1 2 3")


def mesh(*own: str) -> str:
    """The triangles of a tetrahedron, two high, with attributes of each."""
    own = own or ("",) * len(FACES)
    corners = [dict(zip(("v1", "v2", "v3"), face.split(), strict=True)) for face in FACES]
    rows = [
        "<triangle " + " ".join(f'{k}="{v}"' for k, v in each.items()) + f" {more}/>"
        for each, more in zip(corners, own, strict=True)
    ]
    return TETRAHEDRON.format("".join(rows))


def model(resources: str, build: str = '<item objectid="1"/>', unit: str = ' unit="millimeter"') -> str:
    return f"{HEAD}{unit}><resources>{resources}</resources><build>{build}</build></model>"


def packed(*models: str | bytes, names: tuple[str, ...] = ("3D/3dmodel.model", "3D/Objects/a.model")) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        for name, each in zip(names, models, strict=False):
            archive.writestr(name, each)
    return data.getvalue()


def test_units_become_metres_and_z_points_up(mesh_file: Callable[..., Path]) -> None:
    for unit, metres in (("", 1e-3), (' unit="inch"', 0.0254), (' unit="meter"', 1.0), (' unit="micron"', 1e-6)):
        file = mesh_file("a.3mf", packed(model(f'<object id="1" name="foot">{mesh()}</object>', unit=unit)))
        found = read_model(file)
        (part,) = found.parts
        assert (part.name, part.smooth, found.notes) == ("foot", False, ())
        # (x, y, z) of the file is (x, z, −y) here: what is two high stays so.
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 2, 0]]) * metres
        np.testing.assert_allclose(part.mesh.vertices, corners, rtol=1e-12, atol=0)
        assert part.mesh.triangles.tolist() == [[int(k) for k in face.split()] for face in FACES]


def test_components_and_items_are_placed_one_in_another(mesh_file: Callable[..., Path]) -> None:
    turned = "0 1 0 -1 0 0 0 0 1 0 0 0"  # rows for row vectors: x becomes y
    parts = '<components><component objectid="1" transform="2 0 0 0 2 0 0 0 2 10 0 0"/></components>'
    build = (
        f'<item objectid="2" transform="{turned}" partnumber="7"/><item objectid="1" partnumber="7"/>'
        '<item objectid="1" partnumber="7" transform="1 0 0 0 1 0 0 0 1 0 0 5"/>'
    )
    resources = f'<object id="1">{mesh()}</object><object id="2">{parts}</object>'
    (part,) = read_model(mesh_file("a.3mf", packed(model(resources, build, ' unit="meter"')))).parts
    assert part.name == "object 1" and len(part.mesh.triangles) == 12  # three copies, whatever their part numbers
    highest = part.mesh.vertices[:, 1].reshape(3, 4).max(axis=1)
    assert sorted(highest.tolist()) == [2.0, 4.0, 7.0]
    copy = part.mesh.vertices.reshape(3, 4, 3)[int(np.argmax(highest == 4.0))]
    # (2 x + 10, 2 y, 2 z) turned about z: (−2 y, 2 x + 10, 2 z), and (x, z, −y) of that.
    np.testing.assert_allclose(copy, [[0, 0, -10], [0, 0, -12], [-2, 0, -10], [0, 4, -10]], atol=1e-12)


def test_components_of_other_models_have_numbers_of_their_own(mesh_file: Callable[..., Path]) -> None:
    """As slicers write them: each object in a model of its own file, with equal numbers."""
    other = model(f'<object id="1">{mesh()}</object><object id="2" name="far">{mesh()}</object>', "")
    parts = '<components><component p:path="/3D/Objects/a.model" objectid="2"/></components>'
    main = model(f'<object id="1" name="near">{mesh()}</object><object id="2">{parts}</object>',
                 '<item objectid="2"/>')  # fmt: skip
    (part,) = read_model(mesh_file("a.3mf", packed(main, other))).parts
    assert (part.name, len(part.mesh.triangles)) == ("far", 4)


def test_base_materials_are_parts_and_groups_of_colours_are_of_corners(mesh_file: Callable[..., Path]) -> None:
    groups = (
        '<basematerials id="5"><base name="rubber" displaycolor="#FF0000"/>'
        '<base name="steel" displaycolor="#808080FF"/></basematerials>'
        '<m:colorgroup id="6"><m:color color="#00FF00"/><m:color color="#0000FF"/></m:colorgroup>'
    )
    own = ("", 'p1="0"', 'pid="6" p1="0" p2="1" p3="0"', 'pid="6" p1="1"')
    found = read_model(
        mesh_file(
            "a.3mf", packed(model(groups + f'<object id="1" name="toy" pid="5" pindex="1">{mesh(*own)}</object>'))
        )
    )
    rubber, steel, toy = sorted(found.parts, key=lambda part: part.name)
    grey = decode_srgb(np.array([128 / 255]))[0]
    for part, name, albedo in ((rubber, "rubber", (1.0, 0.0, 0.0)), (steel, "steel", (grey,) * 3)):
        assert part.name == name and len(part.mesh.triangles) == 1 and part.mesh.colours is None
        np.testing.assert_allclose(part.layers[0].parameters["albedo"], albedo, rtol=1e-6)
    green, blue = [0, 1, 0, 1], [0, 0, 1, 1]
    assert toy.name == "toy" and toy.layers == () and toy.mesh.colours is not None
    assert toy.mesh.colours.tolist() == [[green, blue, green], [blue] * 3]


def image(colour: tuple[int, int, int]) -> bytes:
    data = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(data, "PNG")
    return data.getvalue()


TEXTURES = (
    '<m:texture2d id="8" path="/3D/Textures/b.png" contenttype="image/png" tilestyleu="mirror" tilestylev="clamp"/>'
    '<m:texture2dgroup id="9" texid="8"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0"/>'
    '<m:tex2coord u="0.5" v="2"/></m:texture2dgroup>'
)


def test_textures_are_those_of_the_archive(mesh_file: Callable[..., Path]) -> None:
    own = mesh('pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="2"', "", "")
    text = model(TEXTURES + f'<object id="1" name="toy">{own}</object>')
    names = ("3D/3dmodel.model", "3D/Textures/a.png", "3D/Textures/b.png")
    file = mesh_file("a.3mf", packed(text, image((255, 0, 0)), image((0, 0, 255)), names=names))
    found = read_model(file)
    assert found.unshown == () and found.notes == ()
    shown, plain = sorted(found.parts, key=lambda part: len(part.layers), reverse=True)
    # The second of the images in the archive; v grows upwards in both.
    assert shown.layers[0].maps == LayerMaps("#1", "srgb", texture_wrap=("mirror", "clamp"))
    assert shown.mesh.uvs is not None and plain.mesh.uvs is None and len(plain.mesh.triangles) == 2
    assert shown.mesh.uvs.tolist() == [[[0, 0], [1, 0], [0.5, 2]], [[0.5, 2]] * 3]
    assert image_reader(file)(1) == image((0, 0, 255))
    scene = load_scene(file)
    texture = scene.textures.texture(scene.description.objects[0].layers[0].maps.images)
    assert texture is not None and texture.mean.tolist() == [0.0, 0.0, 1.0]
    with pytest.raises(LoadError, match="image = 2, expected an image from 0 to 1"):
        image_reader(file)(2)


def test_textures_that_are_not_there_leave_white(mesh_file: Callable[..., Path]) -> None:
    text = model(TEXTURES + f'<object id="1" pid="9" pindex="0">{mesh()}</object>')
    found = read_model(mesh_file("a.3mf", packed(text)))
    assert found.parts[0].layers[0].maps == LayerMaps()
    assert found.notes == ("image 3D/Textures/b.png is not shown: it is not in the archive",)
    names = ("3D/3dmodel.model", "3D/Textures/b.png")
    damaged = read_model(mesh_file("a.3mf", packed(text, image((9, 9, 9))[:60], names=names)))
    assert damaged.parts[0].layers[0].maps == LayerMaps() and "is not shown" in damaged.notes[0]


def test_what_is_not_there_or_flat_does_not_refuse_the_rest(mesh_file: Callable[..., Path]) -> None:
    flat = TETRAHEDRON.format('<triangle v1="0" v2="1" v3="1"/>')
    resources = f'<object id="1" name="toy">{mesh()}</object><object id="2" name="flat">{flat}</object>'
    build = '<item objectid="1"/><item objectid="2"/><item objectid="3"/>'
    path = mesh_file("a.3mf", packed(model(resources, build)))
    found = read_model(path)
    assert [part.name for part in found.parts] == ["toy"]
    assert found.notes[0] == "1 objects that the file places are not in it"
    assert found.notes[-1] == "parts of which no face has an area are left out: flat"
    assert len(load_scene(path).object_names) == 2  # with the floor


def test_elements_that_are_not_known_are_listed(mesh_file: Callable[..., Path]) -> None:
    more = '<metadata name="a">b</metadata><d:displacement2d xmlns:d="d" id="7"/>'
    found = read_model(mesh_file("a.3mf", packed(model(more + f'<object id="1">{mesh()}</object>'))))
    assert [(each.name, each.count) for each in found.unshown] == [("displacement2d", 1)]


def test_each_triangle_may_have_a_group_or_a_material_of_its_own(mesh_file: Callable[..., Path]) -> None:
    """Materials of one group alternate with colours of several."""
    groups = "".join(
        f'<m:colorgroup id="{k}"><m:color color="#000000"/><m:color color="#0000{k:02X}"/></m:colorgroup>'
        for k in (7, 8)
    )
    materials = '<basematerials id="5"><base name="a" displaycolor="#FF0000"/><base name="b"/></basematerials>'
    own = ('pid="8" p1="1"', 'pid="5" p1="1"', 'pid="7" p1="1" p2="0"', 'pid="5" p1="0"')
    found = read_model(mesh_file("a.3mf", packed(model(groups + materials + f'<object id="1">{mesh(*own)}</object>'))))
    assert [(part.name, len(part.mesh.triangles)) for part in found.parts] == [("a", 1), ("b", 1), ("object 1", 2)]
    colours = found.parts[2].mesh.colours
    assert colours is not None and (colours[..., 2] * 255 * 12.92).round(3).tolist() == [[8, 8, 8], [7, 0, 7]]


TOY = f'<object id="1">{mesh()}</object>'
LOOP = '<object id="1"><components><component objectid="1"/></components></object>'
DOUBLES = "".join(
    f'<object id="{k}"><components><component objectid="{k + 1}"/><component objectid="{k + 1}"/></components></object>'
    for k in range(1, 30)
)
ENTITIES = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><model>&b;</model>'


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"PK\x03\x04", "zip archive = no directory at its end"),
        (packed(), "models = 0, expected a file 3D/3dmodel.model"),
        (packed("<model"), "3D/3dmodel.model: line 1 = unclosed token"),
        (packed(ENTITIES), "line 1 = a document type, expected XML without one"),
        (packed(ENTITIES.encode("utf-16")), "line 1 = a document type"),
        (packed(model("", "")), "faces = 0, expected at least one object"),
        (packed(model("", '<item objectid="4"/>')), "faces = 0, expected at least one object with triangles"),
        (packed(model(LOOP)), "object 1 = 0 at level 33, expected at most"),
        (packed(model(DOUBLES + f'<object id="30">{mesh()}</object>')), "of all copies"),
        (packed(model(DOUBLES + f'<object id="30">{mesh()}</object>') + " " * (8 << 20)), "at most 1524"),
        (packed(model(TOY, unit=' unit="mile"')), "unit = mile, expected micron"),
        (packed(model('<object id="1"><mesh><vertices><vertex x="0" y="a" z="0"/></vertices></mesh></object>')),
         "line 1 = could not convert string to float: 'a', expected numbers"),
        (packed(model('<object id="1"><mesh><vertices><vertex x="0" z="0"/></vertices></mesh></object>')), "'y'"),
        (packed(model(TOY.replace('z="2"', 'z="nan"'))), "vertex 3 = [0.0, 0.0, nan]"),
        (packed(model(TOY.replace('v3="3"', 'v3="4"'))), "face 1 = [0, 1, 4], expected"),
        (packed(model(TOY.replace('v3="3"', 'v3="-1"'))), "index -1"),
        (packed(model(TOY.replace('id="1"', 'id="1" pid="5" pindex="' + "9" * 30 + '"'))), "index 99999"),
        (packed(model(TOY * 2)), "object = 1, expected numbers that differ"),
        (packed(model('<basematerials id="5"><base name="a" displaycolor="#FFFF"/></basematerials>')), "colour = #FF"),
        (packed(model('<basematerials id="5"/>' + TOY.replace('id="1"', 'id="1" pid="5" pindex="0"'))),
         "property of triangle 0 = [0, 0, 0], expected entries from 0 to -1"),
        (packed(model(TOY, '<item objectid="1" transform="1 0 0"/>')), "transform 1 0 0"),
        (packed(model(TOY, '<item objectid="1" transform="' + "nan " * 12 + '"/>')),
         "transform nan"),
    ],
)  # fmt: skip
def test_faulty_files_are_refused_in_one_line(mesh_file: Callable[..., Path], data: bytes, said: str) -> None:
    with pytest.raises(LoadError) as caught:
        read_model(mesh_file("bad.3mf", data))
    assert said in str(caught.value) and "bad.3mf: " in str(caught.value)


def test_an_archive_that_claims_too_much_is_refused_before_it_is_unpacked(mesh_file: Callable[..., Path]) -> None:
    bomb = packed(" " * (80 << 20))
    assert len(bomb) < 100_000
    with pytest.raises(LoadError, match="size once unpacked = .* bytes, expected at most"):
        read_model(mesh_file("bad.3mf", bomb))
