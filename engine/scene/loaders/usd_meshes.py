"""The surfaces of meshes of a USD stage, with their primvars and subsets.

A polygon mesh (`subdivisionScheme = "none"` or `"bilinear"`) has the normals of the file, or flat ones where it has
none. Of a surface by subdivision two steps are shown (`engine.scene.subdivision`), fewer of a large control mesh, with
smooth normals: those of its control mesh mean nothing. Faces that are holes are left out, and faces of a left-handed
mesh are wound the other way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.loaders.usd_prims import Float64Array, Int64Array, UsdPrim, UsdScene
from engine.scene.mesh import (
    MAX_COORDINATE,
    MAX_UV,
    Mesh,
    normalize,
    select_faces,
    smooth_normals,
    validate_mesh,
    without_unused_vertices,
)
from engine.scene.polygons import triangulate
from engine.scene.subdivision import ControlMesh, subdivide, subdivide_values

COLOUR, OPACITY = "primvars:displayColor", "primvars:displayOpacity"
STEPS = 2
MOST_CORNERS = 1 << 20  # of the quads of a mesh once it is subdivided
_INTERPOLATIONS = ("constant", "uniform", "varying", "vertex", "faceVarying")
_FLAT = ("none", "bilinear")
_SMOOTH = "catmullClark"


@dataclass(frozen=True)
class Surface:
    """The triangles of a prim in its own frame, without what belongs to corners; and where the values of its primvars
    stand. triangles (T, 3): as corners of all polygons, after so many steps of subdivision; lengths (N,) and numbers
    (N,) of the polygons that are shown; points and corners (C,): the numbers of their corners in the file; counts: of
    points, polygons and corners there; control: the mesh of the file before these steps, None of a shape."""

    prim: UsdPrim
    mesh: Mesh
    triangles: Int64Array
    lengths: Int64Array
    polygons: Int64Array
    points: Int64Array
    corners: Int64Array
    counts: tuple[int, int, int]
    steps: int = 0
    control: ControlMesh | None = None

    def values(self, owner: UsdPrim, key: str, width: int, interpolation: str = "constant") -> Float64Array | None:
        """The values of a primvar at the corners of all triangles, (T, 3, width); None where there are none. owner: the
        prim that has it; interpolation: where the file does not say it. Raises LoadError."""
        rows = owner.array(key, width)
        if rows is None or not rows.size:
            return None
        rows = rows.reshape(-1, width)
        indices = owner.integers(f"{key}:indices")
        if indices is not None:
            if len(indices) and not 0 <= indices.min() <= indices.max() < len(rows):
                raise owner.error(f"{key}:indices", int(indices.max()), f"indices from 0 to {len(rows) - 1}")
            rows = rows[indices]
        kind = owner.about(key, "interpolation", interpolation)
        if kind not in _INTERPOLATIONS:
            raise owner.error(key, kind, f"interpolation {', '.join(_INTERPOLATIONS)}")
        n_points, n_polygons, n_corners = self.counts
        needed = {"constant": 1, "uniform": n_polygons, "faceVarying": n_corners}.get(kind, n_points)
        if len(rows) < needed:
            raise owner.error(key, f"{len(rows)} values", f"{needed} for interpolation {kind}")
        if kind == "constant":
            return np.broadcast_to(rows[0], (len(self.triangles), 3, width))
        where = {"uniform": np.repeat(self.polygons, self.lengths), "faceVarying": self.corners}.get(kind, self.points)
        found, lengths = rows[where], self.lengths
        for _ in range(self.steps):
            found, lengths = subdivide_values(lengths, found), np.full(len(found), 4)
        return found[self.triangles]

    def of_points(self, rows: Float64Array) -> Float64Array:
        """Rows (P, W) of the points in the file at the vertices (V, W) of the mesh: refined as their places are."""
        if self.steps and self.control is not None:
            refined = replace(self.control, points=rows)
            for _ in range(self.steps):
                refined = subdivide(refined)
            return refined.points
        found = np.zeros((len(self.mesh.vertices), rows.shape[1]))
        found[self.mesh.triangles.ravel()] = rows[self.points[self.triangles.ravel()]]
        return found

    def colours(self, scene: UsdScene) -> npt.NDArray[np.float32] | None:
        """Linear display colours and opacities of the corners (T, 3, 4); None where neither the prim nor one above it
        has them."""
        red, alpha = (self._inherited(scene, key, width) for key, width in ((COLOUR, 3), (OPACITY, 1)))
        if red is None and alpha is None:
            return None
        colours = np.ones((len(self.triangles), 3, 4), np.float32)
        if red is not None:
            colours[..., :3] = np.clip(np.nan_to_num(red, nan=1.0), 0.0, 1.0)
        if alpha is not None:
            colours[..., 3:] = np.clip(np.nan_to_num(alpha, nan=1.0), 0.0, 1.0)
        return colours

    def coordinates(self, scene: UsdScene, names: Sequence[str]) -> npt.NDArray[np.float32] | None:
        """Sets of texture coordinates of the corners (T, 3, 2 S) by the primvars of these names, v upwards, 0 for those
        that are not there; without any, those of the shape."""
        sets = [self._inherited(scene, f"primvars:{name}", 2) for name in names]
        if all(values is None for values in sets):
            return self.mesh.uvs
        nothing = np.zeros((len(self.triangles), 3, 2))
        found = np.concatenate([nothing if values is None else values for values in sets], axis=2)
        is_usable = np.abs(found) <= MAX_UV
        if not is_usable.all():
            n = np.count_nonzero(~is_usable)
            self.prim.note("texture coordinates", f"{n} numbers beyond {MAX_UV:g}", "taken as 0")
        return np.where(is_usable, found, 0.0).astype(np.float32)

    def _inherited(self, scene: UsdScene, key: str, width: int) -> Float64Array | None:
        """A primvar of the prim, or a constant one of the nearest prim above that has it; None, listed, where it is not
        as it should be."""
        owner = scene.owner(self.prim, key)
        if owner is None or (owner is not self.prim and owner.about(key, "interpolation", "constant") != "constant"):
            return None
        try:
            return self.values(owner, key, width)
        except LoadError as error:
            owner.not_shown(key, f"values that cannot be used: {error.reason}")
            return None

    def pieces(self, scene: UsdScene) -> list[tuple[UsdPrim, npt.NDArray[np.bool_]]]:
        """The prims that have the materials, subsets and the mesh for the rest, and which triangles (T,) have each."""
        rest = np.ones(len(self.triangles), bool)
        found: list[tuple[UsdPrim, npt.NDArray[np.bool_]]] = []
        corner = self.triangles[:, 0] // 4**self.steps
        polygon = np.repeat(self.polygons, self.lengths)[corner]
        for subset in scene.children(self.prim):
            if subset.kind != "GeomSubset" or subset.is_off or not subset.material:
                continue
            if subset.word("elementType", "face") != "face":
                subset.not_shown("elementType", "a part of a surface that keeps the material of the whole")
                continue
            subset.mark_read("familyName")
            indices = subset.integers("indices")
            is_own = np.zeros(self.counts[1], bool)
            if indices is not None:
                is_inside = (indices >= 0) & (indices < len(is_own))
                if not is_inside.all():
                    subset.note("indices", int(indices[~is_inside][0]), f"left out: there are {len(is_own)} faces")
                is_own[indices[is_inside]] = True
            chosen = is_own[polygon] & rest
            rest &= ~chosen
            if chosen.any():
                found.append((subset, chosen))
        return [*found, (self.prim, rest)] if rest.any() else found

    def select(
        self, chosen: npt.NDArray[np.bool_], uvs: npt.NDArray[np.float32] | None,
        colours: npt.NDArray[np.float32] | None,
    ) -> Mesh:  # fmt: skip
        """The mesh of some triangles (T,), with these values of the corners of all."""
        mesh = replace(self.mesh, uvs=uvs, colours=colours)
        return mesh if chosen.all() else without_unused_vertices(select_faces(mesh, chosen))


def read_mesh(prim: UsdPrim, n_bytes: int) -> Surface | None:
    """The surface of a mesh; None, with a note, where it has no faces. n_bytes: of the file, which limits the cost.
    Raises LoadError."""
    points = prim.array("points", 3)
    counts, corners = prim.integers("faceVertexCounts"), prim.integers("faceVertexIndices")
    if points is None or counts is None or corners is None or not len(counts):
        prim.note("faces", 0, "left out")
        return None
    if counts.min() < 0 or counts.sum() != len(corners):
        raise prim.error("faceVertexCounts", int(counts.sum()), f"{len(corners)}, as there are faceVertexIndices")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        worst = corners.min() if corners.min() < 0 else corners.max()
        raise prim.error("faceVertexIndices", int(worst), f"indices from 0 to {len(points) - 1}")
    scheme = prim.word("subdivisionScheme", _SMOOTH)
    is_place = np.abs(points) <= MAX_COORDINATE  # false for NaN too
    kept = _shown_polygons(prim, counts, corners, np.asarray(is_place.all(axis=1)))
    points = np.where(is_place, points, 0.0)
    if not kept.any():
        prim.note("faces", f"{len(counts)} without three corners, or holes", "left out")
        return None
    numbers = np.flatnonzero(kept[np.repeat(np.arange(len(counts)), counts)])
    control = _control_mesh(prim, points, counts[kept], corners[numbers], scheme)
    steps, refined = 0, control
    while scheme not in _FLAT and steps < STEPS and 4 * len(refined.corners) <= MOST_CORNERS:
        steps, refined = steps + 1, subdivide(refined)
    if scheme not in _FLAT and (scheme != _SMOOTH or steps < STEPS):
        prim.not_shown("subdivisionScheme", f"a surface by subdivision, shown after {steps} steps of Catmull and Clark")
    lines = list[str]()
    triangles = triangulate(refined.points[refined.corners], refined.lengths, n_bytes, lines.append).astype(np.int64)
    for line in lines:
        prim.note("faces", len(refined.lengths), line)
    if prim.word("orientation", "rightHanded") == "leftHanded":
        triangles = triangles[:, ::-1]
    mesh = Mesh(refined.points, refined.corners[triangles].astype(np.int32))
    surface = Surface(
        prim, mesh, triangles, control.lengths, np.flatnonzero(kept), control.corners, numbers,
        (len(points), len(counts), len(corners)), steps, control,
    )  # fmt: skip
    if scheme in _FLAT:
        mesh = _with_file_normals(surface)
    else:
        prim.mark_read("normals", "primvars:normals", "primvars:normals:indices")
        mesh = replace(mesh, normals=smooth_normals(mesh.vertices, mesh.triangles))
    return replace(surface, mesh=validate_mesh(mesh, prim.file, f"{prim.place}: "))


def _shown_polygons(
    prim: UsdPrim, counts: Int64Array, corners: Int64Array, is_place: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Which polygons (N,) have three corners, all of them at places, and are no holes."""
    kept: npt.NDArray[np.bool_] = counts >= 3
    if not is_place.all():
        n_bad = np.bincount(np.repeat(np.arange(len(counts)), counts), ~is_place[corners], len(counts))
        prim.note("faces", f"{np.count_nonzero(n_bad)} with a corner that is no number", "left out")
        kept &= n_bad == 0
    holes = prim.integers("holeIndices")
    if holes is not None:
        kept[holes[(holes >= 0) & (holes < len(kept))]] = False
    return kept


def _control_mesh(
    prim: UsdPrim, points: Float64Array, lengths: Int64Array, corners: Int64Array, scheme: str
) -> ControlMesh:
    """The control mesh with its creases and corners; without where it is not subdivided."""
    edges, sharpness, own = np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(len(points))
    plain = ControlMesh(points, lengths, corners, edges, sharpness, own)
    chains, n_each, weights = (prim.array(f"crease{name}") for name in ("Indices", "Lengths", "Sharpnesses"))
    ends, sharp = prim.array("cornerIndices"), prim.array("cornerSharpnesses")
    rule = prim.word("interpolateBoundary", "edgeAndCorner")
    prim.mark_read("faceVaryingLinearInterpolation", "triangleSubdivisionRule")
    if scheme in _FLAT:
        return plain
    if ends is not None and sharp is not None and len(ends) == len(sharp):
        inside = (ends >= 0) & (ends < len(points))
        own[ends[inside].astype(np.int64)] = np.nan_to_num(sharp[inside])
    if rule == "edgeAndCorner":  # a point of one face stays
        n_faces = np.bincount(corners, minlength=len(points))
        own[n_faces == 1] = np.inf
    if chains is not None and n_each is not None and weights is not None:
        edges, sharpness = _crease_edges(chains, n_each, weights, len(points))
    return replace(plain, edges=edges, sharpness=sharpness, point_sharpness=own)


def _crease_edges(
    indices: Float64Array, lengths: Float64Array, sharpness: Float64Array, n_points: int
) -> tuple[Int64Array, Float64Array]:
    """The edges (K, 2) of creases, chains of points, and the sharpness of each (K,): a chain has one for all its edges
    or one for each. Nothing where the numbers do not fit."""
    of, n = indices.astype(np.int64), lengths.astype(np.int64)
    nothing = np.zeros((0, 2), np.int64), np.zeros(0)
    if not len(n) or n.min() < 2 or n.sum() != len(of) or of.min() < 0 or of.max() >= n_points:
        return nothing
    is_edge = np.ones(len(of), bool)
    is_edge[np.cumsum(n) - 1] = False
    starts = np.flatnonzero(is_edge)
    sharp = np.repeat(sharpness, n - 1) if len(sharpness) == len(n) else sharpness
    if len(sharp) != len(starts):
        return nothing
    return np.stack([of[starts], of[starts + 1]], axis=1), np.nan_to_num(np.maximum(sharp, 0.0))


def _with_file_normals(surface: Surface) -> Mesh:
    """The mesh with the normals of the file; without where it has none that can be used. Vertices are split where their
    corners have normals that differ."""
    prim, mesh = surface.prim, surface.mesh
    key = "primvars:normals" if prim.has("primvars:normals") else "normals"
    if key != "normals":
        prim.mark_read("normals")  # the primvar replaces them
    try:
        values = surface.values(prim, key, 3, "vertex")
    except LoadError as error:
        prim.not_shown(key, f"normals that cannot be used: {error.reason}")
        values = None
    if values is None:
        return mesh
    points = mesh.triangles.reshape(-1)
    if prim.about(key, "interpolation", "vertex") in ("vertex", "varying"):
        of_points = np.zeros_like(mesh.vertices)
        of_points[points] = values.reshape(-1, 3)
        return _with_usable_normals(prim, key, replace(mesh, normals=of_points))
    rows = np.empty((len(points), 4), np.float32)
    rows[:, :3], rows[:, 3] = values.reshape(-1, 3), points.view(np.float32)
    _, first, vertex = np.unique(rows.view("V16").ravel(), return_index=True, return_inverse=True)
    triangles = vertex.reshape(-1, 3).astype(np.int32)
    split = Mesh(mesh.vertices[points[first]], triangles, values.reshape(-1, 3)[first])
    return _with_usable_normals(prim, key, split)


def _with_usable_normals(prim: UsdPrim, key: str, mesh: Mesh) -> Mesh:
    """The mesh with unit normals; those that are no numbers are computed from the faces."""
    assert mesh.normals is not None
    around = smooth_normals(mesh.vertices, mesh.triangles)
    is_usable = np.asarray(np.isfinite(mesh.normals).all(axis=1))
    if not is_usable.all():
        prim.note(key, f"{np.count_nonzero(~is_usable)} that are no numbers", "computed from the faces")
    return replace(mesh, normals=normalize(np.where(is_usable[:, None], mesh.normals, around), around))
