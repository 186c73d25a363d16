"""A mode makes pictures of one document. It has three roles, defined here, and a name for each.

    window's process                 worker                        window's process, GL
    ModeController ── requests ──► ModeWorker ── responses ──► ModeController ── picture events ──► PictureSource
    (`ui.picture_feed`)

The editor knows modes only by this module, and one controller at a time: that of the mode the user has chosen. Each
method of a controller is an event of the editor; the defaults here ignore it. `app.modes.registry` lists the modes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.history import History
from app.document.view_state import ViewState
from app.messages.editor_status import Status, StatusMetrics
from app.messages.picture_events import PictureEvent, SkyChanged
from app.messages.worker_messages import Request, Response
from app.system.barrier import Barrier
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import SceneDescription

if TYPE_CHECKING:
    from app.modes.placement.highlight_controller import HighlightController
    from app.worker.schedule import Handlers
    from app.worker.tasks import WorkerContext


Shared = TypeVar("Shared")
StillMode = Literal["placement", "orbit", "deform"]


class EditorServices(Protocol):
    """The services of the editor for a mode controller."""

    barrier: Barrier
    metrics: StatusMetrics
    history: History[Document]
    view: ViewState

    @property
    def pictured(self) -> Document:
        """The document that pictures are made of now, see `with_nodes`: with the objects of the traced scene, whatever
        the present document has."""

    @property
    def pictured_view(self) -> ViewState:
        """The view of that document: without the selection of what it does not have."""

    def shared_state(self, kind: type[Shared]) -> Shared:
        """State that one controller leaves to the next, one of a kind; made where there is none yet."""

    def send(self, request: Request) -> int:
        """Send a request to the worker; returns its number."""

    def notify(self, text: str, is_error: bool = False) -> None:
        """Show one line to the user."""

    def notify_once(self, note: str) -> None:
        """Show a line the first time it comes up in a scene; does nothing where it is empty."""

    def with_nodes(self, document: Document) -> Document:
        """The document that pictures of a document are made of, see `app.document.node_layers`."""

    def document_changed(self) -> None:
        """Report that the controller itself has taken something out of the document."""


@dataclass(frozen=True, eq=False)
class OpenedScene:
    """The scene that the worker has open: the number of its traced view, what was planned of its layers, what its file
    says, the document that this describes, and the one that pictures are made of now; notes: warnings about the
    scene; poses: those in the traced view."""

    view_id: int
    planned: tuple[tuple[Layer, dict[str, int]], ...]
    description: SceneDescription
    described: Document
    document: Document
    notes: tuple[str, ...] = ()
    poses: Poses = ()


class ModeController(Protocol):
    """A mode in the window's process: what to request of the worker for a document and a view, and what responses mean.

    `update` compares the desired state with what was requested and what has come, once a frame; all other methods only
    take notes.
    """

    def __init__(self, services: EditorServices) -> None: ...

    @property
    def highlights(self) -> HighlightController | None:
        """The strokes that are painted over its picture; None where that is not possible."""
        return None

    def scene_closed(self) -> None:
        """Another scene is being opened: there is nothing to request meanwhile."""

    def scene_open_failed(self) -> None:
        """The scene could not be opened: the one before is still there."""

    def scene_opened(self, scene: OpenedScene) -> None:
        """The worker has opened and traced a scene; there is no picture of it yet."""

    def view_moved(self) -> None:
        """The view is not the one that the worker has traced; it is traced again once idle."""

    def view_requested(self) -> None:
        """The worker was asked for another view, and has given up what it did for the one before."""

    def view_restored(self) -> None:
        """The view is again the one that the worker has traced."""

    def view_traced(self, scene: OpenedScene) -> None:
        """The worker has traced the same scene from another camera or in another resolution."""

    def deactivated(self) -> None:
        """Another mode was chosen: what the worker does for this one is of no use, and this controller ends."""

    def edited(self, command: EditCommand | None = None) -> None:
        """Document or selection changed, by this command or in another way (undo)."""

    def drag_ended(self) -> None:
        """A drag ended: what waits for the idle time need wait no longer."""

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        """Request what is missing; once a frame. Returns what the picture is to follow. now: seconds of a steady
        clock; document: the one that pictures are made of."""
        return []

    def receive(self, response: Response) -> list[PictureEvent]:
        """Process a response of the worker, which may be another's; returns what the picture needs of it."""
        return []

    def sky_changed(self, event: SkyChanged) -> list[PictureEvent]:
        """Another sky is behind the scene; returns what the picture needs of that now."""
        return [event]

    def status(self, status: Status) -> Status:
        """The status with what this mode has to say of the picture."""
        return status

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        """Take the worker's plan of layers that the document is about to get."""

    def reload_images(self, key: str) -> None:
        """Another program has changed the images of a layer."""

    @property
    def awaits_response(self) -> bool:
        """Whether the user waits for a response that is due at any moment."""
        return False

    @property
    def is_running(self) -> bool:
        """Whether the worker is computing the picture."""
        return False

    @property
    def still_mode(self) -> StillMode:
        """The mode of stills that are drawn as the newest picture is."""
        return "placement"

    @property
    def is_whole(self) -> bool:
        """Whether that picture is complete."""
        return self.status(Status()).is_finished

    def await_catchers(self, awaits: bool) -> None:
        """Note whether Placement's picture is still to show shadow catchers as objects, which soon are not; once a
        frame."""
        return

    @property
    def follows_objects(self) -> bool:
        """Whether pictures show objects where they are dragged to, before the view is traced."""
        return False

    def cancelled(self) -> None:
        """The user stopped the work; what has come stays."""

    def resume(self) -> None:
        """Go on with what was stopped or has failed."""

    def worker_restarted(self) -> None:
        """A new worker runs; it knows nothing but the pending requests."""


class ModeWorker(Protocol):
    """A mode in the worker: it carries out the mode's requests. Its handlers import what is slow to import."""

    def __init__(self, context: WorkerContext) -> None: ...

    @property
    def handlers(self) -> Handlers:
        """The handlers of each of its kinds of request, run step by step."""
        return {}

    def view_traced(self) -> None:
        """The worker context has another scene, or another traced view."""

    def plan(self, layers: Iterable[Layer]) -> tuple[tuple[Layer, dict[str, int]], ...]:
        """Plan layers before the window sees them; returns the number of bands of each, by factor."""
        return ()


@dataclass(frozen=True)
class Mode:
    """A mode: its name, and for users its title and its purpose.

    Its parts are written as "module:name", because only one process or layer imports each. controller: makes its
    `ModeController`, given the editor's services; worker: its `ModeWorker`; picture: its
    `ui.picture_feed.PictureSource`; accuracy: draws its part of the Accuracy panel; tools: draws its controls for the
    selected object, above the material; strip: draws below the picture; handles: the handles that can be dragged in the
    picture (`ui.panels.picture_overlays`).
    """

    name: str
    title: str
    controller: str
    worker: str
    picture: str
    tooltip: str = ""
    accuracy: str = ""
    tools: str = ""
    strip: str = ""
    handles: str = ""
