"""Pictures that panels draw and others make; with those and the plots of the selected material's BRDF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from imgui_bundle import ImVec2, imgui

from ui.gl.brdf_views import Albedo, BrdfSlice
from ui.surface_lobe import SurfaceLobe


@dataclass(frozen=True)
class Picture:
    """A texture that panels may draw: `reference` for imgui, size in texels. `flipped` when row 0 is the bottom."""

    reference: imgui.ImTextureRef
    width: int
    height: int
    flipped: bool = False

    def corners(self) -> tuple[ImVec2, ImVec2]:
        """Texture coordinates of the picture's upper left and lower right."""
        return (ImVec2(0, 1), ImVec2(1, 0)) if self.flipped else (ImVec2(0, 0), ImVec2(1, 1))


Part = Literal["sphere", "lobe", "slice", "albedo", "surface"]


def _nothing(theta_h: float, theta_d: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


class BrdfBoard:
    """The pictures and plots of the selected material's BRDF, and which of them the panels of this frame show.

    Like `Handles`: panels note what they draw, `ui.brdf_feed` computes that and nothing else. What is not ready is
    None. `shown` are the parts on screen; `problem` says in one line why nothing can be shown of this material.

    `curves_alone`: of a measured layer the product of its curves is shown, because its measurement is on its way, or is
    not available for the reason in `why_alone`.
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
        """Clear the list of shown parts, which panels fill again."""
        self.shown.clear()

    def clear(self) -> None:
        """Note that there is no material."""
        self.sphere = self.slice = self.lobe = self.albedo = self.surface = None
        self.problem = ""
