"""The slider's table: what is on the front, where the settings stand on it, and who reads it."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.__main__ import Desktop
from app.cli.program import run
from app.document.pareto_front import FrontPoint, format_front, load_front, parse_front
from app.document.view_state import SetView, ViewState
from app.measure.front import FrontEffort, measure_front, on_the_front
from app.modes.registry import MODES
from app.operators.script import Step, parse_script
from engine.core.errors import InsituError
from engine.settings import SETTINGS

Captured = pytest.CaptureFixture[str]


def stop(n_lights: int, error: float, seconds: float) -> FrontPoint:
    return FrontPoint((("n_lights", n_lights),), error, seconds)


def test_what_another_beats_in_error_and_time_is_not_on_the_front() -> None:
    quick, worse, true = stop(100, 0.1, 1.0), stop(200, 0.2, 2.0), stop(400, 0.05, 3.0)
    assert on_the_front([true, worse, quick]) == (quick, true)
    assert on_the_front([stop(1, 0.1, 2.0), stop(2, 0.1, 1.0)]) == (stop(2, 0.1, 1.0),)


@pytest.mark.parametrize("mode", [mode.name for mode in MODES])
def test_every_mode_has_a_front_from_speed_to_accuracy_which_its_settings_can_follow(mode: str) -> None:
    table, view = load_front(), ViewState()
    stops = table.points[mode]
    assert len(stops) >= 2 and stops == on_the_front(stops) and "processor" in table.origin
    for i, each in enumerate(stops):
        assert all(SETTINGS[name].nearest(value) == value for name, value in each.settings)
        moved = each.command.apply(view)
        assert (
            table.position(mode, moved) == i / (len(stops) - 1)
            and table.nearest_point(mode, i / (len(stops) - 1)) == each
        )
    assert table.nearest_point(mode, -1.0) == stops[0] and table.nearest_point(mode, 2.0) == stops[-1]
    beside = SetView.of(n_lights=777, n_points=777, n_rays=777).apply(view)
    assert table.position(mode, beside) is None


@pytest.mark.parametrize("mode", [mode.name for mode in MODES])
def test_where_nobody_has_moved_a_knob_the_slider_stands_on_the_front(mode: str) -> None:
    assert load_front().position(mode, ViewState()) is not None


def test_a_table_is_read_as_it_was_written() -> None:
    stops = {"placement": (FrontPoint((("n_lights", 100), ("n_patches", 64)), 0.125, 2.5), stop(400, 0.05, 3.0))}
    table = parse_front(format_front("measured here", 1000, stops))
    assert (table.origin, table.n_pixels, table.points) == ("measured here", 1000, stops)


def test_a_larger_picture_takes_longer_where_pixels_are_computed_and_not_where_points_are() -> None:
    table = load_front()
    for mode, expected in {"placement": 4.0, "orbit": 1.0, "deform": 1.0}.items():
        last = table.points[mode][-1]
        assert table.seconds(last, 4 * table.n_pixels) == pytest.approx(expected * last.seconds)


def test_a_front_is_measured() -> None:
    effort = FrontEffort(("cornell",), (), (24, 18), rays=(), lights=((4, 2, 128), (2000, 768, 0)))
    told: list[str] = []
    stops = measure_front(effort, told.append)["placement"]
    assert len(told) == 2 and stops[-1].settings == (("n_lights", 2000), ("n_patches", 768), ("n_hemisphere_rays", 0))
    assert stops[-1].error < 0.2 and all(each.seconds > 0.0 for each in stops)


def test_a_script_moves_the_slider(tmp_path: Path) -> None:
    steps = parse_script({"step": [{"accuracy": 0.6}]}, tmp_path / "a.toml", tmp_path)
    assert steps == (Step("accuracy", 0.6),)
    with pytest.raises(InsituError, match="accuracy"):
        parse_script({"step": [{"accuracy": 1.5}]}, tmp_path / "a.toml", tmp_path)


def test_the_command_line_takes_accuracy_in_place_of_settings(tmp_path: Path, capsys: Captured) -> None:
    said, first = [], dict(load_front().points["placement"][0].settings)
    by_hand = [f"--lights={first['n_lights']}", f"--patches={first['n_patches']}"]
    by_hand += [f"--override=rays={first['n_hemisphere_rays']}"] if first.get("n_hemisphere_rays") else []
    for name, options in {"accuracy": ["--accuracy", "0"], "settings": by_hand}.items():
        out = tmp_path / f"{name}.exr"
        words = ["render", "cornell", "-o", str(out), "--resolution", "16", "12", "--bounces", "2", *options]
        assert run(words, Desktop()) == 0
        said.append(capsys.readouterr().out.split(" s, ", 1)[1])
    assert said[0] == said[1]
    with pytest.raises(InsituError, match="--accuracy 0 --lights, --patches: expected one of them"):
        run(["render", "shapes", "-o", str(out), "--accuracy", "0", "--lights", "300"], Desktop())
