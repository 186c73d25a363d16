"""What there is to see of the selected material's BRDF, and what of it the panels of this frame show.

A noticeboard like `Handles`: panels note what they draw, `ui.brdf_feed` makes that and nothing else. What is not there
yet is None.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from ui.gl.brdf_views import Albedo, BrdfSlice
from ui.panels.picture import Picture
from ui.surface_lobe import SurfaceLobe

Part = Literal["sphere", "lobe", "slice", "albedo", "surface"]


def _nothing(theta_h: float, theta_d: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


class BrdfBoard:
    """`shown` are the parts on screen; `problem` says in one line why there is nothing to see of this material.

    `curves_alone`: of a measured layer what is shown is the product of its curves, its measurement being on its way, or
    for the reason that `why_alone` tells not to be had.
    """

    def __init__(self) -> None:
        self.shown: set[Part] = set()
        self.sphere_side = 96
        self.sphere: Picture | None = None
        self.slice: Picture | None = None
        self.slice_value: Callable[[float, float], tuple[float, float, float]] = _nothing
        self.lobe: BrdfSlice | None = None
        self.albedo: Albedo | None = None
        self.surface: SurfaceLobe | None = None
        self.problem = ""
        self.curves_alone = False
        self.why_alone = ""

    def begin_frame(self) -> None:
        """Nothing is shown until a panel says so."""
        self.shown.clear()

    def clear(self) -> None:
        """There is no material."""
        self.sphere = self.slice = self.lobe = self.albedo = self.surface = None
        self.problem = ""
