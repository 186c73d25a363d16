"""Surface shaders of MaterialX: images, bumps and emission of their inputs, and no input that is neither shown nor
listed."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.material.bumps import Bumps
from engine.scene.loaders import mtlx_library
from engine.scene.loaders.mtlx import mtlx_image_reader, read_mtlx
from tests.engine.scene.loaders.mtlx_samples import (
    document,
    given,
    image,
    linked,
    material,
    node,
    read_text,
    surface,
    write_png,
)

pytest.importorskip("MaterialX")
SHADERS = ("open_pbr_surface", "standard_surface", "gltf_pbr", "UsdPreviewSurface")


def test_roughness_becomes_the_map_of_widths(tmp_path: Path) -> None:
    write_png(tmp_path / "rough.png", np.array([[0.2, 0.8]]))
    text = linked("specular_roughness", "float", "i")
    for shader, name in (("open_pbr_surface", "gloss"), ("standard_surface", "gloss")):
        (found,) = read_text(tmp_path, material(shader, text, image("i", "float", "rough.png")))
        table = next(each for each in found.material.layers if each.name == name).parameter_maps["alpha"]
        assert (table["map"], table["channel"], table["response"], table["range"]) == (
            "rough.png",
            "r",
            "square",
            (0, 1),
        )


def test_normal_maps_opacity_and_emission(tmp_path: Path) -> None:
    write_png(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    nodes = image("i", "vector3", "n.png") + node(
        "normalmap", "vector3", "n", linked("in", "vector3", "i") + given("scale", "float", "0.5")
    )
    text = linked("geometry_normal", "vector3", "n") + given("geometry_opacity", "float", "0.25")
    text += given("emission_luminance", "float", "683") + given("emission_color", "color3", "1, 0.5, 0")
    (found,) = read_text(tmp_path, material("open_pbr_surface", text, nodes))
    own = found.material
    assert (own.bumps.normal_map, own.bumps.bump_strength) == ("n.png", 0.5)
    assert (own.opacity.opacity_mode, own.opacity.opacity_factor) == ("blend", 0.25)
    assert own.emission.radiance == pytest.approx((1.0, 0.5, 0.0), rel=1e-6)  # 683 nits are 1 W / (m² sr)
    assert own.unshown == ()


@pytest.mark.parametrize(("shader", "weight", "own", "of_base"), [
    ("open_pbr_surface", "coat_weight", "geometry_coat_normal", "geometry_normal"),
    ("standard_surface", "coat", "coat_normal", "normal"), ("gltf_pbr", "clearcoat", "clearcoat_normal", "normal"),
])  # fmt: skip
def test_coats_have_normals_of_their_own(tmp_path: Path, shader: str, weight: str, own: str, of_base: str) -> None:
    write_png(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    nodes = image("i", "vector3", "n.png") + node("normalmap", "vector3", "n", linked("in", "vector3", "i"))
    coat = given(weight, "float", "0.5")
    for name, bumps in ((own, Bumps(coat_normal_map="n.png")), (of_base, Bumps("n.png"))):
        (found,) = read_text(tmp_path, material(shader, coat + linked(name, "vector3", "n"), nodes))
        frames = {each.name: each.frame for each in found.material.layers}
        assert frames.pop("coat") == "coat" and set(frames.values()) == {"base"}
        assert (found.material.bumps, found.material.unshown) == (bumps, ())


@pytest.mark.parametrize(("shader", "name", "strength", "value"), [
    ("standard_surface", "emission_color", "emission", "4"), ("gltf_pbr", "emissive", "emissive_strength", "4"),
    ("open_pbr_surface", "emission_color", "emission_luminance", "2732"),  # nits: 683 are 1 W / (m² sr)
])  # fmt: skip
def test_an_image_of_emission_is_a_texture_of_it(
    tmp_path: Path, shader: str, name: str, strength: str, value: str
) -> None:
    write_png(tmp_path / "glow.png", np.full((2, 2, 3), 0.5))
    text = linked(name, "color3", "i") + given(strength, "float", value)
    (found,) = read_text(tmp_path, material(shader, text, image("i", "color3", "glow.png", space="srgb_texture")))
    shines = found.material.emission
    assert (shines.radiance, shines.texture.texture, shines.texture.texture_space) == ((4.0,) * 3, "glow.png", "srgb")


def test_a_coat_dims_and_tints_what_shines_below(tmp_path: Path) -> None:
    text = given("emission", "float", "2") + given("coat", "float", "0.5") + given("coat_color", "color3", "1, 0.5, 0")
    (found,) = read_text(tmp_path, material("standard_surface", text))
    # Half of it through the coat: its colour, 1 − 0.04, and the mean over views of 1 − (1 − cos)^5, 20/21.
    expected = 2.0 * (0.5 + 0.5 * np.array([1.0, 0.5, 0.0]) * 0.96 * 20.0 / 21.0)
    assert found.material.emission.radiance == pytest.approx(expected, rel=1e-5)
    assert [each.name for each in found.material.unshown] == ["materials.standard_surface.emission"]


def definition_inputs(shader: str) -> list[tuple[str, str, str]]:
    """Name, type and default of all inputs of a shader."""
    import MaterialX as mx

    definition = next(
        each for each in mtlx_library._definitions().getMatchingNodeDefs(shader)
        if each.getDefaultVersion() or len(mtlx_library._definitions().getMatchingNodeDefs(shader)) == 1
    )  # fmt: skip
    assert isinstance(definition, mx.NodeDef)
    return [(each.getName(), each.getType(), each.getValueString()) for each in definition.getActiveInputs()]


# A value of each type that no default has, and that makes every group of inputs effective.
OTHER = {"float": "0.37", "integer": "1", "boolean": "true", "color3": "0.31, 0.22, 0.13", "vector3": "0.1, 0.2, 0.9"}


@pytest.mark.parametrize("shader", SHADERS)
def test_every_input_is_shown_or_listed(tmp_path: Path, shader: str) -> None:
    """Each input, changed while all others are set, changes what is shown, or is in the list."""
    inputs = {name: (kind, OTHER[kind]) for name, kind, _ in definition_inputs(shader) if kind in OTHER}
    inputs |= {name: ("float", "1.4") for name in inputs if name.lower().endswith("ior")}
    if shader == "UsdPreviewSurface":
        inputs["useSpecularWorkflow"] = ("integer", "0")

    def result(changed: dict[str, tuple[str, str]]):
        text = "".join(given(name, kind, value) for name, (kind, value) in changed.items())
        (found,) = read_text(tmp_path, material(shader, text))
        own = found.material
        return (own.layers, own.emission, own.bumps, own.opacity), {each.name.split(".")[-1] for each in own.unshown}

    shown, listed = result(inputs)
    second = {"float": "0.59", "boolean": "false", "color3": "0.5, 0.4, 0.3", "vector3": "0.3, 0.1, 0.8"}
    second["integer"] = "1" if shader == "UsdPreviewSurface" else "0"
    harmless = {"occlusion"}  # shadows are computed
    harmless |= {"specularColor"} if shader == "UsdPreviewSurface" else set()
    lost = [
        name for name, (kind, _) in inputs.items()
        if name not in listed | harmless and result(inputs | {name: (kind, second[kind])})[0] == shown
    ]  # fmt: skip
    assert lost == []


def test_what_has_no_effect_is_not_listed(tmp_path: Path) -> None:
    text = given("transmission", "float", "0") + given("transmission_color", "color3", "1,0,0")
    (found,) = read_text(tmp_path, material("standard_surface", text + given("thin_walled", "boolean", "false")))
    assert found.material.unshown == ()


def test_shaders_that_are_not_known_are_grey_and_listed(tmp_path: Path) -> None:
    nodes = '<burley_diffuse_bsdf name="b" type="BSDF"/>'
    (found,) = read_text(tmp_path, material("surface", linked("bsdf", "BSDF", "b"), nodes))
    assert [each.model for each in found.material.layers] == ["lambert"]
    assert [each.name for each in found.material.unshown] == ["materials.surface"]


def test_a_file_is_a_ball_for_each_material(tmp_path: Path) -> None:
    body = surface("gltf_pbr", "", "brass") + surface("standard_surface", "", "wood")
    (tmp_path / "it.mtlx").write_text(document(body), encoding="utf-8")
    model = read_mtlx(tmp_path / "it.mtlx")
    assert [part.name for part in model.parts] == ["brass", "wood"]
    middles = [part.mesh.vertices.mean(axis=0) for part in model.parts]
    np.testing.assert_allclose(middles, [[0.0, 0.5, 0.0], [1.25, 0.5, 0.0]], atol=1e-6)


def test_computed_maps_are_read_by_number(tmp_path: Path) -> None:
    write_png(tmp_path / "c.png", np.full((2, 2, 3), 0.5))
    nodes = image("i", "color3", "c.png") + node("invert", "color3", "v", linked("in", "color3", "i"))
    nodes += surface("gltf_pbr", "", "plain")  # the first material has none
    found = read_text(tmp_path, material("gltf_pbr", linked("base_color", "color3", "v"), nodes))
    assert found[1].material.layers[-1].maps.texture == "#0"
    read_map = mtlx_image_reader(tmp_path / "it.mtlx")
    assert read_map(0)[:4] == b"\x76\x2f\x31\x01"  # OpenEXR
    with pytest.raises(LoadError, match="computed map = 1, expected a number below 1"):
        read_map(1)


def test_without_the_library_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mtlx_library, "PACKAGE", "no_such_package_of_materials")
    with pytest.raises(LoadError, match=r"pip install 'insitu\[materialx\]'"):
        read_text(tmp_path, material("gltf_pbr", ""))


def test_a_document_without_materials_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="materials = 0, expected at least one"):
        read_text(tmp_path, document(""))
