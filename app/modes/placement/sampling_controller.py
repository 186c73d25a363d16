"""Requests that the worker traces further rays where an edit made indirect light noisy, once its picture is idle.

The worker says of each freezing whether its rays went where the materials need them. Where they did not, the request is
sent, and cancelled as soon as the picture changes: an edit has the processors to itself. What was traced until then
stays, and the next edit goes on from there. So light improves at rest alone, and an edit that is undone afterwards has
the better light as well: its picture is that of before up to the noise that is gone.
"""

from __future__ import annotations

from collections.abc import Callable

from app.document.document import Document
from app.messages.editor_status import Status
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import EditedSampled, SampleEdited, SamplingProgress
from app.modes.reconciler import Reconciler
from engine.render.picture_error import percent

# The error of the picture and what a turning sky needs are requested before: they take less.
IDLE_SECONDS = 1.5
STAGE = "sampling the edited light"

# A document and the revision of its transport.
_LitDocument = tuple[Document, int]


def _is_same(one: _LitDocument, two: _LitDocument) -> bool:
    return one[0] is two[0] and one[1] == two[1]


class SamplingController:
    """Requests rays for edited materials. ``send`` sends a request; sampled: the last response that rays were added by,
    None without any."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        self._reconciler = Reconciler[_LitDocument, EditedSampled](IDLE_SECONDS, cancels_at_once=True, covers=_is_same)
        self.forget()

    def forget(self) -> None:
        """Forget what is ready: another picture, or another worker."""
        self._reconciler.clear()
        self.sampled: EditedSampled | None = None
        self._fraction: float | None = None  # of what is under way, once the worker has begun
        self._number = 0

    def update(self, now: float, document: Document, revision: int, rests: bool, lacks_rays: bool) -> None:
        """Request rays where it is time to. revision: of the transport that the picture is made with; rests: whether
        all of the picture is there, and no drag is under way; lacks_rays: whether its materials may need others."""
        reconciler = self._reconciler
        reconciler.desire(now, (document, revision))
        match reconciler.action(now, rests and lacks_rays):
            case "request":
                request = SampleEdited(self._curves.scene_state(document), revision=revision)
                reconciler.sent(now, self._send(request))
                self._fraction = None
            case "cancel":
                self._send(CancelRequests(of=(SampleEdited,)))

    def light_improved(self, number: int) -> None:
        """Note the number of light with more rays."""
        self._number = number

    def light_found(self, number: int) -> None:
        """Note light that was found: other light than that with more rays has none for edited materials."""
        if number != self._number:
            self.sampled = None

    def receive_progress(self, response: SamplingProgress) -> None:
        self._fraction = response.fraction

    def receive(self, response: EditedSampled) -> None:
        """Take the response."""
        if self._reconciler.receive(response.id, response) and response.n_points:
            self.sampled = response

    def interrupted(self) -> None:
        """The user or a fault stopped it: it is not requested again before the picture changes."""
        self._reconciler.stop()

    def lose_request(self) -> None:
        """The request will not be answered: the worker was given something else to do."""
        self._reconciler.lose()

    def receive_failure(self, id: int) -> None:
        self._reconciler.fail(id)

    def status(self, status: Status) -> dict[str, object]:
        """The fields of the status that are about it: the plan's, and the progress where nothing else is under way."""
        said: dict[str, object] = {}
        if self.sampled is not None:
            said = {
                "sample_sets": self.sampled.n_sets / self.sampled.n_points,
                "sampling_reason": _reason(self.sampled),
            }
        if self._reconciler.is_under_way and self._fraction is not None and not status.stage:
            said |= {"stage": STAGE, "fraction": self._fraction, "text": "tracing rays where the edit made noise"}
        return said


def _reason(sampled: EditedSampled) -> str:
    """What was traced for edited materials, for the plan."""
    noise = f"noise then fell from {percent(sampled.noise_before)} to {percent(sampled.noise)}"
    noisy = sampled.n_noisy / sampled.n_points
    left = "" if not noisy else f"; {percent(noisy)} of points have as many as they may, and would need more"
    return f"sample sets of {sampled.n_points:,} points, {sampled.n_added:,} for edited materials: {noise}{left}"
