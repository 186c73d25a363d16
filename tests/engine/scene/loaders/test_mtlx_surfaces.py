"""Surface shaders of MaterialX as layers: BRDFs against the shaders' own formulas (`engine.reference.mtlx_brdf`)."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.linked_layers import layers_from_descriptions
from engine.material.layer import evaluate_layers
from engine.reference.mtlx_brdf import (
    OpenPbrInputs,
    PreviewInputs,
    StandardInputs,
    open_pbr_brdf,
    preview_surface_brdf,
    standard_surface_brdf,
)
from engine.scene.loaders.mtlx import read_materials
from tests.engine.scene.loaders.mtlx_samples import (
    given,
    image,
    linked,
    material,
    read_text,
    write_png,
)

pytest.importorskip("MaterialX")


def brdf(folder: Path, shader: str, inputs: dict[str, str], wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """The reflection of a shader as layers, without the cosine, (N, 3)."""
    kinds = {0: "float", 2: "color3"}
    text = "".join(given(name, kinds[value.count(",")], value) for name, value in inputs.items())
    (found,) = read_text(folder, material(shader, text))
    layers = layers_from_descriptions("it", "it", found.material.layers)
    shares = [layer.maps.weight_start for layer in layers]
    total = sum(share * evaluate_layers([layer], wi, wo) for share, layer in zip(shares, layers, strict=True))
    return total / wi[:, 2:]


def sphere_directions(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(0.08, 1.0, n), rng.uniform(0.0, 2 * math.pi, n)
    return np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], 1)


# ------------------------------------------------------------------------- against the formulas of the specification


WI, WO = sphere_directions(24, 1), sphere_directions(24, 2)
BASE = np.array([0.6, 0.3, 0.1])


def check(found: np.ndarray, expected: np.ndarray, within: float) -> None:
    error = math.sqrt(((found - expected) ** 2).sum() / (expected**2).sum())
    assert error <= within, error


OPEN = OpenPbrInputs(base_color=(0.6, 0.3, 0.1), specular_roughness=0.5)
STANDARD = StandardInputs(base_color=(0.6, 0.3, 0.1), specular_roughness=0.5)
PREVIEW = PreviewInputs(diffuseColor=(0.6, 0.3, 0.1))
FORMULAS = {
    OpenPbrInputs: ("open_pbr_surface", open_pbr_brdf), StandardInputs: ("standard_surface", standard_surface_brdf),
    PreviewInputs: ("UsdPreviewSurface", preview_surface_brdf),
}  # fmt: skip


@pytest.mark.parametrize(
    ("inputs", "within"),
    [
        # Light that a dielectric's facets scatter again is not shown: 1 to 2 % of these pairs, many at grazing.
        (replace(OPEN, specular_ior=1.7), 2e-2),
        (replace(OPEN, base_weight=0.0, specular_weight=0.25), 1.5e-2),  # scales the reflectance head-on
        (replace(OPEN, specular_color=(1.0, 0.5, 0.2), specular_weight=0.8), 1e-2),  # takes nothing from the base
        (replace(OPEN, coat_weight=0.7, coat_roughness=0.5, coat_color=(0.9, 0.8, 0.5)), 2e-2),
        (replace(OPEN, fuzz_weight=0.6, fuzz_color=(0.9, 0.5, 0.2), fuzz_roughness=1.0), 1e-2),
        (replace(OPEN, fuzz_weight=0.6, fuzz_roughness=0.2), 1.5e-2),
        # Of light that rough metals scatter again the facets' mean reflectance counts, and of a base's its mean colour.
        (replace(OPEN, base_metalness=1.0), 5e-3),
        (replace(OPEN, base_metalness=1.0, specular_color=(1.0, 0.8, 0.4)), 5e-3),
        (replace(OPEN, base_metalness=1.0, specular_roughness=0.9), 3e-2),
        (replace(OPEN, base_metalness=0.3), 1e-2),
        (replace(OPEN, base_diffuse_roughness=0.5, specular_weight=0.0), 2e-2),
        (replace(STANDARD, specular_IOR=1.7), 2e-2),
        (replace(STANDARD, specular=0.6, specular_color=(1.0, 0.5, 0.2)), 1e-2),
        (replace(STANDARD, metalness=1.0), 2e-2),
        (replace(STANDARD, coat=0.7, coat_roughness=0.4, coat_color=(0.9, 0.8, 0.5)), 1.5e-2),
        (replace(STANDARD, sheen=0.7, sheen_color=(0.9, 0.5, 0.2), sheen_roughness=0.4), 1.5e-2),
        (replace(STANDARD, diffuse_roughness=0.6, specular=0.0), 1e-6),
        (replace(PREVIEW, roughness=0.4), 1e-2),
        (replace(PREVIEW, metallic=1.0, roughness=0.4), 5e-3),
        (replace(PREVIEW, metallic=0.5), 3.5e-2),
        (replace(PREVIEW, useSpecularWorkflow=1, specularColor=(0.3, 0.2, 0.1)), 4.5e-2),
        (replace(PREVIEW, clearcoat=0.8, clearcoatRoughness=0.4), 1.5e-2),
    ],
)
def test_layers_are_the_formulas_of_the_specification(
    tmp_path: Path, inputs: OpenPbrInputs | StandardInputs | PreviewInputs, within: float
) -> None:
    shader, formula = FORMULAS[type(inputs)]
    given_inputs = {name: ", ".join(map(str, np.atleast_1d(value))) for name, value in vars(inputs).items()}
    check(brdf(tmp_path, shader, given_inputs, WI, WO), formula(inputs, WI, WO), within)


@pytest.mark.parametrize("inputs", [
    OpenPbrInputs(base_color=1.0, specular_roughness=0.6), OpenPbrInputs(base_color=1.0, base_diffuse_roughness=1.0),
    OpenPbrInputs(base_color=1.0, base_metalness=1.0, specular_roughness=1.0),
    OpenPbrInputs(base_color=1.0, fuzz_weight=0.8, fuzz_roughness=1.0),
    StandardInputs(base_color=1.0, sheen=0.5, coat=1.0), PreviewInputs(diffuseColor=1.0, clearcoat=1.0),
])  # fmt: skip
def test_white_surfaces_of_the_judge_reflect_all_light(inputs: OpenPbrInputs | StandardInputs | PreviewInputs) -> None:
    # Every layer gives what it does not reflect to the one below, and the lowest reflects all.
    wi = sphere_directions(60_000, 3)
    wo = np.broadcast_to([0.6, 0.0, 0.8], wi.shape)
    value = FORMULAS[type(inputs)][1](inputs, wi, wo)
    albedo = (value * wi[:, 2:]).mean(axis=0) * 2.0 * math.pi * (1.0 - 0.08)  # cosines from 0.08 on
    np.testing.assert_allclose(albedo, 1.0, atol=0.02)


def test_a_metal_of_standard_surface_has_the_exact_term(tmp_path: Path) -> None:
    # Gulbrandsen's n and k of the colours head-on and at the edge; at 0° the term is the first [Gulbrandsen14].
    inputs = {"base": "1", "base_color": "0.6, 0.3, 0.1", "metalness": "1", "specular_roughness": "0.5"}
    (found,) = read_text(tmp_path, material("standard_surface", "".join(
        given(name, "color3" if "," in value else "float", value) for name, value in inputs.items())))  # fmt: skip
    (layer,) = layers_from_descriptions("it", "it", found.material.layers)
    np.testing.assert_allclose(layer.curve("theta_d")(np.zeros(1))[0], BASE, atol=1e-5)


@pytest.mark.parametrize("shader", ["open_pbr_surface", "standard_surface"])
def test_an_anisotropic_metal_has_ggx_of_two_widths(tmp_path: Path, shader: str) -> None:
    is_open = shader == "open_pbr_surface"
    names = ("base_metalness", "specular_roughness_anisotropy") if is_open else ("metalness", "specular_anisotropy")
    inputs = dict.fromkeys(names, "1") | {names[1]: "0.6", "specular_roughness": "0.5", "base_color": "0.6, 0.3, 0.1"}
    # Of roughness 0.5 and anisotropy 0.6, along and across [OpenPBR; MaterialX, roughness_anisotropy].
    width, aspect = 0.25 * math.sqrt(2.0 / (1.0 + 0.4**2)), math.sqrt(0.4)
    a, b = (width, 0.4 * width) if is_open else (0.25 / aspect, 0.25 * aspect)
    half = WI + WO
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    d = 1.0 / (math.pi * a * b * ((half[:, 0] / a) ** 2 + (half[:, 1] / b) ** 2 + half[:, 2] ** 2) ** 2)
    lengths = [np.linalg.norm(w * np.array([a, b, 1.0]), axis=1) for w in (WI, WO)]
    masked = 0.5 / (WI[:, 2] * lengths[1] + WO[:, 2] * lengths[0])  # Smith's, correlated by height
    schlick = BASE + (1.0 - BASE) * (1.0 - (WI * half).sum(axis=1)[:, None]) ** 5
    check(brdf(tmp_path, shader, inputs, WI, WO), (d * masked)[:, None] * schlick, 1e-5)
    text = "".join(given(name, "color3" if "," in value else "float", value) for name, value in inputs.items())
    assert read_text(tmp_path, material(shader, text))[0].material.bumps.tangent_along_u


def test_mixed_metalness_is_a_mixture(tmp_path: Path) -> None:
    one = {"base_color": "0.6, 0.3, 0.1", "specular_roughness": "0.5"}
    plain, metal, mixed = (
        brdf(tmp_path, "open_pbr_surface", one | {"base_metalness": value}, WI, WO) for value in ("0", "1", "0.25")
    )
    check(mixed, 0.75 * plain + 0.25 * metal, 1e-6)


def test_rough_diffuse_of_openpbr_keeps_its_mean(tmp_path: Path) -> None:
    # E of FON is A (1 + (2/3 − 28 / 15π) r), and with all further reflections of a base ρ: ρ E / (1 − ρ (1 − E)).
    inputs = {"base_color": "0.6, 0.3, 0.1", "specular_weight": "0", "base_diffuse_roughness": "0.5"}
    rng = np.random.default_rng(5)
    z, phi = np.sqrt(rng.random((2, 40_000))), rng.uniform(0.0, 2 * math.pi, (2, 40_000))
    s = np.sqrt(1.0 - z * z)
    wi, wo = (np.stack([s[k] * np.cos(phi[k]), s[k] * np.sin(phi[k]), z[k]], 1) for k in (0, 1))
    mean = math.pi * brdf(tmp_path, "open_pbr_surface", inputs, wi, wo).mean(axis=0)
    a = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * 0.5)
    once = a * (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * math.pi)) * 0.5)
    np.testing.assert_allclose(mean, BASE * once / (1.0 - BASE * (1.0 - once)), rtol=5e-3)


def test_the_weight_of_a_rough_base_scales_all_of_it(tmp_path: Path) -> None:
    # Not the albedo, of which light that is scattered again is the square.
    one = {"base_color": "0.6, 0.3, 0.1", "specular_weight": "0", "base_diffuse_roughness": "1"}
    whole, part = (brdf(tmp_path, "open_pbr_surface", one | {"base_weight": each}, WI, WO) for each in ("1", "0.4"))
    check(part, 0.4 * whole, 1e-6)


# ------------------------------------------------------------------------------------------ maps


def test_a_map_of_metalness_and_of_a_coat_multiplies_each_layer(tmp_path: Path) -> None:
    write_png(tmp_path / "share.png", np.array([[0.0, 1.0], [0.25, 0.5]]))
    nodes = image("i", "float", "share.png")
    text = linked("base_metalness", "float", "i") + linked("coat_weight", "float", "i")
    text += given("coat_darkening", "float", "0") + given("specular_roughness", "float", "0.4")
    (found,) = read_text(tmp_path, material("open_pbr_surface", text, nodes))
    layers = {layer.name: layer for layer in found.material.layers}
    assert set(layers) == {
        "base",
        "base without coat",
        "gloss",
        "gloss without coat",
        "metal",
        "metal without coat",
        "coat",
    }
    assert (layers["base"].under, layers["gloss"].under) == ("gloss", "coat")
    assert (layers["base without coat"].under, layers["base without coat"].follows) == ("gloss without coat", "base")

    def texels(name: str) -> np.ndarray:
        texture = layers[name].maps.texture
        if texture == "share.png":
            return np.array([[0.0, 1.0], [0.25, 0.5]])
        return read_materials(tmp_path / "it.mtlx").maps[int(texture[1:])].texels()[1::3, 1::3, 0]

    share = np.round(np.array([[0.0, 1.0], [0.25, 0.5]]) * 255) / 255
    np.testing.assert_allclose(texels("base"), (1.0 - share) * share, atol=1e-6)
    np.testing.assert_allclose(texels("base without coat"), (1.0 - share) ** 2, atol=1e-6)
    np.testing.assert_allclose(texels("metal"), share**2, atol=1e-6)
    np.testing.assert_allclose(texels("coat"), share, atol=2e-3)


def test_a_rough_metal_with_a_texture_is_the_metal_of_each_texel(tmp_path: Path) -> None:
    # One texel of 0.6, 0.3, 0.1: the four layers are the metal of that colour.
    write_png(tmp_path / "c.png", np.full((2, 2, 3), np.round(np.array([0.6, 0.3, 0.1]) * 255) / 255))
    more = given("base_metalness", "float", "1") + given("specular_roughness", "float", "0.8")
    (found,) = read_text(tmp_path, material("open_pbr_surface", linked("base_color", "color3", "i") + more,
                                       image("i", "color3", "c.png")))  # fmt: skip
    layers = layers_from_descriptions("it", "it", found.material.layers)
    maps = read_materials(tmp_path / "it.mtlx").maps
    colours = [maps[int(each.maps.texture[1:])].texels()[1, 1] for each in layers if each.maps.texture[:1] == "#"]
    assert len(layers) == 4 and len(colours) == 4
    total = sum(c * evaluate_layers([layer], WI, WO) for c, layer in zip(colours, layers, strict=True)) / WI[:, 2:]
    inputs = {"base_color": "0.6, 0.298039, 0.101961", "base_metalness": "1", "specular_roughness": "0.8"}
    check(total, brdf(tmp_path, "open_pbr_surface", inputs, WI, WO), 1e-3)


@pytest.mark.parametrize(("roughness", "within"), [(0.3, 2e-2), (0.6, 5e-2)])
@pytest.mark.parametrize(
    ("inputs", "name", "width"),
    [
        (StandardInputs(metalness=1.0), "base_color", "specular_roughness"),
        (StandardInputs(metalness=1.0, specular=0.5), "base_color", "specular_roughness"),
        (PreviewInputs(metallic=1.0), "diffuseColor", "roughness"),
    ],
)
def test_a_metal_with_a_texture_has_the_exact_term_at_each_texel(
    tmp_path: Path, inputs: StandardInputs | PreviewInputs, name: str, width: str, roughness: float, within: float
) -> None:
    # Mixed of five metals; Schlick's term is 20 to 30 % off. Rough: facets scatter light again by one mean for each.
    colours = np.round(np.array([[[0.9, 0.5, 0.2], [0.6, 0.3, 0.1]], [[0.2, 0.15, 0.05], [0.02, 0.04, 0.8]]]) * 255)
    write_png(tmp_path / "c.png", colours / 255)
    shader, formula = FORMULAS[type(inputs)]
    inputs = replace(inputs, **{width: roughness})
    more = "".join(
        given(each, "color3" if np.ndim(value) else "integer" if isinstance(value, int) else "float",
              ", ".join(map(str, np.atleast_1d(value))))
        for each, value in vars(inputs).items() if each != name
    )  # fmt: skip
    (found,) = read_text(tmp_path, material(shader, linked(name, "color3", "i") + more, image("i", "color3", "c.png")))
    layers = layers_from_descriptions("it", "it", found.material.layers)
    maps = read_materials(tmp_path / "it.mtlx").maps
    assert [layer.model.name for layer in layers] == ["metal"] * 5
    for row, column in np.ndindex(2, 2):
        total = sum(
            maps[int(layer.maps.texture[1:])].texels()[1::3, 1::3][row, column]
            * evaluate_layers([layer], WI, WO)
            / WI[:, 2:]
            for layer in layers
        )
        check(total, formula(replace(inputs, **{name: colours[row, column] / 255}), WI, WO), within)


def test_a_metal_of_standard_surface_has_the_mean_of_an_image_at_its_edge(tmp_path: Path) -> None:
    write_png(tmp_path / "c.png", np.full((2, 2, 3), 0.5))
    text = given("metalness", "float", "1") + linked("specular_color", "color3", "i")
    (found,) = read_text(tmp_path, material("standard_surface", text, image("i", "color3", "c.png")))
    assert [each.name for each in found.material.unshown] == ["materials.standard_surface.specular_color"]
    layers = [each.parameters for each in found.material.layers]
    same = given("metalness", "float", "1") + given("specular_color", "color3", ", ".join(3 * [str(128 / 255)]))
    (plain,) = read_text(tmp_path, material("standard_surface", same))
    assert len(layers) == 1 and layers[0]["k"] == pytest.approx(plain.material.layers[0].parameters["k"], rel=1e-4)


@pytest.mark.parametrize("roughness", [0.5, 0.8])
def test_rough_metals_reflect_as_much_as_the_formula(tmp_path: Path, roughness: float) -> None:
    # What facets reflect of light that others sent to them is a mean here: over all directions it is 0.2 % off. The
    # mean by the cosine, with 1/21 of Schlick's rise, is 1 to 2 % too bright where facets are seen from their front.
    wi, wo = sphere_directions(2000, 3), sphere_directions(2000, 4)
    inputs = {"base_color": "0.6, 0.3, 0.1", "base_metalness": "1", "specular_roughness": str(roughness)}
    found = brdf(tmp_path, "open_pbr_surface", inputs, wi, wo)
    expected = open_pbr_brdf(replace(OPEN, base_metalness=1.0, specular_roughness=roughness), wi, wo)
    by_cosines = wi[:, 2:] * wo[:, 2:]
    np.testing.assert_allclose((found * by_cosines).sum(0), (expected * by_cosines).sum(0), rtol=4e-3)
