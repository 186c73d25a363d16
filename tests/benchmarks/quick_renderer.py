"""`benchmarks.programs.renderer` over a worker that judges errors quickly, with few coefficients and edits each."""

import functools
import sys

from app.worker.client import Client
from benchmarks.programs import renderer
from tests.ui.quick_worker import HANDLERS

if __name__ == "__main__":
    renderer.Client = functools.partial(Client, HANDLERS)
    renderer.ALL_TERMS, renderer.WARM_UP = (1, 32), 1
    sys.exit(renderer.main())
