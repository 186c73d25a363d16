"""What a worker does before its first task: it says where compiled kernels are kept, while nothing of the engine is
imported yet."""

from __future__ import annotations

from distributed import Worker, WorkerPlugin

from app.machine.kernel_cache import use_kernel_cache


class KernelCache(WorkerPlugin):
    """Sent to all workers, also those that come later."""

    name = "insitu-kernel-cache"

    def setup(self, worker: Worker) -> None:
        use_kernel_cache()
