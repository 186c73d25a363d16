"""What of a USD stage is not shown: every prim and every authored property that no reader asked for, by its schema and
name.

A prim of a schema that is not shown is listed as a whole, as are materials and shaders that nothing uses. Of a property
with time samples that is not a transform the first value is shown, and its animation listed. Not listed is what has no
effect on a picture by rays (`_HARMLESS`), and what is below a prim that is hidden, which is listed itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Set
from fnmatch import fnmatchcase

from engine.core.errors import printable_name
from engine.scene.loaders.gltf_unshown import LONGEST_NAME, MOST_LISTED, UNKNOWN, UNUSED
from engine.scene.loaders.model import UnshownProperty
from engine.scene.loaders.usd_prims import UsdPrim, UsdScene

# Patterns of names that are not listed: hints for speed, for other programs' windows, and what is known from elsewhere.
_HARMLESS = (
    "*.extent", "*.extentsHint", "*.ui:*", "*.xformOpOrder", "*.xformOp:*", "*.info:id", "*.info:implementationSource",
    "*.outputs:*", "*.proxyPrim", "*.material:binding*", "*.subsetFamily:*", "*.familyName", "Backdrop.*", "*.cacheId",
)  # fmt: skip
_HARMLESS_KINDS = frozenset({"Backdrop", "RenderSettings", "RenderProduct", "RenderVar", "RenderPass"})
_HARMLESS_SCHEMAS = frozenset(
    {
        "MaterialBindingAPI", "ShapingAPI", "ShadowAPI", "LightAPI", "GeomModelAPI", "NodeDefAPI", "ConnectableAPI",
        "CoordSysAPI", "CollectionAPI", "PrimvarsAPI", "VisibilityAPI", "XformCommonAPI", "MotionAPI", "SkelBindingAPI",
        "NodeGraphNodeAPI", "SceneGraphPrimAPI", "AssetPreviewsAPI", "ColorSpaceAPI", "MaterialXConfigAPI",
    }
)  # fmt: skip
_EFFECTS = (
    ("Skel*", "meshes are shown at rest: they do not bend"),
    ("BlendShape", "the shape without its blend shapes"),
    ("*.skel:*", "a mesh that does not bend"),
    ("*.primvars:skel:*", "a mesh that does not bend"),
    ("*Curves", "curves are not drawn"),
    ("NurbsPatch", "a surface that is not drawn"),
    ("TetMesh", "a body that is not drawn"),
    ("Points", "points are not drawn"),
    ("Volume", "smoke and clouds are not drawn"),
    ("*Asset", "smoke and clouds are not drawn"),
    ("*Light", "a lamp that is not lit"),
    ("*LightFilter", "the light is not filtered"),
    ("Physics*", "bodies do not move by themselves"),
    ("*.physics:*", "bodies do not move by themselves"),
    ("SpatialAudio", "no sound"),
    ("*Light*.*shadow:*", "the lamp's shadows are as those of all"),
    ("*Light*.*shaping:*", "the lamp shines as if it were bare"),
    ("*Light*.*texture:*", "the lamp has one radiance"),
    ("*Light*.light:*", "the lamp shines for everything"),
    ("*Light*.collection:*", "the lamp shines for everything"),
    ("*Light*.portals", "no effect: light of the whole dome is found"),
    ("*.primvars:displayColor*", "colours that the material does not use"),
    ("*.primvars:displayOpacity*", "opacity that the material does not use"),
    ("*.primvars:st*", "coordinates that no shown texture uses"),
    ("*.primvars:*", "data that no shown material uses"),
    ("*.velocities", "nothing is blurred by motion"),
    ("*.accelerations", "nothing is blurred by motion"),
    ("*.angularVelocities", "nothing is blurred by motion"),
    ("*.motion:*", "nothing is blurred by motion"),
    ("*.model:*", "the model itself is shown in place of cards or boxes"),
    ("*.userProperties:*", "data of an application"),
)
_NETWORKS = ("Material", "NodeGraph")  # whose connections lead on
_OF_SKINS = ("Skeleton", "SkelAnimation", "BlendShape")
_KEYS_OF_SKINS = (
    "joints", "jointNames", "*Transforms", "skel:*", "xformOp*", "translations", "rotations", "scales", "blendShape*",
    "offsets", "normalOffsets", "pointIndices", "inbetweens:*", "visibility", "purpose", "timeSamples",
)  # fmt: skip
_MOVING = "an animation that is not played: the pose at the stage's start is shown"
_ANIMATED = "an animation that is not played: the first value is shown"


def unshown_properties(scene: UsdScene, visited: set[str], played: Set[str] = frozenset()) -> list[UnshownProperty]:
    """What no reader has asked for, and what readers list as not shown; visited: the paths of all prims that the
    picture has or could have; played: those of animations of skins that play."""
    unread: Counter[str] = Counter()
    effects: dict[str, str] = {}
    are_posed = any("posed" in prim.own for prim in scene.prims)
    for prim in scene.prims:
        if are_posed and prim.kind in _OF_SKINS:
            if "moving" in prim.own and prim.place not in played:
                prim.not_shown("timeSamples", _MOVING)
            for key in prim.values:
                if not any(fnmatchcase(key, pattern) for pattern in _KEYS_OF_SKINS):
                    unread[f"{prim.kind}.{key}"] += 1
                    effects[f"{prim.kind}.{key}"] = UNKNOWN
        elif prim.place in visited:
            for name, effect in _of_prim(scene, prim):
                unread[name] += 1
                effects[name] = effect
        elif _is_unused(scene, prim, visited):
            unread[prim.kind] += 1
            effects[prim.kind] = UNUSED
    found = [UnshownProperty(name, n, effect) for (name, effect), n in scene.log.unshown.items()]
    names = sorted(name for name in unread if not any(fnmatchcase(name, pattern) for pattern in _HARMLESS))
    found += [UnshownProperty(name, unread[name], effects[name]) for name in names]
    if len(found) > MOST_LISTED:
        n_more = sum(each.count for each in found[MOST_LISTED:])
        found = [*found[:MOST_LISTED], UnshownProperty("others", n_more, "too many properties to list")]
    return [UnshownProperty(printable_name(each.name, LONGEST_NAME), each.count, each.effect) for each in found]


def _of_prim(scene: UsdScene, prim: UsdPrim) -> list[tuple[str, str]]:
    """The names of what nobody asked for of one prim, with their effects."""
    kind = prim.kind or "Prim"
    if id(prim.values) in scene.log.left_out:
        return [] if kind in _HARMLESS_KINDS else [(kind, _effect(kind))]
    read = scene.log.read.get(id(prim.values), set())
    found = []
    for key in prim.values:
        if "posed" in prim.own and key.removeprefix("primvars:").startswith("skel:"):
            continue
        if key not in read and not (kind in _NETWORKS and prim.source(key)):
            found.append((f"{kind}.{key}", _effect(f"{kind}.{key}")))
        elif isinstance(meta := prim.meta.get(key), dict) and "samples" in meta and not key.startswith("xformOp"):
            found.append((f"{kind}.{key}.timeSamples", _ANIMATED))
    schemas = {str(name).partition(":")[0] for name in prim.own.get("schemas", ())}
    found += [(name, _effect(name)) for name in sorted(schemas - _HARMLESS_SCHEMAS)]
    return found


def _is_unused(scene: UsdScene, prim: UsdPrim, visited: set[str]) -> bool:
    """Whether it is a material that nothing has, or a node that nothing in its material takes."""
    if prim.is_off or prim.kind not in ("Material", "Shader", "NodeGraph"):
        return False
    return prim.kind == "Material" or (prim.own["parent"] >= 0 and scene.prims[prim.own["parent"]].place in visited)


def _effect(name: str) -> str:
    return next((effect for pattern, effect in _EFFECTS if fnmatchcase(name, pattern)), UNKNOWN)
