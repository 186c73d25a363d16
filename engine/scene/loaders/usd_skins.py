"""The pose of skinned meshes of a USD stage at one time, by UsdSkel's own skinning and blend shapes.

It runs where the stage is composed (`usd_stage`), in the decoder's process, and writes to the session layer alone:
each skinned mesh gets the points, the normals or the transform of its pose as values of its own, which readers then
find like those of any mesh.
"""

from __future__ import annotations

import contextlib
from typing import Any

MOST_INSTANCES = 256  # that are opened for their skinned meshes


def pose_skins(stage: Any, time: Any) -> tuple[set[str], set[str]]:
    """Pose all skinned meshes of a stage at a time; returns the paths of those that have their pose, and of animations
    with more than one key."""
    from pxr import Gf, Tf, Usd, UsdSkel

    roots = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Root) and not prim.IsInstanceProxy()]
    if not roots:
        return set(), set()
    # Times of a layer of another rate would be scaled.
    stage.GetSessionLayer().timeCodesPerSecond = stage.GetTimeCodesPerSecond()
    at = 0.0 if time.IsEarliestTime() else time.GetValue()
    posed, moving = set[str](), set[str]()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for prim in stage.Traverse():
            if not prim.IsA(UsdSkel.Animation):
                continue
            for attribute in prim.GetAuthoredAttributes():
                value = attribute.Get(time)
                if attribute.GetNumTimeSamples() > 1:
                    moving.add(str(prim.GetPath()))
                # A key at this very time, since the library bakes at keys alone.
                if value is not None:
                    attribute.Set(value, at)
        for prim in roots:
            with contextlib.suppress(Tf.ErrorException):  # its meshes rest, and are listed
                whole = _whole_skins(prim)
                UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(at, at))
                prim.SetTypeName("SkelRoot")  # which the library has made an Xform
                posed |= whole
    return posed, moving


def _whole_skins(root: Any) -> set[str]:
    """The paths of meshes below a root whose joints and weights are as they should be."""
    from pxr import Usd, UsdSkel

    cache, skin, every = UsdSkel.Cache(), UsdSkel.Root(root), Usd.PrimDefaultPredicate
    cache.Populate(skin, every)
    targets = [each for binding in cache.ComputeSkelBindings(skin, every) for each in binding.GetSkinningTargets()]
    return {
        str(each.GetPrim().GetPath())
        for each in targets
        if not each.HasJointInfluences() or each.ComputeJointInfluences() is not None
    }


def open_instances(stage: Any) -> None:
    """Make prims of their own of instances with skinned meshes, which the library cannot pose otherwise."""
    from pxr import Usd

    left = MOST_INSTANCES
    while left and (skinned := _skinned_prototypes(stage)):
        found = [
            prim for prim in stage.Traverse() if prim.IsInstance() and str(prim.GetPrototype().GetPath()) in skinned
        ][:left]  # fmt: skip
        if not found:
            return
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            for prim in found:
                prim.SetInstanceable(False)
        left -= len(found)


def _skinned_prototypes(stage: Any) -> set[str]:
    """The paths of prototypes with skinned meshes, also in instances inside them, each of which is visited once."""
    from pxr import Usd, UsdSkel

    users: dict[str, list[str]] = {}
    stack = []
    for prototype in stage.GetPrototypes():
        path = str(prototype.GetPath())
        for prim in Usd.PrimRange(prototype):
            if prim.IsA(UsdSkel.Root):
                stack.append(path)
            elif prim.IsInstance():
                users.setdefault(str(prim.GetPrototype().GetPath()), []).append(path)
    found = set[str]()
    while stack:
        path = stack.pop()
        if path not in found:
            found.add(path)
            stack += users.get(path, [])
    return found
