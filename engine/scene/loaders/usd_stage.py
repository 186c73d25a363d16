"""Reads the layers of a USD file with usd-core into one tree of prims, as JSON with arrays.

The library is native and its parsers meet strangers' files: both functions here are decoders, which run where the
program decides (`engine.core.native_decoders`). They open nothing by a name that a file gives. Each layer comes as
bytes, becomes an anonymous layer, and its references, payloads and sublayers are replaced by the anonymous layers that
the caller found for them (`usd_layers`); the others are removed, as value clips are.

The tree has what composition and schemas decide: which prims there are, the value of each authored property at one
time, of skinned meshes in their pose (`usd_skins`), the local transform, the material that is bound, prototypes, and
where a shader's input comes from. What it means for the picture is decided by those who read the tree (`usd_prims`).
"""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from engine.core.native_decoders import Arrays
from engine.scene.loaders.usd_looks import differ_in_materials_alone, selections
from engine.scene.loaders.usd_skeletons import SkinData, read_skins
from engine.scene.loaders.usd_skins import open_instances, pose_skins
from engine.scene.loaders.usd_variants import choose_variants, variant_sets

MOST_PRIMS, MOST_PROPERTIES = 500_000, 5_000_000
MOST_KEYS = 2_000  # of one prim's animation
MOST_WORDS = 10_000  # of a list of tokens
# Prims whose arrays are handed over; of others, and of other properties, their lengths.
_WITH_ARRAYS = frozenset({"Mesh", "GeomSubset"})
_ARRAYS = frozenset(
    {
        "points", "normals", "faceVertexCounts", "faceVertexIndices", "holeIndices", "indices", "creaseIndices",
        "creaseLengths", "creaseSharpnesses", "cornerIndices", "cornerSharpnesses",
    }
)  # fmt: skip
_TEMPORARY = re.compile(r"\S*insitu-usd-\S*?usd[ac]:?")  # where a layer was for a moment
_INNER = re.compile(r"parse error matching \S+")
_NETWORK = frozenset({"Material", "Shader", "NodeGraph"})


def pack_layers(header: Mapping[str, Any], layers: list[bytes]) -> bytes:
    """One message of a JSON header, to which the layers' sizes are added, and the layers."""
    text = json.dumps({**header, "sizes": [len(layer) for layer in layers]}).encode()
    return b"".join([len(text).to_bytes(8, "little"), text, *layers])


def _unpack_layers(data: bytes) -> tuple[dict[str, Any], list[bytes]]:
    end = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:end])
    ends = end + np.cumsum([0, *header["sizes"]])
    return header, [data[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True)]


# ------------------------------------------------------------------------------------------------------------- layers


def layer_dependencies(data: bytes) -> Arrays:
    """The paths of a layer's references, payloads and sublayers, as JSON; for `decode_natively`."""
    with _plain_errors():
        (layer,) = _open_layers([data])
    return {"paths": _json(sorted(layer.GetCompositionAssetDependencies()))}


@contextlib.contextmanager
def _plain_errors() -> Iterator[None]:
    """Raise the library's errors as a ValueError with what they say, without the place in its sources."""
    from pxr import Tf

    try:
        yield
    except Tf.ErrorException as error:
        said = str(getattr(error.args[0], "commentary", error)) if error.args else "cannot be read"
        raise ValueError(_INNER.sub("parse error", _TEMPORARY.sub("line ", said)).strip()) from None


def _open_layers(contents: list[bytes]) -> list[Any]:
    """Anonymous layers of these contents. The library reads files alone: they are gone once all are open."""
    from pxr import Sdf, Work

    Work.SetConcurrencyLimit(1)
    layers = []
    with tempfile.TemporaryDirectory(prefix="insitu-usd-", ignore_cleanup_errors=True) as folder:
        for k, content in enumerate(contents):
            path = Path(folder) / f"{k}.{'usdc' if content.startswith(b'PXR-USDC') else 'usda'}"
            path.write_bytes(content)
            layer = Sdf.Layer.OpenAsAnonymous(str(path))
            if layer is None:
                raise ValueError("cannot be read")
            layers.append(layer)
    return layers


def _link_layers(layers: list[Any], links: list[dict[str, int]]) -> int:
    """Replace what layers refer to by the layers that are there, and remove the rest; returns how many prims had value
    clips, which would be opened by their names."""
    n_clips = 0
    for layer, own in zip(layers, links, strict=True):
        for path in layer.GetCompositionAssetDependencies():
            target = own.get(path)
            layer.UpdateCompositionAssetDependency(path, "" if target is None else layers[target].identifier)
        for spec in _prim_specs(layer):
            for key in ("clips", "clipSets"):
                if spec.HasInfo(key):
                    spec.ClearInfo(key)
                    n_clips += key == "clips"
    return n_clips


def _prim_specs(layer: Any) -> Iterator[Any]:
    """All prims that a layer has opinions on, in variants too."""
    stack = list(layer.rootPrims)
    while stack:
        spec = stack.pop()
        yield spec
        stack += spec.nameChildren
        stack += [variant.primSpec for group in spec.variantSets for variant in group.variants]


# -------------------------------------------------------------------------------------------------------------- stage


def stage_tree(data: bytes) -> Arrays:
    """The tree of the stage of these layers, see `pack_layers`, whose first is the root; for `decode_natively`.

    tree: JSON with `prims` and the stage's `up`, `metres`, `start`, `seconds` for a time code, `n_clips`, `errors`,
    `sets` of variants and `looks`, variants with their prims; arrays by the names that the tree has for them.
    """
    from pxr import Usd

    header, contents = _unpack_layers(data)
    with _plain_errors():
        layers = _open_layers(contents)
        n_clips = _link_layers(layers, header["links"])
        stage = Usd.Stage.Open(layers[0], Usd.Stage.LoadAll)
        choose_variants(stage, header["variants"])
        sets = variant_sets(stage)
        writer = _TreeWriter(stage, layers, header["with_pose"])
        tree = writer.tree(n_clips)
        tree["sets"], tree["looks"] = sets, _looks(stage, layers, header, tree["prims"], writer.found)
        return {"tree": _json(tree), **writer.found}


def _looks(
    stage: Any, layers: list[Any], header: Mapping[str, Any], prims: list[dict[str, Any]], arrays: Arrays
) -> list[dict[str, Any]]:
    """The prims of the variants of the default prim, if these differ in materials alone, else nothing."""
    from pxr import Usd

    group, names = selections(stage)
    found: list[dict[str, Any]] = []
    if len(prims) * len(names) > MOST_PRIMS:
        return found
    for name in names:
        other = Usd.Stage.Open(layers[0], Usd.Stage.LoadAll)
        choose_variants(other, {**header["variants"], group: name})
        writer = _TreeWriter(other, layers, header["with_pose"])
        rows = writer.tree(0)["prims"]
        if not differ_in_materials_alone(prims, arrays, rows, writer.found):
            return []
        found.append({"name": name, "prims": rows})
    for row in prims if found else ():
        if row["path"] == str(stage.GetDefaultPrim().GetPath()):
            del row["variants"]  # all are shown
    return found


class _TreeWriter:
    """Writes the prims of a stage."""

    def __init__(self, stage: Any, layers: list[Any], with_pose: bool) -> None:
        from pxr import Usd

        self._stage = stage
        self._layers = {layer.identifier: k for k, layer in enumerate(layers)}
        has_range = stage.HasAuthoredTimeCodeRange()
        self._start = stage.GetStartTimeCode() if has_range else 0.0
        self._end = stage.GetEndTimeCode() if has_range else 0.0
        self._time = Usd.TimeCode(self._start) if has_range else Usd.TimeCode.EarliestTime()
        self._skins: SkinData = {}
        self._posed, self._moving = set[str](), set[str]()
        if with_pose:
            open_instances(stage)
            self._skins = read_skins(stage, self._start)
            self._posed, self._moving = pose_skins(stage, self._time)
        self.found: dict[str, np.ndarray] = {}
        self._n_properties = 0

    def tree(self, n_clips: int) -> dict[str, Any]:
        """The tree but for its looks; its arrays are in `found`."""
        from pxr import UsdGeom

        stage = self._stage
        prims = self._prims()
        errors = list(map(str, stage.GetCompositionErrors()))
        return {
            "up": str(UsdGeom.GetStageUpAxis(stage)), "metres": float(UsdGeom.GetStageMetersPerUnit(stage)),
            "start": self._start, "seconds": 1.0 / max(stage.GetTimeCodesPerSecond(), 1e-6), "n_clips": n_clips,
            "errors": errors[:64], "prims": prims,
        }  # fmt: skip

    def _prims(self) -> list[dict[str, Any]]:
        """All prims, each after its parent; those of prototypes after the others."""
        from pxr import Usd

        roots = [self._stage.GetPseudoRoot(), *self._stage.GetPrototypes()]
        stack = [(root, -1) for root in reversed(roots)]
        found: list[dict[str, Any]] = []
        prims = []
        while stack:
            prim, parent = stack.pop()
            if len(found) >= MOST_PRIMS:
                raise ValueError(f"has more than {MOST_PRIMS} prims")
            number = len(found)
            found.append(self._prim(prim, parent))
            prims.append(prim)
            children = prim.GetFilteredChildren(Usd.PrimAllPrimsPredicate)
            stack += [(child, number) for child in reversed(children)]
        self._add_materials(prims, found)
        return found

    def _add_materials(self, prims: list[Any], found: list[dict[str, Any]]) -> None:
        """The material that is bound to each prim by itself, its ancestors or a collection."""
        from pxr import UsdShade

        shown = [k for k, prim in enumerate(prims) if found[k]["kind"] and not prim.IsPseudoRoot()]
        bound, _ = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(
            [prims[k] for k in shown], UsdShade.Tokens.full
        )  # fmt: skip
        for k, material in zip(shown, bound, strict=True):
            if material:
                found[k]["material"] = str(material.GetPath())

    def _prim(self, prim: Any, parent: int) -> dict[str, Any]:
        from pxr import UsdGeom

        kind = str(prim.GetTypeName())
        own: dict[str, Any] = {"path": str(prim.GetPath()), "kind": kind, "parent": parent, "values": {}, "meta": {}}
        if prim.IsPseudoRoot() or not prim.IsActive():
            return own | {"off": "" if prim.IsPseudoRoot() else "inactive"}
        if prim.IsAbstract() or not (prim.IsDefined() or prim.IsPrototype()):
            own["off"] = "abstract" if prim.IsAbstract() else "over"
        for prop in prim.GetAuthoredProperties():
            self._property(prop, kind, own)
        if own["path"] in self._posed:
            own["posed"] = True
        if own["path"] in self._moving:
            own["moving"] = True
        if own["path"] in self._skins:
            skin = self._skins[own["path"]]
            key = "skin" if "skeleton" in skin else "joints"
            own[key] = {
                name: self._keep(value) if isinstance(value, np.ndarray) else value for name, value in skin.items()
            }
        schemas = list(map(str, prim.GetAppliedSchemas()))
        if schemas:
            own["schemas"] = schemas
        if prim.IsInstance():
            own["prototype"] = str(prim.GetPrototype().GetPath())
        sets = prim.GetVariantSets()
        names = sets.GetNames()
        if names:
            own["variants"] = {
                str(name): [sets.GetVariantSelection(name), list(sets.GetVariantSet(name).GetVariantNames())]
                for name in names
            }
        if prim.IsA(UsdGeom.Xformable):
            self._place(UsdGeom.Xformable(prim), own)
        if kind == "PointInstancer":
            self._instances(UsdGeom.PointInstancer(prim), own)
        return own

    def _place(self, xformable: Any, own: dict[str, Any]) -> None:
        """The local transform (4, 4), for column vectors, and its animation at the times of its samples and at every
        time code between them."""
        matrix = np.array(xformable.GetLocalTransformation(self._time)).T
        if (matrix != np.eye(4)).any():
            own["matrix"] = matrix.ravel().tolist()
        if xformable.GetResetXformStack():
            own["resets"] = True
        times = xformable.GetTimeSamples()
        if len(times) > 1:
            whole = np.arange(np.ceil(times[0]), min(times[-1], times[0] + MOST_KEYS))
            keys = np.unique(np.concatenate([times, whole]))
            own["keys"] = len(keys)
            keys = keys[:MOST_KEYS]
            own["times"] = self._keep(keys)
            own["matrices"] = self._keep(np.stack([np.array(xformable.GetLocalTransformation(t)).T for t in keys]))

    def _instances(self, instancer: Any, own: dict[str, Any]) -> None:
        """The matrices (N, 4, 4) of a point instancer's instances that are not masked, before the transforms of their
        prototypes, and which prototype each has (N,)."""
        from pxr import UsdGeom

        which = np.array(instancer.GetProtoIndicesAttr().Get(self._time) or [], np.int64)
        mask = instancer.ComputeMaskAtTime(self._time)
        own_places = UsdGeom.PointInstancer.ExcludeProtoXform
        matrices = instancer.ComputeInstanceTransformsAtTime(self._time, self._time, own_places)
        found = np.array(matrices, np.float64).reshape(-1, 4, 4).swapaxes(1, 2)
        if mask:
            which = which[np.array(mask, bool)]
        own["instances"], own["which"] = self._keep(found), self._keep(which)

    # -------------------------------------------------------------------------------------------------- properties

    def _property(self, prop: Any, kind: str, own: dict[str, Any]) -> None:
        from pxr import Usd, UsdLux

        self._n_properties += 1
        if self._n_properties > MOST_PROPERTIES:
            raise ValueError(f"has more than {MOST_PROPERTIES} properties")
        name = str(prop.GetName())
        if isinstance(prop, Usd.Relationship):
            own["values"][name] = {"paths": list(map(str, prop.GetTargets()))[:MOST_WORDS]}
            return
        with_arrays = kind in _WITH_ARRAYS and (name in _ARRAYS or name.startswith("primvars:"))
        is_primvar = name.startswith("primvars:") or name in ("normals", "points")
        own["values"][name] = value = self._value(prop, with_arrays or is_primvar)
        if name.endswith("colorTemperature") and isinstance(value, float):
            own["temperature"] = _plain(UsdLux.BlackbodyTemperatureAsRgb(value))
        meta: dict[str, Any] = {}
        if is_primvar:
            meta = {
                str(key): (int(value) if key == "elementSize" else str(value))
                for key in ("interpolation", "elementSize")
                if (value := prop.GetMetadata(key)) is not None
            }
            meta["type"] = str(prop.GetTypeName())
        if prop.HasColorSpace():
            meta["space"] = str(prop.GetColorSpace())
        n_samples = prop.GetNumTimeSamples()
        if n_samples > 1:
            meta["samples"] = n_samples
        if kind in _NETWORK and prop.HasAuthoredConnections():
            meta["from"] = self._sources(prop)
        if meta:
            own["meta"][name] = meta

    def _sources(self, prop: Any) -> list[str]:
        """The properties, of shaders or of an interface, that a property takes its value from."""
        from pxr import UsdShade

        name = prop.GetName()
        end = UsdShade.Input(prop) if name.startswith("inputs:") else UsdShade.Output(prop)
        found = [str(each.GetPath()) for each in UsdShade.Utils.GetValueProducingAttributes(end)] if end else []
        return [path for path in found if path != str(prop.GetPath())][:16]

    def _value(self, attribute: Any, with_arrays: bool) -> Any:
        """A property's value: numbers, texts and lists of them; `{"array": NAME}`, `{"omitted": LENGTH}`, `{"asset":
        PATH, "layer": K}`; None where it has none."""
        from pxr import Sdf

        value = attribute.Get(self._time)
        if isinstance(value, Sdf.AssetPath):
            return {"asset": value.path, "layer": self._layer_of(attribute)}
        if attribute.GetTypeName().isArray:
            if not hasattr(value, "__len__"):  # none, or of another type than the schema has
                return _plain(value)
            items = np.asarray(value) if len(value) else np.zeros(0)
            if items.dtype.kind not in "fiub":
                return {"words": list(map(str, value))[:MOST_WORDS]}
            return {"array": self._keep(items)} if with_arrays else {"omitted": len(value)}
        return _plain(value)

    def _layer_of(self, attribute: Any) -> int:
        """The layer whose opinion a value is, 0 where that is not known."""
        for spec in attribute.GetPropertyStack(self._time):
            if spec.HasInfo("default") or spec.HasInfo("timeSamples"):
                return self._layers.get(spec.layer.identifier, 0)
        return 0

    def _keep(self, array: np.ndarray) -> str:
        name = f"array {len(self.found)}"
        self.found[name] = array
        return name


def _plain(value: Any) -> Any:
    """A value that JSON has."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return _shortest(value)
    if hasattr(value, "GetImaginary"):  # a quaternion
        return [_shortest(float(value.GetReal())), *_plain(value.GetImaginary())]
    try:
        return list(map(_shortest, np.array(value, np.float64).ravel().tolist()))
    except (TypeError, ValueError):
        return {"other": type(value).__name__}


def _shortest(value: float) -> float:
    """A number of single precision as the shortest text that means it, 0.3 and not 0.30000001."""
    with np.errstate(over="ignore"):
        single = np.float32(value)
    return float(str(single)) if float(single) == value else value


def _json(value: Any) -> np.ndarray:
    return np.frombuffer(json.dumps(value).encode(), np.uint8)
