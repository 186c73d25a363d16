"""A scene with objects in other poses: the same triangles, with vertices and normals moved by animations, deformers and
transforms.

An animation from the object's file poses its mesh at a time: morph targets, then the skin [glTF20, 3.7, 3.11]. Each
vertex moves by the sum of the displacements of its bones and targets relative to rest, so that a mesh at rest stays
bit-identical. Axes are transformed from the mesh at rest to the accessors' mesh, then by the Jacobian of the morph
targets (differences over the triangles), and then by the mean of the bones' linear parts; normals use the mean of their
inverse transposes. The variation of weights along the surface is ignored, as usual [Sloan05, 5].

A transform comes last. With the vertices it moves all that belongs to the object's own frame: the transform in the
scene's description, so cones of spots and tangents, the box that images are projected from, and the file's tangents.
The scene is then the one whose file has the object there. A cone replaces that of a spot, and moves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import local_frames, orthonormal
from engine.core.threads import even_parts, on_threads
from engine.light.cones import Cone
from engine.realtime.zonal_harmonics import _animation_kernels as kernels
from engine.realtime.zonal_harmonics.pose import (
    Deformation,
    Moment,
    Motion,
    Pose,
    Poses,
    check_extent,
    deform,
    deformed_frames,
    transformed,
)
from engine.scene.description import ConeDescription
from engine.scene.loaders.gltf_nodes import matrix_of
from engine.scene.mesh import face_normals
from engine.scene.rig import PATHS, Clip, Rig, Track, morph_weight, normal_matrices
from engine.scene.scene_loader import Scene
from engine.scene.scene_placement import MAX_EXTENT
from engine.scene.tangents import object_tangents
from engine.scene.transform import Transform

Float64Array = NDArray[np.float64]
Values = dict[tuple[int, str], Float64Array]

REST_TOLERANCE = (
    # Of the mesh's extent: a bone that displaces no part of it by more is at rest; such differences come from the
    # file's rounding.
    1e-5
)

_FLAT = 1e-12


def pose_scene(scene: Scene, poses: Poses) -> Scene:
    """Return the scene with these objects, by name, in these poses; unknown names are ignored. Returns the same scene
    if nothing moves. Raises InsituError if an object would extend beyond the largest allowed scene.

    A face that loses all its area keeps its normal.
    """
    moving = [(scene.object_index(name), row) for name, row in poses if name in scene.object_names]
    if not moving:
        return scene
    vertices, normals = scene.vertices.copy(), scene.normals.copy()
    placed = dict[int, Float64Array]()
    cones = {i: cone for i, row in moving if (cone := cone_of(row)) is not None}
    moving = [(i, row) for i, row in moving if any(not isinstance(each, Cone) for each in row)]
    for i, row in moving:
        rest, moment = animate_vertices(scene, i, row)
        shift = animation_offset(rest, moment)
        which = np.unique(scene.triangles[slice(*scene.triangle_ranges[i])])
        mine = which - scene.vertex_ranges[i, 0]
        box, transform = resting_box(scene, i), transform_of(row)
        pose = deform(Pose(moment.positions[mine], moment.frames[mine]), deformers(row), box + shift)
        if transform is not None:
            pose = transformed(pose, transform, box.mean(axis=0))
            placed[i] = transform.matrix(box.mean(axis=0))
        check_extent(scene.object_names[i], pose.positions, MAX_EXTENT)
        vertices[which], normals[which] = pose.positions, pose.frames[:, 2]
    geometric = scene.geometric_normals.copy()
    for i, _ in moving:
        own = slice(*scene.triangle_ranges[i])
        found, solid = face_normals(vertices, scene.triangles[own])
        geometric[own] = np.where(solid[:, None], found, geometric[own])
    posed = replace(scene, vertices=vertices, normals=normals, geometric_normals=geometric)
    posed = _with_frames(posed, placed) if placed else posed
    return _with_cones(posed, cones) if cones else posed


def _with_cones(scene: Scene, cones: Mapping[int, Cone]) -> Scene:
    """The scene with these cones of emitters, by index."""
    objects = list(scene.description.objects)
    for i, cone in cones.items():
        described = ConeDescription(inner=cone.inner, outer=cone.outer)
        objects[i] = objects[i].model_copy(update={"cone": described})
    return replace(scene, description=scene.description.model_copy(update={"objects": tuple(objects)}))


def _with_frames(scene: Scene, placed: Mapping[int, Float64Array]) -> Scene:
    """The scene with the frames of objects, by index, under further transforms (4, 4) in the frame of its arrays."""
    objects, boxes = list(scene.description.objects), scene.boxes.copy()
    tangents = None if scene.tangents is None else scene.tangents.copy()
    to_world, from_world = np.eye(4), np.eye(4)
    to_world[:3, 3], from_world[:3, 3] = scene.origin, -scene.origin
    for i, matrix in placed.items():
        in_file = np.reshape(objects[i].transform, (4, 4))
        in_world = to_world @ matrix @ from_world @ in_file
        objects[i] = objects[i].model_copy(update={"transform": tuple(in_world.ravel().tolist())})
        # Points go back to where they were before they meet the box.
        boxes[i] = boxes[i] @ np.linalg.inv(matrix)
        if tangents is not None:
            own = tangents[slice(*scene.triangle_ranges[i])]
            along = own[..., :3] @ matrix[:3, :3].T
            length = np.linalg.norm(along, axis=-1, keepdims=True)
            own[..., :3] = along / np.where(length > 0.0, length, 1.0)
    description = scene.description.model_copy(update={"objects": tuple(objects)})
    return replace(scene, description=description, boxes=boxes, tangents=tangents)


def resting_box(scene: Scene, i: int) -> Float64Array:
    """The bounding box (2, 3) of object i in the scene's file, in the frame of the arrays; its centre is the pivot of
    transforms."""
    corners = scene.vertices[scene.triangles[slice(*scene.triangle_ranges[i])].ravel()].astype(np.float64)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def transform_of(row: Motion) -> Transform | None:
    """The transform of a motion, None where it has none."""
    return next((each for each in row if isinstance(each, Transform)), None)


def cone_of(row: Motion) -> Cone | None:
    """The cone that an emitter has instead of its file's, None where it has none."""
    return next((each for each in row if isinstance(each, Cone)), None)


def movements_between(scene: Scene, before: Poses, after: Poses) -> dict[int, Float64Array] | None:
    """The affine movements (4, 4) of objects, by index, from some poses to others, which differ by transforms and
    cones alone; None where they differ in more. An emitter whose cone alone differs has the identity. scene: as in its
    file."""
    names = scene.object_names
    was, now = ({scene.object_index(name): row for name, row in poses if name in names} for poses in (before, after))
    found = dict[int, Float64Array]()
    for i in was.keys() | now.keys():
        rows = was.get(i, ()), now.get(i, ())
        shapes = [tuple(each for each in row if not isinstance(each, Cone | Transform)) for row in rows]
        if shapes[0] != shapes[1]:
            return None
        if rows[0] != rows[1] and np.ptp(scene.triangle_ranges[i]):
            pivot, steps = resting_box(scene, i).mean(axis=0), [transform_of(row) for row in rows]
            first, last = (np.eye(4) if step is None else step.matrix(pivot) for step in steps)
            found[i] = last @ np.linalg.inv(first)
    return found


def deformers(row: Motion) -> list[Deformation]:
    """The deformers of a motion alone."""
    return [each for each in row if isinstance(each, Deformation)]


def animation_offset(rest: Pose, moment: Pose) -> NDArray[np.float64]:
    """Translation (3,) of an object as a whole by an animation: the deformers' box moves along."""
    return np.asarray((moment.positions - rest.positions).mean(axis=0))


def animate_vertices(scene: Scene, i: int, row: Motion) -> tuple[Pose, Pose]:
    """The vertices of object i in their range, as in the scene's file and at the motion's moment; both are the same if
    there is none, or the object has no such animation."""
    rest, rig, moment = _rest_vertices(scene, i), scene.rigs[i], moment_of(scene, i, row)
    if rig is None or moment is None:
        return rest, rest
    triangles = scene.triangles[slice(*scene.triangle_ranges[i])] - scene.vertex_ranges[i, 0]
    return rest, animated_pose(rig, rest, triangles, moment.clip, moment.time)


def moment_of(scene: Scene, i: int, row: Motion) -> Moment | None:
    """The moment of a motion, if object i has that animation."""
    clips = [] if (rig := scene.rigs[i]) is None else [clip.name for clip in rig.skeleton.clips]
    return next((each for each in row if isinstance(each, Moment) and each.clip in clips), None)


def _rest_vertices(scene: Scene, i: int) -> Pose:
    which: NDArray[np.int64] = np.arange(*scene.vertex_ranges[i])
    normals = scene.normals[which].astype(np.float64)
    tangents = object_tangents(scene, np.full(len(which), i), normals)
    return Pose(scene.vertices[which].astype(np.float64), local_frames(tangents, normals))


def animated_pose(
    rig: Rig, rest: Pose, triangles: NDArray[np.int32], clip: str, time: float, loop: bool = True
) -> Pose:
    """Compute the pose at a time in seconds; after the clip's end it repeats, or without `loop` holds the last frame.

    rest: the object's vertices (V, 3), `Scene.vertices` in its range, and their axes; triangles (T, 3): indices of
    these. Raises ValueError if there is no such animation or the time is not finite.
    """
    if len(rig.binding.bones) != len(rest.positions):
        raise ValueError(f"{len(rest.positions)} vertices, expected {len(rig.binding.bones)}, as the rig has")
    values = sample_clip(rig.skeleton.clip(clip), time, loop)
    weights = {node: values.get((node, "weights"), own) for node, own in rig.skeleton.weights.items()}
    moves = _bone_moves(rig, values)
    is_morphed = any(morph_weight(m, weights) != morph_weight(m, rig.skeleton.weights) for m in rig.binding.morphs)
    if not is_morphed and not moves.any():
        return rest
    # Positions before skinning, now and at rest, and the difference transformed by the bones at rest.
    before, normals = rig.binding.morph_vertices(rig.skeleton.weights)
    places, positions = before, rest.positions.copy()
    has_normals = np.asarray(rig.binding.normals.any(axis=1))
    if is_morphed:
        places, normals = rig.binding.morph_vertices(weights)
        positions += np.einsum("vab,vb->va", rig.rest_pose.linear, places - before)
        for morph in rig.binding.morphs:
            if morph.normals is None and morph_weight(morph, weights) != 0.0:
                has_normals[morph.vertices] = False
    # Displacement by the bones.
    linear, turned = rig.rest_pose.linear.copy(), np.empty_like(positions)
    bones, shares, turns = rig.binding.bones, rig.binding.weights, normal_matrices(rig.rest_pose.matrices + moves)
    on_threads(
        lambda start, stop: kernels.skin_range(
            places, normals, bones, shares, moves, turns, start, stop, positions, linear, turned
        ),
        *even_parts(len(positions)),
    )
    # Transform the axes from the mesh at rest back to before skinning, by the morph targets, and forward again.
    if is_morphed:
        linear = linear @ mesh_jacobians(before, places, triangles)
    axes = deformed_frames(rest.frames, linear @ rig.rest_pose.inverse)
    about = axes.copy()
    about[has_normals, 2] = turned[has_normals]
    return Pose(positions, orthonormal(about, axes))


def sample_clip(clip: Clip, time: float, loop: bool = True) -> Values:
    """Evaluate a clip's tracks, by node and path, at a time. Raises ValueError if it is not finite."""
    if not np.isfinite(time):
        raise ValueError(f"time {time}, expected a finite number of seconds")
    if loop and clip.duration > 0.0 and not 0.0 <= time <= clip.duration:
        time %= clip.duration
    return {(track.node, track.path): _track_value(track, time) for track in clip.tracks}


def _track_value(track: Track, time: float) -> Float64Array:
    """Evaluate a track: interpolate between its keys; before the first and after the last, hold its value."""
    times, is_spline = track.times, track.interpolation == "CUBICSPLINE"
    after = int(np.searchsorted(times, time, side="right"))
    before = max(after - 1, 0)
    if after in (0, len(times)) or track.interpolation == "STEP":
        return _normalized(track, track.values[before, 1] if is_spline else track.values[before])
    span = times[after] - times[before]
    share = (time - times[before]) / span
    if is_spline:
        return _normalized(track, _hermite(track.values[before], track.values[after], span, share))
    if track.path == "rotation":
        return _slerp(track.values[before], track.values[after], share)
    return np.asarray((1.0 - share) * track.values[before] + share * track.values[after])


def _normalized(track: Track, value: Float64Array) -> Float64Array:
    """Normalize the value of a rotation; leave other values."""
    length = float(np.linalg.norm(value)) if track.path == "rotation" else 1.0
    return value / length if length > 1e-6 else np.array([0.0, 0.0, 0.0, 1.0])


def _hermite(before: Float64Array, after: Float64Array, span: float, share: float) -> Float64Array:
    """Evaluate a cubic spline between two keys (3, W) [glTF20, C.5]."""
    square, cube = share**2, share**3
    return np.asarray(
        (2 * cube - 3 * square + 1) * before[1]
        + span * (cube - 2 * square + share) * before[2]
        + (3 * square - 2 * cube) * after[1]
        + span * (cube - square) * after[0]
    )


def _slerp(before: Float64Array, after: Float64Array, share: float) -> Float64Array:
    """Interpolate between two rotations along the shorter arc at constant speed [glTF20, C.4]."""
    before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
    cosine = float(before @ after)
    if cosine < 0.0:
        after, cosine = -after, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        value = (1.0 - share) * before + share * after
    else:
        value = (np.sin((1.0 - share) * angle) * before + np.sin(share * angle) * after) / np.sin(angle)
    return np.asarray(value / np.linalg.norm(value))


def _bone_moves(rig: Rig, values: Values) -> Float64Array:
    """Matrices of bones minus those at rest (B, 3, 4); exactly 0 for bones at rest."""
    skeleton, moved = rig.skeleton, dict[int, Float64Array]()
    for node, rest in skeleton.parts.items():
        if any((node, path) in values for path in PATHS):
            moved[node] = matrix_of(*(values.get((node, path), part) for path, part in zip(PATHS, rest, strict=True)))
    places, matrices = rig.binding.places, rig.rest_pose.matrices
    moves = np.ascontiguousarray(rig.bone_matrices(moved) - matrices)
    low, high = places.min(axis=0), places.max(axis=0)
    corners = np.array(
        [[x, y, z, 1.0] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    # The largest displacement by a bone, and the size of the mesh.
    furthest, size = np.abs(moves @ corners.T).max(axis=(1, 2)), np.ptp(matrices @ corners.T, axis=2).max(axis=1)
    moves[furthest <= REST_TOLERANCE * size] = 0.0
    return moves


def mesh_jacobians(before: Float64Array, after: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Jacobians (V, 3, 3) at the vertices of a mesh that moves from `before` (V, 3) to `after`: the mean over adjacent
    triangles, weighted by area. A triangle's Jacobian maps its edges to its edges and its normal to its normal. A
    vertex without triangles of nonzero area gets the identity."""
    edges, there = _triangle_edges(before, triangles), _triangle_edges(after, triangles)
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    has_area = areas > _FLAT * (edges**2).sum(axis=2).max(axis=1)
    triangles, areas = triangles[has_area], areas[has_area]
    maps = _with_normals(there[has_area]) @ np.linalg.inv(_with_normals(edges[has_area]))
    total = np.zeros((len(before), 9))
    weight = np.zeros(len(before))
    for corner in triangles.T:
        weight += np.bincount(corner, areas, len(before))
        for k in range(9):
            total[:, k] += np.bincount(corner, areas * maps.reshape(-1, 9)[:, k], len(before))
    has_any = weight > 0.0
    total = total / np.where(has_any, weight, 1.0)[:, None]
    return np.where(has_any[:, None, None], total.reshape(-1, 3, 3), np.eye(3))


def _triangle_edges(places: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Two edges of each triangle (T, 2, 3)."""
    corners = places[triangles]
    return corners[:, 1:] - corners[:, :1]


def _with_normals(edges: Float64Array) -> Float64Array:
    """Two edges and a normal of comparable length, as columns (T, 3, 3)."""
    normal = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.sqrt(np.where(doubled > 0.0, doubled, 1.0))
    return np.stack([edges[:, 0], edges[:, 1], normal], axis=2)
