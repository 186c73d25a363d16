"""Milestones of a launch, and the longest time that its thread was blocked: written to a file for `make measure`.

The environment variable `INSITU_TIMES` names the file; without it nothing is written. Times are of the system's steady
clock, which all processes of a machine share, so that the launching process can subtract its own.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path

from app.messages.editor_status import Status
from app.system.atomic import replacing

TIMES_VARIABLE = "INSITU_TIMES"


class LaunchTimes:
    """The milestones of one start, and the longest block while the worker streams.

    first_frame; scene (opened); first_layer (something is shaded); first_picture (every layer is, if coarsely); exact.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._content: dict[str, float] = {}

    def blocked(self, seconds: float, streaming: bool) -> None:
        """Note that the window's thread was busy for so long; it counts while the worker has a scene to stream."""
        if streaming:
            self._content["longest_block_s"] = max(self._content.get("longest_block_s", 0.0), seconds)

    def frame_shown(self, scene_is_open: bool, status: Status) -> None:
        """Note that a frame is on screen, and which milestones it is the first to show."""
        reached = {
            "first_frame": True,
            "scene": scene_is_open,
            "first_layer": status.picture != "waiting",
            "first_picture": status.picture != "waiting" and status.precomputed_mb > 0.0,
            "exact": status.is_finished,
        }
        news = [name for name, is_so in reached.items() if is_so and name not in self._content]
        if news:
            now = time.monotonic()
            self._content |= dict.fromkeys(news, now)
            with replacing(self._file, durable=False) as file:
                file.write(json.dumps(self._content).encode())


def launch_times_from(environment: Mapping[str, str] = os.environ) -> LaunchTimes | None:
    """The object that notes the times, where the variable is set."""
    file = environment.get(TIMES_VARIABLE)
    return LaunchTimes(Path(file)) if file else None
