"""`benchmarks.programs.indirect` over a worker whose finest light is the quick one; no edit is made to warm up."""

import functools
import sys

from app.worker.client import Client
from tests.ui.quick_worker import HANDLERS
from ui import measure_gl, measure_indirect

if __name__ == "__main__":
    measure_gl.Client = functools.partial(Client, HANDLERS)
    measure_indirect.WARM_UP = 0
    sys.exit(measure_indirect.main())
