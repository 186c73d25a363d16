"""The worker's part of matching a material: its measured files, the fit, and both pictures in place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.light_mix import mixed_light
from app.document.named_files import unread_files, with_measurements
from app.messages.match_messages import MatchMaterial, MatchProgress, MaterialMatched
from app.project.matching import match_steps
from app.worker.file_tasks import ensure_tables, read_files
from app.worker.kernels import ESTIMATE
from app.worker.schedule import Steps
from engine.core.generators import map_steps
from engine.planner import band_counts

if TYPE_CHECKING:
    from app.worker.tasks import WorkerContext


def match_material(request: MatchMaterial, context: WorkerContext) -> Steps:
    """The responses. Raises InsituError."""
    match, document, placement = request.match, request.document, context.open_placement
    yield MatchProgress(0.0, "reading the material")
    files = unread_files(match.layers)
    if files:
        found = yield from read_files({file: Path(file) for file in files}, context.store)
        match = replace(match, layers=with_measurements(match.layers, found))
    yield from ensure_tables((*match.layers, *(layer for _, layer in document.layers())), context.store)
    yield from context.until_compiled(ESTIMATE)
    steps = match_steps(match, document, placement, context.sky(mixed_light(document)), request.n_bounces)
    layer, errors = yield from map_steps(steps, lambda step: MatchProgress(*step))
    yield MaterialMatched(layer, errors, band_counts(layer))
