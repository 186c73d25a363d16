"""The judges of the rooms in small: `python -m assets.scripts.judges [FOLDER] [ROOM ...]`.

Path-traced pictures of 48 × 36 pixels, with direct light alone (ROOM_1.exr) and with the scene's bounces (ROOM_4.exr),
as the tests keep them; the noise of each is told.
"""

from __future__ import annotations

import sys
from pathlib import Path

from app.measure.rooms import ROOMS
from app.project import open_project
from app.stills import render_picture, write_picture
from engine.indirect.series import BounceSeries
from engine.render.still import StillProgress

RESOLUTION = 48, 36
SAMPLES = {1: 8192, 4: 4096}
# Thirteen lamps that are drawn by power are noisy: 0.5 % with so many.
MORE_SAMPLES = {("stairwell", 1): 65_536}


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tests/golden/rooms")
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or ROOMS:
        for n_bounces, n_samples in SAMPLES.items():
            project, steps = open_project(name, RESOLUTION), list[StillProgress]()
            picture = render_picture(
                project,
                steps.append,
                reference=True,
                series=BounceSeries(n_bounces),
                n_samples=MORE_SAMPLES.get((name, n_bounces), n_samples),
            )
            write_picture(folder / f"{name}_{n_bounces}.exr", picture)
            print(f"{name}_{n_bounces}.exr: noise {steps[-1].noise:.2%}", flush=True)


if __name__ == "__main__":
    main()
