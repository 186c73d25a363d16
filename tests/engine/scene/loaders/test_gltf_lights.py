"""Lights of glTF files: their units, places and cones, by files that the tests write."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands.light import SetEmission
from app.document.view_state import ViewState
from app.files.session import save_session
from app.project.project import open_project
from engine.scene.description import MAX_RADIANCE, MAX_SUNS, ObjectDescription
from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.gltf_lights import CONVERTED, LUMENS_PER_WATT, MOST_LIGHTS
from engine.scene.loaders.model import ImportedModel
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import pack_glb

PLACES = np.array([[-1, 0, 0], [1, 0, 0], [0, 2, 0]], "<f4").tobytes()


def write(path: Path, lights: list[dict[str, Any]], nodes: list[dict[str, Any]]) -> Path:
    path.write_bytes(lights_glb(lights, nodes))
    return path


def lights_glb(lights: list[dict[str, Any]], nodes: list[dict[str, Any]]) -> bytes:
    """A triangle and nodes, each of which has the light of its number."""
    lit = [node | {"extensions": {"KHR_lights_punctual": {"light": i}}} for i, node in enumerate(nodes)]
    tree = {
        "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": lights}},
        "scenes": [{"nodes": [0, *(k + 1 for k, node in enumerate(nodes) if not node.get("name") == "below")]}],
        "nodes": [{"mesh": 0}, *lit], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36}],
    }  # fmt: skip
    return pack_glb(tree, PLACES)


def unshown(model: ImportedModel) -> dict[str, int]:
    return {each.name: each.count for each in model.unshown}


def test_lights_are_read_in_watts(tmp_path: Path) -> None:
    lights = [
        {"type": "point", "intensity": 683.0, "color": [1, 0.5, 0], "name": "a.bulb", "range": 3.0},
        {"type": "directional", "intensity": 1366.0},
        {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
    ]
    half = math.sqrt(0.5)
    nodes = [
        {"translation": [1, 2, 3], "scale": [5, 5, 5]},
        {"rotation": [-half, 0, 0, half], "name": "Noon"},  # −Z turned down
        {"rotation": [0, half, 0, half], "children": [], "scale": [2, 2, 2]},
    ]
    model = read_gltf(write(tmp_path / "a.glb", lights, nodes))
    bulb, noon, spot = model.lights
    # Candela and lux over 683 lm/W; a node's scale changes neither.
    assert (bulb.name, bulb.kind, bulb.intensity, bulb.position) == ("a_bulb", "point", (1.0, 0.5, 0.0), (1, 2, 3))
    assert (noon.name, noon.kind, noon.intensity) == ("Noon", "directional", (2.0, 2.0, 2.0))
    np.testing.assert_allclose(noon.direction, (0, -1, 0), atol=1e-12)
    assert (spot.name, spot.kind, spot.inner, spot.outer) == ("Light 3", "spot", 0.2, 0.5)
    assert spot.intensity == pytest.approx([1.0 / LUMENS_PER_WATT] * 3)  # 1 cd where it is not said
    np.testing.assert_allclose(spot.direction, (-1, 0, 0), atol=1e-12)
    assert model.notes == (CONVERTED,)
    assert unshown(model) == {"KHR_lights_punctual.lights.range": 1}


def test_lights_stand_under_their_parents(tmp_path: Path) -> None:
    nodes = [
        {"translation": [0, 1, 0], "scale": [2, 2, 2], "children": [2]},
        {"translation": [1, 0, 0], "name": "below"},
    ]
    model = read_gltf(write(tmp_path / "a.glb", [{"type": "point", "intensity": 0}, {"type": "point"}], nodes))
    # The first has no light at all.
    assert [light.position for light in model.lights] == [(2, 1, 0)]


@pytest.mark.parametrize(
    ("light", "reason"),
    [
        ({"type": "area"}, "type = area, expected point, spot or directional"),
        ({}, "type = nothing"),
        ({"type": "point", "intensity": -1}, "intensity, color"),
    ],
)
def test_lights_that_are_none_are_listed(tmp_path: Path, light: dict[str, Any], reason: str) -> None:
    model = read_gltf(write(tmp_path / "a.glb", [light, {"type": "point"}], [{}, {}]))
    assert len(model.lights) == 1
    (listed,) = [each for each in model.unshown if each.name == "nodes.KHR_lights_punctual.light"]
    assert listed.effect.startswith("a lamp that is not lit: ") and reason in listed.effect


def test_numbers_of_a_light_that_are_none_count_as_not_given(tmp_path: Path) -> None:
    light = {"type": "spot", "intensity": "bright", "color": [1, 1], "spot": 3}
    model = read_gltf(write(tmp_path / "a.glb", [light], [{}]))
    assert model.lights[0].intensity == pytest.approx((1.0 / 683.0,) * 3)
    listed = [each.name for each in model.unshown if each.effect.startswith("as if it were not there")]
    names = [f"KHR_lights_punctual.lights.{key}" for key in ("color", "intensity", "spot")]
    assert sorted(listed) == names


def test_cones_are_clamped_and_lights_limited(tmp_path: Path) -> None:
    wide = {"type": "spot", "spot": {"innerConeAngle": 2.0, "outerConeAngle": 1.8}}
    model = read_gltf(write(tmp_path / "a.glb", [wide] * (MOST_LIGHTS + 2), [{}] * (MOST_LIGHTS + 2)))
    assert len(model.lights) == MOST_LIGHTS and unshown(model)["nodes.KHR_lights_punctual.light"] == 2
    assert model.lights[0].inner == model.lights[0].outer == pytest.approx(math.pi / 2.0)


def test_a_lamp_that_an_animation_moves_is_listed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.glb", [{"type": "point"}] * 2, [{"children": [2]}, {"name": "below"}])
    # An animation of nothing but a target: the node of the first light, above that of the second.
    data = path.read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    tree["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR"})
    channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    tree["animations"] = [{"channels": [channel], "samplers": [{"input": 1, "output": 0}]}]
    path.write_bytes(pack_glb(tree, np.array([0, 1, 2, 3, 4, 5, 6, 7, 8], "<f4").tobytes()))
    effects = [each for each in read_gltf(path).unshown if each.name == "nodes.KHR_lights_punctual.light"]
    assert [(each.count, each.effect) for each in effects] == [(2, "the lamp does not move in the animation")]


def test_many_lamps_of_one_name_have_names_that_a_scene_accepts(tmp_path: Path) -> None:
    lamp = {"type": "point", "intensity": 683.0, "name": "A lamp of the street that leads to the harbour, by night"}
    nodes = [{"translation": [k, 3, 0]} for k in range(40)]
    names = load_scene(write(tmp_path / "a.glb", [lamp] * 40, nodes)).object_names
    assert len(set(names)) == len(names) == 42
    assert all(ObjectDescription(name=name, primitive="quad") for name in names)  # raises for one that is too long


def test_suns_are_limited_in_number_and_strength(tmp_path: Path) -> None:
    light = {"type": "directional", "intensity": 1e12, "color": [1e6, 1.0, 0.0]}
    scene = load_scene(write(tmp_path / "a.glb", [light] * (MAX_SUNS + 3), [{}] * (MAX_SUNS + 3)))
    assert scene.description.environment is not None
    suns = scene.description.environment.suns
    assert len(suns) == MAX_SUNS and f"3 suns after the first {MAX_SUNS} are left out" in scene.notes
    assert suns[0].irradiance == (MAX_RADIANCE, pytest.approx(1e12 / LUMENS_PER_WATT), 0.0)


def test_edits_of_lamps_are_saved_by_name(tmp_path: Path) -> None:
    file = write(
        tmp_path / "a.glb", [{"type": "point", "name": "Bulb", "intensity": 100.0}], [{"translation": [0, 3, 1]}]
    )
    project = open_project(str(file))
    assert [state.name for state in project.document.objects if state.is_lamp] == ["Bulb"]
    edited = SetEmission("Bulb", (1.0, 2.0, 3.0)).apply(project.document)
    session = save_session(tmp_path / "work.insitu", edited, ViewState())
    assert open_project(str(session)).document.object("Bulb").emission == (1.0, 2.0, 3.0)
