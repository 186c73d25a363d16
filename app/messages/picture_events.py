"""What the editor tells the renderer: picture events, in the order in which the worker's answers came.

Those of every mode stand here; what else a mode tells its renderer stands with the mode.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from engine.scene.description import SceneDescription
from engine.scene.picture_frame import PictureFrame


@dataclass(frozen=True, eq=False)
class PictureEvent:
    """Something that the picture is made of has come or changed.

    with_next: not to be seen without the event that follows."""

    with_next: bool = field(default=False, kw_only=True)


@dataclass(frozen=True, eq=False)
class SceneFrame(PictureEvent):
    """A scene was opened, or is seen from another camera, that of its description: all pictures before it are void.

    opening: the number of the request that opened it; the same where it is the same scene, seen otherwise."""

    opening: int
    source: str
    description: SceneDescription
    frame: PictureFrame


@dataclass(frozen=True, eq=False)
class SkyChanged(PictureEvent):
    """Another environment stands behind the scene: radiance (H,W,3), lat-long, not rotated, intensity 1."""

    radiance: NDArray[np.floating]
