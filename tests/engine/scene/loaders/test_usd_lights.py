"""Lights and cameras of USD: their units, sizes and places, by files that the tests write."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.scene.loaders.model import ImportedModel
from engine.scene.loaders.usd import read_usd
from engine.scene.scene_loader import load_scene
from tests.pictures import write_exr
from tests.usd_text import CARD, place, read, unshown, usda, write

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")


def lit(folder: Path, light: str, head: str = "") -> ImportedModel:
    return read(folder, f"{CARD}\n{light}", head)


def test_radiance_is_intensity_exposure_and_colour(tmp_path: Path) -> None:
    text = f"""def SphereLight "L" {{
        float inputs:intensity = 3
        float inputs:exposure = 2
        color3f inputs:color = (1, 0.5, 0)
        float inputs:radius = 0.25
        {place(1, 2, 3)}
    }}"""
    model = lit(tmp_path, text)
    (lamp,) = model.lamps
    assert lamp.shape == "sphere" and lamp.radiance == (12.0, 6.0, 0.0) and not model.unshown
    assert np.allclose(lamp.matrix, [[0.5, 0, 0, 1], [0, 0.5, 0, 2], [0, 0, 0.5, 3], [0, 0, 0, 1]])
    # Files before USD 21 have no `inputs:`.
    (old,) = lit(tmp_path, 'def SphereLight "L" { float intensity = 3\n float radius = 0.25\n}').lamps
    assert old.radiance == (3.0, 3.0, 3.0)


@pytest.mark.parametrize(
    ("light", "area"),
    [
        ('SphereLight "L" { float inputs:radius = 2\n', 4.0 * math.pi * 4.0),
        ('DiskLight "L" { float inputs:radius = 2\n', math.pi * 4.0),
        ('RectLight "L" { float inputs:width = 2\n float inputs:height = 3\n', 6.0),
    ],
)
def test_normalized_lights_are_divided_by_their_area_in_the_units_of_the_stage(
    tmp_path: Path, light: str, area: float
) -> None:
    scaled = 'float3 xformOp:scale = (2, 2, 2)\n uniform token[] xformOpOrder = ["xformOp:scale"]'
    body = f"def {light} bool inputs:normalize = 1\n float inputs:intensity = 100\n{scaled}\n}}"
    path = tmp_path / "a.usda"
    path.write_text(usda(f"{CARD}\n{body}").replace("metersPerUnit = 1", "metersPerUnit = 0.01"))
    (lamp,) = read_usd(path).lamps
    assert lamp.radiance == pytest.approx((100.0 / (4.0 * area),) * 3)


def test_panels_and_discs_shine_along_minus_z(tmp_path: Path) -> None:
    for kind, shape in (("RectLight", "quad"), ("DiskLight", "disc")):
        (lamp,) = lit(tmp_path, f'def {kind} "L" {{}}').lamps
        assert lamp.shape == shape and np.allclose(lamp.matrix[:3, 2], [0, 0, -1])
        assert np.linalg.det(lamp.matrix) > 0.0


def test_distant_lights_are_suns(tmp_path: Path) -> None:
    text = """def DistantLight "L" {
        float inputs:intensity = 1000
        float inputs:angle = 2
        float3 xformOp:rotateXYZ = (-90, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    }"""
    model = lit(tmp_path, text)
    (sun,) = model.lights
    assert sun.kind == "directional" and np.allclose(sun.direction, [0, -1, 0], atol=1e-12) and sun.diameter == 2.0
    assert sun.intensity == pytest.approx((1000.0 * math.pi * math.sin(math.radians(1.0)) ** 2,) * 3)
    (sun,) = lit(tmp_path, 'def DistantLight "L" { float inputs:intensity = 3\n bool inputs:normalize = 1\n}').lights
    assert sun.intensity == (3.0, 3.0, 3.0)


def test_colour_temperatures_are_those_of_the_library(tmp_path: Path) -> None:
    from pxr import UsdLux

    text = 'def SphereLight "L" { bool inputs:enableColorTemperature = 1\n float inputs:colorTemperature = 2700\n}'
    (lamp,) = lit(tmp_path, text).lamps
    assert lamp.radiance == pytest.approx(tuple(UsdLux.BlackbodyTemperatureAsRgb(2700.0)), rel=1e-6)
    assert lamp.radiance[0] > 1.0 > lamp.radiance[2]


def test_cones_are_those_of_the_lamp(tmp_path: Path) -> None:
    text = """def {0} "L" (prepend apiSchemas = ["ShapingAPI"]) {{
        float inputs:shaping:cone:angle = 30
        float inputs:shaping:cone:softness = 0.25
        float inputs:radius = 0.5
        float inputs:intensity = 8
        float inputs:shaping:focus = 2
    }}"""
    for kind in ("SphereLight", "DiskLight"):
        model = lit(tmp_path, text.format(kind))
        (lamp,) = model.lamps
        assert lamp.cone is not None and lamp.radiance == (8.0, 8.0, 8.0)
        assert lamp.cone[1] == pytest.approx(math.radians(30.0))
        # The power of glTF's cone is that of 1 - smoothstep from 22.5 to 30 degrees.
        angles = np.linspace(0.0, lamp.cone[1], 5_001)
        t = np.clip((np.degrees(angles) - 22.5) / 7.5, 0.0, 1.0)
        inner, outer = np.cos(lamp.cone)
        ours = np.clip((np.cos(angles) - outer) / (inner - outer), 0.0, 1.0) ** 2
        weight = np.sin(angles) * np.cos(angles)
        assert (ours * weight).sum() == pytest.approx(((1.0 - t**2 * (3.0 - 2.0 * t)) * weight).sum(), rel=1e-3)
        assert np.allclose(lamp.matrix[:3, 2] / np.linalg.norm(lamp.matrix[:3, 2]), [0, 0, -1])  # its cone's axis
        names = {f"{kind}.inputs:shaping:cone:softness": 1, f"{kind}.inputs:shaping:focus": 1}
        assert unshown(model) == names
        scene = load_scene(tmp_path / "a.usda", (8, 8))
        cone = scene.description.objects[scene.object_index("L")].cone
        assert cone is not None and (cone.inner, cone.outer) == pytest.approx(np.degrees(lamp.cone))


def test_an_image_of_a_rectangle_is_upright_as_seen_from_its_front(tmp_path: Path) -> None:
    Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)).save(
        tmp_path / "four.png"
    )
    image = "asset inputs:texture:file = @four.png@\n float inputs:intensity = 3"
    scene = load_scene(write(tmp_path / "a.usda", f'{CARD}\ndef RectLight "Panel" {{ {image}\n}}'), (8, 8))
    k = scene.object_index("Panel")
    panel = scene.description.objects[k]
    assert panel.emission == (3.0, 3.0, 3.0) and panel.emission_texture.texture == "four.png" and not scene.unshown
    # The image begins, at its upper left, at (+X, +Y) [UsdLux, RectLight]: there the lamp has (u, v) = (0, 1).
    start, stop = scene.triangle_ranges[k]
    corners = (scene.vertices[scene.triangles[start:stop]] + scene.origin).reshape(-1, 3)
    assert scene.uvs is not None
    uvs = scene.uvs[start:stop].reshape(-1, scene.uvs.shape[2])[:, :2]
    assert np.allclose(uvs, np.stack([0.5 - corners[:, 0], 0.5 + corners[:, 1]], axis=1))
    cone = "float inputs:shaping:cone:angle = 30"
    spot = lit(tmp_path, f'def RectLight "L" (prepend apiSchemas = ["ShapingAPI"]) {{ {image}\n {cone}\n}}')
    assert unshown(spot) == {"RectLight.inputs:texture:file": 1} and spot.lamps[0].texture == ""


def test_lamps_become_objects_and_suns_part_of_the_sky(tmp_path: Path) -> None:
    body = f"""{CARD}
    def RectLight "Panel" {{ float inputs:intensity = 4\n{place(0, 3, 0)}}}
    def SphereLight "Dark" {{ float inputs:intensity = 0\n}}
    def DistantLight "Sun" {{ float inputs:angle = 0\n}}
    """
    scene = load_scene(write(tmp_path / "a.usda", body), (8, 8))
    panel = next(each for each in scene.description.objects if each.name == "Panel")
    assert panel.is_lamp and panel.primitive == "quad" and panel.emission == (4.0, 4.0, 4.0)
    assert "Dark" not in scene.object_names
    assert scene.description.environment is not None
    (sun,) = scene.description.environment.suns
    assert sun.irradiance == (50_000.0,) * 3 and sun.diameter == pytest.approx(0.1)  # the least that there is


def test_a_dome_is_the_environment(tmp_path: Path) -> None:
    (tmp_path / "skies").mkdir()
    write_exr(tmp_path / "skies" / "sky.exr", np.ones((4, 8, 3), np.float32))
    turned = 'float xformOp:rotateY = 90\n uniform token[] xformOpOrder = ["xformOp:rotateY"]'
    sky = "asset inputs:texture:file = @skies/sky.exr@\n float inputs:intensity = 2"
    body = f'{CARD}\ndef DomeLight "D" {{ {sky}\n{turned}\n}}'
    model = read(tmp_path, body)
    assert model.dome is not None and model.dome.file == "skies/sky.exr" and not model.unshown
    # The image's centre is at +Z, by the quarter turn at +X; here it is at -Z for a rotation of 0, at +X for -90.
    assert model.dome.rotation == pytest.approx(-90.0)
    scene = load_scene(tmp_path / "a.usda", (8, 8))
    environment = scene.description.environment
    assert environment is not None and (environment.file, environment.scale) == ("skies/sky.exr", 2.0)
    assert scene.environment_path == tmp_path / "skies" / "sky.exr"


def test_a_dome_without_image_has_one_radiance(tmp_path: Path) -> None:
    body = f'{CARD}\ndef DomeLight "D" {{ color3f inputs:color = (1, 0.5, 0.25)\n}}'
    scene = load_scene(write(tmp_path / "a.usda", body), (8, 8))
    assert scene.description.environment is not None and scene.environment_path is None
    assert scene.description.environment.radiance == (1.0, 0.5, 0.25)


@pytest.mark.parametrize(
    ("light", "name"),
    [
        ('CylinderLight "L" { }', "CylinderLight"), ('GeometryLight "L" { }', "GeometryLight"),
        ('DomeLight "L" { asset inputs:texture:file = @../sky.exr@ }', "DomeLight.inputs:texture:file"),
        ('RectLight "L" { asset inputs:texture:file = @a.png@ }', "RectLight.inputs:texture:file"),
        ('SphereLight "L" { float inputs:specular = 0 }', "SphereLight.inputs:specular"),
        ('SphereLight "L" { float inputs:radius = 0 }', "SphereLight.intensity"),
        ('SphereLight "L" { float inputs:intensity = 1e30 }', "SphereLight.intensity"),
        ('SphereLight "L" { bool inputs:shadow:enable = 0 }', "SphereLight.inputs:shadow:enable"),
    ],
)  # fmt: skip
def test_what_lights_do_not_show_is_listed(tmp_path: Path, light: str, name: str) -> None:
    assert unshown(lit(tmp_path, f"def {light}")) == {name: 1}


def test_cameras_are_views_of_the_file(tmp_path: Path) -> None:
    text = f"""def Camera "Front" {{
        float focalLength = 24
        float verticalAperture = 24
        float horizontalAperture = 36
        float fStop = 2.8
        {place(0, 0, 7)}
    }}"""
    model = lit(tmp_path, text)
    (found,) = model.cameras
    assert found.name == "Front" and found.aspect == pytest.approx(1.5)
    assert found.camera.fov_y == pytest.approx(math.degrees(2.0 * math.atan(0.5)))
    assert found.camera.position == (0.0, 0.0, 7.0) and found.camera.target == (0.0, 0.0, 0.0)
    assert unshown(model) == {"Camera.fStop": 1}


def test_orthographic_cameras_show_the_same_height_from_afar(tmp_path: Path) -> None:
    lens = 'token projection = "orthographic"\n float verticalAperture = 40'
    model = lit(tmp_path, f'def Camera "Front" {{ {lens}\n{place(0, 0, 7)}}}')
    (found,) = model.cameras
    distance = float(np.linalg.norm(np.subtract(found.camera.position, found.camera.target)))
    # Apertures are in tenths of a unit: 40 are 4 m.
    assert 2.0 * distance * math.tan(math.radians(found.camera.fov_y / 2.0)) == pytest.approx(4.0)
    assert unshown(model) == {"Camera.projection": 1}


@pytest.mark.parametrize("light", ["DistantLight", "RectLight", "DiskLight"])
def test_lights_under_a_flat_transform_are_not_lit(tmp_path: Path, light: str) -> None:
    flat = f"""def Xform "X" {{ float3 xformOp:scale = (1, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:scale"]
        def {light} "L" {{ float inputs:intensity = 3
        }}
    }}"""
    scene = load_scene(write(tmp_path / "a.usda", f"{CARD}\n{flat}"))
    assert not any(each.emits for each in scene.description.objects)
    (listed,) = [each for each in scene.unshown if each.name == f"{light}.intensity"]
    assert "a light that is not lit" in listed.effect and "a flat transform" in listed.effect
