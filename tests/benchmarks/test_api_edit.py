"""The figure of edits through the Python interface."""

from __future__ import annotations

import math

import pytest

from app import interface
from benchmarks import api_edit
from benchmarks.api_edit import ApiEditEffort, api_edit_figures


def test_each_edit_that_is_timed_makes_another_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three edits that are timed and two before them, after the picture of the scene as it was opened."""
    monkeypatch.setattr(api_edit, "DEFAULT_SCENE", "shapes")
    means, original = [], interface.Scene.image

    def image(scene: interface.Scene, bounces: int | None) -> object:
        assert bounces == 1
        picture = original(scene, bounces=bounces)
        means.append(float(picture.mean()))
        return picture

    monkeypatch.setattr(interface.Scene, "image", image)
    [figure] = api_edit_figures(ApiEditEffort((16, 12), 3), lambda line: None)
    assert figure.name == "api_edit_ms" and len(figure.samples) == 3
    assert all(ms > 0.0 and math.isfinite(ms) for ms in figure.samples) and figure.parts["processor_ms"] > 0.0
    assert len(set(means)) == 1 + 2 + 3


def test_a_quick_run_says_that_it_leaves_the_figure_out() -> None:
    [figure] = api_edit_figures(None, lambda line: None)
    assert (figure.name, figure.value) == ("api_edit_ms", None)
