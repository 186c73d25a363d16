"""OBJ files: what is read, and how each kind of error is reported."""

import os

import numpy as np
import pytest

from engine.core import safe_files
from engine.core.errors import LoadError
from engine.scene.loaders.formats import read_model
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import read_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def test_polygons_comments_groups_and_negative_indices(mesh_file):
    text = "# a square\no thing\ng side\ns off\nusemtl red\nvt 0 0\n" + SQUARE + "f 1 2 3 4 # all\nf -4 -2 -1\nl 1 2\n"
    mesh = read_mesh(mesh_file("a.obj", text))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 2, 3]]  # −4 counts from the last vertex: the first
    assert mesh.normals is None


def test_lines_go_on_after_a_backslash_and_carriage_returns_are_blanks(mesh_file):
    mesh = read_mesh(mesh_file("a.obj", SQUARE.replace("\n", "\r\n") + "f 1 2 \\\r\n 3\r\n"))
    assert mesh.triangles.tolist() == [[0, 1, 2]]


def test_corners_split_by_normal_but_not_by_texture_coordinate(mesh_file):
    text = SQUARE + "vn 0 0 1\nvn 1 0 0\nvt 0 0\nvt 1 1\nf 1/1/1 2/1/1 3/1/1\nf 1/2/1 3/2/2 4//1\n"
    mesh = read_mesh(mesh_file("a.obj", text))
    # vertex 3 has two normals and becomes two vertices; vertex 1 has two texture coordinates and stays one
    assert len(mesh.vertices) == 5
    corners = mesh.triangles[1]
    assert mesh.normals is not None and mesh.normals[corners].tolist() == [[0, 0, 1], [1, 0, 0], [0, 0, 1]]
    assert mesh.vertices[corners].tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_normals_count_only_if_every_corner_has_one(mesh_file):
    model = read_model(mesh_file("a.obj", SQUARE + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n"))
    assert model.parts[0].mesh.normals is None
    assert model.notes == ("normals are computed: 3 corners of faces have none",)
    assert read_model(mesh_file("a.obj", SQUARE + "vn 0 0 1\nf 1 2 3\n")).notes == ()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "faces = 0, expected at least one line f"),
        (SQUARE, "faces = 0, expected at least one line f"),
        (SQUARE + "f 0 1 2\n", "line 5 = 0, expected indices from 1"),
        (SQUARE + "f 1 2 30000\n", "line 5: v index = 30000, expected an index from 1 to 4"),
        (SQUARE + "f 1 2 100000000000000000000\n", "line 5 = 100000000000000000000, expected indices"),
        (SQUARE + "f 1 2 1e20\n", "line 5 = 1e20, expected indices from 1"),
        (SQUARE + "f 1 2 -5\n", "line 5 = -5, expected v indices from -4 to -1"),
        (SQUARE + "f 1 2 \u0663\n", "line 5 = \u0663, expected indices"),
        (SQUARE + "f 1//1 2//1 3//1\n", "line 5: vn index = 1, expected an index from 1 to 0"),
        (SQUARE + "f 1/1/1/1 2 3\n", "line 5 = 1/1/1/1, expected v, v/vt"),
        (SQUARE + "f 1 2\n", "faces = 0, expected at least one line f"),
        ("v 0 0 nan\n" + SQUARE + "f 1 2 3\n", "vertex 0 = [0.0, 0.0, nan], expected finite"),
        ("v 0 0\n", "line 1 = v 0 0, expected 3 numbers after v"),
        ("v 0 0 x\n", "line 1 = v 0 0 x, expected 3 numbers after v"),
        ("v 0 0 1_0\n", "line 1 = v 0 0 1_0, expected 3 numbers"),
        ("\n\nlorem ipsum dolor\n", "faces = 0, expected at least one line f"),
        ("v 0 0 0\0", "byte 7 = binary data"),
        (SQUARE + "f 1 2 3 \\", "line 5 = \\, expected a line after"),
    ],
)
def test_broken_files_are_named_by_line_and_value(mesh_file, text, line):
    with pytest.raises(LoadError) as caught:
        read_mesh(mesh_file("bad.obj", text))
    assert line in str(caught.value) and "bad.obj: " in str(caught.value)


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../../x.mtl", "C:\\a.mtl", "a b.mtl", "pipe.mtl", "out.mtl", "absent.mtl", "x" * 300]
)
def test_nothing_outside_the_folder_is_opened_for_a_library(tmp_path, mesh_file, monkeypatch, name):
    os.mkfifo(tmp_path / "pipe.mtl")  # opening it without care would hang
    (tmp_path / "out.mtl").symlink_to("/etc/passwd")
    opened = []
    read = safe_files.local_path
    monkeypatch.setattr(safe_files, "local_path", lambda path: opened.append(path) or read(path))
    path = mesh_file("a.obj", f"mtllib {name}\n" + SQUARE + "usemtl red\nf 1 2 3\n")
    found = read_model(path)
    (part,) = found.parts
    assert part.name == "red" and part.layers == () and len(part.mesh.triangles) == 1 and found.notes == ()
    assert opened == [path, tmp_path / "pipe.mtl"] if name == "pipe.mtl" else opened == [path]
    assert found.unread.startswith(name[:40])
    scene = load_scene(path)
    assert scene.notes == (f"a: materials of {found.unread} are not read, shown in a grey that can be edited",)


def test_lines_that_no_standard_has_are_left_out_with_one_note(mesh_file):
    found = read_model(mesh_file("a.obj", "vw 1 2\nvw 3 4\ncurv 0 1 2\n" + SQUARE + "f 1 2 3\nlorem ipsum\n"))
    assert found.notes == ("4 lines of unknown kinds are left out: vw, curv, lorem",)
    assert found.parts[0].mesh.triangles.tolist() == [[0, 1, 2]]
    many = "".join(f"k{k}\n" for k in range(9))
    (note,) = read_model(mesh_file("b.obj", many + SQUARE + "f 1 2 3\n")).notes
    assert note == "9 lines of unknown kinds are left out: k0, k1, k2, k3 and 5 more"


def test_materials_are_parts_by_name(shared_data):
    card, floor = load_scene(shared_data / "cases" / "24-obj-mtl" / "card.obj", (8, 8)).description.objects
    (layer,) = card.layers
    assert (card.name, layer.model, layer.maps.texture) == ("card", "lambert", "card.png")
    assert layer.parameters["albedo"] == (1.0, 1.0, 1.0)


def test_a_library_that_is_not_there_is_one_note(shared_data):
    paths = sorted((shared_data / "cases" / "25-obj-mtllib-paths").glob("*.obj"))
    assert len(paths) == 7
    for path in paths:
        scene = load_scene(path, (8, 8))
        (note,) = scene.notes
        assert "materials of" in note and "not in the OBJ file's folder" in note
        names = [described.name for described in scene.description.objects]
        assert names == ["white", "red", "green", "floor"]


def test_concave_polygons_keep_their_area(shared_data):
    for name in ("L.obj", "L.ply"):
        mesh = read_mesh(shared_data / "cases" / "26-obj-concave" / name)
        corners = mesh.vertices[mesh.triangles]
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.linalg.norm(doubled, axis=1).sum() / 2 == pytest.approx(3.0)  # 2 × 2 less a corner of 1 × 1


def test_random_damage_ends_in_a_mesh_or_one_error(mesh_file):
    rng = np.random.default_rng(3)
    whole = (SQUARE + "vn 0 0 1\nvt 0 0\nf 1/1/1 2//1 3 4 # all\nf -4 -2 \\\n-1\n").encode()
    outcomes = set()
    for _ in range(500):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), 2):
            data[at] = rng.integers(0, 256)
        try:
            outcomes.add(type(read_mesh(mesh_file("a.obj", bytes(data)))).__name__)
        except LoadError as error:
            outcomes.add(type(error).__name__)
    assert outcomes == {"Mesh", "LoadError"}  # never another exception


def test_agrees_with_an_independent_reader(shared_data):
    trimesh = pytest.importorskip("trimesh")
    path = shared_data / "meshes" / "teapot.obj"
    ours, theirs = read_mesh(path), trimesh.load(path, process=False)
    assert np.array_equal(ours.vertices[ours.triangles], theirs.vertices[theirs.faces])


def test_what_no_picture_shows_is_listed(mesh_file):
    model = read_model(mesh_file("a.obj", "o a\ng b\n" + SQUARE + "vp 0 0\nl 1 2\nl 2 3\np 1\nf 1 2 3\nf 1 2\nlod 3\n"))
    assert [(each.name, each.count) for each in model.unshown] == [("l", 2), ("p", 1), ("lod", 1)]
    assert "1 faces of less than 3 corners left out" in model.notes


def test_a_number_sign_inside_a_name_is_no_comment(mesh_file):
    """3ds Max calls materials "Material #25"."""
    mesh_file("a.mtl", "newmtl wood #1\nKd 1 0 0\nnewmtl wood #2 # the other\nKd 0 1 0 # green\n")
    faces = "usemtl wood #1\nf 1 2 3\nusemtl wood #2 # a comment\nf 1 3 4#c\n"
    parts = read_model(mesh_file("a.obj", "mtllib a.mtl\n" + SQUARE + faces)).parts
    assert [(part.name, part.layers[0].parameters["albedo"]) for part in parts] == [
        ("wood #1", (1.0, 0.0, 0.0)), ("wood #2", (0.0, 1.0, 0.0)),
    ]  # fmt: skip


@pytest.mark.parametrize("names", ["a.mtl  b.MTL", "two words.mtl", "c.mtl d.mtl"])
def test_a_line_names_several_libraries_or_one_with_blanks(mesh_file, names):
    for name, material in (("a.mtl", "red"), ("b.MTL", "blue"), ("two words.mtl", "blue"), ("c.mtl d.mtl", "blue")):
        mesh_file(name, f"newmtl {material}\nKd 0.1 0.2 0.3\n")
    model = read_model(mesh_file("a.obj", f"mtllib {names}\n" + SQUARE + "usemtl blue\nf 1 2 3\n"))
    assert model.unread == "" and model.parts[0].layers[0].parameters["albedo"] == (0.1, 0.2, 0.3)
