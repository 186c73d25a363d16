"""What the editor does at once: steps, refusals, and what costs the worker nothing."""

import numpy as np

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetIntensity, SetRotation
from app.editor.editor import Editor
from app.messages.worker_messages import OpenScene, WorkerRestarted
from engine.curve.operators import Operator
from tests.app.fake_worker import FakeClient

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)


def test_coefficients_are_computed_once(settled: Editor) -> None:
    first = settled.controller.picture.wanted_coefficients("pot.1")
    settled.do(SetParameter("pot.1", "scale", 2.0))
    again = settled.controller.picture.wanted_coefficients("pot.1")
    assert all(again[name] is first[name] for name in first)  # the scale is in no curve
    assert settled.controller.picture.gain("pot.1").tolist() == [2.0, 2.0, 2.0]
    assert not first["theta_h"].flags.writeable


def test_visibility_and_intensity_cost_nothing(settled: Editor, client: FakeClient) -> None:
    settled.do(SetVisible("pot.0", False))
    settled.do(SetIntensity(3.0))
    settled.tick(9.0)
    settled.tick(10.0)
    assert client.requests == []


def test_view_factors_are_applied_in_image_space(settled: Editor, client: FakeClient) -> None:
    settled.select("floor.0.theta_o")
    settled.do(AddOperator("floor.0", "theta_o", LIFT))
    settled.tick(1.1)
    assert client.requests == []
    curve = settled.controller.picture.view_curves("floor.0").prod(axis=0)
    assert curve.shape == (256, 3) and curve[-1].tolist() == [1.0, 1.0, 1.0]
    angle = np.linspace(0.0, np.pi / 2, 256)
    assert np.allclose(curve[(angle > 0.2) & (angle < 0.3)], 2.0)  # 1 as generated, lifted by 1


def test_a_crash_is_reported_and_loses_nothing(settled: Editor, client: FakeClient) -> None:
    settled.do(SetParameter("pot.1", "scale", 2.0))
    before = settled.document
    client.answer(OpenScene("shelf"), WorkerRestarted("signal 9"))
    settled.tick(1.5)
    assert settled.document is before
    assert "signal 9" in settled.status.message and settled.status.is_error


def test_refusals_are_lines_and_change_nothing(settled: Editor) -> None:
    before = settled.document
    for command in (SetParameter("pot.1", "alpha", 7.0), SetParameter("pot.9", "alpha", 0.1), SetIntensity(np.nan)):
        line = settled.do(command)
        assert line and "\n" not in line and settled.status.message == line
    assert settled.select("pot.1.theta_x") is not None
    assert settled.document is before and settled.undo() is None


def test_a_drag_is_one_step(settled: Editor) -> None:
    before = settled.document
    settled.begin_drag()
    for degrees in range(31, 61):
        settled.do(SetRotation(float(degrees)))
    settled.end_drag()
    assert settled.document.light.rotation == 60.0
    assert settled.undo() == "rotate the environment"
    assert settled.document is before  # the very value: bit by bit
    assert settled.redo() == "rotate the environment"
    assert settled.document.light.rotation == 60.0
