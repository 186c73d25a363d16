"""Materials of OBJ files as layers: against the formulas of the format and of the programs that write it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core import safe_files
from engine.material import MODELS, validate_parameters
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.loaders.formats import read_model
from engine.scene.loaders.model import NO_EMISSION, Emission, ImportedModel, ImportedPart
from engine.scene.scene_loader import load_scene
from tests.naive.exr_files import ExrPart, exr_file

CARD = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl red\nf 1/1 2/2 3/3\n"


@pytest.fixture
def material(mesh_file: Callable[..., Path]) -> Callable[[str], ImportedPart]:
    """material(text) reads a card of the material of that text."""

    def read(text: str) -> ImportedPart:
        return model(mesh_file, text).parts[0]

    return read


def model(mesh_file: Callable[..., Path], text: str) -> ImportedModel:
    mesh_file("a.mtl", text.replace("newmtl red", "newmtl red", 1))
    return read_model(mesh_file("a.obj", CARD))


def picture(folder: Path, name: str, colour: tuple[int, int, int] = (200, 100, 50)) -> None:
    (folder / name).parent.mkdir(exist_ok=True)
    Image.new("RGB", (4, 4), colour).save(folder / name)


def test_the_highlight_is_that_of_the_formula_at_normal_incidence(material: Callable[[str], ImportedPart]) -> None:
    diffuse, glossy = material("newmtl red\nKd 0.4 0.3 0.2\nKs 0.9 0.5 0.1\nNs 30\n").layers
    assert diffuse.parameters["albedo"] == (0.4, 0.3, 0.2)
    values = validate_parameters(MODELS[glossy.model], glossy.parameters, "a.mtl")
    wi = np.array([[0.0, 0, 1]])
    found = MODELS[glossy.model].brdf(values, wi, wi)
    # In light of strength 1, of which white shows 1 (a radiance of pi from its direction), the highlight shows Ks.
    np.testing.assert_allclose(found[0] * np.pi, [0.9, 0.5, 0.1], rtol=1e-6)


def test_light_from_nowhere_is_scaled_with_a_note(mesh_file: Callable[..., Path]) -> None:
    found = model(mesh_file, "newmtl red\nKd 0.9 0.1 0.1\nKs 1 1 1\nNs 6\n")
    diffuse, glossy = found.parts[0].layers
    # 8 / (Ns + 2) = 1: together 1.9 in red.
    assert diffuse.parameters["albedo"] == pytest.approx((0.9 / 1.9, 0.1 / 1.9, 0.1 / 1.9))
    assert glossy.parameters["scale"] == pytest.approx((1 / 1.9,) * 3)
    assert found.notes == ("red reflects 1.9 times the light it receives: scaled to 1",)


@pytest.mark.parametrize("more", ["illum 1\nKs 1 1 1\n", "Ks 0 0 0\n", ""])
def test_without_a_highlight_there_is_one_layer(material: Callable[[str], ImportedPart], more: str) -> None:
    (only,) = material("newmtl red\nKd 0.5 0.5 0.5\n" + more).layers
    assert only.model == "lambert"


def test_blenders_numbers_are_metallic_roughness(material: Callable[[str], ImportedPart]) -> None:
    head = "# Blender 4.2.0 MTL File: 'a.blend'\n# www.blender.org\n\nnewmtl red\nNs 250.0\nKa 1 1 1\nKd 0.8 0.1 0.1\n"
    diffuse, glossy = material(head + "Ks 0.5 0.5 0.5\nNi 1.5\nd 1.0\nillum 2\n").layers
    assert glossy.parameters["alpha"] == pytest.approx(0.5**4**0.5)  # roughness 1 − √(250 / 1000) = 1/2, squared
    assert glossy.parameters["f0"] == pytest.approx((0.04,) * 3)  # 0.08 · 0.5
    assert diffuse.parameters["albedo"] == pytest.approx((0.8, 0.1, 0.1)) and diffuse.follows == glossy.name
    (metal,) = material(head + "Ks 0.5 0.5 0.5\nillum 3\n").layers
    assert metal.model == "microfacet" and metal.parameters["f0"][0] > 0.5


def test_the_physically_based_extension(material: Callable[[str], ImportedPart]) -> None:
    diffuse, glossy = material("newmtl red\nKd 0.5 0.5 0.5\nPr 0.3\nPm 0\nNi 2\n").layers
    assert glossy.parameters["alpha"] == pytest.approx(0.09) and glossy.parameters["f0"] == pytest.approx((1 / 9,) * 3)
    (metal,) = material("newmtl red\nKd 1 0.8 0.3\nPr 0.3\nPm 1\n").layers
    assert metal.model == "microfacet" and metal.parameters["f0"][0] > 0.5


def test_sheen_and_coat_of_the_extension(mesh_file: Callable[..., Path]) -> None:
    text = "newmtl red\nKd 0.5 0.5 0.5\nPr 0.3\nPs 0.5\nPc 0.8\nPcr 0.1\n"
    found = model(mesh_file, text)
    names = [layer.name for layer in found.parts[0].layers]
    assert names == ["base", "gloss", "sheen", "coat"] and not found.unshown
    coat = found.parts[0].layers[-1]
    assert coat.parameters["alpha"] == pytest.approx(0.01) and coat.parameters["scale"] == pytest.approx(0.8)
    plain = model(mesh_file, text.replace("Pr 0.3\n", ""))  # without Pr or Pm it is the format's own
    assert {each.name for each in plain.unshown} == {"mtl.ps", "mtl.pc", "mtl.pcr"}


def test_images_with_their_options_and_names_of_other_systems(
    tmp_path: Path, material: Callable[[str], ImportedPart]
) -> None:
    picture(tmp_path, "tex/Wood grain.png")
    for name in ("tex/Wood grain.png", "TEX\\wood GRAIN.png", "./tex/Wood grain.png"):
        (only,) = material(f"newmtl red\nmap_Kd -s 2 3 1 -o 0.25 0.5 -clamp on {name}\n").layers
        maps = only.maps
        assert (maps.texture, maps.texture_space) == ("tex/Wood grain.png", "srgb"), name
        assert (maps.texture_scale, maps.texture_offset) == ((2.0, 3.0), (0.25, 0.5))
        assert maps.texture_wrap == ("clamp", "clamp") and only.parameters["albedo"] == (1.0, 1.0, 1.0)
    picture(tmp_path, "wood.png")
    for name in ("C:\\Users\\me\\wood.png", "/home/me/wood.png", "../other/wood.png"):
        assert material(f"newmtl red\nKd 0 0 0\nmap_Kd {name}\n").layers[0].maps.texture == "wood.png", name


def test_scenes_name_images_from_their_own_folder(tmp_path: Path, mesh_file: Callable[..., Path]) -> None:
    from tests.engine.scene.conftest import VIEW
    from tests.scene_text import placed

    (tmp_path / "parts").mkdir()
    picture(tmp_path, "parts/wood.png")
    (tmp_path / "parts" / "a.mtl").write_text(
        "newmtl red\nKd 0.5 0.5 0.5\nKs 1 1 1\nNs 99\nmap_Kd wood.png\nmap_Ks wood.png\n"
    )
    (tmp_path / "parts" / "a.obj").write_text(CARD)
    scene = load_scene(mesh_file("scene.toml", VIEW + placed("card", "parts/a.obj")))
    names = [layer.maps.texture for layer in scene.description.objects[0].layers]
    assert names == ["parts/wood.png"] * 2 and not scene.notes


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("absent.png", "file = not there"),
        ("/etc/passwd", "file = not there"),
        ("../../x.png", "file = not there"),
        ("out.png", "file = not there"),
        ("pipe.png", "file = a named pipe"),
        ("a.mtl", "format = .mtl, expected PNG, JPEG, WebP, KTX 2 or OpenEXR"),
        ("cut.png", "PNG image = "),
    ],
)
def test_images_that_cannot_be_shown_are_notes(
    tmp_path: Path, mesh_file: Callable[..., Path], name: str, why: str
) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "out.png").symlink_to("/etc/passwd")
    picture(tmp_path, "whole.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:20])
    found = model(mesh_file, f"newmtl red\nmap_Kd {name}\n")
    (note,) = found.notes
    assert note.startswith(f"image {name} is not shown: {why}")
    assert found.parts[0].layers[0].maps.is_plain


@pytest.mark.parametrize("name", ["wood.png", "wood.jpg", "wood.exr"])
@pytest.mark.parametrize("key", ["map_Kd", "map_bump", "map_d"])
def test_an_image_that_is_cut_off_is_a_note(
    tmp_path: Path, mesh_file: Callable[..., Path], name: str, key: str
) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (40, 40, 3)).astype(np.uint8)
    if name == "wood.exr":
        channels = {"R": pixels[..., 0] / np.float32(255), "G": pixels[..., 1] / np.float32(255)}
        (tmp_path / name).write_bytes(exr_file(ExrPart(channels)))
    else:
        Image.fromarray(pixels).save(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    text = f"newmtl red\n{key} {name}\n"
    assert not any("is not shown" in note for note in model(mesh_file, text).notes)
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    found = model(mesh_file, text)
    (note,) = found.notes
    assert note.startswith(f"image {name} is not shown: ")
    assert load_scene(tmp_path / "a.obj").object_names == ("a", "floor")


def test_an_image_is_examined_once_and_all_may_have_so_many_pixels(
    tmp_path: Path, mesh_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.scene.loaders.image_files.MOST_PIXELS", 6000)
    names = [f"blank {k}.png" for k in range(4)]
    for name in names:
        Image.new("1", (100, 60)).save(tmp_path / name)
    left = 2 * 32 * (tmp_path / names[0]).stat().st_size  # by the bytes of two, after one
    assert left < 6000
    opened = []
    read = safe_files.local_path
    monkeypatch.setattr(safe_files, "local_path", lambda path: opened.append(path) or read(path))
    text = "".join(f"newmtl {k}\nmap_Kd {names[k // 2]}\nmap_d {names[k // 2]}\n" for k in range(4))
    mesh_file("a.mtl", text)
    faces = "".join(f"usemtl {k}\nf {1 + k}/1 {2 + k}/2 {3 + k}/3\n" for k in range(4))
    places = "".join(f"v {k} {k * k} 0\n" for k in range(6))
    found = read_model(mesh_file("a.obj", "mtllib a.mtl\nvt 0 0\nvt 1 0\nvt 1 1\n" + places + faces))
    assert [part.layers[0].maps.texture for part in found.parts] == [names[0]] * 2 + [""] * 2
    (note,) = found.notes
    why = f"pixels, with those of other images = 6000, expected at most {left}"
    assert note == f"image blank 1.png is not shown: {why}"
    assert [path.name for path in opened] == ["a.obj", "a.mtl", names[0], names[1]]


def test_bumps_are_normals_or_heights_by_key_or_colour(tmp_path: Path, mesh_file: Callable[..., Path]) -> None:
    picture(tmp_path, "n.png", (128, 128, 255))
    picture(tmp_path, "h.png", (90, 90, 90))
    for line, normal, height in (
        ("norm h.png", "h.png", ""), ("map_Bump -bm 0.5 n.png", "n.png", ""), ("bump -bm 0.5 h.png", "", "h.png")
    ):  # fmt: skip
        found = model(mesh_file, f"newmtl red\n{line}\n")
        bumps = found.parts[0].bumps
        assert (bumps.normal_map, bumps.bump_map) == (normal, height)
        assert bumps.bump_strength == (0.5 if "-bm" in line else 1.0)
        assert bool(found.notes) == bool(height)  # heights have no unit


def test_what_is_not_shown_is_listed_by_its_key(mesh_file: Callable[..., Path]) -> None:
    text = (
        "newmtl red\nKd 0.5 0.5 0.5\nTf 1 1 1\nTr 0\nd 1\nKa 0.2 0.2 0.2\nsharpness 60\nillum 5\nPs 0.5\nPc 0\n"
        "map_Ns a.png\nwave 3\nKe spectral a.rfl\nnewmtl blue\nPs 0.5\n"
    )
    found = model(mesh_file, text)
    names = {each.name: each.count for each in found.unshown}
    assert names == dict.fromkeys(["mtl.illum", "mtl.ps", "mtl.map_ns", "mtl.wave", "mtl.ke"], 1)
    assert all(each.effect for each in found.unshown)


def test_emission_and_numbers_that_are_none(material: Callable[[str], ImportedPart]) -> None:
    part = material("newmtl red\nKd nan 1 1\nKs 1e999 1 1\nKe 2 0.5 0\nNs -4\n")
    assert part.emission == Emission((2.0, 0.5, 0.0))
    assert part.layers[0].parameters["albedo"] == (0.8, 0.8, 0.8)


def test_images_of_emission_multiply_it_and_stand_for_it(
    tmp_path: Path, material: Callable[[str], ImportedPart]
) -> None:
    picture(tmp_path, "glow.png")
    maps = LayerMaps("glow.png", "srgb", (2.0, 3.0))
    assert material("newmtl red\nKe 2 1 0\nmap_Ke -s 2 3 1 glow.png\n").emission == Emission((2.0, 1.0, 0.0), maps)
    assert material("newmtl red\nKe 0 0 0\nmap_Ke -s 2 3 1 glow.png\n").emission == Emission((1.0, 1.0, 1.0), maps)
    # A surface does not glow all over where the image of its few lights is gone.
    assert material("newmtl red\nKe 1 1 1\nmap_Ke gone.png\n").emission == NO_EMISSION


def test_images_of_roughness_and_metalness_are_maps_of_parameters(
    tmp_path: Path, mesh_file: Callable[..., Path]
) -> None:
    for name in ("rough.png", "metal.png"):
        picture(tmp_path, name)
    found = model(mesh_file, "newmtl red\nPr 0.5\nmap_Pr rough.png\nmap_Pm -clamp on metal.png\n")
    assert found.unshown == ()
    glosses = [layer for layer in found.parts[0].layers if layer.model == "microfacet"]
    # Alpha is the square of 0.5 times the image; metalness is the image alone, in parts for 0 and 1.
    assert {layer.parameter_maps["alpha"]["map"] for layer in glosses} == {"rough.png"}
    assert all(layer.parameter_maps["alpha"]["range"] == (0.0, 0.25) for layer in glosses)
    assert {layer.parameter_maps["scale"]["map"] for layer in glosses} == {"metal.png"}
    assert all(layer.parameter_maps["scale"]["wrap"] == ("clamp", "clamp") for layer in glosses)
    by_blender = model(mesh_file, "# Blender 4.2\nnewmtl red\nNs 250\nKd 1 1 1\nillum 2\nmap_Ns rough.png\n")
    (gloss,) = (layer for layer in by_blender.parts[0].layers if layer.model == "microfacet")
    assert gloss.parameter_maps["alpha"]["range"] == (0.0, 1.0) and by_blender.unshown == ()
    (only,) = model(mesh_file, "newmtl red\nKs 1 1 1\nNs 9\nmap_Ns rough.png\n").unshown
    assert only.name == "mtl.map_ns"


def test_a_file_without_normals_is_smooth_across_materials_unless_it_says_off(mesh_file: Callable[..., Path]) -> None:
    roof = "v 0 0 0\nv 1 0 0\nv 0 1 1\nv 1 1 1\nv 0 2 0\nv 1 2 0\n{}usemtl a\nf 1 2 4 3\nusemtl b\nf 3 4 6 5\n"
    one, two = read_model(mesh_file("a.obj", roof.format(""))).parts
    assert one.smooth and one.mesh.normals is not None and two.mesh.normals is not None
    ridge = [each.mesh.normals[np.flatnonzero(each.mesh.vertices[:, 2] == 1.0)] for each in (one, two)]
    np.testing.assert_allclose(ridge[0], ridge[1], atol=1e-12)
    for off in ("s off\n", "s 0\n"):
        one, two = read_model(mesh_file("a.obj", roof.format(off))).parts
        assert not one.smooth and not two.smooth and one.mesh.normals is None


def test_vertex_colours_are_srgb(mesh_file: Callable[..., Path]) -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nf 1 2 3\n"
    (part,) = read_model(mesh_file("a.obj", text)).parts
    assert part.mesh.colours is not None
    np.testing.assert_allclose(
        part.mesh.colours[0], [[1, 0, 0, 1], [0.21404, 0.21404, 0.21404, 1], [1, 1, 1, 1]], atol=1e-5
    )


def test_opacity_is_of_numbers_and_images(tmp_path: Path, mesh_file: Callable[..., Path]) -> None:
    picture(tmp_path, "leaf.png")
    for text, opacity, n_notes in (
        ("d 1", OPAQUE, 0), ("Tr 0", OPAQUE, 0), ("d 0.25", Opacity("blend", opacity_factor=0.25), 0),
        ("Tr 0.25", Opacity("blend", opacity_factor=0.75), 0),
        ("d 0.5\nTr 0.25", Opacity("blend", opacity_factor=0.5), 0),
        ("Tr 1", OPAQUE, 1), ("map_d leaf.png", Opacity("blend", opacity_map="leaf.png"), 0),
    ):  # fmt: skip
        found = model(mesh_file, f"newmtl red\nKd 0.5 0.5 0.5\n{text}\n")
        assert found.parts[0].opacity == opacity and len(found.notes) == n_notes, text


def test_vertex_colours_multiply_the_diffuse_colour(mesh_file: Callable[..., Path]) -> None:
    coloured = CARD.replace("v 0 0 0", "v 0 0 0 1 0 0")
    mesh_file("a.mtl", "newmtl red\nKd 0.5 0.5 0.5\nKs 0.5 0.5 0.5\n")
    diffuse, glossy = read_model(mesh_file("a.obj", coloured)).parts[0].layers
    assert diffuse.maps.vertex_colours and not glossy.maps.vertex_colours
