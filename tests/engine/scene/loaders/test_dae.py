"""COLLADA files: axes, units, transforms, polygons, materials, and what is listed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.scene.loaders.dae import read_dae
from engine.scene.loaders.model import ImportedModel
from engine.scene.scene_loader import load_scene

# A square of 2 with texture coordinates, as a polygon of four corners.
MESH = """<mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 2 0 0 2 2 0 0 2 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="n"><float_array id="na" count="3">0 0 1</float_array><technique_common>
<accessor source="#na" count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="t"><float_array id="ta" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
<accessor source="#ta" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist material="m" count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#n" offset="1"/><input semantic="TEXCOORD" source="#t" offset="2" set="0"/>
<vcount>4</vcount><p>0 0 0 1 0 1 2 0 2 3 0 3</p></polylist>{lines}</mesh>"""
PHONG = """<phong><emission><color>0 0 0 1</color></emission><diffuse>{diffuse}</diffuse>
<specular><color>0.25 0.25 0.25 1</color></specular><shininess><float>30</float></shininess></phong>"""
WHOLE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>{up}</up_axis></asset>
<library_images><image id="i"><init_from>a%20b.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="q"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c">{shading}</technique></profile_COMMON></effect></library_effects>
<library_materials><material id="mat" name="Red paint"><instance_effect url="#e"/></material></library_materials>
<library_lights><light id="l"><technique_common><point><color>1 1 1</color></point></technique_common></light>
</library_lights>
<library_geometries><geometry id="g" name="card">{mesh}</geometry></library_geometries>
<library_visual_scenes><visual_scene id="all">{nodes}<node id="lamp"><instance_light url="#l"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#all"/></scene></COLLADA>"""
BIND = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#mat"/>
</technique_common></bind_material></instance_geometry>"""


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., ImportedModel]:
    """read(up, unit, nodes, diffuse, lines) reads a file with these."""

    def make(
        up: str = "Y_UP", unit: str = "", nodes: str = f"<node>{BIND}</node>",
        diffuse: str = "<color>0.5 0.1 0.1 1</color>", lines: str = "",
    ) -> ImportedModel:  # fmt: skip
        text = WHOLE.format(
            up=up, unit=unit, nodes=nodes, shading=PHONG.format(diffuse=diffuse), mesh=MESH.format(lines=lines)
        )
        (tmp_path / "a.dae").write_text(text)
        return read_dae(tmp_path / "a.dae")

    return make


def test_a_polygon_with_its_material(read: Callable[..., ImportedModel]) -> None:
    model = read()
    (part,) = model.parts
    assert part.name == "Red paint" and len(part.mesh.triangles) == 2 and part.mesh.normals is not None
    assert part.mesh.uvs is not None and sorted(map(tuple, part.mesh.uvs.reshape(-1, 2).tolist()))[0] == (0.0, 0.0)
    np.testing.assert_allclose(
        part.mesh.uvs.reshape(-1, 2) * 2.0, part.mesh.vertices[part.mesh.triangles].reshape(-1, 3)[:, :2]
    )
    base, gloss = part.layers
    # 8 Ks / (Ns + 2) is a sixteenth: together with Kd less than 1.
    assert base.parameters["albedo"] == (0.5, 0.1, 0.1)
    assert gloss.parameters["exponent"] == 30.0 and gloss.parameters["scale"] == (0.0625,) * 3
    assert [(each.name, each.count) for each in model.unshown] == [("lights", 1)]


def test_concave_polygons_keep_their_area(tmp_path: Path) -> None:
    # An arrowhead: the third corner of the square is drawn to its inside, so that a fan about the second covers more.
    mesh = MESH.format(lines="").replace("0 0 0 2 0 0 2 2 0 0 2 0", "0 0 0 2 0 0 0.5 0.5 0 0 2 0")
    mesh = mesh.replace("0 0 0 1 0 1 2 0 2 3 0 3", "1 0 1 2 0 2 3 0 3 0 0 0")
    white = PHONG.format(diffuse="<color>1 1 1 1</color>")
    text = WHOLE.format(up="Y_UP", unit="", nodes=f"<node>{BIND}</node>", shading=white, mesh=mesh)
    (tmp_path / "a.dae").write_text(text)
    found = read_dae(tmp_path / "a.dae").parts[0].mesh
    corners = found.vertices[found.triangles]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (areas > 0.0).all() and areas.sum() == pytest.approx(1.0)  # two triangles of base 2 and height 0.5


@pytest.mark.parametrize(("up", "third"), [("Y_UP", [2, 2, 0]), ("Z_UP", [2, 0, -2]), ("X_UP", [-2, 2, 0])])
def test_axes_and_units(read: Callable[..., ImportedModel], up: str, third: list[float]) -> None:
    model = read(up, '<unit name="centimeter" meter="0.01"/>')
    corners = model.parts[0].mesh.vertices.tolist()
    assert any(np.allclose(corner, np.array(third) * 0.01) for corner in corners)


def test_nodes_place_copies_and_mirrors_stay_outside_out(read: Callable[..., ImportedModel]) -> None:
    inner = f"<node><scale>-1 1 1</scale>{BIND}</node>"
    (part,) = read(nodes=f"<node><translate>10 0 0</translate>{inner}</node><node>{BIND}</node>").parts
    assert len(part.mesh.triangles) == 4
    assert part.mesh.vertices[:, 0].min() == 0.0 and part.mesh.vertices[:, 0].max() == 10.0
    corners = part.mesh.vertices[part.mesh.triangles]
    winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (winding > 0.0).all() and part.mesh.normals is not None and (part.mesh.normals[:, 2] > 0.0).all()


def test_an_image_beside_the_file(read: Callable[..., ImportedModel], tmp_path: Path) -> None:
    (part,) = (missing := read(diffuse='<texture texture="q" texcoord="UV"/>')).parts
    assert not part.layers[0].maps.texture and any("a%20b.png" in note for note in missing.notes)
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "a b.png")
    (part,) = read(diffuse='<texture texture="q" texcoord="UV"/>').parts
    assert part.layers[0].maps.texture == "a b.png" and part.layers[0].parameters["albedo"] > (0.9,) * 3
    assert load_scene(tmp_path / "a.dae").description.objects[0].layers[0].maps.texture == "a b.png"


def test_lines_are_listed(read: Callable[..., ImportedModel]) -> None:
    lines = '<lines count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1</p></lines>'
    assert {each.name: each.count for each in read(lines=lines).unshown} == {"lights": 1, "lines": 1}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "COLLADA"), ("<a/>", "COLLADA"), ("<COLLADA", "COLLADA"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><COLLADA/>', "a document type, expected none"),
        (WHOLE.format(up="Y_UP", unit="", nodes="", shading="", mesh=""), "faces = 0"),
        (WHOLE.format(up="Y_UP", unit='<unit meter="1e30"/>', nodes=f"<node>{BIND}</node>",
                      shading=PHONG.format(diffuse="<color>1 1 1 1</color>"), mesh=MESH.format(lines="")), "unit"),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.dae").write_text(text)
    with pytest.raises(LoadError) as caught:
        read_dae(tmp_path / "a.dae")
    assert said in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("more", "is_read"), [(0, True), (-(1 << 20), False)])
def test_copies_are_limited_by_the_files_size(
    read: Callable[..., ImportedModel], monkeypatch: pytest.MonkeyPatch, more: int, is_read: bool
) -> None:
    """Four vertices and two faces, five times, in a file of some 3,000 bytes."""
    monkeypatch.setattr("engine.scene.loaders.dae.MOST_COPIED", more)
    nodes = f"<node>{BIND}</node>" * 5
    if is_read:
        assert len(read(nodes=nodes).parts[0].mesh.triangles) == 10
    else:
        with pytest.raises(LoadError, match="vertices and faces of all copies = 30, expected at most"):
            read(nodes=nodes)


def test_meshes_under_flat_transforms_are_left_out_with_a_note(read: Callable[..., ImportedModel]) -> None:
    flat = f"<node><scale>0 0 1</scale>{BIND}</node>"
    model = read(nodes=f"<node>{BIND}</node>{flat}")
    assert len(model.parts[0].mesh.triangles) == 2
    assert model.notes == ("meshes under flat transforms, as two scales of 0, are left out",)
    with pytest.raises(LoadError, match="faces = 0"):
        read(nodes=flat)
