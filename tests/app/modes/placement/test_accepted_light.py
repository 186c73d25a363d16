"""An environment that the worker cannot read leaves the document again, and nothing else does."""

import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.light import SetEnvironment, SetIntensity, SetMapping, SetRotation
from app.editor.editor import Editor
from app.messages.worker_messages import RequestFailed
from app.modes.placement.placement_messages import ComputeTransport
from tests.app.fake_worker import FakeClient

LINE = "bad.hdr: first bytes = b'', expected an OpenEXR or a Radiance HDR image; nothing was changed"
BAD = SetEnvironment("/bad.hdr")


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """At time 1, all of the final picture delivered."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    return editor


def fail_newest(editor: Editor, client: FakeClient, now: float) -> None:
    """Let the hand rest, and the worker refuse what is asked then."""
    editor.tick(now)
    editor.tick(now + 0.5)
    client.answer(client.sent(ComputeTransport)[-1], RequestFailed(LINE))
    editor.tick(now + 0.6)


def test_a_refused_environment_was_never_there(editor: Editor, client: FakeClient) -> None:
    editor.do(SetParameter("pot.1", "eta", 1.9))
    before, steps = editor.document, len(editor.history.undo_steps)
    editor.do(BAD)
    fail_newest(editor, client, 2.0)
    assert editor.document is before and len(editor.history.undo_steps) == steps
    assert editor.history.redo_label is None
    assert editor.status.message == LINE and editor.status.is_error
    # The old light is asked for again, and comes.
    editor.tick(3.0)
    assert client.sent(ComputeTransport)[-1].scene.light.environment == "scene"
    client.finish_stage("final", exact=True)
    editor.tick(3.1)
    assert editor.status.picture != "preview"


def test_edits_made_meanwhile_stay(editor: Editor, client: FakeClient) -> None:
    editor.do(BAD)
    editor.tick(2.0)
    editor.tick(2.5)
    request = client.sent(ComputeTransport)[-1]
    editor.do(SetIntensity(3.0))
    client.answer(request, RequestFailed(LINE))
    editor.tick(2.6)
    light = editor.document.light
    assert (light.environment, light.intensity) == ("scene", 3.0)


def test_a_mapping_is_taken_back_too(editor: Editor, client: FakeClient) -> None:
    editor.do(SetEnvironment("/good.hdr"))
    editor.tick(2.0)
    editor.tick(2.5)
    client.finish_stage("final", exact=True)
    editor.tick(2.6)
    editor.do(SetMapping("angular"))  # a file whose header does not tell its size
    fail_newest(editor, client, 3.0)
    assert (editor.document.light.environment, editor.document.light.mapping) == ("/good.hdr", "latlong")


def test_other_failures_leave_the_light(editor: Editor, client: FakeClient) -> None:
    editor.do(SetRotation(90.0))
    before = editor.document
    fail_newest(editor, client, 2.0)
    assert editor.document is before


def test_a_light_that_worked_once_is_kept_when_it_fails_later(editor: Editor, client: FakeClient) -> None:
    editor.do(BAD)
    editor.tick(2.0)
    editor.tick(2.5)
    client.finish_stage("coarse", exact=False)
    editor.tick(2.6)
    before = editor.document
    client.answer(client.sent(ComputeTransport)[-1], RequestFailed("out of memory"))
    editor.tick(2.7)
    assert editor.document is before
