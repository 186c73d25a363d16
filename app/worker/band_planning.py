"""The worker's part of planning how many bands layers need (`app.modes.placement.band_plans`)."""

from __future__ import annotations

from collections.abc import Iterator

from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import BandsPlanned, PlanBands
from engine.planner import band_counts


def plan_bands(request: PlanBands) -> Iterator[Response | None]:
    """Plan one layer a step: some 10 to 40 ms each."""
    bands = []
    for layer in request.layers:
        bands.append(band_counts(layer))
        yield None
    yield BandsPlanned(tuple(bands))
