"""The clipboard of the window's imgui context: the desktop's where there is one, else the window's own."""

from __future__ import annotations

from imgui_bundle import imgui


class Clipboard:
    """Text in and out."""

    def put(self, text: str) -> None:
        """Replace what is there."""
        imgui.set_clipboard_text(text)

    def text(self) -> str:
        """What is there; "" where there is nothing, or no text."""
        return imgui.get_clipboard_text() or ""
