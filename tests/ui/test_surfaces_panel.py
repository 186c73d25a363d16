"""What Deform knows of a surface, in the Material panel: a kind is chosen, its values are dragged, one step each."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.commands import SetSurface
from app.document.commands.layers import SetFrozen
from app.document.view_state import OpenPanel, SetView
from app.editor.editor import Editor
from engine.scene.surface_kinds import NO_SURFACE, SURFACES, DeformSurface
from ui.headless import HeadlessWindow
from ui.panels.file_dialog import answer
from ui.panels.window_state import PanelState

pytestmark = pytest.mark.gl


@pytest.fixture
def editor(window: HeadlessWindow) -> Editor:
    """The editor in Deform, its teapot selected."""
    editor = window.shell.editor
    editor.do(SetView.of(mode="deform"))
    editor.select("teapot")
    for panel in ("light", "library", "brdf"):  # room for all rows
        editor.do(OpenPanel(panel, False))
    window.frames(5)
    return editor


def surface(editor: Editor) -> DeformSurface:
    return editor.document.object("teapot").surface


def test_a_kind_is_chosen_and_taken_back(window: HeadlessWindow, editor: Editor) -> None:
    assert surface(editor) == NO_SURFACE
    window.click_handle("surface.kind")
    window.frames(2)
    window.click_handle("surface.kind.subsurface")
    assert surface(editor).kind == "subsurface" and len(editor.history.undo_steps) == 1
    editor.undo()
    assert surface(editor) == NO_SURFACE


@pytest.mark.parametrize("kind", SURFACES)
def test_all_that_a_kind_has_is_dragged_or_chosen(window: HeadlessWindow, editor: Editor, kind: str) -> None:
    editor.do(SetSurface("teapot", kind))
    window.frames(3)
    for parameter in SURFACES[kind].parameters:
        before, steps = surface(editor), len(editor.history.undo_steps)
        handle = f"surface.{parameter.name}"
        if parameter.kind == "choice":
            window.click_handle(handle)
            window.frames(2)
            window.click_handle(f"{handle}.{parameter.choices[1]}")
        elif isinstance(before.values[parameter.name], tuple):
            window.drag_handle(f"{handle}.v", (20.0, 0.0))
        else:
            window.drag_handle(handle, (15.0, 0.0))
        window.frames(2)
        assert surface(editor) != before and len(editor.history.undo_steps) == steps + 1, parameter.name


def test_what_is_frozen_stays_and_an_image_gives_way_to_a_value(window: HeadlessWindow, editor: Editor) -> None:
    editor.do(SetSurface("teapot", "membrane", (("translucency", "leaf.png"),)))
    window.frames(3)
    window.click_handle("button.surface.translucency.clear")
    assert surface(editor).values["translucency"] == 0.5
    editor.do(SetFrozen("teapot", True))
    window.frames(3)
    window.drag_handle("surface.translucency", (30.0, 0.0))
    assert surface(editor).values["translucency"] == 0.5


@pytest.mark.parametrize(
    ("kind", "parameter", "what"),
    [("membrane", "translucency", "translucency"), ("patch", "kind", "heights"), ("wrinkles", "depth", "depth")],
)
def test_an_image_is_chosen_by_the_browser(
    window: HeadlessWindow, editor: Editor, tmp_path: Path, kind: str, parameter: str, what: str
) -> None:
    editor.do(SetSurface("teapot", kind))
    window.frames(3)
    before = surface(editor)
    for name, button in (("leaf.png", f"button.surface.{parameter}.image"), ("bark.exr", f"surface.{parameter}.file")):
        window.click_handle(button)
        window.frames(2)
        question = window.shell.state.question
        assert question is not None and (question.purpose, question.key) == (f"open_{what}", "teapot")
        file = tmp_path / name
        actor = window.shell.actor
        actor.perform([answer(question, file)], window.shell.state, 0.0)
        assert f"{name}: there is no such file; nothing was changed" in editor.status.message
        file.touch()
        actor.perform([answer(question, file)], window.shell.state, 0.0)
        assert surface(editor).files == (("patch" if kind == "patch" else parameter, str(file)),)
        window.shell.state = PanelState()
        window.frames(2)
    editor.undo()
    editor.undo()
    assert surface(editor) == before


def test_the_error_of_the_fit_has_its_colours_beside_it(window: HeadlessWindow, editor: Editor) -> None:
    editor.do(SetView.of(split=(0.3, 0.6)))
    window.frames(2)
    window.click_handle("button.deform.fit_error")
    window.frames(2)
    assert editor.view.fit_error and editor.view.split is None and not editor.history.undo_steps
    window.click_handle("button.deform.fit_error")
    assert not editor.view.fit_error
