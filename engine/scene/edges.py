"""Antialiasing: finds pixels that need several shading points, and chooses these points.

A pixel needs more than its centre if one of its eight neighbours shows another object, if the angle between
neighbouring normals exceeds a limit, or if a surface breaks off between them: at silhouettes and creases, and on rims
and ridges whose highlights are narrower than a pixel. Such pixels get n rays. Hits that are alike (one object, one
plane, normals within that angle) share one point, which represents their share of the pixel: half of the pixels along
an edge need just one more point, however many rays located the edge, and inside objects nothing is added. The centre
keeps its point, so that a picture with edges has all the points of one without.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from engine.scene import _hit_kernels as kernels

if TYPE_CHECKING:
    from engine.scene.primary_hits import PrimaryHits

Float32Array = npt.NDArray[np.float32]
Int32Array = npt.NDArray[np.int32]

# Angle in radians by which normals of one point may differ, times the number of rays.
_TURN = 1.2
# Limits of additional points relative to the points at pixel centres, for creases and for surfaces that break off; a
# few are always allowed.
_MOST_TURNED, _MOST_BROKEN, _FEW = 0.25, 0.5, 1000

_PATTERNS = {
    4: ((-6, -2), (2, -6), (6, 2), (-2, 6)),
    8: ((1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)),
    16: (
        (1, 1), (-1, -3), (-3, 2), (4, -1), (-5, -2), (2, 5), (5, 3), (3, -5),
        (-2, 6), (0, -7), (-4, -6), (-6, 4), (-8, 0), (7, -4), (6, 7), (-7, -8),
    ),
}  # fmt: skip


def ray_offsets(n_rays: int) -> Float32Array:
    """Positions of the rays of an edge pixel, (n, 2) columns and rows from its centre, in pixels; no two of them in one
    column or row, none at the centre. The patterns are those of Direct3D's multisampling; of the 16, the middle one is
    moved."""
    sixteenths = np.asarray(_PATTERNS[n_rays], np.float32)
    return (sixteenths + np.float32(0.5 if n_rays == 16 else 0.0)) / np.float32(16.0)


class Surface(NamedTuple):
    """Hits of rays: the reflecting object or −1, ids of any shape; position and normal, of that shape times 3."""

    ids: Int32Array
    position: Float32Array
    normal: Float32Array


class Groups(NamedTuple):
    """Groups of the centre and rays (F, 1 + n) of edge pixels (F,): leader, the sample whose point each of them shares,
    −1 where nothing reflects, and share, the part of the pixel that each leader represents, 0 for others."""

    leader: Int32Array
    share: Float32Array


def turn_of(n_rays: int) -> float:
    """The angle by which normals of one point may differ, radians."""
    return _TURN / n_rays


def edge_pixels(seen: Int32Array, centres: Surface, turn: float, resolution: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Find the pixels (N,) of a picture of resolution (width, height) that differ from a neighbour; seen (N,): the
    object at each centre, −1 for none; centres: the hits there."""
    width, height = resolution
    edge = np.zeros((height, width), bool)
    ids, position, normal = (each.reshape(height, width, *each.shape[1:]) for each in centres)
    kernels.mark_edges(seen.reshape(height, width), ids, position, normal, np.float32(np.cos(turn)), edge)
    return edge.ravel()


def group_samples(samples: Surface, offsets: Float32Array, turn: float, n_centres: int) -> Groups:
    """Group samples (F, 1 + n), the centre first, whose rays pass at offsets (n, 2).

    If there would be too many groups relative to the n_centres points of a picture, the angle is widened, until only
    objects and planes decide, and at last objects alone.
    """
    shape = samples.ids.shape
    leader, share = np.empty(shape, np.int32), np.empty(shape, np.float32)
    places = np.concatenate([np.zeros((1, 2), np.float32), offsets])
    turns = [turn * 2.0**k for k in range(16) if turn * 2.0**k < np.pi / 2]
    bounds = [(np.cos(each), kernels.SAME_PLANE, _MOST_TURNED) for each in turns] + [
        (-2.0, kernels.SAME_PLANE, _MOST_BROKEN)
    ]
    for least, plane, most in (*bounds, (-2.0, kernels.ANY_PLANE, np.inf)):
        kernels.group(samples.ids, samples.position, samples.normal, places, np.float32(least), plane, leader, share)
        if (leader[:, 1:] == np.arange(1, shape[1])).sum() <= max(most * n_centres, _FEW):
            break
    return Groups(leader, share)


def nearest_centres(
    hits: PrimaryHits, normals: Float32Array, least_alike: Float32Array
) -> tuple[Int32Array, Int32Array]:
    """The rows (X,) of all points off their pixels' centres, and for each the nearest row at the centre of its own
    pixel or a neighbouring one on the same surface, −1 if there is none.

    normals (P, 3); least_alike (M,): the least cosine between normals of an object's points.
    """
    rows = np.flatnonzero(~hits.is_centred).astype(np.int32)
    nearest = np.full(len(rows), -1, np.int32)
    kernels.find_nearest(
        rows, hits.pixel, hits.offset, hits.objects, hits.position, normals, hits.row_image,
        np.asarray(least_alike, np.float32), nearest,
    )  # fmt: skip
    return rows, nearest
