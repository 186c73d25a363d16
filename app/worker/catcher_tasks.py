"""Finds what shadow catchers show where nothing stands on them: a still of these and what emits, alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.document.light_mix import mixed_light
from app.messages.catcher_messages import CatcherLightFound, CatcherProgress, FindCatcherLight
from app.worker.file_tasks import ensure_tables
from app.worker.kernels import ESTIMATE, INDIRECT
from app.worker.schedule import Steps
from engine.core.generators import map_steps

if TYPE_CHECKING:
    from app.worker.tasks import WorkerContext
    from engine.precompute.direct.pipeline import Quality

_NOTHING = np.zeros((0, 0, 3), np.float32)


def find_catcher_light(request: FindCatcherLight, context: WorkerContext, quality: Quality | None) -> Steps:
    """The responses. quality: that of the whole picture's direct light. Raises InsituError."""
    document = request.document
    yield from ensure_tables((layer for _, layer in document.layers()), context.store)
    for what in (INDIRECT, ESTIMATE):
        yield from context.until_compiled(what)
    from app.project.project import Project
    from app.stills.shadow_catcher import empty_light
    from app.stills.stills import still_steps

    alone = Project(context.scene_of(document), document, settings=request.settings)
    vars(alone)["sky"] = context.sky_over(alone.scene, mixed_light(document))  # its map is in memory
    yield None
    drawing = still_steps(alone, quality=quality)
    still = yield from map_steps(drawing, lambda step: CatcherProgress(step.fraction))
    part = still.catchers
    if part is None or not part[..., 3].any():
        yield CatcherLightFound(_NOTHING)
    else:
        yield CatcherLightFound(empty_light(part).astype(np.float32))
