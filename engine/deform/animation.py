"""A mesh where an animation of its file has taken it at a time: morph targets, then the skin [glTF20, 3.7, 3.11].

Each vertex moves by the sum of what its bones do beyond resting: with all bones at rest it stays as it was to the last
bit. Its axes go by the Jacobian of both steps: that of morph targets by differences over the triangles, that of the
skin the mean of its bones' linear parts; how weights change along the surface is left out, as is usual [Sloan05, 5].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.deform import _animation_kernels as kernels
from engine.deform.gradients import gradients
from engine.deform.pose import Pose, deformed_frames, orthonormal
from engine.scene.gltf_nodes import matrix_of
from engine.scene.rig import PATHS, Clip, Rig, Track
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float64]
Values = dict[tuple[int, str], Floats]

RESTS = 1e-5  # of the mesh's extent: a bone that moves nothing of it by more is at rest, but for the file's rounding


def posed(rig: Rig, rest: Pose, triangles: NDArray[np.int32], clip: str, time: float, loop: bool = True) -> Pose:
    """The pose at a time, seconds; beyond a clip's end it begins anew, or without `loop` stays as it ends.

    rest: the object's vertices (V, 3), `Scene.vertices` in its range, and their axes; triangles (T, 3): numbers of
    these. Raises ValueError where there is no such animation, or the time is not finite.
    """
    if len(rig.binding.bones) != len(rest.positions):
        raise ValueError(f"{len(rest.positions)} vertices, expected {len(rig.binding.bones)}, as the rig has")
    values = sampled(rig.skeleton.clip(clip), time, loop)
    pose, moves = _morphed(rig, rest, triangles, values), _bone_moves(rig, rest.positions, values)
    return _skinned(rig, pose, moves) if moves.any() else pose


def sampled(clip: Clip, time: float, loop: bool = True) -> Values:
    """The values of a clip's tracks, by node and path, at a time. Raises ValueError where it is not finite."""
    if not np.isfinite(time):
        raise ValueError(f"time {time}, expected a finite number of seconds")
    if loop and clip.duration > 0.0 and not 0.0 <= time <= clip.duration:
        time %= clip.duration
    return {(track.node, track.path): _at(track, time) for track in clip.tracks}


def _at(track: Track, time: float) -> Floats:
    """A track's value between its keys, or of the nearest where there is none on one side."""
    times, is_spline = track.times, track.interpolation == "CUBICSPLINE"
    after = int(np.searchsorted(times, time, side="right"))
    before = max(after - 1, 0)
    if after in (0, len(times)) or track.interpolation == "STEP":
        return _kept(track, track.values[before, 1] if is_spline else track.values[before])
    span = times[after] - times[before]
    share = (time - times[before]) / span
    if is_spline:
        return _kept(track, _hermite(track.values[before], track.values[after], span, share))
    if track.path == "rotation":
        return _slerp(track.values[before], track.values[after], share)
    return np.asarray((1.0 - share) * track.values[before] + share * track.values[after])


def _kept(track: Track, value: Floats) -> Floats:
    """The value, of a rotation at length 1."""
    length = float(np.linalg.norm(value)) if track.path == "rotation" else 1.0
    return value / length if length > 1e-6 else np.array([0.0, 0.0, 0.0, 1.0])


def _hermite(before: Floats, after: Floats, span: float, share: float) -> Floats:
    """Between two keys (3, W) of a cubic spline [glTF20, C.5]."""
    square, cube = share**2, share**3
    return np.asarray(
        (2 * cube - 3 * square + 1) * before[1]
        + span * (cube - 2 * square + share) * before[2]
        + (3 * square - 2 * cube) * after[1]
        + span * (cube - square) * after[0]
    )


def _slerp(before: Floats, after: Floats, share: float) -> Floats:
    """Between two rotations, the shorter way round at an even speed [glTF20, C.4]."""
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


def _bone_moves(rig: Rig, places: Floats, values: Values) -> Floats:
    """What each bone does (B, 3, 4) beyond leaving all in place; 0 of those at rest."""
    skeleton, matrices = rig.skeleton, dict[int, Floats]()
    for node in skeleton.order:
        own = skeleton.matrices[node]
        if node in skeleton.parts:
            rest = zip(PATHS, skeleton.parts[node], strict=True)
            parts = [values.get((node, path), part) for path, part in rest]
            own = matrix_of(*parts) if any((node, path) in values for path in PATHS) else own
        parent = skeleton.parents.get(node)
        matrices[node] = own if parent is None else matrices[parent] @ own
    there = rig.frame @ np.stack([matrices[int(node)] for node in rig.binding.nodes])
    moves = np.ascontiguousarray((there @ rig.binding.maps - np.eye(4))[:, :3])
    low, high = places.min(axis=0), places.max(axis=0)
    corners = np.array(
        [[x, y, z, 1.0] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    furthest = np.abs(moves @ corners.T).max(axis=(1, 2))
    moves[furthest <= RESTS * (high - low).max()] = 0.0
    return moves


def _morphed(rig: Rig, rest: Pose, triangles: NDArray[np.int32], values: Values) -> Pose:
    """The pose after the morph targets; the resting one itself where all weigh nothing."""
    positions, normals, has_normals = rest.positions, rest.frames[:, 2], np.ones(len(rest.positions), bool)
    for morph in rig.binding.morphs:
        weights = values.get((morph.node, "weights"), rig.skeleton.weights.get(morph.node))
        weight = float(weights[morph.number]) if weights is not None and morph.number < len(weights) else 0.0
        if weight == 0.0:
            continue
        if positions is rest.positions:
            positions, normals = positions.copy(), normals.copy()
        positions[morph.vertices] += weight * morph.offsets
        if morph.normals is None:
            has_normals[morph.vertices] = False
        else:
            normals[morph.vertices] += weight * morph.normals
    if positions is rest.positions:
        return rest
    frames = deformed_frames(rest.frames, gradients(rest.positions, positions, triangles))
    about = frames.copy()
    about[has_normals, 2] = normals[has_normals]
    return Pose(positions, orthonormal(about, frames))


def _skinned(rig: Rig, pose: Pose, moves: Floats) -> Pose:
    positions, linear = np.empty_like(pose.positions), np.empty((len(pose.positions), 3, 3))
    bones, weights = rig.binding.bones, rig.binding.weights
    on_threads(
        lambda start, stop: kernels.skin_range(pose.positions, bones, weights, moves, start, stop, positions, linear),
        *even_parts(len(positions)),
    )
    return Pose(positions, deformed_frames(pose.frames, linear))
