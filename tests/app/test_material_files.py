"""Materials of MaterialX files on objects: one undo step, by name, on the command line and in the window."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import SetFrozen, SetMaterial, SetVariant
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.material_files import import_material, read_file_materials, split_material
from app.files.session import load_session, save_session
from app.messages.file_messages import MaterialsRead, ReadMaterials
from app.project.project import open_project
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError, LoadError
from tests.app.fake_worker import FakeClient
from tests.engine.scene.loaders.mtlx_samples import document, given, image, linked, node, surface, write_png

pytest.importorskip("MaterialX")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Oak, with an image and relief, and brass."""
    write_png(tmp_path / "oak.png", np.full((2, 2, 3), 0.5))
    nodes = image("i", "color3", "oak.png", space="srgb_texture") + image("j", "vector3", "oak.png")
    nodes += node("normalmap", "vector3", "n", linked("in", "vector3", "j"))
    oak = linked("base_color", "color3", "i") + linked("geometry_normal", "vector3", "n")
    oak += given("transmission_weight", "float", "0.5") + given("geometry_opacity", "float", "0.5")
    body = nodes + surface("open_pbr_surface", oak, "oak")
    body += surface("open_pbr_surface", given("base_metalness", "float", "1"), "brass")
    path = tmp_path / "wood.mtlx"
    path.write_text(document(body), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("wood.mtlx", ("wood.mtlx", "")), ("a#b/WOOD.MTLX#dark oak #2", ("a#b/WOOD.MTLX", "dark oak #2")),
        ("wood.mtlx#", ("wood.mtlx", "")), ("gold", ("gold", "")),
    ],
)  # fmt: skip
def test_a_material_is_named_by_its_file(name: str, parts: tuple[str, str]) -> None:
    assert split_material(name) == parts


def test_a_material_of_a_file_is_one_step_and_its_others_are_variants(client: FakeClient, file: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.select("pot")
    before = editor.document
    assert editor.exchange.import_material(str(file)) is None and editor.document == before
    (asked,) = client.sent(ReadMaterials)
    found = read_file_materials(Path(asked.file), asked.name)
    client.answer(asked, MaterialsRead(found.materials, found.chosen, notes=found.notes))
    editor.tick(0.1)
    pot = editor.document.object("pot")
    assert [layer.name for layer in pot.layers] == ["base", "gloss"]
    assert pot.layers[0].maps.texture == str(file.parent / "oak.png") == pot.bumps.normal_map
    assert pot.opacity.opacity_factor == 0.5
    assert "oak of 2 materials" in editor.status.message and "not shown" in editor.status.message
    editor.do(SetVariant("brass"))
    assert [layer.name for layer in editor.document.object("pot").layers] == ["metal"]
    assert not editor.document.object("pot").bumps.file
    editor.undo()
    editor.undo()
    assert editor.document == before


def test_a_material_waits_in_vain_for_a_frozen_object_and_without_one(client: FakeClient, file: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.select(None)
    assert "select the object" in str(editor.exchange.import_material(str(file)))
    editor.select("pot")
    editor.do(SetFrozen("pot", True))
    assert "frozen" in str(editor.exchange.import_material(str(file))) and not client.sent(ReadMaterials)


def test_the_worker_reads_a_material_and_plans_it(file: Path) -> None:
    *_, answer = RequestDispatcher().handle(ReadMaterials(str(file), "brass"))
    assert isinstance(answer, MaterialsRead) and answer.chosen.name == "brass"
    assert [each.name for each in answer.materials] == ["oak", "brass"]
    assert [sorted(bands) for bands in answer.planned] == [["theta_d", "theta_h"]]
    with pytest.raises(LoadError, match="material = birch, expected oak or brass"):
        list(RequestDispatcher().handle(ReadMaterials(str(file), "birch")))


def test_the_command_line_sets_a_material_of_a_file(file: Path) -> None:
    scene = file.parent / "scene.toml"
    scene.write_text(
        "version = 1\n[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\nresolution = [4, 4]\n"
        '[environment]\nradiance = 1.0\n[[object]]\nname = "ball"\nprimitive = "sphere"\n'
        'layer = [{ model = "lambert" }]\n'
    )
    project = open_project(str(scene), values=[("ball.material", f"{file}#oak")])
    ball = project.document.object("ball")
    # Images in the scene's folder are named from there, so that it can move.
    assert ball.layers[0].maps.texture == "oak.png" == ball.bumps.normal_map
    with pytest.raises(InsituError, match="there is no such file|No such file"):
        open_project(str(scene), values=[("ball.material", str(file.parent / "birch.mtlx"))])


def test_a_session_keeps_computed_maps_by_their_numbers(file: Path) -> None:
    write_png(file.parent / "share.png", np.array([[0.0, 1.0], [0.25, 0.5]]))
    nodes = image("i", "float", "share.png")
    metal = linked("base_metalness", "float", "i") + linked("specular_roughness", "float", "i")
    file.write_text(document(nodes + surface("open_pbr_surface", metal, "patchy")), encoding="utf-8")
    project = open_project("teatray", (4, 4), values=[("teapot.material", str(file))])
    layers = project.document.object("teapot").layers
    assert layers[0].maps.texture == f"{file}#0"
    saved = save_session(file.parent / "a.insitu", project.document, ViewState())
    assert load_session(saved).document.object("teapot").layers == layers


def test_an_edit_that_waits_for_its_file_cannot_be_carried_out(client: FakeClient, file: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    command = import_material("pot", str(file))
    assert isinstance(command, SetMaterial) and command.file == str(file)
    with pytest.raises(InsituError, match="has no layers"):
        command.apply(editor.document)
