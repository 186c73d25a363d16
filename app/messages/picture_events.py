"""Picture events: what the editor sends the renderer, in the order of the worker's responses.

Those of every mode are here; those of one mode are in its folder.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from engine.scene.description import SceneDescription
from engine.scene.picture_frame import PictureFrame


@dataclass(frozen=True, eq=False)
class PictureEvent:
    """A part of the picture has come or changed.

    with_next: it must not be shown without the event that follows.
    """

    with_next: bool = field(default=False, kw_only=True)


@dataclass(frozen=True, eq=False)
class SceneFrame(PictureEvent):
    """A scene was opened, or is seen from another camera, that of its description: all pictures before it are void.

    opening: the number of the request that opened it; the same where only the view of the scene changed.
    """

    opening: int
    source: str
    description: SceneDescription
    frame: PictureFrame


@dataclass(frozen=True, eq=False)
class SkyChanged(PictureEvent):
    """Another environment is behind the scene: radiance (H,W,3), lat-long, not rotated, intensity 1."""

    radiance: NDArray[np.floating]
