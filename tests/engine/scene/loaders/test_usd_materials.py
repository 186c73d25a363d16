"""Preview surfaces of USD as layers, by files that the tests write."""

from __future__ import annotations

import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.scene.description import LayerDescription
from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.model import ImportedModel, ImportedPart
from engine.scene.loaders.pbr_layers import Coat, PbrMaterial, pbr_layers
from engine.scene.loaders.usd import read_usd
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import pack_glb
from tests.usd_text import READER, SQUARE, bound, card_of, material, read, texture, unshown, usda

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

NUMBERS = np.random.default_rng(3).integers(20, 220, (4, 4, 3)).astype(np.uint8)


def image(folder: Path, name: str, texels: np.ndarray = NUMBERS) -> None:
    Image.fromarray(texels).save(folder / name)


def look(folder: Path, inputs: str, more: str = "") -> tuple[ImportedPart, ImportedModel]:
    """The part of a card with a material M."""
    model = read(folder, material("M", inputs, more) + card_of("M"))
    (part,) = model.parts
    return part, model


def layer(part: ImportedPart, name: str) -> LayerDescription:
    return next(each for each in part.layers if each.name == name)


def test_a_material_without_inputs_is_that_of_the_schema(tmp_path: Path) -> None:
    part, model = look(tmp_path, "")
    # diffuseColor 0.18, roughness 0.5, ior 1.5, no metal and no coat.
    f0 = (0.5 / 2.5) ** 2
    assert part.layers == pbr_layers(PbrMaterial((0.18,) * 3, 0.0, 0.5, facing=(f0, f0, f0))) and part.name == "M"
    assert not model.unshown and part.opacity.opacity_mode == "opaque" and part.emission.radiance is None


def test_numbers_are_those_of_metallic_roughness(tmp_path: Path) -> None:
    part, model = look(
        tmp_path,
        """color3f inputs:diffuseColor = (0.8, 0.4, 0.2)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.3
        float inputs:ior = 2
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.1
        color3f inputs:emissiveColor = (3, 2, 1)
        color3f inputs:specularColor = (1, 0, 0)""",
    )
    f0 = 1.0 / 9.0
    expected = PbrMaterial((0.8, 0.4, 0.2), 0.25, 0.3, facing=(f0, f0, f0), coat=Coat(0.5, 0.1))
    assert part.layers == pbr_layers(expected) and part.emission.radiance == (3.0, 2.0, 1.0)
    # Without useSpecularWorkflow its colour counts for nothing.
    assert unshown(model) == {"Shader.inputs:clearcoat": 1}  # which does not dim the emission


def test_a_texture_shines_by_its_scale(tmp_path: Path) -> None:
    image(tmp_path, "screen.png")
    glow = "color3f inputs:emissiveColor.connect = </M/A.outputs:rgb>"
    part, model = look(tmp_path, glow, READER + texture("A", "screen.png", "float4 inputs:scale = (8, 4, 2, 1)"))
    assert part.emission.radiance == (8.0, 4.0, 2.0) and part.emission.texture.texture == "screen.png"
    assert not model.unshown
    # An image that is not there leaves the fallback of the node, black.
    part, model = look(tmp_path, glow, READER + texture("A", "gone.png"))
    assert part.emission.radiance is None and unshown(model)["Shader.inputs:file"] == 1


def test_the_specular_workflow(tmp_path: Path) -> None:
    part, _ = look(
        tmp_path,
        """int inputs:useSpecularWorkflow = 1
        color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        color3f inputs:specularColor = (0.9, 0.5, 0.1)
        float inputs:metallic = 1""",
    )
    assert part.layers == pbr_layers(PbrMaterial((0.1, 0.2, 0.3), 0.0, 0.5, facing=(0.9, 0.5, 0.1)))


def test_opacity_blends_or_cuts_out(tmp_path: Path) -> None:
    part, _ = look(tmp_path, "float inputs:opacity = 0.25")
    assert (part.opacity.opacity_mode, part.opacity.opacity_factor) == ("blend", 0.25)
    image(tmp_path, "leaf.png", np.dstack([NUMBERS, NUMBERS[..., :1]]))
    part, model = look(
        tmp_path,
        "float inputs:opacity.connect = </M/T.outputs:a>\n float inputs:opacityThreshold = 0.4",
        READER + texture("T", "leaf.png"),
    )
    own = part.opacity
    assert (own.opacity_mode, own.opacity_cutoff, own.opacity_map) == ("mask", 0.4, "leaf.png") and not model.unshown


def test_textures_of_colours_and_numbers_with_their_layout(tmp_path: Path) -> None:
    for name in ("colour.png", "numbers.png", "relief.png"):
        image(tmp_path, name)
    layout = """
    def Shader "Layout" {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </M/Reader.outputs:result>
        float2 inputs:scale = (2, 3)
        float inputs:rotation = 30
        float2 inputs:translation = (0.25, -0.5)
        float2 outputs:result
    }"""
    moved = texture("Colour", "./colour.png", 'token inputs:wrapS = "mirror"\n token inputs:wrapT = "clamp"').replace(
        "Reader.outputs", "Layout.outputs"
    )
    scale = "float4 inputs:scale = (1, -1, 2, 1)"
    part, model = look(
        tmp_path,
        """color3f inputs:diffuseColor.connect = </M/Colour.outputs:rgb>
        float inputs:roughness.connect = </M/Numbers.outputs:g>
        float inputs:metallic.connect = </M/Numbers.outputs:b>
        normal3f inputs:normal.connect = </M/Relief.outputs:rgb>""",
        READER + layout + moved + texture("Numbers", "numbers.png", 'token inputs:sourceColorSpace = "raw"')
        + texture("Relief", "relief.png", f"{scale}\n float4 inputs:bias = (-0.5, 0.5, 0, 0)"),
    )  # fmt: skip
    maps = layer(part, "base").maps
    assert (maps.texture, maps.texture_scale, maps.texture_rotation) == ("colour.png", (2.0, 3.0), 30.0)
    assert (maps.texture_offset, maps.texture_wrap) == ((0.25, -0.5), ("mirror", "clamp"))
    widths = layer(part, "gloss").parameter_maps["alpha"]
    assert (widths["map"], widths["channel"], widths["range"], widths["response"]) == (
        "numbers.png", "g", (0.0, 1.0), "square",
    )  # fmt: skip
    assert layer(part, "gloss").parameter_maps["scale"]["channel"] == "b"
    assert (part.bumps.normal_map, part.bumps.bump_strength, part.bumps.flip_green) == ("relief.png", 0.5, True)
    assert not model.unshown and not model.notes


def test_textures_lie_by_their_own_coordinates(tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "c.png"):
        image(tmp_path, name)
    readers = READER + "".join(
        READER.replace('"Reader"', f'"{name}"').replace('"st"', f'"{name}"') for name in ("Second", "Third")
    )
    own = [texture(k, f"{k.lower()}.png").replace("Reader.outputs", f"{at}.outputs") for k, at in
           (("A", "Reader"), ("B", "Second"), ("C", "Third"))]  # fmt: skip
    inputs = """color3f inputs:diffuseColor.connect = </M/A.outputs:rgb>
        float inputs:roughness.connect = </M/B.outputs:g>
        float inputs:metallic.connect = </M/C.outputs:b>"""
    second = 'texCoord2f[] primvars:Second = [(5, 5), (6, 5), (6, 6), (5, 6)] (interpolation = "vertex")'
    mesh = f'def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}{bound("M")}{second}\n}}'
    model = read(tmp_path, material("M", inputs, readers + "".join(own)) + mesh)
    (part,) = model.parts
    assert part.mesh.uvs is not None and part.mesh.uvs[0].tolist() == [[0, 0, 5, 5], [1, 0, 6, 5], [1, 1, 6, 6]]
    assert layer(part, "base").maps.texture_uv_set == 0
    assert layer(part, "gloss").parameter_maps["alpha"]["uv_set"] == 1
    assert unshown(model) == {"Shader.inputs:st": 1}


def test_a_texture_that_is_the_same_everywhere_is_a_number(tmp_path: Path) -> None:
    image(tmp_path, "half.png", np.full((4, 4, 3), 51, np.uint8))
    part, _ = look(
        tmp_path, "float inputs:roughness.connect = </M/T.outputs:r>",
        READER + texture("T", "half.png", "float4 inputs:scale = (2, 1, 1, 1)\n float4 inputs:bias = (0.1, 0, 0, 0)"),
    )  # fmt: skip
    # 2 · 51/255 + 0.1 = 0.5.
    assert layer(part, "gloss").parameters["alpha"] == pytest.approx(0.25) and not layer(part, "gloss").parameter_maps


def test_inputs_of_an_interface_and_graphs_of_nodes(tmp_path: Path) -> None:
    image(tmp_path, "colour.png")
    reader = READER.replace('string inputs:varname = "st"', "string inputs:varname.connect = </M.inputs:coordinates>")
    own_file, its_file = "asset inputs:file = @colour.png@", "asset inputs:file.connect = </M.inputs:picture>"
    body = f"""
    def Material "M" {{
        float inputs:rough = 0.2
        string inputs:coordinates = "st"
        asset inputs:picture = @colour.png@
        token outputs:surface.connect = </M/Graph.outputs:surface>
        def NodeGraph "Graph" {{
            float inputs:inner.connect = </M.inputs:rough>
            token outputs:surface.connect = </M/Graph/Surface.outputs:surface>
            def Shader "Surface" {{
                uniform token info:id = "UsdPreviewSurface"
                float inputs:roughness.connect = </M/Graph.inputs:inner>
                color3f inputs:diffuseColor.connect = </M/Colour.outputs:rgb>
                token outputs:surface
            }}
        }}
        {reader}
        {texture("Colour", "colour.png").replace(own_file, its_file)}
    }}
    """
    model = read(tmp_path, body + card_of("M"))
    (part,) = model.parts
    assert layer(part, "gloss").parameters["alpha"] == pytest.approx(0.04)
    assert layer(part, "base").maps.texture == "colour.png" and not model.unshown


def test_colours_of_vertices_are_shown_where_the_material_reads_them(tmp_path: Path) -> None:
    mesh = f'def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}{bound("M")}'
    mesh += (
        '\ncolor3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (interpolation = "vertex")\n}'
    )
    reader = """def Shader "Paint" {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "displayColor"
        float3 outputs:result
    }"""
    painted = material("M", "color3f inputs:diffuseColor.connect = </M/Paint.outputs:result>", reader)
    (part,) = read(tmp_path, painted + mesh).parts
    assert layer(part, "base").maps.vertex_colours and part.mesh.colours is not None
    assert part.mesh.colours[0, :, :3].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    model = read(tmp_path, material("M", "") + mesh)
    assert model.parts[0].mesh.colours is None and unshown(model) == {"Mesh.primvars:displayColor": 1}


def test_subsets_have_their_materials_and_the_rest_that_of_the_mesh(tmp_path: Path) -> None:
    body = f"""
    def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        int[] faceVertexCounts = [3, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 0, 3, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
        {bound("Red")}
        def GeomSubset "S" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1, 99]
            {bound("Blue")}
        }}
    }}
    """
    model = read(tmp_path, body + material("Red", "") + material("Blue", ""))
    assert {part.name: len(part.mesh.triangles) for part in model.parts} == {"Red": 2, "Blue": 1}
    assert any("99" in note for note in model.notes)


def test_a_material_of_a_prim_above_and_of_an_instance(tmp_path: Path) -> None:
    body = f"""
    def Xform "A" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{bound("Red")} def Mesh "M" {{{SQUARE}}} }}
    class Xform "Tree" {{ def Mesh "M" {{{SQUARE}}} }}
    def Xform "B" (
        instanceable = true
        prepend inherits = </Tree>
        prepend apiSchemas = ["MaterialBindingAPI"]
    ) {{{bound("Blue")}}}
    """
    model = read(tmp_path, body + material("Red", "") + material("Blue", ""))
    assert sorted(part.name for part in model.parts) == ["Blue", "Red"]


def test_what_a_material_cannot_show_is_listed(tmp_path: Path) -> None:
    image(tmp_path, "a.png")
    part, model = look(
        tmp_path,
        """color3f inputs:emissiveColor.connect = </M/A.outputs:rgb>
        float inputs:occlusion.connect = </M/A.outputs:r>
        float inputs:displacement = 0.5
        color3f inputs:diffuseColor.connect = </M/Gone.outputs:rgb>
        float inputs:roughness.connect = </M/Odd.outputs:out>
        float inputs:unheardOf = 3""",
        READER + texture("A", "a.png") + texture("Gone", "gone.png", "float4 inputs:fallback = (0.5, 0.25, 0, 1)")
        + 'def Shader "Odd" { uniform token info:id = "Noise"\n float outputs:out }',
    )  # fmt: skip
    assert unshown(model) == {
        "Shader.inputs:occlusion": 1, "Shader.inputs:displacement": 1,
        "Shader.inputs:file": 1, "Shader.inputs:roughness": 1, "Shader.inputs:unheardOf": 1,
    }  # fmt: skip
    assert layer(part, "base").parameters["albedo"] == (0.5, 0.25, 0.0)  # the texture's fallback


def test_an_unknown_surface_is_grey_and_listed(tmp_path: Path) -> None:
    body = material("M", "").replace("UsdPreviewSurface", "PxrSurface") + card_of("M")
    model = read(tmp_path, body)
    assert model.parts[0].layers == () and model.parts[0].name == "M"
    assert [each.effect for each in model.unshown] == ["a surface PxrSurface that is not known: shown in grey"]


def test_a_stage_and_a_glb_file_of_one_scene_have_the_same_arrays(tmp_path: Path) -> None:
    """A textured card with metal, roughness, a coat and a normal map, under a transform."""
    for name in ("colour.png", "numbers.png", "relief.png"):
        image(tmp_path, name)
    places = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "<f4")
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")  # downwards
    corners = np.array([0, 1, 2, 0, 2, 3], "<u2")
    chunks = [places.tobytes(), uvs.tobytes(), corners.tobytes()]
    chunks += [(tmp_path / name).read_bytes() for name in ("colour.png", "numbers.png", "relief.png")]
    starts = np.cumsum([0, *map(len, chunks)]).tolist()
    views = [{"buffer": 0, "byteOffset": a, "byteLength": b - a} for a, b in pairwise(starts)]
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 2, 3], "rotation": [0, 0.6, 0, 0.8], "scale": [2, 1, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
                      {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": views,
        "buffers": [{"byteLength": starts[-1]}],
        "images": [{"bufferView": 3 + k, "mimeType": "image/png"} for k in range(3)],
        "textures": [{"source": k} for k in range(3)],
        "materials": [{
            "name": "M",
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
            "normalTexture": {"index": 2},
            "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1}},
        }],
    }  # fmt: skip
    (tmp_path / "a.glb").write_bytes(pack_glb(tree, b"".join(chunks)))
    look_of = material(
        "M",
        """color3f inputs:diffuseColor.connect = </M/Colour.outputs:rgb>
        float inputs:roughness.connect = </M/Numbers.outputs:g>
        float inputs:metallic.connect = </M/Numbers.outputs:b>
        normal3f inputs:normal.connect = </M/Relief.outputs:rgb>
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.1""",
        READER + texture("Colour", "colour.png", 'token inputs:sourceColorSpace = "sRGB"')
        + texture("Numbers", "numbers.png", 'token inputs:sourceColorSpace = "raw"')
        + texture("Relief", "relief.png", "float4 inputs:scale = (2, 2, 2, 1)\n float4 inputs:bias = (-1, -1, -1, 0)"),
    )  # fmt: skip
    mesh = f"""def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}{bound("M")}
        double3 xformOp:translate = (1, 2, 3)
        quatf xformOp:orient = (0.8, 0, 0.6, 0)
        float3 xformOp:scale = (2, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient", "xformOp:scale"]
    }}"""
    (tmp_path / "a.usda").write_text(usda(look_of + mesh))
    ours, theirs = read_usd(tmp_path / "a.usda").parts[0], read_gltf(tmp_path / "a.glb").parts[0]
    names = {"#0": "colour.png", "#1": "numbers.png", "#2": "relief.png"}

    def renamed(each: LayerDescription) -> LayerDescription:
        maps = each.maps.with_files(lambda name: names[name])
        tables = {key: table | {"map": names[str(table["map"])]} for key, table in each.parameter_maps.items()}
        # UsdPreviewSurface has one normal, glTF's coat its own.
        return each.model_copy(update={"maps": maps, "parameter_maps": tables, "frame": "base"})

    assert ours.layers == tuple(map(renamed, theirs.layers))
    assert ours.bumps.bump_strength == theirs.bumps.bump_strength and not ours.bumps.flip_green
    one, other = load_scene(tmp_path / "a.usda", (16, 16)), load_scene(tmp_path / "a.glb", (16, 16))
    for name in ("vertices", "normals", "triangles", "uvs"):
        assert np.allclose(getattr(one, name), getattr(other, name), atol=1e-6), name
    assert one.description.camera.position == pytest.approx(other.description.camera.position)


NETWORK = """
def Material "M" {
    token outputs:mtlx:surface.connect = </M/Surface.outputs:out>
    def Shader "Surface" {
        uniform token info:id = "ND_standard_surface_surfaceshader"
        color3f inputs:base_color.connect = </M/Graph.outputs:colour>
        float inputs:base = 1
        float inputs:specular_roughness = 0.4
        token outputs:out
    }
    def NodeGraph "Graph" {
        color3f outputs:colour.connect = </M/Graph/Tint.outputs:out>
        def Shader "Tint" {
            uniform token info:id = "ND_multiply_color3"
            color3f inputs:in1.connect = </M/Graph/Image.outputs:out>
            color3f inputs:in2 = (0.5, 0.25, 1)
            color3f outputs:out
        }
        def Shader "Image" {
            uniform token info:id = "ND_image_color3"
            asset inputs:file = @colour.png@
            color3f outputs:out
        }
    }
}
"""


@pytest.mark.parametrize("is_archive", [False, True])
def test_networks_of_materialx_are_read_and_their_maps_computed(tmp_path: Path, is_archive: bool) -> None:
    image(tmp_path, "colour.png")
    path, first = tmp_path / "a.usda", 0
    path.write_text(usda(NETWORK + card_of("M")))
    if is_archive:
        with zipfile.ZipFile(tmp_path / "a.usdz", "w") as archive:
            archive.write(path, "a.usda")
            archive.write(tmp_path / "colour.png", "colour.png")
        path, first = tmp_path / "a.usdz", 2
    model = read_usd(path)
    base = next(each for each in model.parts[0].layers if each.maps.texture)
    # The texels times a constant are a computed map, the first after the archive's files.
    assert base.maps.texture == f"#{first}" and not [each for each in model.unshown if "MaterialX" in each.effect]
    scene = load_scene(path, (8, 8))
    shown = next(each for each in scene.description.objects[0].layers if each.maps.texture)
    pyramid = scene.textures.texture(shown.maps.images)
    assert pyramid is not None
    expected = NUMBERS.astype(np.float32) / 255.0 * (0.5, 0.25, 1.0)
    assert np.allclose(pyramid.levels[0][1::3, 1::3], expected, atol=2e-3)  # of a small image


def test_a_network_that_cannot_be_read_is_listed(tmp_path: Path) -> None:
    body = NETWORK.replace("ND_standard_surface_surfaceshader", "ND_nothing_of_the_kind") + card_of("M")
    model = read(tmp_path, body)
    assert model.parts[0].layers == () and "Shader.info:id" in unshown(model)


def test_variants_that_differ_in_materials_alone_are_those_of_objects(tmp_path: Path) -> None:
    """One variant binds another material, the other changes the colour of the one that is bound."""

    def painted(colour: str) -> str:
        return f'over "Red" {{ over "Surface" {{ color3f inputs:diffuseColor = {colour}\n}} }}'

    body = f"""
def Xform "Chair" (
    prepend variantSets = "look"
    variants = {{ string look = "red" }}
) {{
    def Mesh "Seat" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}}}
    def Mesh "Leg" {{{SQUARE}}}
    {material("Red", "").replace("</Red", "</Chair/Red")}
    {material("Blue", "color3f inputs:diffuseColor = (0, 0, 1)").replace("</Blue", "</Chair/Blue")}
    variantSet "look" = {{
        "red" {{ over "Seat" {{{bound("Chair/Red")}}}
            {painted("(1, 0, 0)")} }}
        "blue" {{ over "Seat" {{{bound("Chair/Blue")}}} }}
        "dark" {{ over "Seat" {{{bound("Chair/Red")}}}
            {painted("(0.1, 0, 0)")} }}
    }}
}}
"""
    model = read(tmp_path, body, 'defaultPrim = "Chair"')
    seat, leg = sorted(model.parts, key=lambda part: part.object_name != "Seat")
    assert [each.name for each in seat.variants] == ["blue", "dark", "red"] and leg.variants == ()
    found = [each.layers[0].parameters["albedo"] for each in seat.variants]
    assert found == [(0.0, 0.0, 1.0), (0.1, 0.0, 0.0), (1.0, 0.0, 0.0)] and seat.layers == seat.variants[2].layers
    assert not unshown(model)
    # A variant that moves anything is listed.
    moved = body.replace(f'def Mesh "Leg" {{{SQUARE}}}', 'def Mesh "Leg" { }').replace(
        '"blue" {', f'"blue" {{ over "Leg" {{{SQUARE}}}'
    )
    model = read(tmp_path, moved, 'defaultPrim = "Chair"')
    assert all(part.variants == () for part in model.parts) and "variantSets.look" in unshown(model)
