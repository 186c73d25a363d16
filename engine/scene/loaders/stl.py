"""STL files, read by trimesh behind checks of ours: it takes files that were cut off without a word.

A facet is flat, has three corners of its own, and may have a colour of 15 bits, of which there are two conventions:
VisCAM's (blue in the lowest bits; the highest bit is 1 where there is one) and that of Materialise Magics (red in the
lowest bits; the highest bit is 1 where the facet has the colour of the header's COLOR=). Corners at the same place
become one vertex, so that winding and holes can be told. Normals of facets are not used: many programs write zeros.
"""

from __future__ import annotations

import re
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.scene.loaders.model import ImportedModel, ImportedPart
from engine.scene.loaders.vertex_colours import linear_colours
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, mend_mesh, weld_equal_vertices
from engine.scene.mesh_defects import describe_holes

_HEADER, _FACET = 84, 50
_KEYWORDS = re.compile(rb"^[ \t]*(solid|facet|outer|vertex|endloop|endfacet|endsolid)\b", re.MULTILINE | re.IGNORECASE)
_NAMES = re.compile(rb"^([ \t]*(?:end)?solid)\b.*$", re.MULTILINE | re.IGNORECASE)


def read_stl(file: Path) -> ImportedModel:
    """Read a binary or an ASCII STL file; raises LoadError."""
    from trimesh.exchange.stl import load_stl_ascii, load_stl_binary

    data = read_regular_file(file, MAX_MESH_BYTES)
    notes: list[str] = []
    try:
        if _is_text(data):
            found = load_stl_ascii(BytesIO(_checked_text(data, file)))
        else:
            found = load_stl_binary(BytesIO(_checked_binary(data, file, notes)))
    except LoadError:
        raise
    except Exception as error:  # the library raises ValueError, IndexError and its own
        raise LoadError(file, "STL facets", str(error), "facets of three vertices of three numbers each") from None
    solids = [found] if "vertices" in found else [*found["geometry"].values()]
    if not solids:
        raise LoadError(file, "facets", 0, "at least one facet")
    corners = np.concatenate([np.asarray(solid["vertices"], np.float64) for solid in solids])
    mesh = Mesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3), colours=_colours(found, data))
    mesh, mended = mend_mesh(mesh, file)
    mesh = weld_equal_vertices(mesh)
    return ImportedModel((ImportedPart(mesh, smooth=False),), (*notes, *mended, *describe_holes(mesh)))


def _is_text(data: bytes) -> bool:
    """Whether it is an ASCII file; binary ones may begin with the same word."""
    return (
        data.lstrip()[:5].lower() == b"solid" and re.search(rb"\bfacet\b|\bendsolid\b", data[:4096], re.I) is not None
    )


def _checked_text(data: bytes, file: Path) -> bytes:
    """The text without the names of solids, if each facet has three vertices and each solid its end."""
    words = [word.lower() for word in _KEYWORDS.findall(data)]
    counts = {word: words.count(word) for word in (b"facet", b"vertex", b"endfacet", b"solid", b"endsolid")}
    facets = counts[b"facet"]
    if counts[b"endfacet"] != facets or counts[b"vertex"] != 3 * facets:
        found = f"{facets} facets, {counts[b'vertex']} vertices, {counts[b'endfacet']} ends"
        raise LoadError(file, "facets", found, "three vertices and an end for each facet")
    if counts[b"solid"] != counts[b"endsolid"]:
        raise LoadError(file, "solids", f"{counts[b'solid']}, {counts[b'endsolid']} ends", "an end for each solid")
    return _NAMES.sub(rb"\1", data)


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


def _colours(found: dict[str, Any], data: bytes) -> npt.NDArray[np.float32] | None:
    """Linear colours of the corners (T, 3, 4) of a binary file; None where no facet has one."""
    if "face_attributes" not in found:
        return None
    words = np.asarray(found["face_attributes"]["stl"], np.uint16)
    bits = np.stack([words & 31, words >> 5 & 31, words >> 10 & 31], axis=1) / 31.0
    has_mark = (words & 0x8000) != 0
    start = data[:80].find(b"COLOR=")
    if 0 <= start <= 70:
        own = np.frombuffer(data, np.uint8, 3, start + 6) / 255.0
        shares = np.where((has_mark | (words == 0))[:, None], own, bits)
    elif has_mark.any():
        shares = np.where(has_mark[:, None], bits[:, ::-1], 1.0)
    else:
        return None
    return np.repeat(linear_colours(shares)[:, None], 3, axis=1)
