"""Layers of glTF's materials against the specification's own formulas (`engine/reference/gltf_brdf.py`)."""

import math

import numpy as np
import pytest

from app.document.linked_layers import layers_from_descriptions
from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.layer import Layer, evaluate_by_curves, evaluate_layers
from engine.material.layer_maps import ChannelImage
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.reference.gltf_brdf import GltfInputs, gltf_brdf
from engine.scene.loaders.pbr_layers import Coat, Film, PbrMaterial, SheenCoat, pbr_layers
from tests.engine.material.test_models import hemisphere

CASES = {
    "plastic": (PbrMaterial((0.8, 0.3, 0.1), 0.0, 0.4), GltfInputs((0.8, 0.3, 0.1), 0.0, 0.4)),
    "metal": (PbrMaterial((0.9, 0.6, 0.2), 1.0, 0.3), GltfInputs((0.9, 0.6, 0.2), 1.0, 0.3)),
    "half a metal": (PbrMaterial((0.9, 0.6, 0.2), 0.4, 0.5), GltfInputs((0.9, 0.6, 0.2), 0.4, 0.5)),
    "diamond": (
        PbrMaterial((0.5, 0.5, 0.5), 0.0, 0.3, facing=(0.1726,) * 3),
        GltfInputs((0.5, 0.5, 0.5), 0.0, 0.3, ior=(1 + 0.1726**0.5) / (1 - 0.1726**0.5)),
    ),
    "weak coloured gloss": (
        PbrMaterial((0.4, 0.4, 0.4), 0.0, 0.3, facing=(0.04, 0.02, 0.01), specular=0.5),
        GltfInputs((0.4, 0.4, 0.4), 0.0, 0.3, specular=0.5, specular_color=(1.0, 0.5, 0.25)),
    ),
    "oil on plastic": (
        PbrMaterial((0.6, 0.3, 0.1), 0.0, 0.3, film=Film(0.7, 1.4, 450.0)),
        GltfInputs((0.6, 0.3, 0.1), 0.0, 0.3, iridescence=0.7, iridescence_ior=1.4, iridescence_thickness=450.0),
    ),
    "half a metal under a film": (
        PbrMaterial((0.5, 0.3, 0.1), 0.4, 0.4, specular=0.8, film=Film(1.0, 1.8, 300.0)),
        GltfInputs((0.5, 0.3, 0.1), 0.4, 0.4, specular=0.8, iridescence=1.0, iridescence_ior=1.8,
                   iridescence_thickness=300.0),
    ),
    "lacquer": (
        PbrMaterial((0.6, 0.1, 0.1), 0.0, 0.6, coat=Coat(0.8, 0.3)),
        GltfInputs((0.6, 0.1, 0.1), 0.0, 0.6, clearcoat=0.8, clearcoat_roughness=0.3),
    ),
    "velvet": (
        PbrMaterial((0.3, 0.1, 0.1), 0.0, 0.8, sheen=SheenCoat((0.9, 0.5, 0.4), 0.5)),
        GltfInputs((0.3, 0.1, 0.1), 0.0, 0.8, sheen_color=(0.9, 0.5, 0.4), sheen_roughness=0.5),
    ),
    "coated velvet": (
        PbrMaterial((0.3, 0.1, 0.1), 0.5, 0.8, sheen=SheenCoat((0.4, 0.5, 0.6), 0.3), coat=Coat(1.0, 0.2)),
        GltfInputs((0.3, 0.1, 0.1), 0.5, 0.8, sheen_color=(0.4, 0.5, 0.6), sheen_roughness=0.3, clearcoat=1.0,
                 clearcoat_roughness=0.2),
    ),
}  # fmt: skip


def made(material: PbrMaterial) -> tuple[Layer, ...]:
    return layers_from_descriptions("model.glb", "it", pbr_layers(material))


@pytest.mark.parametrize("name", CASES)
def test_the_layers_are_what_the_specification_says(name: str) -> None:
    material, authored = CASES[name]
    wi, wo = hemisphere(3000, 3), hemisphere(3000, 4)
    wi, wo = wi[wo[:, 2] > 0.05], wo[wo[:, 2] > 0.05]
    expected = gltf_brdf(authored, wi, wo) * wi[:, 2:]
    found = evaluate_layers(made(material), wi, wo)
    # The sheen's directional albedo is a table of 33 angles, the twin's one of 100 cosines: within half a percent.
    tolerance = 5e-3 if max(authored.sheen_color) > 0.0 else 1e-9
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance * 1e-3 * expected.max())


@pytest.mark.parametrize("name", CASES)
def test_curves_and_quotients_are_the_same_layers(name: str) -> None:
    wi, wo = hemisphere(1000, 5), hemisphere(1000, 6)
    for layer in made(CASES[name][0]):
        formula = layer.brdf(wi, wo) * wi[:, 2:]
        by_curves = layer.scale() * evaluate_by_curves(layer, wi, wo)
        np.testing.assert_allclose(by_curves, formula, rtol=1e-5, atol=1e-8 * formula.max())


def test_a_coat_takes_what_it_reflects() -> None:
    # 0.5 (0.04 + 0.96 (1 - cos)^5): 2 % head-on, all of 0.5 at grazing angles.
    base, gloss, coat = made(PbrMaterial((0.5,) * 3, 0.0, 0.5, coat=Coat(0.5, 0.1)))
    assert [layer.under for layer in (base, gloss, coat)] == ["coat", "coat", ""]
    angles = np.array([0.0, math.pi / 2])
    assert base.view_curve(angles)[:, 0] == pytest.approx([0.98, 0.5])
    assert coat.view_curve(angles)[:, 0] == pytest.approx([0.04, 1.0])
    # An edit of the coat's own curve counts, and no coat that is hidden.
    lift = Operator("translate", "y", 0.0, 0.0, math.pi / 2, math.pi / 2, magnitude=0.2)
    edited = base.replace(covers=(coat.with_operators("theta_o", [lift]),))
    assert edited.view_curve(angles[:1])[0, 0] == pytest.approx(1.0 - 0.5 * 0.24)
    assert base.replace(covers=(coat.replace(visible=False),)).view_curve(angles)[:, 0] == pytest.approx([1.0, 1.0])


def test_a_white_furnace_loses_nothing_to_a_sheen() -> None:
    # Under a white sheen lies a white base: together they reflect what the base does alone, 1, at each angle.
    sheen = make_layer(MODELS["sheen"], {"alpha": 0.3, "scale": 1.0})
    base = make_layer(MODELS["lambert"], {"albedo": 1.0}).replace(covers=(sheen,))
    cosine, phi = np.meshgrid(np.sqrt((np.arange(200) + 0.5) / 200), (np.arange(200) + 0.5) * (math.pi / 200))
    sine = np.sqrt(1.0 - cosine**2)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1).reshape(-1, 3)
    for angle in (0.0, 0.6, 1.2, 1.4):
        wo = np.broadcast_to([math.sin(angle), 0.0, math.cos(angle)], wi.shape)
        total = sum(layer.brdf(wi, wo).mean(axis=0)[0] * math.pi for layer in (sheen, base))
        assert total == pytest.approx(1.0, abs=4e-3)


def test_images_split_layers_into_what_adds_up() -> None:
    # With its image at 1 the split material is the covered one, at 0 the bare one: shares add up to 1 in between.
    plain = PbrMaterial((0.5, 0.4, 0.3), 0.3, 0.4, coat=Coat(0.8, 0.2), sheen=SheenCoat((0.5,) * 3, 0.5))
    coat = Coat(0.8, 0.2, image=ChannelImage("#1", "r"))
    split = made(PbrMaterial((0.5, 0.4, 0.3), 0.3, 0.4, coat=coat, sheen=SheenCoat((0.5,) * 3, 0.5)))
    wi, wo = hemisphere(200, 7), hemisphere(200, 8)
    for share in (0.0, 0.3, 1.0):
        factors = [1.0 - share if layer.maps.weight_invert else share for layer in split]
        found = sum(f * layer.brdf(wi, wo) for f, layer in zip(factors, split, strict=True))
        bare, covered = (
            sum(layer.brdf(wi, wo) for layer in made(each))
            for each in (PbrMaterial((0.5, 0.4, 0.3), 0.3, 0.4, sheen=SheenCoat((0.5,) * 3, 0.5)), plain)
        )
        np.testing.assert_allclose(found, (1 - share) * bare + share * covered, rtol=1e-9, atol=1e-12)


def test_the_base_takes_f0_of_the_gloss_that_it_follows() -> None:
    # F0 and F90 are shared, whichever layer's are set; the curves are not: one is what the other leaves.
    base, gloss = made(PbrMaterial((0.5,) * 3, 0.0, 0.5))
    brighter = gloss.with_parameter("f0", 0.3).with_parameter("f90", 0.8)
    followed = base.with_curves_of(brighter)
    angles = np.array([0.0, 1.0, math.pi / 2])
    assert followed.curve("beneath")(angles) == pytest.approx(1.0 - brighter.curve("theta_d")(angles))
    assert gloss.with_curves_of(base.with_parameter("f0", 0.2)).values["f0"] == (0.2, 0.2, 0.2)
    assert followed.values["albedo"] == base.values["albedo"] and brighter.values["alpha"] == 0.25


def test_further_bounces_see_what_a_coat_leaves() -> None:
    # The mean of F = 0.04 + 0.96 (1 - x)^5 over cosines x, weighted by 2x: 0.04 + 0.96 · 2 / 42.
    coat = make_layer(MODELS["clearcoat"], {"scale": 0.5})
    base = make_layer(MODELS["lambert"], {"albedo": 0.6}).replace(under=coat.name, covers=(coat,))
    taken = 0.04 + 0.96 * 2.0 / 42.0
    assert equivalent_albedo(base, (1,)) == pytest.approx(np.full(3, 0.6 * (1.0 - 0.5 * taken)), rel=2e-3)
    assert indirect_layer(0, base, (1,)).view_curve[-1, 0] == pytest.approx(0.5)
