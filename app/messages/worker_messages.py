"""The window's requests to the worker, and the worker's responses: one frozen dataclass per message.

Every message has `id`, the request it belongs to, and `revision`, the document it was made from. Both may be left out:
the client numbers a request as it is sent, and the worker sets the numbers of its request in a response; a response
that belongs to another request, the scene's, has that one's `id`.

Shapes: P pixels that see a reflecting object, p those of one layer, J bands, H × W the picture. Images have row 0 at
the top. Arrays of 4 KiB and more cross in shared memory and arrive read-only (see `app.worker.shared_arrays`). Messages
that hold arrays compare by identity, since arrays have no single truth value.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.system.file_watch import FileStamp
from engine.scene.import_report import ImportReport
from engine.scene.loaders.model import ImportedCamera

if TYPE_CHECKING:
    from engine.material.bumps import BumpsByObject
    from engine.material.layer import Layer
    from engine.material.layer_maps import ChannelImage
    from engine.material.opacity import OpacityByObject
    from engine.material.parameter_maps import ChannelStatistics
    from engine.material.parameter_nodes import KnownNodes
    from engine.measured.measurement import Measurement
    from engine.realtime.zonal_harmonics.pose import Poses
    from engine.scene.added_objects import AddedObject
    from engine.scene.composition import Composition, ObjectSource
    from engine.scene.description import Camera, ObjectDescription
    from engine.scene.picture_frame import PictureFrame
    from engine.scene.rig import Animations


@dataclass(frozen=True, kw_only=True)
class Message:
    id: int = 0
    revision: int = 0


# ------------------------------------------------------------------------------------------------------------- requests


@dataclass(frozen=True)
class Request(Message):
    """A message from the window to the worker; a newer request of one kind cancels the older, and what is built on it.

    Each class defines what the two processes need to know of its kind. `built_on`: kinds without which it is void.
    `priority`: it is served between the steps of long ones, and must be short itself; the lower number goes first;
    None: it is a long one. `answered_once`: answered once, not again to a worker that is restarted. `exclusive`:
    nothing is served before it is done, except requests that are `served_anytime`. `is_stopped_by_user`: stopping the
    work stops it as well. `is_foreground`: the user waits for the response; all others run at a lower priority.
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
        """The number of kinds that it is built on: those come first."""
        return 1 + max(each.depth() for each in cls.built_on) if cls.built_on else 0

    def cancels(self, kind: type[Request]) -> bool:
        """Whether requests of that kind are void once this one is there."""
        return kind.needs(type(self))


@dataclass(frozen=True)
class OpenScene(Request):
    """Load a scene; requests for the scene before are cancelled. It is open once its view is traced: `SetCamera`.

    measured: files of measured BRDFs to read besides those that the scene names; layers: those of a session, whose
    curves are planned as well; added: what to read objects from that the scene's file does not have.
    """

    exclusive = True

    source: str
    measured: tuple[str, ...] = ()
    layers: tuple[Layer, ...] = ()
    added: tuple[ObjectDescription, ...] = ()


@dataclass(frozen=True)
class SetCamera(Request):
    """Trace what a camera sees of the scene of this number (that of its `OpenScene`), in a resolution (width, height),
    None: as its file has them; with objects in these poses, under these bumps and as opaque as these; with so many rays
    through a pixel at an edge, None: as many as the scene requires; with these objects, none given: those of its file.
    Answered by `ViewTraced`."""

    built_on = (OpenScene,)
    exclusive = True

    scene: int
    camera: Camera | None = None
    resolution: tuple[int, int] | None = None
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = 0
    opacities: OpacityByObject = ()
    composition: Composition | None = None


@dataclass(frozen=True)
class FetchTable(Request):
    """Hand out the samples of a measured BRDF, read first where they are not there. number: what names them where the
    file was read before, 0 for any content. Answered by `TableFetched`."""

    priority = 5
    answered_once = True
    is_stopped_by_user = False

    file: str
    number: int = 0


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
    """A message from the worker to the window. `is_partial`: the answer to its request is still to come."""

    is_partial: ClassVar[bool] = False


@dataclass(frozen=True, eq=False)
class SceneOpened(Response):
    """The scene as the window needs it; `description` is JSON.

    `measurements`: those read, by the names of the request. `planned`: for each of the scene's own layers, and those of
    a session that differ, with their measurements, the number of bands of each curve, by factor; planned here because
    it takes longer than the window may be blocked. `boxes` (M, 2, 3): the least and the largest corner of each object
    in the world, NaN where it has no surface. `animations`: each object's. `files`: those the scene was read from, each
    with its stamp then. `report`: what they contain, and what of it is not shown. `channels`: statistics of the images
    of parameter maps, the scene's and the request's; `nodes`: of all their maps. `cameras`: those of its files.
    `added`: the request's objects that could be read.
    `has_session`: it is in an archive, with a session.
    """

    description: str
    notes: tuple[str, ...] = ()
    measurements: dict[str, Measurement] = field(default_factory=dict)
    planned: tuple[tuple[Layer, dict[str, int]], ...] = ()
    boxes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2, 3)))
    animations: tuple[Animations, ...] = ()
    files: Mapping[str, FileStamp] = field(default_factory=dict)
    report: ImportReport = ImportReport()
    channels: Mapping[ChannelImage, ChannelStatistics] = field(default_factory=dict)
    cameras: tuple[ImportedCamera, ...] = ()
    nodes: KnownNodes = field(default_factory=dict)
    added: tuple[AddedObject, ...] = ()
    has_session: bool = False


@dataclass(frozen=True, eq=False)
class ViewTraced(Response):
    """The primary hits of the camera; flaws: errors of bump images, which are flat then, a line each; missing: objects
    of the view that it does not have, as they cannot be read; problems: why, a line for each file."""

    frame: PictureFrame
    flaws: tuple[str, ...] = ()
    missing: tuple[ObjectSource, ...] = ()
    problems: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class TableFetched(Response):
    """The samples (90, 90, 180, 3) of a `FetchTable`, 1/sr over theta_h, theta_d and phi_d, and the fitted factors;
    of an anisotropic surface a single value, which is no table."""

    measurement: Measurement
    samples: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SkyImage(Response):
    """The environment that lights the scene, for the background: radiance (H,W,3), black where there is none.

    Sent once, under the first light with it: it belongs to the view, as `StageFootprint` does.
    """

    radiance: NDArray[np.floating]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Progress(Response):
    """How far a stage is: `fraction` in [0, 1], `seconds_left` None while unknown."""

    is_partial = True

    stage: str
    fraction: float
    seconds_left: float | None = None
    text: str = ""


@dataclass(frozen=True)
class RequestFailed(Response):
    """The request was given up; `line` is one sentence for the user."""

    line: str


@dataclass(frozen=True)
class WorkerWarnings(Response):
    """Warnings for the user that do not affect the response, a line each; none is repeated."""

    is_partial = True

    lines: tuple[str, ...]


@dataclass(frozen=True)
class WorkerRestarted(Response):
    """The worker process died or hung and a new one is running; pending requests were sent again."""

    reason: str


@dataclass(frozen=True)
class Heartbeat(Response):
    """The worker is alive. `starting`: still importing; `busy`: at work on request `id`; `idle`: waiting."""

    state: Literal["starting", "idle", "busy"]


AnyMessage = TypeVar("AnyMessage", bound=Message)


def with_numbers(message: AnyMessage, id: int, revision: int) -> AnyMessage:
    """The message with these numbers."""
    if (message.id, message.revision) == (id, revision):
        return message
    return dataclasses.replace(message, id=id, revision=revision)


class WorkerClient(Protocol):
    """The interface of `app.worker.client.Client` that the editor uses."""

    @property
    def alive(self) -> bool: ...

    @property
    def pid(self) -> int | None: ...

    @property
    def arriving(self) -> bool: ...

    def send(self, request: Request) -> int: ...

    def poll(self, budget_s: float = ...) -> list[Response]: ...

    def close(self) -> None: ...
