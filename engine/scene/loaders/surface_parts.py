"""Parts that surface shaders have in common: bases, glosses, metals, emission, relief and opacity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from engine.core.errors import printable_name
from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.dielectric import schlick_curve
from engine.material.diffuse import rough_diffuse_mean
from engine.material.microfacet import conductor_fresnel
from engine.material.opacity import OPAQUE, Mode, Opacity
from engine.material.openpbr import lost_light, mean_seen_again
from engine.material.parameters import ETA, EXTINCTION
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.graph_fields import Array, Field, combine, constant
from engine.scene.loaders.layer_stack import ONE, StackedLayer, covered
from engine.scene.loaders.model import NO_EMISSION, Emission, UnshownProperty
from engine.scene.loaders.pbr_layers import SMOOTHEST, Film
from engine.scene.loaders.surface_inputs import (
    RGB,
    Float64Array,
    SurfaceInputs,
    mean_of,
    one_minus,
    plain,
    probes_of,
    product,
    rgb_of,
)

_ROUGH = 0.3  # of metals, from which light that facets scatter again counts by texels
_LEAST_FACING = 3e-5  # of a gloss, that of the index 1.01
# Of [OpenPBR]: Schlick's rise at 82°, where the edge tint counts.
_RISE_82 = (6.0 / 7.0) ** 5
# Of which one is mixed whose colour varies; fewer where roughness does, whose nodes share the layers of an object.
_N_METALS, _N_METALS_OF_WIDTHS = 5, 4
# Reflectances head-on for which their weights are found, cosines of facets and angles of views where they are compared.
_REFLECTANCES = np.linspace(0.0, 1.0, 65) ** 2
_FACETS = (np.arange(32) + 0.5) / 32
_VIEWS = np.array([0.3, 0.8, 1.2])


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
    """OpenPBR's base [Portsmouth25]. Light that is scattered again has the mean colour in its distribution, and in its
    amount each colour its own."""
    if roughness <= 0.0:
        return rough_diffuse(diffuse, 0.0)
    mean, several = rough_diffuse_mean(roughness), float(np.clip(mean_of(diffuse).mean(), 0.0, 1.0))

    def reflected(albedo: Array) -> Array:
        """What facets of an albedo reflect of light from all sides, over what the layer does."""
        again = [m * mean / (1.0 - m * (1.0 - mean)) for m in (np.clip(albedo, 0.0, 1.0), several)]
        return np.asarray(albedo * (mean + again[0] * (1.0 - mean)) / (mean + again[1] * (1.0 - mean)))

    own = {"roughness": min(roughness, 1.0), "several": plain(several)}
    return StackedLayer("base", "rough_diffuse", combine(reflected, diffuse), parameters=own)


def glossy_base(
    base: list[StackedLayer],
    share: Field,
    roughness: Field,
    facing: float,
    tint: Field,
    film: Film | None,
    weight: Field = ONE,
) -> list[StackedLayer]:
    """The layers of a base beneath a gloss that reflects `facing` head-on, in this share of all. The base loses what
    the gloss reflects by its weight; a tint takes only from the gloss."""
    tint = tint if film is None else product(tint, weight)
    if facing < _LEAST_FACING or is_everywhere(tint, 0.0) or is_everywhere(weight, 0.0):
        return [replace(each, share=product(each.share, share)) for each in base]
    if film is None:
        gloss = StackedLayer("gloss", "varnish", share=tint, roughness=roughness, parameters={"ior": _index(facing)})
        return [replace(each, share=product(each.share, share)) for each in covered(base, gloss, weight)]
    own = {"f0": (facing,) * 3, "f90": 1.0, "film": film.strength, "film_ior": film.ior, "thickness": film.thickness}
    found = [
        replace(each, model="thin_film_base", parameters=own, follows="gloss")
        if each.model in ("lambert", "oren_nayar", "rough_diffuse") else each
        for each in base
    ]  # fmt: skip
    found.append(StackedLayer("gloss", "thin_film", tint, roughness=roughness, parameters=own))
    return [replace(each, share=product(each.share, share)) for each in found]


def schlick_gloss(
    base: list[StackedLayer], share: Field, roughness: Field, facing: Float64Array, tint: Field
) -> list[StackedLayer]:
    """The layers of a base beneath a gloss with Schlick's term of `facing` (3,) times a tint, in this share of all. The
    base loses the mean of its colours."""
    mean = rgb_of(mean_of(tint)).mean()
    own = {"f0": _numbers(facing), "f90": 1.0}
    relative = combine(lambda each: each / max(mean, 1e-6), tint)
    gloss = StackedLayer("gloss", "schlick_varnish", share=relative, roughness=roughness, parameters=own)
    covered_base = covered(base, gloss, constant(float(mean)))
    return [replace(each, share=product(each.share, share)) for each in covered_base]


def streak_of(along: float, across: float) -> dict[str, float]:
    """The parameters of a `brushed` layer whose microfacets have these widths along and across the streak."""
    across = min(max(across, SMOOTHEST), 0.999)
    return {"alpha": plain(across), "anisotropy": plain(math.sqrt(max(min(along, 1.0) - across, 0.0) / (1.0 - across)))}


def brushed_metal(facing: Field, share: Field, streak: dict[str, float]) -> list[StackedLayer]:
    """A metal by what it reflects head-on and Schlick's term, whose highlight is a streak."""
    if facing.is_constant:
        own = {"f0": _numbers(facing.value), "f90": 1.0}
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
        tint = {"f82": _numbers(edge.value), "several": _numbers(_mean_seen(mean_of(facing), roughness))}
        if facing.is_constant:
            own = {"f0": _numbers(facing.value), "f90": 1.0}
            return [StackedLayer("metal", "tinted_microfacet", ONE, share, roughness, own | tint)]
        if float(mean_of(roughness)[0]) > _ROUGH:
            return _rough_painted_metal(facing, tint["f82"], share, roughness)
        rim = StackedLayer(
            "metal edge", "tinted_microfacet", ONE, share, roughness, {"f0": (0.0,) * 3, "f90": 1.0} | tint
        )
        head_on = {"f0": (1.0,) * 3, "f90": 0.0} | tint
        return [StackedLayer("metal", "tinted_microfacet", facing, share, roughness, head_on), rim]
    q, again = _RISE_82, {"f82": (1.0,) * 3, "several": _numbers(_mean_seen(mean_of(facing), roughness))}
    grazing = combine(lambda f, t: np.maximum(t * (f + (1.0 - f) * q) - f * (1.0 - q), 0.0) / q, facing, edge)
    return [
        StackedLayer("metal", "tinted_microfacet", facing, share, roughness, {"f0": (1.0,) * 3, "f90": 0.0} | again),
        StackedLayer(
            "metal edge", "tinted_microfacet", grazing, share, roughness, {"f0": (0.0,) * 3, "f90": 1.0} | again
        ),
    ]


def _rough_painted_metal(facing: Field, f82: RGB, share: Field, roughness: Field) -> list[StackedLayer]:
    """A metal whose colour b varies, with light that facets scatter again by the colour of each texel. With Schlick's
    term b A + B, the mean b + (1 − b) e of it, and k of the view,

        (b A + B) (1 + k (b + (1 − b) e))
            = b² A (1 + k) + (b − b²) A (1 + k e) + b B (1 + k) + (1 − b) B (1 + k e).
    """
    b = combine(lambda each: np.clip(each, 0.0, 1.0), facing)
    squared = combine(lambda each: each * each, b)
    rest = combine(lambda each: each - each * each, b)
    head_on, rim = {"f0": (1.0,) * 3, "f90": 0.0, "f82": f82}, {"f0": (0.0,) * 3, "f90": 1.0, "f82": f82}
    once, again = {"several": _numbers(_mean_seen(np.zeros(3), roughness))}, {"several": (1.0,) * 3}
    return [
        StackedLayer(name, "tinted_microfacet", strength, share, roughness, term | scattered)
        for name, strength, term, scattered in (
            ("metal", squared, head_on, again), ("metal, once", rest, head_on, once),
            ("metal edge", b, rim, again), ("metal edge, once", one_minus(b), rim, once),
        )
    ]  # fmt: skip


def _mean_seen(facing: Float64Array, roughness: Field) -> Float64Array:
    """What facets reflect of light that others sent to them, by Schlick's term; of the mean roughness."""
    return mean_seen_again(_alpha(roughness), lambda cosine: schlick_curve(facing, 1.0, cosine))


def _alpha(roughness: Field) -> float:
    return max(float(mean_of(roughness)[0]) ** 2, SMOOTHEST)


def _numbers(values: NDArray[np.floating]) -> RGB:
    """Three shares of one or three."""
    red, green, blue = rgb_of(np.asarray(values, float)).clip(0.0, 1.0).tolist()
    return plain(red), plain(green), plain(blue)


def conductor(facing: Field, edge: Field, share: Field, roughness: Field, film: Film | None) -> list[StackedLayer]:
    """A metal by its colours head-on and at the edge, of which the exact Fresnel term follows [Gulbrandsen14]; of an
    edge that varies the mean counts, unless it is the field that is seen head-on. Where that varies, metals of a few
    greys are mixed texel by texel. Under a film the term is Schlick's."""
    if film is not None:
        return metal(facing, ONE, share, roughness, film)
    tint = None if edge is facing else rgb_of(mean_of(edge))
    if facing.is_constant:
        colour = rgb_of(facing.value.astype(float))
        return [_exact_metal("metal", ONE, colour, tint, share, roughness)]
    greys = _greys(facing, _N_METALS if roughness.is_constant else _N_METALS_OF_WIDTHS)
    edges = [None] * 3 if tint is None else tint.tolist()
    alpha, layers = _alpha(roughness), list[StackedLayer]()
    weights = [_weights_of_greys(tuple(of.tolist()), edge, alpha) for of, edge in zip(greys, edges, strict=True)]
    for k, middle in enumerate(greys.T):
        weight = combine(partial(_looked_up, [each[:, k] for each in weights]), facing)
        layers.append(_exact_metal(f"metal {k + 1}", weight, middle, tint, share, roughness))
    return layers


def _greys(facing: Field, n: int) -> Float64Array:
    """Reflectances head-on (3, n), of each channel, from the lowest to the highest of a texture, the darker the closer;
    less than 0.02 is hardly seen."""
    probed = probes_of(facing)
    probed = np.broadcast_to(probed, (len(probed), 3))
    high = probed.max(axis=0).clip(0.04, 0.97)
    low = np.clip(probed.min(axis=0), 0.02, 0.5 * high)
    return np.linspace(np.cbrt(low), np.cbrt(high), n, axis=1) ** 3


def _exact_metal(
    name: str, strength: Field, facing: Float64Array, edge: Float64Array | None, share: Field, roughness: Field
) -> StackedLayer:
    n, k = _shown_index(*_conductor_index(facing, facing if edge is None else edge))
    own: dict[str, object] = {
        "eta": tuple(map(plain, n.tolist())), "k": tuple(map(plain, k.tolist())),
        "several": _numbers(_exact_seen_again(_alpha(roughness), n, k)),
    }  # fmt: skip
    return StackedLayer(name, "metal", strength, share, roughness, own)


def _exact_seen_again(alpha: float, n: Float64Array, k: Float64Array) -> Float64Array:
    """What facets of metals (N,) reflect of light that others sent to them: the mean of F by what those reflect, F."""
    once = mean_seen_again(alpha, lambda c: conductor_fresnel(c[:, None], n, k))
    twice = mean_seen_again(alpha, lambda c: conductor_fresnel(c[:, None], n, k) ** 2)
    return twice / np.maximum(once, 1e-9)


def _conductor_index(facing: Float64Array, edge: Float64Array) -> tuple[Float64Array, Float64Array]:
    """n and k of colours head-on and at the edge [Gulbrandsen14]."""
    r, g = facing.clip(0.0, 0.99), edge.clip(0.0, 1.0)
    n = g * (1.0 - r) / (1.0 + r) + (1.0 - g) * (1.0 + np.sqrt(r)) / (1.0 - np.sqrt(r))
    return n, np.sqrt(np.maximum((r * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - r), 0.0))


def _shown_index(n: Float64Array, k: Float64Array) -> tuple[Float64Array, Float64Array]:
    """n and k within the ranges of a layer's parameters."""
    return n.clip(ETA.minimum, ETA.maximum), k.clip(EXTINCTION.minimum, EXTINCTION.maximum)


@lru_cache(maxsize=64)
def _weights_of_greys(greys: tuple[float, ...], edge: float | None, alpha: float) -> Float64Array:
    """Weights (R, K) of metals of greys at `_REFLECTANCES`, of an edge, None for one of the same grey. What they
    reflect, F (1 + s (1 − E1) / E1) at angles of facets and views, has the least relative square error."""

    def index(facing: Float64Array) -> tuple[Float64Array, Float64Array]:
        return _conductor_index(facing, facing if edge is None else np.full_like(facing, edge))

    def reflected(n: Float64Array, k: Float64Array) -> Float64Array:
        """Of metals, (N, G) for N angles."""
        again = _exact_seen_again(alpha, n, k)
        once = conductor_fresnel(_FACETS[:, None], n, k)
        return np.concatenate([once * (1.0 + again * each) for each in lost_light(alpha, _VIEWS)])

    of_greys, found = reflected(*_shown_index(*index(np.array(greys)))), [np.zeros(len(greys))]
    for wanted in reflected(*index(_REFLECTANCES[1:])).T:
        found.append(nnls(of_greys / wanted[:, None], np.ones(len(wanted)), maxiter=1000)[0])
    return np.stack(found)


def _looked_up(weights: list[Float64Array], colours: Array) -> Array:
    """Weights (N, 3) of colours (N, 1 or 3), linear between their values (R,) at `_REFLECTANCES`, of each channel."""
    channels = np.broadcast_to(colours, (len(colours), 3)).T
    found = [np.interp(each, _REFLECTANCES, of) for each, of in zip(channels, weights, strict=True)]
    return np.stack(found, axis=1).astype(np.float32)


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
