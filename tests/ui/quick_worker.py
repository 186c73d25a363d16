"""A worker's process whose finest indirect light is the quick one, whose errors are judged quickly, and whose
Orbit has few points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.jobs.kernels import prepared_tasks

if TYPE_CHECKING:
    from app.jobs.tasks import Tasks

HANDLERS = "tests.ui.quick_worker:quick_tasks"


def quick_tasks() -> Tasks:
    """The worker's own, but for these."""
    tasks = prepared_tasks()
    from app.jobs import indirect
    from app.jobs.orbit import OrbitWork
    from engine.render import error_estimate
    from tests.fineness import QUICK

    indirect.FINE = QUICK
    error_estimate.FINER_PATCHES = 1
    OrbitWork.n_points = 1000
    return tasks
