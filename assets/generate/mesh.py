"""Triangle meshes with normals, the checks that every built-in one passes, and their binary PLY files."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]


@dataclass(frozen=True)
class Mesh:
    """Positions (V, 3) in metres, unit normals (V, 3), faces (T, 3) counter-clockwise seen from outside; texture
    coordinates (V, 2) where it is finished and has some."""

    positions: Floats
    normals: Floats
    faces: Faces
    coordinates: Floats | None = None


def with_coordinates(mesh: Mesh, coordinates: Floats) -> Mesh:
    """The mesh with texture coordinates (V, 2): the last thing that is done to it."""
    return Mesh(mesh.positions, mesh.normals, mesh.faces, coordinates)


def merged(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of several, their vertices kept apart."""
    parts = list(meshes)
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    return Mesh(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
    )


def transformed(
    mesh: Mesh, rotation: Floats, translation: Iterable[float] = (0.0, 0.0, 0.0), scale: float = 1.0
) -> Mesh:
    """Scaled, then turned by the 3x3 rotation (for column vectors), then moved."""
    positions = scale * mesh.positions @ rotation.T + np.asarray(list(translation))
    return Mesh(positions, mesh.normals @ rotation.T, mesh.faces)


def moved(mesh: Mesh, translation: Iterable[float]) -> Mesh:
    return transformed(mesh, np.eye(3), translation)


def axis_rotation(axis: Iterable[float], angle: float) -> Floats:
    """The right-handed rotation matrix (3, 3) about an axis by an angle in radians (Rodrigues)."""
    x, y, z = np.asarray(list(axis)) / np.linalg.norm(list(axis))
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def face_normals(mesh: Mesh) -> Floats:
    """(T, 3), of length twice the face's area."""
    a, b, c = (mesh.positions[mesh.faces[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a)


def cleaned(mesh: Mesh) -> Mesh:
    """Equal vertices welded, faces without area dropped, every face wound to agree with its vertices' normals.

    Vertices are equal when positions agree to a millionth of the mesh's size and normals to 1/100: a crease stays.
    """
    size = np.ptp(mesh.positions, axis=0).max()
    key = np.column_stack([np.round(mesh.positions / (1e-6 * size)), np.round(mesh.normals * 100)]) + 0.0  # no -0
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")  # vertices stay in the order of their first use
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    kept = first[order]
    mesh = Mesh(mesh.positions[kept], mesh.normals[kept], rank[index.reshape(-1)][mesh.faces])
    mesh = Mesh(mesh.positions, mesh.normals, mesh.faces[_has_area(mesh)])
    agreement = np.einsum("ij,ij->i", face_normals(mesh), mesh.normals[mesh.faces].sum(axis=1))
    return Mesh(mesh.positions, mesh.normals, np.where(agreement[:, None] < 0, mesh.faces[:, ::-1], mesh.faces))


def _has_area(mesh: Mesh) -> NDArray[np.bool_]:
    """Faces that are more than a line: twice the area exceeds 1e-6 of the longest edge's square."""
    corners = mesh.positions[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.linalg.norm(face_normals(mesh), axis=1) > 1e-6 * longest**2


def check(mesh: Mesh) -> None:
    """Refuse what a renderer trips over: ValueError names the fault and how often it occurs."""
    if not np.isfinite(mesh.positions).all() or not np.isfinite(mesh.normals).all():
        raise ValueError("positions and normals must be finite")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.positions):
        raise ValueError("a face points outside of the vertices")
    faults = {
        "normals are not unit": np.abs(np.linalg.norm(mesh.normals, axis=1) - 1) > 1e-5,
        "faces have no area": ~_has_area(mesh),
        "faces are wound against their normals": np.einsum(
            "ij,ikj->ik", face_normals(mesh), mesh.normals[mesh.faces]
        ).sum(axis=1)
        <= 0,
    }
    for fault, where in faults.items():
        if where.any():
            raise ValueError(f"{int(where.sum())} {fault}, the first is {int(np.flatnonzero(where)[0])}")


_VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3)])
_MAPPED = np.dtype([*((name, "<f4", 3) for name in ("position", "normal")), ("coordinates", "<f4", 2)])
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def save_ply(mesh: Mesh, path: Path) -> None:
    """Binary little-endian PLY: x y z nx ny nz, and s t where it has them, as float32, faces as lists of int32."""
    vertices = np.zeros(len(mesh.positions), _VERTEX if mesh.coordinates is None else _MAPPED)
    vertices["position"], vertices["normal"] = mesh.positions, mesh.normals
    names = ["x", "y", "z", "nx", "ny", "nz"]
    if mesh.coordinates is not None:
        vertices["coordinates"] = mesh.coordinates
        names += ["s", "t"]
    faces = np.zeros(len(mesh.faces), _FACE)
    faces["count"], faces["corners"] = 3, mesh.faces
    properties = "".join(f"property float {name}\n" for name in names)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode("ascii") + vertices.tobytes() + faces.tobytes())


def load_ply(path: Path) -> Mesh:
    """Read back what `save_ply` wrote (and nothing else)."""
    header, body = path.read_bytes().split(b"end_header\n", 1)
    counts = [int(line.split()[2]) for line in header.decode("ascii").splitlines() if line.startswith("element")]
    is_mapped = b"property float s\n" in header
    vertices = np.frombuffer(body, _MAPPED if is_mapped else _VERTEX, counts[0])
    faces = np.frombuffer(body, _FACE, counts[1], offset=vertices.nbytes)
    return Mesh(
        vertices["position"].astype(np.float64),
        vertices["normal"].astype(np.float64),
        faces["corners"].astype(np.int64),
        vertices["coordinates"].astype(np.float64) if is_mapped else None,
    )
