"""Positions, normals and tangents of the points that camera rays hit, turned so that the camera sees them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import Footprints, pixel_footprints

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]

# Of a shading normal to wo; and of the mirror direction of wo to the face, at most as a share of that of wo.
LEAST_COSINE = 1e-3
_LEAST_MIRROR, _MIRROR_SHARE = 0.025, 0.9


def shading_frames(
    scene: Scene, caster: RayCaster, found: Intersections, ids: Int32Array, rays: npt.NDArray[np.integer],
    wo: Float32Array,
    places: tuple[Float64Array, tuple[int, int]] | None = None,
) -> dict[str, Float32Array]:  # fmt: skip
    """Position, normals, tangents and wo of the points (P,) that some `rays` (P,) of those found hit; those of the
    coat's frame where it differs from the base's.

    ids (R,): `object_ids` of all; wo (P, 3): back along the rays. Named and oriented as in `PrimaryHits`. places:
    positions (P, 2) of the rays in a picture of that resolution, over whose pixels bumps are averaged; None for other
    rays.
    """
    triangle, ids = found.triangle[rays], ids[rays]
    u, v = found.u[rays].astype(np.float64), found.v[rays].astype(np.float64)
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    corners = scene.triangles[triangle]
    position = np.einsum("pk,pki->pi", weights, scene.vertices[corners].astype(np.float64))
    geometric = scene.geometric_normals[triangle].astype(np.float64)
    interpolated = np.einsum("pk,pki->pi", weights, scene.normals[corners].astype(np.float64))
    length = np.linalg.norm(interpolated, axis=1, keepdims=True)
    usable = scene.smooth[ids][:, None] & (length > 1e-4)
    shading = np.where(usable, interpolated / np.where(usable, length, 1.0), geometric)
    geometric = turned_to(geometric, wo)
    horizon = _bend_towards_camera(turned_to(shading, geometric), wo)
    horizon = _raise_mirror(horizon, geometric, wo)
    normal = _perturbed(scene, found, rays, horizon, wo, places) if scene.bump_normals.objects else horizon
    of_coat = dict[str, Float64Array]()
    if (coated := scene.in_coat_frame) is not None:
        smooth = _perturbed(coated, found, rays, horizon, wo, places) if coated.bump_normals.objects else horizon
        of_coat = {"coat_normal": smooth, "coat_tangent": _tangents(coated, found, rays, ids, smooth, places)}
    vectors = {
        "position": position,
        "offset_position": caster.offset_origins(position, geometric),
        "horizon": horizon,
        "normal": normal,
        "geometric_normal": geometric,
        "tangent": _tangents(scene, found, rays, ids, normal, places),
        "wo": wo,
        **of_coat,
    }
    return {name: np.ascontiguousarray(vector, dtype=np.float32) for name, vector in vectors.items()}


def _perturbed(
    scene: Scene, found: Intersections, rays: npt.NDArray[np.integer], normals: Float64Array,
    wo: Float32Array,
    places: tuple[Float64Array, tuple[int, int]] | None,
) -> Float64Array:  # fmt: skip
    """Normals (P, 3) of hits, perturbed by the scene's bumps."""
    bumpy = np.flatnonzero(np.isin(scene.object_of_triangle[found.triangle[rays]], scene.bump_normals.objects))
    hit = found.of(rays[bumpy])
    footprints = None if places is None else pixel_footprints(scene, hit, places[0][bumpy], places[1])
    out = normals.copy()
    out[bumpy] = scene.bump_normals.perturb(hit.triangle, hit.u, hit.v, normals[bumpy], wo[bumpy], footprints)
    return out


def _tangents(
    scene: Scene, found: Intersections, rays: npt.NDArray[np.integer], ids: npt.NDArray[np.integer],
    normals: Float64Array, places: tuple[Float64Array, tuple[int, int]] | None,
) -> Float64Array:  # fmt: skip
    """Tangents (P, 3) of hits on objects ids (P,), rotated by angles and maps."""
    hits = found.of(rays)

    def footprints(rows: npt.NDArray[np.integer]) -> Footprints:
        assert places is not None
        return pixel_footprints(scene, hits.of(rows), places[0][rows], places[1])

    return scene.tangent_rotations.tangents(ids, normals, hits, None if places is None else footprints)


def turned_to(normals: Float64Array, side: npt.NDArray[np.floating]) -> Float64Array:
    """Flip normals to a side: the face's to the camera's, the shading normal to the face's."""
    return np.where(np.einsum("pk,pk->p", normals, side)[:, None] < 0.0, -normals, normals)


def _bend_towards_camera(normals: Float64Array, wo: Float32Array) -> Float64Array:
    """Bend unit normals that lean away from the camera until they are perpendicular to wo.

    Along silhouettes an interpolated normal may point behind a face that the camera sees. Flipped by its own sign, as
    in two-sided materials that use only the shading frame, it would face into the body: a dark dot in the picture.
    """
    along = np.einsum("pk,pk->p", normals, wo)[:, None]
    bent = normals + np.maximum(LEAST_COSINE - along, 0.0) * wo
    return np.where(along < LEAST_COSINE, bent / np.linalg.norm(bent, axis=1, keepdims=True), normals)


def _raise_mirror(normals: Float64Array, faces: Float64Array, wo: Float32Array) -> Float64Array:
    """Bend unit normals whose mirror direction of wo lies behind the face, so that it lies a little above it.

    Along silhouettes interpolated normals mirror wo into the body, which hides all that gloss reflects there; where a
    coat dims what lies under it, that left dark flecks. The bent normal is the half vector of wo and the raised
    direction, as in Cycles (`ensure_valid_specular_reflection`).
    """
    along, facing = (np.einsum("pk,pk->p", each, wo)[:, None] for each in (normals, faces))
    mirror = 2.0 * along * normals - wo
    height = np.einsum("pk,pk->p", mirror, faces)[:, None]
    least = np.minimum(_MIRROR_SHARE * facing, _LEAST_MIRROR)
    raised = mirror + (least - height) * faces
    bent = wo + raised / np.linalg.norm(raised, axis=1, keepdims=True)
    length = np.linalg.norm(bent, axis=1, keepdims=True)
    return np.where((height < least) & (length > 1e-6), bent / np.where(length > 1e-6, length, 1.0), normals)
