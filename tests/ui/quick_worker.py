"""A worker's process whose finest indirect light is the quick one, whose errors are judged quickly, and whose
Orbit has few points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.worker.kernels import prepared_tasks

if TYPE_CHECKING:
    from app.worker.tasks import RequestDispatcher

HANDLERS = "tests.ui.quick_worker:quick_tasks"


def quick_tasks() -> RequestDispatcher:
    """The worker's own, but for these."""
    tasks = prepared_tasks()
    from app.worker import indirect_tasks
    from app.worker.orbit_worker import OrbitWorker
    from engine.render import error_estimate
    from tests.quick_indirect import QUICK

    indirect_tasks.FINE = QUICK
    error_estimate.FINER_PATCHES = 1
    OrbitWorker.n_points = 300
    return tasks
