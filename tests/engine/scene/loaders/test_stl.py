"""STL files, in text and binary: what is read, and how each kind of error is reported."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.scene.loaders.formats import read_model
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import read_mesh

# A tetrahedron, wound outwards.
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def text(faces: list[tuple[int, int, int]] = FACES, name: str = "a vertex of facets") -> str:
    lines = [f"solid {name}"]
    for face in faces:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [" vertex " + " ".join(map(str, CORNERS[k])) for k in face]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""])


def binary(words: list[int] | None = None, header: bytes = b"solid facet", count: int | None = None) -> bytes:
    words = words or [0] * len(FACES)
    facets = [
        struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), word)
        for face, word in zip(FACES, words, strict=True)
    ]
    return header.ljust(80, b"\0") + struct.pack("<I", len(FACES) if count is None else count) + b"".join(facets)


@pytest.mark.parametrize("data", [text(), text().replace("\n", "\r\n"), text().upper(), binary(header=b"made here")])
def test_text_and_binary_hold_the_same_flat_mesh(mesh_file: Callable[..., Path], data: str | bytes) -> None:
    found = read_model(mesh_file("a.stl", data))
    (part,) = found.parts
    assert not part.smooth and part.mesh.normals is None and found.notes == ()  # closed: no note on holes
    assert len(part.mesh.vertices) == 4  # of twelve corners
    np.testing.assert_array_equal(part.mesh.vertices[part.mesh.triangles], CORNERS[np.array(FACES)])


def test_a_binary_file_may_begin_like_a_text(mesh_file: Callable[..., Path]) -> None:
    assert len(read_mesh(mesh_file("a.stl", binary(header=b"solid made here"))).triangles) == 4


def test_several_solids_and_holes(mesh_file: Callable[..., Path]) -> None:
    found = read_model(mesh_file("a.stl", text(FACES[:2], "one") + text(FACES[2:3], "two")))
    assert len(found.parts[0].mesh.triangles) == 3
    assert found.notes == ("the surface is not closed: 1 hole, 3 open edges",)


def test_what_follows_the_last_facet_is_left_out_with_a_note(mesh_file: Callable[..., Path]) -> None:
    found = read_model(mesh_file("a.stl", binary(header=b"x") + b"12345"))
    assert found.notes[0] == "5 bytes after the last facet are left out"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "size = 0 bytes, expected a header of 84 bytes"),
        (b"solid", "size = 5 bytes"),
        (binary(header=b"x")[:-1], "facets = 4, truncated at byte 283, expected at most 3 in these bytes"),
        (binary(header=b"x", count=2**32 - 1), "facets = 4294967295, truncated"),
        (binary(header=b"x", count=0), "facets = 0, expected at least one facet"),
        (text().partition("endsolid")[0], "solids = 1, 0 ends, expected an end for each solid"),
        (
            text().replace("endfacet\n", "", 1),
            "facets = 4 facets, 12 vertices, 3 ends, expected three vertices and an end",
        ),
        (text().replace("vertex 1.0 0.0 0.0\n", "\n", 1), "facets = 4 facets, 11 vertices"),
        (text().replace("1.0", "x", 1), "STL facets = "),
        (text().replace("1.0 ", "", 1), "STL facets = "),
        (text().replace("1.0", "nan", 1), "vertex 1 = [0.0, nan, 0.0], expected finite"),
        (text([]), "expected at least one"),
    ],
)
def test_faulty_files_are_refused_in_one_line(mesh_file: Callable[..., Path], data: str | bytes, said: str) -> None:
    with pytest.raises(LoadError) as caught:
        read_model(mesh_file("bad.stl", data))
    assert said in str(caught.value) and "bad.stl: " in str(caught.value)


def test_every_cut_of_a_file_is_refused(mesh_file: Callable[..., Path]) -> None:
    whole = binary(header=b"x")
    for end in range(0, len(whole), 7):
        with pytest.raises(LoadError):
            read_model(mesh_file("a.stl", whole[:end]))


def test_colours_of_both_conventions(mesh_file: Callable[..., Path]) -> None:
    red, blue = 31 << 10, 31
    colours = read_mesh(mesh_file("viscam.stl", binary([red | 0x8000, blue | 0x8000, 0, 0], b"x"))).colours
    assert colours is not None and (colours[..., 3] == 1.0).all()
    assert colours[:, 0, :3].tolist() == [[1, 0, 0], [0, 0, 1], [1, 1, 1], [1, 1, 1]]  # white where it has none
    # Magics: bits in the other order, and the header's colour where the highest bit is set.
    data = binary([red, 0x8000, blue, 0x8000], b"COLOR=" + bytes([128, 0, 0, 255]))
    colours = read_mesh(mesh_file("magics.stl", data)).colours
    assert colours is not None
    dark = decode_srgb(np.array([128 / 255]))[0]
    np.testing.assert_allclose(colours[:, 0, :3], [[0, 0, 1], [dark, 0, 0], [1, 0, 0], [dark, 0, 0]], rtol=1e-6)
    assert read_mesh(mesh_file("plain.stl", binary([1, 2, 3, 4], b"x"))).colours is None
    header = b"COLOR=" + bytes(4) + b",MATERIAL=" + bytes(12)
    assert [each.name for each in read_model(mesh_file("b.stl", binary(header=header))).unshown] == ["header.MATERIAL"]


@pytest.mark.parametrize("size", [1e-3, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_tiny_huge_and_far_parts_open_whole(mesh_file: Callable[..., Path], size: float, offset: float) -> None:
    lines = text()
    for k, corner in enumerate(CORNERS):
        place = " ".join(f"{v * size + offset:.17g}" for v in corner)
        lines = lines.replace("vertex " + " ".join(map(str, CORNERS[k])), f"vertex {place}")
    scene = load_scene(mesh_file("a.stl", lines), (16, 12))
    assert np.diff(scene.triangle_ranges[0]) == 4 and not scene.smooth[0]
    assert all("without a material" in note for note in scene.notes)
