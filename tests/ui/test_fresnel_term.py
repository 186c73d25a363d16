"""The Fresnel term of the material panel: a layer that appears in the picture and goes, also by undo."""

from __future__ import annotations

import pytest

from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl


def test_it_comes_and_goes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before, source = editor.document, window.shell.source
    assert source is not None

    def exact() -> bool:
        return editor.status.picture == "exact"

    editor.select("teapot.0")
    without = source.renderer.linear_image()  # type: ignore[attr-defined]
    window.click_handle("material.fresnel_term.0")
    term = editor.document.layer("teapot.2")
    assert term.rises and term.values["fresnel"] == (0.35, 0.12, 0.08)  # what the base's albedo was
    window.frames(2)
    assert window.run_until(exact, 30.0)
    shown = source.renderer.linear_image()  # type: ignore[attr-defined]
    window.drag_handle("material.fresnel.r", (-40, 0))
    red, green, blue = editor.document.layer("teapot.2").values["fresnel"]  # type: ignore[misc]
    assert red < 0.35 and (green, blue) == (0.12, 0.08)
    window.frames(2)
    assert window.run_until(exact, 30.0)
    less = source.renderer.linear_image()  # type: ignore[attr-defined]
    assert (less[..., 0] != shown[..., 0]).any() and (less[..., 1:] == shown[..., 1:]).all()
    editor.undo()
    editor.undo()
    assert editor.document == before
    window.frames(2)
    assert window.run_until(exact, 30.0)
    assert source.renderer.linear_image() == pytest.approx(without, rel=1e-3)  # type: ignore[attr-defined]
