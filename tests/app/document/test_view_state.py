"""The view changes by commands, and only within its ranges."""

import pytest

from app.document.view_state import HALF_PI, OpenPanel, SetView, ViewState
from engine.core.errors import InsituError


def test_numbers_are_clamped() -> None:
    view = SetView.of(exposure=99.0, compare_divider=-1.0, frame_budget_ms=0.0, n_lights=7).apply(ViewState())
    assert (view.exposure, view.compare_divider, view.frame_budget_ms, view.settings.n_lights) == (20.0, 0.0, 2.0, 20)
    assert isinstance(view.settings.n_lights, int)


def test_regions_are_brought_into_order_and_domain() -> None:
    view = SetView.of(regions=(1.0, -1.0, 0.5, 9.0)).apply(ViewState())
    assert view.regions == (0.0, 0.5, 1.0, HALF_PI)


def test_unknown_fields_are_refused() -> None:
    with pytest.raises(InsituError, match="exposition"):
        SetView.of(exposition=1.0)


def test_channels() -> None:
    assert ViewState().channels == (True, True, True)
    assert SetView.of(channel="g").apply(ViewState()).channels == (False, True, False)


def test_panels_close_and_open_again() -> None:
    closed = OpenPanel("light", False).apply(ViewState())
    assert not closed.panel_open("light") and closed.panel_open("curve")
    assert OpenPanel("light").apply(closed) == ViewState()
