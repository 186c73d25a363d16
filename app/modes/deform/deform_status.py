"""The status of Deform's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.modes.deform.deform_messages import GlossPlan
from app.modes.orbit.orbit_messages import AnimationOffsets
from app.modes.orbit.orbit_status import OrbitStatus


@dataclass(frozen=True)
class DeformStatus(OrbitStatus):
    """The status while Deform's picture is shown. lost, gloss: see `app.modes.deform.deform_messages`; deform_only:
    names of the objects whose surfaces only Deform can draw, for which Placement does not take over; carried: see
    `app.modes.orbit.orbit_messages.OrbitPictureDrawn`."""

    lost: tuple[tuple[str, float], ...] = ()
    deform_only: tuple[str, ...] = ()
    carried: AnimationOffsets = ()
    gloss: tuple[GlossPlan, ...] = ()
