"""The tutorial's pictures of a highlight that is painted: `python -m assets.scripts.painted_highlight FOLDER` writes
highlight-before.png, highlight-stroke.png, with the brush held, and highlight-after.png."""

from __future__ import annotations

import sys
from pathlib import Path

from imgui_bundle import imgui

from app.editor.editor import Editor
from app.worker.client import Client
from engine.inverse.highlight_brush import HighlightBrush
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPanel
from ui.picture_feed import PictureFeed
from ui.script_runner import wait_for_picture, wait_for_scene

SIZE, RESOLUTION, CURVE = (1000, 640), (640, 480), "teapot.copper.gamma_alpha"
BRUSH = HighlightBrush("tint", radius=40.0, colour=(0.4, 0.7, 1.0))
# From one place of the picture to another.
START, END, N_MOVES = (330.0, 250.0), (366.0, 284.0), 8


def draw(folder: Path) -> None:
    """Paint the pot's highlight as a hand does, and write the window before, meanwhile and after."""
    editor = Editor(Client(), "teatray", resolution=RESOLUTION)
    window = HeadlessWindow(editor, size=SIZE)
    window.shell.source = feed = PictureFeed(window.context, editor.mode)
    try:
        wait_for_scene(window, editor)
        editor.select(CURVE)
        window.key(imgui.Key.p, imgui.Key.mod_shift)
        window.shell.do(SetPanel({"highlight": BRUSH, "solved": "curves"}))
        wait_for_picture(window, editor, "exact")
        window.save(folder / "highlight-before.png")
        for i in range(N_MOVES + 1):
            window.move(*_on_screen(window, i / N_MOVES))
            window.press() if i == 0 else window.frames(10)
        strokes = editor.controller.highlights
        assert strokes is not None
        window.run_until(lambda: strokes.outcome is not None, 60.0)
        window.frames(20)
        window.save(folder / "highlight-stroke.png")
        window.release()
        window.run_until(lambda: not (strokes.is_busy or strokes.wants_picture), 60.0)
        window.leave()
        wait_for_picture(window, editor, "exact")
        window.save(folder / "highlight-after.png")
    finally:
        feed.close()
        window.close()
        editor.close()


def _on_screen(window: HeadlessWindow, share: float) -> tuple[float, float]:
    """A place on the way of the stroke, in the window."""
    (left, top), (middle, centre) = (window.shell.handle_position(f"viewport.{name}") for name in ("corner", "centre"))
    scale = max(2 * (middle - left) / RESOLUTION[0], 2 * (centre - top) / RESOLUTION[1])
    x, y = (a + share * (b - a) for a, b in zip(START, END, strict=True))
    return left + scale * x, top + scale * y


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
