"""STL files, read by trimesh behind checks of ours: of a text that was cut off it leaves out the last solid, and a
facet's missing vertex it takes from the next one (`test_trimesh`).

A facet is flat, has three corners of its own, and may have a colour of 15 bits, of which there are two conventions:
VisCAM's (blue in the lowest bits; the highest bit is 1 where there is one) and that of Materialise Magics (red in the
lowest bits; the highest bit is 1 where the facet has the colour of the header's COLOR=). Corners at the same place
become one vertex, so that winding and holes can be found. Normals of facets are not used: many programs write zeros.
"""

from __future__ import annotations

import re
import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.vertex_colours import linear_colours
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, mend_mesh, weld_equal_vertices
from engine.scene.mesh_defects import describe_holes

_HEADER, _FACET = 84, 50
_SOLIDS = re.compile(rb"^[ \t]*((?:end)?solid)\b.*$", re.MULTILINE | re.IGNORECASE)
_PIECE = 1 << 24


def read_stl(file: Path) -> ImportedModel:
    """Read a binary or an ASCII STL file; raises LoadError."""
    data = read_regular_file(file, MAX_MESH_BYTES)
    notes: list[str] = []
    colours = None
    try:
        if _is_text(data):
            corners = _read_text(data, file)
        else:
            corners, colours = _read_binary(data, file, notes)
    except LoadError:
        raise
    except Exception as error:  # the library raises ValueError, IndexError and its own
        raise LoadError(file, "STL facets", str(error), "facets of three vertices of three numbers each") from None
    if not len(corners):
        raise LoadError(file, "facets", 0, "at least one facet")
    mesh = Mesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3), colours=colours)
    mesh, mended = mend_mesh(mesh, file)
    mesh = weld_equal_vertices(mesh)
    highlights = UnshownProperty("header.MATERIAL", 1, "highlights and ambient colours of the part")
    return ImportedModel(
        (ImportedPart(mesh, smooth=False),), (*notes, *mended, *describe_holes(mesh)),
        unshown=() if _is_text(data) or b"MATERIAL=" not in data[:80] else (highlights,),
    )  # fmt: skip


def _is_text(data: bytes) -> bool:
    """Whether it is an ASCII file; binary ones may begin with the same word."""
    return (
        data.lstrip()[:5].lower() == b"solid" and re.search(rb"\bfacet\b|\bendsolid\b", data[:4096], re.I) is not None
    )


def _read_text(data: bytes, file: Path) -> npt.NDArray[np.float64]:
    """The corners of all facets (3 T, 3), if each facet has three vertices and an end, and each solid its end."""
    from trimesh.exchange.stl import load_stl_ascii

    solids = _SOLIDS.findall(data)
    ends = sum(word.lower() == b"endsolid" for word in solids)
    if 2 * ends != len(solids):
        raise LoadError(file, "solids", f"{len(solids) - ends}, {ends} ends", "an end for each solid")
    text = _SOLIDS.sub(b"", data).lower()  # names could have any words
    ends, n_corners = text.count(b"endfacet"), text.count(b"vertex")
    facets = text.count(b"facet") - ends
    if ends != facets or n_corners != 3 * facets:
        counts = f"{facets} facets, {n_corners} vertices, {ends} ends"
        raise LoadError(file, "facets", counts, "three vertices and an end for each facet")
    corners, begin = [np.zeros((0, 3))], 0
    while begin < len(text):  # in pieces, because the library needs eight times a text's memory
        end = text.find(b"endfacet", begin + _PIECE)
        end = len(text) if end < 0 else end + len(b"endfacet")
        piece = text[begin:end]
        if wrong := next((each for each in piece.split(b"endfacet")[:-1] if each.count(b"vertex") != 3), None):
            raise LoadError(file, "facet", wrong.strip().decode("ascii", "replace"), "three vertices")
        found = load_stl_ascii(BytesIO(b"solid\n" + piece + b"\nendsolid"))
        corners.append(np.asarray(found.get("vertices", np.zeros((0, 3))), np.float64))
        begin = end
    return np.concatenate(corners)


def _read_binary(
    data: bytes, file: Path, notes: list[str]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32] | None]:
    """The corners of all facets (3 T, 3), and their linear colours (T, 3, 4) where facets have some."""
    from trimesh.exchange.stl import load_stl_binary

    found = load_stl_binary(BytesIO(_checked_binary(data, file, notes)))
    if "vertices" not in found:  # the library's form of no facets
        return np.zeros((0, 3)), None
    words = np.asarray(found["face_attributes"]["stl"], np.uint16)
    return np.asarray(found["vertices"], np.float64), _colours(words, data[:80])


def _checked_binary(data: bytes, file: Path, notes: list[str]) -> bytes:
    """The header and as many facets as it counts."""
    if len(data) < _HEADER:
        raise LoadError(file, "size", f"{len(data)} bytes", f"a header of {_HEADER} bytes, or the text of an STL file")
    (count,) = struct.unpack_from("<I", data, _HEADER - 4)
    there = (len(data) - _HEADER) // _FACET
    if count > there:
        raise LoadError(file, "facets", f"{count}, truncated at byte {len(data)}", f"at most {there} in these bytes")
    end = _HEADER + count * _FACET
    if end < len(data):
        notes.append(f"{len(data) - end} bytes after the last facet are left out")
    return data[:end]


def _colours(words: npt.NDArray[np.uint16], header: bytes) -> npt.NDArray[np.float32] | None:
    """Linear colours of the corners (T, 3, 4) by the words of facets (T,); None where no facet has one."""
    bits = np.stack([words & 31, words >> 5 & 31, words >> 10 & 31], axis=1) / 31.0
    has_mark = (words & 0x8000) != 0
    start = header.find(b"COLOR=")
    if 0 <= start <= 70:
        own = np.frombuffer(header, np.uint8, 3, start + 6) / 255.0
        shares = np.where((has_mark | (words == 0))[:, None], own, bits)
    elif has_mark.any():
        shares = np.where(has_mark[:, None], bits[:, ::-1], 1.0)
    else:
        return None
    return np.repeat(linear_colours(shares)[:, None], 3, axis=1)
