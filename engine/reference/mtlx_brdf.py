"""Surface shaders of MaterialX as its library builds them: a plain reading of the networks of open_pbr_surface,
standard_surface and UsdPreviewSurface, and of the BSDFs that these are made of [MaterialX, Physically Based Shading
Nodes; OpenPBR; StandardSurface].

The oracle of what files become here as layers; gltf_pbr has its own (`engine.reference.gltf_brdf`). Nothing is shared
with layers: no factors, no curves, no tables. Values are those at one point or at many, (N,) or (N, 3), with textures
applied; colours are linear. Directional albedos are integrals here, where the library has fits to these.

A layer on another is f = f_top + (1 - w E_top) f_base, with E by the view alone. Highlights are GGX's with Smith's
masking by height, times 1 + F (1 - E) / E for light that facets reflect several times [Turquin19].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]

LEAST_ALPHA = 0.01  # of all highlights, here as in the layers
_ROOTS = np.linspace(np.sqrt(LEAST_ALPHA), 1.0, 28)  # roughnesses of tables
_VIEWS = np.linspace(0.0, 1.0, 41) ** 2  # cosines
_VIEWS[0] = 1e-4
_N_SAMPLES = 1024
_FUJII = 0.5 - 2.0 / (3.0 * np.pi), 2.0 / 3.0 - 28.0 / (15.0 * np.pi)


@dataclass(frozen=True)
class OpenPbrInputs:
    """open_pbr_surface, by its names in files, of opaque and isotropic ones without a film."""

    base_weight: ArrayLike = 1.0
    base_color: ArrayLike = (0.8, 0.8, 0.8)
    base_diffuse_roughness: ArrayLike = 0.0
    base_metalness: ArrayLike = 0.0
    specular_weight: ArrayLike = 1.0
    specular_color: ArrayLike = (1.0, 1.0, 1.0)
    specular_roughness: ArrayLike = 0.3
    specular_ior: float = 1.5
    coat_weight: ArrayLike = 0.0
    coat_color: ArrayLike = (1.0, 1.0, 1.0)
    coat_roughness: ArrayLike = 0.0
    coat_ior: float = 1.6
    coat_darkening: ArrayLike = 1.0
    fuzz_weight: ArrayLike = 0.0
    fuzz_color: ArrayLike = (1.0, 1.0, 1.0)
    fuzz_roughness: float = 0.5


@dataclass(frozen=True)
class StandardInputs:
    """standard_surface, likewise."""

    base: ArrayLike = 1.0
    base_color: ArrayLike = (0.8, 0.8, 0.8)
    diffuse_roughness: ArrayLike = 0.0
    metalness: ArrayLike = 0.0
    specular: ArrayLike = 1.0
    specular_color: ArrayLike = (1.0, 1.0, 1.0)
    specular_roughness: ArrayLike = 0.2
    specular_IOR: float = 1.5  # noqa: N815  its name in files
    sheen: ArrayLike = 0.0
    sheen_color: ArrayLike = (1.0, 1.0, 1.0)
    sheen_roughness: float = 0.3
    coat: ArrayLike = 0.0
    coat_color: ArrayLike = (1.0, 1.0, 1.0)
    coat_roughness: ArrayLike = 0.1
    coat_IOR: float = 1.5  # noqa: N815


@dataclass(frozen=True)
class PreviewInputs:
    """UsdPreviewSurface, likewise."""

    diffuseColor: ArrayLike = (0.18, 0.18, 0.18)  # noqa: N815
    useSpecularWorkflow: int = 0  # noqa: N815
    specularColor: ArrayLike = (0.0, 0.0, 0.0)  # noqa: N815
    metallic: ArrayLike = 0.0
    roughness: ArrayLike = 0.5
    clearcoat: ArrayLike = 0.0
    clearcoatRoughness: ArrayLike = 0.01  # noqa: N815
    ior: float = 1.5


class _Pairs:
    """Pairs of directions (N, 3) with the cosines that BSDFs need, each (N, 1)."""

    def __init__(self, light: Float64Array, view: Float64Array) -> None:
        h = light + view
        h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
        self.light, self.view = light, view
        self.n_l, self.n_v = (np.maximum(each[:, 2:], 1e-9) for each in (light, view))
        self.n_h = h[:, 2:]
        self.v_h = np.clip(np.sum(view * h, axis=1, keepdims=True), 1e-9, 1.0)
        self.l_v = np.sum(light * view, axis=1, keepdims=True)


def open_pbr_brdf(a: OpenPbrInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """The BRDF (N, 3) in 1/sr for local unit directions to light and view (N, 3), z the normal."""
    p = _Pairs(light, view)
    base_color, weight, coat = _colour(a.base_color), _number(a.base_weight), _number(a.coat_weight)
    metalness, specular = _number(a.base_metalness), _number(a.specular_weight)
    # Roughness, and the index of the base, under a coat.
    own, above = _number(a.specular_roughness), _number(a.coat_roughness)
    roughness = own + (np.minimum(1.0, own**4 + 2.0 * above**4) ** 0.25 - own) * coat
    ratio = max(a.specular_ior / a.coat_ior, a.coat_ior / a.specular_ior)
    index = a.specular_ior + (ratio - a.specular_ior) * coat
    facing = np.clip(specular * ((index - 1.0) / (index + 1.0)) ** 2, 0.0, 0.99999)
    modulated = (1.0 + np.sqrt(facing)) / (1.0 - np.sqrt(facing))
    diffuse = weight * _energy_preserving(p, base_color, _number(a.base_diffuse_roughness))
    gloss, let_through = _dielectric(p, 1.0, _colour(a.specular_color), modulated, roughness)
    dielectric_base = gloss + let_through * diffuse
    metal, _ = _schlick(p, specular, weight * base_color, _colour(a.specular_color), 1.0, roughness)
    base = dielectric_base + (metal - dielectric_base) * metalness
    # What the coat's colour, and light that it sends back, leave.
    coat_f0 = ((a.coat_ior - 1.0) / (a.coat_ior + 1.0)) ** 2
    k = 1.0 - (1.0 - coat_f0) / a.coat_ior**2
    albedo = base_color + (base_color * specular - base_color) * metalness
    darkening = (1.0 - k) / (1.0 - albedo * k)
    base = base * (1.0 + (darkening - 1.0) * coat * _number(a.coat_darkening))
    base = base * (1.0 + (_colour(a.coat_color) - 1.0) * coat)
    varnish, let_through = _dielectric(p, coat, _colour(1.0), np.array([[a.coat_ior]]), above)
    found = varnish + let_through * base
    if np.any(_number(a.fuzz_weight) > 0.0):
        lobe, fuzz_albedo = _fuzz(p, a.fuzz_roughness)
        found = _number(a.fuzz_weight) * _colour(a.fuzz_color) * fuzz_albedo * lobe + found * (
            1.0 - _number(a.fuzz_weight) * fuzz_albedo
        )
    return _above(p, found)


def standard_surface_brdf(a: StandardInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """The same of standard_surface."""
    p = _Pairs(light, view)
    base_color, weight, coat = _colour(a.base_color), _number(a.base), _number(a.coat)
    roughness = _number(a.specular_roughness)
    base = weight * _oren_nayar(p, base_color, _number(a.diffuse_roughness))
    if np.any(_number(a.sheen) > 0.0):
        fibres, fibre_albedo = _sheen(p, a.sheen_roughness)
        share = _number(a.sheen)
        base = share * _colour(a.sheen_color) * fibres + (1.0 - share * fibre_albedo) * base
    index = np.array([[a.specular_IOR]])
    gloss, let_through = _dielectric(p, _number(a.specular), _colour(a.specular_color), index, roughness)
    plastic = gloss + let_through * base
    edge = _colour(a.specular_color) * _number(a.specular)
    metal = _conductor(p, weight * base_color, edge, roughness)
    found = plastic + (metal - plastic) * _number(a.metalness)
    found = found * (1.0 + (_colour(a.coat_color) - 1.0) * coat)
    varnish, let_through = _dielectric(p, coat, _colour(1.0), np.array([[a.coat_IOR]]), _number(a.coat_roughness))
    return _above(p, varnish + let_through * found)


def preview_surface_brdf(a: PreviewInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """The same of UsdPreviewSurface."""
    p = _Pairs(light, view)
    colour, roughness, metallic = _colour(a.diffuseColor), _number(a.roughness), _number(a.metallic)
    r2 = ((1.0 - a.ior) / (1.0 + a.ior)) ** 2
    if a.useSpecularWorkflow:
        gloss, let_through = _schlick(p, 1.0, _colour(a.specularColor), _colour(1.0), 1.0, roughness)
        found = gloss + let_through * colour / np.pi
    else:
        tint = 1.0 + (colour - 1.0) * metallic
        f0 = tint * r2 + (tint - tint * r2) * metallic
        gloss, let_through = _schlick(p, 1.0, f0, _colour(1.0), tint, roughness)
        plastic = gloss + let_through * (1.0 - metallic) * colour / np.pi
        metal = _conductor(p, colour, colour, roughness)
        found = plastic + (metal - plastic) * metallic
    coat, let_through = _schlick(p, _number(a.clearcoat), _colour(r2), _colour(1.0), 1.0, _number(a.clearcoatRoughness))
    return _above(p, coat + let_through * found)


def _above(p: _Pairs, found: Float64Array) -> Float64Array:
    return np.where((p.light[:, 2:] > 0.0) & (p.view[:, 2:] > 0.0), found, 0.0)


# ------------------------------------------------------------------------------------------------------- highlights


def _facets(p: _Pairs, roughness: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """D G / (4 NdotL NdotV), and what facets reflect of light by F = 1 - c and c, c = (1 - VdotH)^5, each (N, 1)."""
    alpha = np.maximum(roughness**2, LEAST_ALPHA)
    a2 = alpha**2
    distribution = a2 / (np.pi * (p.n_h**2 * (a2 - 1.0) + 1.0) ** 2)
    lengths = [np.sqrt(a2 + (1.0 - a2) * each**2) for each in (p.n_l, p.n_v)]
    value = distribution * 0.5 / (lengths[0] * p.n_v + lengths[1] * p.n_l)
    steady, rising = (_looked_up(table, alpha, p.n_v) for table in _albedo_tables())
    return value, steady, rising


def _dielectric(
    p: _Pairs, weight: Float64Array | float, tint: Float64Array, index: Float64Array, roughness: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """The BRDF (N, 3) of dielectric_bsdf's reflection, and what it lets through (N, 1)."""
    value, steady, rising = _facets(p, roughness)
    fresnel = _dielectric_fresnel(p.v_h, index)
    several = 1.0 + fresnel * (1.0 - steady - rising) / (steady + rising)
    albedo = _dielectric_albedo(index, np.maximum(roughness**2, LEAST_ALPHA), p.n_v)
    return value * fresnel * several * tint * weight, 1.0 - albedo * weight


def _dielectric_fresnel(c: Float64Array, index: ArrayLike) -> Float64Array:
    g = np.sqrt(np.asarray(index) ** 2 + c**2 - 1.0)
    return np.asarray(0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + (((g + c) * c - 1.0) / ((g - c) * c + 1.0)) ** 2))


def _dielectric_albedo(index: Float64Array, alpha: Float64Array, cosine: Float64Array) -> Float64Array:
    """The directional albedo (N, 1) of an index (1 or N, 1); where that varies, linear between four."""
    low, high = float(index.min()), float(index.max())
    if high - low < 1e-6:
        return _looked_up(_dielectric_table(round(low, 6)), alpha, cosine)
    knots = np.round(np.linspace(low, high, 4), 6)
    found = np.stack([_looked_up(_dielectric_table(float(each)), alpha, cosine) for each in knots])
    place = np.interp(np.broadcast_to(index, cosine.shape), knots, np.arange(4.0))
    k = np.minimum(place.astype(int), 2)[None]
    upper, lower = (np.take_along_axis(found, k + step, axis=0)[0] for step in (0, 1))
    return np.asarray(upper + (place - k[0]) * (lower - upper))


def _schlick(
    p: _Pairs,
    weight: Float64Array | float,
    f0: Float64Array,
    f82: Float64Array,
    f90: Float64Array | float,
    roughness: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """The BRDF (N, 3) of generalized_schlick_bsdf, and what it lets through (N, 1)."""
    edge = 1.0 / 7.0
    dip = (f0 + (f90 - f0) * (1.0 - edge) ** 5) * (1.0 - f82) / (edge * (1.0 - edge) ** 6)
    fresnel = f0 + (f90 - f0) * (1.0 - p.v_h) ** 5 - dip * p.v_h * (1.0 - p.v_h) ** 6
    value, steady, rising = _facets(p, roughness)
    several = 1.0 + fresnel * (1.0 - steady - rising) / (steady + rising)
    albedo = ((f0 * steady + f90 * rising) * several).mean(axis=1, keepdims=True)
    return value * fresnel * several * weight, 1.0 - albedo * weight


def _conductor(p: _Pairs, facing: Float64Array, edge: Float64Array, roughness: Float64Array) -> Float64Array:
    """The BRDF (N, 3) of conductor_bsdf with the index of artistic_ior [Gulbrandsen14]."""
    r = np.clip(facing, 0.0, 0.99)
    n = edge * (1.0 - r) / (1.0 + r) + (1.0 - edge) * (1.0 + np.sqrt(r)) / (1.0 - np.sqrt(r))
    k2 = np.maximum((r * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - r), 0.0)
    cos2 = p.v_h**2
    sin2 = 1.0 - cos2
    t0 = n**2 - k2 - sin2
    length = np.sqrt(t0**2 + 4.0 * n**2 * k2)
    t1, t2 = length + cos2, 2.0 * np.sqrt(np.maximum(0.5 * (length + t0), 0.0)) * p.v_h
    across = (t1 - t2) / (t1 + t2)
    t3, t4 = cos2 * length + sin2**2, t2 * sin2
    fresnel = 0.5 * across * (1.0 + (t3 - t4) / (t3 + t4))
    value, steady, rising = _facets(p, roughness)
    return value * fresnel * (1.0 + fresnel * (1.0 - steady - rising) / (steady + rising))


@lru_cache(maxsize=1)
def _albedo_tables() -> tuple[Float64Array, Float64Array]:
    """Directional albedos of F = 1 - c and of F = c, for `_ROOTS` and `_VIEWS`."""
    steady, rising = np.empty((2, len(_ROOTS), len(_VIEWS)))
    for place, share, cos_d in _seen_facets():
        c = (1.0 - cos_d) ** 5
        steady[place], rising[place] = (share * (1.0 - c)).mean(), (share * c).mean()
    return steady, rising


@lru_cache(maxsize=64)
def _dielectric_table(index: float) -> Float64Array:
    """Directional albedos of a dielectric, for `_ROOTS` and `_VIEWS`."""
    steady, rising = _albedo_tables()
    lost, found = 1.0 / (steady + rising) - 1.0, np.empty_like(steady)
    for place, share, cos_d in _seen_facets():
        fresnel = _dielectric_fresnel(np.maximum(cos_d, 1e-9), index)
        found[place] = (share * fresnel * (1.0 + fresnel * lost[place])).mean()
    return found


def _seen_facets() -> Iterator[tuple[tuple[int, int], Float64Array, Float64Array]]:
    """For each of `_ROOTS` and `_VIEWS` G2 / G1 (N,) of half vectors that are seen, and cosines of theta_d there, of
    evenly spread random numbers [Dupuy23]."""
    u = (np.arange(_N_SAMPLES) + 0.5) / _N_SAMPLES
    phi = 2.0 * np.pi * np.mod(np.arange(_N_SAMPLES) * 0.6180339887498949, 1.0)
    for i, alpha in enumerate(_ROOTS**2):
        for j, cos_o in enumerate(_VIEWS):
            view = np.array([np.sqrt(1.0 - cos_o**2), 0.0, cos_o])
            stretched = view * [alpha, alpha, 1.0]
            stretched /= np.linalg.norm(stretched)
            z = (1.0 - u) * (1.0 + stretched[2]) - stretched[2]
            sine = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
            half = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1) + stretched
            half = np.stack([half[:, 0] * alpha, half[:, 1] * alpha, np.maximum(half[:, 2], 0.0)], axis=1)
            half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-12)
            cos_d = half @ view
            cos_i = 2.0 * cos_d * half[:, 2] - cos_o
            seen = cos_i > 0.0
            cosines = np.where(seen, cos_i, 1.0), cos_o
            lambdas = [0.5 * np.sqrt(1.0 + alpha**2 * (1.0 / c**2 - 1.0)) - 0.5 for c in cosines]
            share = np.where(seen, (1.0 + lambdas[1]) / (1.0 + lambdas[0] + lambdas[1]), 0.0)
            yield (i, j), share, np.clip(cos_d, 0.0, 1.0)


def _looked_up(table: Float64Array, alpha: Float64Array, cosine: Float64Array) -> Float64Array:
    """A table (roots, views) at alpha (1 or N, 1) and cosines (N, 1), linear between its entries."""
    alpha = np.broadcast_to(alpha, cosine.shape)
    row = np.interp(np.sqrt(alpha), _ROOTS, np.arange(len(_ROOTS), dtype=float))
    column = np.interp(cosine, _VIEWS, np.arange(len(_VIEWS), dtype=float))
    i, j = np.minimum(row.astype(int), len(_ROOTS) - 2), np.minimum(column.astype(int), len(_VIEWS) - 2)
    s, t = row - i, column - j
    upper, lower = (table[i + k, j] * (1.0 - t) + table[i + k, j + 1] * t for k in (0, 1))
    return np.asarray(upper * (1.0 - s) + lower * s)


# ----------------------------------------------------------------------------------------------- diffuse and fibres


def _oren_nayar(p: _Pairs, colour: Float64Array, roughness: Float64Array) -> Float64Array:
    s = p.l_v - p.n_l * p.n_v
    lean = np.where(s > 0.0, s / np.maximum(p.n_l, p.n_v), 0.0)
    s2 = roughness**2
    return colour / np.pi * (1.0 - 0.5 * s2 / (s2 + 0.33) + 0.45 * s2 / (s2 + 0.09) * lean)


def _energy_preserving(p: _Pairs, colour: Float64Array, roughness: Float64Array) -> Float64Array:
    """[Portsmouth25]: light that is scattered once, and a term for all further times."""
    s = p.l_v - p.n_l * p.n_v
    lean = np.where(s > 0.0, s / np.maximum(p.n_l, p.n_v), s)
    a = 1.0 / (1.0 + _FUJII[0] * roughness)

    def albedo(cosine: Float64Array) -> Float64Array:
        sine = np.sqrt(1.0 - np.minimum(cosine, 1.0) ** 2)
        g = sine * (np.arccos(np.minimum(cosine, 1.0)) - sine * cosine)
        g = g + 2.0 / 3.0 * (sine / cosine * (1.0 - sine**3) - sine)
        return np.asarray(a + roughness * a * g / np.pi)

    mean = a * (1.0 + _FUJII[1] * roughness)
    several = colour**2 * mean / (1.0 - colour * np.maximum(1.0 - mean, 0.0))
    rest = [np.maximum(1.0 - albedo(each), 1e-6) for each in (p.n_v, p.n_l)]
    rests = rest[0] * rest[1] / np.maximum(1.0 - mean, 1e-6)
    return (colour * a * (1.0 + roughness * lean) + several * rests) / np.pi


def _sheen(p: _Pairs, roughness: float) -> tuple[Float64Array, Float64Array]:
    """The BRDF (N, 1) of sheen_bsdf [EstevezKulla17], without masking, and its directional albedo (N, 1)."""
    value = _fibres(p.n_l, p.n_v, p.n_h, roughness)
    return value, np.clip(np.interp(p.n_v, *_fibre_albedo(roughness)), 0.0, 1.0)


def _fibres(n_l: Float64Array, n_v: Float64Array, n_h: Float64Array, roughness: float) -> Float64Array:
    inverse = 1.0 / max(roughness, 0.005)
    distribution = (2.0 + inverse) * np.maximum(1.0 - n_h**2, 0.0) ** (0.5 * inverse) / (2.0 * np.pi)
    return np.asarray(distribution / (4.0 * (n_l + n_v - n_l * n_v)))


@lru_cache(maxsize=16)
def _fibre_albedo(roughness: float) -> tuple[Float64Array, Float64Array]:
    """Cosines of the view and albedos there."""
    views, steps = np.linspace(1e-3, 1.0, 80), (np.arange(256) + 0.5) / 256
    cosine, phi = (each.ravel() for each in np.meshgrid(steps, steps * np.pi))
    sine, found = np.sqrt(1.0 - cosine**2), list[float]()
    for view in views:
        half_z = (cosine + view) / np.sqrt(2.0 + 2.0 * (cosine * view + sine * np.cos(phi) * np.sqrt(1.0 - view**2)))
        value = _fibres(cosine, np.full_like(cosine, view), half_z, roughness)
        found.append(float((value * cosine).mean() * 2.0 * np.pi))
    return views, np.array(found)


def _fuzz(p: _Pairs, roughness: float) -> tuple[Float64Array, Float64Array]:
    """The lobe (N, 1) in 1/sr over NdotL, and the directional albedo (N, 1), of sheen_bsdf in its mode "zeltner"."""
    x, y = np.minimum(p.n_v, 1.0), float(np.clip(roughness, 0.01, 1.0))
    s = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y))
    m = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y)
    o = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y))
    albedo = np.exp(-0.5 * ((x - m) / s) ** 2) / (s * np.sqrt(2.0 * np.pi)) + o
    a_inv = (2.58126 * x + 0.813703 * y) * y / (1.0 + 0.310327 * x * x + 2.60994 * x * y)
    b_inv = np.sqrt(1.0 - x) * (y - 1.0) * y**3
    b_inv = b_inv / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y)
    # The light in the frame of the view, whose tangent is the view's: x and y from dot and cross products.
    sine = np.maximum(np.sqrt(1.0 - x * x), 1e-9)
    along = (p.l_v - p.light[:, 2:] * p.view[:, 2:]) / sine
    across2 = np.maximum(1.0 - p.light[:, 2:] ** 2 - along**2, 0.0)
    squared = (a_inv * along + b_inv * p.light[:, 2:]) ** 2 + a_inv**2 * across2 + p.light[:, 2:] ** 2
    return (a_inv / squared) ** 2 / np.pi, np.maximum(albedo, 0.0)


def _colour(value: ArrayLike) -> Float64Array:
    return np.broadcast_to(np.asarray(value, float), (3,))[None] if np.ndim(value) < 2 else np.asarray(value, float)


def _number(value: ArrayLike) -> Float64Array:
    return np.asarray(value, float).reshape(-1, 1)
