"""The clipboard of the window's imgui context: the desktop's where there is one, else the window's own."""

from __future__ import annotations

from imgui_bundle import imgui


class Clipboard:
    """Text in and out."""

    def put(self, text: str) -> None:
        """Replace the content."""
        imgui.set_clipboard_text(text)

    def text(self) -> str:
        """The content; "" where there is none, or no text."""
        return imgui.get_clipboard_text() or ""
