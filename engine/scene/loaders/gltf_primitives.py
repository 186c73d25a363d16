"""The triangles of one primitive of a glTF file, with what belongs to their corners.

Positions and indices are required; any other attribute that cannot be read is left out, and listed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from engine.scene.loaders.draco import decode_primitive, has_draco
from engine.scene.loaders.gltf_file import INTEGERS, SHARES, GltfFile
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.gltf_unshown import unknown_requirements
from engine.scene.mesh import MAX_COORDINATE, MAX_UV, Float64Array, Mesh, normalize, smooth_normals, validate_mesh

Float32Array = npt.NDArray[np.float32]
Int32Array = npt.NDArray[np.int32]

TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_primitive(file: GltfFile, primitive: JsonObject, uv_sets: Sequence[int]) -> Mesh | None:
    """Read one list, strip or fan of triangles, with these sets of texture coordinates; None if it has none. Raises
    LoadError."""
    attributes = primitive.child("attributes")
    if not attributes.has("POSITION"):
        raise attributes.error("POSITION", "nothing", "an accessor of positions")
    is_compressed = has_draco(primitive)
    if is_compressed:
        decode_primitive(file, primitive)
    _check_positions(file, attributes)
    vertices = file.read_floats(attributes, "POSITION", "VEC3")
    if primitive.has("indices"):
        corners = file.read(primitive, "indices", "SCALAR", INTEGERS).astype(np.int64)[:, 0]
    else:
        corners = np.arange(len(vertices))
    triangles = _triangles(primitive, corners, TRIANGLES if is_compressed else None)
    is_there = (triangles < len(vertices)).all(axis=1)
    if not is_there.all():
        found = f"{np.count_nonzero(~is_there)} with an index that is not from 0 to {len(vertices) - 1}"
        primitive.note("faces", found, "left out")
        triangles = triangles[is_there]
    is_place = np.abs(vertices) <= MAX_COORDINATE  # false for NaN too
    if not is_place.all():
        is_whole = is_place[triangles].all(axis=(1, 2))
        primitive.note("faces", f"{np.count_nonzero(~is_whole)} with a corner that is no number", "left out")
        triangles, vertices = triangles[is_whole], np.where(is_place, vertices, 0.0)
    if not len(triangles):
        primitive.note("faces", 0, "left out")
        return None
    normals = tangents = colours = None
    if attributes.has("NORMAL"):
        read = partial(_read_normals, file, attributes, vertices, triangles)
        normals = attributes.attempt("NORMAL", "faces are flat", read)
    uvs = _read_uvs(file, attributes, uv_sets, len(vertices), triangles)
    if attributes.has("TANGENT") and normals is not None and uvs is not None:  # it needs both [glTF20, 3.7.2.1]
        read_tangents = partial(_read_tangents, file, attributes, len(vertices), triangles)
        tangents = attributes.attempt("TANGENT", "tangents are computed", read_tangents)
    if attributes.has("COLOR_0"):
        read_colours = partial(_read_colours, file, attributes, len(vertices), triangles)
        colours = attributes.attempt("COLOR_0", "colours of vertices do not tint the surface", read_colours)
    mesh = Mesh(vertices, triangles, normals, uvs, tangents, colours)
    return validate_mesh(mesh, file.path, f"{primitive.place}: ")


def _check_positions(file: GltfFile, attributes: JsonObject) -> None:
    """Refuse positions that are nowhere in the file, as where an unknown extension has them."""
    accessor = file.accessors[attributes.integer("POSITION", 0, len(file.accessors) - 1)]
    if not accessor.has("bufferView") and not accessor.has("sparse") and not file.is_decoded(attributes, "POSITION"):
        unknown = unknown_requirements(file.root)
        if unknown:
            raise file.root.error("extensionsRequired", unknown[0], "extensions of geometry that Insitu knows")
        raise accessor.error("bufferView", "nothing", "a view of positions")


def _triangles(primitive: JsonObject, corners: npt.NDArray[np.int64], mode: int | None = None) -> npt.NDArray[np.int32]:
    """Triangles (T, 3) of a list, a strip or a fan [glTF20, 3.7.2.1]; degenerate ones of a strip, which repeat a corner
    to turn it, are dropped. mode: which of them, None as the primitive says."""
    mode, n = mode or primitive.integer("mode", TRIANGLES, _FAN, TRIANGLES), len(corners)
    if mode == TRIANGLES:
        if n % 3:
            primitive.note("indices", f"{n} corners, no multiple of 3", "the last are left out")
        return corners[: n - n % 3].reshape(-1, 3).astype(np.int32)
    i = np.arange(max(n - 2, 0))
    if mode == _STRIP:  # v_i, v_(i + 1 + i mod 2), v_(i + 2 − i mod 2)
        triangles = corners[np.stack([i, i + 1 + i % 2, i + 2 - i % 2], axis=1)]
    else:
        triangles = corners[np.stack([i + 1, i + 2, np.zeros_like(i)], axis=1)]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)].astype(np.int32)


def _rows(file: GltfFile, attributes: JsonObject, key: str, kind: str, n_vertices: int) -> Float64Array:
    """The rows of an attribute, as many as there are positions."""
    values = file.read_floats(attributes, key, kind)
    if len(values) != n_vertices:
        raise attributes.error(key, f"{len(values)} rows", f"{n_vertices}, as there are positions")
    return values


def _read_normals(
    file: GltfFile, attributes: JsonObject, vertices: Float64Array, triangles: Int32Array
) -> Float64Array:
    """Unit normals (V, 3); those that are not finite are computed from the faces around."""
    normals = _rows(file, attributes, "NORMAL", "VEC3", len(vertices))
    is_usable = np.asarray(np.isfinite(normals).all(axis=1))
    around = smooth_normals(vertices, triangles)
    if not is_usable.all():
        attributes.note("NORMAL", f"{np.count_nonzero(~is_usable)} that are no numbers", "computed from the faces")
    return normalize(np.where(is_usable[:, None], normals, around), around)


def _read_uvs(
    file: GltfFile, attributes: JsonObject, sets: Sequence[int], n_vertices: int, triangles: Int32Array
) -> Float32Array | None:
    """Texture coordinates of the corners in these sets, (T, 3, 2 K), in place of one that is not there those of
    another; None if there are none of them."""
    found: list[Float32Array | None] = []
    for key in (f"TEXCOORD_{k}" for k in sets):
        read = partial(_read_uv_set, file, attributes, key, n_vertices)
        lacking = "a texture is laid out by other coordinates, or not shown"
        found.append(attributes.attempt(key, lacking, read) if attributes.has(key) else None)
    there = next((each for each in found if each is not None), None)
    if there is None:
        return None
    if any(each is None for each in found):
        names = ", ".join(f"TEXCOORD_{k}" for k, each in zip(sets, found, strict=True) if each is None)
        attributes.note(names, "nothing", "its textures are laid out by the other coordinates")
    return np.concatenate([there if each is None else each for each in found], axis=1)[triangles]


def _read_uv_set(file: GltfFile, attributes: JsonObject, key: str, n_vertices: int) -> Float32Array:
    """Texture coordinates (V, 2), v flipped to grow upwards: in glTF it grows downwards."""
    uvs = _rows(file, attributes, key, "VEC2", n_vertices).astype(np.float32)
    uvs[:, 1] = np.float32(1.0) - uvs[:, 1]
    is_usable = np.abs(uvs) <= MAX_UV
    if not is_usable.all():
        attributes.note(key, f"{np.count_nonzero(~is_usable)} numbers beyond {MAX_UV:g}", "taken as 0")
        uvs = np.where(is_usable, uvs, np.float32(0.0))
    return uvs


def _read_colours(file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: Int32Array) -> Float32Array:
    """Colours and opacities of the corners, (T, 3, 4), linear [glTF20, 3.7.2.1]; opaque where the file has three
    numbers."""
    accessor = file.accessors[attributes.integer("COLOR_0", 0, len(file.accessors) - 1)]
    kind = "VEC3" if accessor.text("type") == "VEC3" else "VEC4"
    values = file.read_shares(attributes, "COLOR_0", kind, SHARES)
    if len(values) != n_vertices:
        raise attributes.error("COLOR_0", f"{len(values)} colours", f"{n_vertices}, as there are positions")
    colours = np.ones((n_vertices, 4), np.float32)
    # NaN and numbers beyond the largest float become a share as well.
    colours[:, : values.shape[1]] = np.clip(np.nan_to_num(values, nan=1.0), 0.0, 1.0)
    if n_clamped := np.count_nonzero(~((values >= 0.0) & (values <= 1.0))):
        attributes.note("COLOR_0", f"{n_clamped} numbers that are not from 0 to 1", "clamped")
    return colours[triangles]


def _read_tangents(
    file: GltfFile, attributes: JsonObject, n_vertices: int, triangles: Int32Array
) -> Float32Array | None:
    """Tangents and handedness of the corners, (T, 3, 4): bitangents are hand × normal × tangent, in the images' upward
    direction."""
    values = _rows(file, attributes, "TANGENT", "VEC4", n_vertices)
    is_usable = np.isfinite(values).all(axis=1)
    if not is_usable.all():
        attributes.note("TANGENT", f"{np.count_nonzero(~is_usable)} that are no numbers", "all are computed")
        return None
    return np.asarray(values[triangles], np.float32)
