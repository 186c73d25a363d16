"""Whatever a person does, and however the answers come in, the talk with the worker ends with the right picture."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from app.document.commands.curves import AddOperator, ResetCurve
from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetEditable,
    SetFresnelTerm,
    SetMaterial,
    SetModel,
    SetParameter,
    SetVisible,
    new_layer,
)
from app.document.commands.light import SetEnvironment, SetIntensity, SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.plan import OverrideLine, active_overrides
from app.document.document import reflecting_layers
from app.document.effective_settings import effective_view
from app.document.light_mix import emission_of, mixed_light
from app.document.light_state import LightState, MixRow
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.files.session import load_session
from app.modes.placement.desired_state import DesiredTransport, same_coefficients
from app.modes.placement.placement_events import LayerRadiance, TransportReady
from app.modes.placement.placement_messages import ComputeTransport, ContractTransport, EstimateError
from app.modes.placement.placement_status import RenderReport
from engine.curve.operators import Operator
from engine.light.suns import Sun
from engine.settings import RenderSettings
from tests.app.fake_worker import ServingClient

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
ACTIONS: dict[str, Any] = {
    "edit": lambda editor: editor.do(AddOperator("pot.1", "theta_h", LIFT)),
    "edit other curve": lambda editor: editor.do(AddOperator("pot.1", "theta_d", LIFT)),
    "edit other object": lambda editor: editor.do(AddOperator("floor.0", "theta_i", LIFT)),
    "reset": lambda editor: editor.do(ResetCurve("pot.1", "theta_h")),
    "roughness": lambda editor: editor.do(SetParameter("pot.1", "alpha", 0.4)),
    "index": lambda editor: editor.do(SetParameter("pot.1", "eta", 1.7)),
    "model": lambda editor: editor.do(SetModel("pot.0", "phong")),
    "fewer curves": lambda editor: editor.do(SetModel("pot.1", "lambert")),
    "Fresnel term": lambda editor: editor.do(SetFresnelTerm("pot.1", True)),
    "no Fresnel term": lambda editor: editor.do(SetFresnelTerm("pot.1", False)),
    "edit the term": lambda editor: editor.do(AddOperator("pot.2", "theta_h", LIFT)),
    "select the term": lambda editor: editor.select("pot.2.theta_h"),
    "hide the term": lambda editor: editor.do(SetVisible("pot.2", False)),
    "another material": lambda editor: editor.do(SetMaterial("pot", (new_layer("ward"),))),
    "a layer more": lambda editor: editor.do(AddLayers("pot", (new_layer("schlick"),))),
    "a layer less": lambda editor: editor.do(RemoveLayer("pot.0")),
    "turn": lambda editor: editor.do(SetRotation(editor.document.light.rotation + 10.0)),
    "sky": lambda editor: editor.do(SetEnvironment("studio")),
    "dim": lambda editor: editor.do(SetIntensity(0.5)),
    "brighter lamp": lambda editor: editor.do(SetMix("lamp", "strength", 1.0)),
    "warmer sky": lambda editor: editor.do(SetMix("light.environment", "kelvin", 4000.0)),
    "lamp off or on": lambda editor: editor.do(SetMix("lamp", "on", not editor.document.light.row("lamp").on)),
    "solo or not": lambda editor: editor.do(SetMix("lamp", "solo", not editor.document.light.row("lamp").solo)),
    "group": lambda editor: editor.do(SetMix("lamp", "group", "Key")),
    "undo": lambda editor: editor.undo(),
    "redo": lambda editor: editor.redo(),
    "take hold": lambda editor: editor.begin_drag(),
    "let go": lambda editor: editor.end_drag(),
    "select θh": lambda editor: editor.select("pot.1.theta_h"),
    "select θd": lambda editor: editor.select("pot.1.theta_d"),
    "select θo": lambda editor: editor.select("floor.0.theta_o"),
    "select floor": lambda editor: editor.select("floor"),
    "select nothing": lambda editor: editor.select(None),
    "fix the pot": lambda editor: editor.do(SetEditable("pot", False)),
    "free the pot": lambda editor: editor.do(SetEditable("pot", True)),
    "fix the floor": lambda editor: editor.do(SetEditable("floor", False)),
    "half": lambda editor: editor.do(SetView.of(precision="half")),
    "float": lambda editor: editor.do(SetView.of(precision="float")),
    "few lights": lambda editor: editor.do(OverrideLine("lights", 600)),
    "more lights": lambda editor: editor.do(OverrideLine("lights", 5000)),
    "few bands": lambda editor: editor.do(OverrideLine("pot.1.theta_h", 16)),
    "few bands of the floor": lambda editor: editor.do(OverrideLine("floor.0.theta_i", 4)),
    "no sphere": lambda editor: editor.do(OverrideLine("sphere", 0)),
    "float by hand": lambda editor: editor.do(OverrideLine("precision", "float")),
    "edges by hand": lambda editor: editor.do(OverrideLine("edges", 4)),
    "as planned": lambda editor: [editor.do(OverrideLine(line, None)) for line, _ in editor.document.overrides],
    "open again": lambda editor: opened_again(editor),
    "rest": lambda editor: None,
}


def opened_again(editor: Editor) -> None:
    """Save the session and open it, where a scene is open."""
    if editor.scene_is_open and editor.scenes._opening is None:
        document = editor.document
        with tempfile.TemporaryDirectory() as folder:
            assert editor.save(Path(folder, "s.insitu")) is None
            assert load_session(Path(folder, "s.insitu")).document.overrides == document.overrides
            assert editor.open(str(Path(folder, "s.insitu"))) is None


class Renderer:
    """Keeps what a renderer would show: radiance is exact for its coefficients, the selected curve is stepped."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.shown: dict[str, dict[str, Any]] = {}
        self.curves: dict[str, tuple[str, str]] = {}

    def frame(self, now: float) -> None:
        for event in self.editor.tick(now):
            if isinstance(event, LayerRadiance):
                self.shown[event.key] = dict(event.coefficients)
            elif isinstance(event, TransportReady):
                precision = {np.float16: "half", np.float32: "float"}[event.coefficients_first.dtype.type]
                self.curves = {key: curve for key, curve in self.curves.items() if key in event.beside}
                self.curves[event.key] = event.factor, precision
        selected = self.editor.view.selected
        for key in self.editor.controller.picture.edited_layers:
            factor, _ = self.curves.get(key, ("", ""))
            if selected is not None and factor == selected.factor and key in self.shown:
                self.shown[key][factor] = self.editor.controller.picture.wanted_coefficients(key)[factor]
        self.editor.controller.rendered(RenderReport(exact=True))


def settle(editor: Editor, renderer: Renderer, now: float) -> float:
    """Frames until the picture is exact; what the clock says then."""
    for _ in range(400):
        now += 0.3
        renderer.frame(now)
        if editor.status.picture == "exact":
            break
    assert editor.status.picture == "exact"
    return now


def test_a_curve_selected_again_is_there_again() -> None:
    editor = Editor(ServingClient(0), "shelf")
    renderer, now = Renderer(editor), 0.0
    for path in ("pot.1.theta_h", "floor.0", "pot.1.theta_h", "floor.0", "pot.1.theta_d", "pot.1.theta_h"):
        editor.select(path)
        now = settle(editor, renderer, now)


def assert_estimate_is_of_the_picture(editor: Editor, client: ServingClient) -> None:
    """What is told of the picture's error was found for the layers and the transport that it has now."""
    if (estimate := editor.status.estimate) is None:
        return
    (asked,) = (request for request in client.sent(EstimateError) if request.id == estimate.direct)
    assert editor.status.is_finished and [(layer.key, layer.layer) for layer in asked.scene.visible] == list(
        reflecting_layers(editor.document)
    )
    assert asked.revision == client.sent(ComputeTransport)[-1].revision


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.lists(st.sampled_from(sorted(ACTIONS)), max_size=25), st.floats(0.001, 0.3))
def test_the_picture_comes_right(seed: int, actions: list[str], step: float) -> None:
    client = ServingClient(seed)
    editor = Editor(client, "shelf")
    renderer = Renderer(editor)
    now = 0.0
    for action in ["rest", "rest", *actions]:
        ACTIONS[action](editor)
        assert_estimate_is_of_the_picture(editor, client)
        now += step
        renderer.frame(now)
        assert_estimate_is_of_the_picture(editor, client)
    editor.end_drag()
    now = settle(editor, renderer, now)
    for key, _ in editor.document.layers():
        assert same_coefficients(renderer.shown[key], editor.controller.picture.wanted_coefficients(key)), key
    selected = editor.view.selected
    for key in editor.controller.picture.edited_layers:
        if selected is not None and selected.factor in editor.controller.picture.wanted_coefficients(key):
            view = effective_view(editor.view, editor.document)
            assert renderer.curves[key] == (selected.factor, view.settings.precision)
    (*_, request) = client.sent(ComputeTransport)
    assert request.settings == effective_view(editor.view, editor.document).settings.of_light
    for key, n_bands in active_overrides(editor.document).items():
        layer, _, factor = key.rpartition(".")
        if layer:
            assert len(editor.controller.picture.wanted_coefficients(layer)[factor]) == n_bands
    for _ in range(6):
        now += 0.3
        renderer.frame(now)
    assert editor.status.estimate is not None
    assert_estimate_is_of_the_picture(editor, client)
    n_requests = len(client.requests)
    for _ in range(20):
        now += 0.3
        renderer.frame(now)
    assert client.idle and len(client.requests) == n_requests  # and then it is quiet
    last = client.sent(ComputeTransport)[-1]
    fixed = {layer.key for layer in last.scene.layers if layer.fixed}
    assert fixed == {key for key, _ in editor.document.layers() if not editor.document.object(key[:-2]).editable}
    assert not last.is_drag
    assert (last.scene.light, last.scene.emission) == (
        replace(mixed_light(editor.document), intensity=1.0), emission_of(editor.document)
    )  # fmt: skip


def test_lights_that_were_made_ready_are_mixed_at_once() -> None:
    """An edit of the mix asks for a quick picture in the same frame, and for the last one when idle; before the worker
    is prepared, only for that."""
    client = ServingClient(3)
    editor = Editor(client, "shelf")
    renderer = Renderer(editor)
    now = settle(editor, renderer, 0.0)
    for prepared in (False, True):
        n_before = len(client.sent(ComputeTransport))
        editor.do(SetMix("lamp", "strength", 2.0 if prepared else 1.0))
        renderer.frame(now + 0.01)
        asked = client.sent(ComputeTransport)[n_before:]
        assert [request.is_drag for request in asked] == ([True] if prepared else [])
        now = settle(editor, renderer, now)
        asked = client.sent(ComputeTransport)[n_before:]
        assert [request.is_drag for request in asked] == ([True, False] if prepared else [False])
        assert asked[-1].scene.emission == emission_of(editor.document)
        for _ in range(12):  # rests until the worker is prepared
            now += 0.3
            renderer.frame(now)
    editor.do(SetParameter("floor.0", "albedo", 0.7))
    editor.do(SetMix("lamp", "strength", 3.0))
    n_before = len(client.sent(ComputeTransport))
    renderer.frame(now + 0.01)
    assert len(client.sent(ComputeTransport)) == n_before


def test_a_long_drag_does_not_flood_the_worker() -> None:
    client = ServingClient(1)
    editor = Editor(client, "shelf")
    renderer = Renderer(editor)
    for frame in range(100):
        renderer.frame(0.3 * frame)
    n_before = len(client.requests)
    editor.begin_drag()
    for frame in range(200):  # the index drives the curve that is not selected
        editor.do(SetParameter("pot.1", "eta", 1.0 + 0.001 * frame))
        renderer.frame(100.0 + 0.016 * frame)
    editor.end_drag()
    # This worker's answers to a contraction take one to three frames: a new one is asked for only after them.
    during = client.requests[n_before:]
    assert 10 < len(during) <= 150 and {type(request) for request in during} == {ContractTransport}


def test_only_a_turn_is_a_turn() -> None:
    wish = DesiredTransport(LightState(rotation=1.0), ())
    assert replace(wish, light=LightState(rotation=2.0)).moved_from(wish)
    suns = (Sun((0.0, 1.0, 0.0), (1.0, 1.0, 1.0), name="Noon"),)
    assert replace(wish, light=LightState(rotation=1.0, new_suns=suns)).moved_from(wish)
    assert not wish.moved_from(wish)
    # What lights reach is traced anew, and the picture stays meanwhile.
    linked = LightState(rotation=1.0).with_row("lamp", MixRow(excludes=("pot",)))
    assert not replace(wish, light=linked).moved_from(wish)
    assert replace(wish, light=replace(linked, rotation=2.0)).moved_from(replace(wish, light=linked))
    assert not replace(wish, light=LightState("studio", rotation=2.0)).moved_from(wish)
    assert not replace(wish, light=LightState(rotation=2.0), settings=RenderSettings(400)).moved_from(wish)
    assert not replace(wish, light=LightState(rotation=2.0), settings=RenderSettings(n_patches=20)).moved_from(wish)


def test_coefficients_are_the_same_to_a_millionth() -> None:
    one = {"theta_h": np.array([[1.0, 2.0, 0.0]])}
    assert same_coefficients(one, {"theta_h": one["theta_h"].astype(np.float32).astype(np.float64)})
    assert not same_coefficients(one, {"theta_h": np.array([[1.0, 2.001, 0.0]])})
    assert not same_coefficients(one, {"theta_h": np.array([[1.0, 2.0, 1e-9]])})
    assert not same_coefficients(one, {"theta_h": one["theta_h"], "theta_d": one["theta_h"]})
    assert not same_coefficients(one, {"theta_h": np.ones((2, 3))})
