"""Poses are a part of the document: their commands, their steps, what is kept of them, and what the worker is asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands import AddDeformer, EditCommand, MoveDeformer, RemoveDeformer, SetDeformer, SetPose, SetTime
from app.document.commands.poses import MAX_DEFORMERS
from app.document.document import Document
from app.document.timeline import visible_poses
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.editor.view_controller import REST_SECONDS
from app.files.session import dump_session, load_session, save_session
from app.files.session_fitting import fit_session, session_notes
from app.messages.worker_messages import RequestFailed, SetCamera
from app.operators.edits import Deform
from app.operators.script import Step, load_script
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.realtime.zonal_harmonics.pose import Deformation, Moment
from engine.scene.rig import Animation
from tests.app.fake_worker import FakeClient

BEND, TWIST = Deformation("bend", 40.0), Deformation("twist", -90.0, "x")
WIDE = Deformation("bulge", 4.0)


@pytest.fixture
def bent(document: Document) -> Document:
    return SetPose("pot", (BEND, TWIST)).apply(document)


@pytest.mark.parametrize(
    ("command", "row"),
    [
        (AddDeformer("pot", "taper", 0.5), (BEND, TWIST, Deformation("taper", 0.5))),
        (SetDeformer("pot", 0, amount=-720.0), (Deformation("bend", -720.0), TWIST)),
        (SetDeformer("pot", 1, axis="z"), (BEND, Deformation("twist", -90.0, "z"))),
        (MoveDeformer("pot", 0, 1), (TWIST, BEND)),
        (RemoveDeformer("pot", 0), (TWIST,)),
        (SetPose("pot"), ()),
    ],
)
def test_each_command_changes_the_row(bent: Document, command: EditCommand, row: tuple[Deformation, ...]) -> None:
    assert command.apply(bent).object("pot").deformations == row


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (SetDeformer("pot", 0, amount=721.0), "bend 721, expected -720 to 720"),
        (SetDeformer("pot", 0, amount=float("nan")), "bend nan"),
        (SetDeformer("pot", 2), "2 deformers, none at 2"),
        (SetDeformer("pot", 0, axis="w"), "axis 'w', expected one of x, y, z"),
        (AddDeformer("pot", "melt"), "deformer 'melt', expected one of bend"),
        (RemoveDeformer("floor", 0), "no deformers"),
        (AddDeformer("cup", "bend"), "no object 'cup'"),
        (SetPose("pot", (BEND,) * (MAX_DEFORMERS + 1)), f"{MAX_DEFORMERS} deformers"),
        (SetPose("pot", (WIDE,) * MAX_DEFORMERS), "pot: its deformers make it 1.53e.11 times as large, expected"),
        (SetPose("pot", (Deformation("taper", 4.0),) * 5), "make it 3.12e.03 times as large, expected at most 1000 "),
    ],
)
def test_what_makes_no_sense_is_refused(bent: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(bent)


def test_a_pose_is_set_by_path(bent: Document) -> None:
    changed = set_path(bent, "pot.twist", 30).apply(bent)
    assert changed.object("pot").deformations == (BEND, Deformation("twist", 30.0, "x"))
    assert set_path(bent, "floor.wave", 0.25).apply(bent).object("floor").deformations == (Deformation("wave", 0.25),)
    for value in ("a lot", True, 1e9, [1.0]):
        with pytest.raises(InsituError, match="-720"):
            set_path(bent, "pot.bend", value)


def test_deformers_of_no_amount_are_no_pose(document: Document) -> None:
    assert document.poses == ()
    assert AddDeformer("pot", "bend").apply(document).poses == ()
    assert SetPose("pot", (Deformation("wave", 0.0), BEND)).apply(document).poses == (("pot", (BEND,)),)


def test_a_session_keeps_poses(bent: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "bent.insitu", bent, ViewState())
    assert load_session(path).document == bent
    path.write_text(path.read_text().replace('"bend"', '"melt"'))
    with pytest.raises(LoadError, match="deformer 'melt', expected one of bend"):
        load_session(path)


def test_a_session_of_what_grows_without_end_is_refused_in_one_line(bent: Document, tmp_path: Path) -> None:
    far = bent.with_object(replace(bent.object("pot"), deformations=(WIDE,) * MAX_DEFORMERS))
    path = tmp_path / "far.insitu"
    path.write_text(dump_session(far, ViewState()))
    with pytest.raises(LoadError, match="1.53e\\+11 times as large"):
        load_session(path)


def test_what_grows_without_end_is_refused_in_the_window_and_nothing_is_lost(editor: Editor) -> None:
    for _ in range(4):
        assert editor.do(AddDeformer("pot", "bulge", 4.0)) is None
    before, steps = editor.document, len(editor.history.undo_steps)
    line = editor.do(AddDeformer("pot", "bulge", 4.0))
    assert line is not None and "times as large" in line and "\n" not in line
    assert editor.document is before and len(editor.history.undo_steps) == steps


def test_a_script_deforms(tmp_path: Path) -> None:
    script = tmp_path / "script.toml"
    script.write_text('[[step]]\ndeform = {object = "vase", bend = 40.0, taper = 1}\n')
    assert load_script(script) == (Step("deform", Deform(object="vase", bend=40.0, taper=1.0)),)
    for wrong in ('{object = "vase"}', '{object = "vase", melt = 1.0}', "{bend = 1.0}", '{object = "v", bend = "x"}'):
        script.write_text(f"[[step]]\ndeform = {wrong}\n")
        with pytest.raises(LoadError, match="deform"):
            load_script(script)


@pytest.fixture
def flying(document: Document) -> Document:
    """The pot has two animations, the floor one."""
    flap, glide = Animation("flap", 1.2), Animation("glide", 3.0)
    pot, floor, lamp = document.objects
    moving = replace(pot, animations=(flap, glide)), replace(floor, animations=(flap,)), lamp
    return replace(document, objects=moving)


def moments(document: Document) -> list[Moment | None]:
    return [state.moment for state in document.objects]


def test_time_is_that_of_all_that_are_animated(flying: Document) -> None:
    document = set_path(flying, "time", 0.4).apply(flying)
    assert moments(document) == [Moment("flap", 0.4), Moment("flap", 0.4), None]
    assert document.poses == (("pot", (Moment("flap", 0.4),)), ("floor", (Moment("flap", 0.4),)))
    document = SetTime(2.0, "glide").apply(document)
    assert moments(document) == [Moment("glide", 2.0), Moment("flap", 0.4), None]
    document = set_path(document, "pot.time", 2.5).apply(document)
    assert moments(document)[:2] == [Moment("glide", 2.5), Moment("flap", 0.4)]
    bent = SetPose("pot", (BEND,)).apply(document)
    assert bent.poses[0] == ("pot", (Moment("glide", 2.5), BEND))  # what is animated bends as it is then
    assert SetTime(None).apply(document) == flying


def test_times_that_make_no_sense_are_refused(document: Document, flying: Document) -> None:
    for edit, said in (
        (SetTime(1.0), "the scene has no animation"),
        (SetTime(1.0, object="pot"), "pot has no animation"),
    ):
        with pytest.raises(InsituError, match=said):
            edit.apply(document)
    with pytest.raises(InsituError, match="animation 'swim', expected one of flap, glide"):
        SetTime(1.0, "swim").apply(flying)
    with pytest.raises(InsituError, match="time nan, expected a finite number of seconds"):
        SetTime(float("nan")).apply(flying)
    for value in ("soon", True, float("inf")):
        with pytest.raises(LoadError, match=r"pot\.time: value = .*, expected a finite number of seconds"):
            set_path(flying, "pot.time", value)


def test_a_session_keeps_the_time_and_says_what_of_it_there_is_no_more(flying: Document, tmp_path: Path) -> None:
    document = SetTime(0.4).apply(flying)
    session = load_session(save_session(tmp_path / "flying.insitu", document, ViewState()))
    assert fit_session(session, flying, "flying.insitu") == document
    resting = replace(flying, objects=tuple(replace(each, animations=()) for each in flying.objects))
    assert fit_session(session, resting, "flying.insitu").object("pot").moment is None
    (note,) = session_notes(session, resting)
    assert note == "pot, floor: the animation of the session is no longer in the file, shown at rest"


def test_a_script_says_a_time(tmp_path: Path) -> None:
    script = tmp_path / "script.toml"
    script.write_text(
        '[[step]]\ndeform = {time = 0.4}\n[[step]]\ndeform = {object = "pot", time = 1, clip = "glide", bend = 40.0}\n'
    )
    assert load_script(script) == (
        Step("deform", Deform(time=0.4)),
        Step("deform", Deform(object="pot", time=1.0, clip="glide", bend=40.0)),
    )
    for wrong in ('{clip = "flap"}', '{time = "soon"}', "{time = 1.0, bend = 4.0}", "{time = nan}"):
        script.write_text(f"[[step]]\ndeform = {wrong}\n")
        with pytest.raises(LoadError, match="deform"):
            load_script(script)


@pytest.fixture
def playing(client: FakeClient) -> Editor:
    """An editor in Deform whose pot has an animation of 1.2 seconds, which plays from second 1 on."""
    editor = Editor(client, "shelf")
    client.open_scene(animations=((Animation("flap", 1.2),), (), ()))
    editor.do(SetView.of(mode="deform"))
    editor.tick(0.0)
    editor.player.play()
    editor.tick(1.0)
    return editor


def test_what_plays_is_no_step_and_stays_where_it_stops(playing: Editor, client: FakeClient) -> None:
    for now, time in ((1.5, 0.5), (2.0, 1.0), (2.5, 0.3)):  # it begins anew after 1.2 seconds
        playing.tick(now)
        ((_, (moment,)),) = visible_poses(playing.document, playing.view)
        assert isinstance(moment, Moment) and moment.time == pytest.approx(time)
    assert playing.document.poses == () and not playing.history.undo_steps
    assert not [look for look in client.sent(SetCamera) if look.poses]  # it does not rest
    playing.do(AddDeformer("pot", "bend", 40.0))
    playing.player.pause()
    stopped, bend = playing.document.object("pot").motion_stack
    assert isinstance(stopped, Moment) and stopped.time == pytest.approx(0.3) and bend == BEND
    playing.tick(9.0)
    assert playing.document.object("pot").moment == stopped
    assert [step.label for step in playing.history.undo_steps] == ["bend pot"]


def test_what_plays_is_no_unsaved_edit(playing: Editor) -> None:
    playing.tick(1.5)
    playing.player.pause()
    assert playing.document.object("pot").moment == Moment("flap", 0.5)
    assert playing.history.undo_label is None and not playing.session.is_unsaved
    # An edit is one, before it plays on and after; undone, nothing is unsaved.
    playing.do(AddDeformer("pot", "bend", 40.0))
    assert playing.session.is_unsaved
    playing.player.play()
    playing.tick(2.0)
    playing.tick(2.2)
    playing.player.pause()
    assert playing.session.is_unsaved
    playing.undo()
    assert playing.document.object("pot").moment == Moment("flap", 0.5) and not playing.session.is_unsaved


def test_without_a_loop_it_stops_at_its_end_and_plays_from_the_start_again(playing: Editor) -> None:
    playing.do(SetView.of(loops=False))
    playing.tick(5.0)
    assert playing.view.playing is None and playing.document.object("pot").moment == Moment("flap", 1.2)
    playing.player.play()
    assert playing.view.playing == 0.0


def test_another_mode_stops_it(playing: Editor) -> None:
    playing.tick(1.5)
    playing.do(SetView.of(mode="placement"))
    playing.tick(1.6)
    assert playing.view.playing is None and playing.document.object("pot").moment == Moment("flap", 0.5)


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor at time 1 with its scene open, whose worker has nothing to do."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.tick(1.0)
    client.requests.clear()
    return editor


def test_a_drag_is_one_step_and_is_traced_once_it_rests(editor: Editor, client: FakeClient) -> None:
    editor.do(AddDeformer("pot", "bend"))
    editor.begin_drag()
    for step in range(1, 5):
        editor.do(SetDeformer("pot", 0, amount=10.0 * step))
        editor.tick(2.0 + 0.5 * REST_SECONDS * step)
    assert client.sent(SetCamera) == [] and editor.status.is_away
    editor.end_drag()
    editor.tick(4.0)
    (look,) = client.sent(SetCamera)
    assert look.poses == (("pot", (BEND,)),) and look.camera is None
    client.see_scene()
    editor.tick(4.1)
    assert not editor.status.is_away and len(client.sent(SetCamera)) == 1
    editor.undo()
    assert editor.document.object("pot").deformations == (Deformation("bend", 0.0),)
    editor.tick(5.0)
    editor.tick(6.0)
    assert client.sent(SetCamera)[1].poses == ()


def test_a_pose_that_cannot_be_traced_is_asked_for_once(editor: Editor, client: FakeClient) -> None:
    editor.do(AddDeformer("pot", "bend", 40.0))
    editor.tick(2.0)
    editor.tick(3.0)
    (look,) = client.sent(SetCamera)
    client.answer(look, RequestFailed("no memory"))
    for step in range(5):
        editor.tick(4.0 + step)
    assert len(client.sent(SetCamera)) == 1 and editor.document.poses
    editor.do(SetDeformer("pot", 0, amount=20.0))
    editor.tick(10.0)
    editor.tick(11.0)
    assert len(client.sent(SetCamera)) == 2
