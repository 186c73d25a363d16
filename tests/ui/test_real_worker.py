"""The real window while the worker computes: what it shows is one thing, and a fault in a frame is one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.pictures import write_exr
from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()
small = real_window_fixture(small_scene=True)

SET_MATERIAL = """
from app.files.materials import Library
from app.document.commands.layers import SetMaterial
library = Library()
library.read_all()
editor.do(SetMaterial("teapot", library.entry({name!r}).material.layers))
"""
BREAK = """
def broken(*arguments, **named):
    raise KeyError("theta_i")
editor.controller._transport.update = broken
"""
RECORD = """
editor.brightness, inner = [], window._frame
editor.unrecorded = inner
def watched(inner=inner, window=window, editor=editor):
    result = inner()
    editor.brightness.append(float(window._feed.source.renderer.display_image()[..., :3].mean()))
    return result
window._frame = watched
"""


def test_one_material_of_the_library_after_another(real: RealWindow) -> None:
    real.fresh()
    for name in ("Copper", "Velvet, red", "Copper"):
        real.do(SET_MATERIAL.format(name=name))
        real.wait_until("editor.status.is_finished")
        assert not real.ask("editor.status.is_error"), real.notice()


def test_a_fault_in_every_frame_is_one_line_and_the_hand_goes_on(real: RealWindow) -> None:
    real.fresh()
    real.do(BREAK)
    real.drag("curve.magnitude", by=(0, -40))
    assert real.n_steps() == 1
    assert "bug in Insitu" in real.notice() and "window.log" in real.notice() and "theta_i" not in real.notice()
    real.click("status.message")
    assert real.ask("state.message is None")
    for _ in range(3):
        real.drag("curve.magnitude", by=(0, 10))
    assert real.ask("state.message is None")  # told once
    real.do("del editor.controller._transport.update")
    real.key("ctrl+z")
    real.wait_until("editor.status.is_finished")


def test_a_parameter_that_changes_while_the_stages_come(small: RealWindow) -> None:
    small.fresh(select="ball.1.theta_h")
    small.do("from app.document.commands import SetModel; editor.do(SetModel('ball.1', 'cook_torrance'))")
    small.wait_until("editor.status.picture == 'preview'")
    for n in range(60):  # until all stages are there
        edit = f"editor.do(SetParameter('ball.1', 'eta', {1.2 + 0.01 * n}), 'eta')"
        small.do(f"from app.document.commands import SetParameter; {edit}")
        assert not small.ask("editor.status.is_error"), small.notice()
        if small.ask("editor.status.is_finished"):
            break
    small.wait_until("editor.status.is_finished")
    assert not small.ask("editor.status.is_error"), small.notice()


def test_light_that_is_opened_and_turned_at_once(small: RealWindow, tmp_path: Path) -> None:
    small.fresh(select="ball.1.theta_h")
    red = np.zeros((16, 32, 3), np.float32)
    red[..., 0] = 0.5
    write_exr(tmp_path / "red.exr", red)
    small.do(f"shell.actor.files.open({str(tmp_path / 'red.exr')!r})")
    small.drag("viewport.centre", by=(60, 0), held="shift", steps=12)
    assert small.ask("editor.document.light.rotation") != 0.0
    small.wait_until("editor.status.is_finished")
    small.wait_until("list(window._feed.environment.read()[:3])[1:] == [0, 0]")
    behind = "window._feed.source.renderer.linear_image()[0, 0].tolist()"
    small.wait_until(f"{behind}[0] > 0.4 and {behind}[1:] == [0.0, 0.0]")


def test_exact_is_said_of_nothing_that_is_not(small: RealWindow) -> None:
    small.fresh(select="ball.1.theta_h")
    small.wait_until("editor.status.is_finished")
    said = "__import__('ui.panels.status_bar').panels.status_bar.picture_state(editor.status)[1]"
    assert small.ask(said).startswith("finished")
    small.wait_until("editor.status.estimate is not None")
    assert 0.0 < small.ask("editor.status.estimate.direct") < 0.1 and "error about" in small.ask(said)
    small.do("from app.document.view_state import SetView; editor.do(SetView.of(n_bounces=2))")
    assert "exact" not in small.ask(said) and "error" not in small.ask(said)
    small.wait_until("editor.status.is_finished", timeout=240.0)
    assert (
        0.0 < small.ask("editor.controller._summary._noise") < small.ask("editor.status.indirect_noise")
    )  # part of it is direct
    small.wait_until("editor.status.estimate is not None")
    assert small.ask("editor.status.image_error == editor.status.estimate.overall")
    # Neither the sum of the parts' errors nor less than half of one of them: they may make up for each other a little.
    assert small.ask("editor.status.estimate.overall > 0.5 * editor.status.estimate.indirect > 0")


def test_a_measured_import_flashes_in_no_frame(small: RealWindow, merl_file: Path) -> None:
    small.fresh(select="ball.1.theta_h")
    small.wait_until("editor.status.is_finished")
    small.do(RECORD)
    made = f"ImportMeasured(pathlib.Path({str(merl_file)!r}))"
    small.do(f"import pathlib; from ui.panels.actions import ImportMeasured; shell.do({made})")
    small.wait_until("'measured' in editor.document.object('ball').layers[0].model.name")
    small.wait_until("editor.status.is_finished")
    small.do("window._frame = editor.unrecorded")
    found = np.array(small.ask("editor.brightness"))
    low, high = sorted((found[0], found[-1]))
    assert len(found) > 5 and found.max() < 1.1 * high and found.min() > 0.9 * low
