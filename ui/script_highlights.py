"""Carries out a script's stroke on a highlight, as a hand would: press, drag, release, and wait for the answer."""

from __future__ import annotations

from app.editor.editor import Editor
from app.operators.edits import HighlightStep
from app.operators.registry import run_operator
from engine.inverse.highlight_brush import HighlightBrush, Place
from ui.headless import HeadlessWindow
from ui.highlight_feed import radiance_at
from ui.panels.actions import DragHighlight, PressHighlight, ReleaseHighlight
from ui.scene_view import sample_path


def paint_highlight(window: HeadlessWindow, editor: Editor, step: HighlightStep, timeout: float) -> str | None:
    """Returns None, or one line that says why there is no such highlight. Raises InsituError for a bad brush."""
    refusal = run_operator(editor, "select", step.layer)
    if refusal is not None:
        return refusal
    colour = step.colour
    if step.there is not None:
        source = window.shell.source
        shown = None if source is None else source.shown(editor)
        if shown is None:
            return "paint_highlight: there is no picture yet"
        colour = radiance_at(shown, step.there)
    brush = HighlightBrush(step.effect, step.stops, step.radius, step.hardness, step.hold, colour)
    said_before = editor.status.message_number
    places: list[Place] = [(float(x), float(y)) for x, y in step.points]
    window.shell.request(
        PressHighlight(brush, step.solve, places[0]),
        *([DragHighlight(tuple(sample_path(places, step.radius)))] if len(places) > 1 else []),
        ReleaseHighlight(),
    )
    window.frames(2)
    strokes = editor.controller.highlights
    if strokes is not None and not window.run_until(lambda: not (strokes.is_busy or strokes.wants_picture), timeout):
        return f"paint_highlight: not solved for after {timeout:.0f} s"
    if editor.status.message_number != said_before and editor.status.is_error:
        return editor.status.message
    if strokes is not None and strokes.outcome is None:
        return f"paint_highlight: no pixel of the stroke sees {step.layer} alone"
    return None
