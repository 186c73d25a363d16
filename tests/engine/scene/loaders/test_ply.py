"""PLY files, ASCII and binary: what is read, and how each kind of error is reported."""

import struct

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.formats import read_model
from tests.engine.scene.conftest import read_mesh

POSITIONS = "property float x\nproperty float y\nproperty float z\n"
FACES = "property list uchar int vertex_indices\n"


def header(kind: str, n_vertices: object = 4, n_faces: object = 1, vertex: str = POSITIONS, face: str = FACES) -> str:
    return (
        f"ply\nformat {kind} 1.0\ncomment made here\nelement vertex {n_vertices}\n{vertex}"
        f"element face {n_faces}\n{face}end_header\n"
    )


CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
ASCII_CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def binary(order: str, faces: bytes, **counts) -> bytes:
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    body = b"".join(struct.pack(order + "3f", *corner) for corner in CORNERS)
    return header(kind, **counts).encode() + body + faces


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_files_of_both_byte_orders(mesh_file, order):
    mesh = read_mesh(mesh_file("a.ply", binary(order, struct.pack(order + "B4i", 4, 0, 1, 2, 3))))
    assert mesh.vertices.tolist() == [list(c) for c in CORNERS]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]  # a quad is a fan of two
    assert mesh.normals is None


def test_polygons_of_different_size_in_binary(mesh_file):
    faces = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3) + struct.pack("<B3i", 3, 1, 2, 3)
    mesh = read_mesh(mesh_file("a.ply", binary("<", faces, n_faces=3)))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [1, 2, 3]]  # in the order of the file


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_faces_of_less_than_three_corners_are_left_out_with_their_colours(mesh_file, kind):
    face = FACES + "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    rows = [((0, 1), 9), ((0, 1, 2), 255), ((), 9), ((0, 2, 3), 0)]
    if kind == "ascii":
        lines = "".join(f"{len(own)} {' '.join(map(str, own))} {red} 255 0\n" for own, red in rows)
        data = header("ascii", 4, 4, face=face) + ASCII_CORNERS + lines
    else:
        parts = [struct.pack(f"<B{len(own)}i3B", len(own), *own, red, 255, 0) for own, red in rows]
        data = binary("<", b"".join(parts), n_faces=4, face=face)
    model = read_model(mesh_file("a.ply", data))
    (part,) = model.parts
    assert part.mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert part.mesh.colours[:, 0].tolist() == [[1, 1, 0, 1], [0, 1, 0, 1]]
    assert model.notes == ("2 faces of less than 3 corners left out",)


def test_ascii_with_normals_colours_and_other_elements(mesh_file):
    vertex = POSITIONS + "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n"
    text = (
        header("ascii", 3, 1, vertex).replace("end_header", "element edge 1\nproperty int a\nend_header")
        + "0 0 0 0 0 2 255\r\n1 0 0 0 0 2 255\n\n0 1 0 0 0 2 0\n3 0 1 2\n7\n"
    )
    mesh = read_mesh(mesh_file("a.ply", text))
    assert mesh.normals is not None and mesh.normals[1].tolist() == [0, 0, 2]  # as in the file, not yet unit
    assert mesh.triangles.tolist() == [[0, 1, 2]]


def test_ascii_polygons_of_different_size(mesh_file):
    mesh = read_mesh(mesh_file("a.ply", header("ascii", 4, 2) + ASCII_CORNERS + "4 0 1 2 3\n3 1 2 3\n"))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "first line = , expected ply"),
        ("plyx\n", "first line = plyx"),
        ("PK\x03\x04", "first line = "),
        ("ply\nformat ascii 1.0\n", "header = no end_header"),
        ("ply\nelement vertex 3\nend_header\n", "header = no format"),
        (header("ascii_2"), "line 2 = format ascii_2 1.0"),
        (header("ascii", -1), "line 4: count = -1, expected a number from 0"),
        (header("ascii", 10**12), "line 4: count = 1000000000000, expected a number from 0"),
        (header("ascii", "x"), "line 4: count = x"),
        (header("ascii", 10**9) + ASCII_CORNERS, "rows in the body = 4, expected 1000000001 rows"),
        (header("ascii", 4, 1) + ASCII_CORNERS, "rows in the body = 4, expected 5 rows"),
        (header("ascii", 4, 1) + "0 0 0\n1 0\n1 1 0\n0 1 0\n3 0 1 2\n", "line 12 = 1 0, expected 3 numbers"),
        (header("ascii", 4, 1) + "0 0 0\n1 0 x\n1 1 0\n0 1 0\n3 0 1 2\n", "line 12 = 1 0 x, expected numbers"),
        (header("ascii", 4, 1) + "0 0 0\n1 0 1_0\n1 1 0\n0 1 0\n3 0 1 2\n", "line 12 = 1 0 1_0, expected numbers"),
        (header("ascii", 4, 1) + "0 0 0\n1 0 nan\n1 1 0\n0 1 0\n3 0 1 2\n", "vertex 1 = [1.0, 0.0, nan], expected"),
        (header("ascii", 4, 1) + "0 0 0\n1 0 1e999\n1 1 0\n0 1 0\n3 0 1 2\n", "vertex 1 = [1.0, 0.0, inf], expected"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 4\n", "face 0 = 4, expected indices from 0 to 3"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 -1\n", "face 0 = -1, expected indices from 0 to 3"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 1e20\n", "face 0 = 1e+20, expected indices"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 1.5\n", "face 0 = 1.5, expected indices"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 nan\n", "face 0 = nan, expected indices"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "2 0 1\n", "faces = 0, expected at least one face"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "-3 0 1 2\n", "line 15 = -3 0 1 2, expected a list length"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "1000000000 0 1 2\n", "line 15 = 1000000000 0 1 2, expected a list"),
        (header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 2 3\n", "line 15 = 3 0 1 2 3, expected 4 numbers"),
        (header("ascii", 4, 0) + ASCII_CORNERS, "faces = 0, expected at least one face"),
        (header("ascii", 0, 1) + "3 0 1 2\n", "face 0 = 0, expected indices from 0 to -1"),
        (header("ascii", 4, 1, "property float x\nproperty float y\n"), "rows in the body = 0"),
        (header("ascii", 1, 0, "property float x\nproperty float y\n") + "0 0\n", "element vertex = missing"),
        (header("ascii", 4, 1, face="property int vertex_indices\n") + ASCII_CORNERS + "3\n", "element face = no list"),
        (header("ascii", 4, 1, face="property list float int vertex_indices\n"), "line 9 = property list float int"),
    ],
)
def test_broken_ascii_files_are_named_by_line_and_value(mesh_file, text, line):
    with pytest.raises(LoadError) as caught:
        read_mesh(mesh_file("bad.ply", text))
    assert line in str(caught.value) and "bad.ply: " in str(caught.value)


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (binary("<", b""), "element face = 1 rows, truncated at byte"),
        (binary("<", struct.pack("<B2i", 3, 0, 1)), "of its first row = 3, expected a length that fits"),
        (binary("<", b"", n_vertices=10**9), "element vertex = 1000000000 rows, truncated at byte"),
        (binary("<", struct.pack("<B3i", 3, 0, 1, 2), n_faces=2 * 10**9), "truncated at byte"),
        (binary("<", struct.pack("<B3i", 255, 0, 1, 2)), "a length that fits the file"),
        (binary("<", struct.pack("<B3i", 3, 0, 1, 4)), "face 0 = 4, expected indices from 0 to 3"),
        (binary("<", struct.pack("<B3i", 3, 0, 1, -2)), "face 0 = -2, expected indices from 0 to 3"),
        (
            header("binary_little_endian", 3, 1).encode()
            + struct.pack("<9f", *[0] * 4, float("nan"), *[0] * 4)
            + struct.pack("<B3i", 3, 0, 1, 2),
            "vertex 1 = [0.0, nan, 0.0], expected finite",
        ),
    ],
)
def test_broken_binary_files_are_named(mesh_file, data, line):
    with pytest.raises(LoadError) as caught:
        read_mesh(mesh_file("bad.ply", data))
    assert line in str(caught.value)


def test_every_cut_of_a_binary_file_is_refused(mesh_file):
    whole = binary("<", struct.pack("<B4i", 4, 0, 1, 2, 3) + struct.pack("<B3i", 3, 0, 1, 2), n_faces=2)
    assert len(read_mesh(mesh_file("a.ply", whole)).triangles) == 3
    for end in range(len(whole)):
        with pytest.raises(LoadError):
            read_mesh(mesh_file("a.ply", whole[:end]))


def test_random_damage_ends_in_a_mesh_or_one_error(mesh_file):
    rng = np.random.default_rng(1)
    whole = binary("<", struct.pack("<B4i", 4, 0, 1, 2, 3))
    outcomes = set()
    for _ in range(400):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(0, 256)
        try:
            mesh = read_mesh(mesh_file("a.ply", bytes(data)))
            assert np.isfinite(mesh.vertices).all() and mesh.triangles.max() < len(mesh.vertices)
            outcomes.add("mesh")
        except LoadError:
            outcomes.add("error")
    assert outcomes == {"mesh", "error"}  # never another exception


def test_other_types_are_refused_by_name(mesh_file):
    for name in ("a.zip", "a.ply.bz2", "a"):
        with pytest.raises(LoadError, match="expected a mesh of type .glb, .gltf, .*, .obj, .ply, .stl, .off, .3mf"):
            read_mesh(mesh_file(name, b"PK\x03\x04"))


def test_agrees_with_an_independent_reader(shared_data):
    trimesh = pytest.importorskip("trimesh")
    path = shared_data / "meshes" / "dragon_res3.ply"
    ours, theirs = read_mesh(path), trimesh.load(path, process=False)
    first = np.sort(np.unique(np.sort(theirs.faces, axis=1), axis=0, return_index=True)[1])
    assert len(theirs.faces) - len(first) == 1254  # that file has so many faces twice
    assert np.array_equal(ours.triangles, theirs.faces[first])
    assert np.abs(ours.vertices - theirs.vertices).max() < 1e-7  # they round ASCII numbers to float32


def test_what_follows_the_last_element_is_left_out_with_a_note(mesh_file):
    whole = binary("<", struct.pack("<B3i", 3, 0, 1, 2))
    for end, notes in (
        (b"", ()),
        (b"\n", ()),
        (b"\r\n", ()),
        (b"more", ("4 bytes after the last element are left out",)),
    ):
        found = read_model(mesh_file("a.ply", whole + end))
        assert found.notes == notes and found.parts[0].mesh.triangles.tolist() == [[0, 1, 2]]
    text = header("ascii", 4, 1) + ASCII_CORNERS + "3 0 1 2\n3 0 1 2\n\n7\n"
    found = read_model(mesh_file("b.ply", text))
    assert found.notes == ("2 lines after the last element are left out",) and len(found.parts[0].mesh.triangles) == 1


@pytest.mark.parametrize("order", ["<", ">"])
def test_strips_of_triangles(mesh_file, order):
    """Every other triangle of a strip is wound the other way in the file; -1, or the next list, begins another."""
    strips = struct.pack(order + "i8i", 8, 0, 1, 3, 2, -1, 0, 1, 2) + struct.pack(order + "i5i", 5, 3, 2, 2, 1, 0)
    data = binary(order, strips, n_faces=2, face="property list int int vertex_indices\n")
    mesh = read_mesh(mesh_file("a.ply", data.replace(b"element face", b"element tristrips")))
    assert mesh.triangles.tolist() == [[0, 1, 3], [3, 1, 2], [0, 1, 2], [2, 1, 0]]
    outside = binary(order, struct.pack(order + "i3i", 3, 0, 1, -2), face="property list int int vertex_indices\n")
    with pytest.raises(LoadError, match="tristrips 0 = -2, expected indices from -1 to 3"):
        read_mesh(mesh_file("a.ply", outside.replace(b"element face", b"element tristrips")))


def test_variants_that_other_programs_write_open(shared_data):
    paths = sorted((shared_data / "cases" / "27-ply").glob("*.ply"))
    assert len(paths) == 8
    for path in paths:
        found = read_model(path)
        assert found.notes == ()
        if path.stem not in ("mirror", "multi"):  # cubes 2 m wide
            corners = found.parts[0].mesh.vertices[found.parts[0].mesh.triangles]
            doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            assert np.linalg.norm(doubled, axis=1).sum() / 2 == pytest.approx(24.0)
            # All wound outwards, or all inwards: the volume by the divergence theorem is that of the cube.
            assert abs((corners[:, 0] * doubled).sum() / 6) == pytest.approx(8.0)


def test_the_image_of_a_comment_is_the_texture(tmp_path, mesh_file):
    from PIL import Image

    Image.new("RGB", (2, 2), (200, 100, 50)).save(tmp_path / "a b.png")
    vertex = POSITIONS + "property float s\nproperty float t\n"
    rows = "".join(f"{x} {y} {z} {x} {y}\n" for x, y, z in CORNERS) + "4 0 1 2 3\n"
    for comment, texture, note in (
        ("TextureFile a b.png", "a b.png", None), ("TextureFile C:\\scans\\A B.PNG", "a b.png", None),
        ("TextureFile gone.png", None, "image gone.png is not shown: file = not there"), ("made here", None, None),
    ):  # fmt: skip
        text = header("ascii", 4, 1, vertex).replace("comment made here", f"comment {comment}") + rows
        found = read_model(mesh_file("a.ply", text))
        assert [layer.maps.texture for layer in found.parts[0].layers] == ([texture] if texture else []), comment
        assert len(found.notes) == (note is not None) and (note is None or found.notes[0].startswith(note))
    bare = header("ascii", 4, 1).replace("comment made here", "comment TextureFile a b.png")
    found = read_model(mesh_file("a.ply", bare + ASCII_CORNERS + "4 0 1 2 3\n"))
    assert found.notes == ("image a b.png is not shown: there are no texture coordinates",)


PER_FACE = FACES + "property list uchar float texcoord\nproperty int texnumber\n"


@pytest.mark.parametrize("order", ["", "<"])
def test_texture_coordinates_and_images_of_faces(tmp_path, mesh_file, order):
    """As MeshLab and scanners write them: a quad and a triangle that shows a second image."""
    from PIL import Image

    for name in ("one.png", "two.png"):
        Image.new("RGB", (2, 2)).save(tmp_path / name)
    quad, other = (0, 0, 1, 0, 1, 1, 0, 0.5), (0.25, 0, 0.5, 0, 0.5, 0.75)
    kind = "binary_little_endian" if order else "ascii"
    text = header(kind, 4, 2, face=PER_FACE)
    text = text.replace("comment made here", "comment TextureFile one.png\ncomment TextureFile two.png")
    if order:
        rows = b"".join(struct.pack("<3f", *corner) for corner in CORNERS)
        rows += struct.pack("<B4iB8fi", 4, 0, 1, 2, 3, 8, *quad, 0) + struct.pack("<B3iB6fi", 3, 0, 2, 3, 6, *other, 1)
        file = mesh_file("a.ply", text.encode() + rows)
    else:
        lines = ASCII_CORNERS + f"4 0 1 2 3 8 {' '.join(map(str, quad))} 0\n"
        file = mesh_file("a.ply", text + lines + f"3 0 2 3 6 {' '.join(map(str, other))} 1\n")
    found = read_model(file)
    assert found.notes == () and found.unshown == ()
    one, two = found.parts
    assert [part.layers[0].maps.texture for part in found.parts] == ["one.png", "two.png"]
    assert [part.name for part in found.parts] == ["one", "two"]
    assert one.mesh.uvs.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 0.5]]]
    assert two.mesh.uvs.tolist() == [[[0.25, 0], [0.5, 0], [0.5, 0.75]]]
    assert two.mesh.vertices[two.mesh.triangles[0]].tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_faces_without_coordinates_have_those_of_the_corner(tmp_path, mesh_file):
    face = FACES + "property list uchar float texcoord\n"
    text = header("ascii", 4, 2, face=face) + ASCII_CORNERS + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 0\n"
    (part,) = read_model(mesh_file("a.ply", text)).parts
    assert part.mesh.uvs.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0]] * 3]
