import numpy as np
import pytest

from engine.material import MODELS, validate_parameters
from engine.scene.loaders.gltf_materials import conductor_index, metallic_roughness_layers


def normal_reflectance(eta: float, k: float) -> float:
    """Fresnel at normal incidence: ((η − 1)² + k²) / ((η + 1)² + k²)."""
    return ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)


@pytest.mark.parametrize("tint", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("f0", [0.0, 0.04, 0.5, 0.95, 0.98])
def test_the_index_gives_back_the_reflectance(f0, tint):
    assert normal_reflectance(*conductor_index(f0, tint)) == pytest.approx(f0, abs=1e-9)


def test_a_dielectric_is_glass_and_white_metal_stays_finite():
    assert conductor_index(0.04, 0.0) == pytest.approx((1.5, 0.0))  # (0.5 / 2.5)² = 0.04
    eta, k = conductor_index(1.0, 1.0)
    assert np.isfinite([eta, k]).all() and normal_reflectance(eta, k) == pytest.approx(0.98)


def test_metal_has_no_diffuse_layer_and_plastic_has_both():
    (metal,) = metallic_roughness_layers((0.9, 0.6, 0.2), 1.0, 0.5)
    assert metal.model == "rough_conductor" and metal.parameters["alpha"] == 0.25
    plastic = metallic_roughness_layers((0.9, 0.6, 0.2), 0.0, 0.0)
    assert [layer.model for layer in plastic] == ["lambert", "rough_conductor"]
    # what the coat reflects at normal incidence, 4 %, is missing below it
    assert plastic[0].parameters["albedo"] == pytest.approx((0.864, 0.576, 0.192))
    assert plastic[1].parameters["k"] == (0.0, 0.0, 0.0)
    assert plastic[1].parameters["alpha"] == 0.01  # a mirror is kept just rough enough to be sampled


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 1.0])
@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (1.0, 1.0, 1.0)])
def test_every_material_is_within_the_models_ranges(base, roughness, metallic):
    for layer in metallic_roughness_layers(base, metallic, roughness):
        accepted = validate_parameters(MODELS[layer.model], layer.parameters, "model.glb")
        assert set(layer.parameters) <= set(accepted)  # otherwise the call has raised
