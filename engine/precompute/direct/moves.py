"""What a picture's direct light changes by where objects are moved: only what they shade, or are shaded by.

Two scenes of the same objects, seen by one camera, differ in the place of some. A point of the picture that shows the
same place of the same surface in both keeps its radiance, but for lights that it sees in one of them alone. Direct
light is linear in visibility [BenArtzi07, eq. 4.12]:

    B' = B + Σ_m (V'_m − V_m) · ρ f cosθ_m L_m,

so the sum over lights gained, less that over lights lost, is all there is to add. It is exactly nothing where no shadow
ray meets the objects: only rays that pass the bounds of moved objects, before or after, are traced, in both scenes.
Points without a place in the scene before, those of the moved objects and what these hid, are lit anew.

Emitters that move take their light along: the picture loses what they gave, and gains what they give now.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import map_ahead, pool
from engine.precompute.direct import _move_kernels as kernels
from engine.precompute.direct.lighting import Lighting
from engine.precompute.direct.near_leaves import no_near_leaves
from engine.precompute.direct.pipeline import Placement
from engine.precompute.direct.projection import VisibleLight
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.visibility import _kernels as bit_kernels
from engine.visibility.moved_objects import have_same_triangles, moved_objects
from engine.visibility.point_visibility import (
    BLOCK,
    Targets,
    Visibility,
    empty_visibility,
    horizons,
    trace_targets,
)

AT_ONCE = 4
COARSEST = 8
# Of a box's size, for rounding.
MARGIN = 1e-4


def lattice_stride(n_points: int, most: int) -> int:
    """The stride of a lattice on which about `most` of so many points of a picture lie at most: a power of two."""
    stride = 1
    while stride < COARSEST and n_points > most * stride**2:
        stride *= 2
    return stride


@dataclass(frozen=True, eq=False)
class SceneMove:
    """Objects that two scenes of the same objects have in different places. moved (M,): which; boxes (K, 2, 3): their
    bounds in both."""

    moved: NDArray[np.bool_]
    boxes: NDArray[np.float32]


def scene_move(before: Scene, after: Scene) -> SceneMove | None:
    """What was moved between two scenes; None where they differ in more: objects, cutouts, textures of emitters. Bumps
    show in the normals of `same_points`."""
    same = (
        before.object_names == after.object_names
        and have_same_triangles(before, after)
        and before.cutouts.digest == after.cutouts.digest
        and before.emission_textures.digest == after.emission_textures.digest
    )
    if not same:
        return None
    moved = moved_objects(before, after)
    found = np.concatenate([(scene.bounds - scene.origin)[moved] for scene in (before, after)])
    room = MARGIN * np.linalg.norm(found[:, 1] - found[:, 0], axis=1)[:, None]
    found[:, 0], found[:, 1] = found[:, 0] - room, found[:, 1] + room
    return SceneMove(moved, found.astype(np.float32))


def same_points(before: PrimaryHits, after: PrimaryHits) -> NDArray[np.int32]:
    """For each point of a picture the row of the point in the one before that shows the same place of the same object,
    with the same normals, (P,); −1 for none."""
    found = np.full(len(after.pixel), -1, np.int32)
    if before.resolution != after.resolution or len(before.object_ranges) != len(after.object_ranges):
        return found
    if not len(before.pixel) or (before.coat_normal is None) != (after.coat_normal is None):
        return found
    keys = [_place_keys(each) for each in (before, after)]
    order = np.argsort(keys[0], kind="stable")
    place = np.minimum(np.searchsorted(keys[0], keys[1], sorter=order), len(order) - 1)
    row = order[place].astype(np.int32)
    same = keys[0][row] == keys[1]
    names = ["position", "normal", "tangent", "wo"]
    for name in names + (["coat_normal", "coat_tangent"] if before.coat_normal is not None else []):
        same &= (getattr(before, name)[row] == getattr(after, name)).all(axis=1)
    found[same] = row[same]
    return found


def _place_keys(hits: PrimaryHits) -> NDArray[np.int64]:
    """A number for the object, pixel and place in the pixel of each point (P,)."""
    width, height = hits.resolution
    offset = np.round(hits.offset * 256.0).astype(np.int64) + 128
    return ((hits.objects.astype(np.int64) * (width * height) + hits.pixel) << 18) + (offset[:, 0] << 9) + offset[:, 1]


def changed_light(
    points: Placement, before: RayCaster, lighting: Lighting, boxes: NDArray[np.float32]
) -> Iterator[tuple[VisibleLight, VisibleLight] | None]:
    """The lights that points see now and did not see before, and those that they no longer see; None after each step
    before. points: those of the picture that are asked for, in the scene as it is now; before: the ray caster of the
    scene before. lighting: of lights that stay, each with a ray of its own."""
    hits = points.hits
    pairs = list[tuple[Visibility, Visibility]]()
    for targets in (lighting.fine_targets, lighting.emitter_targets):
        pair = empty_visibility(hits, targets), empty_visibility(hits, targets)
        yield from _changes(hits, (before, points.caster), targets, boxes, pair)
        pairs.append(pair)
    none = no_near_leaves(len(hits.pixel))
    (fine, lost_fine), (leaves, lost_leaves) = pairs
    gained = VisibleLight(lighting, points.sphere, fine, leaves, none)
    yield gained, replace(gained, fine=lost_fine, emitters=lost_leaves)


def _changes(
    hits: PrimaryHits, casters: tuple[RayCaster, RayCaster], targets: Targets, boxes: NDArray[np.float32],
    pair: tuple[Visibility, Visibility],
) -> Iterator[None]:  # fmt: skip
    """Marks the targets that points see by the second of two casters alone, and by the first alone."""
    gained, lost = pair
    if not len(targets.positions):
        return

    def trace(block: slice) -> None:
        rows = np.arange(len(hits.pixel), dtype=np.int32)[block]
        asked = horizons(hits, targets, rows)
        kernels.keep_passing(rows, hits.offset_position, targets.positions, targets.finite, boxes, asked)
        n_rays = bit_kernels.count_bits(asked)
        if not n_rays:
            return
        point, target = np.empty(n_rays, np.int32), np.empty(n_rays, np.int32)
        bit_kernels.list_bits(asked, point, target)
        was, now = (trace_targets(hits, caster, targets, rows, point, target) for caster in casters)
        kernels.mark_bits(rows, point, target, was & ~now, gained.bits)
        kernels.mark_bits(rows, point, target, now & ~was, lost.bits)

    blocks = [slice(i, i + BLOCK) for i in range(0, len(hits.pixel), BLOCK)]
    with pool() as threads:
        for _ in map_ahead(threads, trace, blocks, AT_ONCE):
            yield None


def changed_rows(light: VisibleLight) -> NDArray[np.int32]:
    """The points, by row, that a part of the light reaches at all."""
    return np.flatnonzero(light.fine.bits.any(axis=1) | light.emitters.bits.any(axis=1)).astype(np.int32)


def kept_detail(interpolated: NDArray[np.float32], changed: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much of a picture's detail, what a lattice leaves out of it, stays where light changes, (P, 3) in [0, 1]: the
    share of the light that stays, or highlights and edges of shadows would be seen where they were. interpolated,
    changed (P, 3): from the lattice, all light and that which changes."""
    share = np.where(changed > 0.0, np.float32(1.0), np.float32(0.0))  # where there is no other light
    np.divide(changed, interpolated, out=share, where=interpolated > changed)
    return np.float32(1.0) - share


def without_objects(scene: Scene, objects: NDArray[np.bool_]) -> Scene:
    """A scene in which rays meet nothing of some objects (M,): their triangles have no area."""
    vertices = scene.vertices.copy()
    for begin, end in scene.vertex_ranges[objects]:
        vertices[begin:end] = vertices[begin] if end > begin else 0.0
    return replace(scene, vertices=vertices)
