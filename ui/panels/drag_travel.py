"""How far a hand has moved since it took hold of something: pixel by pixel, or with Shift held by tenths.

Measured from where it took hold, or last pressed or let go of Shift, so that a hand that returns is back where it began
to the last bit, and Shift never makes anything jump. Rejected: summing the mouse's steps, which drifts.
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
        """Pixels right and down in all, with the mouse there."""
        rate = FINE if self.fine else 1.0
        across, down = (
            before + rate * (at - origin) for before, at, origin in zip(self.before, mouse, self.origin, strict=True)
        )
        return across, down

    def with_fine(self, mouse: Place, fine: bool) -> Travel:
        """This travel with Shift held (`fine`) or not from here on."""
        return self if fine == self.fine else Travel(mouse, self.distance_to(mouse), fine)
