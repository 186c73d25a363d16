"""Surface shaders of MaterialX as layers: open_pbr_surface, standard_surface, gltf_pbr and UsdPreviewSurface.

The first two are stacks. With E the directional albedo of what lies above, w its weight, and m the metalness,

    fuzz      f = w f_fuzz + (1 − w E_fuzz) (…)                      `fuzz`, of [Zeltner22]
    coat      f = w f_coat + (1 − w E_coat) t (…)                    `varnish`; t: its colour and darkening
    metal     m f_metal, bright where rough                          `tinted_microfacet`, `metal`
    gloss     (1 − m) (f_gloss + (1 − E_gloss) …)                    `varnish`
    base      albedo / π, or of a rough surface                      `lambert`, `oren_nayar`, `rough_diffuse`

as MaterialX's own networks of these shaders have it [MaterialX, open_pbr_surface.mtlx, standard_surface.mtlx]; there,
standard_surface has its sheen between base and gloss. A thin film makes gloss and base those of
KHR_materials_iridescence. gltf_pbr is glTF's material (`engine.scene.loaders.pbr_layers`), UsdPreviewSurface a stack
as well (`engine.scene.loaders.mtlx_pbr`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from engine.material.bumps import Bumps
from engine.material.parameters import reflectance_of_index
from engine.scene.description import LayerDescription
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Array, Field, combine, constant
from engine.scene.loaders.graph_nodes import ImageSource, NodeFields
from engine.scene.loaders.layer_stack import ONE, StackedLayer, covered, layer_descriptions
from engine.scene.loaders.model import UnshownProperty
from engine.scene.loaders.mtlx_pbr import read_gltf_pbr, read_preview_surface
from engine.scene.loaders.pbr_layers import COAT, Film, with_coat_frame
from engine.scene.loaders.shader_graph import ShaderNode
from engine.scene.loaders.surface_inputs import Group, SurfaceInputs, mean_of, mixed, one_minus, product
from engine.scene.loaders.surface_parts import (
    SurfaceMaterial,
    blended,
    brushed_metal,
    bumps_of,
    conductor,
    emission_of,
    film_of,
    glossy_base,
    is_everywhere,
    metal,
    preserving_diffuse,
    rough_diffuse,
    streak_of,
)

LUMENS_A_WATT = 683.0  # docs/conventions.md
_OPAQUE = "surfaces are opaque that should let light through"
_SUBSURFACE = "light leaves the surface where it enters it"
_ROUND = "highlights are round where they should be streaks"
_THIN = "surfaces are opaque, and both sides reflect alike"
_EVEN = "the base is even under a thin film"
_MEAN_EDGE = "the edge of a metal has the mean of its image"


def surface_material(
    surface: ShaderNode, images: ImageSource, maps: MapMaker, positions: Field | None = None
) -> SurfaceMaterial:
    """The material of a surface shader; maps: takes its computed maps, after those of others; positions: see
    `NodeFields`. A shader that is not known is grey, and listed."""
    if surface.category not in _SHADERS:
        effect = "a surface shader that is not read: shown in a grey that can be edited"
        grey = LayerDescription(model="lambert", parameters={"albedo": (0.5, 0.5, 0.5)})
        return SurfaceMaterial((grey,), unshown=(UnshownProperty(f"materials.{surface.category}", 1, effect),))
    shader = _SHADERS[surface.category]
    inputs = SurfaceInputs(surface, NodeFields(images, positions), shader.groups, shader.effects)
    return replace(shader.read(inputs, maps), unshown=inputs.unshown())


# ------------------------------------------------------------------------------------------------ OpenPBR


def _open_pbr(inputs: SurfaceInputs, maps: MapMaker) -> SurfaceMaterial:
    weight, colour, metalness = (inputs.field(f"base_{name}") for name in ("weight", "color", "metalness"))
    gloss_weight = inputs.field("specular_weight")
    coat, coat_colour = inputs.field("coat_weight"), inputs.field("coat_color")
    coat_index = inputs.number("coat_ior", 1.01, 5.0)
    subsurface = inputs.field("subsurface_weight")
    if not is_everywhere(subsurface, 0.0):
        inputs.list("subsurface_weight", _SUBSURFACE)
    dim = _dimmed_by_coat(inputs, coat, coat_colour, coat_index, colour, gloss_weight, metalness)
    roughness = inputs.field("specular_roughness")
    if not is_everywhere(coat, 0.0):
        roughness = combine(_roughened, roughness, inputs.field("coat_roughness"), coat)
    film = film_of(inputs, "thin_film_weight", "thin_film_ior", inputs.number("thin_film_thickness", 0.0, 5.0) * 1000.0)
    if not coat.is_constant:
        inputs.list("coat_weight", "the index of the gloss below is that under the coat's mean")
    index = _under_coat(inputs.number("specular_ior", 1.0, 5.0), coat_index, float(mean_of(coat)[0]))
    facing = min(inputs.number("specular_weight", 0.0, 1e3) * float(reflectance_of_index(index)), 0.999)  # type: ignore[arg-type]
    rough = preserving_diffuse(colour, inputs.number("base_diffuse_roughness"))
    diffuse = mixed(product(weight, rough.strength), inputs.field("subsurface_color"), subsurface)
    base = [replace(rough, strength=diffuse)]
    if film is not None and base[0].parameters:
        inputs.list("base_diffuse_roughness", _EVEN)
    share = product(one_minus(metalness), dim)
    layers = glossy_base(base, share, roughness, facing, inputs.field("specular_color"), film)
    edge, shine = product(inputs.field("specular_color"), gloss_weight), product(metalness, gloss_weight, dim)
    stretched = _stretched(inputs, "specular_roughness_anisotropy", metalness, film)
    if stretched:
        width = float(mean_of(roughness)[0]) ** 2 * math.sqrt(2.0 / (1.0 + (1.0 - stretched) ** 2))
        layers += brushed_metal(product(weight, colour), shine, streak_of(width, (1.0 - stretched) * width))
    else:
        layers += metal(product(weight, colour), edge, shine, roughness, film)
    if not is_everywhere(coat, 0.0):
        varnish = StackedLayer(
            COAT, "varnish", roughness=inputs.field("coat_roughness"), parameters={"ior": coat_index}
        )
        layers = covered(layers, varnish, coat)
    fuzz = inputs.field("fuzz_weight")
    if not is_everywhere(fuzz, 0.0):
        fibres = {"roughness": max(inputs.number("fuzz_roughness"), 0.01)}
        layers = covered(
            layers, StackedLayer("fuzz", "fuzz", share=inputs.field("fuzz_color"), parameters=fibres), fuzz
        )
    luminance = product(inputs.field("emission_luminance"), constant(1.0 / LUMENS_A_WATT))
    through = _through_coat(inputs, "emission_luminance", coat, coat_colour, coat_index)
    emitted = emission_of(inputs.field("emission_color"), maps, luminance, through)
    described = layer_descriptions(layers, maps)
    bumps = _along_u(bumps_of(inputs, "geometry_normal", maps), stretched)
    opacity = blended(inputs.field("geometry_opacity"), maps)
    if not is_everywhere(coat, 0.0):
        bumps = bumps.with_coat(bumps_of(inputs, "geometry_coat_normal", maps))
    return SurfaceMaterial(with_coat_frame(described, bumps), emitted, bumps, opacity)


def _dimmed_by_coat(
    inputs: SurfaceInputs, coat: Field, coat_colour: Field, index: float, base: Field, gloss: Field, metalness: Field
) -> Field:
    """What a coat's colour, and light that it sends back into the base, leave of the base: K = 1 − (1 − F0) / n²,
    darkening (1 − K) / (1 − E K) with the base's albedo E."""
    albedo = mixed(
        mixed(base, inputs.field("subsurface_color"), inputs.field("subsurface_weight")),
        product(base, gloss),
        metalness,
    )
    returned = 1.0 - (1.0 - float(reflectance_of_index(index))) / index**2  # type: ignore[arg-type]
    darkened = combine(lambda e: (1.0 - returned) / (1.0 - np.clip(e, 0.0, 1.0) * returned), albedo)
    darkened = mixed(ONE, darkened, product(coat, inputs.field("coat_darkening")))
    return product(darkened, mixed(ONE, coat_colour, coat))


def _roughened(roughness: Array, coat_roughness: Array, coat: Array) -> Array:
    """The roughness of what is seen through a rough coat: (r^4 + 2 r_c^4)^(1/4)."""
    through = np.minimum(1.0, roughness**4 + 2.0 * coat_roughness**4) ** 0.25
    return np.asarray(roughness * (1.0 - coat) + through * coat)


def _under_coat(index: float, coat_index: float, coat: float) -> float:
    """The index of the base against what is above it, inverted where it would reflect totally."""
    ratio = index / coat_index
    return index * (1.0 - coat) + max(ratio, 1.0 / ratio) * coat


def _through_coat(inputs: SurfaceInputs, name: str, coat: Field, colour: Field, index: float) -> Field:
    """What a coat leaves of emitted light: its colour times the mean over views of (1 - F0) (1 - (1 - cos)^5), of which
    cosines weight the last factor to 20/21."""
    if not is_everywhere(coat, 0.0):
        inputs.list(name, "under the coat it shines alike to all sides")
    rest = 20.0 / 21.0 * (1.0 - float(reflectance_of_index(index)))  # type: ignore[arg-type]
    return mixed(ONE, product(colour, constant(rest)), coat)


# -------------------------------------------------------------------------------------------- Standard Surface


def _standard(inputs: SurfaceInputs, maps: MapMaker) -> SurfaceMaterial:
    weight, colour, metalness = inputs.field("base"), inputs.field("base_color"), inputs.field("metalness")
    coat, coat_colour = inputs.field("coat"), inputs.field("coat_color")
    gloss, tint = inputs.field("specular"), inputs.field("specular_color")
    deeper = combine(lambda c, a: 1.0 + np.clip(c, 0.0, 1.0) * a, coat, inputs.field("coat_affect_color"))
    subsurface = inputs.field("subsurface")
    diffuse = mixed(
        product(weight, _deepened(colour, deeper)), _deepened(inputs.field("subsurface_color"), deeper), subsurface
    )
    if not is_everywhere(subsurface, 0.0):
        inputs.list("subsurface", _SUBSURFACE)
    dim = mixed(ONE, coat_colour, coat)
    coat_roughness = inputs.field("coat_roughness")
    blurred = product(coat, inputs.field("coat_affect_roughness"), coat_roughness)
    roughness = mixed(inputs.field("specular_roughness"), ONE, blurred)
    thickness = inputs.number("thin_film_thickness", 0.0, 5000.0)
    film = Film(1.0, inputs.number("thin_film_IOR", 1.0, 5.0), thickness) if thickness > 0.0 else None
    base = [rough_diffuse(diffuse, inputs.number("diffuse_roughness"))]
    if film is not None and base[0].parameters:
        inputs.list("diffuse_roughness", _EVEN)
    sheen = inputs.field("sheen")
    if not is_everywhere(sheen, 0.0):
        fibres = StackedLayer(
            "sheen", "soft_sheen", share=inputs.field("sheen_color"),
            roughness=combine(np.sqrt, inputs.field("sheen_roughness")),
        )  # fmt: skip
        base = covered(base, fibres, sheen)
    facing = float(reflectance_of_index(inputs.number("specular_IOR", 1.0, 5.0)))  # type: ignore[arg-type]
    layers = glossy_base(base, product(one_minus(metalness), dim), roughness, facing, tint, film, gloss)
    stretched = _stretched(inputs, "specular_anisotropy", metalness, film)
    turn = inputs.number("specular_rotation") if stretched else 0.0
    if stretched:
        width, aspect = float(mean_of(roughness)[0]) ** 2, math.sqrt(1.0 - min(stretched, 0.98))
        layers += brushed_metal(
            product(weight, colour), product(metalness, dim), streak_of(width / aspect, width * aspect)
        )
    else:
        edge = product(gloss, tint)
        if not (edge.is_constant or is_everywhere(metalness, 0.0)):
            inputs.list("specular" if tint.is_constant else "specular_color", _MEAN_EDGE)
        layers += conductor(product(weight, colour), edge, product(metalness, dim), roughness, film)
    if not is_everywhere(coat, 0.0):
        varnish = StackedLayer(
            COAT, "varnish", roughness=coat_roughness, parameters={"ior": inputs.number("coat_IOR", 1.01, 5.0)}
        )
        layers = covered(layers, varnish, coat)
    through = _through_coat(inputs, "emission", coat, coat_colour, inputs.number("coat_IOR", 1.01, 5.0))
    emitted = emission_of(inputs.field("emission_color"), maps, inputs.field("emission"), through)
    opacity = combine(lambda each: each[:, :3] @ _LUMINANCE, inputs.field("opacity"))
    described = layer_descriptions(layers, maps)
    bumps, cover = _along_u(bumps_of(inputs, "normal", maps), stretched, turn), blended(opacity, maps)
    if not is_everywhere(coat, 0.0):
        bumps = bumps.with_coat(bumps_of(inputs, "coat_normal", maps))
    return SurfaceMaterial(with_coat_frame(described, bumps), emitted, bumps, cover)


_LUMINANCE = np.array([[0.2126], [0.7152], [0.0722]], np.float32)


def _along_u(bumps: Bumps, stretched: float, turn: float = 0.0) -> Bumps:
    """Bumps with the tangents of streaks, along u and turned by shares of a circle."""
    return replace(bumps, tangent_along_u=True, tangent_angle=360.0 * turn) if stretched else bumps


def _stretched(inputs: SurfaceInputs, name: str, metalness: Field, film: Film | None) -> float:
    """The anisotropy of a metal, 0 for a round highlight. That of a gloss is not shown."""
    found = inputs.number(name)
    if not found:
        return 0.0
    if film is not None or is_everywhere(metalness, 0.0):
        inputs.list(name, _ROUND)
        return 0.0
    if not is_everywhere(metalness, 1.0):
        inputs.list(name, "the metal's highlight is a streak, and that of the gloss is round")
    return found


def _deepened(colour: Field, exponent: Field) -> Field:
    """Colours raised to a power."""
    return colour if is_everywhere(exponent, 1.0) else combine(lambda c, e: np.maximum(c, 0.0) ** e, colour, exponent)


class _Shader(NamedTuple):
    """What reads a shader's inputs, and what of these is not shown, see `SurfaceInputs`."""

    read: Callable[[SurfaceInputs, MapMaker], SurfaceMaterial]
    groups: tuple[Group, ...]
    effects: Mapping[str, str]


_SHADERS = {
    "open_pbr_surface": _Shader(
        _open_pbr,
        (
            Group("transmission_weight", ("transmission_*",), _OPAQUE),
            Group("subsurface_weight", ("subsurface_*",), _SUBSURFACE),
            Group("coat_weight", ("coat_*", "geometry_coat_*")),
            Group("fuzz_weight", ("fuzz_*",)),
            Group("thin_film_weight", ("thin_film_*",)),
            Group("emission_luminance", ("emission_color",)),
            Group("specular_roughness_anisotropy", ("geometry_tangent",), _ROUND),
            Group("coat_roughness_anisotropy", ("geometry_coat_tangent",), _ROUND),
            Group("geometry_thin_walled", (), _THIN),
        ),
        {},
    ),
    "standard_surface": _Shader(
        _standard,
        (
            Group("transmission", ("transmission_*",), _OPAQUE),
            Group("subsurface", ("subsurface_*",), _SUBSURFACE),
            Group("sheen", ("sheen_*",)),
            Group("coat", ("coat_*",)),
            Group("thin_film_thickness", ("thin_film_IOR",)),
            Group("emission", ("emission_color",)),
            Group("specular_anisotropy", ("specular_rotation", "tangent"), _ROUND),
            Group("coat_anisotropy", ("coat_rotation",), _ROUND),
            Group("thin_walled", (), _THIN),
        ),
        {},
    ),
    "gltf_pbr": _Shader(
        read_gltf_pbr,
        (
            Group("transmission", ("thickness", "attenuation_*", "dispersion"), _OPAQUE),
            Group("iridescence", ("iridescence_*",)),
            Group("sheen_color", ("sheen_roughness",)),
            Group("clearcoat", ("clearcoat_*",)),
            Group("emissive", ("emissive_strength",)),
            Group("anisotropy_strength", ("anisotropy_rotation", "tangent"), _ROUND),
            Group("alpha_mode", ("alpha", "alpha_cutoff")),
        ),
        {},
    ),
    "UsdPreviewSurface": _Shader(
        read_preview_surface,
        (
            Group("clearcoat", ("clearcoatRoughness",)),
            Group("displacement", (), "the surface is where the mesh is"),
        ),
        {"opacityMode": "opacity is coverage"},
    ),
}
