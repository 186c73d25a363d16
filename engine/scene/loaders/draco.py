"""Decodes the compressed primitives of KHR_draco_mesh_compression with DracoPy, which is native: it runs where the
program decides (`engine.core.native_decoders`)."""

from __future__ import annotations

import numpy as np

from engine.core.native_decoders import Arrays, DecoderError, decode_natively
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_json import JsonObject

DRACO = "KHR_draco_mesh_compression"
# A stream counts for as many bytes as one of its own: scans take less than a byte for each vertex and face.
_GROWTH = 4


def has_draco(primitive: JsonObject) -> bool:
    """Whether a primitive is compressed."""
    return primitive.has("extensions") and primitive.child("extensions").has(DRACO)


def decode_primitive(file: GltfFile, primitive: JsonObject) -> None:
    """Decode a compressed primitive: its attributes become the rows of their accessors, in `GltfFile.decoded`, and its
    triangles those of its indices. Raises LoadError."""
    compressed = primitive.child("extensions").child(DRACO)
    _, stream = file.buffers.view(compressed)
    file.buffers.n_bytes += (_GROWTH - 1) * len(stream)
    try:
        arrays = decode_natively(decode_draco, stream.tobytes())
    except DecoderError as error:
        raise compressed.error("stream", str(error), "a mesh that Draco compressed") from None
    numbers, attributes = compressed.child("attributes"), primitive.child("attributes")
    for key in numbers.values:
        rows = arrays.get(f"attribute {numbers.integer(key, 0, 2**32 - 1)}")
        if rows is None or rows.ndim != 2:
            raise numbers.error(key, numbers.values[key], "the number of an attribute in the stream")
        if attributes.has(key):
            file.decoded[attributes.integer(key, 0, len(file.accessors) - 1)] = rows
    faces = arrays.get("faces", np.zeros(0))
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise compressed.error("stream", "no triangles", "a mesh")
    if primitive.has("indices"):
        file.decoded[primitive.integer("indices", 0, len(file.accessors) - 1)] = faces.reshape(-1, 1)


def decode_draco(data: bytes) -> Arrays:
    """The faces (F, 3) and each attribute (V, width), by its number; for `decode_natively`."""
    import DracoPy

    mesh = DracoPy.decode(data)
    found = {f"attribute {each['unique_id']}": np.atleast_2d(each["data"]) for each in mesh.attributes}
    return {"faces": np.asarray(getattr(mesh, "faces", np.zeros((0, 3), np.uint32))), **found}
