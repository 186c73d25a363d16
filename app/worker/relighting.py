"""Lights a scene anew at once: rows over a lighting basis for each layer, made when there is nothing else to do.

They hold for the layers' materials as they are: when one changes, that layer's are made again, and until then a dragged
light gets the quick picture. The basis was chosen for the sky at the time; another sky makes them anew in the end.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.document import LightState
from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import Response
from app.modes.placement.desired_state import brightening_factors
from app.system.memory import available_memory
from app.worker.layer_data import LayerData, LightingState
from engine.light.environment import Environment
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.precompute.direct.relight import (
    LightRows,
    RowMaker,
    joined_rows,
    light_coefficients,
    sky_likeness,
    turning_effects,
)

Steps = Iterator[Response | None]
MOST_BYTES = 256e6
# Of the free memory.
SHARE_OF_MEMORY = 0.25


@dataclass(frozen=True, eq=False)
class _LayerRows:
    """A layer's rows, for its material then, and what its exact picture (p, 3) adds to them under a light."""

    work: LayerState
    maker: RowMaker
    rows: LightRows
    rest: NDArray[np.float32] | None = None
    lit_by: LightingState | None = None

    def is_of(self, work: LayerState) -> bool:
        """Whether the work reflects the same."""
        mine, theirs = self.work, work
        if mine.layer == theirs.layer:
            return True
        alike = mine.quotient == theirs.quotient and len(mine.coefficients) == len(theirs.coefficients)
        return alike and all(map(np.array_equal, mine.coefficients, theirs.coefficients))


class Relighting:
    """The rows of the open picture."""

    def __init__(self) -> None:
        self._ready: dict[str, _LayerRows] = {}
        self._maker: RowMaker | None = None
        self._made_under: tuple[Environment, float] | None = None
        self._compared_under: SkyState | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of the rows and what is stored with them."""
        rests = (0 if each.rest is None else each.rest.nbytes for each in self._ready.values())
        return sum(each.rows.n_bytes for each in self._ready.values()) + sum(rests)

    # -------------------------------------------------------------------------------------------------------- preparing

    def prepare(
        self, placement: Placement, scene: SceneState, sky: SkyState, current: Mapping[str, LayerData]
    ) -> Steps:
        """Make the rows that the layers lack, and compare them with their final pictures."""
        pictures = {key: data for key, data in current.items() if data.stage == FINAL.name}
        works = [work for work in scene.layers if work.key in pictures]
        if sky.environment is None or not placement.sphere.done.all() or not works:
            return
        rows_of = {work.key: placement.rows_of(placement.scene.object_index(work.object)) for work in works}
        maker = yield from self._maker_for(placement, sky.environment, sky.scale, works, rows_of)
        self._ready = {work.key: self._ready[work.key] for work in works if work.key in self._ready}
        light, self._compared_under = self.light_of(sky), sky
        for work in works:
            ready = self._ready.get(work.key)
            if ready is None or ready.maker is not maker or not ready.is_of(work):
                self._ready.pop(work.key, None)  # memory for one at a time
                tiles = []
                for tile in maker.rows(work.layer, rows_of[work.key]):
                    tiles.append(tile)
                    yield None
                ready = _LayerRows(work, maker, joined_rows(tiles))
            data = pictures[work.key]
            data = data.with_curves(work) if data.fits_curves(work) else data
            rest = data.radiance - ready.rows.lit(light) if data.lit_by.light == scene.light else None
            self._ready[work.key] = replace(ready, rest=rest, lit_by=data.lit_by)
            yield None

    def _maker_for(
        self, placement: Placement, environment: Environment, scale: float, works: list[LayerState],
        rows_of: Mapping[str, NDArray[np.integer]],
    ) -> Generator[None, None, RowMaker]:  # fmt: skip
        """The row maker for this sky."""
        if self._maker is None or self._made_under != (environment, scale):
            effects = yield from turning_effects(environment, scale)
            all_of_it = RowMaker(placement.hits, placement.sphere, effects)
            room = min(MOST_BYTES, SHARE_OF_MEMORY * available_memory())
            self._maker = all_of_it.rows_within([(work.layer, rows_of[work.key]) for work in works], room)
            self._made_under = environment, scale
        return self._maker

    # ------------------------------------------------------------------------------------------------------- relighting

    def takes(self, work: LayerState, lit_by: LightingState) -> bool:
        """Whether a layer can be relit: its material is that of its rows, and emitters are as they were, or all of them
        brighter by one factor."""
        ready = self._ready.get(work.key)
        if ready is None or not ready.is_of(work) or ready.rest is None or ready.lit_by is None:
            return False
        return _emitter_factors(lit_by, ready.lit_by) is not None

    def light_of(self, sky: SkyState) -> NDArray[np.float32]:
        """A sky's coefficients in the rows' basis."""
        if sky.environment is None:
            return np.zeros((1, 3), np.float32)
        return light_coefficients(sky.environment, sky.rotation, sky.scale)

    def likeness(self, sky: SkyState) -> NDArray[np.float32]:
        """How far a sky (3,) is still like the one that the exact pictures were made under, see `sky_likeness`."""
        return sky_likeness(sky, self._compared_under or sky)

    def picture(
        self, work: LayerState, lit_by: LightingState, light: NDArray[np.float32], likeness: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """The radiance (p, 3) of a relit layer, from what `light_of` and `likeness` find of the sky.

        It adds to the rows' radiance what the exact picture had more under the light before: of emitters, in proportion
        to their radiance; without emitters what is finer than the basis, as far as the sky is still like that one, for
        under another sky it is the ghost of a sun that has moved on.
        """
        ready = self._ready[work.key]
        radiance = ready.rows.lit(light)
        assert ready.rest is not None and ready.lit_by is not None
        if lit_by.emission or _source(lit_by.light) == _source(ready.lit_by.light):
            factors = _emitter_factors(lit_by, ready.lit_by) if lit_by.emission else likeness
            assert factors is not None
            radiance += ready.rest * factors.astype(np.float32)
        return np.maximum(radiance, 0.0)


def _source(light: LightState) -> LightState:
    return replace(light, rotation=0.0)


def _emitter_factors(now: LightingState, then: LightingState) -> NDArray[np.float64] | None:
    """The factors (3,) by which all emitters are brighter; None where they are not the same for all."""
    return np.ones(3) if now.emission == then.emission else brightening_factors(now.emission, then.emission)
