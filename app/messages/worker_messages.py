"""What the window asks of the worker, and what the worker answers: one frozen dataclass a message.

Every message carries `id`, the request it belongs to, and `revision`, the document it was made from. Both may be left
out: the client numbers a request as it is sent, and the worker stamps an answer with the numbers of its request; an
answer that belongs to another one, the scene's, says so by its own `id`.

Shapes: P pixels that see a reflecting object, p those of one layer, J bands, H × W the picture. Images have row 0 at
the top. Arrays of 4 KiB and more cross in shared memory and arrive read-only (see `app.worker.shared_arrays`).
Messages that hold arrays compare by identity, since arrays have no single truth value.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from app.document.document import Document
    from engine.material.bumps import BumpsByObject
    from engine.material.layer import Layer
    from engine.measured.measurement import Measurement
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.scene.description import Camera
    from engine.scene.picture_frame import PictureFrame
    from engine.scene.rig import Animations


@dataclass(frozen=True, kw_only=True)
class Message:
    id: int = 0
    revision: int = 0


# ------------------------------------------------------------------------------------------------------------- requests


@dataclass(frozen=True)
class Request(Message):
    """From the window to the worker; a newer request of one kind cancels the older, and what is built on that.

    What the two processes need to know of a kind it says itself. `built_on`: kinds that it means nothing without.
    `priority`: it is served between the steps of long ones, which none of it may be; the lower number goes first; None:
    it is a long one. `answered_once`: answered once and for all, not again to a worker that is started anew.
    `exclusive`: nothing is served before it is done, but what is served at `served_anytime`. `is_stopped_by_user`: a
    person who stops the work means it as well. `is_foreground`: a person waits for the answer; of all others the
    processors are left to whoever wants them.
    """

    built_on: ClassVar[tuple[type[Request], ...]] = ()
    priority: ClassVar[int | None] = None
    answered_once: ClassVar[bool] = False
    exclusive: ClassVar[bool] = False
    served_anytime: ClassVar[bool] = False
    is_stopped_by_user: ClassVar[bool] = True
    is_foreground: ClassVar[bool] = True

    @classmethod
    def needs(cls, kind: type[Request]) -> bool:
        """Whether it is of that kind or built on it."""
        return cls is kind or any(each.needs(kind) for each in cls.built_on)

    @classmethod
    def depth(cls) -> int:
        """How many kinds stand below it: those come first."""
        return 1 + max(each.depth() for each in cls.built_on) if cls.built_on else 0

    def cancels(self, kind: type[Request]) -> bool:
        """Whether requests of that kind are void once this one is there."""
        return kind.needs(type(self))


@dataclass(frozen=True)
class OpenScene(Request):
    """Load a scene; what was asked of the scene before is cancelled. It is open once it is seen: `SetCamera`.

    measured: files of measured BRDFs that are to be read besides those that the scene names; layers: those of a
    session, whose curves are planned as well.
    """

    exclusive = True

    source: str
    measured: tuple[str, ...] = ()
    layers: tuple[Layer, ...] = ()


@dataclass(frozen=True)
class SetCamera(Request):
    """Trace what the scene of this number (that of its `OpenScene`) shows from a camera, in so many pixels (width,
    height), None: as its file has them; with objects in these poses and under these bumps; so many rays go
    through a pixel at an edge, None: as many as the scene requires. Answered by `ViewTraced`."""

    built_on = (OpenScene,)
    exclusive = True

    scene: int
    camera: Camera | None = None
    resolution: tuple[int, int] | None = None
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = 0


@dataclass(frozen=True)
class ReadMeasured(Request):
    """Read files of measured BRDFs, fill them and fit factors to them; answered by `MeasurementsRead`.

    layers: those that wait for them; how many bands their curves need takes longer to say than the window may be
    blocked.
    """

    built_on = (OpenScene,)
    priority = 6
    answered_once = True

    files: tuple[str, ...]
    layers: tuple[Layer, ...] = ()


@dataclass(frozen=True)
class FetchTable(Request):
    """Hand out the samples of a measured BRDF, read first where they are not there. number: what names them where
    the file was read before, 0 for whatever it holds. Answered by `TableFetched`."""

    priority = 5
    answered_once = True
    is_stopped_by_user = False

    file: str
    number: int = 0


@dataclass(frozen=True)
class WriteFiles(Request):
    """Write for other programs: what layers reflect as a MERL file; or, of a `document`, the scene that is open as a
    folder for Mitsuba 3, by so many bounces. Answered by `FilesWritten`."""

    built_on = (OpenScene,)
    priority = 7
    answered_once = True

    path: str
    layers: tuple[Layer, ...]
    document: Document | None = None
    n_bounces: int = 1


@dataclass(frozen=True)
class CancelRequests(Request):
    """Drop what is running or waiting; an opened scene stays open. of: only these kinds, and what is built on them."""

    of: tuple[type[Request], ...] = ()

    def cancels(self, kind: type[Request]) -> bool:
        return any(kind.needs(each) for each in self.of) if self.of else kind.is_stopped_by_user


@dataclass(frozen=True)
class Shutdown(Request):
    """End the worker process."""


# ------------------------------------------------------------------------------------------------------------ responses


@dataclass(frozen=True)
class Response(Message):
    """From the worker to the window."""


@dataclass(frozen=True, eq=False)
class SceneOpened(Response):
    """The scene as the window needs it; `description` is JSON.

    `measurements`: what was read, by the names that asked for it. `planned`: what each of the scene's own layers needs,
    and of a session's those that are others, with what was read for them: of each curve, by factor, how many bands;
    planned here because it takes longer than the window may be blocked. `boxes` (M, 2, 3): the least and the largest
    corner of each object in the world, not a number where it has no surface. `animations`: each object's. `files`: what
    the scene was read from.
    """

    description: str
    notes: tuple[str, ...] = ()
    measurements: dict[str, Measurement] = field(default_factory=dict)
    planned: tuple[tuple[Layer, dict[str, int]], ...] = ()
    boxes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2, 3)))
    animations: tuple[Animations, ...] = ()
    files: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ViewTraced(Response):
    """What the camera sees; flaws: what is wrong with images of bumps, which are flat then, a line each."""

    frame: PictureFrame
    flaws: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasurementsRead(Response):
    """The measurements of a `ReadMeasured`, by file; `planned`: bands by factor of its layers, in their order."""

    found: dict[str, Measurement]
    planned: tuple[dict[str, int], ...] = ()


@dataclass(frozen=True, eq=False)
class TableFetched(Response):
    """The samples (90, 90, 180, 3) of a `FetchTable`, 1/sr over theta_h, theta_d and phi_d, and what was fitted."""

    measurement: Measurement
    samples: NDArray[np.float32]


@dataclass(frozen=True)
class FilesWritten(Response):
    """A file or a folder is there; `notes` say what it does not hold."""

    path: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SkyImage(Response):
    """The environment that lights the scene, for the background: radiance (H,W,3), black where there is none.

    Told once, under the first light with it: it belongs to the view, as `StageFootprint` does."""

    radiance: NDArray[np.floating]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Progress(Response):
    """How far a stage is: `fraction` in [0, 1], `seconds_left` None while unknown."""

    stage: str
    fraction: float
    seconds_left: float | None = None
    text: str = ""


@dataclass(frozen=True)
class RequestFailed(Response):
    """The request was given up; `line` is one sentence for the person."""

    line: str


@dataclass(frozen=True)
class WorkerWarnings(Response):
    """What a person should know though the answer does not suffer by it, a line each; nothing is said twice."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class WorkerRestarted(Response):
    """The worker process died or hung and a new one is at work; standing requests were sent again."""

    reason: str


@dataclass(frozen=True)
class Heartbeat(Response):
    """The worker lives. `starting`: still importing; `busy`: at work on request `id`; `idle`: waiting."""

    state: Literal["starting", "idle", "busy"]


AnyMessage = TypeVar("AnyMessage", bound=Message)


def with_numbers(message: AnyMessage, id: int, revision: int) -> AnyMessage:
    """The message with these numbers."""
    if (message.id, message.revision) == (id, revision):
        return message
    return dataclasses.replace(message, id=id, revision=revision)
