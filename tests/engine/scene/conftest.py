"""Small scene folders, mesh files and GLB containers made on the spot."""

import json
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.scene.loaders.formats import read_model
from engine.scene.mesh import Mesh, join_meshes
from tests.scene_text import camera, placed

VIEW = camera((0, 0, 3), 40, (32, 24))
CARD = placed("card", "quad")
TOY = placed("toy", "model.glb")  # of the container that `glb_file` writes
TRIANGLE_PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[..., Path]:
    """scene_file(objects, view) writes a scene and returns its path."""

    def write(objects: str = CARD, view: str = VIEW) -> Path:
        path = tmp_path / "scene.toml"
        path.write_text(view + objects)
        return path

    return write


def n_calls(work: Callable[[], object]) -> int:
    """Calls of functions, Python's and C's, until it ends."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def read_mesh(path: Path) -> Mesh:
    """The triangles of a file, of all its parts."""
    parts = read_model(path).parts
    return parts[0].mesh if len(parts) == 1 else join_meshes([part.mesh for part in parts])


@pytest.fixture
def mesh_file(tmp_path: Path) -> Callable[[str, str | bytes], Path]:
    """mesh_file(name, content) writes a file beside the scene."""

    def write(name: str, content: str | bytes) -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def pack_glb(tree: object, binary: bytes = b"", text: bytes | None = None) -> bytes:
    """A GLB 2 container around a JSON tree (or a text in its place) and a binary chunk."""
    payload = json.dumps(tree).encode() if text is None else text
    payload += b" " * (-len(payload) % 4)
    chunks = struct.pack("<II", len(payload), 0x4E4F534A) + payload
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.fixture
def triangle_glb() -> tuple[dict, bytes]:
    """The JSON tree and the binary chunk of one triangle (0,0,0) (1,0,0) (0,1,0): to be spoilt by tests."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    indices = np.array([0, 1, 2], "<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "buffers": [{"byteLength": 42}],
    }
    return tree, positions + indices


@pytest.fixture
def glb_file(mesh_file: Callable) -> Callable[..., Path]:
    """glb_file(tree, binary, text) writes model.glb."""

    def write(tree: object, binary: bytes = b"", text: bytes | None = None) -> Path:
        return mesh_file("model.glb", pack_glb(tree, binary, text))

    return write
