"""What glTF's materials look like here, against paths whose BRDF is the specification's own formula, at full resolution
of the textures: `python -m benchmarks.gltf_materials MUSEUM.exr [--side PIXELS] [CASE ...]` prints the table
of docs/guides/materials.md.

The judge is `engine.reference.gltf_brdf`; a sphere has factors alone, and a quad a texture of each colour, strength and
roughness (`benchmarks.material_pictures`).
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.material_pictures import Directions, MaterialCase, Texture, png, print_table
from engine.reference.gltf_brdf import GltfInputs, gltf_reflection
from engine.scene.primitives import quad, sphere


@dataclass(frozen=True)
class Case(MaterialCase):
    """material: of the file, without textures; inputs: what the judge makes of the factors; textures: by the place of
    their key in the file, such as "pbrMetallicRoughness.baseColorTexture", their channels; normals: the keys of normal
    maps, waves that both shapes have."""

    material: Mapping[str, Any]
    inputs: GltfInputs
    textures: Mapping[str, Sequence[Texture]] = field(default_factory=dict)
    normals: tuple[str, ...] = ()

    @property
    def channels(self) -> list[tuple[int, Texture]]:
        """The number of a texture and each of its channels."""
        return [(k, channel) for k, channels in enumerate(self.textures.values()) for channel in channels]

    def image(self, k: int) -> str:
        return f"model.glb#{k}"

    def write(self, shape: str, folder: Path) -> tuple[str, list[tuple[str, str]]]:
        (folder / "model.glb").write_bytes(_glb(self, shape))
        return 'mesh = "model.glb"', []

    def reflection(self, inputs: Any, base: Directions, coat: Directions) -> NDArray[np.float64]:
        return gltf_reflection(inputs, base, coat)


def _material(metallic: float = 0.0, roughness: float = 0.4, **extensions: Mapping[str, Any]) -> dict[str, Any]:
    pbr = {"baseColorFactor": [0.7, 0.4, 0.2, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    return {
        "pbrMetallicRoughness": pbr,
        "extensions": {f"KHR_materials_{name}": values for name, values in extensions.items()},
    }


_INPUTS = GltfInputs(base_color=(0.7, 0.4, 0.2), roughness=0.4)
_BASE = {"pbrMetallicRoughness.baseColorTexture": (Texture("base_color"),)}
_COAT, _SHEEN, _FILM, _OLD = (
    f"extensions.KHR_materials_{name}"
    for name in ("clearcoat", "sheen", "iridescence", "pbrSpecularGlossiness")
)  # fmt: skip
CASES: Mapping[str, Case] = {
    "core, plastic": Case(_material(), _INPUTS, _BASE),
    "core, metal": Case(_material(1.0), replace(_INPUTS, metallic=1.0), _BASE),
    "core, half a metal": Case(_material(0.5), replace(_INPUTS, metallic=0.5), _BASE),
    "clearcoat": Case(
        _material(0.0, 0.8, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.3),
        {**_BASE, f"{_COAT}.clearcoatTexture": (Texture("clearcoat", "r"),)},
    ),
    "clearcoat, its normals": Case(
        _material(0.0, 0.5, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.3),
        _BASE, (f"{_COAT}.clearcoatNormalTexture",),
    ),
    "clearcoat, base's normals": Case(
        _material(0.0, 0.5, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.3}),
        replace(_INPUTS, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.3), _BASE, ("normalTexture",),
    ),
    "sheen": Case(
        _material(0.0, 0.8, sheen={"sheenColorFactor": [0.8, 0.8, 0.8], "sheenRoughnessFactor": 0.5}),
        replace(_INPUTS, roughness=0.8, sheen_color=(0.8, 0.8, 0.8), sheen_roughness=0.5),
        {**_BASE, f"{_SHEEN}.sheenColorTexture": (Texture("sheen_color"),)},
    ),
    "specular": Case(
        _material(0.0, 0.3, specular={"specularFactor": 0.8, "specularColorFactor": [1.0, 0.6, 0.3]}),
        replace(_INPUTS, roughness=0.3, specular=0.8, specular_color=(1.0, 0.6, 0.3)),
        {**_BASE, "extensions.KHR_materials_specular.specularTexture": (Texture("specular", "a"),)},
    ),
    "specular colour, ior": Case(
        _material(0.0, 0.3, specular={"specularColorFactor": [1.0, 1.0, 1.0]}, ior={"ior": 2.4}),
        replace(_INPUTS, roughness=0.3, ior=2.4),
        {**_BASE, "extensions.KHR_materials_specular.specularColorTexture": (Texture("specular_color"),)},
    ),
    "iridescence, plastic": Case(
        _material(0.0, 0.3, iridescence={"iridescenceFactor": 1.0, "iridescenceThicknessMaximum": 450.0}),
        replace(_INPUTS, roughness=0.3, iridescence=1.0, iridescence_thickness=450.0),
        {**_BASE, f"{_FILM}.iridescenceTexture": (Texture("iridescence", "r"),)},
    ),
    "iridescence, metal": Case(
        _material(1.0, 0.3, iridescence={"iridescenceFactor": 0.8, "iridescenceIor": 1.8}),
        replace(_INPUTS, metallic=1.0, roughness=0.3, iridescence=0.8, iridescence_ior=1.8),
        {f"{_FILM}.iridescenceTexture": (Texture("iridescence", "r"),)},
    ),
    "anisotropy": Case(
        _material(1.0, 0.4, anisotropy={"anisotropyStrength": 0.8}),
        replace(_INPUTS, metallic=1.0, anisotropy=0.8),
        {**_BASE, "extensions.KHR_materials_anisotropy.anisotropyTexture": (Texture("anisotropy", "b"),)},
    ),
    "specular-glossiness": Case(
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.5, 0.3, 0.2, 1.0], "specularFactor": [0.6, 0.6, 0.6], "glossinessFactor": 0.6,
        }}},
        GltfInputs(base_color=(0.5, 0.3, 0.2), roughness=0.4, ior=0.0, specular_color=(0.6, 0.6, 0.6)),
        {f"{_OLD}.diffuseTexture": (Texture("base_color"),),
         f"{_OLD}.specularGlossinessTexture": (Texture("specular_color"), Texture("roughness", "a", 1.0))},
    ),
    "roughness, metalness": Case(
        _material(1.0, 0.9), replace(_INPUTS, metallic=1.0, roughness=0.9),
        {"pbrMetallicRoughness.metallicRoughnessTexture": (Texture("roughness", "g"), Texture("metallic", "b"))},
    ),
    "clearcoat roughness": Case(
        _material(0.0, 0.8, clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.6}),
        replace(_INPUTS, roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.6),
        {**_BASE, f"{_COAT}.clearcoatRoughnessTexture": (Texture("clearcoat_roughness", "g"),)},
    ),
    "sheen roughness": Case(
        _material(0.0, 0.8, sheen={"sheenColorFactor": [0.8, 0.8, 0.8], "sheenRoughnessFactor": 0.9}),
        replace(_INPUTS, roughness=0.8, sheen_color=(0.8, 0.8, 0.8), sheen_roughness=0.9),
        {**_BASE, f"{_SHEEN}.sheenRoughnessTexture": (Texture("sheen_roughness", "a"),)},
    ),
    "film thickness": Case(
        _material(1.0, 0.3, iridescence={
            "iridescenceFactor": 0.8, "iridescenceThicknessMinimum": 200.0, "iridescenceThicknessMaximum": 500.0,
        }),
        replace(_INPUTS, metallic=1.0, roughness=0.3, iridescence=0.8, iridescence_thickness=500.0),
        {f"{_FILM}.iridescenceThicknessTexture": (Texture("iridescence_thickness", "g", 200.0),)},
    ),
}  # fmt: skip


def _glb(case: Case, shape: str) -> bytes:
    """The case as a GLB file: of the quad with its textures, of the sphere with normal maps alone."""
    mesh = sphere() if shape == "sphere" else quad()
    corners = mesh.triangles.ravel()
    assert mesh.normals is not None and mesh.uvs is not None
    uvs = mesh.uvs.reshape(-1, 2) * [1.0, -1.0] + [0.0, 1.0]  # v grows downwards there
    parts = [mesh.vertices[corners].astype("<f4"), mesh.normals[corners].astype("<f4"), uvs.astype("<f4")]
    material = json.loads(json.dumps(case.material))
    textures = list(case.textures.items()) if shape == "quad" else []
    for k, path in enumerate((*(path for path, _ in textures), *case.normals)):
        *above, key = path.split(".")
        there = material
        for name in above:
            there = there.setdefault(name, {})
        there[key] = {"index": k}
    images = [png(k, channels) for k, (_, channels) in enumerate(textures)] + [_waves() for _ in case.normals]
    chunks = [each.tobytes() for each in parts] + images
    binary, views = b"", []
    for chunk in chunks:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(chunk)})
        binary += chunk + b"\0" * (-len(chunk) % 4)
    accessors = [
        {"bufferView": k, "componentType": 5126, "count": len(part), "type": f"VEC{part.shape[1]}"}
        for k, part in enumerate(parts)
    ]
    low, high = parts[0].min(axis=0).tolist(), parts[0].max(axis=0).tolist()
    accessors[0] |= {"min": low, "max": high}
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "material": 0}]}], "materials": [material],
        "textures": [{"source": k} for k in range(len(images))],
        "images": [{"bufferView": len(parts) + k, "mimeType": "image/png"} for k in range(len(images))],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}],
    }  # fmt: skip
    text = json.dumps({key: value for key, value in tree.items() if value}).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _waves() -> bytes:
    """A normal map of one wave each way, up to 14 degrees steep: broad, for a pixel has the mean of its normals. With
    two waves, up to 22 degrees, a coat of roughness 0.3 under the lamp is 9 % off."""
    slope = 0.25 * np.sin((np.arange(64) + 0.5) / 64 * 2.0 * np.pi)
    normals = np.stack(np.broadcast_arrays(slope[None, :], slope[:, None], 1.0), axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    buffer = io.BytesIO()
    Image.fromarray(np.round(127.5 + 127.5 * normals).astype(np.uint8), "RGB").save(buffer, "PNG")
    return buffer.getvalue()


def main() -> None:
    print_table(CASES, "benchmarks.gltf_materials")


if __name__ == "__main__":
    main()
