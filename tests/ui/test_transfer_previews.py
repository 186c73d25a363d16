"""Previews of a transferred edit: the materials that other objects would have, in the menu, made once."""

from __future__ import annotations

import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.objects import DuplicateObject
from app.document.commands.transfer import TransferEdit
from engine.curve.operators import Operator
from engine.inverse.transferred_edit import MEASURES
from ui.headless import HeadlessWindow
from ui.transfer_previews import MOST_SHOWN, TransferPreviews

CURVE = "teapot.1.theta_h"
TWICE = Operator("amplify", "y", 0.0, 0.0, 0.3, 0.5, magnitude=4.0)


def select_for_transfer(window: HeadlessWindow) -> None:
    """The pot's edited curve is active, and the tray is selected as well."""
    editor = window.shell.editor
    assert editor.do(AddOperator("teapot.1", "theta_h", TWICE)) is None
    assert editor.select(("tray", CURVE)) is None


def test_previews_are_what_the_edit_makes_and_stay_until_the_document_changes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    select_for_transfer(window)
    previews = TransferPreviews(lambda: editor.document, lambda: editor.view)
    for measure in MEASURES:
        (entry,) = previews.entries(measure)
        changed = TransferEdit(CURVE, ("tray",), measure).apply(editor.document)
        assert entry.name == "tray" and entry.material.layers == changed.object("tray").layers
        assert previews.entries(measure)[0].material is entry.material
    editor.undo()
    assert previews.entries("ratio") == ()  # no operator is left to transfer


def test_a_call_makes_one_at_most(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many objects are selected, a frame computes one for each measure."""
    editor = window.shell.editor
    select_for_transfer(window)
    names = tuple(f"copy {i}" for i in range(9))
    for name in names:
        assert editor.do(DuplicateObject("tray", name)) is None
    assert editor.select((*names, CURVE)) is None
    applied: list[tuple[str, ...]] = []
    apply = TransferEdit.apply
    monkeypatch.setattr(TransferEdit, "apply", lambda edit, document: applied.append(edit.to) or apply(edit, document))
    previews = TransferPreviews(lambda: editor.document, lambda: editor.view)
    for n in range(1, MOST_SHOWN + 1):
        assert [each.name for each in previews.entries("ratio")] == list(editor.view.others[:n])
        assert len(applied) == n
    previews.entries("ratio")
    assert len(applied) == MOST_SHOWN and all(len(to) == 1 for to in applied)


def test_the_menu_shows_them(window: HeadlessWindow) -> None:
    shell = window.shell
    select_for_transfer(window)
    window.frames(2)
    window.click_handle("menu.Edit")
    window.frames(2)
    window.click_handle("menu.Transfer the curve's edit")
    shown = [entry for measure in MEASURES for entry in shell._pictures.transfers.entries(measure)]
    assert len(shown) == len(MEASURES)
    pictures = shell._pictures.materials
    for each in shown:  # all are requested, as a panel does that draws them
        pictures.texture(each)
    assert window.run_until(lambda: all(pictures.texture(each) is not None for each in shown), 60.0)
    window.frames(2)
    assert {f"menu.transfer_{measure}.0" for measure in MEASURES} <= set(shell.handles.names())
    window.click_handle("menu.transfer_ratio")
    window.frames(2)
    assert shell.editor.document.layer("tray.0").operators("theta_h")
