"""The menus of the real window by clicks: what stands in them does what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()
VIEW = "editor.view.tone_mapping"
POPUPS = "imgui.get_current_context().open_popup_stack.size()"
OPENED = "[request.source for request in client.requests if type(request).__name__ == 'OpenScene']"


def open_menu(real: RealWindow, *titles: str) -> None:
    """Click a menu, then rest on menus within it, which open after a moment."""
    real.click(f"menu.{titles[0]}")
    for count, title in enumerate(titles[1:], 2):
        real.move(f"menu.{title}")
        real.wait_until(f"{POPUPS} == {count}")


def test_the_colours_are_chosen_from_the_list_and_from_the_menu(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.click("view.tone_mapping")
    real.click("colours.agx")
    real.wait_until(f"{VIEW} == 'agx'")
    assert real.ask(POPUPS) == 0
    # In a window too narrow for the list the menu has it still.
    real.resize(400, 300)
    assert "view.tone_mapping" not in real.handles()
    open_menu(real, "View", "Colours")
    real.click("menu.colours.aces_2")
    real.wait_until(f"{VIEW} == 'aces_2'")
    assert real.ask(POPUPS) == 0
    real.resize(1380, 860)
    assert real.n_steps() == 0  # it is a way to look, no edit


def test_what_was_opened_last_is_opened_from_its_menu(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    there, gone = tmp_path / "there.toml", tmp_path / "gone.toml"
    there.write_text("version = 1\n")
    real.do(
        f"from pathlib import Path; shell.actor.recent.add(Path({str(there)!r})); "
        f"shell.actor.recent.add(Path({str(gone)!r}))"
    )
    opened = len(real.ask(OPENED))
    open_menu(real, "File", "Open recent")
    real.click("menu.recent.0")  # grey: it has gone
    assert real.ask(POPUPS) == 2 and len(real.ask(OPENED)) == opened
    real.click("menu.recent.1")
    assert real.ask(POPUPS) == 0 and real.ask(OPENED)[opened:] == [str(there)]


def test_a_path_is_typed_where_a_file_is_asked_for(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    there = tmp_path / "a folder" / "there.toml"
    there.parent.mkdir()
    there.write_text("version = 1\n")
    opened = len(real.ask(OPENED))
    real.key("ctrl+o")
    real.text(str(there.parent))  # without a click: the field waits for it
    real.key("enter")
    assert real.ask("str(state.question.folder)") == str(there.parent)
    real.click("files.name")
    real.text(str(there))
    real.key("enter")
    assert real.ask("state.question") is None and real.ask(OPENED)[opened:] == [str(there)]
