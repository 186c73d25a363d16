"""Small sound glTF files for `formats`: in JSON, and compressed in each way that is read."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np

from tests.engine.scene.conftest import pack_glb
from tests.naive.meshopt_encoder import encode_indices, encode_triangles, encode_vertices


def gltfs(_: Path) -> list[bytes]:
    """A square in JSON with its data inside, quantized, sparse and instanced, beside a camera, another scene, and an
    image out of its folder."""
    places = np.array([[0, 0, 0, 0], [9, 0, 0, 0], [0, 9, 0, 0], [9, 9, 0, 0]], "<i2")
    parts = [
        places.tobytes(), np.array([0, 1, 2, 2, 1, 3], "<u2").tobytes(), b"\1\0\0\0", places[3].tobytes(),
        np.array([[0, 0, 0], [5, 0, 0]], "<f4").tobytes(),
    ]  # fmt: skip
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    views = [{"buffer": 0, "byteOffset": at, "byteLength": len(part)} for at, part in zip(starts, parts, strict=False)]
    views[0]["byteStride"] = 8
    data = "data:application/octet-stream;base64," + base64.b64encode(b"".join(parts)).decode()
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": 3}}
    tree = {
        "asset": {"version": "2.0"}, "extensionsRequired": ["KHR_mesh_quantization"], "scene": 0,
        "scenes": [{"nodes": [0]}, {"nodes": [2], "name": "other"}],
        "nodes": [{"children": [1]}, {"mesh": 0, "scale": [1, -1, 1], "extensions": {
            "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}, {"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "extensions": {"ACME_a": {"b": 1}}}],
        "textures": [{"source": 0}], "images": [{"uri": "../wood.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5122, "normalized": True, "count": 4, "type": "VEC3", "sparse": sparse},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {"bufferView": 4, "componentType": 5126, "count": 2, "type": "VEC3"},
        ],
        "bufferViews": views, "buffers": [{"byteLength": starts[-1], "uri": data}],
    }  # fmt: skip
    return [json.dumps(each, indent=1).encode() for each in (tree, tree | {"scene": 1, "nodes": [{"mesh": 0}] * 3})]


def meshopts(_: Path) -> list[bytes]:
    """A grid whose buffer views are compressed by both versions of the streams, with filters."""
    random = np.random.default_rng(6)
    places = np.stack([*np.mgrid[:5, :5], np.zeros((5, 5), int)], axis=2).reshape(-1, 3)
    corners = [
        i for y in range(4) for x in range(4) for k in [5 * y + x] for i in (k, k + 5, k + 1, k + 1, k + 5, k + 6)
    ]
    normals = np.tile(np.array([0, 0, 127, 0], "i1"), (25, 1))
    exponents = (places.astype("<i4") & 0xFFFFFF).astype("<i4")
    found = []
    for version in (0, 1):
        rows, vectors = exponents.view("u1").reshape(25, 12), normals.view("u1").reshape(25, 4)
        streams = [
            (encode_vertices(rows, version, random), 25, 12, "ATTRIBUTES", "EXPONENTIAL"),
            (encode_vertices(vectors, version, random), 25, 4, "ATTRIBUTES", "OCTAHEDRAL"),
            (encode_triangles(corners, random) if version else encode_indices(corners, random), len(corners), 2,
             "TRIANGLES" if version else "INDICES", "NONE"),
        ]  # fmt: skip
        name = ("EXT_meshopt_compression", "KHR_meshopt_compression")[version]
        starts = np.cumsum([0, *(len(stream) for stream, *_ in streams)]).tolist()
        views = [
            {"buffer": 1, "byteLength": count * stride, "extensions": {name: {
                "buffer": 0, "byteOffset": at, "byteLength": len(stream), "byteStride": stride, "count": count,
                "mode": mode, "filter": filtering}}}
            for at, (stream, count, stride, mode, filtering) in zip(starts, streams, strict=False)
        ]  # fmt: skip
        tree = {
            "asset": {"version": "2.0"}, "extensionsRequired": [name], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 25, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5120, "normalized": True, "count": 25, "type": "VEC3"},
                {"bufferView": 2, "componentType": 5123, "count": len(corners), "type": "SCALAR"},
            ],
            "bufferViews": [view | ({"byteStride": 4} if k == 1 else {}) for k, view in enumerate(views)],
            "buffers": [{"byteLength": starts[-1]}, {"byteLength": 10**6}],
        }  # fmt: skip
        found.append(pack_glb(tree, b"".join(stream for stream, *_ in streams)))
    return found


def dracos(_: Path) -> list[bytes]:
    """A grid that Draco compresses, by its two methods."""
    import DracoPy

    places = np.stack([*np.mgrid[:5, :5], np.zeros((5, 5), int)], axis=2).reshape(-1, 3).astype(np.float32)
    corners = [[k, k + 5, k + 1] for k in range(20) if k % 5 < 4]
    found = []
    for keeps_order in (False, True):
        stream = DracoPy.encode(places, np.array(corners, np.uint32), preserve_order=keeps_order)
        (attribute,) = DracoPy.decode(stream).attributes
        compressed = {"bufferView": 0, "attributes": {"POSITION": attribute["unique_id"]}}
        tree = {
            "asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1,
                                        "extensions": {"KHR_draco_mesh_compression": compressed}}]}],
            "accessors": [{"componentType": 5126, "count": 25, "type": "VEC3"},
                          {"componentType": 5123, "count": 48, "type": "SCALAR"}],
            "bufferViews": [{"buffer": 0, "byteLength": len(stream)}], "buffers": [{"byteLength": len(stream)}],
        }  # fmt: skip
        found.append(pack_glb(tree, stream))
    return found
