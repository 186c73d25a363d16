"""COLLADA (.dae): triangles and polygons of the scene under their nodes' transforms, and the materials' colours and
diffuse images.

pycollada reads the file, in a process of its own (`engine.core.native_decoders`): what that returns is unchecked arrays
and a description. Polygons are cut by `engine.scene.polygons`. trimesh's reader, which asks pycollada as well, was
rejected: it ignores the axis that points up, leaves the unit to its caller, cuts polygons as fans and loses meshes
under skins, which are shown in their bind shape here. Colours are linear and images sRGB, as Blender reads and writes
them; a phong or blinn material is Lambert and Blinn-Phong, as of an OBJ file (`mtl_materials`).
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value, printable_name
from engine.core.native_decoders import Arrays, DecoderError, decode_natively
from engine.core.safe_files import read_regular_file
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.gltf_nodes import are_flat
from engine.scene.loaders.image_files import FileImages
from engine.scene.loaders.model import NO_EMISSION, RGB, Emission, ImportedModel, ImportedPart, UnshownProperty
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, join_meshes, mend_mesh, place_copies, with_flat_normals
from engine.scene.polygons import triangulate

LONGEST_NAME = 64
MOST_PLACES = 100_000
# Limit of vertices and faces of all copies, plus one for every byte: small files must not cost much.
MOST_COPIED = 1_000_000
# The axes of the file that are X, Y and Z here, and their signs.
_AXES = {"X_UP": ((1, 0, 2), (-1, 1, 1)), "Y_UP": ((0, 1, 2), (1, 1, 1)), "Z_UP": ((0, 2, 1), (1, 1, -1))}
_NOT_SHOWN = {
    "cameras": "views that are not offered", "lights": "lamps that are not lit", "animations": "nothing moves",
    "controllers": "meshes do not bend", "lines": "lines and points are not drawn",
}  # fmt: skip
_UNREAD = {
    "ambient": "", "reflective": "no mirror beside the highlight", "reflectivity": "no mirror beside the highlight",
    "index_of_refraction": "nothing shines through", "bumpmap": "the surface stays flat",
}  # fmt: skip


def read_dae(file: Path) -> ImportedModel:
    """Read a COLLADA file; raises LoadError."""
    data = read_regular_file(file, MAX_MESH_BYTES)
    try:
        arrays = decode_natively(decode_dae, data)
        described = json.loads(arrays["description"].tobytes())
    except (DecoderError, KeyError, ValueError) as error:
        raise LoadError(file, "COLLADA", str(error), "a COLLADA document with a scene") from None
    notes: dict[str, None] = {}
    by_material: dict[str, list[Mesh]] = {}
    n_copied, most = 0, MOST_COPIED + len(data)
    for k, primitive in enumerate(described["primitives"]):
        mesh, lines = mend_mesh(_mesh(arrays, k), file)
        notes |= dict.fromkeys(lines)
        matrices = np.array([described["places"][i] for i in primitive["places"]], np.float64).reshape(-1, 4, 4)
        matrices = _turned(matrices, described["up"], float(described["unit"]), file)
        matrices = matrices[~(flat := are_flat(matrices))]
        n_copied += (len(mesh.vertices) + len(mesh.triangles)) * len(matrices)
        if n_copied > most:
            raise LoadError(
                file, "vertices and faces of all copies", n_copied, f"at most {most} in a file of this size"
            )
        if flat.any():
            notes["meshes under flat transforms, as two scales of 0, are left out"] = None
        if not len(matrices):
            continue
        by_material.setdefault(primitive["material"], []).append(place_copies(mesh, matrices))
    if not by_material:
        why = f": {described['errors'][0]}" if described["errors"] else ""
        raise LoadError(file, "faces", 0, f"at least one mesh of triangles in the scene{why}")
    images = FileImages(file.parent)
    unread: dict[str, int] = {}
    parts = []
    for key, meshes in by_material.items():
        if any(mesh.normals is not None for mesh in meshes):
            meshes = [mesh if mesh.normals is not None else with_flat_normals(mesh)[0] for mesh in meshes]
        mesh, material = join_meshes(meshes), described["materials"].get(key, {})
        parts.append(_part(mesh, material, images, file.parent, notes))
        for name in material.get("unread", ()):
            unread[name] = unread.get(name, 0) + 1
    unshown = [UnshownProperty(name, n, _NOT_SHOWN[name]) for name, n in described["counts"].items() if n]
    unshown += [UnshownProperty(f"effect.{name}", n, _UNREAD[name]) for name, n in unread.items() if _UNREAD[name]]
    return ImportedModel(tuple(parts), (*notes, *described["errors"]), unshown=tuple(unshown))


def _mesh(arrays: Arrays, k: int) -> Mesh:
    """The primitive of that number, as unchecked as the arrays."""
    values = {name: arrays.get(f"{k} {name}") for name in ("vertices", "triangles", "normals", "uvs")}
    vertices, triangles = (np.asarray(values[name]) for name in ("vertices", "triangles"))
    normals = None if values["normals"] is None else np.asarray(values["normals"], np.float64)
    uvs = None if values["uvs"] is None else np.asarray(values["uvs"], np.float32)
    return Mesh(vertices.astype(np.float64), triangles.astype(np.int32), normals, uvs)


def _turned(matrices: npt.NDArray[np.float64], up: str, unit: float, file: Path) -> npt.NDArray[np.float64]:
    """The transforms to metres, Y up."""
    if not (np.isfinite(matrices).all() and 1e-9 <= unit <= 1e9):
        raise LoadError(file, "transforms, unit", unit, "finite matrices, a unit from 1e-09 to 1e+09 m")
    axes, signs = _AXES.get(up, _AXES["Y_UP"])
    turn = np.zeros((4, 4))
    turn[range(3), axes] = np.multiply(signs, unit)
    turn[3, 3] = 1.0
    return turn @ matrices


def _part(
    mesh: Mesh, material: Mapping[str, Any], images: FileImages, folder: Path, notes: dict[str, None]
) -> ImportedPart:
    """The part of a material."""
    name = printable_name(str(material.get("name", "")), LONGEST_NAME)
    if not material:
        return ImportedPart(mesh, name=name, smooth=mesh.normals is not None)
    maps = LayerMaps()
    if (image := material.get("image")) and mesh.uvs is not None:
        try:
            maps = LayerMaps(images.find(folder, unquote(str(image)).removeprefix("file://")), "srgb")
        except LoadError as error:
            notes[f"image {describe_value(image)} is not shown: {error.reason}"] = None
    base, glossy = _colour(material["diffuse"]), _colour(material["specular"])
    exponent = min(max(float(material["shininess"]), 0.0), 1e6)
    share = 8.0 / (exponent + 2.0)
    total = max(1.0, *(d + share * s for d, s in zip(base, glossy, strict=True)))
    albedo, scale = (_scaled(colour, by / total) for colour, by in ((base, 1.0), (glossy, share)))
    layers = [LayerDescription(model="lambert", maps=maps, parameters={"albedo": albedo})]
    if any(scale):
        parameters = {"exponent": exponent, "reflectance": 1.0, "scale": scale}
        layers.append(LayerDescription(model="blinn_phong", parameters=parameters))
    emission = _colour(material["emission"], MAX_RADIANCE)
    share = min(max(float(material["opacity"]), 0.0), 1.0)
    opacity = OPAQUE if share in (0.0, 1.0) else Opacity("blend", opacity_factor=share)
    return ImportedPart(
        mesh, tuple(layers), Emission(emission) if any(emission) else NO_EMISSION, opacity=opacity,
        smooth=mesh.normals is not None, name=name,
    )  # fmt: skip


def _colour(values: Any, most: float = 1.0) -> RGB:
    red, green, blue = (min(max(float(v), 0.0), most) for v in np.nan_to_num(np.asarray(values, np.float64)[:3]))
    return red, green, blue


def _scaled(colour: RGB, factor: float) -> RGB:
    red, green, blue = colour
    return red * factor, green * factor, blue * factor


def decode_dae(data: bytes) -> Arrays:
    """The primitives that the scene places and a description as JSON, for `decode_natively`: `description` and, for
    each primitive k, `k vertices` (V, 3), `k triangles` (T, 3), `k normals` (V, 3) and `k uvs` (T, 3, 2), v upwards."""
    import collada

    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise ValueError("a document type, expected none")
    document = collada.Collada(io.BytesIO(data), ignore=[collada.DaeError])
    described: dict[str, Any] = {
        "up": str(document.assetInfo.upaxis), "unit": float(document.assetInfo.unitmeter or 1.0), "places": [],
        "primitives": [], "materials": {}, "errors": [str(each)[:200] for each in document.errors[:8]],
        "counts": {"animations": len(document.animations), "controllers": len(document.controllers), "lines": 0},
    }  # fmt: skip
    if document.scene is None:
        raise ValueError("no scene")
    described["counts"] |= {f"{kind}s": sum(1 for _ in document.scene.objects(kind)) for kind in ("camera", "light")}
    arrays: dict[str, npt.NDArray[np.generic]] = {}
    known: dict[tuple[int, str], int] = {}
    for bound in _bound_geometries(document):
        described["places"].append(np.asarray(bound.matrix, np.float64).ravel().tolist())
        if len(described["places"]) > MOST_PLACES:
            raise ValueError(f"more than {MOST_PLACES} places of meshes")
        for primitive in bound.original.primitives:
            node = bound.materialnodebysymbol.get(primitive.material)
            material = None if node is None else node.target
            key = "" if material is None else str(material.id)
            if not hasattr(primitive, "vcounts") and not hasattr(primitive, "ntriangles"):
                described["counts"]["lines"] += 1
                continue
            number = known.get((id(primitive), key))
            if number is None:
                number = known[id(primitive), key] = len(described["primitives"])
                described["primitives"].append({"material": key, "places": []})
                own = _primitive_arrays(primitive, len(data), described["errors"])
                arrays |= {f"{number} {name}": each for name, each in own.items()}
                if material is not None and key not in described["materials"]:
                    described["materials"][key] = _material_words(material)
            described["primitives"][number]["places"].append(len(described["places"]) - 1)
    return {"description": np.frombuffer(json.dumps(described).encode(), np.uint8), **arrays}


def _bound_geometries(document: Any) -> Iterator[Any]:
    """The geometries of the scene, those of skins and morphs in their bind shape."""
    yield from document.scene.objects("geometry")
    for bound in document.scene.objects("controller"):
        if hasattr(bound, "geometry"):
            yield bound.geometry


def _primitive_arrays(primitive: Any, n_bytes: int, notes: list[str]) -> dict[str, npt.NDArray[np.generic]]:
    """The triangles of a set of triangles or polygons; n_bytes: of the file; notes: on polygons that are not cut."""
    vertices = np.asarray(primitive.vertex, np.float64)
    corners: npt.NDArray[np.int64] = np.asarray(primitive.vertex_index, np.int64).ravel()
    are_polygons = hasattr(primitive, "vcounts")
    lengths = np.asarray(primitive.vcounts, np.int64) if are_polygons else np.full(len(corners) // 3, 3)
    shown = np.repeat(lengths >= 3, lengths)
    triangles = triangulate(vertices[corners[shown]], lengths[lengths >= 3], n_bytes, notes.append)
    corners, found = corners[shown][triangles], dict[str, npt.NDArray[np.generic]]()
    if primitive.normal is not None and primitive.normal_index is not None:
        # A vertex for each pair of position and normal.
        normals = np.asarray(primitive.normal_index, np.int64).ravel()[shown][triangles]
        used, which = np.unique(np.stack([corners.ravel(), normals.ravel()], axis=1), axis=0, return_inverse=True)
        vertices, corners = vertices[used[:, 0]], which.reshape(-1, 3)
        found["normals"] = np.asarray(primitive.normal, np.float64)[used[:, 1]]
    if primitive.texcoordset:
        index = np.asarray(primitive.texcoord_indexset[0], np.int64).ravel()[shown][triangles]
        found["uvs"] = np.asarray(primitive.texcoordset[0])[index][..., :2].astype(np.float32)
    return {"vertices": vertices, "triangles": corners.astype(np.int32), **found}


def _material_words(material: Any) -> dict[str, Any]:
    """A material's name, colours, and which of its properties are not read."""
    effect = material.effect

    def colour(name: str, default: float) -> list[float]:
        value = getattr(effect, name, None)
        return [float(v) for v in value[:3]] if isinstance(value, tuple) else [default] * 3

    def number(name: str, default: float) -> float:
        value = getattr(effect, name, None)
        return float(value) if isinstance(value, (int, float)) else default

    image: Any = getattr(effect, "diffuse", None)
    is_image = image is not None and not isinstance(image, tuple)
    transparent = getattr(effect, "transparent", None)
    share = number("transparency", 1.0)
    if isinstance(transparent, tuple) and len(transparent) == 4:
        # RGB_ZERO says how much passes, others how much does not [COLLADA 1.4, 7].
        is_zero = str(getattr(effect, "opaque_mode", "")).endswith("RGB_ZERO")
        share = 1.0 - share * max(transparent[:3]) if is_zero else share * transparent[3]
    return {
        "name": str(material.name or material.id or ""),
        "image": str(image.sampler.surface.image.path) if image is not None and is_image else "",
        "diffuse": colour("diffuse", 1.0 if is_image else 0.8), "specular": colour("specular", 0.0),
        "shininess": number("shininess", 10.0), "emission": colour("emission", 0.0), "opacity": share,
        "unread": [
            name for name in ("reflective", "reflectivity", "index_of_refraction", "bumpmap")
            if getattr(effect, name, None) not in (None, 0.0, (0.0, 0.0, 0.0, 1.0), 1.0)
        ],
    }  # fmt: skip
