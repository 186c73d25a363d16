"""Images of a layer and surfaces of an object as edits: by path, with undo, and in sessions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.document.commands import SetSurface
from app.document.commands.layers import AddLayers, SetFresnelTerm, SetMaterial
from app.document.commands.maps import SetMap
from app.document.described import document_from_description
from app.document.document import Document
from app.document.named_files import image_name, scene_folder, with_full_names
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.project.assignments import set_path
from engine.core.errors import InsituError
from engine.material.layer_maps import LayerMaps
from engine.scene.description import SceneDescription
from engine.scene.surface_kinds import NO_SURFACE, SURFACES, DeformSurface
from tests.ui.stand_in import SCENE

SET = {
    "texture": "wood/oak.png", "texture_space": "linear", "texture_scale": [2, 0.1 + 0.2], "texture_strength": 1 / 3,
    "weight": "/elsewhere/mask.exr", "weight_invert": True, "texture_offset": [0.25, -1], "texture_rotation": 1 / 3,
    "texture_wrap": ["clamp", "mirror"],
}  # fmt: skip
MAPS = LayerMaps(
    "wood/oak.png", "linear", (2.0, 0.1 + 0.2), 1 / 3, "/elsewhere/mask.exr", True,
    texture_offset=(0.25, -1.0), texture_rotation=1 / 3, texture_wrap=("clamp", "mirror"),
)  # fmt: skip


@pytest.fixture
def mapped(document: Document) -> Document:
    for name, value in SET.items():
        document = set_path(document, f"pot.1.{name}", value).apply(document)
    return document


def test_every_part_is_set_by_its_path(mapped: Document, document: Document) -> None:
    assert mapped.layer("pot.1").maps == MAPS and mapped.layer("pot.0").maps.is_plain
    assert mapped.object("floor") is document.object("floor")
    assert SetMap("pot.1", "texture", "").apply(mapped).layer("pot.1").maps.images.weight == MAPS.weight


def test_a_session_brings_maps_back_equal(mapped: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "mine.insitu", mapped, ViewState())
    assert load_session(path).document == mapped
    assert path.read_text().count("maps = {") == 1  # of layers without, nothing is said


def test_values_out_of_range_are_refused(document: Document) -> None:
    refused = (
        ("texture_scale", 0), ("texture_strength", 1.5), ("weight", 3), ("texture_space", "gamma"),
        ("texture_offset", [1e9, 0]), ("texture_offset", 1), ("texture_rotation", float("nan")),
        ("texture_wrap", "border"), ("texture_wrap", ["clamp"]),
    )  # fmt: skip
    for name, value in refused:
        with pytest.raises(InsituError, match=f"{name} = "):
            set_path(document, f"pot.1.{name}", value).apply(document)


def test_a_fresnel_term_has_the_maps_of_its_layer(mapped: Document, tmp_path: Path) -> None:
    two = SetFresnelTerm("pot.1", True).apply(mapped)
    term = next(key for key, layer in two.layers() if layer.rises)
    assert two.layer(term).maps == MAPS
    plain = SetMap(term, "texture", "").apply(two)  # edited in the term, both have it
    assert plain.layer("pot.1").maps == plain.layer(term).maps != MAPS
    path = save_session(tmp_path / "mine.insitu", two, ViewState())
    assert load_session(path).document == two


def test_files_in_the_scenes_folder_are_named_from_there(tmp_path: Path) -> None:
    scene = tmp_path / "scene" / "scene.toml"
    assert image_name(scene.parent / "maps" / "a.png", str(scene)) == "maps/a.png"
    assert image_name(tmp_path / "b.png", str(scene)) == str((tmp_path / "b.png").resolve())
    assert scene_folder("teatray").name == "teatray"


def test_a_material_that_is_taken_elsewhere_finds_its_images(mapped: Document, tmp_path: Path) -> None:
    home, away = (replace(mapped, source=str(tmp_path / name / "scene.toml")) for name in ("home", "away"))
    glb = mapped.layer("pot.0").replace(maps=LayerMaps("cups/cup.glb#2"))
    taken = with_full_names((glb, mapped.layer("pot.1")), home.source)
    folder = (tmp_path / "home").resolve()
    assert [layer.maps.texture for layer in taken] == [f"{folder}/cups/cup.glb#2", f"{folder}/wood/oak.png"]
    there = SetMaterial("pot", taken).apply(away)
    assert [layer.maps for layer in there.object("pot").layers] == [layer.maps for layer in taken]
    back = AddLayers("floor", taken).apply(home)  # where they come from they have the scene's names again
    assert [layer.maps for layer in back.object("floor").layers[-2:]] == [glb.maps, MAPS]


@pytest.fixture
def scene() -> Document:
    return document_from_description("stand-in", SceneDescription.model_validate(SCENE))


def having(document: Document, *said: tuple[str, Any]) -> DeformSurface:
    """The teapot's surface after these."""
    for path, value in said:
        document = set_path(document, f"teapot.{path}", value).apply(document)
    return document.object("teapot").surface


@pytest.mark.parametrize("kind", SURFACES)
def test_an_object_becomes_of_a_kind_and_back(scene: Document, kind: str) -> None:
    surface = having(scene, ("surface", kind))
    assert surface.kind == kind
    assert set(SURFACES[kind].defaults) <= set(surface.values)
    assert having(scene, ("surface", kind), ("surface", "none")) == NO_SURFACE


def test_a_value_makes_it_of_its_kind_and_leaves_the_others(scene: Document) -> None:
    found = having(scene, ("subsurface.scattering", 900.0), ("subsurface.ior", 1.5))
    assert found.values == {"scattering": 900.0, "absorption": 0.5, "ior": 1.5}
    found = having(scene, ("patch.kind", "swirl"), ("patch.repeats", 3))
    assert found.values.items() >= {"kind": "swirl", "file": None, "repeats": (3.0, 3.0), "height": 1.0}.items()
    assert found.values["thickness"] == 0.0  # opaque
    found = having(scene, ("patch.kind", "swirl"), ("patch.file", "heights.png"))
    assert (found.values["kind"], found.values["file"]) == (None, "heights.png")


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("teapot.surface", "fur", "none, membrane"),
        ("teapot.membrane", 0.5, "membrane.translucency"),
        (
            "teapot.membrane.translucency",
            2.0,
            "teapot: membrane: translucency = 2.0, expected a number from 0 to 1, or",
        ),
        ("teapot.membrane.thickness", 2.0, "thickness = 2.0, expected less than or equal to 1"),
        ("teapot.membrane.weight", 2.0, "translucency"),
        ("teapot.subsurface.ior", "glass", "ior"),
        ("teapot.patch.repeats", [1, 0], "repeats"),
        ("teapot.patch.kind", "knit", "'bumps'"),
        ("lamp.membrane.translucency", 0.5, "is an emitter"),
    ],
)
def test_what_makes_no_sense_is_one_line(scene: Document, path: str, value: Any, said: str) -> None:
    with pytest.raises(InsituError, match=said) as error:
        set_path(scene, path, value).apply(scene)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", ["", *SURFACES])
def test_a_session_keeps_it(scene: Document, kind: str, tmp_path: Path) -> None:
    owned = scene.with_object(SetSurface("tray", "wrinkles").apply(scene).object("tray"))
    tray = owned.object("tray")
    scene = scene.with_object(type(tray)(**{**vars(tray), "own_surface": tray.surface, "new_surface": None}))
    edited = SetSurface("tray", kind).apply(scene)
    path = save_session(tmp_path / "kept.insitu", edited, ViewState())
    again = fit_session(load_session(path), scene, str(path))
    assert again.object("tray").surface == edited.object("tray").surface
    assert [name for name, _ in again.new_surfaces] == ([] if kind == "wrinkles" else ["tray"])
