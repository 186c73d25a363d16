"""Orbit's talk by itself: one picture under way, the next of what is wanted then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.barrier import Barrier
from app.commands.layers import SetParameter
from app.commands.light import SetRotation
from app.document import document_from_description
from app.history import History
from app.messages import Cancel, Failed, Request
from app.mode import OpenedScene
from app.orbit.events import OrbitPicture
from app.orbit.messages import DrawOrbit, OrbitAdvanced, OrbitDrawn, OrbitUnknown, PrepareOrbit
from app.orbit.talk import REST_SECONDS, OrbitTalk
from app.orbit.wishes import MOVING_SECONDS, STEPS, Pace
from app.placement.messages import ComputeTransport
from app.status import Gauges, Status
from app.view_state import ViewState
from engine.plan import band_counts
from engine.scene.description import Camera, SceneDescription
from tests.ui.stand_in import HEIGHT, SCENE, WIDTH

CAMERAS = [Camera(position=(0.1 * i, 1.0, 4.0), target=(0.0, 0.5, 0.0)) for i in range(1, 6)]


class Table:
    """A desk whose requests lie on it."""

    def __init__(self) -> None:
        self.description = SceneDescription.model_validate(SCENE)
        self.document = document_from_description("stand-in", self.description)
        self.barrier, self.gauges, self.view = Barrier(), Gauges(), ViewState(mode="orbit", n_bounces=1)
        self.history = History(self.document)
        self.sent: list[Request] = []
        self._kept: dict[type, object] = {}
        self.talk = OrbitTalk(self)
        self.now = 0.0
        planned = tuple((layer, band_counts(layer)) for _, layer in self.document.layers())
        self.talk.scene_opened(OpenedScene(1, planned, self.description, self.document, self.document))

    def send(self, request: Request) -> int:
        self.sent.append(request)
        return len(self.sent)

    def kept(self, kind):  # type: ignore[no-untyped-def]
        """One of each kind."""
        return self._kept.setdefault(kind, kind())

    def notify(self, text: str, is_error: bool = False) -> None: ...

    def say_once(self, note: str) -> None: ...

    def document_changed(self) -> None:
        self.talk.edited()

    def update(self, seconds: float = 0.01) -> list[Request]:
        """A frame later: what was asked in it."""
        before, self.now = len(self.sent), self.now + seconds
        self.talk.update(self.now, self.history.document, self.view)
        return self.sent[before:]

    def look(self, camera: Camera | None) -> None:
        self.view = replace(self.view, camera=camera)
        self.talk.looked_away()

    def id_of(self, kind: type[Request]) -> int:
        """The number of the newest of that kind."""
        return max(i + 1 for i, request in enumerate(self.sent) if isinstance(request, kind))

    def advance(self, version: int, is_done: bool = True) -> None:
        self.talk.take(OrbitAdvanced(version, is_done, id=self.id_of(PrepareOrbit)))

    def drawn(self, version: int, is_done: bool = True, prepared: int = 0) -> list[object]:
        """The answer to the newest picture that was asked for."""
        radiance = np.ones((2, 2, 3), np.float32)
        prepared = prepared or self.id_of(PrepareOrbit)
        return self.talk.take(OrbitDrawn(radiance, prepared, version, is_done, 0.01, id=self.id_of(DrawOrbit)))


@pytest.fixture
def table() -> Table:
    """Orbit's whole picture of the scene's own camera is shown."""
    table = Table()
    assert [type(request) for request in table.update()] == [PrepareOrbit]
    table.advance(1)
    (asked,) = table.update()
    assert asked == DrawOrbit(table.description.camera, (WIDTH, HEIGHT), "rest")
    assert [type(event) for event in table.drawn(1)] == [OrbitPicture]
    assert table.talk.status(Status()).picture == "refining"
    return table


def test_nothing_is_drawn_before_there_is_anything_to_draw_of() -> None:
    table = Table()
    table.update()
    assert table.update(1.0) == [] and table.talk.status(Status()).picture == "waiting"


def test_a_camera_that_moves_has_one_picture_under_way_and_the_next_is_of_then(table: Table) -> None:
    table.look(CAMERAS[0])
    (first,) = table.update()
    assert isinstance(first, DrawOrbit) and first.camera == CAMERAS[0] and first.quality == "moving"
    for camera in CAMERAS[1:]:
        table.look(camera)
        assert table.update() == []
    table.drawn(1)
    (second,) = table.update()
    assert isinstance(second, DrawOrbit) and second.camera == CAMERAS[-1]


def test_a_picture_at_rest_gives_way_to_a_hand(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.drawn(1)
    (at_rest,) = table.update(REST_SECONDS)
    assert isinstance(at_rest, DrawOrbit) and (at_rest.quality, at_rest.resolution) == ("rest", (WIDTH, HEIGHT))
    table.look(CAMERAS[1])
    (moving,) = table.update()
    assert isinstance(moving, DrawOrbit) and (moving.quality, moving.camera) == ("moving", CAMERAS[1])


def test_placement_has_its_turn_once_the_picture_is_whole_and_loses_it_to_a_hand(table: Table) -> None:
    table.update()
    assert [type(request) for request in table.update()] == [ComputeTransport]
    table.look(CAMERAS[0])
    assert Cancel(of=(ComputeTransport,)) in table.sent
    assert [type(request) for request in table.update()] == [DrawOrbit]


def test_in_mid_drag_a_wish_waits_until_the_one_before_is_seen(table: Table) -> None:
    table.history.begin_drag()
    table.history.do(SetRotation(10.0))
    assert [type(request) for request in table.update()] == [
        PrepareOrbit
    ]  # what is shown is sharper than a quick picture
    table.history.do(SetRotation(20.0))
    assert table.update() == []
    table.advance(2, is_done=False)
    assert [type(request) for request in table.update()] == [DrawOrbit]
    table.drawn(2, is_done=False)
    (asked,) = [request for request in table.update() if isinstance(request, PrepareOrbit)]
    assert asked.scene.light.rotation == 20.0


def test_an_edit_is_not_whole_before_it_was_followed(table: Table) -> None:
    table.history.do(SetParameter("tray.0", "alpha", 0.4))
    assert table.talk.status(Status()).picture == "preview"


def test_what_a_picture_saw_that_nothing_was_ready_for_is_made_ready(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.drawn(1, is_done=False)
    assert PrepareOrbit in map(type, table.update())


def test_a_worker_that_has_nothing_to_draw_of_is_told_again(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.talk.take(OrbitUnknown(id=table.id_of(DrawOrbit)))
    assert [type(request) for request in table.update()] == [PrepareOrbit]


def test_a_picture_that_failed_is_not_asked_for_again_and_again(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.update(REST_SECONDS)
    table.talk.take(Failed("no", id=table.id_of(DrawOrbit)))
    table.update()
    table.talk.take(Failed("no", id=table.id_of(DrawOrbit)))
    assert table.update() == [] and table.update(1.0) == []


def test_as_many_pixels_as_are_drawn_in_time() -> None:
    pace = Pace()
    for _ in range(10):
        pace.took(10.0 * MOVING_SECONDS)
    scale, n = STEPS[-1]
    assert (*pace.resolution((400, 200)), pace.n_coefficients) == (400 * scale, 200 * scale, n)
    for _ in range(10):
        pace.took(0.1 * MOVING_SECONDS)
    assert (*pace.resolution((400, 200)), pace.n_coefficients) == (400, 200, STEPS[0][1])
    pace.took(MOVING_SECONDS)
    assert pace.resolution((400, 200)) == (400, 200)  # in time: it stays


def test_what_cost_more_than_it_promised_is_tried_less_and_less_often() -> None:
    # Most of a picture's time does not shrink with its pixels: it must neither stay small nor change its size for ever.
    pace, sizes = Pace(), []
    for _ in range(300):
        width, _ = pace.resolution((400, 200))
        sizes.append(width)
        pace.took(MOVING_SECONDS * (0.5 + (width / 400.0) ** 2))
    assert sizes.count(400) <= 10 and 0.9 < np.mean(np.array(sizes[20:]) == 300)
