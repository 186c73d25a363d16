"""What the camera sees where the scene has no surface.

The environment lights the scene whatever is behind it: a colour or nothing in its place changes no light, so it is no
part of `LightState`, and an edit of it computes nothing again. The colour is radiance as it appears in the picture:
exposure and the view transform apply to it, the intensity of the light does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.document.light_state import RGB

BackgroundKind = Literal["environment", "colour", "transparent"]
BACKGROUND_KINDS: tuple[BackgroundKind, ...] = get_args(BackgroundKind)


@dataclass(frozen=True)
class Background:
    """kind: the environment, one colour (linear Rec. 709), or transparent: pictures have alpha."""

    kind: BackgroundKind = "environment"
    colour: RGB = (0.8, 0.8, 0.8)

    @property
    def hides_environment(self) -> bool:
        """Whether pictures are drawn without the environment, with alpha."""
        return self.kind != "environment"

    def behind(self, picture: NDArray[np.floating]) -> NDArray[np.float32]:
        """A picture (H, W, 4), whose alpha is multiplied into its light, over this background: (H, W, 3), or the
        picture itself where the background is transparent or the environment, which pictures contain."""
        if self.kind != "colour":
            return np.asarray(picture, np.float32)
        share_behind = 1.0 - picture[..., 3:]
        return np.asarray(picture[..., :3] + share_behind * np.asarray(self.colour, np.float32), np.float32)
