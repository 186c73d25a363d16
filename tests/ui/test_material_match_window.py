"""Matching a material by hand: from the library's menu and the Material panel, its progress, errors, and stopping."""

from __future__ import annotations

import pytest

from app.document.material_match import MaterialAnswer, MaterialMatchErrors
from app.editor.material_matching import MaterialMatching
from engine.material import MODELS, make_layer
from tests.app.editor.test_material_matching import Matcher
from ui.headless import HeadlessWindow


@pytest.fixture
def shelf(window: HeadlessWindow) -> HeadlessWindow:
    """A window whose library has been read, with the teapot selected."""
    window.frames(60)
    window.shell.editor.select("teapot")
    window.frames(2)
    return window


@pytest.fixture
def matcher(shelf: HeadlessWindow) -> Matcher:
    made = Matcher("matching teapot 0% opening the scene")
    shelf.shell.editor.material_matching = MaterialMatching(shelf.shell.editor, made)
    return made


def choose_model(window: HeadlessWindow, name: str) -> None:
    window.frames(2)
    window.click_handle(name)
    window.frames(2)


def open_library_menu(window: HeadlessWindow, material: str) -> None:
    """The submenu of models in a material's menu."""
    window.click_handle("library.search")
    window.type(material)
    window.frames(2)
    window.click(*window.shell.handle_position(f"library.{material}"), button=1)
    window.frames(2)
    window.click_handle(f"library.match_material.{material}")


def test_a_material_of_the_library_is_matched_and_its_errors_are_said(shelf: HeadlessWindow, matcher: Matcher) -> None:
    editor = shelf.shell.editor
    before = editor.document
    open_library_menu(shelf, "Terracotta")
    choose_model(shelf, "library.match_material.Terracotta.lambert")
    assert matcher.settings is not None and matcher.settings.title == "Terracotta"
    assert editor.status.material_match and "button.match_material.stop" in shelf.shell.handles.names()
    layer = make_layer(MODELS["lambert"], {"albedo": (0.5, 0.25, 0.125)})
    matcher.end(MaterialAnswer(layer, MaterialMatchErrors(0.5, 0.0125, 0.034)))
    shelf.frames(3)
    assert editor.document.object("teapot").layers == (layer,)
    words = "Diffuse, as Terracotta: error 1.2 % of the BRDF, 3.4 % in the picture"
    assert editor.status.material_match_note[1] == words
    assert "material.match_material.result" in shelf.shell.handles.names()
    assert "button.match_material.stop" not in shelf.shell.handles.names()
    assert editor.undo() == "Diffuse, as Terracotta on teapot" and editor.document == before
    shelf.frames(3)
    assert "material.match_material.result" not in shelf.shell.handles.names()


def test_the_objects_own_material_is_matched_and_the_cross_stops_it(shelf: HeadlessWindow, matcher: Matcher) -> None:
    editor = shelf.shell.editor
    before = editor.document
    shelf.click_handle("button.material.match_material")
    choose_model(shelf, "material.match_material.ward")
    assert matcher.settings is not None and matcher.settings.layers == before.object("teapot").layers
    shelf.click_handle("button.match_material.stop")
    shelf.frames(3)
    assert matcher.settings is None and not editor.material_matching.progress and editor.document is before
    assert editor.status.message == "stopped matching"


def test_progress_is_news_to_a_window_that_rests(shelf: HeadlessWindow, matcher: Matcher) -> None:
    shelf.click_handle("button.material.match_material")
    choose_model(shelf, "material.match_material.ward")
    for words in ("matching teapot 25% fitting curves", "matching teapot 70% drawing both in place"):
        shelf.frames(60)
        assert not shelf.poll(telling=True)
        matcher.words = words
        # As often as text is drawn anew while nothing else changes.
        assert any(shelf.poll(telling=True) for _ in range(60))
