"""`benchmarks.programs.indirect` with few lights, over a worker whose finest light is the quick one; no edit is made to
warm up."""

import functools
import sys

from app.worker.client import Client
from benchmarks.programs import indirect, renderer
from tests.ui.quick_worker import HANDLERS

if __name__ == "__main__":
    renderer.Client = functools.partial(Client, HANDLERS)
    indirect.EditorRig = functools.partial(renderer.EditorRig, n_lights=200)
    indirect.WARM_UP = 0
    sys.exit(indirect.main())
