"""The BRDF panel in a window over the stand-in worker: its parts come, follow the curve, and cost nothing unseen."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetMaterial, SetModel, SetParameter
from app.document.named_files import with_measurements
from app.document.view_state import OpenPanel, SetView, ViewState
from app.files.materials import measured_layers
from app.messages.worker_messages import FetchTable, RequestFailed, TableFetched
from engine.curve.operators import Operator
from engine.measured.measurement import evaluate_table
from tests.naive.measured import analytic_samples, drawn_measurement
from tests.ui.conftest import opened
from tests.ui.stand_in import StandInClient
from ui import brdf_feed
from ui.gl.brdf_views import Albedo, LitSphere
from ui.headless import HeadlessWindow
from ui.panels.actions import ShowPanel
from ui.panels.brdf import _places, energy_warning
from ui.panels.brdf_plots import arcs_of_region, radii
from ui.panels.pictures import BrdfBoard

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def one_window(context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeadlessWindow]:
    """Opened once for all tests here; smaller than others, because many frames are drawn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(brdf_feed, "LitSphere", functools.partial(LitSphere, n_steps=2))
        patch.setenv("INSITU_STATE", str(tmp_path_factory.mktemp("state")))
        yield from opened(context, (960, 600), 1.0)


@pytest.fixture
def window(one_window: HeadlessWindow) -> HeadlessWindow:
    """As it was opened."""
    editor = one_window.shell.editor
    while editor.undo():
        pass
    editor.select("teapot.1.theta_h")
    one_window.shell.do(ShowPanel("brdf"))
    plain = ViewState()
    names = ("brdf_plot", "brdf_whole", "brdf_across", "lobe_angle", "lobe_log")
    editor.do(SetView.of(**{name: getattr(plain, name) for name in names}))
    one_window.leave()
    return one_window


def settled(window: HeadlessWindow) -> BrdfBoard:
    """What is on the board when nothing more comes."""
    for _ in range(300):
        if not window.frame().busy:
            break
    else:
        pytest.fail("the window is busy for ever")
    assert window.shell._brdf_board.problem == ""
    return window.shell._brdf_board


def sphere_pixels(window: HeadlessWindow) -> np.ndarray:
    sphere = window.shell._brdf._sphere
    assert sphere is not None and sphere.finished
    return np.frombuffer(sphere.texture.read(), np.uint8).reshape(sphere.side, sphere.side, 4).astype(int)


def test_sphere_and_plots_follow_the_curve(window: HeadlessWindow) -> None:
    editor, board = window.shell.editor, settled(window)
    lobe, albedo, sphere = board.lobe, board.albedo, sphere_pixels(window)
    assert lobe is not None and albedo is not None and board.slice is None  # the slice is not on screen
    dark = Operator("amplify", "y", 0.0, 0.0, math.pi / 2, math.pi / 2, magnitude=-0.3)
    editor.do(SetOperators("teapot.1", "theta_h", (dark,)))
    board = settled(window)
    gain = editor.document.layer("teapot.1").curve("theta_h")(np.array([0.2])) / (
        editor.document.layer("teapot.1").generated_curve("theta_h")(np.array([0.2]))
    )
    assert board.lobe is not None and board.lobe.values == pytest.approx(lobe.values * gain, rel=1e-3)
    assert board.albedo is not None and board.albedo.equivalent == pytest.approx(albedo.equivalent * gain[0], rel=1e-3)
    assert sphere_pixels(window)[..., :3].sum() < sphere[..., :3].sum()
    editor.undo()
    assert settled(window).lobe.values == pytest.approx(lobe.values)


def test_a_panel_of_another_height_shows_a_sphere_of_its_own_in_every_frame(window: HeadlessWindow) -> None:
    board = settled(window)
    side = board.sphere_side
    for height in (440, 600):
        window.resize((960, height))
        window.frames(12)  # a texture that this frame's panels draw must not be freed before they are drawn
    assert board.sphere_side == side and settled(window).sphere is not None


def test_the_light_of_the_lobe_is_dragged(window: HeadlessWindow) -> None:
    settled(window)
    x, y = window.shell.handle_position("brdf.light")
    window.drag((x, y), (x - 20, y + 40))
    editor = window.shell.editor
    assert editor.view.lobe_angle > math.radians(60) and not editor.history.undo_label
    board = settled(window)
    assert board.lobe is not None and board.lobe.theta_i == editor.view.lobe_angle
    window.click_handle("brdf.log.0")
    assert editor.view.lobe_log


def test_slice_and_albedo_are_asked_for_by_their_buttons(window: HeadlessWindow) -> None:
    window.click_handle("brdf.plot.1")
    board = settled(window)
    assert board.slice is not None and window.shell.editor.view.brdf_plot == "slice"
    assert board.slice_value(0.05, 0.3)[0] > board.slice_value(0.8, 0.3)[0] > 0.0
    window.move(*window.shell.handle_position("brdf.slice"))  # a tooltip with the value, no trouble
    window.click_handle("brdf.plot.2")
    settled(window)
    window.move(*window.shell.handle_position("brdf.albedo"))
    window.click_handle("brdf.whole.0")
    whole, alone = settled(window).albedo, None
    window.click_handle("brdf.whole.0")
    alone = settled(window).albedo
    assert whole is not None and alone is not None
    base = window.shell.editor.document.layer("teapot.0").scale()  # a diffuse one: its albedo
    assert whole.equivalent == pytest.approx(alone.equivalent + base, rel=5e-3)


def test_anisotropic_layers_have_two_planes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    settled(window)
    assert "brdf.across.0" not in window.shell.handles.names()
    editor.do(SetModel("teapot.1", "ashikhmin_shirley"))
    along = settled(window).lobe
    window.click_handle("brdf.across.0")
    across = settled(window).lobe
    assert along is not None and across is not None and across.azimuth == pytest.approx(math.pi / 2)
    # n_v is ten times n_u: narrower across, as high in the mirror direction.
    assert across.values.max() == pytest.approx(along.values.max(), rel=0.2)
    assert np.trapezoid(across.values[:, 0], across.angles) < 0.6 * np.trapezoid(along.values[:, 0], along.angles)


def test_light_from_nowhere_is_warned_of(window: HeadlessWindow) -> None:
    settled(window)
    window.frame()
    assert "brdf.warning" not in window.shell.handles.names()
    window.shell.editor.do(SetParameter("teapot.1", "scale", 3.0))
    settled(window)
    window.frame()
    assert "brdf.warning" in window.shell.handles.names()


def test_the_warning_in_words() -> None:
    angles = np.radians([10.0, 50.0, 89.0])
    quiet = Albedo(angles, np.array([[0.9] * 3, [1.01] * 3, [5.0] * 3]), np.full(3, 0.9))  # 5: quadrature at grazing
    assert energy_warning(quiet) == ""
    loud = Albedo(angles, np.array([[0.9] * 3, [0.5, 1.31, 1.0], [0.2] * 3]), np.full(3, 0.9))
    assert energy_warning(loud) == "1.31× at 50°"


def test_a_closed_panel_costs_nothing(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    settled(window)
    editor.do(OpenPanel("brdf", False))
    window.frames(2)
    made = window.shell._brdf._n_made
    editor.do(SetParameter("teapot.1", "alpha", 0.3))
    settled(window)
    assert window.shell._brdf._n_made == made
    window.key(imgui.Key.b, imgui.Key.mod_shift)
    assert editor.view.panel_open("brdf")
    settled(window)
    assert window.shell._brdf._n_made > made


def test_a_hand_at_work_leaves_most_of_the_time_to_the_picture(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    settled(window)
    editor.begin_drag()
    window.shell._brdf._paused_until = math.inf  # a part that took long has just been made
    made = window.shell._brdf._n_made
    editor.do(SetParameter("teapot.1", "alpha", 0.3))
    assert window.frame().busy and window.shell._brdf._n_made == made
    editor.end_drag()
    settled(window)
    assert window.shell._brdf._n_made > made


def test_what_was_measured_is_shown_once_it_is_here(window: HeadlessWindow) -> None:
    client, editor = window.shell.editor._client, window.shell.editor
    assert isinstance(client, StandInClient)
    file, samples = Path("/drawn.binary"), np.maximum(analytic_samples(), 0.0)
    measurement = replace(drawn_measurement(), file=str(file))
    editor.do(SetMaterial("teapot", with_measurements(measured_layers(file), {str(file): measurement}), "drawn"))
    editor.do(SetView.of(brdf_whole=True))
    board = settled(window)
    window.frame()
    curves, sphere = board.lobe, sphere_pixels(window)
    assert board.curves_alone and "brdf.curves_alone" in window.shell.handles.names() and curves is not None
    asked = [request for request in client.requests if isinstance(request, FetchTable)]
    assert [(each.file, each.number) for each in asked] == [(str(file), 5)]
    client.say(TableFetched(measurement, samples, id=asked[0].id))
    for _ in range(100):  # uploaded between frames, in pieces as there is time
        window.poll()
        if not settled(window).curves_alone:
            break
    window.frame()
    assert not board.curves_alone and "brdf.curves_alone" not in window.shell.handles.names()
    lobe = board.lobe
    assert lobe is not None and not np.allclose(lobe.values, curves.values, rtol=0.1)
    wo = np.stack([np.sin(lobe.angles), np.zeros_like(lobe.angles), np.cos(lobe.angles)], axis=1)
    wi = np.broadcast_to([-math.sin(lobe.theta_i), 0.0, math.cos(lobe.theta_i)], wo.shape)
    assert lobe.values == pytest.approx(evaluate_table(samples, wi, wo), rel=1e-3)
    assert np.abs(sphere_pixels(window) - sphere).max() > 10


def test_a_table_without_room_is_reported(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    client, editor = window.shell.editor._client, window.shell.editor
    assert isinstance(client, StandInClient)
    measurement = replace(drawn_measurement(), file="/large.binary", number=7)
    layers = with_measurements(measured_layers(Path("/large.binary"), cloth=True), {"/large.binary": measurement})
    monkeypatch.setattr(window.shell._tables.tables._memory, "limit", 1 << 20)
    editor.do(SetMaterial("teapot", layers, "large"))
    settled(window)
    asked = [request for request in client.requests if isinstance(request, FetchTable)][-1]
    client.say(TableFetched(measurement, np.zeros((90, 90, 180, 3), np.float32), id=asked.id))
    board = window.shell._brdf_board
    for _ in range(100):  # taken between frames, where a slow one leaves time for it
        window.poll()
        if settled(window).why_alone:
            break
    assert board.curves_alone and "17 MiB of texture" in board.why_alone and not window.shell.awaits_table


def test_a_table_that_cannot_be_had_is_reported(window: HeadlessWindow) -> None:
    client, editor = window.shell.editor._client, window.shell.editor
    assert isinstance(client, StandInClient)
    measurement = replace(drawn_measurement(), file="/gone.binary", number=6)
    layers = with_measurements(measured_layers(Path("/gone.binary"), cloth=True), {"/gone.binary": measurement})
    editor.do(SetMaterial("teapot", layers, "gone"))
    settled(window)
    asked = [request for request in client.requests if isinstance(request, FetchTable)][-1]
    client.say(RequestFailed("/gone.binary: cannot be read", id=asked.id))
    board = settled(window)
    assert board.curves_alone and board.why_alone == "/gone.binary: cannot be read" and board.lobe is not None


def test_nothing_selected_shows_nothing(window: HeadlessWindow) -> None:
    window.shell.editor.select(None)
    board = settled(window)
    assert board.sphere is None and board.lobe is None
    window.shell.editor.select("tray")
    assert settled(window).sphere is not None


def test_regions_of_the_curve_around_the_lobe() -> None:
    # Light at 0.5: theta_h from 0.1 to 0.2 is the eye 0.2 to 0.4 from the mirror direction, on both sides.
    arcs = arcs_of_region("theta_h", 0.5, 0.1, 0.2)
    assert sorted(arcs) == [pytest.approx((0.1, 0.3)), pytest.approx((0.7, 0.9))]
    assert arcs_of_region("theta_o", 0.5, 1.5, 1.7)[0] == pytest.approx((1.5, math.pi / 2))
    assert arcs_of_region("gamma_beta", 0.5, 0.1, 0.2) == []


def test_logarithmic_radii_show_four_decades() -> None:
    values = np.array([10.0, 1.0, 1e-3, 1e-6, 0.0])
    assert radii(values, 10.0, True) == pytest.approx([1.0, 0.75, 0.0, 0.0, 0.0])
    assert radii(values, 10.0, False)[:2] == pytest.approx([1.0, 0.1])


def test_view_keeps_the_lobe_above_the_horizon(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(lobe_angle=3.0))
    assert window.shell.editor.view.lobe_angle < math.pi / 2


@pytest.mark.parametrize("width", [120.0, 180.0, 260.0, 400.0])
@pytest.mark.parametrize("height", [110.0, 160.0, 220.0, 500.0])
def test_the_figures_of_albedo_do_not_reach_into_the_plot(width: float, height: float) -> None:
    context = SimpleNamespace(px=lambda size: size)
    places = _places(context, ImVec2(10.0, 20.0), ImVec2(width, height))  # type: ignore[arg-type]
    figures, plot = places.figures, places.plot
    # In a line: two lines of 15 pixels. Else three numbers of 30 and their gaps across, four lines down.
    wide, high = (0.0, 30.0) if places.in_line else (98.0, 60.0)
    assert figures.x + wide <= plot.x or figures.y + high <= plot.y
