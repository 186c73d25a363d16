"""Emitters that a person dims and tints: the document, what is asked of the worker, and what may follow at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands.layers import SetFrozen
from app.document.commands.light import SetEmission
from app.document.document import Document, Selection
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.modes.placement.desired_state import brightening_factors
from app.modes.placement.placement_messages import ComputeTransport
from app.project.assignments import set_path
from app.project.project import open_project
from engine.core.errors import InsituError
from tests.app.fake_worker import SCENE, FakeClient
from tests.scene_text import camera, facing_up, material, placed

DARK: dict[str, Any] = {key: value for key, value in SCENE.items() if key != "environment"}
TWO: dict[str, Any] = {
    **DARK,
    "object": [*DARK["object"], {"name": "strip", "primitive": "quad", "emission": [1.0, 2.0, 4.0]}],
}


def settled(client: FakeClient, scene: dict[str, Any]) -> Editor:
    """An editor at time 1 with the final picture of a scene."""
    editor = Editor(client, "shelf")
    client.open_scene(scene)
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    client.requests.clear()
    return editor


def gain(editor: Editor) -> list[float]:
    """How much brighter the picture is drawn than it was computed."""
    return (editor.controller.picture.gain("floor.0") / editor.document.layer("floor.0").scale()).tolist()


def test_emission_is_three_numbers_or_one(document: Document) -> None:
    assert set_path(document, "lamp.emission", 3).apply(document).object("lamp").emission == (3.0, 3.0, 3.0)
    assert SetEmission("lamp", [1, 2, 3]).apply(document).object("lamp").emission == (1.0, 2.0, 3.0)
    black = SetEmission("lamp", 0.0).apply(document)
    assert black.object("lamp").emits  # it is an emitter that is off, not a surface


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("lamp.emission", -1, "emission = -1, expected a number or three from 0 to 1e+09"),
        ("lamp.emission", [1, 2], "emission = [1, 2], expected"),
        ("lamp.emission", float("nan"), "emission = nan, expected"),
        ("lamp.emission", "white", "emission = 'white', expected"),
        ("pot.emission", 1, "pot is not an emitter"),
        ("lamp.emissions", 1, "there is no"),
    ],
)
def test_what_is_no_emission_is_refused_in_a_line(document: Document, path: str, value: Any, says: str) -> None:
    with pytest.raises(InsituError) as refused:
        set_path(document, path, value).apply(document)
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_a_frozen_emitter_stays_as_it_is(document: Document) -> None:
    frozen = SetFrozen("lamp", True).apply(document)
    with pytest.raises(InsituError, match="thaw"):
        SetEmission("lamp", 2.0).apply(frozen)


def test_a_session_keeps_the_light(document: Document, tmp_path: Path) -> None:
    edited = SetEmission("lamp", (4.0, 2.0, 0.0)).apply(document)
    session = load_session(save_session(tmp_path / "s.insitu", edited, ViewState()))
    assert fit_session(session, document, "s.insitu") == edited


def test_an_emitter_is_selected_as_it_is(client: FakeClient) -> None:
    editor = settled(client, SCENE)
    assert editor.select("lamp") is None
    assert editor.view.selected == Selection("lamp", 0)
    editor.do(SetEmission("lamp", 1.0))
    assert editor.undo() == "lamp emission"
    assert editor.view.selected == Selection("lamp", 0)
    assert editor.select(editor.view.selected) is None
    assert editor.exchange.export_measured(Path("x.binary")) is not None  # there is no material to write
    editor.tick(2.0)
    assert editor.controller.picture.edited_layers == ()


def test_beside_a_sky_light_is_computed_quickly_and_then_exactly(client: FakeClient) -> None:
    editor = settled(client, SCENE)
    editor.begin_drag()
    for strength in (6.0, 7.0):
        editor.do(SetEmission("lamp", strength))
        editor.tick(2.0 + 0.01 * strength)
    (quick,) = client.sent(ComputeTransport)
    assert quick.is_drag and dict(quick.scene.emission) == {"lamp": (6.0, 6.0, 6.0)}
    assert editor.status.emitter_note.startswith("a preview")
    assert gain(editor) == [1.0, 1.0, 1.0]
    client.finish_stage("drag", exact=True)
    editor.end_drag()
    editor.tick(2.5)
    last = client.sent(ComputeTransport)[-1]
    assert not last.is_drag and dict(last.scene.emission) == {"lamp": (7.0, 7.0, 7.0)}
    client.finish_stage("final", exact=True)
    editor.tick(3.0)
    assert editor.status.emitter_note == ""


def test_the_only_light_follows_at_once(client: FakeClient) -> None:
    editor = settled(client, DARK)
    editor.do(SetEmission("lamp", (10.0, 2.5, 0.0)))
    editor.tick(2.0)
    editor.tick(3.0)
    assert client.sent(ComputeTransport) == []
    # It was 5 in each channel.
    assert gain(editor) == pytest.approx([2.0, 0.5, 0.0])
    assert editor.status.emitter_note.startswith("the scene's only light")
    editor.undo()
    editor.tick(4.0)
    assert gain(editor) == [1.0, 1.0, 1.0]
    assert client.sent(ComputeTransport) == []


def test_one_of_two_lights_is_computed_anew_and_both_alike_are_not(client: FakeClient) -> None:
    editor = settled(client, TWO)
    editor.do(SetEmission("lamp", 10.0))
    editor.do(SetEmission("strip", (2.0, 4.0, 8.0)))
    editor.tick(2.0)
    editor.tick(3.0)
    assert client.sent(ComputeTransport) == []
    assert gain(editor) == pytest.approx([2.0, 2.0, 2.0])
    editor.do(SetEmission("strip", 1.0))
    editor.tick(4.0)
    editor.tick(5.0)
    (asked,) = client.sent(ComputeTransport)
    assert dict(asked.scene.emission) == {"lamp": (10.0, 10.0, 10.0), "strip": (1.0, 1.0, 1.0)}
    assert gain(editor) == pytest.approx([2.0, 2.0, 2.0])  # the picture of both alike stays until the next is there
    client.finish_stage("final", exact=True)
    editor.tick(6.0)
    assert gain(editor) == [1.0, 1.0, 1.0]


def test_a_light_that_was_off_is_computed(client: FakeClient) -> None:
    scene = json.loads(json.dumps(DARK))
    scene["object"][2]["emission"] = [5.0, 0.0, 0.0]
    editor = settled(client, scene)
    editor.do(SetEmission("lamp", (5.0, 1.0, 0.0)))
    editor.tick(2.0)
    editor.tick(3.0)
    assert len(client.sent(ComputeTransport)) == 1


def test_factors_are_those_of_all_emitters_or_none() -> None:
    one = (("a", (1.0, 2.0, 0.0)), ("b", (3.0, 0.0, 0.0)))
    twice = (("a", (2.0, 2.0, 0.0)), ("b", (6.0, 0.0, 0.0)))
    factors = brightening_factors(twice, one)
    assert factors is not None
    np.testing.assert_allclose(factors, [2.0, 1.0, 1.0])  # a sky keeps its blue beside lamps without
    dark = (("a", (0.0, 0.0, 0.0)),)
    np.testing.assert_array_equal(brightening_factors(dark, dark), np.ones(3))
    assert brightening_factors((("a", (0.0, 0.0, 1.0)),), dark) is None
    np.testing.assert_array_equal(brightening_factors(dark, one[:1]), [0.0, 0.0, 1.0])
    assert brightening_factors((("a", (2.0, 2.0, 0.0)), ("b", (3.0, 0.0, 0.0))), one) is None
    assert brightening_factors(twice[:1], one) is None
    assert brightening_factors((), ()) is None


def test_stills_and_the_reference_shine_as_the_document(tmp_path: Path) -> None:
    file = tmp_path / "dark.toml"
    floor = placed("floor", "quad", more=material('model = "lambert", name = "paint"'))
    lamp = placed("lamp", "quad", facing_up(1, (0, 2, 0)), "emission = [5, 5, 5]\n")
    file.write_text(camera((0, 1, 4), 40, (8, 6), head='name = "dark"\n') + floor + lamp)
    scene = open_project(str(file), values=[("lamp.emission", [1, 2, 3])]).scene
    assert scene.emission.tolist() == [[0, 0, 0], [1, 2, 3]]
    off = open_project(str(file), values=[("lamp.emission", 0)]).scene
    assert off.emitters.tolist() == [False, True] and not off.emission.any()
