"""Indirect light on the window's side: which freezing is desired, requested and ready.

The worker freezes indirect light for the object of the selected layer [BenArtzi07, sect. 6.1]; `indirect_picture` makes
the picture of a freezing in every frame. What its sums hold fixed (other objects' curves, the other curve of the
selected layer) is compared with the document once a frame, and frozen anew when it has changed, one request at a time.
The light that a glossy object sends on follows its curve, by the bands that it was frozen with; it is frozen anew once
the user is idle, or at once where the curve has moved far. Just after another object was selected it stays as it is:
its freezing takes longer, and comes with a second answer. A freezing is answered again whenever its samples have become
finer. While a light is dragged, what was frozen is relit with each quick picture of the direct light, and stays
so until the light of the end is frozen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from app.document.document import Document, Selection
from app.messages.editor_status import Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request
from app.modes.placement.curves import Curves
from app.modes.placement.desired_freezing import DesiredFreezing, desired_freezing
from app.modes.placement.indirect_picture import Freezing, IndirectPicture, light_edit
from app.modes.placement.placement_events import Footprint
from app.modes.placement.placement_messages import (
    FreezeIndirect,
    FreezingProgress,
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
    IndirectRelit,
)
from app.modes.reconciler import Reconciler
from engine.precompute.indirect.frozen_light import FrozenGloss

FREEZE_PATIENCE = 5.0
IDLE_SECONDS = 0.25
# A curve that has moved this far is frozen anew during the drag: products of three changes are left out.
FAR = 0.5
FINE_STAGE = "fine"
# What the worker's progress is called while light is found and frozen.
STAGE = "indirect light"
# Freezings stored beside the one that is drawn: undo goes back to them.
MAX_CACHED = 4

# A desired freezing, and the revision of the transport whose light is frozen.
_FreezingOf = tuple[DesiredFreezing, int]


def _covers(made_for: _FreezingOf, desired: _FreezingOf) -> bool:
    return made_for[1] == desired[1] and made_for[0].serves(desired[0]) and made_for[0].same(desired[0])


class IndirectController:
    """Requests indirect light. ``send`` sends a request and returns its id; `picture` is what is on screen of it."""

    def __init__(self, send: Callable[[Request], int], curves: Curves) -> None:
        self._send, self._curves = send, curves
        # A request is numbered by its serial, which comes back with all responses to it; a failure has its id alone.
        self._reconciler = Reconciler[_FreezingOf, IndirectFrozen](IDLE_SECONDS, FREEZE_PATIENCE, covers=_covers)
        self.scene_opened()

    def scene_opened(self) -> None:
        """Another scene is open: its light is unknown."""
        self._reconciler.clear()
        self.picture = IndirectPicture(self._curves)
        self._n_sent = self._sent_id = 0
        self._found: IndirectFound | None = None
        self._confirmed = -1  # the revision under which it holds
        self._used: Freezing | None = None  # the one that is drawn
        self._lit_under = -1  # the revision under which its light holds
        self._cached: list[Freezing] = []
        self._noises: dict[tuple[int, int], IndirectNoise] = {}  # of freezings, by the numbers of light and request
        self._relit: IndirectRelit | None = None  # of the one that is drawn
        self._desired: DesiredFreezing | None = None
        self._nearest_to: DesiredFreezing | None = None  # what the one that is drawn was chosen for
        self._desired_inputs: tuple[Document | None, Selection | None, int | None] = None, None, None
        self._drawn: DesiredFreezing | None = None
        self._n_bounces = 1
        self._complete = self._fits = False
        self._fraction: float | None = None  # of the freezing under way, where that takes a while

    # ------------------------------------------------------------------------------------------------------ state shown

    @property
    def is_complete(self) -> bool:
        """Whether what is shown is the document's indirect light in its final quality, or none is desired."""
        return self._n_bounces <= 1 or self._complete

    def found_under(self, revision: int) -> IndirectFound | None:
        """The fine light that was found, or also holds, under the transport of that number; None without any."""
        found = self._found if self._confirmed == revision else None
        return found if found is not None and found.stage == FINE_STAGE else None

    @property
    def follows_edits(self) -> bool:
        """Whether what is shown follows edits of what is selected, by the newest samples; what edited gloss sends on
        may be still to come."""
        number = None if self._found is None else self._found.number
        return self._n_bounces <= 1 or (self._used is not None and self._fits and self._used.frozen.number == number)

    @property
    def awaits_frozen(self) -> bool:
        """Whether a freezing is under way of light that has been found."""
        return self._found is not None and self._reconciler.is_under_way

    @property
    def is_pending(self) -> bool:
        """Whether light has been found, and none of it is in the picture yet."""
        return self._n_bounces > 1 and self._found is not None and self._used is None

    def is_outdated(self, revision: int | None) -> bool:
        """Whether the picture has indirect light, and none of the document's is here yet. revision: of the transport
        under way, None where none is."""
        if self._n_bounces <= 1 or not self.picture.is_on_screen or self._reconciler.requested is None:
            return False
        is_due = not self._fits and self._used is not None and self._reconciler.is_under_way
        return is_due or revision is not None and self._confirmed != revision

    def awaits_relit(self, revision: int) -> bool:
        """Whether indirect light follows a drag, and has not yet come for the light of the transport of that number."""
        return self._relit is not None and self._relit.revision != revision

    @property
    def sent_on(self) -> tuple[FrozenGloss, ...]:
        """What is stored of the light that the edited curves send on, of the freezing that is drawn."""
        return () if self._used is None or self._n_bounces <= 1 else self._used.frozen.light.gloss

    @property
    def noise(self) -> float | None:
        """The noise of the indirect light that is shown, RMS relative to its mean, with what a drag leaves out; None
        while unknown."""
        known = self._noise_of_used
        if not self.picture.is_shown or known is None:
            return None
        left_out = self.picture.unrepresented / known.mean if known.mean > 0.0 else 0.0
        return math.hypot(known.noise, left_out)

    def noise_of_picture(self, direct: float) -> float:
        """The same, relative to the mean of the whole picture; direct: the mean of its direct light. 0 while
        unknown."""
        known = self._noise_of_used
        if self.noise is None or known is None:
            return 0.0
        mean = known.mean + direct
        return self.noise * known.mean / mean if mean > 0.0 else self.noise

    @property
    def _noise_of_used(self) -> IndirectNoise | None:
        """The noise of the freezing that is drawn, None while unknown."""
        frozen = None if self._used is None else self._used.frozen
        return None if frozen is None else self._noises.get((frozen.number, frozen.serial))

    def status(self, status: Status) -> dict[str, object]:
        """The progress of a freezing that takes a while, where nothing else is under way."""
        if self._fraction is None or not self.awaits_frozen or status.stage:
            return {}
        return {"stage": STAGE, "fraction": self._fraction, "text": "gathering towards the camera"}

    @property
    def lacks_rays(self) -> bool:
        """Whether what is shown was made with rays that went where other materials needed them."""
        known = self._noise_of_used
        return self._n_bounces > 1 and known is not None and not known.is_sampled

    # -------------------------------------------------------------------------------------------------------- responses

    def edited(self) -> None:
        """The document or the selection changed: until the next update it is unknown whether anything is missing."""
        self._complete = False

    def worker_restarted(self) -> None:
        """A new worker knows nothing of what was requested, and computes light anew."""
        self._reconciler.restart()
        self._confirmed = -1

    def lose_request(self) -> None:
        """The freezing under way will not come: the worker gave it up for a scene or a view that it could not show."""
        self._reconciler.lose()
        self._forget_early()

    def cancelled(self) -> None:
        """The user stopped the work: what is desired is not frozen before another transport."""
        self._forget_early()
        self._reconciler.stop()

    def _forget_early(self) -> None:
        """Forget an answer whose second one will not come: it is to be requested again."""
        if self._reconciler.ready is not None and not self._reconciler.ready.is_last:
            self._reconciler.forget_ready()

    def receive_failure(self, id: int) -> None:
        """Note that a request failed: it is not repeated until it would be another one."""
        if id == self._sent_id:
            self._forget_early()
            self._reconciler.fail(self._n_sent)

    def receive_samples(self, response: IndirectFound) -> None:
        """Samples were found, or also hold under another transport; what they reflect comes with a freezing."""
        if self._found is not None and (self._found.stage, self._confirmed) == (FINE_STAGE, response.revision):
            if response.stage != FINE_STAGE:
                return  # what is there is finer, and of this light
        self._confirmed = response.revision
        if self._used is not None and self._used.frozen.number == response.number:
            self._lit_under = response.revision
        if self._relit is not None and response.number == self._relit.number:
            self._relight(None)  # the light is as it was
        if self._found is None or response.number != self._found.number:
            self._found = response

    def receive_frozen(self, response: IndirectFrozen) -> None:
        """Take a freezing; it is drawn with the footprint of its own samples."""
        reconciler, found = self._reconciler, self._found
        if found is None or response.number != found.number:
            return
        if not reconciler.receive(response.serial, response, response.is_last):
            return
        assert reconciler.ready_for is not None
        used = self._used
        is_of_them = used is not None and used.frozen.number == response.number
        footprint = used.footprint if is_of_them and used else Footprint(found.rows, found.weights)
        self._lit_under = self._confirmed
        self._use(Freezing(reconciler.ready_for[0], response, footprint))

    def receive_progress(self, response: FreezingProgress) -> None:
        """Note how far the freezing under way is."""
        if response.serial == self._n_sent:
            self._fraction = response.fraction

    def receive_relit(self, response: IndirectRelit) -> None:
        """Take what the freezing that is drawn looks like under a dragged light."""
        if self._used is not None and self._used.frozen.number == response.number:
            self._relight(response)

    def _relight(self, relit: IndirectRelit | None) -> None:
        self._relit, self._drawn = relit, None

    def _use(self, freezing: Freezing) -> None:
        """Use a freezing from now on; earlier ones stay stored as long as they are of the same light, and whole."""
        number, serial = freezing.frozen.number, freezing.frozen.serial
        others = [each for each in (self._used, *self._cached) if each is not None and each.frozen.serial != serial]
        self._cached = [each for each in others if each.frozen.number == number and each.frozen.is_last][:MAX_CACHED]
        kept = {(each.frozen.number, each.frozen.serial) for each in (freezing, *self._cached)}
        self._noises = {numbers: noise for numbers, noise in self._noises.items() if numbers in kept}
        self._used, self._drawn, self._nearest_to = freezing, None, None
        if self._relit is not None and self._relit.number != freezing.frozen.number:
            self._relit = None
        self.picture.forget_drawn()

    def _use_nearest(self, document: Document, desired: DesiredFreezing) -> None:
        """Use the freezing for these edits whose curves are nearest to the document's, as undo goes back to: far from
        those that were frozen, gloss follows coarsely, with specks where light falls. Once for each edit."""
        if self._used is None or self._nearest_to is desired:
            return
        serving = [each for each in (self._used, *self._cached) if each.made_for.serves(desired)]
        nearest = min(serving, key=lambda each: self._distance(each.frozen, document), default=self._used)
        if nearest is not self._used:
            self._use(nearest)
        self._nearest_to = desired

    def _distance(self, frozen: IndirectFrozen, document: Document) -> tuple[bool, float]:
        """How far a document's curves are from those that were frozen; an early answer is farther than any other."""
        return not frozen.is_last, frozen.light.departure(light_edit(document, frozen, self._curves))

    def means_changed(self) -> None:
        """The albedo of layers became known otherwise than by an edit: the mean of a texture."""
        self._desired_inputs = None, None, None

    def receive_noise(self, response: IndirectNoise) -> None:
        """Take the noise of a freezing."""
        self._noises[response.number, response.serial] = response

    def receive_improved(self, response: IndirectImproved) -> None:
        """Take light with more rays: samples, freezing and noise in one."""
        self.receive_samples(replace(response.found, revision=response.revision))
        self.receive_frozen(response.frozen)
        self.receive_noise(response.noise)

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(
        self, now: float, document: Document, selected: Selection | None, n_bounces: int, second: int | None,
        revision: int,
    ) -> list[PictureEvent]:  # fmt: skip
        """Request what is missing; returns the radiances that changed."""
        self.request_missing(now, document, selected, n_bounces, second, revision)
        return self.follow(document, revision)

    def request_missing(
        self, now: float, document: Document, selected: Selection | None, n_bounces: int, second: int | None,
        revision: int, may_request: bool = True,
    ) -> None:  # fmt: skip
        """Request what is missing. second: the most bands of the second bounce, None for as many as a curve has;
        revision: of the transport requested last; may_request: whether the worker has the scene and the view open."""
        self._n_bounces = n_bounces
        if n_bounces <= 1:
            return
        desired = self._desired_state(document, selected, second)
        self._use_nearest(document, desired)
        self._reconcile(now, desired, revision, may_request)
        if self._used is None:
            self._complete = self._fits = False
            return
        made_for, number = self._used.made_for, self._used.frozen.number
        fine = self.found_under(revision)
        self._fits = made_for.serves(desired)
        is_final = fine is not None and fine.number == number  # it is the newest light, and of this transport
        is_whole = self._used.frozen.is_last and self._noise_of_used is not None
        self._complete = self._fits and is_final and is_whole and made_for.same(desired)

    def _accept_stored(self, desired: DesiredFreezing, revision: int) -> None:
        """Where what is used again is all that is desired, and nothing better is to come, request nothing."""
        used, fine = self._used, self.found_under(revision)
        if self._reconciler.is_ready or used is None or fine is None or used.frozen.number != fine.number:
            return
        if used.frozen.is_last and self._noise_of_used is not None and used.made_for.same(desired):
            if used.made_for.serves(desired):
                self._reconciler.accept(used.frozen, (used.made_for, revision))

    def _desired_state(self, document: Document, selected: Selection | None, second: int | None) -> DesiredFreezing:
        """The desired freezing, computed once: most frames find nothing changed, and processors are the worker's."""
        before, *rest = self._desired_inputs
        if self._desired is None or before is not document or rest != [selected, second]:
            self._desired_inputs = document, selected, second
            self._desired = desired_freezing(document, selected, second, self._curves)
        return self._desired

    def _reconcile(self, now: float, desired: DesiredFreezing, revision: int, may_request: bool) -> None:
        """Request a freezing: at once where the one before does not serve, once the user is idle where it does."""
        reconciler = self._reconciler
        if reconciler.requested is not None and reconciler.requested.desired[1] != revision:
            self.lose_request()  # other transport has cancelled it
        reconciler.desire(now, (desired, revision))
        self._accept_stored(desired, revision)
        if reconciler.requested is None or not reconciler.requested.desired[0].serves(desired):
            reconciler.skip_idle()
        if self._used is not None and self.picture.departure > FAR:
            reconciler.skip_idle()
        if reconciler.action(now, may_request) == "request":
            self._n_sent += 1
            request = FreezeIndirect(
                desired.scene,
                desired.key,
                desired.factor,
                desired.second,
                self._n_sent,
                tuple(desired.edited.items()),
                revision=revision,
            )
            self._sent_id = self._send(request)
            reconciler.sent(now, self._n_sent)
            self._fraction = None

    def follow(self, document: Document, revision: int | None) -> list[PictureEvent]:
        """The radiances that changed, of the document at the last request. revision: of the transport under whose light
        the document is, None where that has not been requested."""
        if self._n_bounces <= 1:
            self._reconciler.restart()
            self._used = self._drawn = self._relit = None
            return self.picture.remove()
        if self._used is None or not self._fits or self._drawn is self._desired:
            return []
        if self._lit_under != revision and self._used.frozen.number != self.picture.number:
            return []  # it was frozen for a light that is not the document's any more
        self._drawn = self._desired
        return self.picture.draw(document, self._used, self._relit)

    def follow_light(self, document: Document, revision: int) -> list[PictureEvent]:
        """The same, of a document that is drawn in place of the present one: the light is on its way to that, or other
        edits are. revision: of the transport whose light it has."""
        is_relit = self._relit is not None and self._relit.revision == revision
        if self._n_bounces <= 1 or self._used is None or not (is_relit or self._lit_under == revision):
            return []
        _, selected, second = self._desired_inputs
        if not self._used.made_for.has_layers_of(desired_freezing(document, selected, second, self._curves)):
            return []
        self._drawn = None
        return self.picture.draw(document, self._used, self._relit)
