"""What is to be said of Deform's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.orbit.messages import Carried
from app.orbit.status import OrbitStatus


@dataclass(frozen=True)
class DeformStatus(OrbitStatus):
    """The status while Deform's picture is seen. lost: see `app.deform.messages.DeformKnown`; alone: objects, by
    name, whose surfaces Deform alone knows, so that Placement does not take the picture over; carried: see
    `app.orbit.messages.OrbitDrawn`."""

    lost: tuple[tuple[str, float], ...] = ()
    alone: tuple[str, ...] = ()
    carried: Carried = ()
