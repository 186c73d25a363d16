"""glTF's materials as the specification prints them: a plain reading of its appendix B and of the extensions' formulas,
in their words [glTF20, B; KHR_materials_specular, _sheen, _clearcoat, _anisotropy, _iridescence].

The oracle of what files become here as layers. Nothing is shared with these: no factors, no curves, no tables. Values
are those at one point or at many, (N,) or (N, 3), with textures applied; colours are linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]

LEAST_ALPHA = 0.01  # of all highlights: mirrors are kept just rough enough to be sampled, here as in the layers
_XYZ_TO_REC709 = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


@dataclass(frozen=True)
class GltfInputs:
    """The inputs of the BRDF by their names in files, factor times texture."""

    base_color: ArrayLike = (1.0, 1.0, 1.0)
    metallic: ArrayLike = 0.0
    roughness: ArrayLike = 0.5
    ior: float = 1.5
    specular: ArrayLike = 1.0
    specular_color: ArrayLike = (1.0, 1.0, 1.0)
    sheen_color: ArrayLike = (0.0, 0.0, 0.0)
    sheen_roughness: ArrayLike = 0.5
    clearcoat: ArrayLike = 0.0
    clearcoat_roughness: ArrayLike = 0.0
    anisotropy: ArrayLike = 0.0
    iridescence: ArrayLike = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: ArrayLike = 400.0


def gltf_brdf(a: GltfInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """The BRDF (N, 3) in 1/sr for local unit directions to light and view (N, 3), z the normal, x the tangent."""
    # coated_material = mix(material, clearcoat_brdf, clearcoat * clearcoat_fresnel)
    blend = _coat_blend(a, view)
    return _material(a, light, view) * (1.0 - blend) + _coat(a, light, view) * blend


def gltf_reflection(
    a: GltfInputs, base: tuple[Float64Array, Float64Array], coat: tuple[Float64Array, Float64Array]
) -> Float64Array:
    """The BRDF times the cosine of the light (N, 3) where clearcoatNormal is not normal: directions to light and view
    in the frames of either. Each part is a surface with its own normal, and both coat factors take clearcoatNormal."""
    blend = _coat_blend(a, coat[1])
    beneath = _material(a, *base) * np.maximum(base[0][:, 2:], 0.0)
    return beneath * (1.0 - blend) + _coat(a, *coat) * np.maximum(coat[0][:, 2:], 0.0) * blend


def _coat_blend(a: GltfInputs, view: Float64Array) -> Float64Array:
    """clearcoat * clearcoat_fresnel, (N, 1)."""
    n_v = np.clip(view[:, 2], 0.0, 1.0)
    return np.asarray(_number(a.clearcoat) * (0.04 + 0.96 * (1.0 - n_v) ** 5)[:, None])


def _coat(a: GltfInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """clearcoat_brdf (N, 1), 0 below the horizon."""
    coat = _specular_brdf(a.clearcoat_roughness, 0.0, light, view, _half(light, view))
    return np.where((light[:, 2] > 0.0) & (view[:, 2] > 0.0), coat, 0.0)[:, None]


def _half(light: Float64Array, view: Float64Array) -> Float64Array:
    h = light + view
    return np.asarray(h / np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12))


def _material(a: GltfInputs, light: Float64Array, view: Float64Array) -> Float64Array:
    """The material (N, 3) under the coat, 0 below the horizon."""
    n_l, n_v, h = light[:, 2], view[:, 2], _half(light, view)
    v_h = np.abs(np.sum(view * h, axis=1))
    rise = ((1.0 - v_h) ** 5)[:, None]
    base_color, weight, metallic = _colour(a.base_color), _number(a.specular), _number(a.metallic)
    specular_brdf = _specular_brdf(a.roughness, a.anisotropy, light, view, h)[:, None]
    # dielectric_brdf = rgb_mix(diffuse_brdf, specular_brdf, dielectric_fresnel)
    f0 = np.minimum(((1.0 - a.ior) / (1.0 + a.ior)) ** 2 * _colour(a.specular_color), 1.0)
    dielectric_fresnel = weight * (f0 + (1.0 - f0) * rise)
    metal_fresnel = base_color + (1.0 - base_color) * rise
    iridescence = _number(a.iridescence)
    if np.any(iridescence > 0.0):
        film = a.iridescence_ior, _number(a.iridescence_thickness)
        thin, thin_metal = (_iridescent_fresnel(*film, base_f0, v_h) for base_f0 in (weight * f0, base_color))
        dielectric_fresnel = (1.0 - iridescence) * dielectric_fresnel + iridescence * thin
        metal_fresnel = (1.0 - iridescence) * metal_fresnel + iridescence * thin_metal
    let_through = 1.0 - dielectric_fresnel.max(axis=1, keepdims=True)
    dielectric = let_through * base_color / np.pi + dielectric_fresnel * specular_brdf
    # material = mix(dielectric_brdf, metal_brdf, metallic)
    material = (1.0 - metallic) * dielectric + metallic * metal_fresnel * specular_brdf
    # sheen_material = sheenColor * sheen_brdf + material * sheen_albedo_scaling, in the form by VdotN
    sheen_color = _colour(a.sheen_color)
    if np.any(sheen_color > 0.0):
        alpha_g = np.maximum(np.asarray(a.sheen_roughness, float) ** 2, LEAST_ALPHA)
        albedo = _sheen_albedos(alpha_g, n_v)[:, None]
        sheen = _sheen_brdf(alpha_g, n_l, n_v, h[:, 2])[:, None]
        material = sheen_color * sheen + material * (1.0 - sheen_color.max(axis=1, keepdims=True) * albedo)
    return np.where(((n_l > 0.0) & (n_v > 0.0))[:, None], material, 0.0)


def _specular_brdf(
    roughness: ArrayLike, anisotropy: ArrayLike, light: Float64Array, view: Float64Array, h: Float64Array
) -> Float64Array:
    """D G / (4 NdotL NdotV) of GGX, (N,), wider along the tangent by KHR_materials_anisotropy."""
    alpha, anisotropy = np.maximum(np.asarray(roughness, float) ** 2, LEAST_ALPHA), np.asarray(anisotropy, float)
    a_t, a_b = alpha + (1.0 - alpha) * anisotropy**2, alpha
    n_l, n_v = np.maximum(light[:, 2], 1e-9), np.maximum(view[:, 2], 1e-9)
    w2 = (h[:, 0] / a_t) ** 2 + (h[:, 1] / a_b) ** 2 + h[:, 2] ** 2
    distribution = 1.0 / (np.pi * a_t * a_b * w2**2)

    def length(w: Float64Array, n_w: Float64Array) -> Float64Array:
        return np.sqrt((a_t * w[:, 0]) ** 2 + (a_b * w[:, 1]) ** 2 + n_w**2)

    if np.any(anisotropy > 0.0):  # the extension prints the form by height, the core specification the separable one
        return np.asarray(distribution * 0.5 / (n_l * length(view, n_v) + n_v * length(light, n_l)))
    return np.asarray(distribution / ((n_l + length(light, n_l)) * (n_v + length(view, n_v))))


def _sheen_brdf(alpha_g: ArrayLike, n_l: Float64Array, n_v: Float64Array, n_h: Float64Array) -> Float64Array:
    inv_r = 1.0 / np.asarray(alpha_g, float)
    sin2h = np.maximum(1.0 - n_h**2, 0.0)
    distribution = (2.0 + inv_r) * sin2h ** (inv_r * 0.5) / (2.0 * np.pi)
    n_l, n_v = np.maximum(n_l, 1e-9), np.maximum(n_v, 1e-9)
    lambdas = _lambda_sheen(n_v, alpha_g) + _lambda_sheen(n_l, alpha_g)
    return np.asarray(distribution / ((1.0 + lambdas) * (4.0 * n_v * n_l)))


def _lambda_sheen(cos_theta: Float64Array, alpha_g: ArrayLike) -> Float64Array:
    def fit(x: Float64Array) -> Float64Array:
        t = (1.0 - np.asarray(alpha_g, float)) ** 2
        a, b = 21.5473 + t * (25.3245 - 21.5473), 3.82987 + t * (3.32435 - 3.82987)
        c, d = 0.19823 + t * (0.16801 - 0.19823), -1.97760 + t * (-1.27393 + 1.97760)
        e = -4.32054 + t * (-4.85967 + 4.32054)
        return np.asarray(a / (1.0 + b * x**c) + d * x + e)

    low, high = np.minimum(cos_theta, 0.5), np.maximum(cos_theta, 0.5)
    return np.where(cos_theta < 0.5, np.exp(fit(low)), np.exp(2.0 * fit(np.array(0.5)) - fit(1.0 - high)))


def _sheen_albedos(alpha_g: Float64Array, views: Float64Array) -> Float64Array:
    """E (N,) at cosines (N,), for one alpha or (N,); between sixteen ones where it varies."""
    if alpha_g.size == 1:
        return np.asarray(np.interp(views, *_sheen_albedo(float(alpha_g))))
    roots = np.linspace(np.sqrt(LEAST_ALPHA), 1.0, 16)
    table = np.array([np.interp(views, *_sheen_albedo(float(root**2))) for root in roots])
    place = np.interp(np.sqrt(alpha_g), roots, np.arange(16.0))
    low = np.minimum(place.astype(int), 14)
    rows = np.arange(len(views))
    return np.asarray(table[low, rows] + (place - low) * (table[low + 1, rows] - table[low, rows]))


@lru_cache(maxsize=32)
def _sheen_albedo(alpha_g: float) -> tuple[Float64Array, Float64Array]:
    """Cosines of the view (V,) and E (V,): the integral of sheen_brdf NdotL over light from all directions."""
    views = np.linspace(0.01, 1.0, 100)
    steps = (np.arange(256) + 0.5) / 256
    cosine, phi = (each.ravel() for each in np.meshgrid(steps**2, steps * np.pi))  # dense at grazing angles
    area = np.broadcast_to(2.0 * steps, (256, 256)).ravel()
    sine = np.sqrt(1.0 - cosine**2)
    light, found = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1), list[float]()
    for view in views:
        h = light + np.array([np.sqrt(1.0 - view**2), 0.0, view])
        n_h = h[:, 2] / np.linalg.norm(h, axis=1)
        value = _sheen_brdf(alpha_g, cosine, np.full_like(cosine, view), n_h)
        found.append(float((value * cosine * area).mean() * 2.0 * np.pi))
    return views, np.array(found)


def _iridescent_fresnel(
    film_ior: float, thickness: Float64Array, base_f0: Float64Array, cos1: Float64Array
) -> Float64Array:
    """iridescent_fresnel (N, 3) of a film in air, thickness (1 or N, 1) in nm, on a base with F0 (1 or N, 3)."""
    cos1 = cos1[:, None]
    cos2 = np.sqrt(np.maximum(1.0 - (1.0 / film_ior) ** 2 * (1.0 - cos1**2), 0.0))
    # First interface, air to film.
    r12 = _schlick(((film_ior - 1.0) / (film_ior + 1.0)) ** 2, cos1)
    t121 = 1.0 - r12
    phi21 = np.pi if film_ior >= 1.0 else 0.0
    # Second interface, film to base, whose index follows from its F0.
    root = np.sqrt(np.minimum(base_f0 + 0.0001, 0.9999))
    base_ior = (1.0 + root) / (1.0 - root)
    r23 = _schlick(((base_ior - film_ior) / (base_ior + film_ior)) ** 2, cos2)
    phi = phi21 + np.where(base_ior < film_ior, np.pi, 0.0)
    opd = 2.0 * film_ior * thickness * cos2
    # Analytic spectral integration.
    r123 = np.clip(r12 * r23, 1e-5, 0.9999)
    rs = t121**2 * r23 / (1.0 - r123)
    total, cm = r12 + rs, rs - t121
    for m in (1, 2):
        cm = cm * np.sqrt(r123)
        total = total + cm * 2.0 * _sensitivity(m * opd, m * phi)
    return np.maximum(total, 0.0)


def _sensitivity(opd: Float64Array, shift: Float64Array) -> Float64Array:
    """evalSensitivity (N, 3): the CIE matching functions' Fourier transforms by Gaussians, as Rec. 709."""
    phase = 2.0 * np.pi * opd * 1e-9
    val = np.array([5.4856e-13, 4.4201e-13, 5.2481e-13])
    pos = np.array([1.6810e6, 1.7953e6, 2.2084e6])
    var = np.array([4.3278e9, 9.3046e9, 6.6121e9])
    xyz = val * np.sqrt(2.0 * np.pi * var) * np.cos(pos * phase + shift) * np.exp(-(phase**2) * var)
    more = np.cos(2.2399e6 * phase + shift[:, :1]) * np.exp(-4.5282e9 * phase**2)
    xyz[:, :1] += 9.7470e-14 * np.sqrt(2.0 * np.pi * 4.5282e9) * more
    return np.asarray((xyz / 1.0685e-7) @ _XYZ_TO_REC709.T)


def _schlick(f0: ArrayLike, cosine: Float64Array) -> Float64Array:
    facing = np.asarray(f0, float)
    return np.asarray(facing + (1.0 - facing) * (1.0 - cosine) ** 5)


def _colour(value: ArrayLike) -> Float64Array:
    return np.asarray(value, float).reshape(-1, 3)


def _number(value: ArrayLike) -> Float64Array:
    return np.asarray(value, float).reshape(-1, 1)
