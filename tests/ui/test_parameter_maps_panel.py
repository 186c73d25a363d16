"""Parameters that vary over the surface in the window: the rows of their maps, and the curves of their nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.maps import SetMap, SetParameterMap
from app.messages.file_messages import ReadChannels
from app.modes.placement.placement_messages import MapsSampled, SampleMaps
from engine.curve.operators import Operator
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage, FurtherWeight, MapMeans
from tests.app.channel_answers import channels_read
from tests.ui.stand_in import StandInClient, scene_frame
from ui.brdf_feed import shown_layers
from ui.headless import HeadlessWindow
from ui.panels.file_dialog import answer
from ui.panels.window_state import PanelState

pytestmark = pytest.mark.gl


def coat(window: HeadlessWindow) -> Layer:
    return window.shell.editor.document.layer("teapot.1")


def read_images(window: HeadlessWindow) -> None:
    """The stand-in's worker reads the images asked for: ramps; it samples nodes as one half everywhere."""
    client = window.shell.editor._client
    assert isinstance(client, StandInClient)
    window.frames(2)
    request = next(r for r in reversed(client.requests) if isinstance(r, ReadChannels))
    client.say(channels_read(request, request.id))
    window.frames(2)
    asked = next((r for r in reversed(client.requests) if isinstance(r, SampleMaps)), None)
    for key, images in () if asked is None else asked.layers:
        start, stop = scene_frame().object_ranges[0]
        samples = np.full((int(stop - start), 4), 0.5, np.float16)
        client.say(MapsSampled(key, images, samples, MapMeans(), {}, id=asked.id))
    window.frames(3)


def test_a_map_is_chosen_changed_and_removed_by_its_rows(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.1")
    window.frames(2)
    window.click_handle("material.images.0")
    window.frames(2)
    window.click_handle("material.alpha_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_parameter_map", "teapot.1.alpha")
    (tmp_path / "worn.png").touch()
    actor.perform([answer(question, tmp_path / "worn.png")], window.shell.state, 0.0)
    window.shell.state = PanelState()
    read_images(window)
    (own,) = coat(window).parameter_maps
    assert own.image == ChannelImage(str(tmp_path / "worn.png")) and own.low < own.high
    assert "material.alpha" not in window.shell.handles.names()  # its rows are in place of the parameter's
    window.click_handle("material.alpha_map.channel")
    window.frames(2)
    window.click_handle("material.alpha_map.channel.g")
    window.frames(2)
    assert coat(window).parameter_maps[0].image.channel == "g"
    window.drag_handle("material.alpha_map.white", (-20, 0))
    window.frames(2)
    assert coat(window).parameter_maps[0].high < own.high and coat(window).parameter_maps[0].low == own.low
    window.click_handle("material.alpha_map.square.0")
    window.frames(2)
    assert coat(window).parameter_maps[0].response == "square"
    window.click_handle("button.clear_alpha_map")
    window.frames(2)
    assert coat(window).parameter_maps == ()
    for _ in range(5):
        editor.undo()
    assert coat(window).parameter_maps == () and editor.undo_label is None  # one step each


def test_the_curve_panel_shows_the_curve_of_each_node(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.1.theta_h")
    window.frames(2)
    assert "curve.node" not in window.shell.handles.names()
    editor.do(SetParameterMap("teapot.1", "alpha", {"map": "worn.png", "range": [0.1, 0.6]}))
    read_images(window)
    (count,) = editor.status.map_nodes
    assert "curve.node" in window.shell.handles.names() and count.n_nodes > 2

    def shown() -> float:
        return float(shown_layers(editor.document, editor.view, editor.status.map_nodes)[0].values["alpha"])  # type: ignore[arg-type]

    assert shown() == count.values[count.n_nodes // 2]
    window.click_handle("curve.node")
    window.frames(2)
    window.click_handle("curve.node.0")
    window.frames(2)
    assert editor.view.node == 0 and shown() == count.values[0]
    # An edit is one of all of them: the document's one layer has it.
    editor.do(AddOperator("teapot.1", "theta_h", Operator("amplify", "y", 0.0, 0.1, 0.3, 0.5, 2.0)))
    window.frames(2)
    nodes = [layer for layer in editor.with_nodes(editor.document).object("teapot").layers if layer.node_of]
    assert len(nodes) == count.n_nodes and all(layer.edits == coat(window).edits != () for layer in nodes)


def test_further_weight_maps_have_rows(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.0")
    editor.do(SetMap("teapot.0", "further_weights", (FurtherWeight(ChannelImage("share.png", "r")),)))
    window.frames(3)
    window.click_handle("material.further_0.0")
    window.frames(2)
    assert editor.document.layer("teapot.0").maps.further_weights[0].invert
    window.click_handle("button.clear_further_0")
    window.frames(2)
    assert editor.document.layer("teapot.0").maps.is_plain
