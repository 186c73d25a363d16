"""The Fresnel term of the material panel: a layer that appears in the picture and goes, also by undo."""

from __future__ import annotations

import numpy as np
import pytest

from app.project.assignments import set_path
from engine.core.errors import InsituError
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl


def test_it_comes_and_goes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before, source = editor.document, window.shell.source
    assert source is not None

    def exact() -> bool:
        return editor.status.picture == "exact"

    editor.select("teapot.0")
    without = source.source.renderer.linear_image()  # type: ignore[attr-defined]
    window.click_handle("material.fresnel_term.0")
    term = editor.document.layer("teapot.2")
    assert term.rises and term.values["fresnel"] == (0.35, 0.12, 0.08)  # what the base's albedo was
    window.frames(2)
    assert window.run_until(exact, 30.0)
    shown = source.source.renderer.linear_image()  # type: ignore[attr-defined]
    window.drag_handle("material.fresnel.r", (-40, 0))
    red, green, blue = editor.document.layer("teapot.2").values["fresnel"]  # type: ignore[misc]
    assert red < 0.35 and (green, blue) == (0.12, 0.08)
    window.frames(2)
    assert window.run_until(exact, 30.0)
    less = source.source.renderer.linear_image()  # type: ignore[attr-defined]
    assert (less[..., 0] != shown[..., 0]).any() and (less[..., 1:] == shown[..., 1:]).all()
    editor.undo()
    editor.undo()
    assert editor.document == before
    window.frames(2)
    assert window.run_until(exact, 30.0)
    assert source.source.renderer.linear_image() == pytest.approx(without, rel=1e-3)  # type: ignore[attr-defined]


def test_both_terms_follow_every_frame(window: HeadlessWindow) -> None:
    # In the stand-in both layers have the same transport: so their pictures are the same, while the hand moves as well.
    editor, source = window.shell.editor, window.shell.source
    assert source is not None
    renderer = source.source.renderer  # type: ignore[attr-defined]
    window.click_handle("material.fresnel_term.0")
    window.frames(2)
    assert window.run_until(lambda: editor.status.picture == "exact", 30.0)
    assert renderer._edited.keys == ("teapot.1", "teapot.2")
    client, before = editor._client, renderer.layer_radiance("teapot.2")
    assert isinstance(client, StandInClient)
    n_requests = len(client.requests)
    x, y = window.shell.handle_position("curve.magnitude")
    window.move(x, y)
    window.press()
    for step in range(1, 5):
        window.move(x, y - 10.0 * step)
        window.frame()
        first, second = (renderer.layer_radiance(key) for key in ("teapot.1", "teapot.2"))
        # Half floats, added up in as many parts as there was time for.
        np.testing.assert_allclose(second, first, rtol=2e-2)
        assert (second > 1.01 * before).any() and len(client.requests) == n_requests
        before = second
    window.release()


def test_the_index_sets_the_reflectance_of_each_colour(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.0")
    window.click_handle("material.fresnel_term.0")
    before = editor.document.layer("teapot.2").values["fresnel"]
    window.frames(2)
    window.drag_handle("material.fresnel_index.r", (-40, 0))
    red, *others = editor.document.layer("teapot.2").values["fresnel"]  # type: ignore[misc]
    assert red < 0.35 and others == [0.12, 0.08], before
    # One drag is one step; R by n = 1.5 is 0.04.
    editor.undo()
    assert editor.document.layer("teapot.2").values["fresnel"] == before
    assert editor.do(set_path(editor.document, "teapot.2.fresnel_index", [1.5, 3.0, 9.0])) is None
    assert editor.document.layer("teapot.2").values["fresnel"] == pytest.approx((0.04, 0.25, 0.64))
    with pytest.raises(InsituError, match="fresnel_index"):
        set_path(editor.document, "teapot.2.fresnel_index", 0.5)
    with pytest.raises(InsituError, match="reflectance"):
        set_path(editor.document, "teapot.2.reflectance_index", 1.5)
