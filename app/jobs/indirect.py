"""The worker's share of indirect light: found once for scene and camera, lit anew, frozen for what is being edited.

Found roughly after the first picture, finely after the last stage of the direct light, so that a person waits for
neither; where the rays of a fine one are still there, another light lights their cells anew, at once, and what glossy
surfaces send goes by albedo until the end. Fine light is kept on disk, where a scene that is opened again, or a worker
after one that died, finds it with the first picture; while it is being found its finished parts are, from which either
goes on.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.jobs.array_record import Arrays, RecordError
from app.jobs.cache import Store, content_key
from app.jobs.messages import (
    BouncesPlanned,
    Freeze,
    Frozen,
    IndirectFound,
    IndirectNoise,
    LayerReflection,
    Progress,
    Response,
)
from app.jobs.tiles import Tiles
from engine.indirect.albedo import albedo_bands, albedo_of, tint_of
from engine.indirect.curves import LayerCurves
from engine.indirect.irradiance import NOBODY
from engine.indirect.layers import IndirectLayer, albedos_of
from engine.indirect.light import IndirectLight
from engine.indirect.representation import GatherPolynomial, Selected
from engine.indirect.solver import FINE, ROUGH, Fineness, Solver, relit
from engine.indirect.stored import NAMES, arrays_of
from engine.material import MODELS
from engine.render.bounces import planned_bounces
from engine.transport.pipeline import Placement, SkyState

Steps = Iterator[Response | None]
# Raised when anything changes the numbers in what is kept on disk.
STORED_VERSION = 2
MOST_PARTS = 1024


@dataclass(frozen=True, eq=False)
class _Found:
    """Indirect light, what its rays and what its irradiance were found for."""

    light: IndirectLight
    fineness: Fineness
    models: tuple[tuple[str, str], ...]
    lit_by: str
    depth: int  # bounces that the rays were found for
    number: int


class _KeptParts:
    """The finished parts of light that is being found, as the solver keeps them."""

    def __init__(self, tiles: Tiles) -> None:
        self._tiles = tiles

    def part(self, index: int) -> Arrays | None:
        if index not in self._tiles.complete_tiles:
            return None
        try:
            return self._tiles.tile(index)
        except (OSError, RecordError):  # sound when the file was opened: found anew
            return None

    def keep(self, index: int, arrays: Arrays) -> None:
        if index < MOST_PARTS:
            self._tiles.append_tile(index, arrays)


class IndirectTasks:
    """Indirect light of the scene that is open, and the freezing that was asked for last."""

    def __init__(self, placement: Placement, store: Store | None = None, scene_key: str = "") -> None:
        """store: where fine light is kept for the next time, under keys of the scene; None for nowhere."""
        self._placement, self._store, self._scene_key = placement, store, scene_key
        self._names = [described.name for described in placement.scene.description.objects]
        self._found: _Found | None = None
        self._wish: Freeze | None = None
        self._noise_told = 0
        self._kept: GatherPolynomial | None = None
        self._number = 0

    @property
    def n_bytes(self) -> int:
        """Memory of what was found, and of what freezings keep."""
        kept = 0 if self._kept is None else self._kept.n_bytes
        return kept + (0 if self._found is None else self._found.light.n_bytes)

    def forget_wish(self) -> None:
        """Another transport was asked for: its freezing comes after it."""
        self._wish = None

    def planned(self, looks: Sequence[LayerReflection]) -> BouncesPlanned:
        """How many bounces the scene requires with its layers as they look."""
        albedos = albedos_of([self._layer(look) for look in looks], len(self._names))
        return BouncesPlanned(*planned_bounces(self._placement, albedos))

    def find(
        self, looks: Sequence[LayerReflection], sky: SkyState, lit_by: str, n_bounces: int, is_last: bool
    ) -> Steps:
        """What a stage of the direct light calls for: `is_last` all that can be had, else what can be had at once.

        lit_by: a key of the light.
        """
        models = tuple((look.key, look.model) for look in looks)
        found = self._found
        same_rays = found is not None and found.models == models and found.depth >= n_bounces
        finest = found is not None and found.fineness is FINE and found.light.points.glossy
        if found is not None and same_rays and (finest or not is_last):
            if (found.lit_by, found.light.n_bounces) == (lit_by, n_bounces):
                yield self._where(found)
                return
            yield Progress("indirect light", 0.0, text="light on surfaces")
            light = relit(found.light, self._placement, sky, found.fineness, n_bounces)
            yield from self._hold(replace(found, light=light, lit_by=lit_by))
            return
        kept, key = self._kept_on_disk(models, lit_by, n_bounces)
        fineness = FINE if is_last or kept is not None else ROUGH
        of_object: dict[int, list[str]] = {}
        for look in looks:
            of_object.setdefault(self._object(look.key), []).append(look.model)
        solver = Solver(self._placement, of_object, sky, n_bounces, fineness)
        if kept is not None:
            yield from self._hold(_Found(solver.restored(kept), fineness, models, lit_by, n_bounces, 0))
            return
        layers = [self._layer(look) for look in looks]
        if self._store is None or fineness is not FINE:
            light = yield from _told(solver.solve(layers))
            yield from self._hold(_Found(light, fineness, models, lit_by, n_bounces, 0))
            return
        with self._store.open_tiles(key, MOST_PARTS) as tiles:
            light = yield from _told(solver.solve(layers, _KeptParts(tiles)))
            yield from self._hold(_Found(light, fineness, models, lit_by, n_bounces, 0))
            if self._store.put(key, arrays_of(light)):
                tiles.finish()

    def _kept_on_disk(
        self, models: tuple[tuple[str, str], ...], lit_by: str, n_bounces: int
    ) -> tuple[dict[str, NDArray[np.generic]] | None, str]:
        """Fine light that was found before, if it is kept, and its key. The curves that decided where it is finest do
        not count: within a session they do not either."""
        key = content_key("indirect", STORED_VERSION, NAMES, self._scene_key, models, lit_by, n_bounces, repr(FINE))
        return (None if self._store is None else self._store.get(key)), key

    def freeze(self, request: Freeze) -> Steps:
        """The answer, if there is anything to answer with; it is given again when there is something finer."""
        self._wish = request
        if self._found is not None:
            yield from self._frozen(self._found, request)
            yield from self._noise(self._found, request)

    def _hold(self, found: _Found) -> Steps:
        self._number += 1
        self._kept = self._kept.under(found.light) if self._kept is not None else GatherPolynomial(found.light)
        self._found = found = replace(found, number=self._number)
        yield self._where(found)
        if self._wish is not None:
            yield from self._frozen(found, self._wish)
            yield from self._noise(found, self._wish)

    def _where(self, found: _Found) -> IndirectFound:
        rows, weights = found.light.footprint_by_object()
        return IndirectFound(found.number, found.fineness.name, rows, weights)

    def _frozen(self, found: _Found, wish: Freeze) -> Steps:
        edited = NOBODY if wish.key is None else self._object(wish.key)
        layers = {look.key: self._layer(look) for look in wish.looks}
        seen = found.light.by_albedo() if wish.by_albedo else found.light
        self._kept = GatherPolynomial(seen) if self._kept is None else self._kept.under(seen)
        selected = None
        if wish.key in layers and wish.factor is not None:
            selected = Selected(list(layers).index(wish.key), wish.factor)
        frozen = yield from self._kept.freeze(list(layers.values()), edited, selected)
        keys = list(layers)
        reflected = {keys[i]: np.ascontiguousarray(part.transpose(1, 0, 2)) for i, part in frozen.reflected.items()}
        albedos = {
            look.key: albedo_bands(look.model, look.quotient_parameters, tuple(map(len, look.coefficients)))
            for look in wish.looks if self._object(look.key) == edited
        }  # fmt: skip
        yield Frozen(found.number, wish.serial, wish.key, wish.factor, reflected, frozen.bands, albedos)

    def _noise(self, found: _Found, wish: Freeze) -> Steps:
        """Once for each light that is found: curves change it little."""
        if found.number == self._noise_told:
            return
        light = found.light.by_albedo() if wish.by_albedo else found.light
        steps = light.noise([self._layer(look) for look in wish.looks])
        while True:
            try:
                yield next(steps)
            except StopIteration as end:
                self._noise_told = found.number
                yield IndirectNoise(found.number, end.value)
                return

    def _layer(self, look: LayerReflection) -> IndirectLayer:
        curves, sent = (
            tuple(np.asarray(values, np.float64) for values in all_values)
            for all_values in (look.coefficients, look.sent)
        )
        e = albedo_bands(look.model, look.quotient_parameters, tuple(map(len, curves)))
        gain, view = np.asarray(look.gain, np.float64), np.asarray(look.view_curve, np.float64)
        tint = tint_of(look.model, look.quotient_parameters, curves, view)
        seen_as, sent_as = (
            LayerCurves(MODELS[look.model], np.array(look.quotient_parameters), each, tint) for each in (curves, sent)
        )
        albedo = albedo_of(e, curves, gain, view)
        return IndirectLayer(self._object(look.key), seen_as, sent_as, gain, view, albedo)

    def _object(self, key: str) -> int:
        return self._names.index(key.rpartition(".")[0])


def _told(steps: Generator[tuple[float, str], None, IndirectLight]) -> Generator[Response | None, None, IndirectLight]:
    """The steps of a solver as progress."""
    while True:
        try:
            fraction, text = next(steps)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        yield Progress("indirect light", fraction, text=text)
