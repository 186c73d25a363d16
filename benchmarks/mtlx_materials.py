"""What surface shaders of MaterialX look like here, against paths whose BRDF is the shader's own formula, at full
resolution of the textures: `python -m benchmarks.mtlx_materials MUSEUM.exr [--side PIXELS] [CASE ...]` prints the
table of docs/accuracy.md.

The judges are `engine.reference.mtlx_brdf` and, of gltf_pbr, `engine.reference.gltf_brdf`; a sphere has factors alone,
and a quad a texture of each input that a case names (`benchmarks.material_pictures`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.material_pictures import Directions, MaterialCase, Texture, png, print_table
from engine.reference.gltf_brdf import GltfInputs, gltf_brdf
from engine.reference.mtlx_brdf import (
    OpenPbrInputs,
    PreviewInputs,
    StandardInputs,
    open_pbr_brdf,
    preview_surface_brdf,
    standard_surface_brdf,
)

Brdf = Callable[[Any, NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
_SHADERS: Mapping[type, tuple[str, Brdf]] = {
    OpenPbrInputs: ("open_pbr_surface", open_pbr_brdf),
    StandardInputs: ("standard_surface", standard_surface_brdf),
    PreviewInputs: ("UsdPreviewSurface", preview_surface_brdf),
    GltfInputs: ("gltf_pbr", gltf_brdf),
}


@dataclass(frozen=True)
class Case(MaterialCase):
    """inputs: those of the shader, whose class says which it is; textured: names of those that images multiply."""

    inputs: Any
    textured: tuple[str, ...]

    @property
    def channels(self) -> list[tuple[int, Texture]]:
        return [(k, self._texture(name)) for k, name in enumerate(self.textured)]

    def _texture(self, name: str) -> Texture:
        return Texture(name, None if np.ndim(getattr(self.inputs, name)) else "r")

    def image(self, k: int) -> str:
        return f"{k}.png"

    def write(self, shape: str, folder: Path) -> tuple[str, list[tuple[str, str]]]:
        shader, _ = _SHADERS[type(self.inputs)]
        nodes, inputs = "", ""
        for name, value in vars(self.inputs).items():
            kind = "color3" if np.ndim(value) else "integer" if isinstance(value, int) else "float"
            text = ", ".join(map(str, np.atleast_1d(value).tolist()))
            if shape == "sphere" or name not in self.textured:
                inputs += f'<input name="{name}" type="{kind}" value="{text}"/>'
                continue
            k = self.textured.index(name)
            (folder / self.image(k)).write_bytes(png(k, [self._texture(name)]))
            space = ' colorspace="srgb_texture"' if kind == "color3" else ""
            nodes += (
                f'<image name="i{k}" type="{kind}"><input name="file" type="filename" value="{k}.png"{space}/></image>'
            )
            nodes += f'<multiply name="m{k}" type="{kind}"><input name="in1" type="{kind}" nodename="i{k}"/>'
            nodes += f'<input name="in2" type="{kind}" value="{text}"/></multiply>'
            inputs += f'<input name="{name}" type="{kind}" nodename="m{k}"/>'
        surface = f'<{shader} name="s" type="surfaceshader">{inputs}</{shader}>'
        material = '<input name="surfaceshader" type="surfaceshader" nodename="s"/>'
        document = f'{nodes}{surface}<surfacematerial name="it" type="material">{material}</surfacematerial>'
        file = folder / "it.mtlx"
        file.write_text(f'<materialx version="1.39">{document}</materialx>', encoding="utf-8")
        return f'primitive = "{shape}"', [("it.material", str(file))]

    def reflection(self, inputs: Any, base: Directions, coat: Directions) -> NDArray[np.float64]:
        return _SHADERS[type(self.inputs)][1](inputs, *base) * np.maximum(base[0][:, 2:], 0.0)


_COLOUR = (0.7, 0.4, 0.2)
_OPEN = OpenPbrInputs(base_color=_COLOUR, specular_roughness=0.4)
_STANDARD = StandardInputs(base_color=_COLOUR, specular_roughness=0.4)
_PREVIEW = PreviewInputs(diffuseColor=_COLOUR, roughness=0.4)
_GLTF = GltfInputs(base_color=_COLOUR, roughness=0.4)
CASES: Mapping[str, Case] = {
    "OpenPBR, plastic": Case(_OPEN, ("base_color",)),
    "OpenPBR, rough base": Case(
        replace(_OPEN, base_diffuse_roughness=0.6, specular_weight=0.0), ("base_color", "base_weight")
    ),
    "OpenPBR, tinted gloss": Case(
        replace(_OPEN, specular_weight=0.8, specular_color=(1.0, 0.6, 0.3)), ("base_color", "specular_color")
    ),
    "OpenPBR, metal": Case(
        replace(_OPEN, base_metalness=1.0, specular_color=(1.0, 0.8, 0.5)), ("base_color", "specular_roughness")
    ),
    "OpenPBR, rough metal": Case(replace(_OPEN, base_metalness=1.0, specular_roughness=0.8), ("base_color",)),
    "OpenPBR, half a metal": Case(replace(_OPEN, base_metalness=0.5), ("base_color", "base_metalness")),
    "OpenPBR, coat": Case(
        replace(_OPEN, specular_roughness=0.6, coat_weight=1.0, coat_roughness=0.3, coat_color=(0.9, 0.8, 0.5)),
        ("base_color", "coat_color"),
    ),
    "OpenPBR, coat's share": Case(
        replace(_OPEN, specular_roughness=0.6, coat_weight=1.0, coat_roughness=0.3, coat_darkening=0.0),
        ("coat_weight",),
    ),
    "OpenPBR, fuzz": Case(
        replace(_OPEN, specular_roughness=0.6, fuzz_weight=0.8, fuzz_color=(0.8, 0.6, 0.9)),
        ("base_color", "fuzz_color"),
    ),
    "OpenPBR, fuzz of roughness 1": Case(
        replace(_OPEN, specular_roughness=0.6, fuzz_weight=0.8, fuzz_roughness=1.0), ("base_color", "fuzz_weight")
    ),
    "Standard, plastic": Case(_STANDARD, ("base_color",)),
    "Standard, tinted gloss": Case(
        replace(_STANDARD, specular=0.6, specular_color=(1.0, 0.6, 0.3)), ("base_color", "specular")
    ),
    "Standard, rough base": Case(replace(_STANDARD, diffuse_roughness=0.7, specular=0.0), ("base_color",)),
    "Standard, metal": Case(replace(_STANDARD, metalness=1.0), ("base_color", "specular_roughness")),
    "Standard, coat": Case(
        replace(_STANDARD, specular_roughness=0.6, coat=1.0, coat_roughness=0.3, coat_color=(0.9, 0.8, 0.5)),
        ("base_color", "coat_color"),
    ),
    "Standard, sheen": Case(replace(_STANDARD, sheen=0.8, sheen_roughness=0.5), ("base_color", "sheen_color")),
    "Preview, plastic": Case(_PREVIEW, ("diffuseColor", "roughness")),
    "Preview, metal": Case(replace(_PREVIEW, metallic=1.0), ("diffuseColor",)),
    "Preview, specular workflow": Case(
        replace(_PREVIEW, useSpecularWorkflow=1, specularColor=(0.3, 0.2, 0.1)), ("diffuseColor",)
    ),
    "Preview, coat": Case(
        replace(_PREVIEW, roughness=0.6, clearcoat=1.0, clearcoatRoughness=0.3), ("diffuseColor", "clearcoat")
    ),
    "glTF, plastic": Case(_GLTF, ("base_color",)),
    "glTF, metal": Case(replace(_GLTF, metallic=1.0), ("base_color", "roughness")),
    "glTF, coat": Case(
        replace(_GLTF, roughness=0.8, clearcoat=1.0, clearcoat_roughness=0.3), ("base_color", "clearcoat")
    ),
    "glTF, sheen": Case(
        replace(_GLTF, roughness=0.8, sheen_color=(0.8, 0.8, 0.8), sheen_roughness=0.5), ("base_color", "sheen_color")
    ),
}


def main() -> None:
    print_table(CASES, "benchmarks.mtlx_materials")


if __name__ == "__main__":
    main()
