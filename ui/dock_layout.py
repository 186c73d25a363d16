"""The panels' places in one window: in the form that its size gives it, as they were when it last had that form."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from app.document.view_state import OpenPanel
from app.editor.editor import Editor
from ui import layout
from ui.layout_memory import LayoutMemory

# Frames until imgui has docked its windows, and their tabs know which others are in the same dock.
SETTLING = 3
# This many frames before that, they are docked where a remembered text has them.
SETTLED_IN = 1


class Docking:
    """Follows the window's form, and remembers what the user has moved and folded away."""

    def __init__(self, editor: Editor, file: Path | None, scale: float) -> None:
        self.form: layout.Form = "wide"
        self._editor = editor
        self._memory = LayoutMemory.read(file, scale)
        self._is_placed = False
        self._unsettled = 0
        self._rebuild = False
        self._recalled = ""
        self._in_front: tuple[str, ...] = ()
        self._behind_picture: tuple[str, ...] | None = None

    def take_size(self, size: tuple[int, int], scale: float) -> None:
        """Before a frame: if the window has another form than before, restore the panels of that form."""
        form = layout.form_of(size, scale)
        if self._is_placed and form == self.form:
            return
        if self._is_placed:
            self.keep()
        self.form, self._is_placed = form, True
        places = self._memory.places.get(form)
        self._rebuild = places is None
        self._unsettled = SETTLING
        self._recalled = "" if places is None or form == "small" else places
        self._in_front = ()
        if places is not None:
            imgui.load_ini_settings_from_memory(places)
        self._fold(self._memory.folded.get(form, layout.FOLDED[form]))

    @property
    def is_settling(self) -> bool:
        """Whether the panels' new places show only in the coming frames."""
        return self._unsettled > 0

    def rescale(self, scale: float) -> None:
        """Adopt another scale of the screen, which changes every place."""
        self._memory.rescale(scale)
        self._rebuild = True

    def make_room(self, front: tuple[str, ...]) -> None:
        """In a small window there is room for one panel beside the picture: the one that comes to the front."""
        if self.form == "small" and front:
            self._fold(layout.FOLDED["small"] - {*front})

    def begin_space(self, scale: float, alone: bool = False) -> tuple[str, ...]:
        """Begin the space that panels dock in; where their places are new, or they come back after the picture was
        alone, return those that are to be in front.

        That is for the next pass, when the panels are there: of those that appear together the last one would be in
        front. One per pass: of panels that were docked elsewhere a frame ago imgui raises only the last that it is
        given.
        """
        layout.begin_dock_space(self.form, scale, self._rebuild)
        rebuilt, self._rebuild = self._rebuild, False
        self._unsettled = SETTLING if rebuilt else max(self._unsettled - 1, 0)
        if rebuilt:
            self._recalled, self._in_front = "", layout.IN_FRONT[self.form]
        if alone and self._behind_picture is None:
            self._behind_picture = layout.chosen_tabs(imgui.save_ini_settings_to_memory())
        elif not alone and self._behind_picture is not None:
            self._in_front, self._behind_picture = self._in_front or self._behind_picture, None
            self._unsettled = SETTLING
        if self._in_front:
            first, *others = self._in_front
            self._in_front = tuple(others)
            return (first,)
        if self._recalled and self._unsettled == SETTLED_IN:
            recalled, self._recalled = self._recalled, ""
            return layout.chosen_tabs(recalled)
        return ()

    def reset(self) -> None:
        """Put all panels into the default layout."""
        self._rebuild = True
        self._fold(layout.FOLDED[self.form])

    def remember(self) -> None:
        """After a frame: write what has changed, when imgui asks for it."""
        if imgui.get_io().want_save_ini_settings:
            self.keep()
            imgui.get_io().want_save_ini_settings = False

    def keep(self) -> None:
        """Write the layout of the panels."""
        if self._is_placed:
            folded = (panel.key for panel in layout.PANELS if not self._editor.view.panel_open(panel.key))
            self._memory.keep(self.form, imgui.save_ini_settings_to_memory(), frozenset(folded))

    def _fold(self, folded: frozenset[str]) -> None:
        for panel in layout.PANELS:
            self._editor.do(OpenPanel(panel.key, panel.key not in folded))
