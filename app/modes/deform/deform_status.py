"""What is to be said of Deform's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.modes.orbit.orbit_messages import AnimationOffsets
from app.modes.orbit.orbit_status import OrbitStatus


@dataclass(frozen=True)
class DeformStatus(OrbitStatus):
    """The status while Deform's picture is seen. lost: see `app.modes.deform.deform_messages.DeformLoss`; alone:
    objects, by name, whose surfaces Deform alone knows, so that Placement does not take the picture over; carried: see
    `app.modes.orbit.orbit_messages.OrbitPictureDrawn`."""

    lost: tuple[tuple[str, float], ...] = ()
    deform_only: tuple[str, ...] = ()
    carried: AnimationOffsets = ()
