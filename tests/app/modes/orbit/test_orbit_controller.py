"""Orbit's talk by itself: one picture under way, the next of what is wanted then."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.light import SetRotation
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from app.document.view_state import ViewState
from app.messages.editor_status import Status, StatusMetrics
from app.messages.worker_messages import CancelRequests, Request, RequestFailed
from app.modes.mode import OpenedScene
from app.modes.orbit.desired_state import (
    IDLE_SECONDS,
    MOVING_SECONDS,
    STEPS,
    WINDOW_SECONDS,
    WINDOW_STEPS,
    QualityPacer,
)
from app.modes.orbit.orbit_controller import OrbitController
from app.modes.orbit.orbit_events import OrbitPicture
from app.modes.orbit.orbit_messages import (
    DrawHeadlight,
    DrawnErrorEstimated,
    DrawOrbit,
    EstimateOrbit,
    OrbitNotReady,
    OrbitPictureDrawn,
    OrbitProgress,
    PrepareOrbit,
    PrioritizeView,
)
from app.modes.orbit.picture_controller import PRIORITIZE_SECONDS
from app.modes.placement.placement_messages import ComputeTransport
from app.system.barrier import Barrier
from engine.planner import band_counts
from engine.render.picture_error import ErrorEstimate
from engine.scene.description import Camera, SceneDescription
from tests.ui.stand_in import HEIGHT, SCENE, WIDTH

CAMERAS = [Camera(position=(0.1 * i, 1.0, 4.0), target=(0.0, 0.5, 0.0)) for i in range(1, 6)]


class Table:
    """A desk whose requests lie on it."""

    def __init__(self) -> None:
        self.description = SceneDescription.model_validate(SCENE)
        self.document = document_from_description("stand-in", self.description)
        self.barrier, self.metrics, self.view = Barrier(), StatusMetrics(), ViewState(mode="orbit")
        self.history = History(self.document)
        self.sent: list[Request] = []
        self._kept: dict[type, object] = {}
        self.controller = OrbitController(self)
        self.now = 0.0
        planned = tuple((layer, band_counts(layer)) for _, layer in self.document.layers())
        self.controller.scene_opened(OpenedScene(1, planned, self.description, self.document, self.document))

    def send(self, request: Request) -> int:
        self.sent.append(request)
        return len(self.sent)

    def shared_state(self, kind):  # type: ignore[no-untyped-def]
        """One of each kind."""
        return self._kept.setdefault(kind, kind())

    def notify(self, text: str, is_error: bool = False) -> None: ...

    def notify_once(self, note: str) -> None: ...

    @property
    def pictured(self) -> Document:
        return self.history.document

    @property
    def pictured_view(self) -> ViewState:
        return self.view

    def with_nodes(self, document: Document) -> Document:
        return document

    def document_changed(self) -> None:
        self.controller.edited()

    def update(self, seconds: float = 0.01) -> list[Request]:
        """A frame later: what was asked in it."""
        before, self.now = len(self.sent), self.now + seconds
        self.controller.update(self.now, self.history.document, self.view)
        return self.sent[before:]

    def look(self, camera: Camera | None) -> None:
        self.view = replace(self.view, camera=camera)
        self.controller.view_moved()

    def id_of(self, kind: type[Request]) -> int:
        """The number of the newest of that kind."""
        return max(i + 1 for i, request in enumerate(self.sent) if isinstance(request, kind))

    def advance(self, version: int, is_done: bool = True) -> None:
        self.controller.receive(OrbitProgress(version, is_done, id=self.id_of(PrepareOrbit)))

    def drawn(self, version: int, is_done: bool = True, prepared: int = 0) -> list[object]:
        """The answer to the newest picture that was asked for."""
        radiance = np.ones((2, 2, 3), np.float32)
        prepared = prepared or self.id_of(PrepareOrbit)
        return self.controller.receive(
            OrbitPictureDrawn(radiance, prepared, version, is_done, 0.01, id=self.id_of(DrawOrbit))
        )


@pytest.fixture
def table() -> Table:
    """Orbit's whole picture of the scene's own camera is shown."""
    table = Table()
    assert [type(request) for request in table.update()] == [PrepareOrbit]
    table.advance(1)
    (asked,) = table.update()
    assert asked == DrawOrbit(table.description.camera, (WIDTH, HEIGHT), "rest")
    assert [type(event) for event in table.drawn(1)] == [OrbitPicture]
    assert table.controller.status(Status()).picture == "refining"
    return table


def test_nothing_is_drawn_before_there_is_anything_to_draw_of() -> None:
    table = Table()
    table.update()
    status = table.controller.status(Status())
    assert table.update(1.0) == [] and status.picture == "waiting" and not status.follows_input


def test_a_plain_picture_that_a_worker_without_a_scene_was_asked_for_is_not_asked_for_again_and_again() -> None:
    table = Table()
    table.update()
    table.look(CAMERAS[0])
    (asked,) = table.update()
    assert isinstance(asked, DrawHeadlight)
    table.controller.receive(OrbitNotReady(id=table.id_of(DrawHeadlight)))
    assert table.update() == [] and table.update() == []
    table.look(CAMERAS[1])
    assert [type(request) for request in table.update()] == [DrawHeadlight]


def test_from_the_first_picture_on_it_goes_with_the_hand(table: Table) -> None:
    assert table.controller.status(Status()).follows_input


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
    (at_rest,) = table.update(IDLE_SECONDS)
    assert isinstance(at_rest, DrawOrbit) and (at_rest.quality, at_rest.resolution) == ("rest", (WIDTH, HEIGHT))
    table.look(CAMERAS[1])
    (moving,) = table.update()
    assert isinstance(moving, DrawOrbit) and (moving.quality, moving.camera) == ("moving", CAMERAS[1])


def test_placement_has_its_turn_once_the_picture_is_whole_and_loses_it_to_a_hand(table: Table) -> None:
    table.update()
    assert [type(request) for request in table.update()] == [ComputeTransport]
    table.look(CAMERAS[0])
    assert CancelRequests(of=(ComputeTransport,)) in table.sent
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
    assert table.controller.status(Status()).picture == "preview"


def test_what_a_picture_saw_that_nothing_was_ready_for_is_made_ready(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.drawn(1, is_done=False)
    assert PrepareOrbit in map(type, table.update())


def test_a_worker_without_a_scene_is_sent_it_again(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.controller.receive(OrbitNotReady(id=table.id_of(DrawOrbit)))
    assert [type(request) for request in table.update()] == [PrepareOrbit]


def test_a_picture_that_failed_is_not_asked_for_again_and_again(table: Table) -> None:
    table.look(CAMERAS[0])
    table.update()
    table.update(IDLE_SECONDS)
    table.controller.receive(RequestFailed("no", id=table.id_of(DrawOrbit)))
    table.update()
    table.controller.receive(RequestFailed("no", id=table.id_of(DrawOrbit)))
    assert table.update() == [] and table.update(1.0) == []


def test_it_knows_whether_its_picture_is_of_the_view_as_it_looks_now(table: Table) -> None:
    assert table.controller.shows_viewpoint
    table.look(CAMERAS[0])
    table.update()
    assert not table.controller.shows_viewpoint  # what is selected has no outline over the picture of before
    table.drawn(1)
    assert table.controller.shows_viewpoint


@pytest.fixture
def drawing(table: Table) -> Table:
    """The same, with a window that draws moving pictures itself."""
    table.controller.draw_in_window(1 << 20)
    prepare, look = table.update()
    assert isinstance(prepare, PrepareOrbit) and prepare.listener > 0 and prepare.most_bytes == 1 << 20
    assert look == PrioritizeView(table.description.camera)
    table.advance(1)
    (asked,) = table.update()
    assert isinstance(asked, DrawOrbit) and asked.quality == "rest"
    table.drawn(1)
    assert table.controller.drawn_in_window is None  # the worker's picture of a view at rest
    return table


def test_a_window_that_draws_itself_asks_for_pictures_at_rest_alone(drawing: Table) -> None:
    for camera in CAMERAS:
        drawing.look(camera)
        assert drawing.update() == []
        wanted = drawing.controller.drawn_in_window
        assert wanted is not None and wanted[:2] == (camera, (WIDTH, HEIGHT))
        drawing.controller.record_draw_seconds(0.1 * WINDOW_SECONDS)
    (asked,) = drawing.update(IDLE_SECONDS)
    assert asked == DrawOrbit(CAMERAS[-1], (WIDTH, HEIGHT), "rest")
    drawing.look(CAMERAS[0])  # which a hand does not wait for
    assert drawing.update() == [CancelRequests(of=(DrawOrbit,)), PrioritizeView(CAMERAS[0])]
    assert drawing.drawn(1) == [] and drawing.controller.drawn_in_window is not None


def test_what_it_sees_comes_first_while_not_all_is_ready(drawing: Table) -> None:
    drawing.history.do(SetRotation(30.0))
    assert [type(request) for request in drawing.update()] == [PrepareOrbit]
    drawing.advance(2, is_done=False)
    drawing.look(CAMERAS[0])
    assert drawing.update() == [PrioritizeView(CAMERAS[0])]
    assert drawing.update() == []


def test_backs_that_come_into_its_sight_are_made_ready(drawing: Table) -> None:
    drawing.look(CAMERAS[0])
    assert drawing.update(PRIORITIZE_SECONDS) == [
        PrioritizeView(CAMERAS[0])
    ]  # it may see what nothing was made ready for
    drawing.advance(2, is_done=False)
    assert [type(request) for request in drawing.update()] == [PrepareOrbit]
    drawing.advance(3, is_done=False)
    assert drawing.update() == []


def test_where_it_cannot_the_worker_draws_again(drawing: Table) -> None:
    drawing.controller.draw_in_window(0)
    drawing.look(CAMERAS[0])
    prepare, moving = drawing.update()
    assert isinstance(prepare, PrepareOrbit) and not prepare.listener
    assert isinstance(moving, DrawOrbit) and moving.quality == "moving"


def test_a_picture_that_takes_very_long_skips_steps() -> None:
    pace = QualityPacer(WINDOW_SECONDS, WINDOW_STEPS, 0)
    pace.record_seconds(1.5 * WINDOW_SECONDS)
    assert pace.n_coefficients == WINDOW_STEPS[1][1]
    pace.record_seconds(9.0 * WINDOW_SECONDS)
    assert pace.n_coefficients == WINDOW_STEPS[4][1]
    pace.record_seconds(math.inf)
    assert pace.resolution((400, 300)) == (100, 75)


def test_as_many_pixels_as_are_drawn_in_time() -> None:
    pace = QualityPacer()
    for _ in range(10):
        pace.record_seconds(10.0 * MOVING_SECONDS)
    scale, n = STEPS[-1]
    assert (*pace.resolution((400, 200)), pace.n_coefficients) == (400 * scale, 200 * scale, n)
    for _ in range(10):
        pace.record_seconds(0.1 * MOVING_SECONDS)
    assert (*pace.resolution((400, 200)), pace.n_coefficients) == (400, 200, STEPS[0][1])
    pace.record_seconds(MOVING_SECONDS)
    assert pace.resolution((400, 200)) == (400, 200)  # in time: it stays


def test_what_cost_more_than_it_promised_is_tried_less_and_less_often() -> None:
    # Most of a picture's time does not shrink with its pixels: it must neither stay small nor change its size for ever.
    pace, sizes = QualityPacer(), []
    for _ in range(300):
        width, _ = pace.resolution((400, 200))
        sizes.append(width)
        pace.record_seconds(MOVING_SECONDS * (0.5 + (width / 400.0) ** 2))
    assert sizes.count(400) <= 10 and 0.9 < np.mean(np.array(sizes[20:]) == 300)


NEAR, FAR = ErrorEstimate(None, None, 0.02), ErrorEstimate(None, None, 0.08)


def judged(table: Table) -> EstimateOrbit:
    """What is asked once the picture rests, answered."""
    table.update()
    (asked,) = (request for request in table.update(1.0) if isinstance(request, EstimateOrbit))
    table.controller.receive(DrawnErrorEstimated(NEAR, FAR, id=table.id_of(EstimateOrbit)))
    return asked


def test_the_error_of_a_whole_picture_is_estimated_at_rest_and_while_something_moves(table: Table) -> None:
    asked = judged(table)
    assert isinstance(asked.at_rest, DrawOrbit) and isinstance(asked.moving, DrawOrbit)
    assert (asked.at_rest.quality, asked.moving.quality) == ("rest", "moving")
    assert asked.at_rest.resolution == (WIDTH, HEIGHT) and asked.moving.resolution < (WIDTH, HEIGHT)
    assert table.controller.status(Status()).estimate == NEAR and table.controller.status(Status()).image_error == 0.02
    assert not [request for request in table.update(1.0) if isinstance(request, EstimateOrbit)]


def test_from_another_view_the_error_is_that_of_moving_pictures_until_an_edit(table: Table) -> None:
    judged(table)
    table.look(CAMERAS[0])
    table.update()
    table.drawn(1)
    assert table.controller.status(Status()).estimate == FAR
    table.history.do(SetRotation(40.0))
    table.update()
    assert table.controller.status(Status()).estimate is None


def test_the_error_map_is_sent_where_it_is_requested(table: Table) -> None:
    judged(table)
    table.view = replace(table.view, shows_error=True)
    requests = [*table.update(), *table.update(1.0)]
    (asked,) = (request for request in requests if isinstance(request, EstimateOrbit))
    colours = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    assert asked.has_map and table.controller.status(Status()).error_colours is None
    assert table.controller.status(Status()).estimate == NEAR  # the same picture's, so that its map is awaited
    table.controller.receive(DrawnErrorEstimated(NEAR, FAR, colours, id=table.id_of(EstimateOrbit)))
    assert table.controller.status(Status()).error_colours is colours
    table.look(CAMERAS[0])
    table.update()
    assert table.controller.status(Status()).error_colours is None


def test_a_picture_that_is_no_longer_shown_has_no_estimate(table: Table) -> None:
    table.update()
    assert [type(request) for request in table.update(1.0)].count(EstimateOrbit) == 1
    late = table.id_of(EstimateOrbit)
    table.look(CAMERAS[0])
    assert CancelRequests(of=(EstimateOrbit,)) in table.update()
    table.controller.receive(DrawnErrorEstimated(NEAR, FAR, id=late))
    assert table.controller.status(Status()).estimate is None


def test_an_estimate_that_failed_is_not_requested_again(table: Table) -> None:
    table.update()
    table.update(1.0)
    table.controller.receive(RequestFailed("no", id=table.id_of(EstimateOrbit)))
    assert not [request for request in table.update(5.0) if isinstance(request, EstimateOrbit)]
    assert table.controller.status(Status()).estimate is None
