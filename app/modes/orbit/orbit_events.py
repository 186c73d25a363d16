"""Picture events of Orbit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.picture_events import PictureEvent

if TYPE_CHECKING:
    from engine.realtime.core.gpu_parts import OrbitPart


@dataclass(frozen=True, eq=False)
class OrbitPicture(PictureEvent):
    """The picture from the view's camera, present or of a moment ago: linear radiance (h, w, 3), or with alpha (h, w,
    4), of fewer pixels than the view's while something moves. is_measure: it is not light but a measure, to be shown in
    false colours; are_caught: it shows shadows in place of their catchers."""

    radiance: NDArray[np.float32]
    is_measure: bool = False
    are_caught: bool = False


@dataclass(frozen=True, eq=False)
class OrbitPartArrived(PictureEvent):
    """A part of what moving pictures are drawn of, where the window draws them."""

    part: OrbitPart
