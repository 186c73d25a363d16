"""Parts that surface shaders have in common: bases, glosses, metals, emission, relief and opacity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from engine.core.errors import printable_name
from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.diffuse import oren_nayar_terms
from engine.material.opacity import OPAQUE, Mode, Opacity
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Field, combine
from engine.scene.loaders.layer_stack import ONE, StackedLayer, covered
from engine.scene.loaders.model import NO_EMISSION, Emission, UnshownProperty
from engine.scene.loaders.pbr_layers import SMOOTHEST, Film
from engine.scene.loaders.surface_inputs import SurfaceInputs, mean_of, plain, product, rgb_of

# The mean of max(cos(phi_i - phi_o), 0) sin(alpha) tan(beta), of Oren and Nayar's second term, over both hemispheres.
_MEAN_LEAN = 0.213961
_LEAST_FACING = 3e-5  # of a gloss, that of the index 1.01
# Of [OpenPBR]: Schlick's rise at 82°, where the edge tint counts.
_RISE_82 = (6.0 / 7.0) ** 5
_SIGMAS = np.linspace(0.0, 1.0, 101)
_RATIOS = 0.45 * _SIGMAS**2 / (_SIGMAS**2 + 0.09) / (1.0 - 0.5 * _SIGMAS**2 / (_SIGMAS**2 + 0.33))


@dataclass(frozen=True)
class SurfaceMaterial:
    """A material as layers, its emission, normal map and opacity, and what is not shown of it; images "#N" are maps of
    the `MapMaker` that it was made with."""

    layers: tuple[LayerDescription, ...]
    emission: Emission = NO_EMISSION
    bumps: Bumps = NO_BUMPS
    opacity: Opacity = OPAQUE
    unshown: tuple[UnshownProperty, ...] = ()


def rough_diffuse(diffuse: Field, roughness: float) -> StackedLayer:
    """Even light, or Oren and Nayar's with sigma = roughness."""
    if roughness <= 0.0:
        return StackedLayer("base", "lambert", diffuse)
    return StackedLayer("base", "oren_nayar", diffuse, parameters={"sigma": min(roughness, 1.0)})


def preserving_diffuse(diffuse: Field, roughness: float) -> StackedLayer:
    """OpenPBR's base [Portsmouth25]: A (1 + r s / t) and light that is reflected several times. It is the Oren-Nayar
    layer whose second term is as large against its first, up to r = 0.66, with the same mean albedo."""
    if roughness <= 0.0:
        return rough_diffuse(diffuse, 0.0)
    sigma = float(np.interp(roughness, _RATIOS, _SIGMAS))
    once = (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * math.pi)) * roughness) / (1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * roughness)
    constant_term, rough_term = oren_nayar_terms(sigma)
    ours = constant_term + _MEAN_LEAN * rough_term
    return rough_diffuse(combine(lambda rho: rho * once / (1.0 - rho * (1.0 - once)) / ours, diffuse), sigma)


def glossy_base(
    base: list[StackedLayer], share: Field, roughness: Field, facing: float, tint: Field, film: Film | None
) -> list[StackedLayer]:
    """The layers of a base beneath a gloss that reflects `facing` head-on, in this share of all."""
    if facing < _LEAST_FACING or is_everywhere(tint, 0.0):
        return [replace(each, share=product(each.share, share)) for each in base]
    if film is None:
        gloss = StackedLayer("gloss", "varnish", tint, roughness=roughness, parameters={"ior": _index(facing)})
        return [replace(each, share=product(each.share, share)) for each in covered(base, gloss, ONE)]
    own = {"f0": (facing,) * 3, "f90": 1.0, "film": film.strength, "film_ior": film.ior, "thickness": film.thickness}
    found = [
        replace(each, model="thin_film_base", parameters=own, follows="gloss")
        if each.model in ("lambert", "oren_nayar") else each
        for each in base
    ]  # fmt: skip
    found.append(StackedLayer("gloss", "thin_film", tint, roughness=roughness, parameters=own))
    return [replace(each, share=product(each.share, share)) for each in found]


def streak_of(along: float, across: float) -> dict[str, float]:
    """The parameters of a `brushed` layer whose microfacets have these widths along and across the streak."""
    across = min(max(across, SMOOTHEST), 0.999)
    return {"alpha": plain(across), "anisotropy": plain(math.sqrt(max(min(along, 1.0) - across, 0.0) / (1.0 - across)))}


def brushed_metal(facing: Field, share: Field, streak: dict[str, float]) -> list[StackedLayer]:
    """A metal by what it reflects head-on and Schlick's term, whose highlight is a streak."""
    if facing.is_constant:
        own = {"f0": tuple(map(plain, rgb_of(facing.value.astype(float)).clip(0.0, 1.0).tolist())), "f90": 1.0}
        return [StackedLayer("metal", "brushed", ONE, share, None, own | streak)]
    rim = StackedLayer("metal edge", "brushed", ONE, share, None, {"f0": (0.0,) * 3, "f90": 1.0} | streak)
    return [StackedLayer("metal", "brushed", facing, share, None, {"f0": (1.0,) * 3, "f90": 0.0} | streak), rim]


def metal(facing: Field, edge: Field, share: Field, roughness: Field, film: Film | None) -> list[StackedLayer]:
    """A metal by what it reflects head-on and Schlick's term, times `edge` at 82° [OpenPBR]. Where the first varies, it
    multiplies a layer of its own; where the second does, Schlick's term ends where it meets it."""
    if film is not None:
        middle = rgb_of(mean_of(facing))
        own = {"f0": tuple(middle.clip(0.0, 1.0).tolist()), "f90": 1.0, "film": film.strength, "film_ior": film.ior,
               "thickness": film.thickness}  # fmt: skip
        relative = ONE if facing.is_constant else combine(lambda f: f / np.maximum(middle, 1e-6), facing)
        return [StackedLayer("metal", "thin_film", relative, share, roughness, own)]
    if edge.is_constant:
        tint = {"f82": tuple(map(plain, rgb_of(edge.value.astype(float)).clip(0.0, 1.0).tolist()))}
        if facing.is_constant:
            own = {"f0": tuple(map(plain, rgb_of(facing.value.astype(float)).clip(0.0, 1.0).tolist())), "f90": 1.0}
            return [StackedLayer("metal", "tinted_microfacet", ONE, share, roughness, own | tint)]
        rim = StackedLayer(
            "metal edge", "tinted_microfacet", ONE, share, roughness, {"f0": (0.0,) * 3, "f90": 1.0} | tint
        )
        head_on = {"f0": (1.0,) * 3, "f90": 0.0} | tint
        return [StackedLayer("metal", "tinted_microfacet", facing, share, roughness, head_on), rim]
    q = _RISE_82
    grazing = combine(lambda f, t: np.maximum(t * (f + (1.0 - f) * q) - f * (1.0 - q), 0.0) / q, facing, edge)
    return [
        StackedLayer("metal", "microfacet", facing, share, roughness, {"f0": (1.0,) * 3, "f90": 0.0}),
        StackedLayer("metal edge", "microfacet", grazing, share, roughness, {"f0": (0.0,) * 3, "f90": 1.0}),
    ]


def conductor(facing: Field, edge: Field, share: Field, roughness: Field, film: Film | None) -> list[StackedLayer]:
    """A metal by its colours head-on and at the edge [Gulbrandsen14], of which the exact Fresnel term follows; where
    they vary, Schlick's."""
    is_grey = share.is_constant and float(np.ptp(share.value)) == 0.0
    if film is not None or not (facing.is_constant and edge.is_constant and (is_grey or not share.is_constant)):
        return metal(facing, ONE, share, roughness, film)
    r = rgb_of(facing.value.astype(float)).clip(0.0, 0.99)
    g = rgb_of(edge.value.astype(float)).clip(0.0, 1.0)
    n = g * (1.0 - r) / (1.0 + r) + (1.0 - g) * (1.0 + np.sqrt(r)) / (1.0 - np.sqrt(r))
    k = np.sqrt(np.maximum((r * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - r), 0.0))
    own = {"eta": tuple(map(plain, n.clip(0.01, 20.0).tolist())), "k": tuple(map(plain, k.clip(0.0, 20.0).tolist()))}
    return [StackedLayer("metal", "rough_conductor", ONE, share, roughness, own)]


def _index(facing: float) -> float:
    root = math.sqrt(facing)
    return plain(min((1.0 + root) / (1.0 - root), 5.0))


def is_everywhere(values: Field, number: float) -> bool:
    """Whether a field is constant, and that number."""
    return values.is_constant and bool((values.value == number).all())


def film_of(inputs: SurfaceInputs, weight: str, index: str, thickness: float) -> Film | None:
    """A thin film, thickness in nm; None where its weight is 0."""
    strength = inputs.number(weight)
    return Film(strength, inputs.number(index, 1.0, 5.0), thickness) if strength > 0.0 else None


def emission_of(colour: Field, maps: MapMaker, *factors: Field) -> Emission:
    """Emitted radiance: the product of fields, of which the part that varies is a texture."""
    number, varying = product(colour, *factors).parts
    red, green, blue = np.clip(rgb_of(number), 0.0, MAX_RADIANCE).tolist()
    if red + green + blue == 0.0:
        return NO_EMISSION
    radiance = plain(red), plain(green), plain(blue)
    return Emission(radiance) if varying is None else Emission(radiance, maps.colours(varying))


def bumps_of(inputs: SurfaceInputs, name: str, maps: MapMaker) -> Bumps:
    """The normal map that an input comes from."""
    node = inputs.node_of(name)
    if node is None:
        if inputs.is_set(name):
            inputs.list(name, "one direction for all is that of the surface")
        return NO_BUMPS
    if node.category != "normalmap" or "in" not in node.inputs:
        inputs.list(name, f"relief by a node {printable_name(node.category, 40)} is not shown")
        return NO_BUMPS
    directions = inputs.of_input(node.inputs["in"], "vector3")
    if directions.is_constant:
        return NO_BUMPS
    strength = mean_of(inputs.of_input(node.inputs["scale"], "float")) if "scale" in node.inputs else np.ones(1)
    return bumps_of_colours(directions, abs(float(strength[0])), maps)


def bumps_of_colours(colours: Field, strength: float, maps: MapMaker) -> Bumps:
    """A normal map of colours, whose middle is flat."""
    file, placement = maps.normals(colours)
    own = placement.transform
    return Bumps(
        file, bump_strength=min(strength, BUMP_STRENGTH.maximum), bump_repeats=placement.repeats,
        bump_offset=own.offset, bump_wrap=own.wrap,
    )  # fmt: skip


def blended(opacity: Field, maps: MapMaker, mode: Mode = "blend", cutoff: float = 0.5) -> Opacity:
    """An opacity of this mode."""
    if opacity.is_constant:
        factor = float(np.clip(opacity.value[0], 0.0, 1.0))
        return OPAQUE if factor == 1.0 else Opacity(mode, cutoff, factor)
    file, placement = maps.opacity(opacity)
    own = placement.transform
    return Opacity(
        mode, cutoff, opacity_map=file, opacity_repeats=placement.repeats, opacity_offset=own.offset,
        opacity_rotation=own.rotation, opacity_wrap=own.wrap,
    )  # fmt: skip
