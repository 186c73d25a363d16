"""What moves the skinned meshes of a USD stage, as arrays: joints over time, influences and blend shapes.

It runs where the stage is composed (`usd_stage`), before the library poses the meshes (`usd_skins`), whose points are
then other ones. Blend shapes with shapes in between are left out, and so is what has other numbers than it should: such
a mesh stays in its pose (`usd_bindings` checks the rest).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import numpy as np

MOST_JOINTS, MOST_KEYS = 1024, 2_000  # of one skeleton
MOST_INFLUENCES = 4_000_000  # of one mesh
_SHAPES = "inbetweens:"

SkinData = dict[str, dict[str, Any]]  # by the paths of skeletons and meshes


def read_skins(stage: Any, start: float) -> SkinData:
    """The skeletons that are animated from a time code on, and the meshes that they bend.

    Of a skeleton: parents (J,), times (K,), locals (K, J, 4, 4), binds (J, 4, 4) for column vectors, and the path of
    its animation. Of a mesh: its skeleton, points (P, 3), bones and weights (P, N), bind (4, 4), offsets (S, P, 3) of
    its shapes, and their weights (K, S).
    """
    from pxr import Tf, Usd, UsdSkel

    found: SkinData = {}
    for prim in [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Root) and not prim.IsInstanceProxy()]:
        cache, root, every = UsdSkel.Cache(), UsdSkel.Root(prim), Usd.PrimDefaultPredicate
        cache.Populate(root, every)
        for binding in cache.ComputeSkelBindings(root, every):
            path, query = str(binding.GetSkeleton().GetPath()), cache.GetSkelQuery(binding.GetSkeleton())
            joints = None
            with contextlib.suppress(Tf.ErrorException, ValueError):
                joints = _joints(query, start)
            if joints is None:
                continue
            found[path] = joints
            for target in binding.GetSkinningTargets():
                with contextlib.suppress(Tf.ErrorException, ValueError):
                    mesh = _mesh(target, query, joints["times"], start)
                    if mesh is not None:
                        found[str(target.GetPrim().GetPath())] = mesh | {"skeleton": path}
    return found


def _joints(query: Any, start: float) -> dict[str, Any] | None:
    """The joints of a skeleton; None where nothing moves them."""
    animation = query.GetAnimQuery()
    if not animation:
        return None
    samples = [*animation.GetJointTransformTimeSamples(), *animation.GetBlendShapeWeightTimeSamples()]
    every = np.unique([start, *(time for time in samples if time > start)])
    times = every[:MOST_KEYS]
    parents = np.array(query.GetTopology().GetParentIndices(), np.int64)
    if len(times) < 2 or not 1 <= len(parents) <= MOST_JOINTS:
        return None
    places = [_matrices(query.ComputeJointLocalTransforms(time), len(parents)) for time in times]
    return {
        "parents": parents, "times": times, "locals": np.stack(places), "n_keys": len(every),
        "binds": _matrices(query.GetJointWorldBindTransforms(), len(parents)),
        "animation": str(animation.GetPrim().GetPath()),
    }  # fmt: skip


def _mesh(target: Any, query: Any, times: np.ndarray, start: float) -> dict[str, Any] | None:
    """The influences and the blend shapes of a mesh; None where it is none, or has neither."""
    from pxr import UsdGeom

    prim = target.GetPrim()
    if not prim.IsA(UsdGeom.Mesh):
        return None
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(start) or [], np.float64).reshape(-1, 3)
    influences = target.ComputeVaryingJointInfluences(len(points), start) if target.HasJointInfluences() else None
    if not len(points) or influences is None:
        return None
    bones, weights = (np.array(each).reshape(len(points), -1) for each in influences)
    if bones.size > MOST_INFLUENCES:
        return None
    order = target.GetJointOrder()
    if order is not None:  # the mesh has joints of its own order
        numbers = {str(name): k for k, name in enumerate(query.GetJointOrder())}
        own = np.array([numbers.get(str(name), 0) for name in order])
        bones = own[bones]
    bind = np.array(target.GetGeomBindTransform(start)).T
    found = {"points": points, "bones": bones, "weights": weights, "bind": bind}
    return {**found, **_shapes(target, query.GetAnimQuery(), len(points), times)}


def _shapes(target: Any, animation: Any, n_points: int, times: np.ndarray) -> Mapping[str, Any]:
    """The offsets of the blend shapes that the animation names, and their weights at these times. Raises ValueError
    where there are shapes in between."""
    from pxr import UsdSkel

    names = [str(name) for name in target.GetBlendShapeOrder() or []]
    moved = {str(name): k for k, name in enumerate(animation.GetBlendShapeOrder())}
    targets = target.GetBlendShapeTargetsRel().GetTargets() if names else []
    chosen = [(moved[name], path) for name, path in zip(names, targets, strict=False) if name in moved]
    if not chosen or len(chosen) * n_points > MOST_INFLUENCES:
        return {}
    every = np.array([np.array(animation.ComputeBlendShapeWeights(time)) for time in times], np.float64)
    offsets = np.zeros((len(chosen), n_points, 3))
    for k, (_, path) in enumerate(chosen):
        shape = UsdSkel.BlendShape(target.GetPrim().GetStage().GetPrimAtPath(path))
        if shape.GetInbetweens():
            raise ValueError("shapes in between")
        rows = np.array(shape.GetOffsetsAttr().Get() or [], np.float64).reshape(-1, 3)
        own = shape.GetPointIndicesAttr().Get()
        where = np.arange(n_points) if own is None or not len(own) else np.array(own, np.int64)
        if len(where) != len(rows) or (len(where) and not 0 <= where.min() <= where.max() < n_points):
            raise ValueError("offsets")
        offsets[k, where] = rows
    return {"offsets": offsets, "shapes": every[:, [number for number, _ in chosen]]}


def _matrices(found: Any, count: int) -> np.ndarray:
    """Matrices (N, 4, 4) for column vectors. Raises ValueError where there are others than so many."""
    matrices = np.array(found if found is not None else [], np.float64).reshape(-1, 4, 4).swapaxes(1, 2)
    if len(matrices) != count:
        raise ValueError(f"{len(matrices)} joints")
    return matrices
