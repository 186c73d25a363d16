"""What is to be said of Deform's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.orbit.status import OrbitStatus


@dataclass(frozen=True)
class DeformStatus(OrbitStatus):
    """The status while Deform's picture is seen. lost: see `app.deform.messages.DeformKnown`; bends: whether anything
    is in another pose than its file has; alone: objects, by name, whose surfaces Deform alone knows, so that Placement
    does not take the picture over."""

    lost: tuple[tuple[str, float], ...] = ()
    bends: bool = False
    alone: tuple[str, ...] = ()
