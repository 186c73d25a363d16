"""The small references of the rooms: `python -m benchmarks.room_references [FOLDER] [ROOM ...]`.

Path-traced pictures of 48 × 36 pixels, with direct light alone (ROOM_1.exr) and with the scene's bounces (ROOM_4.exr),
and of the storeroom's balls through a window (BALL_1.exr, BALL_2.exr), as the tests keep them; prints their noise.
"""

from __future__ import annotations

import sys
from pathlib import Path

from app.project.project import Project, open_project
from app.stills.stills import render_picture, write_picture
from benchmarks.gloss import BALLS, ball_in_view
from benchmarks.rooms import ROOMS
from engine.core.generators import StillProgress
from engine.precompute.indirect.sampling_settings import BounceSeries

RESOLUTION = 48, 36
SAMPLES = {1: 8192, 4: 4096}
# Thirteen lamps that are drawn by power are noisy: 0.5 % with so many.
MORE_SAMPLES = {("stairwell", 1): 65_536}
BALL_SAMPLES = {1: 16_384, 2: 12_288}


def judge(file: Path, project: Project, n_bounces: int, n_samples: int) -> None:
    """Trace one picture into a file, and tell its noise."""
    steps, series = list[StillProgress](), BounceSeries(n_bounces)
    picture = render_picture(project, steps.append, reference=True, series=series, n_samples=n_samples)
    write_picture(file, picture)
    print(f"{file.name}: noise {steps[-1].noise:.2%}", flush=True)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tests/golden/rooms")
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or (*ROOMS, *BALLS):
        if name in BALLS:
            for n_bounces, n_samples in BALL_SAMPLES.items():
                file = folder / f"{name.replace(' ', '_')}_{n_bounces}.exr"
                judge(file, ball_in_view(name), n_bounces, n_samples)
            continue
        for n_bounces, n_samples in SAMPLES.items():
            n_samples = MORE_SAMPLES.get((name, n_bounces), n_samples)
            judge(folder / f"{name}_{n_bounces}.exr", open_project(name, RESOLUTION), n_bounces, n_samples)


if __name__ == "__main__":
    main()
