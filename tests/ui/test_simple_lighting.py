"""Simple lighting in the window, with a real worker: a view of the same document, under which edits go on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.curves import AddOperator
from app.document.view_state import SetView
from app.modes.placement.placement_messages import ComputeTransport, EstimateError
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from tests.ui.small_scene import CountingClient, linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl

LIFT = Operator("translate", "y", 0.1, 0.2, 0.5, 0.7, magnitude=0.8)


@pytest.fixture
def client(tmp_path: Path) -> CountingClient:
    return CountingClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path, client: CountingClient) -> Iterator[HeadlessWindow]:
    with opened_window(context, write_small_scene(tmp_path), client, n_lights=800) as opened:
        opened.shell.editor.do(SetView.of(n_bounces=2))
        wait_until_exact(opened)
        yield opened


def newest(client: CountingClient) -> ComputeTransport:
    return [request for request in client.requests if isinstance(request, ComputeTransport)][-1]


def test_the_key_goes_through_the_lights_and_comes_back_to_the_same_picture(
    window: HeadlessWindow, client: CountingClient
) -> None:
    editor, before = window.shell.editor, window.shell.editor.document
    in_place = linear_picture(window)
    pictures = {}
    for expected in ("no_shadows", "point_light"):
        window.key(imgui.Key.k)
        assert editor.view.lighting == expected
        wait_until_exact(window)
        pictures[expected] = linear_picture(window)
        assert newest(client).settings.lighting == expected and newest(client).settings.n_bounces == 1
    window.key(imgui.Key.k)
    wait_until_exact(window)
    again = linear_picture(window)
    assert newest(client).settings.lighting == "scene" and newest(client).settings.n_bounces == 2
    assert np.sqrt(np.mean((again - in_place) ** 2)) < 0.01 * in_place.mean()
    # The ball shades the ground below it: without shadows that is brighter, and nothing is darker than by direct light.
    below = slice(52, 62), slice(40, 70)
    assert pictures["no_shadows"][below].mean() > 1.05 * in_place[below].mean()
    assert np.abs(pictures["point_light"] - pictures["no_shadows"]).mean() > 0.05 * in_place.mean()
    # It is a view: neither an edit nor a step of the history.
    assert editor.document is before and not editor.history.undo_steps


def test_edits_go_on_under_simple_light_and_its_error_is_not_estimated(
    window: HeadlessWindow, client: CountingClient
) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(lighting="no_shadows"))
    wait_until_exact(window)
    n_requests, n_estimates = client.n_asked(ComputeTransport), client.n_asked(EstimateError)
    before = linear_picture(window)
    editor.do(AddOperator("ball.1", "theta_h", LIFT))
    wait_until_exact(window)
    window.frames(120)
    assert np.abs(linear_picture(window) - before).max() > 0.05
    # The curve needs no other transport; the estimate would be of light in place.
    assert client.n_asked(ComputeTransport) == n_requests and client.n_asked(EstimateError) == n_estimates
    assert editor.status.estimate is None


def test_orbit_has_its_own_light(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(lighting="point_light", mode="orbit"))
    window.frames(2)
    window.key(imgui.Key.k)
    assert editor.view.lighting == "point_light"
    assert window.shell.state.message is not None and "Placement, which alone" in window.shell.state.message.text
