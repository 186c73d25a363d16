"""When the view is traced while a hand moves lamps and objects in Placement."""

from __future__ import annotations

from app.document.commands.poses import SetTransform
from app.editor.editor import Editor
from app.messages.worker_messages import SetCamera
from app.modes.placement.placement_messages import ComputeTransport
from tests.app.fake_worker import FakeClient


def test_a_lamp_that_a_hand_holds_still_is_traced_when_it_is_released(settled: Editor, client: FakeClient) -> None:
    # Its light follows in the view before, which a new view at each pause of the hand would keep it from.
    settled.begin_drag()
    for k in range(4):
        settled.do(SetTransform("lamp", (0.1 * (k + 1), 0.0, 0.0)))
        for now in (1.1 + k, 1.6 + k, 1.9 + k):
            settled.tick(now)
    assert not client.sent(SetCamera) and any(request.scene.lamps for request in client.sent(ComputeTransport))
    settled.end_drag()
    settled.tick(5.1)
    assert len(client.sent(SetCamera)) == 1


def test_an_object_that_a_hand_holds_still_is_traced_at_the_pause(settled: Editor, client: FakeClient) -> None:
    settled.begin_drag()
    settled.do(SetTransform("pot", (0.1, 0.0, 0.0)))
    for now in (1.1, 1.6, 1.9):
        settled.tick(now)
    assert len(client.sent(SetCamera)) == 1
