"""Shadow catchers in the pictures of Orbit and Deform: the engine of a mode draws them alone as well, beside all.

That has catchers and what emits, and stays while other objects are edited, moved and bent. Until it is lit, pictures
show catchers as objects. What it draws costs a picture more: `app.stills.shadow_catcher` has the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.document.shadow_catchers import CatchersAlone
from engine.core.generators import StillProgress
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.picture_parts import parts_of
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.scene_loader import Scene

if TYPE_CHECKING:
    from app.worker.tasks import WorkerContext
    from engine.scene.description import CameraDescription

Float32Array = NDArray[np.float32]


class Engine(Protocol):
    """What Orbit and Deform have in common."""

    scene: Scene
    version: int

    @property
    def is_ready(self) -> bool: ...

    @property
    def is_done(self) -> bool: ...

    @property
    def n_bytes(self) -> int: ...

    def work(self) -> Iterator[StillProgress]: ...


Drawing = TypeVar("Drawing", bound=Engine)


class CatcherEngine(Generic[Drawing]):
    """The engine of catchers alone. make: one for a scene, with some effort. engine: None without catchers."""

    def __init__(self, context: WorkerContext, make: Callable[..., Drawing]) -> None:
        self._context, self._make = context, make
        self.alone: CatchersAlone | None = None
        self.engine: Drawing | None = None
        self.sky = SkyState(None)
        self._effort: tuple[int, ...] = ()
        self._made_of: tuple[object, ...] = ()

    def forget(self) -> None:
        """Another scene is open."""
        self.alone, self.engine, self._made_of = None, None, ()

    def desire(self, alone: CatchersAlone | None, effort: tuple[int, ...] = ()) -> None:
        """Draw these alone from now on, None: none; effort: with which the engine is made. Raises InsituError."""
        if (alone, effort) == (self.alone, self._effort):
            return
        if alone is None:
            self.forget()
            return
        document = alone.document
        made_of = (document.composition, document.poses, document.new_opacities, document.new_bumps, effort)
        if self.engine is None or made_of != self._made_of:
            self.engine, self._made_of = self._make(self._context.scene_of(document), *effort), made_of
        self.sky = self._context.sky_over(self.engine.scene, alone.scene.light)
        self.alone, self._effort = alone, effort  # what could not be read is tried again

    @property
    def ready(self) -> Drawing | None:
        """The engine where its pictures show more than black."""
        return self.engine if self.engine is not None and self.engine.is_ready else None

    @property
    def version(self) -> int:
        """Pictures differ from those of a lower one."""
        return 0 if self.ready is None else self.ready.version

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to be done."""
        return self.engine is None or self.engine.is_done

    @property
    def n_bytes(self) -> int:
        return 0 if self.engine is None else self.engine.n_bytes

    def working(self, whole: Drawing, stage: Callable[[Drawing], int]) -> Iterator[StillProgress]:
        """Do the work of the engine of all and of this one, what shows most first. stage: how far an engine has come;
        the one of all goes first into each."""
        working, own = whole.work(), None if self.engine is None else self.engine.work()
        ended = object()
        while own is not None:
            assert self.engine is not None
            goes_ahead = stage(whole) <= stage(self.engine)
            step = next(working if goes_ahead else own, ended)
            if step is not ended:
                yield step  # type: ignore[misc]
            elif goes_ahead:
                yield from own
                return
            else:
                own = None
        yield from working

    def objects_in(self, scene: Scene) -> tuple[int, ...]:
        """The catchers, by their indices in a scene."""
        names = () if self.alone is None else self.alone.document.shadow_catchers
        return tuple(i for i, name in enumerate(scene.object_names) if name in names)


Draw = Callable[[Drawing, Collection[int]], Generator[StillProgress, None, Float32Array]]


def draw_caught(
    whole: Drawing, catchers: CatcherEngine[Drawing], draw: Draw[Drawing], camera: CameraDescription,
    transparent: bool, poses: Poses,
) -> Generator[StillProgress, None, tuple[Float32Array, bool]]:  # fmt: skip
    """A picture, (H, W, 3) or with alpha (H, W, 4), and whether it shows shadows in place of their catchers. draw: by
    an engine, with the part of some objects apart; transparent: without the environment; poses: of all
    objects, which are shown as objects where these are no longer those that are drawn alone."""
    alone = catchers.ready
    if alone is None or catchers.alone is None or not catchers.alone.is_in(poses):
        return (yield from draw(whole, ())), False
    from app.stills.shadow_catcher import caught_shadows, over_sky

    picture, part = parts_of((yield from draw(whole, catchers.objects_in(whole.scene))))
    _, rest = parts_of((yield from draw(alone, catchers.objects_in(alone.scene))))
    if part is not None and rest is not None:
        picture = caught_shadows(picture, part, rest)
        picture = picture if transparent else over_sky(picture, catchers.sky, camera)
    return picture, True
