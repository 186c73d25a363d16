"""A picture that panels may draw."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui


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
