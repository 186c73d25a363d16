"""Triangle meshes as arrays: normals, winding, copies under transforms. The single entry point for geometry files is
`loaders.formats.read_model`; each mesh passes `validate_mesh`: finite, indices in range, small enough to square.

trimesh reads STL files, behind checks of ours. Other formats have readers of ours, because trimesh 5.2 reads what files
do not say (`test_trimesh` shows each). Of files with faults in our tests it takes 5 of 18 OBJ, 12 of 39 PLY and 19 of
54 GLB; with `validate_mesh` behind it, still 4 OBJ and 3 PLY. To tell these apart, a check has to read each number of
each line; what remains for the library is less than what it does differently: it counts an OBJ file's relative indices
from its end, splits vertices along seams of textures, fans concave polygons, rejects binary PLY files with polygons of
different size, drops colours of OFF files, and takes an OFF file that was cut off. GLB files lose skins, morph targets
and transforms of textures. `loaders.threemf` says what becomes of 3MF. `loaders.dae` of COLLADA.

CPU seconds for 100,000 triangles, ours and trimesh's, on a busy machine: binary PLY 0.02 and 0.03, ASCII PLY 0.50 and
0.28, OBJ 0.44 and 0.25, OFF 0.6 and 0.28, binary STL 0.10 and 0.04, ASCII STL 1.0 and 0.54, 3MF 0.28. A million take
0.5 to 13 s and at most 1.0 GB; trimesh alone takes 2.0 GB for a million in an ASCII STL file. Its import takes 0.5 s.
pygltflib 1.16 accepts 49 of those 54 GLB files, and makes an object of each JSON value: 50 s for a megabyte of empty
materials, where we promise 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError

MATERIAL_ENDING = ".mtlx"  # of files that have materials alone
USD_ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
MESH_ENDINGS = (
    ".glb", ".gltf", *USD_ENDINGS, ".obj", ".ply", ".stl", ".off", ".3mf", ".dae", MATERIAL_ENDING,
)  # fmt: skip
MAX_MESH_BYTES = 512 * 2**20
MAX_COORDINATE = 1e12
# Steps of the mesh's size within which positions are equal: three such numbers fit into 63 bits.
_STEPS = 2**21 - 1
MAX_UV = 1e4  # beyond, single precision no longer resolves texels
# What belongs to the corners of triangles, and its values where a mesh without it is joined to others.
_FILL = {"uvs": (0.0,) * 2, "tangents": (0.0,) * 4, "colours": (1.0,) * 4}

Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Mesh:
    """Vertices (V, 3) float64, normals (V, 3) float64 of any length or None, triangles (T, 3) int32, counter-clockwise.

    uvs (T, 3, 2 K) float32 or None: texture coordinates of each triangle's corners, v upwards, in K sets side by side
    (`TextureTransform.uv_set`). They belong to corners and not to vertices, so that a seam of a texture splits no
    vertex and bends no normal. tangents (T, 3, 4) float32 or None: likewise, the direction in which u grows, and the
    handedness 1 or −1: v grows along handedness × normal × tangent; 0 where the file has no tangent. colours (T, 3, 4)
    float32 or None: likewise, linear red, green, blue and opacity in [0, 1], by which the base colour is multiplied
    [glTF20, 3.9.2].
    """

    vertices: Float64Array
    triangles: Int32Array
    normals: Float64Array | None = None
    uvs: npt.NDArray[np.float32] | None = None
    tangents: npt.NDArray[np.float32] | None = None
    colours: npt.NDArray[np.float32] | None = None

    @property
    def corner_values(self) -> dict[str, npt.NDArray]:
        """What belongs to corners, (T, 3, ...), by field: those of uvs, tangents and colours that are there."""
        named = {name: getattr(self, name) for name in _FILL}
        return {name: values for name, values in named.items() if values is not None}


def mend_mesh(mesh: Mesh, file: Path) -> tuple[Mesh, list[str]]:
    """The mesh of a file without normals and texture coordinates that cannot be shown, and notes on these; raises
    LoadError where it cannot be used at all.

    Normals that are not finite are computed from the faces around; texture coordinates beyond single precision become
    0.
    """
    validate_mesh(replace(mesh, normals=None, uvs=None), file)
    notes = []
    if mesh.normals is not None and not (usable := np.asarray(np.isfinite(mesh.normals).all(axis=1))).all():
        notes.append(f"{np.count_nonzero(~usable)} normals that are no numbers are computed from the faces")
        around = smooth_normals(mesh.vertices, mesh.triangles)
        mesh = replace(mesh, normals=np.where(usable[:, None], mesh.normals, around))
    if mesh.uvs is not None and not (inside := np.abs(mesh.uvs) <= MAX_UV).all():
        notes.append(f"{np.count_nonzero(~inside)} texture coordinates beyond {MAX_UV:g} are taken as 0")
        mesh = replace(mesh, uvs=np.where(inside, mesh.uvs, np.float32(0.0)))
    return mesh, notes


def validate_mesh(mesh: Mesh, file: Path, place: str = "") -> Mesh:
    """Return the mesh if it can be used; raises LoadError naming the first invalid vertex or face.

    place is prepended to the message, for files that contain several meshes.
    """
    if not len(mesh.triangles):
        raise LoadError(file, f"{place}faces", 0, "at least one face")
    usable = np.abs(mesh.vertices) <= MAX_COORDINATE  # false for NaN too
    if not usable.all():
        k = int(np.argmin(usable.all(axis=1)))
        expected = f"finite numbers up to {MAX_COORDINATE:g}"
        raise LoadError(file, f"{place}vertex {k}", mesh.vertices[k].tolist(), expected)
    inside = (mesh.triangles >= 0) & (mesh.triangles < len(mesh.vertices))
    if not inside.all():
        k = int(np.argmin(inside.all(axis=1)))
        expected = f"indices from 0 to {len(mesh.vertices) - 1}"
        raise LoadError(file, f"{place}face {k}", mesh.triangles[k].tolist(), expected)
    if mesh.normals is not None and not np.isfinite(mesh.normals).all():
        k = int(np.argmin(np.isfinite(mesh.normals).all(axis=1)))
        raise LoadError(file, f"{place}normal {k}", mesh.normals[k].tolist(), "finite numbers")
    if mesh.uvs is not None and not (np.abs(mesh.uvs) <= MAX_UV).all():
        k = int(np.argmin((np.abs(mesh.uvs) <= MAX_UV).all(axis=(1, 2))))
        expected = f"finite numbers up to {MAX_UV:g}"
        raise LoadError(file, f"{place}texture coordinates of face {k}", mesh.uvs[k].tolist(), expected)
    if mesh.tangents is not None and not np.isfinite(mesh.tangents).all():
        k = int(np.argmin(np.isfinite(mesh.tangents).all(axis=(1, 2))))
        raise LoadError(file, f"{place}tangents of face {k}", mesh.tangents[k].tolist(), "finite numbers")
    if mesh.colours is not None and not (is_share := (mesh.colours >= 0.0) & (mesh.colours <= 1.0)).all():
        k = int(np.argmin(is_share.all(axis=(1, 2))))
        raise LoadError(file, f"{place}colours of face {k}", mesh.colours[k].tolist(), "numbers from 0 to 1")
    return mesh


def cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """Cross products (..., 3), bit by bit those of NumPy, whose own function takes 0.1 ms for a single one: a scene may
    contain thousands of small meshes."""
    after, before = [1, 2, 0], [2, 0, 1]
    return a[..., after] * b[..., before] - a[..., before] * b[..., after]


def face_normals(
    vertices: npt.NDArray[np.floating], triangles: Int32Array
) -> tuple[Float64Array, npt.NDArray[np.bool_]]:
    """Unit normals (T, 3) by winding, and which faces have an area at all (the others get a zero normal).

    A face has no area if |e1 × e2| ≤ 1e-12 · (longest edge)².
    """
    corners = vertices[triangles].astype(np.float64)
    edges = corners[:, (1, 2, 0)] - corners
    normal = cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(normal, axis=1)
    longest = (edges**2).sum(axis=2).max(axis=1)
    solid = length > 1e-12 * longest
    normals = np.zeros_like(normal)
    normals[solid] = normal[solid] / length[solid, None]
    return normals, solid


def has_area(mesh: Mesh) -> bool:
    """Whether any face has an area; a few tell it of nearly all meshes."""
    return any(face_normals(mesh.vertices, faces)[1].any() for faces in (mesh.triangles[:100], mesh.triangles))


def smooth_normals(vertices: npt.NDArray[np.floating], triangles: Int32Array) -> Float64Array:
    """Unit vertex normals (V, 3): face normals weighted by the angle at the vertex [ThurmerWuthrich98].

    Vertices without a face, or whose faces cancel, get +Y.
    """
    flat, _ = face_normals(vertices, triangles)
    corners = vertices[triangles].astype(np.float64)
    total = np.zeros((len(vertices), 3))
    for k in range(3):
        one = corners[:, (k + 1) % 3] - corners[:, k]
        two = corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(cross(one, two), axis=1), (one * two).sum(axis=1))
        for axis in range(3):
            total[:, axis] += np.bincount(triangles[:, k], flat[:, axis] * angle, len(vertices))
    return normalize(total, fallback=(0.0, 1.0, 0.0))


def normalize(vectors: Float64Array, fallback: tuple[float, float, float] | Float64Array) -> Float64Array:
    """Normalize vectors (N, 3); those shorter than 1e-12 of the longest become the fallback."""
    scale = np.abs(vectors).max(axis=1, keepdims=True)
    shrunk = vectors / np.where(scale > 0, scale, 1.0)  # squares neither overflow nor underflow
    length = np.linalg.norm(shrunk, axis=1, keepdims=True)
    unit = shrunk / np.where(length > 0, length, 1.0)
    return np.where(_are_short(vectors)[:, None], np.asarray(fallback, np.float64), unit)


def _are_short(vectors: Float64Array) -> npt.NDArray[np.bool_]:
    """Which vectors (N, 3) are too short relative to the longest to have a direction."""
    scale = np.abs(vectors).max(axis=1)
    return scale <= 1e-12 * scale.max(initial=0.0)


def with_flat_normals(mesh: Mesh) -> tuple[Mesh, npt.NDArray[np.int32]]:
    """The mesh with flat normals: each face has three vertices of its own; and the original indices of these (3 T,)."""
    vertices = mesh.triangles.ravel()
    flat, _ = face_normals(mesh.vertices, mesh.triangles)
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    facets = replace(mesh, vertices=mesh.vertices[vertices], triangles=triangles, normals=np.repeat(flat, 3, axis=0))
    return facets, vertices


def with_normals(mesh: Mesh) -> Mesh:
    """The mesh itself, or, if it has no normals, with smooth ones and consistent winding in each shell."""
    if mesh.normals is not None:
        return mesh
    inconsistent = inconsistent_faces(mesh.vertices, mesh.triangles)[:, None]
    if inconsistent.any():
        corners = {
            name: np.where(inconsistent[..., None], own[:, ::-1], own) for name, own in mesh.corner_values.items()
        }
        mesh = replace(mesh, triangles=np.where(inconsistent, mesh.triangles[:, ::-1], mesh.triangles), **corners)
    return replace(mesh, normals=smooth_normals(mesh.vertices, mesh.triangles))


def place_copies(mesh: Mesh, matrices: npt.NDArray[np.float64]) -> Mesh:
    """Copies of a mesh under affine transforms (N, 4, 4) as one mesh, with unit normals if it has normals.

    Normals are transformed by the inverse transpose (here the cofactor matrix det(A) A⁻ᵀ, which needs no division). A
    mirroring transform reverses the winding, so that fronts stay fronts and geometric and vertex normals agree.
    """
    linear = matrices[:, :3, :3]
    vertices = (mesh.vertices @ linear.swapaxes(1, 2) + matrices[:, None, :3, 3]).reshape(-1, 3)
    cofactor = cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
    mirrored = np.einsum("nk,nk->n", linear[:, 0], cofactor[:, 0]) < 0.0
    starts = np.arange(len(matrices), dtype=np.int32) * len(mesh.vertices)
    triangles = (
        _reverse_mirrored([mesh.triangles] * len(matrices), mirrored) + np.repeat(starts, len(mesh.triangles))[:, None]
    )
    copies = {name: [own] * len(matrices) for name, own in mesh.corner_values.items()}
    if mesh.tangents is not None:
        copies["tangents"] = [*_transform_tangents(mesh.tangents, linear, mirrored)]
    corners = {name: _reverse_mirrored(each, mirrored) for name, each in copies.items()}
    if mesh.normals is None:
        return Mesh(vertices, triangles, None, **corners)
    sign = np.where(mirrored, -1.0, 1.0) / np.abs(cofactor).max(axis=(1, 2))
    normals = (mesh.normals @ (cofactor * sign[:, None, None]).swapaxes(1, 2)).reshape(-1, 3)
    fallback = smooth_normals(vertices, triangles) if _are_short(normals).any() else np.array([0.0, 1.0, 0.0])
    return Mesh(vertices, triangles, normalize(normals, fallback), **corners)


def _reverse_mirrored(copies: Sequence[npt.NDArray], mirrored: npt.NDArray[np.bool_]) -> npt.NDArray:
    """Values at the corners of copies of triangles (T, 3, ...), in reversed order for mirrored ones."""
    return np.concatenate(
        [each[:, ::-1] if is_mirrored else each for each, is_mirrored in zip(copies, mirrored, strict=True)]
    )


def _transform_tangents(
    tangents: npt.NDArray[np.float32], linear: Float64Array, mirrored: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float32]:
    """Tangents (T, 3, 4) under each linear transform (N, 3, 3), (N, T, 3, 4); a mirror changes the handedness."""
    along = np.einsum("nij,tcj->ntci", linear, tangents[..., :3].astype(np.float64))
    length = np.linalg.norm(along, axis=3, keepdims=True)
    handedness = np.where(mirrored, -1.0, 1.0)[:, None, None, None] * np.sign(tangents[..., 3:])
    return np.concatenate([along / np.where(length > 0.0, length, 1.0), handedness], axis=3).astype(np.float32)


def join_meshes(meshes: list[Mesh]) -> Mesh:
    """Join several meshes; those without normals get smooth ones if any other has its own (see `with_normals`), those
    without texture coordinates (0, 0), those with fewer sets of them their first set again, those without colours
    white."""
    if not meshes:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3)))
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    normals = None
    if any(mesh.normals is not None for mesh in meshes):
        meshes = [with_normals(mesh) for mesh in meshes]
        normals = np.concatenate([mesh.normals for mesh in meshes if mesh.normals is not None])
    shifted = [mesh.triangles + int(start) for mesh, start in zip(meshes, starts[:-1], strict=True)]
    triangles = np.concatenate(shifted).astype(np.int32)
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    counts = [len(mesh.triangles) for mesh in meshes]
    corners = {name: join_corners([getattr(mesh, name) for mesh in meshes], counts, name) for name in _FILL}
    return Mesh(vertices, triangles, normals, **corners)


def join_corners(
    values: Sequence[npt.NDArray[np.float32] | None], counts: Sequence[int], name: str
) -> npt.NDArray[np.float32] | None:
    """Values at the corners (T, 3, ...) of several meshes with these numbers of triangles: uvs, tangents or colours, by
    name; None where no mesh has them."""
    if all(own is None for own in values):
        return None
    fill = _FILL[name]
    empty = np.asarray(fill, np.float32)
    every = [
        np.broadcast_to(empty, (n, 3, len(fill))) if own is None else own for own, n in zip(values, counts, strict=True)
    ]
    most = max(each.shape[2] for each in every)
    n_lacking = [(most - each.shape[2]) // len(fill) for each in every]
    filled = [
        np.concatenate([each, np.tile(each[..., : len(fill)], n)], axis=2) if n else each
        for each, n in zip(every, n_lacking, strict=True)
    ]
    return np.ascontiguousarray(np.concatenate(filled), np.float32)


def select_faces(mesh: Mesh, chosen: npt.NDArray[np.bool_ | np.integer]) -> Mesh:
    """The mesh with some of its faces only, by a mask (T,) or by their numbers."""
    corners = {name: own[chosen] for name, own in mesh.corner_values.items()}
    return replace(mesh, triangles=mesh.triangles[chosen], **corners)


def without_unused_vertices(mesh: Mesh) -> Mesh:
    """The mesh without vertices that no face has."""
    used, triangles = np.unique(mesh.triangles, return_inverse=True)
    normals = None if mesh.normals is None else mesh.normals[used]
    corners: Int32Array = triangles.astype(np.int32).reshape(-1, 3)
    return replace(mesh, vertices=mesh.vertices[used], triangles=corners, normals=normals)


def weld_equal_vertices(mesh: Mesh) -> Mesh:
    """The mesh without normals, in which vertices at the very same position are one.

    trimesh's own merging was rejected: it rounds to 1e-8, whatever the size of the mesh, and reorders faces.
    """
    ids = position_ids(mesh.vertices)
    _, first = np.unique(ids, return_index=True)
    triangles: Int32Array = ids.astype(np.int32)[mesh.triangles]
    return replace(mesh, vertices=mesh.vertices[first], triangles=triangles, normals=None)


def position_ids(vertices: Float64Array) -> npt.NDArray[np.int64]:
    """Indices (V,), equal for vertices at the very same position, without gaps from 0."""
    order = np.lexsort(vertices.T)
    ids = np.empty(len(vertices), np.int64)
    ids[order] = np.cumsum((np.diff(vertices[order], axis=0, prepend=np.nan) != 0.0).any(axis=1)) - 1
    return ids


def inconsistent_faces(vertices: Float64Array, triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Which triangles (T, 3) must be reversed, (T,), so that each shell is oriented consistently. Vertices (V, 3) at
    equal positions count as one, as along the seams of textures.

    Normals averaged over faces of opposite orientation cancel, and leave patches without a direction. So each shell is
    oriented consistently before they are averaged. Every face is in a graph twice, as it is and reversed; two faces
    that share an edge are joined in the states that agree, and the components of that graph are the shells, each of
    them twice, in linear time [HopcroftTarjan73]. A shell keeps the orientation of the larger part of its area. Edges
    of three or more faces join none, and a Möbius strip, both of whose states are one component, is left unchanged.
    """
    # Late: the window's process imports no SciPy.
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    n, corners = len(triangles), _weld_vertices(vertices)[triangles]
    start, end = corners, corners[:, (1, 2, 0)]
    low, high = np.minimum(start, end).ravel(), np.maximum(start, end).ravel()
    key = np.where(low == high, -1, low * (int(corners.max(initial=0)) + 1) + high)  # −1: an edge without length
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1) != 0)
    pairs = first[(np.diff(first, append=len(order)) == 2) & (key[order[first]] >= 0)]
    one, two = order[pairs], order[pairs + 1]
    agree = (start < end).ravel()[one] != (start < end).ravel()[two]  # they run along the edge in opposite directions
    a, b = one // 3, two // 3
    at, other = np.concatenate([a, a + n]), np.concatenate([np.where(agree, b, b + n), np.where(agree, b + n, b)])
    graph = sparse.coo_matrix((np.ones(len(at), bool), (at, other)), (2 * n, 2 * n))
    _, shell = connected_components(graph, directed=False)
    places = vertices[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]), axis=1)
    area_of_shell = np.bincount(shell[:n], area, int(shell.max(initial=0)) + 1)
    return np.asarray(area_of_shell[shell[:n]] < area_of_shell[shell[n:]])


def _weld_vertices(vertices: Float64Array) -> npt.NDArray[np.int64]:
    """Indices (V,), equal for vertices at equal positions."""
    low = vertices.min(axis=0)
    size = float((vertices - low).max()) or 1.0
    x, y, z = np.rint((vertices - low) / size * _STEPS).astype(np.int64).T
    return np.unique((x << 42) + (y << 21) + z, return_inverse=True)[1].ravel()
