"""Handlers for the tests: what a request's text says, they do; among it everything a worker can die of."""

import os
import resource
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from app.messages.worker_messages import OpenScene, Progress, Request, Response, SceneOpened, SetCamera, ViewTraced
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    LayerPicture,
    LayerTransport,
    StageDone,
)
from app.worker import channel
from app.worker.cache import ArrayCache
from engine.core.errors import LoadError
from engine.settings import RenderSettings

HANDLERS = "tests.app.worker.faulty_tasks:FaultyTasks"


def picture(index: int, n_pixels: int = 4096) -> np.ndarray:
    """A picture of 48 KiB that says which one it is."""
    return np.full((n_pixels, 3), index, np.float32)


def compute(text: str, **numbers: int) -> ComputeTransport:
    """A request whose `selected` tells FaultyTasks what to do."""
    return ComputeTransport(None, text, None, 8, RenderSettings(64, 20), **numbers)


# Stands for a frame: 40 KiB of it.
PIXELS = {"pixel": np.arange(10_000, dtype=np.int32)}


class Unimportable:
    """Handlers that cannot be made."""

    def __init__(self) -> None:
        raise RuntimeError("no such library")


class FaultyTasks:
    """OpenScene.source and ComputeTransport.selected are `verb` or `verb argument`: a method of this class.

    A contraction has an array for a layer."""

    def handle(self, request: Request) -> Iterator[Response | None]:
        if isinstance(request, ContractTransport):
            return self._contract(request)
        if isinstance(request, SetCamera):
            return self._look()
        text = request.source if isinstance(request, OpenScene) else request.selected
        verb, _, argument = text.partition(" ")
        action: Callable[[str], Iterator[Response | None]] = getattr(self, verb)
        return action(argument)

    def _contract(self, request: ContractTransport) -> Iterator[Response | None]:
        values = request.layer
        yield LayerTransport("ball.0", request.factor, "exact", values, np.ones((1, 3)), np.float64(values.sum()))

    def open(self, argument: str) -> Iterator[Response | None]:
        yield None
        yield SceneOpened(argument)

    def _look(self) -> Iterator[Response | None]:
        yield ViewTraced(PIXELS)

    def pictures(self, argument: str) -> Iterator[Response | None]:
        """So many pictures, one a step."""
        for index in range(int(argument)):
            yield LayerPicture("ball.0", "preview", picture(index), ())
        yield StageDone("preview", True, 0.0)

    def forever(self, argument: str) -> Iterator[Response | None]:
        """Small steps until cancelled; the closing is noted in the file `argument`."""
        try:
            while True:
                yield Progress("visibility", 0.5)
                time.sleep(0.002)
        finally:
            if argument:
                Path(argument).write_text("closed")

    def tiles(self, argument: str) -> Iterator[Response | None]:
        """Eight tiles that are kept; tells of each one that it had to compute, slowly after the third."""
        with ArrayCache().open_tiles(argument, 8) as tiles:
            for index in sorted(set(range(8)) - tiles.complete_tiles):
                tiles.append_tile(index, {"v": np.full(100, index)})
                yield Progress("tiles", index / 8)
                if index == 2:
                    time.sleep(60)
        yield StageDone("tiles", True, 0.0)

    def flood(self, argument: str) -> Iterator[Response | None]:
        """Long texts, so that the socket is full in the middle of a message."""
        while True:
            yield Progress("flood", 0.0, None, "x" * 50_000)

    def damaged(self, argument: str) -> Iterator[Response | None]:
        """A block that is not what its message announces, the first time (the file `argument` remembers)."""
        if not Path(argument).exists():
            Path(argument).touch()
            good = channel.create_block
            channel.create_block = lambda buffers, generation, method: good(buffers, generation + 1, method)
        yield LayerPicture("ball.0", "preview", picture(1), ())

    def sleep(self, argument: str) -> Iterator[Response | None]:
        """One step that is much too long."""
        yield Progress("sleep", 0.0)
        time.sleep(float(argument))

    def load_error(self, argument: str) -> Iterator[Response | None]:
        raise LoadError("a.ply", "vertex 3", "nan", "finite numbers")
        yield

    def bug(self, argument: str) -> Iterator[Response | None]:
        yield Progress("bug", 0.0)
        raise ValueError("two\nlines")

    def die(self, argument: str) -> Iterator[Response | None]:
        """Each time it is asked."""
        yield Progress("die", 0.0)
        os.kill(os.getpid(), signal.SIGKILL)

    def out_of_memory(self, argument: str) -> Iterator[Response | None]:
        yield Progress("memory", 0.0)
        before = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (2 << 30, before[1]))
        try:
            np.zeros(4 << 30, np.uint8)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, before)

    def no_room(self, argument: str) -> Iterator[Response | None]:
        """A result for which no shared block can be made."""
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, before[1]))
        try:
            yield LayerPicture("ball.0", "preview", picture(0, 100_000), ())
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
