"""What the editor tells the renderer of Orbit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.picture import PictureEvent


@dataclass(frozen=True, eq=False)
class OrbitPicture(PictureEvent):
    """The picture from the view's camera as it is, or was a moment ago: linear radiance (h, w, 3), of fewer pixels than
    are shown while something moves."""

    radiance: NDArray[np.float32]
