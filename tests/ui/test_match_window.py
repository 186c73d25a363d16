"""Matching a material by hand: from the library's menu and the Material panel, its progress, errors, and stopping."""

from __future__ import annotations

import pytest

from app.messages.match_messages import MatchErrors, MatchMaterial, MaterialMatched
from engine.material import MODELS, make_layer
from ui.headless import HeadlessWindow


@pytest.fixture
def shelf(window: HeadlessWindow) -> HeadlessWindow:
    """A window whose library has been read, with the teapot selected."""
    window.frames(60)
    window.shell.editor.select("teapot")
    window.frames(2)
    return window


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
    window.click_handle(f"library.match.{material}")


def test_a_material_of_the_library_is_matched_and_its_errors_are_said(shelf: HeadlessWindow) -> None:
    editor = shelf.shell.editor
    before = editor.document
    open_library_menu(shelf, "Terracotta")
    choose_model(shelf, "library.match.Terracotta.lambert")
    assert editor.matching.is_under_way and editor.status.matching.startswith("matching Terracotta")
    assert editor.matching._sent is not None
    found = make_layer(MODELS["lambert"], {"albedo": (0.5, 0.25, 0.125)})
    answer = MaterialMatched(found, MatchErrors(0.5, 0.0125, 0.034), {"theta_i": 8}, id=editor.matching._sent[0])
    editor.matching.receive(answer, False)
    shelf.frames(3)
    assert editor.document.object("teapot").layers == (found,)
    assert editor.status.match_note[1] == "Diffuse, as Terracotta: error 1.2 % of the BRDF, 3.4 % in the picture"
    assert "material.match.result" in shelf.shell.handles.names()
    assert editor.undo() == "Diffuse, as Terracotta on teapot" and editor.document == before
    shelf.frames(3)
    assert "material.match.result" not in shelf.shell.handles.names()


def test_the_objects_own_material_is_matched_and_the_cross_stops_it(shelf: HeadlessWindow) -> None:
    editor = shelf.shell.editor
    before, sent = editor.document, []
    send = editor.matching._send
    editor.matching._send = lambda request: sent.append(request) or send(request)
    shelf.click_handle("button.material.match")
    choose_model(shelf, "material.match.ward")
    (request,) = sent
    assert isinstance(request, MatchMaterial) and request.match.layers == before.object("teapot").layers
    shelf.click_handle("button.matching.stop")
    shelf.frames(3)
    assert not editor.matching.is_under_way and editor.document is before
    assert editor.status.message == "the match was stopped; the material is as it was"
