"""The environment as the window shows it, behind the scene and as a thumbnail, read by a thread of its own.

Reading an EXR takes longer than a frame may; meanwhile the old picture stays. The worker reads the file again for the
light itself: the window's copy is only looked at.
"""

from __future__ import annotations

import re
import struct
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.document import CONSTANT_ENVIRONMENT, SCENE_ENVIRONMENT, LightState
from engine.errors import InsituError
from engine.light.environment import (
    Environment,
    constant_environment,
    downsampled,
    load_environment,
    tone_mapped_thumbnail,
)
from engine.scene.description import EnvironmentDescription

BACKGROUND_HEIGHT = 1024
THUMBNAIL_WIDTH = 512
HEADER_BYTES = 8192


@dataclass(frozen=True)
class EnvironmentSource:
    """Where the environment's picture comes from: a file, or one radiance; neither is black. `scale` multiplies it."""

    file: Path | None = None
    mapping: str = "latlong"
    radiance: tuple[float, float, float] | None = None
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class EnvironmentImage:
    """`radiance` (H,W,3) linear, for the background; `thumbnail` (h,w,3) sRGB bytes."""

    radiance: NDArray[np.float32]
    thumbnail: NDArray[np.uint8]


def source_of(
    light: LightState, scene: EnvironmentDescription | None, scene_folder: Path, builtin: dict[str, Path]
) -> EnvironmentSource:
    """Which picture shows a document's light: built-in, file, even, or what the scene's own file says."""
    if light.environment == CONSTANT_ENVIRONMENT:
        return EnvironmentSource(radiance=light.radiance)
    if light.environment in builtin:
        return EnvironmentSource(builtin[light.environment])
    if light.environment != SCENE_ENVIRONMENT:
        return EnvironmentSource(Path(light.environment), light.mapping)
    if scene is None:
        return EnvironmentSource()
    if scene.file is not None:
        return EnvironmentSource(scene_folder / scene.file, scene.mapping, scale=scene.scale)
    return EnvironmentSource(radiance=scene.radiance, scale=scene.scale)


def load_image(source: EnvironmentSource) -> EnvironmentImage | None:
    """Read and shrink the environment; None for a black one. Raises LoadError."""
    if source.file is None and (source.radiance is None or not any(source.radiance)):
        return None
    environment = _environment(source)
    scaled = Environment(environment.radiance * np.float32(source.scale), environment.source)
    small = downsampled(scaled, min(BACKGROUND_HEIGHT, scaled.radiance.shape[0]))
    return EnvironmentImage(small.radiance, tone_mapped_thumbnail(small, THUMBNAIL_WIDTH))


def _environment(source: EnvironmentSource) -> Environment:
    if source.file is None:
        assert source.radiance is not None
        return constant_environment(source.radiance)
    return load_environment(source.file, "angular" if source.mapping == "angular" else "latlong")


class EnvironmentLoader:
    """Loads the picture of the light asked for last, one at a time."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="environment")
        self._asked: EnvironmentSource | None = None
        self._future: Future[EnvironmentImage | None] | None = None

    def want(self, source: EnvironmentSource) -> None:
        """Have this picture loaded unless it was the last one asked for."""
        if source != self._asked:
            self._asked = source
            self._future = self._threads.submit(load_image, source)

    def forget(self) -> None:
        """Load anew what will be asked for next: whoever showed the last picture has lost it."""
        self._asked = self._future = None

    @property
    def loading(self) -> bool:
        """Whether a picture is still on its way."""
        return self._future is not None

    def take(self) -> tuple[bool, EnvironmentImage | None, str]:
        """(whether a load ended since the last call, its picture, what went wrong or "")."""
        if self._future is None or not self._future.done():
            return False, None, ""
        future, self._future = self._future, None
        try:
            return True, future.result(), ""
        except (InsituError, OSError, MemoryError) as error:
            return True, None, str(error)

    def close(self) -> None:
        """Let the thread end after what it reads now."""
        self._threads.shutdown(wait=False, cancel_futures=True)


def looks_angular(file: Path) -> bool:
    """Whether a light probe is square, as angular maps are, by its header alone; False where that cannot be told."""
    try:
        with file.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError:
        return False
    window = re.search(rb"dataWindow\x00box2i\x00\x10\x00\x00\x00(.{16})", head, re.DOTALL)
    if window is not None:
        left, top, right, bottom = struct.unpack("<4i", window.group(1))
        return bool(right - left == bottom - top)
    size = re.search(rb"\n[-+]Y (\d+) [-+]X (\d+)\n", head)
    return size is not None and size.group(1) == size.group(2)
