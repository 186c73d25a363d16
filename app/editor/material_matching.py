"""Materials that are matched with a model: one request under way at a time, whose answer is one edit.

A newer request takes the place of the one before. The answer is put on the object as the document is by then; the end
of a drag is waited for, of which it is no part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.linked_layers import Layers
from app.document.material_match import MaterialMatch
from app.document.view_state import ViewState
from app.messages.match_messages import MatchErrors, MatchMaterial, MatchProgress, MaterialMatched
from app.messages.worker_messages import CancelRequests, Request, RequestFailed
from app.modes.mode import ModeController


class MatchHost(Protocol):
    """What it needs of the editor."""

    view: ViewState
    controller: ModeController

    @property
    def document(self) -> Document: ...

    def with_nodes(self, document: Document) -> Document: ...

    def do(self, command: EditCommand) -> str | None: ...

    def select(self, path: str | None) -> str | None: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


@dataclass(frozen=True)
class MatchOutcome:
    """What became of a match: the layers that the object has of it, and its errors."""

    match: MaterialMatch
    layers: Layers
    errors: MatchErrors


class MaterialMatching:
    """The matches of one editor. `send` sends a request and returns its number."""

    def __init__(self, host: MatchHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self._sent: tuple[int, MaterialMatch] | None = None
        self._late: MaterialMatched | None = None  # an answer that came during a drag
        self._progress = ""
        self._outcome: MatchOutcome | None = None

    @property
    def is_under_way(self) -> bool:
        """Whether an answer is still to come, or to be put on the object."""
        return self._sent is not None

    @property
    def progress(self) -> str:
        """What is being matched and how far that is, "" where nothing is."""
        return self._progress

    def outcome(self, document: Document) -> MatchOutcome | None:
        """The last match, as long as the document has what it found."""
        found = self._outcome
        if found is None or all(each.name != found.match.object for each in document.objects):
            return None
        return found if document.object(found.match.object).layers == found.layers else None

    def note(self, document: Document) -> tuple[str, str]:
        """The object of the last match, and it in words with both errors; "" where the document no longer has it."""
        found = self.outcome(document)
        if found is None:
            return "", ""
        return found.match.object, f"{found.match.command(found.layers[0]).name}: error {found.errors.text}"

    def request(self, match: MaterialMatch) -> str | None:
        """Match a material; returns None, or one line that says why it cannot be. Raises InsituError as well."""
        host = self._host
        match.start(host.document)
        n_bounces = effective_view(host.view, host.document).settings.n_bounces
        self._sent = self._send(MatchMaterial(match, host.with_nodes(host.document), max(n_bounces, 1))), match
        self._late, self._progress = None, _words(match, 0.0)
        return None

    def cancel(self) -> None:
        """Give up the match that is under way; the material stays."""
        if self._sent is not None:
            self._send(CancelRequests(of=(MatchMaterial,)))
            self.forget()
            self._host.notify("the match was stopped; the material is as it was")

    def forget(self) -> None:
        """No answer comes any more: all work was stopped, or another scene is opened."""
        self._sent = self._late = None
        self._progress = ""

    def receive(self, response: MatchProgress | MaterialMatched, is_dragging: bool) -> None:
        """Take a response."""
        if self._sent is None or response.id != self._sent[0]:
            return
        if isinstance(response, MatchProgress):
            self._progress = _words(self._sent[1], response.fraction)
        elif is_dragging:
            self._late = response
        else:
            self._put(self._sent[1], response)

    def receive_failure(self, response: RequestFailed) -> bool:
        """A request failed; returns whether it was a match."""
        if self._sent is None or response.id != self._sent[0]:
            return False
        match = self._sent[1]
        self.forget()
        self._host.notify(f"{match.source} was not matched: {response.line}", True)
        return True

    def drag_ended(self) -> None:
        """Put on the object what came during a drag."""
        if self._sent is not None and self._late is not None:
            self._put(self._sent[1], self._late)

    def _put(self, match: MaterialMatch, response: MaterialMatched) -> None:
        self.forget()
        host, command = self._host, match.command(response.layer)
        host.controller.add_band_plans([(response.layer, response.planned)])
        if host.do(command) is not None:
            return
        self._outcome = MatchOutcome(match, host.document.object(match.object).layers, response.errors)
        host.select(match.object)
        images = "; its images are left out" if match.has_images else ""
        host.notify(f"{command.name}: error {response.errors.text}{images}")


def _words(match: MaterialMatch, fraction: float) -> str:
    return f"matching {match.source} {100.0 * fraction:.0f} %"
