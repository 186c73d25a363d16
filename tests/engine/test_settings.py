"""Render settings: each is declared once, and what derives from the declaration agrees with it."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from app.document.view_state import SetView, ViewState
from app.files.records import ViewRecord
from engine.core.errors import InsituError
from engine.settings import (
    AS_PLANNED,
    DEFAULT_SETTINGS,
    FIELD_OF_LINE,
    SETTINGS,
    RenderSettings,
    checked_line,
    checked_setting,
)


def test_every_field_but_overridden_lines_and_what_the_view_chooses_is_declared() -> None:
    assert {each.name for each in fields(RenderSettings)} == {*SETTINGS, "overridden", "lighting"}
    assert len(FIELD_OF_LINE) == sum(bool(setting.line) for setting in SETTINGS.values())  # no two share a line


@pytest.mark.parametrize("name", SETTINGS)
def test_the_default_is_possible_and_stays(name: str) -> None:
    default = getattr(DEFAULT_SETTINGS, name)
    assert checked_setting(name, int(default) if isinstance(default, bool) else default) == default
    assert SETTINGS[name].nearest(default) == default


@pytest.mark.parametrize("name", [name for name, setting in SETTINGS.items() if setting.is_saved])
def test_a_session_takes_the_ends_of_each_range_and_nothing_beyond(name: str) -> None:
    setting = SETTINGS[name]
    for value in (*setting.as_required, setting.values[0], setting.values[-1]):
        assert getattr(ViewRecord(**{name: value}), name) == value
    with pytest.raises(ValueError):
        ViewRecord(**{name: 10**9})


@pytest.mark.parametrize(
    ("name", "value", "nearest"),
    [
        ("n_lights", 7, 20), ("n_lights", 10**6, 80_000), ("n_lights", 444.4, 444), ("n_bounces", 9, 8),
        ("n_bounces", AS_PLANNED, AS_PLANNED), ("n_edge_rays", None, None), ("precision", "float", "float"),
    ],
)  # fmt: skip
def test_a_number_is_brought_into_its_range(name: str, value: object, nearest: object) -> None:
    assert SETTINGS[name].nearest(value) == nearest
    assert getattr(SetView.of(**{name: value}).apply(ViewState()).settings, name) == nearest


def test_a_wrong_value_is_refused_by_the_name_that_the_user_gave() -> None:
    with pytest.raises(InsituError, match="--edges 3: expected one of 0, 4, 8, 16"):
        checked_setting("n_edge_rays", 3)
    with pytest.raises(InsituError, match="plan: lobes = 5, expected a whole number from 0 to 4 .0: unshadowed."):
        checked_line("lobes", 5)
    assert checked_line("lobes", "unshadowed") == 0


def test_lines_override_settings_and_say_so() -> None:
    changed = DEFAULT_SETTINGS.with_lines({"lights": 400, "sphere": 0, "teapot.1.theta_h": 32})
    assert (changed.n_lights, changed.keeps_sphere) == (400, False)
    assert changed.overridden == {"lights", "sphere", "teapot.1.theta_h"}
    assert DEFAULT_SETTINGS.with_lines({}) is DEFAULT_SETTINGS


def test_transport_depends_on_nothing_else() -> None:
    of_others = {
        "n_points": 7,
        "n_coefficients": 40,
        "n_rays": 64,
        "n_lobes": 1,
        "n_edge_rays": 4,
        "precision": "float",
    }
    assert replace(DEFAULT_SETTINGS, **of_others).of_light == DEFAULT_SETTINGS.of_light  # type: ignore[arg-type]
    assert replace(DEFAULT_SETTINGS, n_hemisphere_rays=512).of_light != DEFAULT_SETTINGS.of_light
    assert replace(DEFAULT_SETTINGS, n_hemisphere_rays=512, n_bounces=3).of_direct_light == DEFAULT_SETTINGS.of_light
