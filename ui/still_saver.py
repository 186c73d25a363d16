"""Saves the picture on screen, without the window's interface, to a file, in a thread of its own.

The GPU is read at once, so that the file has what the user saw; encoding takes longer than a frame has.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.system.atomic import save_file
from engine.core.errors import InsituError
from engine.render.picture_files import deep_png, exr_bytes, pixels_png


@dataclass(frozen=True)
class ViewportStill:
    """One picture at the scene's resolution.

    shown: (H,W,3) in the screen's values, sRGB; radiance: (H,W,3) linear, including the light's intensity, without
    exposure and tone mapping.
    """

    shown: NDArray[np.float32]
    radiance: NDArray[np.float32]

    def encoded(self, ending: str, deep: bool) -> bytes:
        """The bytes of a file: ".exr" linear, 32 bits; ".png" as shown, 8 bits or `deep` 16."""
        if ending == ".exr":
            return exr_bytes(np.nan_to_num(self.radiance, posinf=0.0, neginf=0.0))  # black, as on screen
        return deep_png(self.shown) if deep else pixels_png(np.round(255.0 * self.shown).astype(np.uint8))


class StillSaver:
    """Saves pictures one after the other; their results are collected between frames."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="still")
        self._pending: list[Future[tuple[str, bool]]] = []

    def save(self, still: ViewportStill, path: Path, deep: bool, remark: str = "") -> None:
        """Begin to write a picture; a remark is added to the message when it is written."""
        self._pending.append(self._thread.submit(_save, still, path, deep, remark))

    def finished_messages(self) -> list[tuple[str, bool]]:
        """A line for the user for each that has ended, and whether it failed."""
        ended = [future for future in self._pending if future.done()]
        self._pending = [future for future in self._pending if not future.done()]
        return [future.result() for future in ended]

    def close(self) -> None:
        """Wait until all are written."""
        self._thread.shutdown(wait=True)


def _save(still: ViewportStill, path: Path, deep: bool, remark: str) -> tuple[str, bool]:
    try:
        save_file(path, still.encoded(path.suffix.lower(), deep))
    except (InsituError, ValueError, MemoryError) as error:
        return f"{error}", True
    return f"saved {path}{remark}", False
