"""What a mode is: a way to make pictures of one document. Three roles, each told from here, and a name for each.

    window's process                 worker                        window's process, GL
    ModeController ── requests ──► ModeWorker ── responses ──► ModeController ── picture events ──► PictureSource
    (`ui.picture_feed`)

The editor knows modes by this module alone, and one talk at a time: that of the mode a person has chosen. Each of a
talk's methods is what happens to the editor; those that a mode has no use for it leaves as they are here.
`app.modes.registry` lists the modes there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.history import History
from app.document.view_state import ViewState
from app.messages.editor_status import Status, StatusMetrics
from app.messages.picture_events import PictureEvent, SkyChanged
from app.messages.worker_messages import Request, Response
from app.system.barrier import Barrier
from engine.material.layer import Layer
from engine.scene.description import SceneDescription

if TYPE_CHECKING:
    from app.worker.schedule import Handlers
    from app.worker.worker_context import WorkerContext


Shared = TypeVar("Shared")


class EditorServices(Protocol):
    """What a talk may ask of the editor."""

    barrier: Barrier
    metrics: StatusMetrics
    history: History[Document]
    view: ViewState

    def shared_state(self, kind: type[Shared]) -> Shared:
        """What talks leave to those after them, one of a kind; made where there is none yet."""

    def send(self, request: Request) -> int:
        """Hand a request over to the worker; its number."""

    def notify(self, text: str, is_error: bool = False) -> None:
        """Tell the person one line."""

    def notify_once(self, note: str) -> None:
        """Tell a line the first time it comes up in a scene; nothing where it is empty."""

    def document_changed(self) -> None:
        """The talk itself has taken something out of the document."""


@dataclass(frozen=True, eq=False)
class OpenedScene:
    """The scene that the worker has open: the number of the look that it was seen by, what was planned of its layers,
    what its file says, the document as that describes it, and as it is now; notes: what is odd about the scene."""

    view_id: int
    planned: tuple[tuple[Layer, dict[str, int]], ...]
    description: SceneDescription
    described: Document
    document: Document
    notes: tuple[str, ...] = ()


class ModeController(Protocol):
    """A mode in the window's process: what to ask of the worker for a document and a view, what its answers mean.

    `update` compares what is wanted with what was asked for and has come, once a frame; all else only takes notes.
    """

    def __init__(self, services: EditorServices) -> None: ...

    def scene_closed(self) -> None:
        """Another scene is being opened: there is nothing to ask for meanwhile."""

    def scene_open_failed(self) -> None:
        """It could not be opened: the one before is still there."""

    def scene_opened(self, scene: OpenedScene) -> None:
        """The worker has a scene open, and sees it: nothing is known of its picture."""

    def view_moved(self) -> None:
        """The view is not the one that the worker sees: it will be, once it rests."""

    def view_restored(self) -> None:
        """It is again the one that the worker sees."""

    def view_traced(self, scene: OpenedScene) -> None:
        """The worker sees the same scene from elsewhere, or in other pixels."""

    def deactivated(self) -> None:
        """Another mode was chosen: what the worker does for this one is of no use, and this talk is over."""

    def edited(self, command: EditCommand | None = None) -> None:
        """Document or selection changed, by this command or in another way (undo)."""

    def drag_ended(self) -> None:
        """A drag ended: what waits for the hand to rest need wait no longer."""

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        """Once a frame: ask for what is missing; what the picture is to follow. now: seconds of a steady clock."""
        return []

    def receive(self, response: Response) -> list[PictureEvent]:
        """An answer of the worker, which may be of no interest; what of it the picture needs."""
        return []

    def sky_changed(self, event: SkyChanged) -> list[PictureEvent]:
        """Another sky stands behind the scene; what the picture needs of that now."""
        return [event]

    def status(self, status: Status) -> Status:
        """The status with what is to be said of the picture."""
        return status

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        """What the worker has planned of layers that the document is about to get."""

    def reload_images(self, key: str) -> None:
        """The images of a layer were changed by another program."""

    @property
    def awaits_response(self) -> bool:
        """Whether a person waits for an answer that is due at any moment."""
        return False

    @property
    def is_running(self) -> bool:
        """Whether the worker is at work on the picture."""
        return False

    def cancelled(self) -> None:
        """The person stopped the work; what has come stays."""

    def resume(self) -> None:
        """Go on with what was stopped, or has failed."""

    def worker_restarted(self) -> None:
        """A new worker knows nothing of what was asked but the requests that stand."""


class ModeWorker(Protocol):
    """A mode in the worker: who carries out its requests. What is slow to import, its handlers import."""

    def __init__(self, context: WorkerContext) -> None: ...

    @property
    def handlers(self) -> Handlers:
        """The answers to each of its kinds of request, step by step."""
        return {}

    def view_traced(self) -> None:
        """Another scene is open on the bench, or another camera sees it."""

    def plan(self, layers: Iterable[Layer]) -> tuple[tuple[Layer, dict[str, int]], ...]:
        """What it has to say of layers before the window sees them."""
        return ()


@dataclass(frozen=True)
class Mode:
    """A mode by its name and, for people, its title and what it is for.

    talk: makes its talk at the editor's desk. As "module:name", for only one process or layer imports them: work, its
    `ModeWorker`; picture, its `ui.picture_feed.PictureSource`; accuracy, what draws its part of the Accuracy panel;
    tools, what it has for the selected object, above its material; strip, what it has below the picture;
    handles, what of it in the picture a hand can drag (`ui.panels.picture_handles`).
    """

    name: str
    title: str
    controller: Callable[[EditorServices], ModeController]
    worker: str
    picture: str
    tooltip: str = ""
    accuracy: str = ""
    tools: str = ""
    strip: str = ""
    handles: str = ""
