"""What workers of a cluster do: open the project that an errand names, from the files that came with it, and work.

A worker keeps what it has opened last, so that the tasks of one scene open it once. It does one task at a time, which
takes all the cores that its process may run on.
"""

from __future__ import annotations

import contextlib
import platform
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.cluster.parcel import Parcel
from app.cluster.program import other_program, program_digest
from app.cluster.shelf import Shelf, fetched
from app.jobs.cache import Store
from app.messages import SetCamera, OpenScene
from app.scene_state import LayerState, SceneState
from engine.errors import InsituError
from engine.safe_files import redirect_files
from engine.stored_arrays import Arrays
from engine.transport.bandstore import BandTile
from engine.transport.pipeline import Quality
from engine.transport.projection import LayerShape, VisibleLight, project_layer

if TYPE_CHECKING:
    import numpy as np

    from app.frame_sequence import Drawer, Frames, Picture
    from app.jobs.bench import Bench
    from app.project import ProjectSpec

_alone = threading.Lock()
_kept: dict[str, object] = {}
_places_of: dict[str, dict[str, Path]] = {}
Kept = TypeVar("Kept")


@dataclass(frozen=True)
class Errand:
    """What every task of one command has: a name that no other command has, the files of its scene, and which Insitu it
    is of."""

    name: str
    parcel: Parcel
    program: str


@dataclass(frozen=True)
class FrameErrand(Errand):
    """Frames of a project."""

    words: ProjectSpec
    frames: Frames


@dataclass(frozen=True, eq=False)
class ViewErrand(Errand):
    """One view of a scene, opened as the editor's worker opens it, under the light and the emitters of a document."""

    open: OpenScene
    look: SetCamera
    scene: SceneState


def draw_frame(errand: FrameErrand, i: int) -> Picture:
    """Frame i: linear radiance (H, W, 3)."""
    with _at_work(errand):
        return _opened(errand, lambda: _drawer(errand)).draw(i)


def see_light(errand: ViewErrand, quality: Quality) -> VisibleLight:
    """All the light of a view, and from where it is seen."""
    from engine.generators import run_to_end

    with _at_work(errand):
        bench = _opened(errand, lambda: _bench(errand))
        return run_to_end(bench.open_placement.light(bench.sky(errand.scene.light), quality))


def project_tiles(
    errand: ViewErrand, light: VisibleLight, layer: LayerShape, rows: np.ndarray, begin: int
) -> list[BandTile]:
    """The tiles of some points of a layer that follow each other; `begin`: which of the layer's the first is."""
    with _at_work(errand):
        hits = _opened(errand, lambda: _bench(errand)).open_placement.hits
        return [replace(tile, begin=begin + tile.begin) for tile in project_layer(hits, rows, light, layer)]


def find_indirect(errand: ViewErrand, layers: Sequence[LayerState], lit_by: str, n_bounces: int, n_rays: int) -> Arrays:
    """The fine indirect light of a view, as it is kept on disk."""
    from app.jobs.indirect import IndirectTasks
    from engine.indirect.stored_light import arrays_of

    with _at_work(errand):
        bench = _opened(errand, lambda: _bench(errand))
        tasks = IndirectTasks(bench.open_placement, bench.store, bench.view_key, bench.view_id)
        for _ in tasks.find(layers, bench.sky(errand.scene.light), lit_by, n_bounces, True, n_rays):
            pass
        assert tasks.light is not None
        return arrays_of(tasks.light)


@contextlib.contextmanager
def _at_work(errand: Errand) -> Iterator[None]:
    """One task at a time, with the files of its errand and no others."""
    if errand.program != program_digest():
        raise InsituError(other_program(f"a worker on {platform.node()}"))
    with _alone:
        with redirect_files(_places(errand)):
            yield


def _places(errand: Errand) -> dict[str, Path]:
    """Where this worker has the errand's files; looked for once."""
    if errand.name not in _places_of:
        try:
            found = Shelf().places(errand.parcel, fetched)
        except OSError as error:
            raise InsituError(f"a worker on {platform.node()} cannot keep the scene: {error.strerror}") from error
        _places_of.clear()
        _places_of[errand.name] = found
    return _places_of[errand.name]


def _opened(errand: Errand, make: Callable[[], Kept]) -> Kept:
    """What the newest errand has opened; that of another one is let go first."""
    if errand.name not in _kept:
        _kept.clear()
        _kept[errand.name] = make()
    return _kept[errand.name]  # type: ignore[return-value]


def _drawer(errand: FrameErrand) -> Drawer:
    from app.frame_sequence import drawer_of

    drawer = drawer_of(errand.words.open(), errand.frames)
    drawer.prepare(lambda step: None)
    return drawer


def _bench(errand: ViewErrand) -> Bench:
    """A worker's bench with the view open on it, and the tables of its measured layers read."""
    from app.jobs.measured import ensure_tables
    from app.jobs.tasks import Tasks

    tasks = Tasks(Store(), fills=True)
    for request in (errand.open, errand.look):
        for _ in tasks.handle(request):
            pass
    for _ in ensure_tables((state.layer for state in errand.scene.layers), tasks.bench.store):
        pass
    tasks.bench.open_placement.set_emission(dict(errand.scene.emission))
    return tasks.bench
