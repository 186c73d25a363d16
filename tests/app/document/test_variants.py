"""Variants: materials that a scene's file gives several objects together, chosen by name, undone and saved as edits."""

from pathlib import Path

import pytest

from app.cli.options import assignments
from app.document.commands.layers import SetFrozen, SetParameter, SetVariant
from app.document.described import AS_IN_THE_FILE, document_from_description
from app.document.document import Document
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.project.assignments import set_path
from app.project.project import open_project
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError, LoadError
from engine.material.measured import measurement_of
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE
from tests.naive.tensor_files import Gloss, acquired, tensor_bytes
from tests.scene_text import camera, material, placed

RED, GREEN, GOLD = ({"model": "lambert", "albedo": each} for each in ([1, 0, 0], [0, 1, 0], [1, 0.8, 0]))


@pytest.fixture
def document() -> Document:
    tree = {**SCENE, "object": [dict(each) for each in SCENE["object"]]}
    pot, floor = (next(each for each in tree["object"] if each["name"] == name) for name in ("pot", "floor"))
    pot["layer"] = [RED]
    pot["variant"] = [{"name": "poppy", "layer": [RED]}, {"name": "fir", "layer": [GREEN]}]
    floor["variant"] = [{"name": "fir", "layer": [GOLD]}]
    return document_from_description("shelf", parse_description(tree, "shelf"))


def albedo(document: Document, name: str) -> object:
    return document.layer(f"{name}.0").values["albedo"]


def test_a_variant_is_of_all_objects_that_have_it(document: Document) -> None:
    assert document.variants == ("poppy", "fir") and document.variant == "poppy"
    fir = SetVariant("fir").apply(document)
    assert albedo(fir, "pot") == (0.0, 1.0, 0.0) and albedo(fir, "floor") == (1.0, 0.8, 0.0)
    assert fir.variant == "fir" and SetVariant("fir").apply(fir) == fir
    # The floor has no poppy, so it keeps what it has; that is no one's variant any more once the pot is edited.
    poppy = SetVariant("poppy").apply(fir)
    assert albedo(poppy, "pot") == (1.0, 0.0, 0.0) and albedo(poppy, "floor") == (1.0, 0.8, 0.0)
    assert SetParameter("pot.0", "albedo", 0.3).apply(fir).variant == ""


def test_what_a_file_shows_unasked_can_be_chosen_again() -> None:
    """It need be none of the file's variants; the window would call it edited, and have no way back."""
    tree = {**SCENE, "object": [dict(each) for each in SCENE["object"]]}
    pot = next(each for each in tree["object"] if each["name"] == "pot")
    pot |= {"layer": [GOLD], "variant": [{"name": "fir", "layer": [GREEN], "emission": [0, 1, 0]}]}
    own = document_from_description("shelf", parse_description(tree, "shelf"))
    assert own.variants == (AS_IN_THE_FILE, "fir") and own.variant == AS_IN_THE_FILE
    fir = SetVariant("fir").apply(own)
    assert fir.variant == "fir" and SetVariant(AS_IN_THE_FILE).apply(fir) == own
    assert SetParameter("pot.0", "albedo", 0.3).apply(own).variant == ""


def test_a_variant_brings_bumps_opacity_and_emission() -> None:
    tree = {**SCENE, "object": [dict(each) for each in SCENE["object"]]}
    pot = next(each for each in tree["object"] if each["name"] == "pot")
    pot["variant"] = [
        {"name": "day", "layer": [RED], "emission": 0, "opacity": {}},
        {"name": "night", "layer": [RED], "emission": [0, 1, 0], "opacity": {"mode": "blend", "factor": 0.5},
         "normal_map": {"file": "n.png"}},
    ]  # fmt: skip
    before = document_from_description("shelf", parse_description(tree, "shelf"))
    assert before.object("pot").emission == (0.0, 0.0, 0.0)
    night = SetVariant("night").apply(before)
    state = night.object("pot")
    assert (state.emission, state.opacity.opacity_factor, state.bumps.normal_map) == ((0.0, 1.0, 0.0), 0.5, "n.png")
    assert night.variant == "night"
    # The day has no bumps of its own: the pot keeps those of the night.
    day = SetVariant("day").apply(night).object("pot")
    assert day.emission == (0.0, 0.0, 0.0) and day.new_opacity is None and day.bumps == state.bumps


def test_paths_name_it_and_errors_list_what_there_is(document: Document) -> None:
    assert set_path(document, "variant", "fir") == SetVariant("fir")
    with pytest.raises(LoadError, match="variant: value = 3, expected the name of a variant"):
        set_path(document, "variant", 3)
    with pytest.raises(InsituError, match="no variant 'oak'; available: poppy, fir"):
        SetVariant("oak").apply(document)
    with pytest.raises(InsituError, match="pot is frozen"):
        SetVariant("fir").apply(SetFrozen("pot", True).apply(document))


def test_a_session_keeps_the_materials_and_the_scene_the_variants(document: Document, tmp_path: Path) -> None:
    fir = SetVariant("fir").apply(document)
    session = load_session(save_session(tmp_path / "mine", fir, ViewState()))
    assert fit_session(session, document, "mine") == fir


def test_the_command_line_chooses_it_before_what_else_is_set(tmp_path: Path) -> None:
    layer = (
        material('model = "lambert"') + 'variant = [{ name = "fir", layer = [{ model = "lambert", albedo = 0.3 }] }]\n'
    )
    scene = tmp_path / "scene.toml"
    scene.write_text(camera((0, 0, 3), 40, (8, 6)) + placed("pot", "sphere", more=layer))
    project = open_project(str(scene), (8, 6), assignments(["pot.0.albedo=0.6"], variant="fir"))
    assert albedo(project.document, "pot") == (0.6,) * 3
    assert albedo(open_project(str(scene), (8, 6), assignments(None, variant="fir")).document, "pot") == (0.3,) * 3


def test_the_measured_layers_of_a_variant_are_read(tmp_path: Path) -> None:
    gloss = acquired(Gloss(0.3, 0.3), n_theta=4, n=8, n_facets=12)
    (tmp_path / "gloss.bsdf").write_bytes(tensor_bytes(gloss))
    measured = '{ model = "measured", file = "gloss.bsdf" }'
    layer = material('model = "lambert"') + f'variant = [{{ name = "shiny", layer = [{measured}] }}]\n'
    scene = tmp_path / "scene.toml"
    scene.write_text(camera((0, 0, 3), 40, (8, 6)) + placed("pot", "sphere", more=layer))
    project = open_project(str(scene), (8, 6), assignments(None, variant="shiny"))
    assert measurement_of(project.document.layer("pot.0").values).is_read and project.document.variant == "shiny"
    editor = Editor(InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache"))), str(scene))
    while not editor.scene_is_open:
        editor.tick()
    editor.do(SetVariant("shiny"))
    assert editor.document.layer("pot.0") == project.document.layer("pot.0")


def test_names_of_one_object_differ() -> None:
    tree = {**SCENE, "object": [dict(each) for each in SCENE["object"]]}
    tree["object"][0]["variant"] = [{"name": "fir", "layer": [RED]}, {"name": "fir", "layer": [GREEN]}]
    with pytest.raises(LoadError, match="variant"):
        parse_description(tree, "shelf")
