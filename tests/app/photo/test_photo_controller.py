"""Matching a picture in the editor: one answer is one step, and what comes too late changes nothing."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import EditCommand
from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetEditable, SetFrozen, SetMaterial, SetParameter, SetVisible
from app.document.commands.light import SetIntensity, SetRotation
from app.document.commands.mix import SetMix
from app.document.commands.several import Several
from app.document.document import Document
from app.document.view_state import Viewpoint
from app.editor.editor import Editor
from app.files.materials import Library
from app.photo.match_refusal import match_refusal
from app.photo.match_settings import (
    LIGHT_FILE,
    MatchAnswer,
    MatchSettings,
    PhotoPair,
    default_settings,
    dump_answer,
    load_answer,
    load_settings,
    possible_targets,
    with_object,
    with_start,
)
from app.photo.photo_controller import PhotoController
from app.photo.photo_request import MOST_SIDE
from engine.core.errors import InsituError
from engine.curve.tables import TabulatedCurve
from engine.inverse.photo_targets import Target
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.material.layer_maps import ChannelImage
from engine.material.parameter_maps import ParameterMap
from tests.app.fake_matcher import FakeMatcher
from tests.app.fake_worker import FakeClient

FILE = Path("/photos/cup.png")
WORN = ParameterMap("alpha", ChannelImage("rough.png"), 0.1, 0.5)


Matcher = FakeMatcher[MatchSettings, MatchAnswer]


def glossy(document: Document) -> tuple[str, int]:
    """An object, and the number of a layer of it that has a roughness."""
    for state in document.objects:
        for i, layer in enumerate(state.layers):
            if "alpha" in layer.values and layer.model.curve_names and state.editable:
                return state.name, i
    raise AssertionError


def answer_for(document: Document, alpha: float = 0.3) -> MatchAnswer:
    name, i = glossy(document)
    curve = document.object(name).layers[i].model.factors[0].name
    table = TabulatedCurve((0.1, 0.5), ((1.0, 2.0, 3.0), (0.5, 0.25, 0.125)), kind="change")
    edit = Several(
        (SetParameter(f"{name}.{i}", "alpha", alpha), SetOperators(f"{name}.{i}", curve, (table,))), f"match {name}"
    )
    deviations = {Target(i, curve): np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])}
    return MatchAnswer(edit, 0.5, 0.01, 0.2, ("a note",), deviations, np.ones((2, 3, 4), np.float32))


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    return editor


@pytest.fixture
def matcher() -> Matcher:
    return Matcher()


@pytest.fixture
def matching(editor: Editor, matcher: Matcher) -> PhotoController:
    return PhotoController(editor, matcher)


def settings_for(editor: Editor) -> MatchSettings:
    name, _ = glossy(editor.document)
    return default_settings(editor.document, name, FILE)


def test_the_process_gets_the_document_with_the_maps_of_other_objects(
    editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    """Not their nodes, which a session does not have."""
    name, _ = glossy(editor.document)
    other = next(each for each in editor.document.objects if each.name != name and each.layers and each.editable)
    rough = make_layer(MODELS["rough_conductor"]).replace(name="worn", parameter_maps=(WORN,))
    assert editor.do(SetMaterial(other.name, (rough,))) is None
    matching.begin(settings_for(editor))
    assert matcher.document is editor.document
    assert matcher.document.object(other.name).layers[0].parameter_maps == (WORN,)


def test_an_answer_is_one_step_with_the_photograph_to_compare(
    editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    before, (name, i) = editor.document, glossy(editor.document)
    matching.begin(settings_for(editor))
    assert matching.progress == "matching cup.png 40%" and not matching.follow()
    answer = answer_for(editor.document)
    matcher.end(answer)
    assert matching.follow() and not matching.progress
    assert editor.document.object(name).layers[i].values["alpha"] == 0.3
    assert editor.view.stored == FILE.name and editor.stored.compared is not None
    assert "error 20 % before, 1 % now, exposure 0.5; a note" in editor.status.message
    curve = editor.document.object(name).layers[i].model.factors[0].name
    assert matching.found is not None
    shown = matching.found.deviation(editor.document, f"{name}.{i}", curve)
    np.testing.assert_array_equal(shown, answer.deviations[Target(i, curve)])
    assert matching.found.deviation(editor.document, f"{name}.{i}", "other") is None
    # One step; and the curve is no longer what was found.
    assert editor.undo_label == f"match {name}" and editor.undo() is not None and editor.document == before
    assert matching.found.deviation(editor.document, f"{name}.{i}", curve) is None
    editor.redo()
    assert matching.found.deviation(editor.document, f"{name}.{i}", curve) is not None


def test_an_object_that_was_edited_meanwhile_stays_and_others_may_be(
    editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    name, i = glossy(editor.document)
    matching.begin(settings_for(editor))
    editor.do(SetIntensity(2.0))
    matcher.end(answer_for(editor.document))
    assert matching.follow() and editor.document.object(name).layers[i].values["alpha"] == 0.3
    assert editor.document.light.intensity == 2.0
    matching.begin(settings_for(editor))
    editor.do(SetParameter(f"{name}.{i}", "alpha", 0.7))
    matcher.end(answer_for(editor.document, 0.4))
    assert matching.follow() and editor.document.object(name).layers[i].values["alpha"] == 0.7
    assert editor.status.is_error and "was edited while it was matched" in editor.status.message


def test_an_answer_does_not_become_part_of_a_drag(editor: Editor, matching: PhotoController, matcher: Matcher) -> None:
    name, i = glossy(editor.document)
    matching.begin(settings_for(editor))
    matcher.end(answer_for(editor.document))
    editor.begin_drag("light")
    editor.do(SetIntensity(3.0))
    assert not matching.follow() and matching.progress == "matched cup.png"
    with pytest.raises(InsituError, match="still being matched"):
        matching.begin(settings_for(editor))
    editor.end_drag()
    assert matching.follow() and editor.undo_label == f"match {name}"


def test_what_was_stopped_changes_nothing(editor: Editor, matching: PhotoController, matcher: Matcher) -> None:
    before = editor.document
    matching.begin(settings_for(editor))
    with pytest.raises(InsituError, match="still being matched"):
        matching.begin(settings_for(editor))
    matcher.end(answer_for(editor.document))  # just before it is stopped
    matching.stop()
    matching.begin(settings_for(editor))
    assert not matching.follow() and matching.progress and editor.document == before
    matcher.end(None, "cup.png: first bytes, expected a picture")
    assert matching.follow() and editor.status.is_error and "first bytes" in editor.status.message
    with pytest.raises(InsituError, match="choose what is to be found"):
        matching.begin(replace(settings_for(editor), targets=()))
    assert not matching.progress


def test_a_camera_that_is_refused_is_said_in_the_line(
    editor: Editor, matching: PhotoController, matcher: Matcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, i = glossy(editor.document)
    matching.begin(settings_for(editor))
    monkeypatch.setattr(editor.camera_history, "set_viewpoint", lambda *given: "3 x 2 is too large")
    matcher.end(replace(answer_for(editor.document), camera=editor.camera_history.own_camera, missed=(0.5,)))
    assert matching.follow() and editor.document.object(name).layers[i].values["alpha"] == 0.3
    assert editor.status.message.endswith("a note; the camera stays as it was: 3 x 2 is too large")


def test_another_scene_stops_it(
    client: FakeClient, editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    matching.begin(settings_for(editor))
    editor.open("bunny")
    client.open_scene()
    editor.tick(0.1)
    before = editor.document
    matching.follow()
    assert not matching.progress and matcher.settings is None and editor.document == before and matching.found is None


def test_a_drag_of_the_camera_keeps_what_was_aligned_out(
    editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    """The answer waits for the end of the drag, and is a step of the view's own."""
    matching.begin(settings_for(editor))
    cameras, before = editor.camera_history, editor.camera_history.camera
    found = before.model_copy(update={"position": (0.5, 1.0, 3.0)})
    dragged = before.model_copy(update={"position": (1.0, 1.0, 3.0)})
    cameras.begin_drag("orbit")
    cameras.drag_to(Viewpoint(dragged, None))
    matcher.end(replace(answer_for(editor.document), camera=found, missed=(0.5,)))
    assert not matching.follow() and matching.progress
    cameras.end_drag()
    assert matching.follow() and cameras.camera == found
    assert cameras.undo() is not None and cameras.camera == dragged
    assert cameras.undo() is not None and cameras.camera == before


def test_files_that_are_read_again_leave_a_match_alone(
    client: FakeClient, editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    name, i = glossy(editor.document)
    matching.begin(settings_for(editor))
    editor.scenes.reload()
    client.open_scene()
    editor.tick(0.1)
    assert not matching.follow() and matching.progress
    matcher.end(answer_for(editor.document))
    assert matching.follow() and editor.document.object(name).layers[i].values["alpha"] == 0.3


@pytest.mark.parametrize("is_edited", [False, True])
def test_light_that_was_edited_meanwhile_stays(
    editor: Editor, matching: PhotoController, matcher: Matcher, is_edited: bool
) -> None:
    name, i = glossy(editor.document)
    matching.begin(replace(settings_for(editor), finds_rotation=True))
    if is_edited:
        editor.do(SetRotation(77.0))
    answer = answer_for(editor.document)
    commands = (SetRotation(30.0), *answer.edit.commands)
    matcher.end(replace(answer, edit=replace(answer.edit, commands=commands)))
    assert matching.follow()
    assert editor.document.light.rotation == (77.0 if is_edited else 30.0)
    assert editor.document.object(name).layers[i].values["alpha"] == 0.3
    assert ("the light stays as it was edited" in editor.status.message) == is_edited


def test_settings_and_answers_survive_their_journey_and_others_are_refused(editor: Editor, tmp_path: Path) -> None:
    settings = replace(
        settings_for(editor), transfer="2.2", exposure=0.25, pairs=(PhotoPair((0.1, 0.9), (1.0, 2.0, 3.0)),),
        finds_rotation=True, finds_lights=True, mask=Path("/photos/mask.png"),
    )  # fmt: skip
    assert load_settings(settings.dump()) == settings
    gold = Library().entry("Gold").material.layers
    begun = with_start(settings, editor.document, "Gold", gold)
    # The process has them in its document.
    assert load_settings(begun.dump()) == replace(begun, start="", start_layers=())
    assert [each.model for each in begun.begun(editor.document).object(begun.object).layers] == [g.model for g in gold]
    assert with_start(begun, editor.document, "", ()) == with_object(settings, editor.document, settings.object)
    answer = answer_for(editor.document)
    light = SetRotation(30.0), SetMix("light.environment", "strength", -1.0)
    answer = replace(answer, edit=replace(answer.edit, commands=(*light, *answer.edit.commands)))
    answer = replace(answer, camera=editor.camera_history.own_camera, missed=(0.5, 2.0))
    text = dump_answer(answer, tmp_path)
    assert len(text) < 4096  # the light is not in it
    found = load_answer(text, tmp_path)
    assert found.edit == answer.edit and found.notes == answer.notes and found.exposure == answer.exposure
    np.testing.assert_array_equal(found.light, answer.light)
    assert found.camera == answer.camera and found.missed == answer.missed
    assert found.deviations.keys() == answer.deviations.keys()
    tree = json.loads(text)
    for faulty in (
        None, {}, {**tree, "exposure": float("nan")}, {**tree, "extra": 1},
        {**tree, "curves": [{"key": "a.0", "factor": "b", "operators": [{"kind": "curve"}]}]},
    ):  # fmt: skip
        with pytest.raises(InsituError, match="cannot be read"):
            load_answer(json.dumps(faulty), tmp_path)
    file = tmp_path / LIGHT_FILE
    whole = file.read_bytes()
    for light in (
        np.ones((2, 3, 4)), np.ones((2, 3, 3), np.float32), np.ones((2, 3), np.float32), np.float32(1.0),
        np.ones((0, 3, 4), np.float32), np.ones((1, MOST_SIDE + 1, 4), np.float32), np.array([{}], object),
    ):  # fmt: skip
        np.save(file, np.asarray(light))
        with pytest.raises(InsituError, match="cannot be read"):
            load_answer(text, tmp_path)
    for content in (b"", b"not an array", whole[:-1]):
        file.write_bytes(content)
        with pytest.raises(InsituError, match="cannot be read"):
            load_answer(text, tmp_path)
    file.unlink()
    with pytest.raises(InsituError, match="cannot be read"):
        load_answer(text, tmp_path)
    np.save(file, np.full((2, 3, 4), np.inf, np.float32))
    assert not load_answer(text, tmp_path).light.any()


def test_what_is_found_by_default_can_be_chosen(editor: Editor) -> None:
    for state in editor.document.objects:
        chosen = default_settings(editor.document, state.name, FILE).targets
        assert set(chosen) <= {f"{t.layer}.{t.name}" for t in possible_targets(state.layers)}


def test_what_cannot_be_matched_is_refused_before_it_begins(
    editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    settings, (name, i) = settings_for(editor), glossy(editor.document)
    layers = editor.document.object(name).layers
    keys = [f"{name}.{n}" for n, _ in enumerate(layers)]
    assert match_refusal(editor.document, settings) == "" and len(layers) > 1
    assert {each.partition(".")[0] for each in settings.targets} == {str(n) for n, _ in enumerate(layers)}
    cases: dict[str, tuple[EditCommand, ...]] = {
        f"{name} is fixed; make it editable to change its material": (SetEditable(name, False),),
        f"{name} is frozen; thaw it to change its material": (SetFrozen(name, True),),
        f"{name} is hidden; show it to match its material": (SetVisible(name, False),),
        f"{name} has no layer that can be edited; thaw one to match it": tuple(SetFrozen(key, True) for key in keys),
        f"{name} has no visible layer that can be matched": tuple(SetVisible(key, False) for key in keys),
        f"{name}.{i} is frozen; thaw it, or find nothing of it": (SetFrozen(f"{name}.{i}", True),),
        f"{name} has parameters that vary over its surface; expected the same everywhere": (
            SetMaterial(name, tuple(replace(each, parameter_maps=(WORN,)) for each in layers[i : i + 1])),
        ),
    }  # fmt: skip
    for line, commands in cases.items():
        for command in commands:
            assert editor.do(command) is None
        assert match_refusal(editor.document, settings) == line
        with pytest.raises(InsituError) as refused:
            matching.begin(settings)
        assert str(refused.value) == line and matcher.settings is None and not matching.progress
        for _ in commands:
            editor.undo()
    assert match_refusal(editor.document, replace(settings, object="gone")) == "gone is gone; choose another object"
    none_there = replace(settings, targets=("7.scale",))
    assert "choose what is to be found" in match_refusal(editor.document, none_there)
    # Of a frozen layer nothing is found by default.
    editor.do(SetFrozen(f"{name}.{i}", True))
    chosen = default_settings(editor.document, name, FILE)
    assert chosen.targets and not any(each.startswith(f"{i}.") for each in chosen.targets)
    assert match_refusal(editor.document, chosen) == ""


@pytest.mark.parametrize("seed", range(12))
def test_any_sequence(
    seed: int, client: FakeClient, editor: Editor, matching: PhotoController, matcher: Matcher
) -> None:
    """Whatever happens in whatever order: an answer is applied once at most, to the layers that it was found for, and
    as one step."""
    rng = random.Random(seed)
    name, i = glossy(editor.document)
    layers_then, applied = None, 0

    def alpha() -> float:
        return float(editor.document.object(name).layers[i].values["alpha"])

    for _ in range(60):
        match rng.choice(("begin", "end", "fail", "stop", "edit", "undo", "redo", "follow", "follow", "drag", "light")):
            case "begin" if not matching.progress:
                matching.begin(settings_for(editor))
                layers_then = editor.document.object(name).layers
            case "end":
                matcher.end(answer_for(editor.document, 0.2 + 0.001 * matcher.n_begun))
            case "fail":
                matcher.end(None, "cup.png: it cannot be read")
            case "stop":
                matching.stop()
                assert matcher.settings is None and not matcher.ended
            case "edit":
                editor.do(SetParameter(f"{name}.{i}", "alpha", rng.uniform(0.5, 0.9)))
            case "undo":
                editor.undo()
            case "redo":
                editor.redo()
            case "drag":
                (editor.end_drag if editor.history.dragging else editor.begin_drag)()
            case "light":
                editor.do(SetIntensity(rng.uniform(0.5, 2.0)))
            case "follow":
                before, n_waiting = editor.document, len(matcher.ended)
                is_same = before.object(name).layers == layers_then
                applies = bool(n_waiting) and matcher.ended[0].answer is not None and not editor.history.dragging
                matching.follow()
                if applies and is_same:
                    assert editor.undo_label == f"match {name}" or before == editor.document
                    assert alpha() == 0.2 + 0.001 * matcher.n_begun
                    applied += 1
                else:
                    assert editor.document == before
        assert bool(matching.progress) == (matcher.settings is not None or bool(matcher.ended))
        assert applied <= matcher.n_begun
