"""What Placement requests of the worker once its picture rests: its error, rays for edited materials, other skies.

Each has a controller of its own, which compares and waits; this tells all of them what the picture is, and what befalls
their requests. An edit has the processors to itself: it cancels what is under way.
"""

from __future__ import annotations

from collections.abc import Callable

from app.document.document import Document
from app.document.view_state import ViewState
from app.messages.editor_status import Status
from app.messages.worker_messages import Request
from app.modes.error_controller import ErrorController
from app.modes.placement.curves import Curves
from app.modes.placement.desired_state import RestingPicture
from app.modes.placement.placement_messages import (
    EditedSampled,
    ErrorEstimated,
    EstimateError,
    IndirectFound,
    IndirectImproved,
    LightsReady,
    RelightingPrepared,
    SamplingProgress,
)
from app.modes.placement.relight_controller import RelightController
from app.modes.placement.sampling_controller import SamplingController

# How long a picture is to be on screen, whole, before its error is estimated.
ERROR_IDLE_SECONDS = 0.5
MAX_ESTIMATES = 32

IdleResponse = (
    ErrorEstimated
    | EditedSampled
    | LightsReady
    | RelightingPrepared
    | SamplingProgress
    | IndirectFound
    | IndirectImproved
)


class IdleWork:
    """The requests of a resting picture. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._curves = curves
        self._error = ErrorController[RestingPicture, ErrorEstimated](
            send, EstimateError, ERROR_IDLE_SECONDS, MAX_ESTIMATES
        )
        self.relight = RelightController(send, curves)
        self.sampling = SamplingController(send, curves)

    def update(
        self, now: float, document: Document, view: ViewState, revision: int, rests: bool, lacks_rays: bool
    ) -> None:
        """Request what it is time for. revision: of the transport that the picture is made with; rests: whether all of
        the picture is there, and no drag is under way; lacks_rays: whether its materials may need other rays."""

        def request() -> EstimateError:
            scene = self._curves.scene_state(document)
            return EstimateError(scene, view.settings.second_bands, view.shows_error, revision=revision)

        self.sampling.update(now, document, revision, rests, lacks_rays)
        self._error.update(now, RestingPicture.of(document, view), rests, request, revision)
        self.relight.update(now, document, revision, rests)

    def estimated(self, document: Document, view: ViewState) -> ErrorEstimated | None:
        """The estimate of the error of this picture; None while unknown."""
        return self._error.estimated(RestingPicture.of(document, view))

    def sampling_status(self, status: Status) -> dict[str, object]:
        """The fields of the status about rays for edited materials."""
        return self.sampling.status(status)

    # -------------------------------------------------------------------------------------------- what becomes of them

    def receive(self, response: IdleResponse) -> None:
        """Take a response that is theirs, or that makes one of them void."""
        match response:
            case ErrorEstimated():
                self._error.receive(response)
            case LightsReady() | RelightingPrepared():
                self.relight.receive(response)
            case EditedSampled():
                self.sampling.receive(response)
                if response.n_added:
                    self.relight.forget()  # what was prepared is of the light before
            case SamplingProgress():
                self.sampling.receive_progress(response)
            case IndirectFound():
                self.sampling.light_found(response.number)
            case IndirectImproved():
                self.sampling.light_improved(response.found.number)
                self._error.forget()

    def receive_failure(self, id: int) -> None:
        self._error.receive_failure(id)
        self.relight.receive_failure(id)
        self.sampling.receive_failure(id)

    def images_changed(self) -> None:
        """Forget estimates of errors: images, which are no part of the document, look different."""
        self._error.forget()

    def scene_opened(self) -> None:
        """Forget all: of another picture."""
        self._error.forget()
        self.relight.forget()
        self.sampling.forget()

    def scene_closed(self) -> None:
        """The worker was given something else to do."""
        self._error.worker_interrupted()
        self.relight.forget()
        self.sampling.lose_request()

    def worker_restarted(self) -> None:
        self.relight.forget()
        self.sampling.forget()

    def cancelled(self) -> None:
        """The user stopped the work: nothing of it is requested again before the picture changes."""
        self._error.user_stopped()
        self.relight.interrupted()
        self.sampling.interrupted()
