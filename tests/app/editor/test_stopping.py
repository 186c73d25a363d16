"""Work that a person stops, and how it goes on."""

import numpy as np
import pytest

from app.document.commands.light import SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import CancelRequests, OpenScene, Progress, Request, RequestFailed
from app.modes.deform.deform_messages import PrepareDeform
from app.modes.orbit.orbit_messages import PrepareOrbit
from app.modes.placement.placement_messages import ComputeTransport, LayerPicture
from app.modes.placement.placement_status import RenderReport
from tests.app.fake_worker import FakeClient, computed

EXACT = RenderReport(128, 128, 0.0, True)


def test_work_can_be_stopped_and_resumed(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    editor.tick(0.1)
    editor.cancel_work()
    editor.tick(1.0)
    assert isinstance(client.requests[-1], CancelRequests) and editor.status.picture == "preview"
    (stopped,) = computed(client)
    client.answer(stopped, Progress("transport", 0.5))
    editor.tick(1.05)
    assert editor.status.stopped and not editor.status.stage  # it was on its way
    editor.resume_work()
    client.answer(stopped, LayerPicture("floor.0", "coarse", np.zeros((4, 3)), stopped.scene.layers[2].coefficients))
    assert editor.tick(1.1) == []  # it was on its way when the work was stopped
    assert isinstance(client.requests[-1], ComputeTransport) and not editor.status.stopped


def test_another_light_goes_on_where_work_was_stopped(editor: Editor, client: FakeClient) -> None:
    editor.cancel_work()
    editor.tick(0.1)
    assert editor.status.stopped and len(computed(client)) == 1
    editor.do(SetRotation(5.0))
    editor.tick(1.0)
    editor.tick(2.0)
    assert not editor.status.stopped and len(computed(client)) == 2


def test_more_bounces_go_on_where_work_was_stopped(editor: Editor, client: FakeClient) -> None:
    editor.cancel_work()
    editor.tick(0.1)
    editor.do(SetView.of(n_bounces=4))
    editor.tick(1.0)
    editor.tick(2.0)
    assert not editor.status.stopped and computed(client)[-1].settings.n_bounces == 4


def test_stopping_what_the_picture_does_not_need_leaves_nothing_to_resume(settled: Editor, client: FakeClient) -> None:
    settled.controller.rendered(EXACT)
    settled.cancel_work()
    settled.tick(1.1)
    assert settled.status.picture == "exact" and not settled.status.stopped


def test_a_first_scene_that_was_stopped_is_opened_by_resuming(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    editor.cancel_work()
    editor.tick(0.0)
    assert editor.status.stopped and not editor.scene_is_open
    editor.resume_work()
    assert [request.source for request in client.sent(OpenScene)] == ["shelf", "shelf"]


@pytest.mark.parametrize(("mode", "kind"), [("orbit", PrepareOrbit), ("deform", PrepareDeform)])
@pytest.mark.parametrize("fails", [False, True])
def test_a_preparation_that_was_stopped_or_failed_can_be_resumed(
    editor: Editor, client: FakeClient, mode: str, kind: type[Request], fails: bool
) -> None:
    editor.do(SetView.of(mode=mode))
    editor.tick(0.1)
    (request,) = client.sent(kind)
    assert editor.controller.is_running
    if fails:
        client.answer(request, RequestFailed("no memory"))
    else:
        editor.cancel_work()
    for now in (0.2, 1.0, 2.0):
        editor.tick(now)
        assert editor.status.stopped != fails and not editor.controller.is_running
    assert len(client.sent(kind)) == 1
    editor.resume_work()
    editor.tick(2.1)
    assert len(client.sent(kind)) == 2 and editor.controller.is_running and not editor.status.stopped
