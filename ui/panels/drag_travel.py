"""The distance of a drag: pixel by pixel, or a tenth with Shift held.

Measured from where the drag began, or where Shift was last pressed or released, so that a pointer that returns restores
the value to the last bit, and Shift never makes anything jump. Rejected: summing the mouse's steps, which drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

FINE = 0.1
Place = tuple[float, float]


@dataclass(frozen=True)
class Travel:
    """`origin`: where the mouse was, pixels, when what was moved so far was `before` (right, down)."""

    origin: Place
    before: Place = (0.0, 0.0)
    fine: bool = False

    def distance_to(self, mouse: Place) -> Place:
        """Pixels right and down in all, with the mouse at this place."""
        rate = FINE if self.fine else 1.0
        across, down = (
            before + rate * (at - origin) for before, at, origin in zip(self.before, mouse, self.origin, strict=True)
        )
        return across, down

    def with_fine(self, mouse: Place, fine: bool) -> Travel:
        """This travel with Shift held (`fine`) or not from here on."""
        return self if fine == self.fine else Travel(mouse, self.distance_to(mouse), fine)
