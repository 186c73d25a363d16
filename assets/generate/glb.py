"""GLB 2 files of meshes at rest, and of meshes that hang on joints or have morph targets with an animation of these."""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mesh import Floats, Mesh

_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125}


@dataclass(frozen=True)
class Joint:
    """A joint by its place in the file's frame at rest, and the joint that it hangs on; -1: none."""

    name: str
    place: tuple[float, float, float]
    parent: int = -1


@dataclass(frozen=True)
class Skinned:
    """A mesh in a material of an sRGB-free base colour, and the weight (V, J) that each joint has at each vertex."""

    mesh: Mesh
    weights: Floats
    colour: tuple[float, float, float]
    name: str


@dataclass(frozen=True)
class Motion:
    """Keys of a joint: times (K,), and quaternions (K, 4), x y z w, or translations beyond its place (K, 3)."""

    joint: int
    times: Floats
    values: Floats


@dataclass(frozen=True)
class Shape:
    """A morph target: what it adds to positions (V, 3); normals follow from its triangles."""

    name: str
    positions: Floats


@dataclass(frozen=True)
class Part:
    """A mesh at rest in a metallic-roughness material."""

    mesh: Mesh
    name: str
    colour: tuple[float, float, float]
    metallic: float
    roughness: float


@dataclass
class _Buffer:
    data: bytearray = field(default_factory=bytearray)
    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(self, values: NDArray[Any], kind: str, **more: Any) -> int:
        """The number of a new accessor; values (N,) or (N, W)."""
        rows = np.ascontiguousarray(values.reshape(len(values), -1), kind)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": rows.nbytes})
        what = {"bufferView": len(self.views) - 1, "componentType": _COMPONENTS[kind], "count": len(rows)}
        self.accessors.append({**what, "type": _TYPES[rows.shape[1]], **more})
        self.data += rows.tobytes() + b"\0" * (-rows.nbytes % 4)
        return len(self.accessors) - 1


def save_glb(
    path: Path, parts: Sequence[Skinned], joints: Sequence[Joint], name: str, motions: Sequence[Motion]
) -> None:
    """One node with all meshes, skinned by the four joints that weigh most; the joints' nodes; one animation."""
    buffer = _Buffer()
    places = np.array([joint.place for joint in joints])
    maps = np.tile(np.eye(4), (len(joints), 1, 1))
    maps[:, :3, 3] = -places
    matrices = buffer.add(maps.transpose(0, 2, 1), "<f4")
    tree = {
        "asset": {"version": "2.0", "generator": "insitu"},
        "scene": 0,
        "scenes": [{"nodes": [0, *(i + 1 for i, joint in enumerate(joints) if joint.parent < 0)]}],
        "nodes": [{"name": name, "mesh": 0, "skin": 0}, *_nodes(joints)],
        "meshes": [{"primitives": [_primitive(buffer, part, i) for i, part in enumerate(parts)]}],
        "materials": [_material(part.name, part.colour) for part in parts],
        "skins": [{"joints": [i + 1 for i in range(len(joints))], "inverseBindMatrices": matrices}],
        "animations": [_animation(buffer, name, joints, motions)],
    }
    _write(path, tree, buffer)


def save_morphing_glb(
    path: Path, mesh: Mesh, colour: tuple[float, float, float], shapes: Sequence[Shape], name: str, times: Floats,
    weights: Floats,
) -> None:  # fmt: skip
    """One node with one mesh, and an animation that gives each shape a weight at times (K,): weights (K, N)."""
    buffer = _Buffer()
    primitive = {
        "attributes": {"POSITION": _places(buffer, mesh.positions), "NORMAL": buffer.add(mesh.normals, "<f4")},
        "targets": [{"POSITION": _places(buffer, shape.positions)} for shape in shapes],
        "indices": buffer.add(mesh.faces.ravel(), "<u2" if len(mesh.positions) < 1 << 16 else "<u4"),
        "material": 0,
    }
    bounds = {"min": [float(times.min())], "max": [float(times.max())]}
    keys = {"input": buffer.add(times, "<f4", **bounds), "output": buffer.add(weights.reshape(-1), "<f4")}
    tree = {
        "asset": {"version": "2.0", "generator": "insitu"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"primitives": [primitive], "extras": {"targetNames": [shape.name for shape in shapes]}}],
        "materials": [_material(name, colour)],
        "animations": [
            {"name": name, "samplers": [keys], "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}
        ],
    }
    _write(path, tree, buffer)


def save_parts_glb(path: Path, parts: Sequence[Part]) -> None:
    """One node for each mesh, at rest."""
    buffer, meshes = _Buffer(), []
    for i, part in enumerate(parts):
        attributes = {
            "POSITION": _places(buffer, part.mesh.positions),
            "NORMAL": buffer.add(part.mesh.normals, "<f4"),
        }
        faces = buffer.add(part.mesh.faces.ravel(), "<u2" if len(part.mesh.positions) < 1 << 16 else "<u4")
        meshes.append({"primitives": [{"attributes": attributes, "indices": faces, "material": i}]})
    tree = {
        "asset": {"version": "2.0", "generator": "insitu"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(parts)))}],
        "nodes": [{"name": part.name, "mesh": i} for i, part in enumerate(parts)],
        "meshes": meshes,
        "materials": [_material(part.name, part.colour, part.metallic, part.roughness) for part in parts],
    }
    _write(path, tree, buffer)


def _write(path: Path, tree: dict[str, Any], buffer: _Buffer) -> None:
    tree |= {"accessors": buffer.accessors, "bufferViews": buffer.views, "buffers": [{"byteLength": len(buffer.data)}]}
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer.data), b"BIN\0") + bytes(buffer.data)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def _nodes(joints: Sequence[Joint]) -> list[dict[str, Any]]:
    nodes = []
    for i, joint in enumerate(joints):
        above = joints[joint.parent].place if joint.parent >= 0 else (0.0, 0.0, 0.0)
        node: dict[str, Any] = {"name": joint.name, "translation": np.subtract(joint.place, above).tolist()}
        below = [k + 1 for k, other in enumerate(joints) if other.parent == i]
        nodes.append(node | ({"children": below} if below else {}))
    return nodes


def _primitive(buffer: _Buffer, part: Skinned, material: int) -> dict[str, Any]:
    most = np.argsort(-part.weights, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(part.weights, most, axis=1)
    attributes = {
        "POSITION": _places(buffer, part.mesh.positions),
        "NORMAL": buffer.add(part.mesh.normals, "<f4"),
        "JOINTS_0": buffer.add(most, "<u2"),
        "WEIGHTS_0": buffer.add(weights / weights.sum(axis=1, keepdims=True), "<f4"),
    }
    return {"attributes": attributes, "indices": buffer.add(part.mesh.faces.ravel(), "<u4"), "material": material}


def _places(buffer: _Buffer, positions: Floats) -> int:
    places = positions.astype("<f4")
    return buffer.add(places, "<f4", min=places.min(axis=0).tolist(), max=places.max(axis=0).tolist())


def _material(
    name: str, colour: tuple[float, float, float], metallic: float = 0.0, roughness: float = 0.8
) -> dict[str, Any]:
    surface = {"baseColorFactor": [*colour, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    return {"name": name, "doubleSided": True, "pbrMetallicRoughness": surface}


def _animation(buffer: _Buffer, name: str, joints: Sequence[Joint], motions: Sequence[Motion]) -> dict[str, Any]:
    samplers, channels = [], []
    for motion in motions:
        turns = motion.values.shape[1] == 4
        joint = joints[motion.joint]
        above = joints[joint.parent].place if joint.parent >= 0 else (0.0, 0.0, 0.0)
        values = motion.values if turns else motion.values + np.subtract(joint.place, above)
        times = motion.times.astype("<f4")
        bounds = {"min": [float(times.min())], "max": [float(times.max())]}
        samplers.append({"input": buffer.add(times, "<f4", **bounds), "output": buffer.add(values, "<f4")})
        target = {"node": motion.joint + 1, "path": "rotation" if turns else "translation"}
        channels.append({"sampler": len(samplers) - 1, "target": target})
    return {"name": name, "samplers": samplers, "channels": channels}
