"""Requests to read and write files in the worker, and its responses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import OpenScene, Request, Response

if TYPE_CHECKING:
    from app.document.document import Document, Variant
    from app.document.view_state import ViewState
    from engine.core.colour import ConfigView
    from engine.core.colour_config import ConfigCatalogue, ViewShader
    from engine.curve.tables import TabulatedCurve
    from engine.material.layer import Layer
    from engine.material.layer_maps import ChannelImage
    from engine.material.parameter_maps import ChannelStatistics
    from engine.material.parameter_nodes import KnownNodes
    from engine.measured.measurement import Measurement
    from engine.scene.added_objects import AddedObject


@dataclass(frozen=True)
class ReadMeasured(Request):
    """Read files of measured BRDFs, fill them and fit factors to them; answered by `MeasurementsRead`.

    layers: those that wait for them; planning the bands of their curves takes longer than the window may be blocked.
    """

    built_on = (OpenScene,)
    priority = 6
    answered_once = True

    files: tuple[str, ...]
    layers: tuple[Layer, ...] = ()


@dataclass(frozen=True)
class ReadMaterials(Request):
    """Read the materials of a MaterialX file, one of which, `name`, "" for the first, an edit waits for; answered by
    `MaterialsRead`."""

    built_on = (OpenScene,)
    priority = 6
    answered_once = True

    file: str
    name: str = ""


@dataclass(frozen=True)
class ReadObjects(Request):
    """Read a shape or the objects of a file, to be added to the open scene: `engine.scene.added_objects.read_added`.
    Answered by `ObjectsRead`."""

    built_on = (OpenScene,)
    priority = 6
    answered_once = True

    what: str
    at: tuple[float, float, float] | None = None
    size: float | None = None


@dataclass(frozen=True)
class ReadChannels(Request):
    """Read images of parameter maps of the open scene, for their statistics, and find the nodes of these documents;
    answered by `ChannelsRead`."""

    built_on = (OpenScene,)
    priority = 3

    images: tuple[ChannelImage, ...]
    documents: tuple[Document, ...] = ()


@dataclass(frozen=True)
class ReadCurveTable(Request):
    """Read the table of a curve from a file or, where there is `text`, from that; `name`: the file, or what to call the
    text. Answered by `CurveTableRead`."""

    built_on = (OpenScene,)
    priority = 4
    answered_once = True

    name: str
    text: str | None = None


@dataclass(frozen=True)
class ReadColourView(Request):
    """Read a view of an OpenColorIO configuration; answered by `ColourViewRead`."""

    priority = 2
    answered_once = True
    is_stopped_by_user = False

    view: ConfigView


@dataclass(frozen=True)
class ReadPicture(Request):
    """Read a finished picture from a file; answered by `PictureRead`. may_have_gaps: values that are not finite become
    0, for a picture that is only looked at; else they are refused, for no error can be measured of them."""

    priority = 4
    answered_once = True
    is_stopped_by_user = False

    file: str
    may_have_gaps: bool = False


@dataclass(frozen=True)
class WriteFiles(Request):
    """Export for other programs: the reflection of layers as a MERL file; or, with a `document`, the open scene as a
    folder for Mitsuba 3, with so many bounces. Answered by `FilesWritten`."""

    built_on = (OpenScene,)
    priority = 7
    answered_once = True

    path: str
    layers: tuple[Layer, ...]
    document: Document | None = None
    n_bounces: int = 1


@dataclass(frozen=True)
class SaveEnvironment(Request):
    """Write the environment of the open scene as a document lights it to an OpenEXR file (`app.export.environment`).
    Answered by `FilesWritten`."""

    built_on = (OpenScene,)
    priority = 7
    answered_once = True

    path: str
    document: Document


@dataclass(frozen=True)
class SaveScene(Request):
    """Save the document and the view with all files of the open scene: in a folder, or in an archive
    (`app.export.package`). Answered by `FilesWritten`."""

    built_on = (OpenScene,)
    priority = 7
    answered_once = True

    path: str
    document: Document
    view: ViewState


@dataclass(frozen=True)
class MeasurementsRead(Response):
    """The measurements of a `ReadMeasured`, by file; `planned`: bands by factor of its layers, in their order."""

    found: dict[str, Measurement]
    planned: tuple[dict[str, int], ...] = ()


@dataclass(frozen=True, eq=False)
class MaterialsRead(Response):
    """The materials of a `ReadMaterials`; chosen: the one that was asked for; planned: bands by factor of its layers,
    in their order; notes: what of it is not shown, in short."""

    materials: tuple[Variant, ...]
    chosen: Variant
    planned: tuple[dict[str, int], ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ObjectsRead(Response):
    """The objects of a `ReadObjects`, and notes on their file."""

    objects: tuple[AddedObject, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CurveTableRead(Response):
    """The table of a `ReadCurveTable`."""

    table: TabulatedCurve


@dataclass(frozen=True)
class ChannelsRead(Response):
    """The statistics of the images of a `ReadChannels` and of its documents; refused: of those that cannot be read, one
    line that says why; nodes: those of all maps of its documents."""

    statistics: Mapping[ChannelImage, ChannelStatistics]
    refused: Mapping[ChannelImage, str]
    nodes: KnownNodes = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ColourViewRead(Response):
    """A view of a configuration, and what else this offers."""

    catalogue: ConfigCatalogue
    shader: ViewShader


@dataclass(frozen=True, eq=False)
class PictureRead(Response):
    """Linear light and alpha (H, W, 4) of a `ReadPicture`."""

    light: NDArray[np.float32]


@dataclass(frozen=True)
class FilesWritten(Response):
    """A file or a folder is written; `notes` say what it does not contain."""

    path: str
    notes: tuple[str, ...] = ()
